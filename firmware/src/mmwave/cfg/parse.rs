//! CLI text to [`CliProfile`].
//!
//! Commands may come in any order and the last of a kind counts, as on the device; `flushCfg` forgets profiles, chirps
//! and frame. Commands that bear on neither the radar profile nor the streamed data are passed over.

use core::str::SplitAsciiWhitespace;

use rfhoi_shared::array::AntennaArray;

use super::{Board, CliProfile, DemoOptions, GuiMonitor, LvdsData, LvdsStream, PointOutput};
use crate::mmwave::front_end::{Channels, Frame, FrontEnd, Names, Ramp, adc_complex, buffer_order};
use crate::mmwave::text::{Args, Place, Problem, TextError, Unsupported};

const NAMES: Names = Names {
    channels: "channelCfg",
    adc: "adcCfg",
    adc_buffer: "adcbufCfg",
    profile: "profileCfg",
    chirp: "chirpCfg",
    frame: "frameCfg",
};

/// All but the chirps, which only the frame makes sense of.
struct Commands {
    /// Line of the last `flushCfg`.
    flushed: u32,
    front_end: FrontEnd,
    /// Whether the ADC buffer holds complex samples, and the line that says so.
    buffer_complex: Option<(bool, u32)>,
    demo: DemoOptions,
}

impl CliProfile {
    /// Reads a profile's text: one command a line, `%` or `#` begins a comment, line ends as in Unix or DOS.
    ///
    /// Numbers are taken exactly as they are written, to the resolution of [`RadarProfile`]'s fields; digits past it
    /// round.
    ///
    /// # Errors
    /// The line and command that is missing, malformed or not supported, or that breaks a rule of
    /// [`RadarProfile::validate`].
    ///
    /// [`RadarProfile`]: rfhoi_shared::radar::RadarProfile
    /// [`RadarProfile::validate`]: rfhoi_shared::radar::RadarProfile::validate
    pub fn parse(text: &str, board: Board) -> Result<Self, TextError> {
        let mut read = Commands {
            flushed: 0,
            front_end: FrontEnd::new(&NAMES, text),
            buffer_complex: None,
            demo: DemoOptions::default(),
        };
        for (line, command, tokens) in commands(text) {
            read.take(line, command, tokens)?;
        }
        let mut chirps = read.front_end.chirps()?;
        for (line, command, tokens) in commands(text) {
            if command == NAMES.chirp && line > read.flushed {
                chirps.take(Args::new(Place { line, command: NAMES.chirp }, tokens))?;
            }
        }
        let array = platform(text).unwrap_or(board.array);
        let radar = read.front_end.profile(&chirps, Board { array, ..board })?;
        if let (Some((adc, _)), Some((buffer, line))) = (read.front_end.complex, read.buffer_complex)
            && adc != buffer
        {
            return Err(Place { line, command: NAMES.adc_buffer }.error(Problem::FormatMismatch));
        }
        Ok(Self { radar, demo: read.demo })
    }
}

/// The commands of `text` as (line, name, arguments), comments and blank lines left out.
fn commands(text: &str) -> impl Iterator<Item = (u32, &str, SplitAsciiWhitespace<'_>)> {
    (1u32..=u32::MAX).zip(text.lines()).filter_map(|(line, content)| {
        let code = content.split(['%', '#']).next()?;
        let mut tokens = code.split_ascii_whitespace();
        Some((line, tokens.next()?, tokens))
    })
}

/// The board that the visualiser's comment names, where it is one of ours.
fn platform(text: &str) -> Option<AntennaArray> {
    text.lines().find_map(|line| {
        let comment = line.trim_start().strip_prefix('%')?.trim_start();
        match comment.strip_prefix("Platform:")?.trim() {
            "xWR18xx_AOP" => Some(AntennaArray::Awr1843Aop),
            "xWR18xx" => Some(AntennaArray::Xwr1843Boost),
            "xWR16xx" => Some(AntennaArray::Xwr1642Boost),
            "xWR68xx_AOP" => Some(AntennaArray::Iwr6843Aop),
            _ => None,
        }
    })
}

impl Commands {
    fn take<'a>(
        &mut self,
        line: u32,
        command: &str,
        tokens: impl Iterator<Item = &'a str>,
    ) -> Result<(), TextError> {
        let args = |command| Args::new(Place { line, command }, tokens);
        let front_end = &mut self.front_end;
        match command {
            "flushCfg" => {
                self.flushed = line;
                front_end.flush();
            }
            "dfeDataOutputMode" => dfe_data_output_mode(args("dfeDataOutputMode"))?,
            "advFrameCfg" => {
                return Err(Place { line, command: "advFrameCfg" }.unsupported(Unsupported::FrameMode));
            }
            "bpmCfg" => bpm_cfg(args("bpmCfg"))?,
            "channelCfg" => {
                let mut args = args(NAMES.channels);
                let (rx_mask, tx_mask) = (args.integer()?, args.integer()?);
                front_end.channels = Some((Channels { rx_mask, tx_mask }, line));
            }
            "adcCfg" => front_end.complex = Some((adc_complex(args(NAMES.adc))?, line)),
            "adcbufCfg" => {
                let mut args = args(NAMES.adc_buffer);
                args.skip(1)?;
                // Here 0 is complex and 1 real, the other way round than in adcCfg.
                self.buffer_complex = Some((!args.switch()?, line));
                front_end.order = Some((buffer_order(&mut args)?, line));
            }
            "profileCfg" => front_end.take_profile(args(NAMES.profile), ramp)?,
            "frameCfg" => {
                let frame = frame_cfg(args(NAMES.frame))?;
                front_end.frame = Some((frame, line));
                self.demo.frames = frame.frames;
            }
            "lvdsStreamCfg" => self.demo.lvds = lvds_stream_cfg(args("lvdsStreamCfg"))?,
            "guiMonitor" => self.demo.gui = gui_monitor(args("guiMonitor"))?,
            "clutterRemoval" => {
                let mut args = args("clutterRemoval");
                args.skip(1)?;
                self.demo.clutter_removal = args.switch()?;
            }
            _ => {}
        }
        Ok(())
    }
}

fn dfe_data_output_mode<'a>(mut args: Args<impl Iterator<Item = &'a str>>) -> Result<(), TextError> {
    // 1: frames, 2: continuous, 3: advanced frames.
    match args.integer::<u8>()? {
        1 => Ok(()),
        _ => Err(args.place.unsupported(Unsupported::FrameMode)),
    }
}

fn bpm_cfg<'a>(mut args: Args<impl Iterator<Item = &'a str>>) -> Result<(), TextError> {
    args.skip(1)?;
    if args.switch()? { Err(args.place.unsupported(Unsupported::BinaryPhase)) } else { Ok(()) }
}

/// `profileCfg` from the start frequency on.
fn ramp<'a>(args: &mut Args<impl Iterator<Item = &'a str>>) -> Result<Ramp, TextError> {
    // GHz to kHz, us to ns, MHz/us to kHz/us.
    let start_khz = args.scaled(6)?;
    let (idle_ns, adc_start_ns, ramp_end_ns) = (args.scaled(3)?, args.scaled(3)?, args.scaled(3)?);
    // Power back-off and phase of the transmitters.
    args.skip(2)?;
    let slope_khz_per_us = args.scaled(3)?;
    // Start time of the transmitters.
    args.skip(1)?;
    let (samples, sample_rate_ksps) = (args.integer()?, args.integer()?);
    Ok(Ramp { start_khz, slope_khz_per_us, idle_ns, adc_start_ns, ramp_end_ns, samples, sample_rate_ksps })
}

fn frame_cfg<'a>(mut args: Args<impl Iterator<Item = &'a str>>) -> Result<Frame, TextError> {
    let (first, last, loops) = (args.integer()?, args.integer()?, args.integer()?);
    let frames = args.integer()?;
    // ms to us.
    Ok(Frame { first, last, loops, frames, period_us: args.scaled(3)? })
}

fn lvds_stream_cfg<'a>(mut args: Args<impl Iterator<Item = &'a str>>) -> Result<LvdsStream, TextError> {
    args.skip(1)?;
    let header = args.switch()?;
    let data = match args.integer::<u8>()? {
        0 => LvdsData::Off,
        1 => LvdsData::Adc,
        4 => LvdsData::CpAdcCq,
        _ => return Err(args.place.error(Problem::Number(3))),
    };
    Ok(LvdsStream { header, data, software: args.switch()? })
}

fn gui_monitor<'a>(mut args: Args<impl Iterator<Item = &'a str>>) -> Result<GuiMonitor, TextError> {
    args.skip(1)?;
    let points = match args.integer::<u8>()? {
        0 => PointOutput::Off,
        1 => PointOutput::WithSideInfo,
        2 => PointOutput::Alone,
        _ => return Err(args.place.error(Problem::Number(2))),
    };
    Ok(GuiMonitor {
        points,
        range_profile: args.switch()?,
        noise_profile: args.switch()?,
        azimuth_heatmap: args.switch()?,
        range_doppler_heatmap: args.switch()?,
        statistics: args.switch()?,
    })
}
