//! Plain loops compiled for the best instruction set of the machine.

use pulp::{Arch, Simd, WithSimd};

/// Runs `body`, compiled once for each supported instruction set (plain code, AVX2 + FMA, AVX-512;
/// NEON is plain on aarch64) and chosen at run time.
///
/// Write `body` as `#[inline(always)] || …`. The bound matters: a closure that is expected to be
/// `FnOnce` is inlined here itself, while one passed straight to `pulp` goes through a shim that
/// stays plain code.
#[inline(always)]
pub fn vectorized<R>(body: impl FnOnce() -> R) -> R {
    Arch::new().dispatch(Body(body))
}

struct Body<F>(F);

impl<R, F: FnOnce() -> R> WithSimd for Body<F> {
    type Output = R;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> R {
        (self.0)()
    }
}
