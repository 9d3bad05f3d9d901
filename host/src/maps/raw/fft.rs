//! The FFT of a power-of-two length from 1 to 256, of sixteen series abreast.

use core::array;
use core::f64::consts::TAU;

use pulp::Simd;

use super::lanes::{Arithmetic, Cells, Complexes, LANES};

/// The first step's length, where there are two.
const FIRST: usize = 16;

/// `exp(-j 2 pi k / n)`.
pub(super) fn root(k: usize, n: usize) -> [f32; 2] {
    let (sin, cos) = libm::sincos(-TAU * (k % n) as f64 / n as f64);
    [cos as f32, sin as f32]
}

/// An FFT of one length: up to 16 at one go in registers, longer ones as 16 times the rest, with twiddle factors between
/// (Cooley and Tukey).
#[derive(Debug)]
pub(super) struct LaneFft {
    length: usize,
    /// Twiddle factors by place in the second step, then bin of the first.
    twiddles: Vec<[[f32; 2]; FIRST]>,
    work: Vec<Cells>,
}

impl LaneFft {
    /// `length` is a power of two from 1 to 256.
    pub(super) fn new(length: usize) -> Self {
        let second = if length > FIRST { length / FIRST } else { 0 };
        let twiddles = (0..second).map(|n| array::from_fn(|k| root(n * k, length))).collect();
        Self { length, twiddles, work: vec![Cells::ZERO; second * FIRST] }
    }

    /// Writes the transform of `source`, each element passed through `weigh` with its place, to `out`, in natural order,
    /// unscaled.
    #[inline(always)]
    pub(super) fn forward<S: Simd>(
        &mut self,
        simd: S,
        source: &[Cells],
        out: &mut [Cells],
        weigh: impl Fn(usize, Complexes<S>) -> Complexes<S> + Copy,
    ) {
        let Self { length, twiddles, work } = self;
        match *length {
            1 => across::<S, 1>(simd, source, 1, out, 1, weigh, |_, z| z),
            2 => across::<S, 2>(simd, source, 1, out, 1, weigh, |_, z| z),
            4 => across::<S, 4>(simd, source, 1, out, 1, weigh, |_, z| z),
            8 => across::<S, 8>(simd, source, 1, out, 1, weigh, |_, z| z),
            16 => across::<S, 16>(simd, source, 1, out, 1, weigh, |_, z| z),
            _ => {
                let second = twiddles.len();
                let turn = Arithmetic(simd);
                for (n, factors) in twiddles.iter().enumerate() {
                    let (source, work) = (&source[n..], &mut work[n..]);
                    let weigh = |i, z| weigh(second * i + n, z);
                    across::<S, FIRST>(simd, source, second, work, second, weigh, |k, z| {
                        turn.turn(z, factors[k])
                    });
                }
                for (k, work) in work.chunks_exact(second).enumerate() {
                    let out = &mut out[k..];
                    match second {
                        2 => across::<S, 2>(simd, work, 1, out, FIRST, |_, z| z, |_, z| z),
                        4 => across::<S, 4>(simd, work, 1, out, FIRST, |_, z| z, |_, z| z),
                        8 => across::<S, 8>(simd, work, 1, out, FIRST, |_, z| z, |_, z| z),
                        _ => across::<S, 16>(simd, work, 1, out, FIRST, |_, z| z, |_, z| z),
                    }
                }
            }
        }
    }
}

/// One FFT of length `N` over `source[step * n]` into `out[out_step * k]`.
#[inline(always)]
#[allow(clippy::needless_range_loop, reason = "iterators of registers are not always inlined")]
fn across<S: Simd, const N: usize>(
    simd: S,
    source: &[Cells],
    step: usize,
    out: &mut [Cells],
    out_step: usize,
    before: impl Fn(usize, Complexes<S>) -> Complexes<S>,
    after: impl Fn(usize, Complexes<S>) -> Complexes<S>,
) {
    let arithmetic = Arithmetic(simd);
    for register in 0..LANES / S::F32_LANES {
        let mut x = [arithmetic.zero(); N];
        for n in 0..N {
            x[n] = before(n, source[step * n].get(register));
        }
        let x = arithmetic.fft::<N>(x);
        for k in 0..N {
            out[out_step * k].put(register, after(k, x[k]));
        }
    }
}

#[cfg(test)]
mod tests {
    use num_complex::Complex64;
    use pulp::{Arch, WithSimd};
    use rfhoi_firmware::simulated::Noise;

    use super::*;

    struct Forward<'a>(&'a mut LaneFft, &'a [Cells], &'a mut [Cells]);

    impl WithSimd for Forward<'_> {
        type Output = ();

        #[inline(always)]
        fn with_simd<S: Simd>(self, simd: S) {
            self.0.forward(simd, self.1, self.2, |_, z| z);
        }
    }

    #[test]
    fn every_length_is_the_transform_on_any_machine() {
        let mut noise = Noise::new(3, 1.0);
        for length in [1, 2, 4, 8, 16, 32, 64, 128, 256] {
            let mut fft = LaneFft::new(length);
            let mut draw = || [(); LANES].map(|()| noise.draw());
            let source: Vec<Cells> = (0..length).map(|_| Cells { re: draw(), im: draw() }).collect();
            let mut out = vec![Cells::ZERO; length];
            for arch in [Arch::Scalar, Arch::new()] {
                arch.dispatch(Forward(&mut fft, &source, &mut out));
                for lane in [0, 5, 15] {
                    for (k, z) in out.iter().enumerate() {
                        let want: Complex64 = (0..length)
                            .map(|n| {
                                let x = Complex64::new(source[n].re[lane].into(), source[n].im[lane].into());
                                x * Complex64::from_polar(1.0, -TAU * (n * k % length) as f64 / length as f64)
                            })
                            .sum();
                        let error = Complex64::new(z.re[lane].into(), z.im[lane].into()) - want;
                        assert!(error.norm() < 1e-6 * length as f64, "{length}, bin {k}: {error}");
                    }
                }
            }
        }
    }
}
