//! The radar profile, and every number that follows from it.
//!
//! A profile holds only what the radar is programmed with, in integers of the CLI's resolution. Bins, spans, bytes and
//! rates are methods, so each formula stands in one place. Formulas are those of FMCW with TDM-MIMO (TI SWRA553,
//! "Programming chirp parameters", and the paper's section 4.1).

use heapless::Vec;
use serde::{Deserialize, Serialize};

use crate::array::{AntennaArray, Mounting};
use crate::fnv;
use crate::units::{Metres, MetresPerSecond, SPEED_OF_LIGHT, Seconds};

/// Receive antennas of a radar, at most.
pub const MAX_RX: usize = 4;
/// Chirps of one loop (transmitter slots), at most.
pub const MAX_TX_SLOTS: usize = 3;
/// Virtual antennas, at most: [`MAX_RX`] x [`MAX_TX_SLOTS`].
pub const MAX_VIRTUAL: usize = MAX_RX * MAX_TX_SLOTS;
/// Samples of one chirp, at most: the longest range FFT.
pub const MAX_SAMPLES: usize = 1024;
/// Loops of one frame, at most: the longest Doppler FFT.
pub const MAX_LOOPS: usize = 256;
/// Range bins of a gate, at most.
pub const MAX_GATE_BINS: usize = 256;

/// Payload of one full DCA1000 datagram in bytes, after its 10-byte header (1466 bytes of UDP payload in all).
pub const DCA1000_PAYLOAD: u32 = 1456;
/// Memory for the radar cube on an xWR1843 (L3), which the stock demo needs whole: 1 MiB.
const STOCK_CUBE_BYTES: u64 = 1 << 20;
/// Fewest loops that the stock demo accepts.
const STOCK_MIN_LOOPS: u16 = 16;

/// Which word of a complex sample comes first on a 2-lane LVDS link of xWR16xx, 18xx and 68xx.
///
/// Words come in groups of four for two samples: `I0 I1 Q0 Q1`, or `Q0 Q1 I0 I1` when `adcbufCfg` sets SampleSwap.
/// The wrong choice conjugates the signal: near targets appear at the last range bins.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum IqOrder {
    /// `I0 I1 Q0 Q1`: mmWave Studio, and `adcbufCfg` with SampleSwap 0.
    IFirst,
    /// `Q0 Q1 I0 I1`: `adcbufCfg` with SampleSwap 1, as in the SDK demo's stock profiles.
    QFirst,
}

/// What the ADC delivers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum SampleFormat {
    /// 16-bit I and Q for each sample.
    Complex(IqOrder),
    /// 16-bit real samples.
    Real,
}

impl SampleFormat {
    /// Bytes of one sample.
    pub const fn bytes(self) -> u32 {
        match self {
            Self::Complex(_) => 4,
            Self::Real => 2,
        }
    }
}

/// What a radar is programmed with.
#[derive(Debug, Clone, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct RadarProfile {
    /// Carrier at the start of the ramp, kHz.
    pub start_khz: u32,
    /// Slope of the ramp, kHz/us.
    pub slope_khz_per_us: u32,
    /// Pause before each ramp, ns.
    pub idle_ns: u32,
    /// From the start of the ramp to the first sample, ns.
    pub adc_start_ns: u32,
    /// Length of the ramp, ns.
    pub ramp_end_ns: u32,
    /// ADC samples of one chirp and receiver.
    pub samples: u16,
    /// Sample rate, ksps.
    pub sample_rate_ksps: u32,
    /// Complex or real samples.
    pub format: SampleFormat,
    /// Receivers in use, bit 0 is RX1.
    pub rx_mask: u8,
    /// Transmitter mask of each chirp of a loop, in the order of time; bit 0 is TX1.
    pub tx_order: Vec<u8, MAX_TX_SLOTS>,
    /// Loops of one frame: chirps of each transmitter slot.
    pub loops: u16,
    /// Frame period, us.
    pub frame_period_us: u32,
    /// The board's antennas.
    pub array: AntennaArray,
    /// How the board is mounted.
    pub mounting: Mounting,
}

/// Why a profile cannot be used, with the numbers that collide.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ProfileError {
    /// Samples a chirp must be a power of two from 16 to [`MAX_SAMPLES`].
    Samples(u16),
    /// Loops a frame must be a power of two from 1 to [`MAX_LOOPS`].
    Loops(u16),
    /// No receiver, or a receiver beyond [`MAX_RX`].
    RxMask(u8),
    /// No transmitter in one of the slots, or no slot.
    TxOrder,
    /// Start frequency, slope, sample rate or frame period is zero.
    ZeroParameter,
    /// The samples end after the ramp: ns of sampling end, ns of ramp end.
    SamplingPastRamp(u64, u64),
    /// The chirps of a frame do not fit its period: us needed, us there (at most 99 %).
    FrameTooLong(u64, u64),
}

impl core::fmt::Display for ProfileError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Samples(n) => {
                write!(f, "{n} samples a chirp: need a power of two from 16 to {MAX_SAMPLES}")
            }
            Self::Loops(n) => write!(f, "{n} loops a frame: need a power of two from 1 to {MAX_LOOPS}"),
            Self::RxMask(m) => write!(f, "receiver mask {m}: need 1 to 15 (RX1 to RX4)"),
            Self::TxOrder => write!(f, "every chirp of the frame must enable a transmitter"),
            Self::ZeroParameter => {
                write!(f, "start frequency, slope, sample rate and frame period must not be zero")
            }
            Self::SamplingPastRamp(end, ramp) => {
                write!(f, "sampling ends at {end} ns, after the ramp's end at {ramp} ns")
            }
            Self::FrameTooLong(need, have) => {
                write!(f, "the chirps take {need} us, more than 99 % of the frame period of {have} us")
            }
        }
    }
}

impl core::error::Error for ProfileError {}

/// The range bins that are kept after the range FFT.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct RangeGate {
    /// First bin kept.
    pub first: u16,
    /// Bins kept.
    pub bins: u16,
}

impl RadarProfile {
    /// The paper's profile (section 4.1): 256 samples at 4.4 Msps, 128 loops.
    pub fn paper() -> Self {
        Self {
            start_khz: 77_000_000,
            slope_khz_per_us: 60_000,
            // 65 us ramp and this pause give the period of 70.3 us that the paper's 4.5 m/s needs.
            idle_ns: 5_300,
            adc_start_ns: 6_000,
            ramp_end_ns: 65_000,
            samples: 256,
            sample_rate_ksps: 4_400,
            format: SampleFormat::Complex(IqOrder::QFirst),
            rx_mask: 0b1111,
            tx_order: [0b001, 0b010, 0b100].into_iter().collect(),
            loops: 128,
            frame_period_us: 100_000,
            array: AntennaArray::Awr1843Aop,
            mounting: Mounting::default(),
        }
    }

    /// As [`Self::paper`] with half the samples at half the rate: the same bins over half the span.
    pub fn fine() -> Self {
        Self { samples: 128, sample_rate_ksps: 2_200, ..Self::paper() }
    }

    /// The default: as [`Self::fine`] with 64 loops, half the cube.
    pub fn bridge() -> Self {
        Self { loops: 64, ..Self::fine() }
    }

    /// The profile of this name (`paper`, `fine`, `bridge`).
    pub fn named(name: &str) -> Option<Self> {
        match name {
            "paper" => Some(Self::paper()),
            "fine" => Some(Self::fine()),
            "bridge" => Some(Self::bridge()),
            _ => None,
        }
    }

    /// Checks what the bridge and physics ask of a profile. What only the stock radar firmware asks is
    /// [`Self::fits_stock_firmware`].
    ///
    /// # Errors
    /// The first rule that is broken.
    pub fn validate(&self) -> Result<(), ProfileError> {
        let power_of_two =
            |n: u16, min: u16, max: usize| n.is_power_of_two() && n >= min && usize::from(n) <= max;
        if !power_of_two(self.samples, 16, MAX_SAMPLES) {
            return Err(ProfileError::Samples(self.samples));
        }
        if !power_of_two(self.loops, 1, MAX_LOOPS) {
            return Err(ProfileError::Loops(self.loops));
        }
        if self.rx_mask == 0 || self.rx_mask >= 1 << MAX_RX {
            return Err(ProfileError::RxMask(self.rx_mask));
        }
        if self.tx_order.is_empty() || self.tx_order.contains(&0) {
            return Err(ProfileError::TxOrder);
        }
        if [self.start_khz, self.slope_khz_per_us, self.sample_rate_ksps, self.frame_period_us].contains(&0) {
            return Err(ProfileError::ZeroParameter);
        }
        let sampling_ns = u64::from(self.samples) * 1_000_000 / u64::from(self.sample_rate_ksps);
        let end = u64::from(self.adc_start_ns) + sampling_ns;
        if end > u64::from(self.ramp_end_ns) {
            return Err(ProfileError::SamplingPastRamp(end, u64::from(self.ramp_end_ns)));
        }
        let active_us = self.frame_active_ns() / 1_000;
        if active_us * 100 > u64::from(self.frame_period_us) * 99 {
            return Err(ProfileError::FrameTooLong(active_us, u64::from(self.frame_period_us)));
        }
        Ok(())
    }

    /// Receivers in use.
    pub fn rx_count(&self) -> usize {
        self.rx_mask.count_ones() as usize
    }

    /// Chirps of one loop.
    pub fn tx_slots(&self) -> usize {
        self.tx_order.len()
    }

    /// Virtual antennas; number `slot * rx_count + rx`, slots in the order of time.
    pub fn virtual_count(&self) -> usize {
        self.rx_count() * self.tx_slots()
    }

    /// Chirps of one frame, all transmitter slots.
    pub fn chirps_per_frame(&self) -> u32 {
        u32::from(self.loops) * self.tx_slots() as u32
    }

    /// From chirp to chirp, ns.
    pub fn chirp_period_ns(&self) -> u64 {
        u64::from(self.idle_ns) + u64::from(self.ramp_end_ns)
    }

    /// From a frame's first chirp to the end of its last, ns.
    pub fn frame_active_ns(&self) -> u64 {
        self.chirp_period_ns() * u64::from(self.chirps_per_frame())
    }

    /// Frame period.
    pub fn frame_period(&self) -> Seconds {
        Seconds(self.frame_period_us as f32 * 1e-6)
    }

    /// Bandwidth that is sampled, Hz: slope x samples / rate.
    pub fn sampled_bandwidth_hz(&self) -> f64 {
        f64::from(self.slope_khz_per_us) * 1e9 * f64::from(self.samples)
            / (f64::from(self.sample_rate_ksps) * 1e3)
    }

    /// Carrier in the middle of the sampled band, Hz.
    pub fn centre_hz(&self) -> f64 {
        let to_first_sample = f64::from(self.slope_khz_per_us) * f64::from(self.adc_start_ns);
        f64::from(self.start_khz) * 1e3 + to_first_sample + self.sampled_bandwidth_hz() / 2.0
    }

    /// Wavelength at [`Self::centre_hz`].
    pub fn wavelength(&self) -> Metres {
        Metres((SPEED_OF_LIGHT / self.centre_hz()) as f32)
    }

    /// Width of one range bin: c / (2 B).
    pub fn range_bin(&self) -> Metres {
        Metres((SPEED_OF_LIGHT / (2.0 * self.sampled_bandwidth_hz())) as f32)
    }

    /// Bins of the range FFT that carry ranges: all of a complex one, half of a real one.
    pub fn range_bins(&self) -> u16 {
        match self.format {
            SampleFormat::Complex(_) => self.samples,
            SampleFormat::Real => self.samples / 2,
        }
    }

    /// Largest range: [`Self::range_bins`] x [`Self::range_bin`].
    pub fn range_span(&self) -> Metres {
        Metres(self.range_bin().0 * f32::from(self.range_bins()))
    }

    /// Largest unambiguous radial speed, either way: lambda / (4 T M), M transmitter slots of period T.
    pub fn velocity_span(&self) -> MetresPerSecond {
        let loop_s = self.chirp_period_ns() as f32 * 1e-9 * self.tx_slots() as f32;
        MetresPerSecond(self.wavelength().0 / (4.0 * loop_s))
    }

    /// Width of one Doppler bin: 2 x span / loops.
    pub fn velocity_bin(&self) -> MetresPerSecond {
        MetresPerSecond(2.0 * self.velocity_span().0 / f32::from(self.loops))
    }

    /// Raw bytes of one chirp of one receiver.
    pub fn row_bytes(&self) -> u32 {
        u32::from(self.samples) * self.format.bytes()
    }

    /// Raw bytes of one chirp of all receivers.
    pub fn chirp_bytes(&self) -> u32 {
        self.row_bytes() * self.rx_count() as u32
    }

    /// Raw bytes of one frame.
    pub fn frame_bytes(&self) -> u32 {
        self.chirp_bytes() * self.chirps_per_frame()
    }

    /// Raw rate on the link, bit/s, without headers.
    pub fn raw_bit_rate(&self) -> f64 {
        f64::from(self.frame_bytes()) * 8.0 * 1e6 / f64::from(self.frame_period_us)
    }

    /// Full DCA1000 datagrams a frame; frames do not end on a datagram's end.
    pub fn datagrams_per_frame(&self) -> f64 {
        f64::from(self.frame_bytes()) / f64::from(DCA1000_PAYLOAD)
    }

    /// Rate on an Ethernet, bit/s, with the overhead of full datagrams.
    pub fn ethernet_bit_rate(&self) -> f64 {
        // 10 B DCA1000 + 8 UDP + 20 IP + 14 Ethernet + 4 FCS + 8 preamble + 12 gap.
        const OVERHEAD: f64 = 76.0;
        let payload = f64::from(DCA1000_PAYLOAD);
        self.raw_bit_rate() * (payload + OVERHEAD) / payload
    }

    /// Whether the raw samples fit a 100 Mbit/s Ethernet, with the overhead of full datagrams.
    pub fn fits_100mbit(&self) -> bool {
        self.ethernet_bit_rate() <= 100e6
    }

    /// Whether the stock SDK demo runs it: a 1 MiB cube over three transmitters makes samples x loops at most 2^14
    /// for 12 antennas, and it wants at least 16 loops.
    pub fn fits_stock_firmware(&self) -> bool {
        let cube = u64::from(self.samples) * u64::from(self.loops) * self.virtual_count() as u64 * 4;
        cube <= STOCK_CUBE_BYTES && self.loops >= STOCK_MIN_LOOPS
    }

    /// The gate that reaches from bin 0 past `depth`: at most all bins.
    pub fn gate_to(&self, depth: Metres) -> RangeGate {
        let bins = libm::ceilf(depth.0 / self.range_bin().0).max(1.0).min(self.range_bins().into());
        RangeGate { first: 0, bins: bins as u16 }
    }

    /// Bytes of the gated cube as 16-bit complex numbers.
    pub fn cube_bytes(&self, gate: RangeGate) -> u32 {
        u32::from(gate.bins) * u32::from(self.loops) * self.virtual_count() as u32 * 4
    }

    /// FNV-1a hash of all fields: tells host and bridge whether they speak of the same profile.
    pub fn fingerprint(&self) -> u32 {
        let mut buffer = [0u8; 128];
        let bytes = postcard::to_slice(self, &mut buffer).map(|b| &*b).unwrap_or(&[]);
        fnv::more(fnv::EMPTY, bytes)
    }
}

impl Default for RadarProfile {
    fn default() -> Self {
        Self::bridge()
    }
}
