//! The scene: a room and what is fixed in it, as `scene.toml` describes it.
//!
//! In: a file, its text, or the name of a room that comes with the program ([`NAMES`]). Out: a [`Scene`] in which
//! everything fits, or a sentence for each line that must be corrected. The keys are documented in
//! `host/scenes/README.md`.

mod check;
mod document;
mod error;
mod geometry;
mod keys;
mod read;
mod rooms;
mod standing;

use std::borrow::Cow;
use std::path::Path;

use glam::{Mat3, Vec2, Vec3};
use rfhoi_shared::radar::{RadarProfile, RangeGate};
use rfhoi_shared::scene::{Scene as Needs, Unmet};
use rfhoi_shared::tag::Epc;
use rfhoi_shared::units::{Metres, MetresPerSecond};

pub use error::{Complaint, SceneError};
pub use standing::{CHEST_M, FIELD_OF_VIEW_RAD, NEAREST_M, PERSON_M, WORKPLACE_M};

use crate::hoi::Object;
use crate::simulate::perform::Manner;
use document::Document;

/// Tags of a sample: its object's and those of five others (the paper's section 4.2).
pub const SAMPLE_TAGS: usize = 6;

/// The paper's three rooms: few, medium and rich multipath (its section 4.2).
pub const SITE: [&str; 3] = ["working-space", "storage-room", "kitchen"];
/// Rooms that come with the program: the paper's; a hall without anything, with other people; one that needs less than those,
/// and one that needs more.
pub const NAMES: [&str; 6] =
    ["working-space", "storage-room", "kitchen", "open-room", "cabinet", "work-room"];
const ROOMS: [&str; 6] = [
    include_str!("../../../scenes/working-space.toml"),
    include_str!("../../../scenes/storage-room.toml"),
    include_str!("../../../scenes/kitchen.toml"),
    include_str!("../../../scenes/open-room.toml"),
    include_str!("../../../scenes/cabinet.toml"),
    include_str!("../../../scenes/work-room.toml"),
];

/// A room with a radar, a reader, furniture and people.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// What people call it.
    pub name: String,
    /// The walls.
    pub room: Room,
    /// What the file says of its needs.
    pub stated: Stated,
    /// What stands in it and never moves.
    pub furniture: Vec<Furniture>,
    /// The radar.
    pub radar: RadarPose,
    /// The RFID reader.
    pub reader: Reader,
    /// Tagged things that may be there; a sample takes some of them.
    pub tags: Vec<Tag>,
    /// Who may act.
    pub people: Vec<Person>,
    /// Where they may act.
    pub places: Vec<Place>,
}

impl Scene {
    /// The scene called `source` in [`NAMES`], or else that in the file `source`.
    ///
    /// # Errors
    /// As [`Self::open`].
    pub fn load(source: &str) -> Result<Self, SceneError> {
        let path = Path::new(source);
        Self::parse(path, &text_of(source)?)
    }

    /// As [`Self::load`], for someone who looks for the profile: that of the file gives the board alone, and may not see
    /// what the scene needs.
    ///
    /// # Errors
    /// As [`Self::open`].
    pub fn load_without_profile(source: &str) -> Result<Self, SceneError> {
        Self::parse_with(Path::new(source), &text_of(source)?, false)
    }

    /// The room of this name in [`NAMES`].
    pub fn named(name: &str) -> Option<Self> {
        NAMES.contains(&name).then(|| Self::load(name).ok())?
    }

    /// The scene in the file at `path`. A radar profile that is a file is looked for beside it.
    ///
    /// # Errors
    /// If the file cannot be read, or anything in it is wrong.
    pub fn open(path: &Path) -> Result<Self, SceneError> {
        Self::parse(path, &read_text(path)?)
    }

    /// Parses and checks `text`, which was read from `path`.
    ///
    /// # Errors
    /// [`SceneError::Invalid`] with all that is wrong.
    pub fn parse(path: &Path, text: &str) -> Result<Self, SceneError> {
        Self::parse_with(path, text, true)
    }

    fn parse_with(path: &Path, text: &str, profile_in_use: bool) -> Result<Self, SceneError> {
        let (mut document, table) = Document::parse(text);
        let mut scene = None;
        // What half a document lacks is not its author's fault.
        if document.complaints.is_empty() {
            let draft = read::draft(&mut document, &table, path);
            check::check(&mut document, &draft, profile_in_use);
            scene = draft.scene();
        }
        let mut complaints = document.complaints;
        match scene {
            Some(scene) if complaints.is_empty() => Ok(scene),
            _ => {
                complaints.sort();
                complaints.dedup();
                Err(SceneError::Invalid { file: path.to_path_buf(), complaints })
            }
        }
    }

    /// What it asks of radar and reader.
    pub fn needs(&self) -> Needs {
        needs(self.radar.depth_m, self.reader.antennas.len(), &self.stated)
    }

    /// The scene with another profile of the radar: as deep as that sees, without the places that are then too far.
    ///
    /// # Errors
    /// If the profile is too slow for hands, or no place is left.
    pub fn with_profile(mut self, profile: &RadarProfile) -> Result<Self, Unmet> {
        let needed = self.needs();
        self.radar.depth_m = self.radar.depth_m.min(profile.range_span().0);
        self.radar.profile = profile.clone();
        let Self { radar, room, places, .. } = &mut self;
        places.retain(|place| place.chest(room).distance(radar.position) <= radar.depth_m);
        if self.places.is_empty() {
            return Err(Unmet::Depth { needed: needed.depth, span: profile.range_span() });
        }
        self.needs().gate(profile)?;
        Ok(self)
    }

    /// Range bins in which its places are.
    pub fn gate(&self) -> RangeGate {
        self.radar.profile.gate_to(Metres(self.radar.depth_m))
    }
}

fn needs(depth_m: f32, antennas: usize, stated: &Stated) -> Needs {
    let (tags, reader_antennas) = (SAMPLE_TAGS as u8, antennas.min(u8::MAX.into()) as u8);
    let Stated { fastest_hand, fastest_tag, .. } = *stated;
    Needs { depth: Metres(depth_m), fastest_hand, fastest_tag, tags, reader_antennas }
}

fn read_text(path: &Path) -> Result<String, SceneError> {
    std::fs::read_to_string(path).map_err(|source| SceneError::Read { path: path.to_path_buf(), source })
}

/// The text of the room of this name, or else of the file.
fn text_of(source: &str) -> Result<Cow<'static, str>, SceneError> {
    match NAMES.iter().position(|&name| name == source) {
        Some(n) => Ok(ROOMS[n].into()),
        None => read_text(Path::new(source)).map(Cow::Owned),
    }
}

/// What a scene file says of its needs: section `[needs]`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stated {
    /// Fastest radial speed of a hand or body.
    pub fastest_hand: MetresPerSecond,
    /// Fastest radial speed of a tag on a handled thing.
    pub fastest_tag: MetresPerSecond,
    /// Finest step of range that tells actions apart.
    pub range_resolution: Metres,
    /// Finest step of radial speed that tells actions apart.
    pub velocity_resolution: MetresPerSecond,
    /// Whether actions are told apart by azimuth.
    pub azimuth: bool,
    /// The same of elevation; `None` where the file does not say.
    pub elevation: Option<bool>,
}

impl Default for Stated {
    /// Hands and tags of [`Needs::default`], resolutions of the `bridge` profile to three digits.
    fn default() -> Self {
        let Needs { fastest_hand, fastest_tag, .. } = Needs::default();
        Self {
            fastest_hand,
            fastest_tag,
            range_resolution: Metres(0.043),
            velocity_resolution: MetresPerSecond(0.141),
            azimuth: true,
            elevation: None,
        }
    }
}

/// A box of air between four walls, floor and ceiling.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Room {
    /// Lowest x, y and z, m; z is the floor.
    pub min: Vec3,
    /// Highest x, y and z, m.
    pub max: Vec3,
    /// Share of the power that walls reflect at 77 GHz, 0 to 1.
    pub reflectivity: f32,
}

/// A box that stands in the room.
#[derive(Debug, Clone, PartialEq)]
pub struct Furniture {
    /// What people call it.
    pub name: String,
    /// Its centre, m.
    pub centre: Vec3,
    /// Width, depth and height, m.
    pub size: Vec3,
    /// Turn about the vertical, clockwise as seen from above, rad.
    pub yaw_rad: f32,
    /// Share of the power that it scatters, 0 to 1.
    pub reflectivity: f32,
}

/// Where the radar is, where it looks, and what it is programmed with.
#[derive(Debug, Clone, PartialEq)]
pub struct RadarPose {
    /// Middle of its antennas, m.
    pub position: Vec3,
    /// Turn of its boresight to the right of y, rad.
    pub yaw_rad: f32,
    /// Turn of its boresight upwards, rad.
    pub pitch_rad: f32,
    /// Range to which its maps reach, m; all places are nearer.
    pub depth_m: f32,
    /// Profile, with the board's mounting.
    pub profile: RadarProfile,
}

impl RadarPose {
    /// From room to radar: rows are the radar's axes, to the right, forward and up, in room coordinates.
    pub fn axes(&self) -> Mat3 {
        orientation(self.yaw_rad, self.pitch_rad)
    }
}

/// From room to one who looks `yaw_rad` to the right of y and `pitch_rad` upwards: rows are to the right, forward and up.
fn orientation(yaw_rad: f32, pitch_rad: f32) -> Mat3 {
    let (sin, cos) = (libm::sinf(yaw_rad), libm::cosf(yaw_rad));
    let (up_sin, up_cos) = (libm::sinf(pitch_rad), libm::cosf(pitch_rad));
    let right = Vec3::new(cos, -sin, 0.0);
    let forward = Vec3::new(sin * up_cos, cos * up_cos, up_sin);
    Mat3::from_cols(right, forward, right.cross(forward)).transpose()
}

/// The RFID reader.
#[derive(Debug, Clone, PartialEq)]
pub struct Reader {
    /// Its antennas, port 1 first.
    pub antennas: Vec<ReaderAntenna>,
    /// Transmit power, dBm.
    pub power_dbm: f32,
}

/// An antenna of the reader.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReaderAntenna {
    /// Where it is, m.
    pub position: Vec3,
    /// Where it looks, a unit vector.
    pub facing: Vec3,
}

/// A tag on a thing.
#[derive(Debug, Clone, PartialEq)]
pub struct Tag {
    /// Its EPC.
    pub epc: Epc,
    /// What it is on.
    pub object: Object,
    /// Where on it: to its right, forward and up from where such a tag usually is, m.
    pub offset: Vec3,
}

/// A person's body.
#[derive(Debug, Clone, PartialEq)]
pub struct Person {
    /// What people call them.
    pub name: String,
    /// Height, m.
    pub height_m: f32,
    /// Girth relative to an average person of that height.
    pub build: f32,
    /// How they move, if not as people of the data's domain do.
    pub manner: Option<Manner>,
}

/// Where a person acts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// Where they stand, x and y, m.
    pub position: Vec2,
    /// Where they look: 0 towards the radar, growing to their left, rad.
    pub facing_rad: f32,
}

#[cfg(test)]
mod tests;
