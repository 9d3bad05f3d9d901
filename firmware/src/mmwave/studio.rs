//! mmWave Studio's API log (`*_LogFile.txt`) to a [`RadarProfile`]: what a raw capture was made with.
//!
//! Each call is a line `<date> <time>: API:<name>,<arguments>,<status>,`. The arguments are the integers of
//! mmWaveLink's structures in their codes, named below with `mmwavelink.h`'s units. That the last number is the call's
//! status is inferred from calls without arguments (`SensorStart,0`); a call whose status is not 0 failed and is passed
//! over. Where a call repeats, the last counts.

use core::str::Split;

use rfhoi_shared::radar::RadarProfile;

use super::cfg::Board;
use super::front_end::{Channels, Frame, FrontEnd, Names, Ramp, adc_complex, buffer_order};
use super::text::{Args, Place, TextError, Unsupported};

/// What a log says of a capture.
#[derive(Debug, Clone, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct StudioProfile {
    /// Chirps, samples and frames; valid by [`RadarProfile::validate`].
    pub radar: RadarProfile,
    /// Frames of the capture; 0 for no end.
    pub frames: u16,
}

const NAMES: Names = Names {
    channels: "ChannelConfig",
    adc: "AdcOutConfig",
    adc_buffer: "DataFmtConfig",
    profile: "ProfileConfig",
    chirp: "ChirpConfig",
    frame: "FrameConfig",
};

/// Reference of the synthesiser in 77 GHz devices, Hz (`rlProfileCfg_t.startFreqConst`).
const REFERENCE_77_HZ: u64 = 3_600_000_000;
/// Reference of the synthesiser in 60 GHz devices, Hz.
const REFERENCE_60_HZ: u64 = 2_700_000_000;
/// Steps of the ramp generator in a microsecond (`rlProfileCfg_t.freqSlopeConst`).
const SLOPE_STEPS_PER_US: u64 = 900;

impl StudioProfile {
    /// Reads a log. It does not name the board, so all of `board` is taken.
    ///
    /// # Errors
    /// The line and call that is missing, malformed or not supported, or that breaks a rule of
    /// [`RadarProfile::validate`].
    pub fn parse(log: &str, board: Board) -> Result<Self, TextError> {
        let mut front_end = FrontEnd::new(&NAMES, log);
        let mut reference_hz = REFERENCE_77_HZ;
        for (line, name, tokens) in calls(log) {
            let args = |command| Args::new(Place { line, command }, tokens);
            match name {
                "select_chip_version" => {
                    let chip = args("select_chip_version").token()?;
                    let sixty = chip.contains("6843") || chip.contains("6443");
                    reference_hz = if sixty { REFERENCE_60_HZ } else { REFERENCE_77_HZ };
                }
                "ChannelConfig" => {
                    let mut args = args(NAMES.channels);
                    let (tx_mask, rx_mask) = (args.integer()?, args.integer()?);
                    front_end.channels = Some((Channels { rx_mask, tx_mask }, line));
                }
                "AdcOutConfig" => front_end.complex = Some((adc_complex(args(NAMES.adc))?, line)),
                "DataFmtConfig" => {
                    let mut args = args(NAMES.adc_buffer);
                    // Receivers, word length and format, as in the calls before.
                    args.skip(3)?;
                    front_end.order = Some((buffer_order(&mut args)?, line));
                }
                "DataPathConfig" => data_path(args("DataPathConfig"))?,
                "ProfileConfig" => {
                    front_end.take_profile(args(NAMES.profile), |args| ramp(args, reference_hz))?;
                }
                "FrameConfig" => front_end.frame = Some((frame(args(NAMES.frame))?, line)),
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
        let mut chirps = front_end.chirps()?;
        for (line, name, tokens) in calls(log) {
            if name == NAMES.chirp {
                chirps.take(Args::new(Place { line, command: NAMES.chirp }, tokens))?;
            }
        }
        let radar = front_end.profile(&chirps, board)?;
        Ok(Self { radar, frames: front_end.frame.map_or(0, |(frame, _)| frame.frames) })
    }
}

/// The calls of `log` that succeeded, as (line, name, arguments with the status).
fn calls(log: &str) -> impl Iterator<Item = (u32, &str, Split<'_, char>)> {
    (1u32..=u32::MAX).zip(log.lines()).filter_map(|(line, content)| {
        let (_, call) = content.split_once("API:")?;
        let call = call.trim_end().strip_suffix(',')?;
        let (_, status) = call.rsplit_once(',')?;
        let mut fields = call.split(',');
        (status == "0").then_some((line, fields.next()?, fields))
    })
}

/// `code` steps of `reference_hz` / 2^26, in kHz, rounded.
fn synthesiser_khz(code: u32, reference_hz: u64) -> u32 {
    const UNIT: u64 = 1000 << 26;
    let khz = u64::from(code).saturating_mul(reference_hz).saturating_add(UNIT / 2) / UNIT;
    u32::try_from(khz).unwrap_or(u32::MAX)
}

/// Interface (1: LVDS) and content of its first packet (1: ADC samples alone).
fn data_path<'a>(mut args: Args<impl Iterator<Item = &'a str>>) -> Result<(), TextError> {
    match (args.integer::<u8>()?, args.integer::<u8>()?) {
        (1, 1) => Ok(()),
        _ => Err(args.place.unsupported(Unsupported::DataPath)),
    }
}

/// `rlProfileCfg_t` from the start frequency on: that in `reference_hz` / 2^26 (53.64 Hz at 77 GHz), times in 10 ns,
/// back-off and phase of the transmitters, slope in 900 such steps a microsecond (48.28 kHz/us), transmit start,
/// samples, ksps.
fn ramp<'a>(args: &mut Args<impl Iterator<Item = &'a str>>, reference_hz: u64) -> Result<Ramp, TextError> {
    let start_khz = synthesiser_khz(args.integer()?, reference_hz);
    let (idle_ns, adc_start_ns, ramp_end_ns) = (args.scaled(1)?, args.scaled(1)?, args.scaled(1)?);
    args.skip(2)?;
    let slope_khz_per_us = synthesiser_khz(args.integer()?, reference_hz * SLOPE_STEPS_PER_US);
    args.skip(1)?;
    let (samples, sample_rate_ksps) = (args.integer()?, args.integer()?);
    Ok(Ramp { start_khz, slope_khz_per_us, idle_ns, adc_start_ns, ramp_end_ns, samples, sample_rate_ksps })
}

/// First and last chirp, frames, loops, period in 5 ns.
fn frame<'a>(mut args: Args<impl Iterator<Item = &'a str>>) -> Result<Frame, TextError> {
    const TICKS_PER_US: u32 = 200;
    let (first, last, frames, loops) = (args.integer()?, args.integer()?, args.integer()?, args.integer()?);
    let period_us = args.integer::<u32>()?.saturating_add(TICKS_PER_US / 2) / TICKS_PER_US;
    Ok(Frame { first, last, loops, frames, period_us })
}
