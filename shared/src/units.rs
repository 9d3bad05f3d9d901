//! Newtypes for codes and physical quantities: a 12-bit phase is not radians, a bin is not a metre.

use serde::{Deserialize, Serialize};

/// Speed of light in vacuum, m/s (exact by definition of the metre).
pub const SPEED_OF_LIGHT: f64 = 299_792_458.0;

macro_rules! quantity {
    ($(#[$doc:meta])* $name:ident, $unit:literal) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, PartialOrd, Default, Serialize, Deserialize)]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        pub struct $name(pub f32);

        impl core::fmt::Display for $name {
            fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                core::fmt::Display::fmt(&self.0, f)?;
                f.write_str(concat!(" ", $unit))
            }
        }
    };
}

quantity!(
    /// A distance in metres.
    Metres, "m"
);
quantity!(
    /// A radial or path speed in metres per second; positive recedes from the radar.
    MetresPerSecond, "m/s"
);
quantity!(
    /// A duration in seconds.
    Seconds, "s"
);
quantity!(
    /// A level in decibels; the reference is stated where it is used.
    Decibels, "dB"
);

/// Time of the bridge: microseconds since it started. The one time base of everything that leaves the bridge.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct BridgeTime(pub u64);

impl BridgeTime {
    /// This time as seconds.
    pub fn seconds(self) -> f64 {
        self.0 as f64 * 1e-6
    }

    /// Microseconds from `earlier` to this time, 0 if `earlier` is later.
    pub fn since(self, earlier: Self) -> u64 {
        self.0.saturating_sub(earlier.0)
    }

    /// This time plus `us` microseconds, saturating.
    pub fn after(self, us: u64) -> Self {
        Self(self.0.saturating_add(us))
    }
}

/// Time of an RFID reader: microseconds of its UTC clock (LLRP 1.0.1, 17.2.2.1 `UTCTimestamp`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ReaderTime(pub u64);

/// Phase of a tag's backscatter as Impinj readers report it: 4096 codes to the turn
/// (`ImpinjRFPhaseAngle`, parameter 56).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct PhaseCode(pub u16);

impl PhaseCode {
    /// Codes to one turn of 2 pi.
    pub const CODES_PER_TURN: u16 = 4096;

    /// The phase in radians, in `0 .. 2 pi` for codes below [`Self::CODES_PER_TURN`].
    pub fn radians(self) -> f32 {
        f32::from(self.0) * (core::f32::consts::TAU / f32::from(Self::CODES_PER_TURN))
    }

    /// The code nearest to `radians`, wrapped into one turn.
    pub fn from_radians(radians: f32) -> Self {
        let turns = radians / core::f32::consts::TAU;
        let fraction = turns - libm::floorf(turns);
        let code = libm::roundf(fraction * f32::from(Self::CODES_PER_TURN)) as u16;
        Self(code % Self::CODES_PER_TURN)
    }
}

/// Received signal strength of a tag in hundredths of a dBm (`ImpinjPeakRSSI`, parameter 57).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CentiDbm(pub i16);

impl CentiDbm {
    /// The level in dBm.
    pub fn dbm(self) -> f32 {
        f32::from(self.0) / 100.0
    }

    /// From the whole dBm of a plain LLRP `PeakRSSI`.
    pub fn from_whole_dbm(dbm: i8) -> Self {
        Self(i16::from(dbm) * 100)
    }
}

/// Doppler shift of a tag in sixteenths of a hertz (`ImpinjRFDopplerFrequency`, parameter 68, 12.4 fixed point).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct DopplerCode(pub i16);

impl DopplerCode {
    /// The shift in hertz.
    pub fn hertz(self) -> f32 {
        f32::from(self.0) / 16.0
    }
}

/// A reader's channel, counted from 1 into its hop table (LLRP 1.0.1, 17.2.7.3 `ChannelIndex`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ChannelIndex(pub u16);

/// A reader's antenna port, counted from 1 (LLRP 1.0.1, 17.2.7.3 `AntennaID`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct AntennaPort(pub u16);

/// A frequency in kilohertz, as hop tables carry it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Kilohertz(pub u32);

impl Kilohertz {
    /// Wavelength in vacuum.
    pub fn wavelength(self) -> Metres {
        Metres((SPEED_OF_LIGHT / (f64::from(self.0) * 1e3)) as f32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn impinj_sample_codes_convert() {
        // sllurp's sample read: 2608 -> 4.000 rad, -5300 -> -53.00 dBm, -40 -> -2.5 Hz.
        assert!((PhaseCode(2608).radians() - 4.000).abs() < 1e-3);
        assert_eq!(CentiDbm(-5300).dbm(), -53.0);
        assert_eq!(DopplerCode(-40).hertz(), -2.5);
    }

    #[test]
    fn phase_code_wraps_into_one_turn() {
        for code in 0..PhaseCode::CODES_PER_TURN {
            let radians = PhaseCode(code).radians();
            assert_eq!(PhaseCode::from_radians(radians), PhaseCode(code));
            assert_eq!(PhaseCode::from_radians(radians - core::f32::consts::TAU), PhaseCode(code));
        }
        assert_eq!(PhaseCode::from_radians(core::f32::consts::TAU * 0.999_99), PhaseCode(0));
    }

    #[test]
    fn uhf_wavelength() {
        assert!((Kilohertz(915_000).wavelength().0 - 0.327_64).abs() < 1e-5);
    }
}
