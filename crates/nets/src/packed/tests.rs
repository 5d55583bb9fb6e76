//! Products of any size, with the same bits for any rows and threads.

use super::*;
use crate::batch::transpose;

fn numbers(n: usize, step: usize) -> Vec<f32> {
    (0..n).map(|i| ((i * step) % 1000) as f32 * 2e-3 - 1.0).collect()
}

#[test]
fn products_are_those_of_burn_for_any_size() {
    for inputs in [1, 3, 40, 129] {
        for outputs in [1, 4, 16, 33, 150] {
            let weight = Matrix::new(outputs, inputs, numbers(inputs * outputs, 7919));
            let mut turned = vec![0.0; inputs * outputs];
            transpose(weight.values(), &mut turned, outputs, inputs);
            let transposed = Matrix::new(inputs, outputs, turned);
            let packed = Packed::new(&weight);
            let bias = numbers(outputs, 31);
            for rows in [1, 2, 3, 4, 5, 6, 7, 13, 400] {
                let values = Matrix::new(rows, inputs, numbers(rows * inputs, 6007));
                let wanted = values.dot(&transposed);
                let found = packed.product(values.values(), Some(&bias));
                let pairs = found.values().iter().zip(wanted.values()).enumerate();
                for (i, (found, wanted)) in pairs {
                    let off = (found - wanted - bias[i % outputs]).abs();
                    assert!(off < 1e-4, "{rows} x {inputs} x {outputs} at {i}: off by {off}");
                }
            }
        }
    }
}

#[test]
fn a_row_has_the_same_bits_whatever_rows_and_threads_there_are() {
    let weight = Matrix::new(70, 55, numbers(70 * 55, 7919));
    let packed = Packed::new(&weight);
    let values = numbers(401 * 55, 6007);
    let all = packed.product(&values, None);
    for row in [0, 5, 397, 400] {
        let found = packed.product(&values[row * 55..][..55], None);
        assert_eq!(found.values(), &all.values()[row * 70..][..70], "row {row}");
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
    let found = pool.install(|| packed.product(&values, None));
    assert_eq!(found.values(), all.values());
}

/// Rows of several parts: their numbers and those of one row alone.
#[test]
fn parts_add_up_to_the_same_bits_for_any_rows() {
    for (count, length) in
        [(1, 255), (1, 256), (1, 257), (1, 600), (1, 1000), (3, 100), (3, 300), (7, 40)]
    {
        let inputs = count * length;
        let weight = Matrix::new(37, inputs, numbers(37 * inputs, 7919));
        let (packed, bias) = (Packed::new(&weight), numbers(37, 31));
        let jump = length + 5;
        let values = numbers(count * jump + 40 * 13, 6007);
        for rows in [1, 2, 6, 12, 13, 31] {
            let starts: Vec<usize> = (0..rows).map(|row| row * 13).collect();
            let runs = Runs { values: &values, starts: &starts, count, jump, length };
            let mut all = vec![f32::NAN; rows * 37];
            packed.multiply(runs, Some(&bias), &mut all);
            for (row, found) in all.chunks(37).enumerate() {
                let mut alone = vec![f32::NAN; 37];
                let runs = Runs { starts: &starts[row..=row], ..runs };
                packed.multiply(runs, Some(&bias), &mut alone);
                assert_eq!(found, alone, "row {row} of {rows}, {count} x {length}");
                let x = (0..count).flat_map(|run| &values[starts[row] + run * jump..][..length]);
                let x: Vec<f32> = x.copied().collect();
                for (o, found) in found.iter().enumerate() {
                    let w = &weight.values()[o * inputs..][..inputs];
                    let products = x.iter().zip(w).map(|(x, w)| f64::from(*x) * f64::from(*w));
                    let off = f64::from(*found) - products.sum::<f64>() - f64::from(bias[o]);
                    assert!(off.abs() < 1e-4, "{o} of row {row}, {count} x {length}: {off}");
                }
            }
        }
    }
}

#[test]
fn runs_lie_anywhere() {
    let values = numbers(100, 37);
    let weight = Matrix::new(3, 6, numbers(18, 211));
    let starts = [50, 0, 7];
    let runs = Runs { values: &values, starts: &starts, count: 2, jump: 20, length: 3 };
    let mut found = vec![0.0; 9];
    Packed::new(&weight).multiply(runs, None, &mut found);
    let rows = starts.iter().flat_map(|&s| [&values[s..s + 3], &values[s + 20..s + 23]]);
    let gathered: Vec<f32> = rows.flatten().copied().collect();
    assert_eq!(found, Packed::new(&weight).product(&gathered, None).values());
}
