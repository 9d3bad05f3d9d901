//! No instructions but those that the target always has.

use super::{Isa, LANES, QUAD, Quads, Work};

#[derive(Debug, Clone, Copy)]
pub(crate) struct Plain;

/// Each lane of `a`, of which the second operand's is `b`.
macro_rules! lanes {
    (|$a:ident| $of:expr => $y:expr) => {{
        let mut y = [Default::default(); LANES];
        for (y, $a) in y.iter_mut().zip($of) {
            *y = $y;
        }
        y
    }};
    (|$a:ident, $b:ident| $of_a:expr, $of_b:expr => $y:expr) => {{
        let mut y = [Default::default(); LANES];
        for (y, ($a, $b)) in y.iter_mut().zip($of_a.into_iter().zip($of_b)) {
            *y = $y;
        }
        y
    }};
}

type Ints = [i32; LANES];
type Floats = [f32; LANES];

impl Isa for Plain {
    type Bytes = Quads;
    type Ints = Ints;
    type Floats = Floats;
    const ROWS: usize = 1;
    const PANELS: usize = 1;
    const EIGHT_SUMS: bool = false;

    #[inline(always)]
    fn run<W: Work>(self, work: W) {
        work.run(self);
    }

    #[inline(always)]
    fn prefetch<T>(self, _: *const T) {}

    #[inline(always)]
    fn bytes(self, quads: &Quads) -> Quads {
        *quads
    }

    #[inline(always)]
    fn splat_bytes(self, quad: [u8; QUAD]) -> Quads {
        [quad; LANES]
    }

    #[inline(always)]
    fn dot(self, mut sum: Ints, unsigned: Quads, signed: Quads) -> Ints {
        for ((sum, unsigned), signed) in sum.iter_mut().zip(unsigned).zip(signed) {
            for (u, s) in unsigned.into_iter().zip(signed) {
                *sum += i32::from(i16::from(u)) * i32::from(i16::from(s.cast_signed()));
            }
        }
        sum
    }

    #[inline(always)]
    fn ints(self, from: &[i32; LANES]) -> Ints {
        *from
    }

    #[inline(always)]
    fn splat_ints(self, value: i32) -> Ints {
        [value; LANES]
    }

    #[inline(always)]
    fn add_ints(self, a: Ints, b: Ints) -> Ints {
        lanes!(|a, b| a, b => a.wrapping_add(b))
    }

    #[inline(always)]
    fn or(self, a: Ints, b: Ints) -> Ints {
        lanes!(|a, b| a, b => a | b)
    }

    #[inline(always)]
    fn shift_left(self, a: Ints, bits: u32) -> Ints {
        lanes!(|a| a => a << bits)
    }

    #[inline(always)]
    fn to_floats(self, a: Ints) -> Floats {
        lanes!(|a| a => a as f32)
    }

    #[inline(always)]
    fn of_bits(self, a: Ints) -> Floats {
        lanes!(|a| a => f32::from_bits(a.cast_unsigned()))
    }

    #[inline(always)]
    fn store_ints(self, a: Ints) -> [i32; LANES] {
        a
    }

    #[inline(always)]
    fn store_codes(self, a: Ints, zero: u8) -> [u8; LANES] {
        lanes!(|a| a => a.saturating_add(zero.into()).max(0) as u8)
    }

    #[inline(always)]
    fn floats(self, from: &[f32; LANES]) -> Floats {
        *from
    }

    #[inline(always)]
    fn splat(self, value: f32) -> Floats {
        [value; LANES]
    }

    #[inline(always)]
    fn add(self, a: Floats, b: Floats) -> Floats {
        lanes!(|a, b| a, b => a + b)
    }

    #[inline(always)]
    fn subtract(self, a: Floats, b: Floats) -> Floats {
        lanes!(|a, b| a, b => a - b)
    }

    #[inline(always)]
    fn multiply(self, a: Floats, b: Floats) -> Floats {
        lanes!(|a, b| a, b => a * b)
    }

    #[inline(always)]
    fn fused(self, a: Floats, b: Floats, c: Floats) -> Floats {
        let mut y = c;
        for (y, (a, b)) in y.iter_mut().zip(a.into_iter().zip(b)) {
            *y = a.mul_add(b, *y);
        }
        y
    }

    #[inline(always)]
    fn max(self, a: Floats, b: Floats) -> Floats {
        lanes!(|a, b| a, b => if a > b { a } else { b })
    }

    #[inline(always)]
    fn min(self, a: Floats, b: Floats) -> Floats {
        lanes!(|a, b| a, b => if a < b { a } else { b })
    }

    #[inline(always)]
    fn less(self, a: Floats, b: Floats, yes: Floats, no: Floats) -> Floats {
        let mut y = no;
        for (y, ((a, b), yes)) in y.iter_mut().zip(a.into_iter().zip(b).zip(yes)) {
            *y = if a < b { yes } else { *y };
        }
        y
    }

    #[inline(always)]
    fn to_bits(self, a: Floats) -> Ints {
        lanes!(|a| a => a.to_bits().cast_signed())
    }

    #[inline(always)]
    fn round(self, a: Floats) -> Ints {
        lanes!(|a| a => if a.is_nan() { i32::MIN } else { a.round_ties_even() as i32 })
    }

    #[inline(always)]
    fn store(self, a: Floats) -> [f32; LANES] {
        a
    }

    #[inline(always)]
    fn sum(self, a: Floats) -> f32 {
        halves(a, |a, b| a + b)
    }

    #[inline(always)]
    fn greatest(self, a: Floats) -> f32 {
        halves(a, |a, b| if a > b { a } else { b })
    }
}

/// The upper half joined to the lower one until one number is left.
#[inline(always)]
fn halves(mut lanes: Floats, join: impl Fn(f32, f32) -> f32) -> f32 {
    let mut width = LANES / 2;
    while width > 0 {
        for lane in 0..width {
            lanes[lane] = join(lanes[lane], lanes[lane + width]);
        }
        width /= 2;
    }
    lanes[0]
}
