//! Arrays as numpy pickles them.

/// Array in C order.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Array {
    pub(crate) shape: Vec<usize>,
    pub(crate) data: Vec<f64>,
}

/// The array of this shape whose elements are `raw`, 8 or 4 bytes each.
pub(super) fn array(
    shape: Vec<usize>,
    raw: &[u8],
    double: bool,
    little: bool,
    fortran: bool,
) -> Result<Array, String> {
    let width = if double { 8 } else { 4 };
    let count = shape.iter().try_fold(1usize, |n, &m| n.checked_mul(m));
    if count.and_then(|n| n.checked_mul(width)) != Some(raw.len()) {
        return Err(format!("an array of shape {shape:?} with {} bytes", raw.len()));
    }
    if fortran && shape.len() > 2 {
        return Err("an array in Fortran order with more than two axes".into());
    }
    let element = |bytes: &[u8]| {
        let mut copy = [0u8; 8];
        copy[..width].copy_from_slice(bytes);
        if !little {
            copy[..width].reverse();
        }
        if double {
            f64::from_le_bytes(copy)
        } else {
            f64::from(f32::from_le_bytes([copy[0], copy[1], copy[2], copy[3]]))
        }
    };
    let mut data: Vec<f64> = raw.chunks_exact(width).map(element).collect();
    if let (true, [rows, columns]) = (fortran, shape.as_slice()) {
        data = (0..rows * columns).map(|i| data[i % columns * rows + i / columns]).collect();
    }
    Ok(Array { shape, data })
}
