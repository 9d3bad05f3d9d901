//! mmWave Studio's API log (`*_LogFile.txt`) to a [`RadarProfile`]: what a raw capture was made with.
//!
//! Each call is a line `<date> <time>: API:<name>,<arguments>,<status>,$`. The arguments are the integers of
//! mmWaveLink's structures in their codes, named below with `mmwavelink.h`'s units. That the last number is the call's
//! status is inferred from calls without arguments (`SensorStart,0`); a call whose status is not 0 failed and is passed
//! over. Where a call repeats, the last counts.

use rfhoi_shared::radar::{IqOrder, ProfileError, RadarProfile, SampleFormat};

use super::cfg::Board;
use super::chirps::{Chirp, FrameChirps, MAX_RAMPS, Ramp};
use super::text::{Args, Place, Problem, TextError, Unsupported};

/// What a log says of a capture.
#[derive(Debug, Clone, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct StudioProfile {
    /// Chirps, samples and frames; valid by [`RadarProfile::validate`].
    pub radar: RadarProfile,
    /// Frames of the capture; 0 for no end.
    pub frames: u16,
}

/// A value and the line that set it.
type Set<T> = Option<(T, u32)>;

#[derive(Debug, Clone, Copy)]
struct Frame {
    first: u16,
    last: u16,
    frames: u16,
    loops: u16,
    period_us: u32,
}

struct Calls {
    lines: u32,
    ramps: [Option<Ramp>; MAX_RAMPS],
    frame: Set<Frame>,
    /// Transmitter and receiver masks.
    channels: Set<(u8, u8)>,
    adc_complex: Set<bool>,
    order: Set<IqOrder>,
}

impl StudioProfile {
    /// Reads a log. It does not name the board, so all of `board` is taken.
    ///
    /// # Errors
    /// The line and call that is missing, malformed or not supported, or that breaks a rule of
    /// [`RadarProfile::validate`].
    pub fn parse(log: &str, board: Board) -> Result<Self, TextError> {
        let calls = Calls::read(log)?;
        let missing = |command| Place { line: calls.lines, command }.error(Problem::Missing);
        let ((tx_enabled, rx_mask), channels_line) = calls.channels.ok_or(missing("ChannelConfig"))?;
        let (complex, _) = calls.adc_complex.ok_or(missing("AdcOutConfig"))?;
        let (order, _) = calls.order.ok_or(missing("DataFmtConfig"))?;
        if calls.ramps.iter().all(Option::is_none) {
            return Err(missing("ProfileConfig"));
        }
        let (frame, frame_line) = calls.frame.ok_or(missing("FrameConfig"))?;

        let at_frame = Place { line: frame_line, command: "FrameConfig" };
        let mut chirps = FrameChirps::new(frame.first, frame.last).map_err(|p| at_frame.error(p))?;
        define_chirps(log, &mut chirps, tx_enabled)?;
        let (profile, tx_order) = chirps.resolve().map_err(|p| at_frame.error(p))?;
        let ramp = calls.ramps.get(usize::from(profile)).copied().flatten();
        let ramp = ramp.ok_or(at_frame.error(Problem::ProfileUndefined(profile)))?;

        let radar = RadarProfile {
            start_khz: ramp.start_khz,
            slope_khz_per_us: ramp.slope_khz_per_us,
            idle_ns: ramp.idle_ns,
            adc_start_ns: ramp.adc_start_ns,
            ramp_end_ns: ramp.ramp_end_ns,
            samples: ramp.samples,
            sample_rate_ksps: ramp.sample_rate_ksps,
            format: if complex { SampleFormat::Complex(order) } else { SampleFormat::Real },
            rx_mask,
            tx_order,
            loops: frame.loops,
            frame_period_us: frame.period_us,
            array: board.array,
            mounting: board.mounting,
        };
        radar.validate().map_err(|e| {
            let (line, command) = match e {
                ProfileError::Samples(_) | ProfileError::SamplingPastRamp(..) => (ramp.line, "ProfileConfig"),
                ProfileError::RxMask(_) => (channels_line, "ChannelConfig"),
                _ => (frame_line, "FrameConfig"),
            };
            Place { line, command }.error(Problem::Profile(e))
        })?;
        Ok(Self { radar, frames: frame.frames })
    }
}

/// The calls of `log` that succeeded, as (line, name, arguments with the status).
fn calls(log: &str) -> impl Iterator<Item = (u32, &str, core::str::Split<'_, char>)> {
    (1u32..=u32::MAX).zip(log.lines()).filter_map(|(line, content)| {
        let (_, call) = content.split_once("API:")?;
        let (call, _) = call.split_once(",$")?;
        let (_, status) = call.rsplit_once(',')?;
        let mut fields = call.split(',');
        (status.trim() == "0").then_some((line, fields.next()?, fields))
    })
}

/// Steps of the ramp generator in a microsecond.
const SLOPE_STEPS_PER_US: u64 = 900;

/// `value` steps of `steps_hz` / 2^26 in kHz, rounded: the synthesiser's codes are 26-bit fractions.
fn synthesiser_khz(value: u32, steps_hz: u64) -> u32 {
    let unit = 1000u64 << 26;
    let khz = (u64::from(value).saturating_mul(steps_hz)).saturating_add(unit / 2) / unit;
    u32::try_from(khz).unwrap_or(u32::MAX)
}

impl Calls {
    fn read(log: &str) -> Result<Self, TextError> {
        let mut this = Self {
            lines: u32::try_from(log.lines().count()).unwrap_or(u32::MAX),
            ramps: [None; MAX_RAMPS],
            frame: None,
            channels: None,
            adc_complex: None,
            order: None,
        };
        // 77 GHz devices multiply a 3.6 GHz reference, 60 GHz devices one of 2.7 GHz (rlProfileCfg_t.startFreqConst).
        let mut reference_hz = 3_600_000_000;
        for (line, name, tokens) in calls(log) {
            let args = |command| Args::new(Place { line, command }, tokens);
            match name {
                "select_chip_version" => {
                    let chip = args("select_chip_version").token()?;
                    let sixty = chip.contains("6843") || chip.contains("6443");
                    reference_hz = if sixty { 2_700_000_000 } else { 3_600_000_000 };
                }
                "ChannelConfig" => {
                    let mut args = args("ChannelConfig");
                    this.channels = Some(((args.integer()?, args.integer()?), line));
                }
                "AdcOutConfig" => this.adc_complex = Some((adc_out_config(args("AdcOutConfig"))?, line)),
                "DataFmtConfig" => this.order = Some((data_fmt_config(args("DataFmtConfig"))?, line)),
                "DataPathConfig" => data_path_config(args("DataPathConfig"))?,
                "ProfileConfig" => {
                    let mut args = args("ProfileConfig");
                    let number = args.integer::<u8>()?;
                    let slot = this.ramps.get_mut(usize::from(number));
                    let slot = slot.ok_or(args.place.error(Problem::Number(1)))?;
                    *slot = Some(profile_config(args, reference_hz)?);
                }
                "FrameConfig" => this.frame = Some((frame_config(args("FrameConfig"))?, line)),
                "AdvancedFrameConfig" => {
                    // Studio logs one beside FrameConfig; with a single subframe it says the same.
                    let mut args = args("AdvancedFrameConfig");
                    if args.integer::<u8>()? > 1 {
                        return Err(args.place.unsupported(Unsupported::FrameMode));
                    }
                }
                _ => {}
            }
        }
        Ok(this)
    }
}

/// Bits (2: 16) and format (0 real, 1 complex 1x, 2 complex 2x): whether complex.
fn adc_out_config<'a>(mut args: Args<impl Iterator<Item = &'a str>>) -> Result<bool, TextError> {
    if args.integer::<u8>()? != 2 {
        return Err(args.place.unsupported(Unsupported::AdcBits));
    }
    match args.integer::<u8>()? {
        0 => Ok(false),
        1 => Ok(true),
        2 => Err(args.place.unsupported(Unsupported::Complex2x)),
        _ => Err(args.place.error(Problem::Number(2))),
    }
}

/// Receivers, bits, format, I/Q swap (0: I first), channel interleave (1: none).
fn data_fmt_config<'a>(mut args: Args<impl Iterator<Item = &'a str>>) -> Result<IqOrder, TextError> {
    args.skip(3)?;
    let order = if args.switch()? { IqOrder::QFirst } else { IqOrder::IFirst };
    if args.switch()? { Ok(order) } else { Err(args.place.unsupported(Unsupported::Interleaved)) }
}

/// Interface (1: LVDS) and content of its first packet (1: ADC samples alone).
fn data_path_config<'a>(mut args: Args<impl Iterator<Item = &'a str>>) -> Result<(), TextError> {
    match (args.integer::<u8>()?, args.integer::<u8>()?) {
        (1, 1) => Ok(()),
        _ => Err(args.place.unsupported(Unsupported::DataPath)),
    }
}

/// `rlProfileCfg_t` from the start frequency on: that in `reference_hz` / 2^26, times in 10 ns, back-off and phase of
/// the transmitters, slope in `reference_hz` x 900 / 2^26 a microsecond (48.28 kHz/us at 77 GHz), transmit start,
/// samples, ksps.
fn profile_config<'a>(
    mut args: Args<impl Iterator<Item = &'a str>>,
    reference_hz: u64,
) -> Result<Ramp, TextError> {
    let line = args.place.line;
    let start_khz = synthesiser_khz(args.integer()?, reference_hz);
    let mut time_ns = || args.scaled(1);
    let (idle_ns, adc_start_ns, ramp_end_ns) = (time_ns()?, time_ns()?, time_ns()?);
    args.skip(2)?;
    let slope_khz_per_us = synthesiser_khz(args.integer()?, reference_hz * SLOPE_STEPS_PER_US);
    args.skip(1)?;
    let (samples, sample_rate_ksps) = (args.integer()?, args.integer()?);
    Ok(Ramp {
        line,
        start_khz,
        slope_khz_per_us,
        idle_ns,
        adc_start_ns,
        ramp_end_ns,
        samples,
        sample_rate_ksps,
    })
}

/// First and last chirp, frames, loops, period in 5 ns.
fn frame_config<'a>(mut args: Args<impl Iterator<Item = &'a str>>) -> Result<Frame, TextError> {
    let (first, last, frames, loops) = (args.integer()?, args.integer()?, args.integer()?, args.integer()?);
    const TICKS_PER_US: u32 = 200;
    let period_us = args.integer::<u32>()?.saturating_add(TICKS_PER_US / 2) / TICKS_PER_US;
    Ok(Frame { first, last, frames, loops, period_us })
}

/// First and last chirp, profile, four variations, transmitter mask.
fn define_chirps(log: &str, chirps: &mut FrameChirps, enabled: u8) -> Result<(), TextError> {
    for (line, name, tokens) in calls(log) {
        if name != "ChirpConfig" {
            continue;
        }
        let mut args = Args::new(Place { line, command: "ChirpConfig" }, tokens);
        let (start, end, profile) = (args.integer()?, args.integer()?, args.integer()?);
        if !args.zeros(4)? {
            return Err(args.place.unsupported(Unsupported::ChirpVariation));
        }
        let tx_mask = args.integer::<u8>()?;
        if tx_mask & !enabled != 0 {
            return Err(args.place.error(Problem::TxNotEnabled(tx_mask & !enabled)));
        }
        chirps.define(start, end, Chirp { profile, tx_mask });
    }
    Ok(())
}
