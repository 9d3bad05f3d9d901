//! The scene: a room and what is fixed in it, as `scene.toml` describes it.

use glam::{Mat3, Vec2, Vec3};
use rfhoi_shared::radar::RadarProfile;
use rfhoi_shared::tag::Epc;

use crate::hoi::Object;

/// A room with a radar, a reader, furniture and people.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// What people call it.
    pub name: String,
    /// The walls.
    pub room: Room,
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
    /// Profile, with the board's mounting.
    pub profile: RadarProfile,
}

impl RadarPose {
    /// From room to radar: rows are the radar's axes, to the right, forward and up, in room coordinates.
    pub fn axes(&self) -> Mat3 {
        let (sin, cos) = (libm::sinf(self.yaw_rad), libm::cosf(self.yaw_rad));
        let (up_sin, up_cos) = (libm::sinf(self.pitch_rad), libm::cosf(self.pitch_rad));
        let right = Vec3::new(cos, -sin, 0.0);
        let forward = Vec3::new(sin * up_cos, cos * up_cos, up_sin);
        Mat3::from_cols(right, forward, right.cross(forward)).transpose()
    }
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
}

/// Where a person acts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// Where they stand, x and y, m.
    pub position: Vec2,
    /// Where they look: 0 towards the radar, growing to their left, rad.
    pub facing_rad: f32,
}
