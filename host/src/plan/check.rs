//! Whether a configuration meets all needs within all limits, and what it costs.

use std::fmt;

use rfhoi_shared::config::{ConfigError, Processing, RadarConfig, RadarInput};
use rfhoi_shared::radar::{MAX_GATE_BINS, RadarProfile};
use rfhoi_shared::scene::Unmet;
use rfhoi_shared::units::{Metres, MetresPerSecond, Seconds};

use super::instructions::Instructions;
use super::limits::{Board, LEAST_SAMPLES, Link, SAMPLE_RATES_KSPS, band_end_khz};
use super::needs::{Antennas, Needs, beam_rad, extent};
use super::reader::{Reading, Rounds};
use super::space::Config;
use crate::simulate::scene::FIELD_OF_VIEW_RAD;

/// Bins that a point of a map may stand for. A Hann window has a noise bandwidth of 1.5 bins: neighbours nearer than that are
/// no two measurements. More points than bins only interpolate.
pub const BINS_A_POINT: f32 = 1.5;
/// Points of the angle map in a half-power beam: with two, none of its power falls between.
pub const POINTS_A_BEAM: f32 = 2.0;
/// Share of the fastest reach in which steps of phase must mean something: more than half, so that most of them tell its
/// direction.
pub const LEAST_REACH_SHARE: f64 = 0.5;

/// What there is to meet the needs with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Means {
    /// From the radar to the bridge.
    pub link: Link,
    /// The bridge.
    pub board: Board,
}

impl Default for Means {
    fn default() -> Self {
        Self { link: Link::FAST_ETHERNET, board: Board::NUCLEO_H743ZI }
    }
}

/// What a configuration costs.
#[derive(Debug, Clone, PartialEq)]
pub struct Cost {
    /// Load on the link to the bridge, bit/s, with what it adds.
    pub link_bit_s: f64,
    /// Bytes of a gated cube.
    pub cube_bytes: u32,
    /// Cubes that the board has memory for, one or two.
    pub cubes: u8,
    /// Instructions of a frame on the bridge.
    pub instructions: Instructions,
    /// Instructions that the board has in a frame's time.
    pub instructions_there: f64,
    /// How each tag is read by each antenna.
    pub reading: Reading,
    /// Values of the three maps of a frame.
    pub map_values: u32,
}

/// What keeps a configuration from working, with the numbers that collide; in the order in which they are checked.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Binding {
    /// Antennas do not tell azimuth: positions, and how many the board has.
    Azimuth(u16, u16),
    /// Antennas do not tell elevation: the same.
    Elevation(u16, u16),
    /// The range bin is wider than needed: bin, need.
    RangeBin(Metres, Metres),
    /// The radar does not sample at that rate, ksps.
    SampleRate(u32),
    /// The ramp leaves the band: its end and the band's, GHz.
    Band(f64, f64),
    /// Range span or unambiguous speed.
    Scene(Unmet),
    /// The Doppler bin is wider than needed: bin, need.
    VelocityBin(MetresPerSecond, MetresPerSecond),
    /// The gate has more bins than a bridge keeps.
    GateBins(u16),
    /// A rule of profiles or bridges.
    Config(ConfigError),
    /// The stock firmware refuses: samples, loops, antennas.
    StockFirmware(u16, u16, usize),
    /// The link is too slow: bit/s needed.
    LinkFull(f64, Link),
    /// Bytes of one gated cube, and of the board.
    Cube(u32, u32),
    /// Instructions of a frame, and of the board in its time.
    Instructions(f64, f64),
    /// A map has fewer points than it needs: points, bins.
    MapPoints(u16, u16),
    /// The same of the angle map: points, degrees of a beam.
    AnglePoints(u16, f32),
    /// Not the number of antennas that was asked for.
    NotAsAsked(u8, u8),
    /// More antennas than the reader has.
    NoSuchAntenna(u8, u8),
    /// A tag is read less than once a frame: tags, antennas, interval, speed that is followed always, frame.
    ReadInterval(u8, u8, Reading, Seconds),
    /// Steps mean something in too little of a reach: tags, antennas, reading, fastest tag.
    Reach(u8, u8, Reading, MetresPerSecond),
}

impl Binding {
    /// Its place in the order of checks.
    pub fn stage(&self) -> usize {
        match self {
            Self::Azimuth(..) => 0,
            Self::Elevation(..) => 1,
            Self::RangeBin(..) => 2,
            Self::SampleRate(..) => 3,
            Self::Band(..) => 4,
            Self::Scene(Unmet::Depth { .. }) => 5,
            Self::Scene(Unmet::Speed { .. }) => 6,
            Self::VelocityBin(..) => 7,
            Self::GateBins(..) => 8,
            Self::Config(..) => 9,
            Self::StockFirmware(..) => 10,
            Self::LinkFull(..) => 11,
            Self::Cube(..) => 12,
            Self::Instructions(..) => 13,
            Self::MapPoints(..) => 14,
            Self::AnglePoints(..) => 15,
            Self::NotAsAsked(..) => 16,
            Self::NoSuchAntenna(..) => 17,
            Self::ReadInterval(..) => 18,
            Self::Reach(..) => 19,
        }
    }

    /// How far it is from being met: what is needed over what there is, above 1; infinite where that is no matter of degree.
    fn excess(&self) -> f64 {
        let over = |needed: f32, there: f32| f64::from(needed) / f64::from(there);
        match *self {
            Self::RangeBin(bin, need) => over(bin.0, need.0),
            Self::SampleRate(ksps) => {
                let (least, most) = (*SAMPLE_RATES_KSPS.start() as f32, *SAMPLE_RATES_KSPS.end() as f32);
                over(least, ksps as f32).max(over(ksps as f32, most))
            }
            Self::Band(end, band) => end / band,
            Self::Scene(Unmet::Depth { needed, span }) => over(needed.0, span.0),
            Self::Scene(Unmet::Speed { needed, span }) | Self::VelocityBin(needed, span) => {
                over(needed.0, span.0)
            }
            Self::GateBins(bins) => over(f32::from(bins), MAX_GATE_BINS as f32),
            Self::LinkFull(bit_s, link) => bit_s / link.capacity_bit_s(),
            Self::Cube(needed, there) => f64::from(needed) / f64::from(there),
            Self::Instructions(needed, there) => needed / there,
            _ => f64::INFINITY,
        }
    }

    /// The one that comes farther, or is broken by less.
    pub(super) fn nearer(self, other: Self) -> Self {
        let key = |b: &Self| (b.stage(), -b.excess());
        if key(&other) > key(&self) { other } else { self }
    }

    /// Whether the radar's profile alone is at fault, whatever maps and antennas are.
    pub fn is_of_radar(&self) -> bool {
        self.stage() < Self::MapPoints(0, 0).stage()
    }
}

impl fmt::Display for Binding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let plural = |n: &u16| if *n == 1 { "" } else { "s" };
        match self {
            Self::Azimuth(have, need) => {
                write!(f, "azimuth: {have} position{} of the {need} that the board has", plural(have))
            }
            Self::Elevation(have, need) => {
                write!(f, "elevation: {have} position{} of the {need} that the board has", plural(have))
            }
            Self::RangeBin(bin, need) => {
                write!(f, "range bin: {:.1} cm, {:.1} cm are needed", bin.0 * 100.0, need.0 * 100.0)
            }
            Self::SampleRate(ksps) => write!(
                f,
                "sample rate: {ksps} ksps, the radar has {} to {}",
                SAMPLE_RATES_KSPS.start(),
                SAMPLE_RATES_KSPS.end()
            ),
            Self::Band(end, band) => {
                write!(f, "band: the ramp would end at {end:.2} GHz, the radar's band at {band:.0}")
            }
            Self::Scene(Unmet::Depth { needed, span }) => {
                write!(f, "range: it sees {:.2} m, {:.2} m are needed", span.0, needed.0)
            }
            Self::Scene(Unmet::Speed { needed, span }) => {
                write!(f, "speed: unambiguous to {:.2} m/s, hands move at up to {:.2} m/s", span.0, needed.0)
            }
            Self::VelocityBin(bin, need) => {
                write!(f, "Doppler bin: {:.1} cm/s, {:.1} cm/s are needed", bin.0 * 100.0, need.0 * 100.0)
            }
            Self::GateBins(bins) => {
                write!(f, "range bins: {bins} are needed, a bridge keeps {MAX_GATE_BINS}")
            }
            Self::Config(error) => write!(f, "profile: {error}"),
            Self::StockFirmware(samples, loops, _) if *samples < LEAST_SAMPLES || *loops < 16 => write!(
                f,
                "stock radar firmware: {samples} samples and {loops} loops, it takes {LEAST_SAMPLES} and 16 or more"
            ),
            Self::StockFirmware(samples, loops, antennas) => write!(
                f,
                "stock radar firmware: {samples} samples x {loops} loops x {antennas} antennas are more than its 1 MiB"
            ),
            Self::LinkFull(bit_s, link) => {
                write!(f, "link: raw samples take {:.1} Mbit/s of {link}", bit_s / 1e6)
            }
            Self::Cube(needed, there) => {
                write!(f, "memory: one gated cube takes {needed} bytes, the board has {there}")
            }
            Self::Instructions(needed, there) => write!(
                f,
                "processor: a frame takes {:.1} million instructions, the board has {:.1} million in its time",
                needed / 1e6,
                there / 1e6
            ),
            Self::MapPoints(points, bins) => {
                write!(f, "maps: {points} points for {bins} bins, more than {BINS_A_POINT} bins a point")
            }
            Self::AnglePoints(points, beam) => write!(
                f,
                "angle map: {points} points over 120 degrees, fewer than {POINTS_A_BEAM} in a beam of {beam:.0} degrees"
            ),
            Self::NotAsAsked(have, asked) => write!(f, "antennas: {have}, {asked} were asked for"),
            Self::NoSuchAntenna(number, there) => {
                write!(f, "antennas: {number}, the reader has {there}")
            }
            Self::ReadInterval(tags, antennas, reading, frame) => write!(
                f,
                "reader: with {} and {} a tag is read by each every {:.0} ms, less than once in a frame of {:.0} ms; at most \
                 {:.2} m/s are followed at all times",
                counted(*tags, "tag"),
                counted(*antennas, "antenna"),
                reading.interval.0 * 1e3,
                frame.0 * 1e3,
                reading.carried.0
            ),
            Self::Reach(tags, antennas, reading, fastest) => write!(
                f,
                "reader: with {} and {} steps of phase mean something in {:.0} % of a reach with {:.2} m/s, less than half; \
                 at most {:.2} m/s are followed at all times",
                counted(*tags, "tag"),
                counted(*antennas, "antenna"),
                100.0 * reading.reach_share,
                fastest.0,
                reading.carried.0
            ),
        }
    }
}

/// `3 tags`, `1 tag`.
pub(super) fn counted(number: u8, name: &str) -> String {
    format!("{number} {name}{}", if number == 1 { "" } else { "s" })
}

/// Needs, means, and what follows from them alone.
#[derive(Debug, Clone)]
pub struct Problem {
    /// What is needed.
    pub needs: Needs,
    /// What there is.
    pub means: Means,
    /// The reader's rounds with all tags.
    pub rounds: Rounds,
}

impl Problem {
    /// The problem of meeting `needs` with `means`.
    pub fn new(needs: Needs, means: Means) -> Self {
        let rounds = Rounds::of(needs.tags);
        Self { needs, means, rounds }
    }

    /// The configuration's cost.
    ///
    /// # Errors
    /// The first need or limit that it breaks, in the order of [`Binding`].
    pub fn check(&self, config: &Config) -> Result<Cost, Binding> {
        self.check_radar(&config.profile)?;
        self.check_map(&config.profile, config.map_points)?;
        self.check_angle_map(&config.profile, config.angle_points)?;
        self.check_reader(config.antennas)?;
        Ok(self.cost(config))
    }

    /// The profile, whatever maps and antennas are.
    pub(super) fn check_radar(&self, profile: &RadarProfile) -> Result<(), Binding> {
        let Self { needs, means, .. } = self;
        let (width, all) = (extent(profile, |at| at.azimuth), extent(&needs.radar, |at| at.azimuth));
        if needs.azimuth && width < all {
            return Err(Binding::Azimuth(width, all));
        }
        let (height, all) = (extent(profile, |at| at.elevation), extent(&needs.radar, |at| at.elevation));
        if needs.elevation && height < all {
            return Err(Binding::Elevation(height, all));
        }
        if profile.range_bin() > needs.range_resolution {
            return Err(Binding::RangeBin(profile.range_bin(), needs.range_resolution));
        }
        if !SAMPLE_RATES_KSPS.contains(&profile.sample_rate_ksps) {
            return Err(Binding::SampleRate(profile.sample_rate_ksps));
        }
        let end_khz = u64::from(profile.start_khz)
            + u64::from(profile.slope_khz_per_us) * u64::from(profile.ramp_end_ns) / 1_000;
        let band_khz = band_end_khz(profile.start_khz);
        if end_khz > band_khz {
            return Err(Binding::Band(end_khz as f64 * 1e-6, band_khz as f64 * 1e-6));
        }
        let gate = needs.scene(1).gate(profile).map_err(Binding::Scene)?;
        if profile.velocity_bin() > needs.velocity_resolution {
            return Err(Binding::VelocityBin(profile.velocity_bin(), needs.velocity_resolution));
        }
        if usize::from(gate.bins) > MAX_GATE_BINS {
            return Err(Binding::GateBins(gate.bins));
        }
        let radar = RadarConfig {
            profile: profile.clone(),
            input: RadarInput::Uart,
            processing: Processing::with_gate(profile, gate),
        };
        radar.validate(u32::MAX).map_err(Binding::Config)?;
        if !profile.fits_stock_firmware() || profile.samples < LEAST_SAMPLES {
            let virtuals = profile.virtual_count();
            return Err(Binding::StockFirmware(profile.samples, profile.loops, virtuals));
        }
        let load = means.link.load_bit_s(profile);
        if load > means.link.capacity_bit_s() {
            return Err(Binding::LinkFull(load, means.link));
        }
        let (needed, there) = (profile.cube_bytes(gate), means.board.cube_bytes);
        if needed > there {
            return Err(Binding::Cube(needed, there));
        }
        let (needed, there) = (Instructions::of(profile, gate).total(), self.instructions_there(profile));
        if needed > there { Err(Binding::Instructions(needed, there)) } else { Ok(()) }
    }

    fn instructions_there(&self, profile: &RadarProfile) -> f64 {
        self.means.board.instructions_s * f64::from(profile.frame_period_us) * 1e-6
    }

    /// Range-time and range-Doppler maps of this side.
    pub(super) fn check_map(&self, profile: &RadarProfile, points: u16) -> Result<(), Binding> {
        let bins = profile.gate_to(self.needs.depth).bins.max(profile.loops);
        if f32::from(bins) > BINS_A_POINT * f32::from(points) {
            return Err(Binding::MapPoints(points, bins));
        }
        Ok(())
    }

    /// The angle map of this side.
    pub(super) fn check_angle_map(&self, profile: &RadarProfile, points: u16) -> Result<(), Binding> {
        let beam = beam_rad(profile, |at| at.azimuth).min(beam_rad(profile, |at| at.elevation));
        let step = 2.0 * FIELD_OF_VIEW_RAD / f32::from(points);
        if step * POINTS_A_BEAM > beam {
            return Err(Binding::AnglePoints(points, beam.to_degrees()));
        }
        Ok(())
    }

    /// The reader, whatever the radar is.
    pub(super) fn check_reader(&self, antennas: u8) -> Result<(), Binding> {
        let Needs { tags, fastest_tag, radar, .. } = &self.needs;
        match self.needs.antennas {
            Antennas::Exactly(asked) if antennas != asked => {
                return Err(Binding::NotAsAsked(antennas, asked));
            }
            Antennas::UpTo(there) if antennas > there => {
                return Err(Binding::NoSuchAntenna(antennas, there));
            }
            _ => {}
        }
        let reading = self.rounds.reading(antennas, *fastest_tag);
        if reading.interval > radar.frame_period() {
            return Err(Binding::ReadInterval(*tags, antennas, reading, radar.frame_period()));
        }
        // Who asks for a number of antennas is warned only.
        let chosen = matches!(self.needs.antennas, Antennas::UpTo(_));
        if chosen && reading.reach_share < LEAST_REACH_SHARE {
            return Err(Binding::Reach(*tags, antennas, reading, *fastest_tag));
        }
        Ok(())
    }

    /// What `config` costs, whether it works or not.
    pub fn cost(&self, config: &Config) -> Cost {
        let Self { needs, means, rounds } = self;
        let profile = &config.profile;
        let gate = profile.gate_to(needs.depth);
        let cube_bytes = profile.cube_bytes(gate);
        let square = |points: u16| u32::from(points) * u32::from(points);
        Cost {
            link_bit_s: means.link.load_bit_s(profile),
            cube_bytes,
            cubes: (means.board.cube_bytes / cube_bytes.max(1)).min(2) as u8,
            instructions: Instructions::of(profile, gate),
            instructions_there: self.instructions_there(profile),
            reading: rounds.reading(config.antennas, needs.fastest_tag),
            map_values: 2 * square(config.map_points) + square(config.angle_points),
        }
    }
}
