//! Floats sixteen abreast: quantisation, and e to the power of x.

use crate::isa::{Isa, LANES};
use crate::out::Quant;

/// The start of `from`; `fill` in lanes beyond its end.
#[inline(always)]
pub(crate) fn load<I: Isa>(isa: I, from: &[f32], fill: f32) -> I::Floats {
    if let Some(full) = from.first_chunk() {
        return isa.floats(full);
    }
    let mut lanes = [fill; LANES];
    for (to, &from) in lanes.iter_mut().zip(from) {
        *to = from;
    }
    isa.floats(&lanes)
}

/// 1.5 * 2^23: a float this large has steps of one, so adding it rounds to the nearest integer, ties to even, and leaves the
/// integer in the low bits.
const ROUND: f32 = 12_582_912.0;

/// Steps from 0, not above what has a code; NaN stays.
#[inline(always)]
fn steps<I: Isa>(isa: I, y: I::Floats, quant: Quant) -> I::Floats {
    // The end is an integer, so it is the same to round after. NaN stays because it is the second operand.
    let most = isa.splat(f32::from(quant.top) - f32::from(quant.zero));
    isa.min(most, isa.multiply(y, isa.splat(quant.inverse)))
}

/// Codes.
#[inline(always)]
pub(crate) fn quantise<I: Isa>(isa: I, y: I::Floats, quant: Quant) -> [u8; LANES] {
    let steps = steps(isa, y, quant);
    let steps = isa.less(steps, isa.splat(256.0), steps, isa.splat(0.0));
    isa.store_codes(isa.round(steps), quant.zero)
}

/// The same of numbers of which none is NaN.
#[inline(always)]
pub(crate) fn quantise_numbers<I: Isa>(isa: I, y: I::Floats, quant: Quant) -> [u8; LANES] {
    isa.store_codes(isa.round(steps(isa, y, quant)), quant.zero)
}

/// The same, one code a lane.
#[inline(always)]
pub(crate) fn quantise_lanes<I: Isa>(isa: I, y: I::Floats, quant: Quant) -> I::Ints {
    let steps = isa.max(steps(isa, y, quant), isa.splat(-f32::from(quant.zero)));
    isa.add_ints(isa.round(steps), isa.splat_ints(quant.zero.into()))
}

/// Below this [`exp`] gives 0: the least that is not below the least normal float.
const EXP_LEAST: f32 = -87.336_54;

/// e to the power of each lane, for numbers not above 0, as softmax has them; 0 for those below [`EXP_LEAST`], NaN for NaN.
///
/// 2^n * e^r with n the nearest integer to x / ln 2, so |r| <= ln 2 / 2, where the polynomial is Cephes' `expf`.
#[inline(always)]
pub(crate) fn exp<I: Isa>(isa: I, x: I::Floats) -> I::Floats {
    // ln 2 in two parts, of which the first has few bits: its product with n is exact.
    const LN_2_HIGH: f32 = 0.693_359_4;
    const LN_2_LOW: f32 = -2.121_944_4e-4;
    let least = isa.splat(EXP_LEAST);
    let inside = isa.max(least, x);
    let shifted = isa.fused(inside, isa.splat(std::f32::consts::LOG2_E), isa.splat(ROUND));
    let n = isa.subtract(shifted, isa.splat(ROUND));
    let r = isa.fused(n, isa.splat(-LN_2_HIGH), inside);
    let r = isa.fused(n, isa.splat(-LN_2_LOW), r);
    let mut p = isa.splat(1.987_569_1e-4);
    for coefficient in [1.398_2e-3, 8.333_452e-3, 4.166_579_6e-2, 1.666_666_5e-1, 0.5] {
        p = isa.fused(p, r, isa.splat(coefficient));
    }
    let p = isa.add(isa.fused(p, isa.multiply(r, r), r), isa.splat(1.0));
    // The low bits of `shifted` are n: into the exponent with it.
    let exponent = isa.shift_left(isa.to_bits(shifted), 23);
    let power = isa.of_bits(isa.add_ints(exponent, isa.splat_ints(1.0f32.to_bits().cast_signed())));
    isa.less(x, least, isa.splat(0.0), isa.multiply(p, power))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::isa::Plain;

    fn exp(x: f32) -> f32 {
        super::exp(Plain, [x; LANES])[0]
    }

    #[test]
    fn exp_within_two_units_in_the_last_place() {
        let mut worst = 0.0f64;
        for step in 0..2_000_000 {
            let x = -(step as f32) * 4.4e-5;
            let got = f64::from(exp(x));
            let want = f64::from(x).exp();
            if x < EXP_LEAST {
                assert_eq!(got, 0.0, "{x}");
            } else {
                worst = worst.max(((got - want) / want).abs());
            }
        }
        assert!(worst < 2.0 * f64::from(f32::EPSILON), "relative error {worst:e}");
        assert_eq!(exp(0.0), 1.0);
        assert_eq!(exp(f32::NEG_INFINITY), 0.0);
        assert!(exp(f32::NAN).is_nan());
    }

    #[test]
    fn rounds_as_said() {
        let extremes =
            [0.0, -0.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, f32::MIN, f32::MIN_POSITIVE];
        let halves = (-1200..1200).map(|half| half as f32 * 0.5);
        let near = (-600..600).flat_map(|half| {
            let half = half as f32 * 0.5;
            [half.next_up(), half.next_down()]
        });
        for y in extremes.into_iter().chain(halves).chain(near) {
            for zero in [0, 1, 127, 128, 255] {
                for (inverse, top) in
                    [(1.0, 255), (1.0, 127), (0.5, 255), (-1.0, 255), (1e-3, 255), (1e30, 255)]
                {
                    let quant = Quant { inverse, zero: zero.min(top), top };
                    let zero = f32::from(quant.zero);
                    let steps = (y * inverse).round_ties_even();
                    let want = if steps.is_nan() { zero } else { (steps + zero).clamp(0.0, top.into()) };
                    assert_eq!(f32::from(quantise(Plain, [y; LANES], quant)[0]), want, "{y} {quant:?}");
                    if !steps.is_nan() {
                        let of_numbers = quantise_numbers(Plain, [y; LANES], quant)[0];
                        let of_lanes = quantise_lanes(Plain, [y; LANES], quant)[0];
                        assert_eq!((f32::from(of_numbers), of_lanes as f32), (want, want), "{y} {quant:?}");
                    }
                }
            }
        }
    }
}
