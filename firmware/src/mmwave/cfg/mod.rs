//! CLI profiles (`.cfg`) of the SDK 3.x demo: text to [`CliProfile`] and back.
//!
//! [`CliProfile::parse`] takes a file as the visualiser writes it, for xWR16xx, 18xx and 68xx; [`write()`] gives the
//! full set of commands that the stock demo needs before it starts. Neither the mounting of the board nor, in most
//! texts, the board itself is in a profile: the caller says ([`Board`]).

mod parse;
mod write;

use rfhoi_shared::array::{AntennaArray, Mounting};
use rfhoi_shared::radar::RadarProfile;

pub use write::{TEXT_CAPACITY, write};

use super::tlv::TlvKind;

/// What a profile's text does not say about the radar.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Board {
    /// Its antennas; the visualiser's comment `% Platform:` goes before this where it names a known board.
    pub array: AntennaArray,
    /// How it is mounted.
    pub mounting: Mounting,
}

/// What a CLI profile makes a radar do.
#[derive(Debug, Clone, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CliProfile {
    /// Chirps, samples and frames; valid by [`RadarProfile::validate`].
    pub radar: RadarProfile,
    /// What else the demo does.
    pub demo: DemoOptions,
}

/// Options of the SDK demo beyond the radar profile.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct DemoOptions {
    /// Frames until it stops by itself; 0 for no end.
    pub frames: u16,
    /// Raw data over LVDS.
    pub lvds: LvdsStream,
    /// Processed data over the data UART.
    pub gui: GuiMonitor,
    /// Removes static clutter before detection (mean over the loops).
    pub clutter_removal: bool,
}

/// Raw data over LVDS (`lvdsStreamCfg`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LvdsStream {
    /// A high-speed-interface header goes before each packet.
    pub header: bool,
    /// What the hardware session sends.
    pub data: LvdsData,
    /// A software session sends detected points too.
    pub software: bool,
}

impl LvdsStream {
    /// ADC samples and nothing else: what the bridge's DCA1000 path takes.
    pub const RAW: Self = Self { header: false, data: LvdsData::Adc, software: false };
}

/// What the LVDS hardware session sends (`lvdsStreamCfg`, `dataFmt`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum LvdsData {
    /// Nothing.
    #[default]
    Off,
    /// ADC samples.
    Adc,
    /// Chirp parameters, ADC samples and chirp quality.
    CpAdcCq,
}

/// What goes out on the data UART (`guiMonitor`).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct GuiMonitor {
    /// Detected points.
    pub points: PointOutput,
    /// Range profile at zero Doppler.
    pub range_profile: bool,
    /// Range profile at the largest Doppler.
    pub noise_profile: bool,
    /// Zero-Doppler samples of the antennas: azimuth alone, or with elevation on an AOP board.
    pub azimuth_heatmap: bool,
    /// Range-Doppler heat map.
    pub range_doppler_heatmap: bool,
    /// Statistics, and temperatures from SDK 3.3 on.
    pub statistics: bool,
}

impl Default for GuiMonitor {
    /// As in the stock profiles: points with side information, range profile and statistics.
    fn default() -> Self {
        Self {
            points: PointOutput::WithSideInfo,
            range_profile: true,
            noise_profile: false,
            azimuth_heatmap: false,
            range_doppler_heatmap: false,
            statistics: true,
        }
    }
}

/// Output of detected points (`guiMonitor`, `detectedObjects`).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum PointOutput {
    /// None.
    Off,
    /// Points with their signal-to-noise ratio and noise.
    WithSideInfo,
    /// Points alone.
    Alone,
}

impl GuiMonitor {
    /// Whether frames carry TLVs of this kind; those of points are left out of frames without any.
    pub fn sends(&self, kind: TlvKind) -> bool {
        match kind {
            TlvKind::DetectedPoints => self.points != PointOutput::Off,
            TlvKind::SideInfo => self.points == PointOutput::WithSideInfo,
            TlvKind::RangeProfile => self.range_profile,
            TlvKind::NoiseProfile => self.noise_profile,
            TlvKind::AzimuthHeatmap | TlvKind::AzimuthElevationHeatmap => self.azimuth_heatmap,
            TlvKind::RangeDopplerHeatmap => self.range_doppler_heatmap,
            TlvKind::Statistics | TlvKind::Temperatures => self.statistics,
        }
    }
}
