//! No instructions but those that the target always has.

use super::{Isa, LANES, QUAD, Quads, Work};

#[derive(Debug, Clone, Copy)]
pub(crate) struct Plain;

impl Isa for Plain {
    type Bytes = Quads;
    type Sums = [i32; LANES];
    const ROWS: usize = 1;
    const PANELS: usize = 1;
    const CHANNELS: usize = 1;

    #[inline(always)]
    fn run<W: Work>(self, work: W) {
        work.run(self);
    }

    #[inline(always)]
    fn load(self, quads: &Quads) -> Quads {
        *quads
    }

    #[inline(always)]
    fn splat(self, quad: [u8; QUAD]) -> Quads {
        [quad; LANES]
    }

    #[inline(always)]
    fn zero(self) -> [i32; LANES] {
        [0; LANES]
    }

    #[inline(always)]
    fn dot(self, mut sums: [i32; LANES], unsigned: Quads, signed: Quads) -> [i32; LANES] {
        for ((sum, unsigned), signed) in sums.iter_mut().zip(unsigned).zip(signed) {
            for (u, s) in unsigned.into_iter().zip(signed) {
                *sum += i32::from(u) * i32::from(s.cast_signed());
            }
        }
        sums
    }

    #[inline(always)]
    fn lanes(self, sums: [i32; LANES]) -> [i32; LANES] {
        sums
    }
}
