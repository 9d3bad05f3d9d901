//! CLI text to [`CliProfile`].
//!
//! Commands may come in any order and the last of a kind counts, as on the device; `flushCfg` forgets profiles, chirps
//! and frame. Commands that bear on neither the radar profile nor the streamed data are passed over.

use rfhoi_shared::array::AntennaArray;
use rfhoi_shared::radar::{IqOrder, ProfileError, RadarProfile, SampleFormat};

use super::{Board, CliProfile, DemoOptions, GuiMonitor, LvdsData, LvdsStream, PointOutput};
use crate::mmwave::chirps::{Chirp, FrameChirps, MAX_RAMPS, Ramp};
use crate::mmwave::text::{Args, Place, Problem, TextError, Unsupported};

/// A value and the line that set it.
type Set<T> = Option<(T, u32)>;

#[derive(Debug, Clone, Copy)]
struct Channels {
    rx_mask: u8,
    tx_mask: u8,
}

#[derive(Debug, Clone, Copy)]
struct AdcBuffer {
    complex: bool,
    order: IqOrder,
}

#[derive(Debug, Clone, Copy)]
struct Frame {
    first: u16,
    last: u16,
    loops: u16,
    period_us: u32,
}

/// All but the chirps, which only the frame makes sense of.
struct Commands {
    lines: u32,
    flushed: u32,
    array: AntennaArray,
    channels: Set<Channels>,
    adc_complex: Set<bool>,
    adc_buffer: Set<AdcBuffer>,
    ramps: [Option<Ramp>; MAX_RAMPS],
    frame: Set<Frame>,
    demo: DemoOptions,
}

impl CliProfile {
    /// Reads a profile's text: one command a line, `%` or `#` begins a comment, line ends as in Unix or DOS.
    ///
    /// Numbers are taken exactly as they are written, to the resolution of [`RadarProfile`]'s fields.
    ///
    /// # Errors
    /// The line and command that is missing, malformed or not supported, or that breaks a rule of
    /// [`RadarProfile::validate`].
    pub fn parse(text: &str, board: Board) -> Result<Self, TextError> {
        let commands = Commands::read(text, board.array)?;
        let missing = |command| Place { line: commands.lines, command }.error(Problem::Missing);
        let (channels, channels_line) = commands.channels.ok_or(missing("channelCfg"))?;
        let (complex, _) = commands.adc_complex.ok_or(missing("adcCfg"))?;
        let (adc_buffer, adc_buffer_line) = commands.adc_buffer.ok_or(missing("adcbufCfg"))?;
        if commands.ramps.iter().all(Option::is_none) {
            return Err(missing("profileCfg"));
        }
        let (frame, frame_line) = commands.frame.ok_or(missing("frameCfg"))?;

        let at_frame = Place { line: frame_line, command: "frameCfg" };
        let mut chirps = FrameChirps::new(frame.first, frame.last).map_err(|p| at_frame.error(p))?;
        let chirps_line = commands.chirps(text, &mut chirps, channels.tx_mask)?;
        let (profile, tx_order) = chirps.resolve().map_err(|p| at_frame.error(p))?;
        let ramp = commands.ramps.get(usize::from(profile)).copied().flatten();
        let ramp = ramp.ok_or(at_frame.error(Problem::ProfileUndefined(profile)))?;
        if complex != adc_buffer.complex {
            let place = Place { line: adc_buffer_line, command: "adcbufCfg" };
            return Err(place.error(Problem::FormatMismatch));
        }

        let radar = RadarProfile {
            start_khz: ramp.start_khz,
            slope_khz_per_us: ramp.slope_khz_per_us,
            idle_ns: ramp.idle_ns,
            adc_start_ns: ramp.adc_start_ns,
            ramp_end_ns: ramp.ramp_end_ns,
            samples: ramp.samples,
            sample_rate_ksps: ramp.sample_rate_ksps,
            format: if complex { SampleFormat::Complex(adc_buffer.order) } else { SampleFormat::Real },
            rx_mask: channels.rx_mask,
            tx_order,
            loops: frame.loops,
            frame_period_us: frame.period_us,
            array: commands.array,
            mounting: board.mounting,
        };
        radar.validate().map_err(|e| {
            let (line, command) = match e {
                ProfileError::Samples(_) | ProfileError::SamplingPastRamp(..) => (ramp.line, "profileCfg"),
                ProfileError::ZeroParameter if radar.frame_period_us != 0 => (ramp.line, "profileCfg"),
                ProfileError::RxMask(_) => (channels_line, "channelCfg"),
                ProfileError::TxOrder => (chirps_line, "chirpCfg"),
                ProfileError::ZeroParameter | ProfileError::Loops(_) | ProfileError::FrameTooLong(..) => {
                    (frame_line, "frameCfg")
                }
            };
            Place { line, command }.error(Problem::Profile(e))
        })?;
        Ok(Self { radar, demo: commands.demo })
    }
}

/// The commands of `text` as (line, name, arguments), comments and blank lines left out.
fn commands(text: &str) -> impl Iterator<Item = (u32, &str, core::str::SplitAsciiWhitespace<'_>)> {
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
    fn read(text: &str, default_array: AntennaArray) -> Result<Self, TextError> {
        let mut this = Self {
            lines: u32::try_from(text.lines().count()).unwrap_or(u32::MAX),
            flushed: 0,
            array: platform(text).unwrap_or(default_array),
            channels: None,
            adc_complex: None,
            adc_buffer: None,
            ramps: [None; MAX_RAMPS],
            frame: None,
            demo: DemoOptions::default(),
        };
        for (line, command, tokens) in commands(text) {
            this.take(line, command, tokens)?;
        }
        Ok(this)
    }

    fn take<'a>(
        &mut self,
        line: u32,
        command: &str,
        tokens: impl Iterator<Item = &'a str>,
    ) -> Result<(), TextError> {
        let args = |command| Args::new(Place { line, command }, tokens);
        match command {
            "flushCfg" => {
                self.flushed = line;
                self.ramps = [None; MAX_RAMPS];
                self.frame = None;
            }
            "dfeDataOutputMode" => dfe_data_output_mode(args("dfeDataOutputMode"))?,
            "advFrameCfg" => {
                return Err(Place { line, command: "advFrameCfg" }.unsupported(Unsupported::FrameMode));
            }
            "bpmCfg" => bpm_cfg(args("bpmCfg"))?,
            "channelCfg" => self.channels = Some((channel_cfg(args("channelCfg"))?, line)),
            "adcCfg" => self.adc_complex = Some((adc_cfg(args("adcCfg"))?, line)),
            "adcbufCfg" => self.adc_buffer = Some((adcbuf_cfg(args("adcbufCfg"))?, line)),
            "profileCfg" => {
                let mut args = args("profileCfg");
                let number = args.integer::<u8>()?;
                let slot = self.ramps.get_mut(usize::from(number));
                let slot = slot.ok_or(args.place.error(Problem::Number(1)))?;
                *slot = Some(profile_cfg(args)?);
            }
            "frameCfg" => {
                let (frame, frames) = frame_cfg(args("frameCfg"))?;
                self.frame = Some((frame, line));
                self.demo.frames = frames;
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

    /// Defines the frame's chirps after the last flush; the line of the last one.
    fn chirps(&self, text: &str, chirps: &mut FrameChirps, enabled: u8) -> Result<u32, TextError> {
        let mut last = self.lines;
        for (line, command, tokens) in commands(text) {
            if command != "chirpCfg" || line < self.flushed {
                continue;
            }
            let mut args = Args::new(Place { line, command: "chirpCfg" }, tokens);
            let (start, end, profile) = (args.integer()?, args.integer()?, args.integer()?);
            if !args.zeros(4)? {
                return Err(args.place.unsupported(Unsupported::ChirpVariation));
            }
            let tx_mask = args.integer::<u8>()?;
            if tx_mask & !enabled != 0 {
                return Err(args.place.error(Problem::TxNotEnabled(tx_mask & !enabled)));
            }
            chirps.define(start, end, Chirp { profile, tx_mask });
            last = line;
        }
        Ok(last)
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

fn channel_cfg<'a>(mut args: Args<impl Iterator<Item = &'a str>>) -> Result<Channels, TextError> {
    Ok(Channels { rx_mask: args.integer()?, tx_mask: args.integer()? })
}

/// Whether the ADC gives complex samples.
fn adc_cfg<'a>(mut args: Args<impl Iterator<Item = &'a str>>) -> Result<bool, TextError> {
    // 0: 12 bits, 1: 14 bits, 2: 16 bits.
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

fn adcbuf_cfg<'a>(mut args: Args<impl Iterator<Item = &'a str>>) -> Result<AdcBuffer, TextError> {
    args.skip(1)?;
    // Here 0 is complex and 1 real, the other way round than in adcCfg.
    let complex = !args.switch()?;
    let order = if args.switch()? { IqOrder::QFirst } else { IqOrder::IFirst };
    let separate = args.switch()?;
    if !separate {
        return Err(args.place.unsupported(Unsupported::Interleaved));
    }
    Ok(AdcBuffer { complex, order })
}

/// From the start frequency on.
fn profile_cfg<'a>(mut args: Args<impl Iterator<Item = &'a str>>) -> Result<Ramp, TextError> {
    // GHz to kHz, us to ns, MHz/us to kHz/us.
    let start_khz = args.scaled(6)?;
    let (idle_ns, adc_start_ns, ramp_end_ns) = (args.scaled(3)?, args.scaled(3)?, args.scaled(3)?);
    // Power back-off and phase of the transmitters.
    args.skip(2)?;
    let slope_khz_per_us = args.scaled(3)?;
    // Start time of the transmitters.
    args.skip(1)?;
    let (samples, sample_rate_ksps) = (args.integer()?, args.integer()?);
    Ok(Ramp {
        line: args.place.line,
        start_khz,
        slope_khz_per_us,
        idle_ns,
        adc_start_ns,
        ramp_end_ns,
        samples,
        sample_rate_ksps,
    })
}

/// The frame, and how many of them.
fn frame_cfg<'a>(mut args: Args<impl Iterator<Item = &'a str>>) -> Result<(Frame, u16), TextError> {
    let (first, last, loops) = (args.integer()?, args.integer()?, args.integer()?);
    let frames = args.integer()?;
    // ms to us.
    Ok((Frame { first, last, loops, period_us: args.scaled(3)? }, frames))
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
