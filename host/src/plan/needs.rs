//! What a scene asks of radar and reader.

use std::f32::consts::FRAC_PI_2;

use rfhoi_shared::array::virtual_antennas;
use rfhoi_shared::config::MAX_READER_ANTENNAS;
use rfhoi_shared::radar::RadarProfile;
use rfhoi_shared::scene::Scene as Needed;
use rfhoi_shared::units::{Metres, MetresPerSecond};
use serde::Serialize;

use crate::hoi::Object;
use crate::simulate::scene::{CHEST_M, Scene, Stated};

/// What is needed, in numbers; whoever meets it all sees the scene.
#[derive(Debug, Clone, PartialEq)]
pub struct Needs {
    /// Range to which the maps reach.
    pub depth: Metres,
    /// Fastest radial speed of a hand or body.
    pub fastest_hand: MetresPerSecond,
    /// Fastest radial speed of a tag on a handled thing.
    pub fastest_tag: MetresPerSecond,
    /// Tags that answer at the same time.
    pub tags: u8,
    /// Antennas of the reader.
    pub antennas: Antennas,
    /// Finest step of range.
    pub range_resolution: Metres,
    /// Finest step of radial speed.
    pub velocity_resolution: MetresPerSecond,
    /// Whether azimuth tells actions apart.
    pub azimuth: bool,
    /// Whether elevation does.
    pub elevation: bool,
    /// Why, or why not.
    pub elevation_because: String,
    /// What cannot be chosen: the radar's board and mounting, its sample format, its frame period.
    pub radar: RadarProfile,
}

/// How many of the reader's antennas are used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Antennas {
    /// As many as may be of those that there are.
    UpTo(u8),
    /// So many.
    Exactly(u8),
}

impl Antennas {
    /// The most.
    pub fn most(self) -> u8 {
        let (Self::UpTo(most) | Self::Exactly(most)) = self;
        most
    }

    /// What may be chosen, the most first.
    pub(super) fn choices(self) -> impl Iterator<Item = u8> {
        let (least, most) = match self {
            Self::UpTo(most) => (1, most),
            Self::Exactly(asked) => (asked, asked),
        };
        (least..=most).rev()
    }
}

impl Needs {
    /// Those of `scene`: its depth, all of its tags, its reader's antennas, and what its file says of the rest.
    pub fn of(scene: &Scene) -> Self {
        let Needed { depth, fastest_hand, fastest_tag, reader_antennas, .. } = scene.needs();
        let Stated { range_resolution, velocity_resolution, azimuth, elevation, .. } = scene.stated;
        let radar = scene.radar.profile.clone();
        let (by_scene, because) = needs_elevation(scene, &radar);
        let because = match elevation {
            Some(true) => "the scene's file asks for it".to_owned(),
            Some(false) => "the scene's file does not ask for it".to_owned(),
            None => because,
        };
        Self {
            depth,
            fastest_hand,
            fastest_tag,
            tags: scene.tags.len().min(u8::MAX.into()) as u8,
            antennas: Antennas::UpTo(reader_antennas),
            range_resolution,
            velocity_resolution,
            azimuth,
            elevation: elevation.unwrap_or(by_scene),
            elevation_because: because,
            radar,
        }
    }

    /// As a bridge is told, with `antennas` of the reader.
    pub fn scene(&self, antennas: u8) -> Needed {
        Needed {
            depth: self.depth,
            fastest_hand: self.fastest_hand,
            fastest_tag: self.fastest_tag,
            tags: self.tags,
            reader_antennas: antennas,
        }
    }

    /// What makes no sense, in a sentence.
    pub(super) fn nonsense(&self) -> Option<String> {
        let positive = [
            ("depth", self.depth.0, "m"),
            ("fastest hand", self.fastest_hand.0, "m/s"),
            ("fastest tag", self.fastest_tag.0, "m/s"),
            ("range resolution", self.range_resolution.0, "m"),
            ("velocity resolution", self.velocity_resolution.0, "m/s"),
        ];
        if let Some((name, value, unit)) = positive.into_iter().find(|(_, v, _)| !(v.is_finite() && *v > 0.0))
        {
            return Some(format!("a {name} of {value} {unit} means nothing: it must be above zero"));
        }
        if self.tags == 0 {
            return Some("without a tag there is nothing to name: need 1 or more".to_owned());
        }
        let most = self.antennas.most();
        (most == 0 || usize::from(most) > MAX_READER_ANTENNAS)
            .then(|| format!("{most} antennas of a reader: it has 1 to {MAX_READER_ANTENNAS}"))
    }
}

impl Default for Needs {
    /// The paper's setting: [`Needed::default`] and [`Stated::default`], with elevation.
    fn default() -> Self {
        let Needed { depth, fastest_hand, fastest_tag, tags, reader_antennas } = Needed::default();
        let Stated { range_resolution, velocity_resolution, .. } = Stated::default();
        Self {
            depth,
            fastest_hand,
            fastest_tag,
            tags,
            antennas: Antennas::UpTo(reader_antennas),
            range_resolution,
            velocity_resolution,
            azimuth: true,
            elevation: true,
            elevation_because: "nothing is known of heights".to_owned(),
            radar: RadarProfile::default(),
        }
    }
}

/// Top of tables, seats, and lower edge of hanging cabinets over the floor, m: about where the simulator's things are.
const TABLE_M: f32 = 0.74;
const SEAT_M: f32 = 0.45;
const CABINET_M: [f32; 2] = [1.2, 1.8];

/// Heights over the floor between which a hand or body moves with an object, m.
fn heights(object: Object, tallest_m: f32) -> [f32; 2] {
    match object {
        Object::Table => [TABLE_M, TABLE_M],
        Object::Chair => [SEAT_M, tallest_m],
        Object::Cabinet => CABINET_M,
        // Lifted to the chest at most.
        _ => [TABLE_M, CHEST_M],
    }
}

/// Whether elevation may tell the scene's actions apart, and why: what is handled is spread over half a beam of the array or
/// more. Within that, elevation says little, and range and speed say the same.
fn needs_elevation(scene: &Scene, radar: &RadarProfile) -> (bool, String) {
    let beam = beam_rad(radar, |position| position.elevation).to_degrees();
    let tallest = scene.people.iter().map(|p| p.height_m).fold(0.0, f32::max);
    let eye = scene.radar.position - glam::Vec3::Z * scene.room.min.z;
    let spread = |object: Object, distance: f32| {
        heights(object, tallest).map(|z| libm::atan2f(z - eye.z, distance).to_degrees())
    };
    let nearest = scene
        .places
        .iter()
        .map(|place| place.position.distance(scene.radar.position.truncate()))
        .fold(f32::INFINITY, f32::min);
    let angles = scene.tags.iter().flat_map(|tag| spread(tag.object, nearest));
    let (low, high) = angles.fold((f32::MAX, f32::MIN), |(low, high), a| (low.min(a), high.max(a)));
    let text = format!(
        "at {nearest:.1} m things are handled from {low:.0} to {high:.0} degrees of elevation, {} half a beam of {beam:.0}",
        if high - low >= beam / 2.0 { "more than" } else { "less than" }
    );
    (high - low >= beam / 2.0, text)
}

/// Half-power width of the beam of a profile's array along one axis, rad: 0.886 lambda / (n d) for n antennas half a
/// wavelength apart (H. L. Van Trees, "Optimum array processing", section 2.4). No beam is wider than the field of view.
pub(super) fn beam_rad(profile: &RadarProfile, axis: impl Fn(rfhoi_shared::array::Position) -> i8) -> f32 {
    const HALF_POWER: f32 = 0.886;
    match extent(profile, axis) {
        0 | 1 => FRAC_PI_2,
        n => (2.0 * HALF_POWER / f32::from(n)).min(FRAC_PI_2),
    }
}

/// Positions along one axis at which the profile has a virtual antenna.
pub(super) fn extent(profile: &RadarProfile, axis: impl Fn(rfhoi_shared::array::Position) -> i8) -> u16 {
    let Some(antennas) = virtual_antennas(profile) else { return 0 };
    let places: std::collections::BTreeSet<i8> = antennas.iter().map(|a| axis(a.position)).collect();
    places.len() as u16
}
