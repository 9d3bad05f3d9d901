//! Signal processing of the bridge, on microfft.
//!
//! A row, one receiver's samples of a chirp, goes through the [`RangeStage`] as it arrives: words to numbers, window,
//! range FFT, and the bins of the gate into the [`Cube`] as 16-bit numbers with one exponent. When the frame is complete the
//! [`DopplerStage`] takes the cube one range bin at a time: window, Doppler FFT and static clutter off for all
//! virtual antennas, one row of each map, and the cells that move into the spatial covariance. One range bin is the unit of
//! work, so that a scheduler can let reception in between.
//!
//! Levels are relative to a full-scale tone, which a window does not change: 0 dB is a complex tone that just
//! reaches the ADC's limits. All arithmetic is plain IEEE f32 in a fixed order, without fused operations and without a
//! system's mathematics library, so the MCU and a PC compute the same bits.
//!
//! Memory lives in the stages, is of fixed size and all zeros at first, so that they can be placed in statics.

mod cube;
mod doppler;
pub mod fft;
pub mod level;
mod moving;
mod range;
pub mod window;

pub use cube::{Cube, CubeShape};
pub use doppler::{DopplerStage, Row};
pub use moving::{MAX_CELLS, MovingCells};
pub use range::RangeStage;

#[cfg(test)]
mod tests;
