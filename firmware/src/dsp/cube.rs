//! The gated radar cube: complex 16-bit numbers with one exponent for each row.
//!
//! A row is the gated range spectrum of one receiver and chirp. It is scaled by the power of two that brings its
//! largest part into the upper half of 16 bits, so its error is at most 2^-15 of that part: block floating point. Cells
//! lie by range bin, virtual antenna, loop, so that the Doppler stage reads memory in order.

use num_complex::{Complex, Complex32};
use rfhoi_shared::config::RadarConfig;
use rfhoi_shared::radar::{MAX_LOOPS, MAX_VIRTUAL};

/// Dimensions of a cube.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CubeShape {
    /// Range bins of the gate.
    pub bins: usize,
    /// Virtual antennas.
    pub virtuals: usize,
    /// Loops.
    pub loops: usize,
}

impl CubeShape {
    /// The shape that `config` asks for.
    pub fn of(config: &RadarConfig) -> Self {
        Self {
            bins: config.processing.gate.bins.into(),
            virtuals: config.profile.virtual_count(),
            loops: config.profile.loops.into(),
        }
    }

    /// Cells of the cube.
    pub fn cells(self) -> usize {
        self.bins * self.virtuals * self.loops
    }
}

/// What the exponent of a row that was never stored reads.
const NOT_STORED: i8 = i8::MIN;

/// A cube in memory that a board lends.
#[derive(Debug)]
pub struct Cube<'m> {
    cells: &'m mut [Complex<i16>],
    exponents: [[i8; MAX_LOOPS]; MAX_VIRTUAL],
    shape: CubeShape,
}

impl<'m> Cube<'m> {
    /// A cube of no size in `memory`.
    pub const fn new(memory: &'m mut [Complex<i16>]) -> Self {
        let shape = CubeShape { bins: 0, virtuals: 0, loops: 0 };
        Self { cells: memory, exponents: [[NOT_STORED; MAX_LOOPS]; MAX_VIRTUAL], shape }
    }

    /// A cube that holds nothing: what is stored in it is lost.
    pub const fn nothing() -> Self {
        Self::new(&mut [])
    }

    /// Whether it holds nothing.
    pub fn is_nothing(&self) -> bool {
        self.shape.cells() == 0
    }

    /// Gives the cube a shape and empties it. Returns whether its memory is large enough; it keeps its old shape if
    /// not.
    pub fn reshape(&mut self, shape: CubeShape) -> bool {
        if shape.cells() > self.cells.len() || shape.virtuals > MAX_VIRTUAL || shape.loops > MAX_LOOPS {
            return false;
        }
        self.shape = shape;
        self.clear();
        true
    }

    /// Empties the cube: every row counts as lost until it is stored.
    pub fn clear(&mut self) {
        self.exponents = [[NOT_STORED; MAX_LOOPS]; MAX_VIRTUAL];
    }

    /// Its shape.
    pub fn shape(&self) -> CubeShape {
        self.shape
    }

    /// Stores the gated range spectrum of one receiver and chirp. Parts must be below 2^100.
    pub fn store(&mut self, virtual_antenna: usize, loop_index: usize, spectrum: &[Complex32]) {
        let CubeShape { bins, virtuals, loops } = self.shape;
        if virtual_antenna >= virtuals || loop_index >= loops {
            return;
        }
        let Some(exponent) = self.exponents.get_mut(virtual_antenna).and_then(|row| row.get_mut(loop_index))
        else {
            return;
        };
        let shift = shift_for(spectrum.iter().take(bins));
        *exponent = shift as i8;
        let scale = power_of_two(shift);
        let start = virtual_antenna * loops + loop_index;
        // An index costs the MCU less than an iterator of steps or chunks.
        let (mut at, bin_step) = (start, virtuals * loops);
        for z in spectrum.iter().take(bins) {
            let Some(cell) = self.cells.get_mut(at) else { return };
            *cell = Complex::new(round_to_i16(z.re * scale), round_to_i16(z.im * scale));
            at += bin_step;
        }
    }

    /// The loops of one range bin and virtual antenna, to be multiplied by [`Self::scales`].
    pub fn row(&self, bin: usize, virtual_antenna: usize) -> &[Complex<i16>] {
        let CubeShape { virtuals, loops, .. } = self.shape;
        let start = (bin * virtuals + virtual_antenna) * loops;
        self.cells.get(start..start + loops).unwrap_or(&[])
    }

    /// What the cells of each loop of one virtual antenna must be multiplied by; `None` where the row was lost.
    pub fn scales(&self, virtual_antenna: usize) -> impl Iterator<Item = Option<f32>> {
        let exponents = self.exponents.get(virtual_antenna).map_or(&[][..], |row| row.as_slice());
        exponents
            .iter()
            .take(self.shape.loops)
            .map(|&e| (e != NOT_STORED).then(|| power_of_two(-i32::from(e))))
    }
}

/// The power of two by which the largest part becomes 2^14 or more and rounds to at most 2^15 - 1.
fn shift_for<'z>(spectrum: impl Iterator<Item = &'z Complex32>) -> i32 {
    const SIGN: u32 = 1 << 31;
    // Bits of positive floats are ordered as the floats are.
    let largest = spectrum.fold(0, |m, z| m.max(z.re.to_bits() & !SIGN).max(z.im.to_bits() & !SIGN));
    // A part that would round up to 2^15 belongs to the next power. Of 23 bits of mantissa 14 stay, so this is half a
    // unit of what stays.
    const ROUND_UP: u32 = 1 << (23 - 14 - 1);
    const BIAS: i32 = 127;
    let exponent = (largest.saturating_add(ROUND_UP) >> 23) as i32 - BIAS;
    // Far from what floats and an i8 can hold; a row of zeros ends up here.
    const LIMIT: i32 = 100;
    (14 - exponent).clamp(-LIMIT, LIMIT)
}

/// `2^exponent` for exponents of normal numbers.
fn power_of_two(exponent: i32) -> f32 {
    f32::from_bits(((127 + exponent) as u32) << 23)
}

/// Rounds to nearest, ties to even, for `|x| < 2^15`: after adding 1.5 x 2^23 the unit is the last bit of the mantissa.
fn round_to_i16(x: f32) -> i16 {
    const UNITS: f32 = 12_582_912.0;
    (x + UNITS).to_bits() as i16
}

#[cfg(test)]
mod tests {
    use std::vec;
    use std::vec::Vec;

    use proptest::prelude::*;

    use super::*;

    const SHAPE: CubeShape = CubeShape { bins: 5, virtuals: 2, loops: 4 };

    fn read_back(cube: &Cube<'_>, v: usize, l: usize) -> Option<Vec<Complex32>> {
        let scale = cube.scales(v).nth(l)??;
        Some(
            (0..SHAPE.bins)
                .map(|bin| {
                    let cell = cube.row(bin, v)[l];
                    Complex32::new(f32::from(cell.re) * scale, f32::from(cell.im) * scale)
                })
                .collect(),
        )
    }

    #[test]
    fn rows_keep_their_places() {
        let mut memory = vec![Complex::default(); SHAPE.cells()];
        let mut cube = Cube::new(&mut memory);
        assert!(cube.reshape(SHAPE));
        let row = |v: usize, l: usize| -> Vec<Complex32> {
            (0..SHAPE.bins).map(|bin| Complex32::new((1 + bin) as f32, (v * 10 + l) as f32)).collect()
        };
        for (v, l) in [(1, 3), (0, 0), (0, 2)] {
            cube.store(v, l, &row(v, l));
        }
        for v in 0..SHAPE.virtuals {
            for l in 0..SHAPE.loops {
                let stored = [(1, 3), (0, 0), (0, 2)].contains(&(v, l));
                assert_eq!(read_back(&cube, v, l), stored.then(|| row(v, l)));
            }
        }
        cube.clear();
        assert!(cube.scales(0).all(|s| s.is_none()));
    }

    #[test]
    fn shapes_that_do_not_fit_are_refused() {
        let mut memory = vec![Complex::default(); SHAPE.cells() - 1];
        let mut cube = Cube::new(&mut memory);
        assert!(!cube.reshape(SHAPE));
        assert!(!cube.reshape(CubeShape { bins: 1, virtuals: 13, loops: 1 }));
        assert_eq!(cube.shape(), CubeShape::default());
        cube.store(0, 0, &[Complex32::new(1.0, 1.0); 4]);
        assert!(cube.row(0, 0).is_empty());
    }

    #[test]
    fn largest_parts_neither_overflow_nor_lose_a_bit() {
        for x in [1.0, 0.999_97, 0.999_99, 0.999_999_9, 0.5, 0.500_01, 1e-20, 3e20, 32767.4, 32767.6] {
            for x in [x, -x] {
                let shift = shift_for([Complex32::new(0.0, x)].iter());
                let scaled = x * power_of_two(shift);
                let code = round_to_i16(scaled);
                assert!(
                    (f32::from(code) - scaled).abs() <= 0.5 && code.unsigned_abs() >= 1 << 14,
                    "{x}: {scaled} became {code}"
                );
            }
        }
    }

    proptest! {
        #[test]
        fn a_rows_error_is_within_half_a_unit(
            parts in prop::collection::vec(-1.0f32..1.0, 10),
            power in -40i32..20,
        ) {
            let spectrum: Vec<_> =
                parts.chunks(2).map(|p| Complex32::new(p[0], p[1]) * power_of_two(power)).collect();
            let mut memory = vec![Complex::default(); SHAPE.cells()];
            let mut cube = Cube::new(&mut memory);
            cube.reshape(SHAPE);
            cube.store(1, 1, &spectrum);
            let largest = spectrum.iter().fold(0.0f32, |m, z| m.max(z.re.abs()).max(z.im.abs()));
            for (z, back) in spectrum.iter().zip(read_back(&cube, 1, 1).unwrap()) {
                let error = (z.re - back.re).abs().max((z.im - back.im).abs());
                prop_assert!(error <= largest * 1.000_1 / 32768.0, "{} of {}", error, largest);
            }
        }
    }
}
