//! Turns the bytes of any numeric element type into arrays of floats.

use std::io::Read;

use half::f16;
use ndarray::{ArrayD, IxDyn, ShapeBuilder};

use super::{DType, Header, Kind, NpyError, Order};

/// Bytes decoded at a time.
const CHUNK: usize = 1 << 20;

/// A number in the file.
pub(crate) trait Endian: Sized {
    /// Bytes of one number.
    type Bytes;
    /// The number that `bytes` spell.
    fn of(bytes: Self::Bytes, big_endian: bool) -> Self;
}

macro_rules! endian {
    ($($number:ty),*) => {$(
        impl Endian for $number {
            type Bytes = [u8; size_of::<$number>()];
            fn of(bytes: Self::Bytes, big_endian: bool) -> Self {
                if big_endian { Self::from_be_bytes(bytes) } else { Self::from_le_bytes(bytes) }
            }
        }
    )*};
}
endian!(u8, u16, u32, u64, i8, i16, i32, i64, f16, f32, f64);

/// Appends the numbers that a stretch of whole elements spells.
pub(crate) type Convert<T> = Box<dyn Fn(&[u8], &mut Vec<T>)>;

/// A type that arrays can be read as.
pub(crate) trait Element: Copy + Sized + 'static {
    /// The elements that it can be read from.
    const EXPECTED: &'static str;

    /// How to read elements of `dtype`; `None` for complex numbers and text.
    fn converter(dtype: DType) -> Option<Convert<Self>>;
}

macro_rules! from {
    ($source:ty, $target:ty, $big_endian:expr) => {{
        let big_endian = $big_endian;
        Box::new(move |bytes: &[u8], out: &mut Vec<$target>| {
            let (items, _) = bytes.as_chunks::<{ size_of::<$source>() }>();
            out.extend(items.iter().map(|&b| <$source>::of(b, big_endian) as $target));
        })
    }};
}

macro_rules! whole {
    ($target:ty, $dtype:expr) => {
        (|| -> Option<Convert<$target>> {
            let big_endian = $dtype.big_endian;
            Some(match ($dtype.kind, $dtype.itemsize) {
                (Kind::Bool | Kind::UInt, 1) => from!(u8, $target, big_endian),
                (Kind::UInt, 2) => from!(u16, $target, big_endian),
                (Kind::UInt, 4) => from!(u32, $target, big_endian),
                (Kind::UInt, 8) => from!(u64, $target, big_endian),
                (Kind::Int, 1) => from!(i8, $target, big_endian),
                (Kind::Int, 2) => from!(i16, $target, big_endian),
                (Kind::Int, 4) => from!(i32, $target, big_endian),
                (Kind::Int, 8) => from!(i64, $target, big_endian),
                _ => return None,
            })
        })()
    };
}

macro_rules! element {
    ($target:ty) => {
        impl Element for $target {
            const EXPECTED: &'static str = "real numbers (b, i, u, f)";

            fn converter(dtype: DType) -> Option<Convert<Self>> {
                let big_endian = dtype.big_endian;
                let half = move |bytes: &[u8], out: &mut Vec<$target>| {
                    let (items, _) = bytes.as_chunks::<2>();
                    out.extend(items.iter().map(|&b| <$target>::from(f16::of(b, big_endian))));
                };
                Some(match (dtype.kind, dtype.itemsize) {
                    (Kind::Float, 2) => Box::new(half),
                    (Kind::Float, 4) => from!(f32, $target, big_endian),
                    (Kind::Float, 8) => from!(f64, $target, big_endian),
                    _ => return whole!($target, dtype),
                })
            }
        }
    };
}
element!(f32);
element!(f64);

/// Whole numbers only, each as it is.
impl Element for i128 {
    const EXPECTED: &'static str = "whole numbers (b, i, u)";

    fn converter(dtype: DType) -> Option<Convert<Self>> {
        whole!(i128, dtype)
    }
}

/// Reads the elements that `header` announces; the caller has compared its shape with the bytes there.
///
/// # Errors
/// [`NpyError::Kind`] for complex numbers and text, [`NpyError::TooLarge`], [`NpyError::Io`].
pub(crate) fn array<T: Element>(
    body: &mut dyn Read,
    header: &Header,
) -> Result<ArrayD<T>, NpyError> {
    let itemsize = header.dtype.itemsize;
    let too_large = || NpyError::TooLarge { shape: header.shape.clone(), itemsize };
    let count = usize::try_from(header.elements()?).map_err(|_| too_large())?;
    let convert = T::converter(header.dtype).ok_or_else(|| NpyError::Kind {
        expected: T::EXPECTED,
        actual: format!("{} of shape {:?}", header.dtype, header.shape),
    })?;
    let mut values: Vec<T> = Vec::new();
    values.try_reserve_exact(count).map_err(|_| too_large())?;
    let mut chunk = vec![0u8; (CHUNK / itemsize).min(count.max(1)) * itemsize];
    let mut left = count * itemsize;
    while left > 0 {
        let now = left.min(chunk.len());
        body.read_exact(&mut chunk[..now])?;
        convert(&chunk[..now], &mut values);
        left -= now;
    }
    let shape: Vec<usize> = header.shape.iter().map(|&n| n as usize).collect();
    let shape = IxDyn(&shape).set_f(header.order == Order::Fortran);
    ArrayD::from_shape_vec(shape, values).map_err(|_| too_large())
}

/// The numbers that `header` announces (the caller has compared its shape with the bytes there), complex ones
/// with an additional first axis of real and imaginary parts.
///
/// # Errors
/// [`NpyError::Kind`] for text, [`NpyError::TooLarge`], [`NpyError::Io`].
pub(crate) fn components(body: &mut dyn Read, header: &Header) -> Result<ArrayD<f64>, NpyError> {
    if header.dtype.kind != Kind::Complex {
        return array(body, header);
    }
    let dtype = DType { kind: Kind::Float, itemsize: header.dtype.itemsize / 2, ..header.dtype };
    // The parts lie side by side: along the fastest axis.
    let axis = if header.order == Order::Fortran { 0 } else { header.shape.len() };
    let mut shape = header.shape.clone();
    shape.insert(axis, 2);
    let mut parts = array(body, &Header { dtype, order: header.order, shape })?;
    for position in (1..=axis).rev() {
        parts.swap_axes(position - 1, position);
    }
    Ok(parts)
}
