//! What both text formats say of the radar's front end, gathered from commands in any order into a [`RadarProfile`].

use heapless::Vec;
use rfhoi_shared::radar::{IqOrder, MAX_TX_SLOTS, ProfileError, RadarProfile, SampleFormat};

use super::cfg::Board;
use super::text::{Args, Place, Problem, TextError, Unsupported};

/// Profiles of a radar (mmWaveLink `rlProfileCfg_t.profileId`: 0 to 3).
const MAX_RAMPS: usize = 4;

/// How a text format spells its commands.
pub(super) struct Names {
    pub(super) channels: &'static str,
    pub(super) adc: &'static str,
    pub(super) adc_buffer: &'static str,
    pub(super) profile: &'static str,
    pub(super) chirp: &'static str,
    pub(super) frame: &'static str,
}

/// Antennas that are enabled.
#[derive(Debug, Clone, Copy)]
pub(super) struct Channels {
    pub(super) rx_mask: u8,
    pub(super) tx_mask: u8,
}

/// Ramp and sampling of one profile, in the units of [`RadarProfile`].
#[derive(Debug, Clone, Copy)]
pub(super) struct Ramp {
    pub(super) start_khz: u32,
    pub(super) slope_khz_per_us: u32,
    pub(super) idle_ns: u32,
    pub(super) adc_start_ns: u32,
    pub(super) ramp_end_ns: u32,
    pub(super) samples: u16,
    pub(super) sample_rate_ksps: u32,
}

/// Which chirps make a frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct Frame {
    pub(super) first: u16,
    pub(super) last: u16,
    pub(super) loops: u16,
    /// Frames until the radar stops, 0 for no end.
    pub(super) frames: u16,
    pub(super) period_us: u32,
}

/// A value and the line that set it.
type Set<T> = Option<(T, u32)>;

/// Everything but the chirps, which only the frame makes sense of.
pub(super) struct FrontEnd {
    names: &'static Names,
    /// Lines of the text.
    lines: u32,
    pub(super) channels: Set<Channels>,
    pub(super) complex: Set<bool>,
    pub(super) order: Set<IqOrder>,
    ramps: [Set<Ramp>; MAX_RAMPS],
    pub(super) frame: Set<Frame>,
}

impl FrontEnd {
    pub(super) fn new(names: &'static Names, text: &str) -> Self {
        Self {
            names,
            lines: u32::try_from(text.lines().count()).unwrap_or(u32::MAX),
            channels: None,
            complex: None,
            order: None,
            ramps: [None; MAX_RAMPS],
            frame: None,
        }
    }

    /// Forgets profiles and frame.
    pub(super) fn flush(&mut self) {
        self.ramps = [None; MAX_RAMPS];
        self.frame = None;
    }

    /// Takes a profile: its number, and what `ramp` makes of the arguments after it.
    pub(super) fn take_profile<'a, I: Iterator<Item = &'a str>>(
        &mut self,
        mut args: Args<I>,
        ramp: impl FnOnce(&mut Args<I>) -> Result<Ramp, TextError>,
    ) -> Result<(), TextError> {
        let number = args.integer::<u8>()?;
        let slot = self.ramps.get_mut(usize::from(number)).ok_or(args.place.error(Problem::Number(1)))?;
        *slot = Some((ramp(&mut args)?, args.place.line));
        Ok(())
    }

    fn last_line(&self, command: &'static str) -> Place {
        Place { line: self.lines, command }
    }

    /// `set`, or that `command` is missing.
    fn need<T: Copy>(&self, set: Set<T>, command: &'static str) -> Result<(T, Place), TextError> {
        let (value, line) = set.ok_or(self.last_line(command).error(Problem::Missing))?;
        Ok((value, Place { line, command }))
    }

    /// The frame's chirps, to be defined by [`FrameChirps::take`].
    pub(super) fn chirps(&self) -> Result<FrameChirps, TextError> {
        let (channels, _) = self.need(self.channels, self.names.channels)?;
        let (frame, at_frame) = self.need(self.frame, self.names.frame)?;
        let count = frame.last.checked_sub(frame.first).ok_or(at_frame.error(Problem::ChirpOrder))?;
        let count = count.saturating_add(1);
        let mut slots = Vec::new();
        slots.resize(usize::from(count), None).map_err(|_| at_frame.error(Problem::TooManySlots(count)))?;
        let place = self.last_line(self.names.chirp);
        Ok(FrameChirps { first: frame.first, slots, tx_enabled: channels.tx_mask, place })
    }

    /// The whole, checked by [`RadarProfile::validate`].
    pub(super) fn profile(&self, chirps: &FrameChirps, board: Board) -> Result<RadarProfile, TextError> {
        let names = self.names;
        let (channels, at_channels) = self.need(self.channels, names.channels)?;
        let (complex, _) = self.need(self.complex, names.adc)?;
        let (order, _) = self.need(self.order, names.adc_buffer)?;
        let (frame, at_frame) = self.need(self.frame, names.frame)?;
        if self.ramps.iter().all(Option::is_none) {
            return Err(self.last_line(names.profile).error(Problem::Missing));
        }
        let (number, tx_order) = chirps.resolve().map_err(|problem| at_frame.error(problem))?;
        let ramp = self.ramps.get(usize::from(number)).copied().flatten();
        let (ramp, line) = ramp.ok_or(at_frame.error(Problem::ProfileUndefined(number)))?;
        let at_profile = Place { line, command: names.profile };

        let profile = RadarProfile {
            start_khz: ramp.start_khz,
            slope_khz_per_us: ramp.slope_khz_per_us,
            idle_ns: ramp.idle_ns,
            adc_start_ns: ramp.adc_start_ns,
            ramp_end_ns: ramp.ramp_end_ns,
            samples: ramp.samples,
            sample_rate_ksps: ramp.sample_rate_ksps,
            format: if complex { SampleFormat::Complex(order) } else { SampleFormat::Real },
            rx_mask: channels.rx_mask,
            tx_order,
            loops: frame.loops,
            frame_period_us: frame.period_us,
            array: board.array,
            mounting: board.mounting,
        };
        profile.validate().map_err(|e| {
            let place = match e {
                ProfileError::Samples(_) | ProfileError::SamplingPastRamp(..) => at_profile,
                ProfileError::ZeroParameter if frame.period_us != 0 => at_profile,
                ProfileError::RxMask(_) => at_channels,
                ProfileError::TxOrder => chirps.place,
                ProfileError::ZeroParameter | ProfileError::Loops(_) | ProfileError::FrameTooLong(..) => {
                    at_frame
                }
            };
            place.error(Problem::Profile(e))
        })?;
        Ok(profile)
    }
}

/// What one chirp is.
#[derive(Debug, Clone, Copy)]
struct Chirp {
    /// Number of its profile.
    profile: u8,
    /// Transmitters that are on.
    tx_mask: u8,
}

/// The chirps from a frame's first to its last index; others are of no effect.
#[derive(Debug, Clone)]
pub(super) struct FrameChirps {
    first: u16,
    slots: Vec<Option<Chirp>, MAX_TX_SLOTS>,
    tx_enabled: u8,
    /// Where the last of them was defined.
    place: Place,
}

impl FrameChirps {
    /// Takes a definition: first and last index, profile, four variations, transmitter mask (`rlChirpCfg_t`). A later
    /// one replaces an earlier one.
    pub(super) fn take<'a>(
        &mut self,
        mut args: Args<impl Iterator<Item = &'a str>>,
    ) -> Result<(), TextError> {
        let (start, end, profile) = (args.integer::<u16>()?, args.integer::<u16>()?, args.integer()?);
        if !args.zeros(4)? {
            return Err(args.place.unsupported(Unsupported::ChirpVariation));
        }
        let tx_mask = args.integer::<u8>()?;
        if tx_mask & !self.tx_enabled != 0 {
            return Err(args.place.error(Problem::TxNotEnabled(tx_mask & !self.tx_enabled)));
        }
        for (index, slot) in (self.first..=u16::MAX).zip(&mut self.slots) {
            if (start..=end).contains(&index) {
                *slot = Some(Chirp { profile, tx_mask });
                self.place = args.place;
            }
        }
        Ok(())
    }

    /// Number of the one profile that all chirps use, and their transmitters in the order of time.
    fn resolve(&self) -> Result<(u8, Vec<u8, MAX_TX_SLOTS>), Problem> {
        let mut profile = None;
        let mut tx_order = Vec::new();
        for (index, slot) in (self.first..=u16::MAX).zip(&self.slots) {
            let chirp = slot.ok_or(Problem::ChirpUndefined(index))?;
            if *profile.get_or_insert(chirp.profile) != chirp.profile {
                return Err(Problem::Unsupported(Unsupported::SeveralProfiles));
            }
            tx_order.push(chirp.tx_mask).map_err(|_| Problem::TooManySlots(u16::MAX))?;
        }
        Ok((profile.unwrap_or_default(), tx_order))
    }
}

/// Whether the ADC gives complex samples: word length (2: 16 bits) and format (0 real, 1 complex 1x, 2 complex 2x), as
/// `rlAdcBitFormat_t` codes them.
pub(super) fn adc_complex<'a>(mut args: Args<impl Iterator<Item = &'a str>>) -> Result<bool, TextError> {
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

/// Order of I and Q (0: I first) and interleaving of receivers (1: none, which it must be).
pub(super) fn buffer_order<'a>(args: &mut Args<impl Iterator<Item = &'a str>>) -> Result<IqOrder, TextError> {
    let order = if args.switch()? { IqOrder::QFirst } else { IqOrder::IFirst };
    if args.switch()? { Ok(order) } else { Err(args.place.unsupported(Unsupported::Interleaved)) }
}
