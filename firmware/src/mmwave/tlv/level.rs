//! Codes of range profiles and range-Doppler maps as decibels.

use rfhoi_shared::units::Decibels;

/// What a code of TLV 2, 3 or 5 means: `level = code x step + offset`.
///
/// The demo sums log2 of the magnitude over the V virtual antennas in fixed point. The visualiser (3.5, xWR18xx and
/// its AOP variant) makes dB of it as `code x 2^ceil(log2 V) / V / 256 x 20 log10(2) + 20 log10(32 / R)` for R range
/// bins; before SDK 3.2 the fraction had one bit more. Devices with another range FFT (xWR16xx) differ in the offset,
/// so that levels compare within a device.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LevelScale {
    /// dB of one code.
    pub step: Decibels,
    /// dB of code 0.
    pub offset: Decibels,
}

/// First version whose codes have 8 fraction bits, as in a frame header.
const SDK_3_2: u32 = 0x0302_0000;
/// 20 log10(2).
const DB_PER_OCTAVE: f32 = 6.020_6;

impl LevelScale {
    /// The scale of a radar of this SDK `version` ([`super::FrameHeader::version`]); `None` without antennas or bins.
    pub fn new(version: u32, virtual_antennas: u16, range_bins: u16) -> Option<Self> {
        if virtual_antennas == 0 || range_bins == 0 {
            return None;
        }
        let antennas = u32::from(virtual_antennas);
        let fill = antennas.next_power_of_two() as f32 / antennas as f32;
        let one = if version < SDK_3_2 { 512.0 } else { 256.0 };
        Some(Self {
            step: Decibels(DB_PER_OCTAVE * fill / one),
            offset: Decibels(20.0 * libm::log10f(32.0 / f32::from(range_bins))),
        })
    }

    /// The level of `code`.
    pub fn level(self, code: u16) -> Decibels {
        Decibels(f32::from(code) * self.step.0 + self.offset.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_octave_is_six_decibels() {
        // 8 antennas fill their power of two: 256 codes to the octave.
        let scale = LevelScale::new(0x0306_0000, 8, 32).unwrap();
        assert_eq!(scale.level(0).0, 0.0);
        assert!((scale.level(256).0 - 6.0206).abs() < 1e-4);
        // 12 of 16: a third more; 256 bins: 18.06 dB less.
        let aop = LevelScale::new(0x0306_0000, 12, 256).unwrap();
        assert!((aop.level(256).0 - (6.0206 * 4.0 / 3.0 - 18.0618)).abs() < 1e-3);
        let old = LevelScale::new(0x0301_0000, 8, 32).unwrap();
        assert!((old.level(512).0 - 6.0206).abs() < 1e-4);
        assert_eq!(LevelScale::new(0x0306_0000, 0, 256), None);
    }
}
