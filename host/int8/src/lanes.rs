//! Arithmetic of floats sixteen abreast, in an order that no level changes: lane by lane, no fused products, and sums over
//! lanes as one fixed tree.

use crate::isa::LANES;
use crate::out::Quant;

/// Sixteen numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C, align(64))]
pub(crate) struct Lanes(pub(crate) [f32; LANES]);

impl Lanes {
    pub(crate) const ZERO: Self = Self([0.0; LANES]);

    #[inline(always)]
    pub(crate) fn splat(value: f32) -> Self {
        Self([value; LANES])
    }

    /// From the start of `from`, `fill` in lanes beyond its end.
    #[inline(always)]
    pub(crate) fn load(from: &[f32], fill: f32) -> Self {
        if let Some(full) = from.first_chunk() {
            return Self(*full);
        }
        let mut lanes = Self::splat(fill);
        for (to, &from) in lanes.0.iter_mut().zip(from) {
            *to = from;
        }
        lanes
    }

    #[inline(always)]
    pub(crate) fn add(mut self, other: Self) -> Self {
        for (a, b) in self.0.iter_mut().zip(other.0) {
            *a += b;
        }
        self
    }

    #[inline(always)]
    pub(crate) fn subtract(mut self, other: Self) -> Self {
        for (a, b) in self.0.iter_mut().zip(other.0) {
            *a -= b;
        }
        self
    }

    #[inline(always)]
    pub(crate) fn multiply(mut self, other: Self) -> Self {
        for (a, b) in self.0.iter_mut().zip(other.0) {
            *a *= b;
        }
        self
    }

    /// The greater in each lane; `other`'s where one is NaN.
    #[inline(always)]
    pub(crate) fn max(mut self, other: Self) -> Self {
        for (a, b) in self.0.iter_mut().zip(other.0) {
            *a = if *a > b { *a } else { b };
        }
        self
    }

    /// Halves added to each other until one number is left.
    #[inline(always)]
    pub(crate) fn sum(mut self) -> f32 {
        let mut width = LANES / 2;
        while width > 0 {
            for lane in 0..width {
                self.0[lane] += self.0[lane + width];
            }
            width /= 2;
        }
        self.0[0]
    }

    /// The greatest, in the same order.
    #[inline(always)]
    pub(crate) fn greatest(mut self) -> f32 {
        let mut width = LANES / 2;
        while width > 0 {
            for lane in 0..width {
                let (a, b) = (self.0[lane], self.0[lane + width]);
                self.0[lane] = if a > b { a } else { b };
            }
            width /= 2;
        }
        self.0[0]
    }
}

/// 1.5 * 2^23: a float this large has steps of one, so adding it rounds to the nearest integer, ties to even, and leaves the
/// integer in the low bits.
const ROUND: f32 = 12_582_912.0;

/// Codes, 0 to 255.
#[inline(always)]
pub(crate) fn quantise(y: &Lanes, quant: Quant) -> [i32; LANES] {
    let mut codes = [0; LANES];
    for (code, y) in codes.iter_mut().zip(y.0) {
        let steps = y * quant.inverse;
        let steps = if steps.is_nan() { 0.0 } else { steps };
        // Beyond 256 steps the code is at its end, whatever the zero point is.
        let steps = if steps > -256.0 { steps } else { -256.0 };
        let steps = if steps < 256.0 { steps } else { 256.0 };
        let rounded = (steps + ROUND).to_bits().wrapping_sub(ROUND.to_bits()).cast_signed();
        *code = rounded.wrapping_add(i32::from(quant.zero)).clamp(0, 255);
    }
    codes
}

/// Below this [`exp`] gives 0: the least that is not below the least normal float.
const EXP_LEAST: f32 = -87.336_54;

/// e to the power of each lane, for numbers not above 0, as softmax has them; 0 for those below [`EXP_LEAST`], NaN for NaN.
///
/// 2^n * e^r with n the nearest integer to x / ln 2, so |r| <= ln 2 / 2, where the polynomial is Cephes' `expf`.
#[inline(always)]
pub(crate) fn exp(x: &Lanes) -> Lanes {
    // ln 2 in two parts, of which the first has few bits: its product with n is exact.
    const LN_2_HIGH: f32 = 0.693_359_4;
    const LN_2_LOW: f32 = -2.121_944_4e-4;
    let mut y = Lanes::ZERO;
    for (y, x) in y.0.iter_mut().zip(x.0) {
        let inside = if x < EXP_LEAST { EXP_LEAST } else { x };
        let shifted = inside * std::f32::consts::LOG2_E + ROUND;
        let n = shifted - ROUND;
        let r = (inside - n * LN_2_HIGH) - n * LN_2_LOW;
        let mut p = 1.987_569_1e-4;
        for coefficient in [1.398_2e-3, 8.333_452e-3, 4.166_579_6e-2, 1.666_666_5e-1, 0.5] {
            p = p * r + coefficient;
        }
        let mantissa = p * (r * r) + r + 1.0;
        // The low bits of `shifted` are n: into the exponent with it.
        let power = f32::from_bits((shifted.to_bits() << 23).wrapping_add(1.0f32.to_bits()));
        let value = mantissa * power;
        *y = if x < EXP_LEAST { 0.0 } else { value };
    }
    y
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exp_within_two_units_in_the_last_place() {
        let mut worst = 0.0f64;
        for step in 0..2_000_000 {
            let x = -(step as f32) * 4.4e-5;
            let got = f64::from(exp(&Lanes::splat(x)).0[0]);
            let want = f64::from(x).exp();
            if x < EXP_LEAST {
                assert_eq!(got, 0.0, "{x}");
            } else {
                worst = worst.max(((got - want) / want).abs());
            }
        }
        assert!(worst < 2.0 * f64::from(f32::EPSILON), "relative error {worst:e}");
        assert_eq!(exp(&Lanes::ZERO), Lanes::splat(1.0));
        assert_eq!(exp(&Lanes::splat(f32::NEG_INFINITY)), Lanes::ZERO);
        assert!(exp(&Lanes::splat(f32::NAN)).0[0].is_nan());
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
                for inverse in [1.0, 0.5, -1.0, 1e-3, 1e30] {
                    let steps = (y * inverse).round_ties_even();
                    let want =
                        if steps.is_nan() { zero } else { (steps + f32::from(zero)).clamp(0.0, 255.0) as u8 };
                    assert_eq!(
                        quantise(&Lanes::splat(y), Quant { inverse, zero })[0],
                        i32::from(want),
                        "{y} {zero}"
                    );
                }
            }
        }
    }
}
