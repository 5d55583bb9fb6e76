//! Matrices in single precision: the border to burn.
//!
//! Rows lie one after another. A clone shares the numbers; writing copies them only while they are
//! shared. Products are burn's, on its CPU backend; those of evaluation are `packed`'s.

use burn_backend::TensorData;
use burn_backend::ops::FloatTensorOps;
use burn_flex::{Flex, FlexTensor, Layout};
use burn_std::Shape;

/// `[rows, cols]` single-precision numbers.
#[derive(Clone, Debug)]
pub struct Matrix {
    tensor: FlexTensor,
    rows: usize,
    cols: usize,
}

/// Stretches of a matrix's numbers that may overlap, as the rows of another matrix.
#[derive(Clone, Copy, Debug)]
pub struct Stretches {
    /// where the first begins among all numbers
    pub first: usize,
    /// numbers from one to the next
    pub step: usize,
    /// how many
    pub rows: usize,
    /// numbers of each
    pub cols: usize,
}

impl Matrix {
    /// From numbers, row after row.
    ///
    /// # Panics
    /// When there are not `rows * cols` numbers.
    pub fn new(rows: usize, cols: usize, values: Vec<f32>) -> Self {
        assert_eq!(values.len(), rows * cols, "{rows} x {cols} matrix");
        let tensor = FlexTensor::from_data(TensorData::new(values, [rows, cols]));
        Self { tensor, rows, cols }
    }

    /// Zeros.
    pub fn zeros(rows: usize, cols: usize) -> Self {
        // Not by burn, which copies them once more to align bytes.
        Self::new(rows, cols, vec![0.0; rows * cols])
    }

    /// Rows.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Numbers per row.
    pub fn cols(&self) -> usize {
        self.cols
    }

    /// All numbers, row after row.
    pub fn values(&self) -> &[f32] {
        self.tensor.storage()
    }

    /// All numbers, to be changed.
    pub fn values_mut(&mut self) -> &mut [f32] {
        self.tensor.storage_mut()
    }

    /// The numbers themselves, without a copy where they are not shared.
    pub fn into_values(self) -> Vec<f32> {
        match self.tensor.into_data().try_into_vec() {
            Ok(values) => values,
            Err(error) => unreachable!("matrices are in single precision: {error}"),
        }
    }

    /// The same numbers as `rows` rows.
    ///
    /// # Panics
    /// When they do not divide into `rows` rows of `cols` numbers.
    pub fn reshaped(self, rows: usize, cols: usize) -> Self {
        assert_eq!(rows * cols, self.rows * self.cols, "{rows} x {cols} matrix");
        let tensor = self.tensor.reshape(Shape::from([rows, cols]));
        Self { tensor, rows, cols }
    }

    /// `self * other`.
    pub fn dot(&self, other: &Self) -> Self {
        product(self.tensor.clone(), other.tensor.clone(), self.rows, other.cols)
    }

    /// `self * other^T`.
    pub fn dot_t(&self, other: &Self) -> Self {
        product(self.tensor.clone(), other.tensor.transpose(0, 1), self.rows, other.rows)
    }

    /// `self^T * other`.
    pub fn t_dot(&self, other: &Self) -> Self {
        product(self.tensor.transpose(0, 1), other.tensor.clone(), self.cols, other.cols)
    }

    /// `self^T * other` over the rows of both from `first` of `self` on.
    pub fn t_dot_from(&self, first: usize, other: &Self) -> Self {
        let rest = self.tensor.narrow(0, first, self.rows - first);
        product(rest.transpose(0, 1), other.tensor.clone(), self.cols, other.cols)
    }

    /// The matrix of these stretches times `other^T`.
    ///
    /// # Panics
    /// When a stretch leaves the matrix.
    pub fn stretches_dot_t(&self, stretches: Stretches, other: &Self) -> Self {
        let left = self.stretches(stretches);
        product(left, other.tensor.transpose(0, 1), stretches.rows, other.rows)
    }

    /// `self^T` times the matrix of these stretches of another.
    ///
    /// # Panics
    /// When a stretch leaves the other matrix.
    pub fn t_dot_stretches(&self, other: &Self, stretches: Stretches) -> Self {
        let left = self.tensor.transpose(0, 1);
        product(left, other.stretches(stretches), self.cols, stretches.cols)
    }

    fn stretches(&self, Stretches { first, step, rows, cols }: Stretches) -> FlexTensor {
        let end = first + rows.saturating_sub(1) * step + cols;
        assert!(end <= self.rows * self.cols, "stretches to {end} of {}", self.rows * self.cols);
        let strides = vec![step as isize, 1];
        self.tensor.clone().with_layout(Layout::new(Shape::from([rows, cols]), strides, first))
    }
}

fn product(left: FlexTensor, right: FlexTensor, rows: usize, cols: usize) -> Matrix {
    Matrix { tensor: Flex::float_matmul(left, right), rows, cols }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stretches_are_the_rows_of_a_product() {
        let numbers = Matrix::new(2, 4, (0..8).map(|v| v as f32).collect());
        let stretches = Stretches { first: 1, step: 2, rows: 3, cols: 3 };
        let gathered = Matrix::new(3, 3, vec![1.0, 2.0, 3.0, 3.0, 4.0, 5.0, 5.0, 6.0, 7.0]);
        let other = Matrix::new(2, 3, vec![1.0, 0.0, -1.0, 2.0, 0.5, 1.0]);
        let found = numbers.stretches_dot_t(stretches, &other);
        assert_eq!(found.values(), gathered.dot_t(&other).values());
        let left = Matrix::new(3, 2, vec![1.0, 2.0, 0.0, 1.0, 3.0, -1.0]);
        let found = left.t_dot_stretches(&numbers, stretches);
        assert_eq!(found.values(), left.t_dot(&gathered).values());
    }

    #[test]
    #[should_panic(expected = "stretches to 10 of 8")]
    fn stretches_stay_within_the_numbers() {
        let stretches = Stretches { first: 1, step: 2, rows: 4, cols: 3 };
        Matrix::zeros(2, 4).stretches_dot_t(stretches, &Matrix::zeros(2, 3));
    }
}
