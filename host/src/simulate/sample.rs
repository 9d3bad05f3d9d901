//! A sample: one performance as both radios see it.

use std::ops::Range;

use glam::Vec3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rfhoi_shared::config::RadarConfig;
use rfhoi_shared::radar::RadarProfile;
use rfhoi_shared::tag::{Epc, TagRead};
use rfhoi_shared::units::{BridgeTime, Kilohertz};

use super::circumstance::{self, Circumstance};
use super::draw::{Draw, Purpose, stream};
use super::effects::{Domain, Effects};
use super::perform::{Brief, BriefError, Generated, Manner};
use super::radar::{FrameMaps, Radar, RadarError};
use super::rfid::{self, Options as ReadOptions, ReaderSession, Situation};
use super::scene::{Scene, Tag};
use super::{Performance, Surface};
use crate::hoi::Object;

/// How long the reader reads before a sample begins, s: once through all channels of the hop table and some more.
const LEAD_IN_S: f64 = 11.0;
/// The same where there is one channel without offsets.
const SHORT_LEAD_IN_S: f64 = 1.0;

/// Why there is no sample.
#[derive(Debug, thiserror::Error)]
pub enum SampleError {
    /// The radar.
    #[error("scene {scene}: {source}")]
    Radar {
        /// Name of the scene.
        scene: String,
        /// What is wrong.
        source: RadarError,
    },
    /// The performance.
    #[error("sample {sample}: {source}")]
    Perform {
        /// Number of the sample.
        sample: u32,
        /// What is wrong.
        source: BriefError,
    },
    /// No tag for an object.
    #[error("the scene {scene} has no tag on a {object}: add [[tags]] with object = \"{object}\"")]
    NoTag {
        /// Name of the scene.
        scene: String,
        /// The object.
        object: Object,
    },
}

/// What both radios measured.
#[derive(Debug, Clone, PartialEq)]
pub struct Sample {
    /// Length, s.
    pub duration_s: f64,
    /// From the person's first movement to the last, s; 0 to 0 without a label.
    pub interaction_s: Range<f64>,
    /// Maps, one for each frame period from 0 s on.
    pub frames: Vec<FrameMaps>,
    /// Reads by time; 0 s of the sample is at [`epoch`].
    pub reads: Vec<TagRead>,
    /// EPCs of the tags.
    pub epcs: Vec<Epc>,
    /// Doppler bins of the range-Doppler map.
    pub loops: usize,
    /// Columns of the range-time map.
    pub columns: usize,
    /// Frequency of the reader's channel 1, 2, ...
    pub channels: Vec<Kilohertz>,
    /// Where the tags are at each frame's beginning, m: frame by frame, tag by tag.
    pub tags_m: Vec<Vec3>,
}

/// How long the reader reads before the sample's time 0, us.
pub fn epoch(effects: &Effects) -> BridgeTime {
    BridgeTime((if effects.hopping { LEAD_IN_S } else { SHORT_LEAD_IN_S } * 1e6) as u64)
}

impl Domain {
    /// How people move in it of whom a scene does not say.
    pub fn manner(self) -> Manner {
        match self {
            Self::Train => Manner::MinimumJerk,
            Self::Site => Manner::SigmaLognormal,
        }
    }

    /// How people of rooms that are drawn move in it, if in another way.
    pub fn manner_in_rooms(self) -> Option<Manner> {
        match self {
            Self::Train => Some(Manner::Varied),
            Self::Site => None,
        }
    }
}

/// The tag on `object` in `scene`.
///
/// # Errors
/// If there is none.
pub fn tag_on(scene: &Scene, object: Object) -> Result<Tag, SampleError> {
    let tag = scene.tags.iter().find(|t| t.object == object).cloned();
    tag.ok_or_else(|| SampleError::NoTag { scene: scene.name.clone(), object })
}

/// The performance of a draw, under its circumstance, and its tags.
///
/// # Errors
/// If the scene lacks a tag, nobody can do that, or there is no room for a second person.
pub fn perform(
    domain: Domain,
    seed: u64,
    draw: &Draw,
    scene: &Scene,
) -> Result<(Generated, Vec<Tag>), SampleError> {
    let tags: Vec<Tag> = draw.objects.iter().map(|&o| tag_on(scene, o)).collect::<Result<_, _>>()?;
    let offsets: Vec<Vec3> = tags.iter().map(|tag| tag.offset).collect();
    let (person, place, under) = (&scene.people[draw.person], draw.place(), draw.circumstance);
    let manner = domain.manner();
    let added = |sample: u32| stream(domain, seed, sample, Purpose::Circumstance);
    let covers_db = match under {
        Some(Circumstance::Hand) => circumstance::covered_db(&mut added(draw.sample)),
        _ => 0.0,
    };
    let brief = Brief {
        person,
        place,
        radar: scene.radar.position,
        label: draw.performed,
        objects: &draw.performed_objects(),
        within_reach: &draw.within_reach,
        offsets: &offsets,
        manner: person.manner.unwrap_or(manner),
        covers_db,
        behind_m: (under == Some(Circumstance::Body)).then(|| circumstance::behind_m(scene, &place)),
        stay: draw.stays.then(|| stream(domain, seed, 0, Purpose::Stay)),
    };
    let mut rng = stream(domain, seed, draw.sample, Purpose::Motion);
    let failed = |source| SampleError::Perform { sample: draw.sample, source };
    let mut generated = Generated::new(&brief, &mut rng).map_err(failed)?;
    if under == Some(Circumstance::SecondPerson) {
        // Through several performances they stay where they are.
        let who = &mut added(if draw.stays { 0 } else { draw.sample });
        let what = &mut ChaCha8Rng::from_rng(&mut added(draw.sample));
        generated = generated.accompanied(scene, (draw.person, &place), manner, who, what).map_err(failed)?;
    }
    Ok((generated, tags))
}

/// A performance in a scene, as the radios are told of it.
#[derive(Clone, Copy)]
pub struct Take<'a> {
    /// The room and its devices.
    pub scene: &'a Scene,
    /// What moves.
    pub performance: &'a dyn Performance,
    /// What else stands there, besides the room's furniture.
    pub fixtures: Option<(&'a Surface, &'a [Vec3])>,
    /// The tags, one for each of the performance.
    pub tags: &'a [Tag],
    /// What is simulated.
    pub effects: Effects,
}

impl<'a> Take<'a> {
    /// Of a generated performance.
    pub fn of(scene: &'a Scene, performance: &'a Generated, tags: &'a [Tag], effects: Effects) -> Self {
        let fixtures = Some(performance.fixtures());
        Self { scene, performance, fixtures, tags, effects }
    }

    /// When the frames of a radar with this profile begin, s: the first with the sample, the last before its end.
    pub fn frame_times(&self, profile: &RadarProfile) -> impl ExactSizeIterator<Item = f64> + use<> {
        let period_us = f64::from(profile.frame_period_us);
        let count = (self.performance.duration_s() * 1e6 / period_us).ceil() as usize;
        (0..count).map(move |frame| frame as f64 * period_us * 1e-6)
    }

    /// All reads, from the lead-in on, and the frequency of channel 1, 2, ...
    ///
    /// Without [`Effects::tag_positions`] the hand stands for the target while it moves it, and all other tags are at rest.
    pub fn reads(&self, rng: &mut ChaCha8Rng) -> (Vec<TagRead>, Vec<Kilohertz>) {
        let Self { scene, performance, tags, effects, .. } = *self;
        let session = ReaderSession::draw(scene.reader.antennas.len(), tags.len(), &effects, rng);
        let epoch = epoch(&effects);
        let position = |tag: usize, time_s: f64| match effects.tag_positions {
            true => performance.tag(tag, time_s),
            false => performance.proxy(tag, time_s),
        };
        let situation = Situation { scene, performance, position: &position, tags, effects };
        let options = ReadOptions::between(-epoch.seconds(), performance.duration_s(), epoch);
        (rfid::simulate(situation, &session, options, rng), session.channels)
    }
}

/// Makes samples, one after the other.
pub struct Maker<'a> {
    domain: Domain,
    seed: u64,
    effects: Effects,
    scenes: &'a [Scene],
    radars: Vec<Radar>,
}

impl<'a> Maker<'a> {
    /// A maker of samples in `scenes`.
    ///
    /// # Errors
    /// If a scene's radar has no antenna geometry.
    pub fn new(
        domain: Domain,
        seed: u64,
        effects: Effects,
        scenes: &'a [Scene],
    ) -> Result<Self, SampleError> {
        let radar = |scene: &Scene| {
            Radar::new(scene, effects)
                .map_err(|source| SampleError::Radar { scene: scene.name.clone(), source })
        };
        let radars = scenes.iter().map(radar).collect::<Result<_, _>>()?;
        Ok(Self { domain, seed, effects, scenes, radars })
    }

    /// What the radar of scene number `scene` is configured for.
    pub fn radar(&self, scene: usize) -> &RadarConfig {
        self.radars[scene].config()
    }

    /// Makes the sample of a draw.
    ///
    /// # Errors
    /// As [`perform`].
    pub fn make(&mut self, draw: &Draw) -> Result<Sample, SampleError> {
        let Self { domain, seed, effects, scenes, .. } = *self;
        let scene = &scenes[draw.scene];
        let (performance, tags) = perform(domain, seed, draw, scene)?;
        let interaction_s = draw.performed.map_or(0.0..0.0, |_| performance.interaction_s());
        Ok(self.measure(draw, &Take::of(scene, &performance, &tags, effects), interaction_s))
    }

    /// What both radios measure of `take`, which is in the draw's scene and has this maker's effects: noise and the reader's
    /// session are those of the draw, whatever is performed.
    pub fn measure(&mut self, draw: &Draw, take: &Take<'_>, interaction_s: Range<f64>) -> Sample {
        let Self { domain, seed, .. } = *self;
        let (performance, tags) = (take.performance, take.tags);
        let radar = &mut self.radars[draw.scene];
        radar.begin(take.fixtures, &mut stream(domain, seed, draw.sample, Purpose::Radar));
        let times = take.frame_times(&radar.config().profile);
        let (mut frames, mut tags_m) =
            (Vec::with_capacity(times.len()), Vec::with_capacity(times.len() * tags.len()));
        for time_s in times {
            radar.look(performance, time_s);
            frames.push(radar.maps());
            tags_m.extend((0..tags.len()).map(|tag| performance.tag(tag, time_s)));
        }
        let (reads, channels) = take.reads(&mut stream(domain, seed, draw.sample, Purpose::Rfid));
        let config = radar.config();
        Sample {
            duration_s: performance.duration_s(),
            interaction_s,
            frames,
            reads,
            epcs: tags.iter().map(|tag| tag.epc.clone()).collect(),
            loops: config.profile.loops.into(),
            columns: config.processing.range_time_columns.into(),
            channels,
            tags_m,
        }
    }
}
