//! Matrices in single precision: the border to burn.
//!
//! Rows lie one after another. A clone shares the numbers; writing copies them only while they are
//! shared. Products are burn's, on its CPU backend.

use burn_backend::ops::FloatTensorOps;
use burn_backend::{DType, TensorData};
use burn_flex::{Flex, FlexTensor};
use burn_std::Shape;

/// `[rows, cols]` single-precision numbers.
#[derive(Clone, Debug)]
pub struct Matrix {
    tensor: FlexTensor,
    rows: usize,
    cols: usize,
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
        let tensor = FlexTensor::zeros(Shape::from([rows, cols]), DType::F32);
        Self { tensor, rows, cols }
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
}

fn product(left: FlexTensor, right: FlexTensor, rows: usize, cols: usize) -> Matrix {
    Matrix { tensor: Flex::float_matmul(left, right), rows, cols }
}
