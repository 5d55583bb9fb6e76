//! Turns the bytes of any numeric element type into floats.

use crate::npy::{DType, Kind};

/// A number in the file.
pub(super) trait Endian: Sized {
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
endian!(u8, u16, u32, u64, i8, i16, i32, i64, f32, f64);

/// Appends the numbers that a stretch of whole elements spells.
pub(super) type Convert<T> = Box<dyn Fn(&[u8], &mut Vec<T>)>;

/// A type that arrays can be read as.
pub(super) trait Element: Copy + Sized + 'static {
    /// How to read elements of `dtype`; `None` for complex numbers and text.
    fn converter(dtype: DType) -> Option<Convert<Self>>;
}

macro_rules! element {
    ($target:ty) => {
        impl Element for $target {
            fn converter(dtype: DType) -> Option<Convert<Self>> {
                let big_endian = dtype.big_endian;
                macro_rules! from {
                    ($source:ty) => {
                        Box::new(move |bytes: &[u8], out: &mut Vec<$target>| {
                            let (items, _) = bytes.as_chunks::<{ size_of::<$source>() }>();
                            out.extend(
                                items.iter().map(|&b| <$source>::of(b, big_endian) as $target),
                            );
                        })
                    };
                }
                Some(match (dtype.kind, dtype.itemsize) {
                    (Kind::Bool | Kind::UInt, 1) => from!(u8),
                    (Kind::UInt, 2) => from!(u16),
                    (Kind::UInt, 4) => from!(u32),
                    (Kind::UInt, 8) => from!(u64),
                    (Kind::Int, 1) => from!(i8),
                    (Kind::Int, 2) => from!(i16),
                    (Kind::Int, 4) => from!(i32),
                    (Kind::Int, 8) => from!(i64),
                    (Kind::Float, 4) => from!(f32),
                    (Kind::Float, 8) => from!(f64),
                    _ => return None,
                })
            }
        }
    };
}
element!(f32);
element!(f64);
