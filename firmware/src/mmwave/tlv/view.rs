//! A view for each kind of TLV; lengths are checked once, when the view is made.

use core::fmt;

use super::element::{take_i16, take_u32};
use super::{ComplexI16, DetectedPoint, Elements, RawTlv, SideInfo, TlvKind};

/// A TLV by kind.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Tlv<'a> {
    /// Detected points.
    DetectedPoints(Elements<'a, DetectedPoint>),
    /// Level for each range bin at zero Doppler; codes of [`super::LevelScale`].
    RangeProfile(Elements<'a, u16>),
    /// Level for each range bin at the largest Doppler; codes of [`super::LevelScale`].
    NoiseProfile(Elements<'a, u16>),
    /// Range x azimuth antennas at zero Doppler; [`HeatMap::new`] with the range bins gives it its shape.
    AzimuthHeatmap(Elements<'a, ComplexI16>),
    /// Range x Doppler; [`RangeDoppler::new`] with the range bins gives it its shape.
    RangeDopplerHeatmap(Elements<'a, u16>),
    /// Timing and load.
    Statistics(Statistics),
    /// Side information of the detected points, in their order.
    SideInfo(Elements<'a, SideInfo>),
    /// Range x all virtual antennas at zero Doppler; [`HeatMap::new`] with the range bins gives it its shape.
    AzimuthElevationHeatmap(Elements<'a, ComplexI16>),
    /// Temperatures.
    Temperatures(Temperatures),
}

/// A TLV whose payload has a length that its kind cannot have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct TlvError {
    /// The kind.
    pub kind: TlvKind,
    /// Bytes of the payload.
    pub length: usize,
}

impl fmt::Display for TlvError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?} cannot have a payload of {} bytes", self.kind, self.length)
    }
}

impl core::error::Error for TlvError {}

impl<'a> Tlv<'a> {
    /// The view of `raw`, `None` for a kind that is none of the demo's.
    ///
    /// # Errors
    /// If the payload's length does not fit the kind.
    pub fn parse(raw: RawTlv<'a>) -> Result<Option<Self>, TlvError> {
        let Some(kind) = TlvKind::from_code(raw.code) else { return Ok(None) };
        let payload = raw.payload;
        let view = match kind {
            TlvKind::DetectedPoints => Elements::new(payload).map(Self::DetectedPoints),
            TlvKind::RangeProfile => Elements::new(payload).map(Self::RangeProfile),
            TlvKind::NoiseProfile => Elements::new(payload).map(Self::NoiseProfile),
            TlvKind::AzimuthHeatmap => Elements::new(payload).map(Self::AzimuthHeatmap),
            TlvKind::RangeDopplerHeatmap => Elements::new(payload).map(Self::RangeDopplerHeatmap),
            TlvKind::Statistics => Statistics::read(payload).map(Self::Statistics),
            TlvKind::SideInfo => Elements::new(payload).map(Self::SideInfo),
            TlvKind::AzimuthElevationHeatmap => Elements::new(payload).map(Self::AzimuthElevationHeatmap),
            TlvKind::Temperatures => Temperatures::read(payload).map(Self::Temperatures),
        };
        view.map(Some).ok_or(TlvError { kind, length: payload.len() })
    }
}

/// Columns of a map of `cells` cells with this many rows; `None` if rows are not all equal or empty.
fn columns(cells: usize, rows: u16) -> Option<usize> {
    let rows = usize::from(rows);
    (rows > 0 && cells > 0 && cells.is_multiple_of(rows)).then(|| cells / rows)
}

/// Zero-Doppler samples of the virtual antennas, the input of the angle FFT: range outside, antenna inside.
///
/// Antennas are in the order of the radar cube: transmitter slots in the order of time, receivers in each.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct HeatMap<'a> {
    cells: Elements<'a, ComplexI16>,
    antennas: usize,
}

impl<'a> HeatMap<'a> {
    /// A map of this many range bins; `None` if the cells are not as many for each.
    pub fn new(cells: Elements<'a, ComplexI16>, range_bins: u16) -> Option<Self> {
        Some(Self { antennas: columns(cells.len(), range_bins)?, cells })
    }

    /// Antennas.
    pub fn antennas(&self) -> usize {
        self.antennas
    }

    /// The samples of one range bin, by antenna.
    pub fn row(&self, range: usize) -> Option<Elements<'a, ComplexI16>> {
        self.cells.slice(range.checked_mul(self.antennas)?, self.antennas)
    }
}

/// Range-Doppler levels, codes of [`super::LevelScale`]: range outside, Doppler inside.
///
/// Doppler bins of a row go from 0 up and then from the most negative one to -1 (not fftshifted). The same bytes read
/// as Doppler x range give a map of the right size and wrong content.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RangeDoppler<'a> {
    cells: Elements<'a, u16>,
    doppler_bins: usize,
}

impl<'a> RangeDoppler<'a> {
    /// A map of this many range bins; `None` if the cells are not as many for each.
    pub fn new(cells: Elements<'a, u16>, range_bins: u16) -> Option<Self> {
        Some(Self { doppler_bins: columns(cells.len(), range_bins)?, cells })
    }

    /// Doppler bins D.
    pub fn doppler_bins(&self) -> usize {
        self.doppler_bins
    }

    /// The levels of one range bin, Doppler in the order on the wire.
    pub fn row(&self, range: usize) -> Option<Elements<'a, u16>> {
        self.cells.slice(range.checked_mul(self.doppler_bins)?, self.doppler_bins)
    }

    /// The level at a range bin and a signed Doppler bin, `-D/2` to `D/2 - 1`; positive recedes.
    pub fn get(&self, range: usize, doppler: i16) -> Option<u16> {
        let magnitude = usize::from(doppler.unsigned_abs());
        let half = self.doppler_bins / 2;
        let column = if doppler < 0 {
            if magnitude > half {
                return None;
            }
            self.doppler_bins.checked_sub(magnitude)?
        } else if magnitude < self.doppler_bins - half {
            magnitude
        } else {
            return None;
        };
        self.row(range)?.get(column)
    }
}

/// Timing and load of the last frame (`MmwDemo_output_message_stats`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Statistics {
    /// Time that processing after the last chirp took, us.
    pub processing_us: u32,
    /// Time that sending the frame before took, us.
    pub transmit_us: u32,
    /// Time left before the next frame, us.
    pub frame_margin_us: u32,
    /// Time left before the next chirp, us.
    pub chirp_margin_us: u32,
    /// Load while chirps arrive, percent.
    pub active_load_percent: u32,
    /// Load between frames, percent.
    pub idle_load_percent: u32,
}

impl Statistics {
    /// Bytes of the payload.
    pub const BYTES: usize = 24;

    fn read(mut payload: &[u8]) -> Option<Self> {
        if payload.len() != Self::BYTES {
            return None;
        }
        let mut field = || take_u32(&mut payload);
        Some(Self {
            processing_us: field()?,
            transmit_us: field()?,
            frame_margin_us: field()?,
            chirp_margin_us: field()?,
            active_load_percent: field()?,
            idle_load_percent: field()?,
        })
    }

    /// The fields in the order on the wire.
    pub(super) fn fields(self) -> [u32; 6] {
        [
            self.processing_us,
            self.transmit_us,
            self.frame_margin_us,
            self.chirp_margin_us,
            self.active_load_percent,
            self.idle_load_percent,
        ]
    }
}

/// Temperatures of the radar's front end (`MmwDemo_temperatureStats`, `rlRfTempData_t`), degrees Celsius.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Temperatures {
    /// Return code of the reading: 0 if the temperatures are valid.
    pub status: i32,
    /// Time of the reading since the front end started, ms.
    pub time_ms: u32,
    /// At receivers 1 to 4.
    pub rx: [i16; 4],
    /// At transmitters 1 to 3.
    pub tx: [i16; 3],
    /// At the power management.
    pub power: i16,
    /// At the two digital sensors.
    pub digital: [i16; 2],
}

impl Temperatures {
    /// Bytes of the payload.
    pub const BYTES: usize = 28;

    fn read(mut payload: &[u8]) -> Option<Self> {
        if payload.len() != Self::BYTES {
            return None;
        }
        let status = take_u32(&mut payload)?.cast_signed();
        let time_ms = take_u32(&mut payload)?;
        let mut next = || take_i16(&mut payload);
        Some(Self {
            status,
            time_ms,
            rx: [next()?, next()?, next()?, next()?],
            tx: [next()?, next()?, next()?],
            power: next()?,
            digital: [next()?, next()?],
        })
    }

    /// All sensors in the order on the wire.
    pub fn sensors(&self) -> impl Iterator<Item = i16> {
        let Self { rx, tx, power, digital, .. } = *self;
        rx.into_iter().chain(tx).chain([power]).chain(digital)
    }

    /// The hottest sensor, if the reading is valid.
    pub fn hottest(&self) -> Option<i16> {
        if self.status == 0 { self.sensors().max() } else { None }
    }
}
