//! The link between an antenna and a tag: what power the tag gets, and what comes back.
//!
//! One way, the field is the sum over paths, `h = sum a_i exp(-j 2 pi d_i / lambda)`: the direct one, and one by way of
//! each wall, floor and ceiling, as if from the tag's mirror image. Each amplitude is Friis', with the antenna's pattern
//! and with what stands in the way. There and back it is `h^2`, so the tag gets `P |h|^2 / loss`, the reader
//! `P |h|^4 / (loss^2 modulation)`, and the phase is `-2 arg h`: `4 pi d / lambda` for one path. The sign is that of the
//! phase pipeline, in which phase grows with distance.
//!
//! The level was fitted to medians of recordings: -40 dBm (`Test15-5-0`, at 1.5 m if its name gives feet) with a tag's
//! loss of 4.7 dB one way, and -62 dBm (the eight `MoveTest1`, a tag carried by a person past antennas in the corners of
//! a square of 15 feet, 3.2 m from its middle) with 9.2 dB. A tag's orientation is not simulated: it is in that loss.

use std::f64::consts::{PI, TAU};

use glam::Vec3;
use num_complex::Complex;

use super::db;
use crate::simulate::scene::{ReaderAntenna, Room};
use crate::simulate::{Capsule, effects::Effects};
use rfhoi_shared::units::SPEED_OF_LIGHT;

/// Weakening by a hand that covers a tag, there and back, dB (paper section 5.6). No figure is given for a body, which
/// takes the same: tags behind people were still read.
pub const BLOCKAGE_DB: f64 = 8.3;
/// Share of the first Fresnel zone's radius that has to be clear for a link to be as good as free (ITU-R P.530).
const CLEAR_SHARE: f32 = 0.6;
/// The zone is not taken for thinner than this, m; it has no width at a tag that lies within a hand.
const THINNEST_ZONE_M: f32 = 0.01;
/// Gain of an antenna on its boresight, dBic: that of a pattern `cos^3`, whose beam is 75 degrees wide.
const READER_GAIN_DB: f64 = 9.0;
/// Its least gain, to the sides and back, dBic.
const BACK_GAIN_DB: f64 = -11.0;
/// Loss between circular and linear polarisation, dB.
const POLARISATION_DB: f64 = 3.0;
/// Gain of a tag's dipole, dBi.
const TAG_GAIN_DB: f64 = 2.0;
/// What a tag's modulation sends back of what it gets, dB.
const MODULATION_DB: f64 = -6.0;
/// Amplitude that walls, floor and ceiling reflect: concrete at normal incidence, permittivity 5.24 (ITU-R P.2040), which
/// gives 0.39.
const WALL_AMPLITUDE: f64 = -0.4;

/// What surrounds the links of a moment.
#[derive(Debug, Clone, Copy)]
pub struct Surroundings<'a> {
    room: &'a Room,
    blockers: &'a [Capsule],
    multipath: bool,
    /// Amplitude of all gains that do not depend on place.
    gain: f64,
    /// Least power of the pattern, relative to its boresight.
    back: f64,
}

impl<'a> Surroundings<'a> {
    /// Of `room`'s walls and of `blockers` what `effects` leaves.
    pub fn new(room: &'a Room, blockers: &'a [Capsule], effects: &Effects) -> Self {
        Self {
            room,
            blockers: if effects.blockage { blockers } else { &[] },
            multipath: effects.tag_multipath,
            gain: db::amplitude(READER_GAIN_DB - POLARISATION_DB + TAG_GAIN_DB),
            back: db::power(BACK_GAIN_DB - READER_GAIN_DB),
        }
    }

    /// The field at `tag`, an amplitude relative to that at the antenna's port, at `hertz`.
    pub fn one_way(&self, antenna: &ReaderAntenna, tag: Vec3, hertz: f64) -> Complex<f64> {
        let wavelength = SPEED_OF_LIGHT / hertz;
        let direct = tag - antenna.position;
        let blocked = self.blocked([antenna.position, tag], direct.length(), wavelength);
        let mut field = self.path(antenna, direct, wavelength) * blocked;
        if !self.multipath {
            return field;
        }
        let Room { min, max, .. } = *self.room;
        for (axis, wall) in (0..3).flat_map(|axis| [(axis, min[axis]), (axis, max[axis])]) {
            let sides = [wall - antenna.position[axis], wall - tag[axis]];
            // Both must be on the same side of the wall.
            if sides[0] * sides[1] <= 0.0 {
                continue;
            }
            let mut image = tag;
            image[axis] = 2.0 * wall - tag[axis];
            let way = image - antenna.position;
            let bounce = antenna.position + way * (sides[0] / way[axis]);
            // Where the way ends, as what blocks is near the tag.
            let blocked = self.blocked([bounce, tag], way.length(), wavelength);
            field += self.path(antenna, way, wavelength) * (WALL_AMPLITUDE * blocked);
        }
        field
    }

    /// A path that leaves `antenna` along `way`, m.
    fn path(&self, antenna: &ReaderAntenna, way: Vec3, wavelength: f64) -> Complex<f64> {
        let length = f64::from(way.length()).max(wavelength / TAU);
        let cos = (f64::from(way.dot(antenna.facing)) / length).max(0.0);
        let pattern = (cos * cos * cos).max(self.back);
        let amplitude = self.gain * pattern.sqrt() * wavelength / (4.0 * PI * length);
        let (sin, cos) = libm::sincos(-TAU * length / wavelength);
        Complex::new(amplitude * cos, amplitude * sin)
    }

    /// Amplitude that passes the blockers along a straight way, the last part of a path of `length` m to a tag, 0 to 1.
    fn blocked(&self, way: [Vec3; 2], length: f32, wavelength: f64) -> f64 {
        if self.blockers.is_empty() {
            return 1.0;
        }
        let covered: f32 =
            self.blockers.iter().map(|capsule| covered(way, length, capsule, wavelength as f32)).sum();
        db::amplitude(-BLOCKAGE_DB / 2.0 * f64::from(covered.min(1.0)))
    }
}

/// Share of the zone around a way that a capsule covers, 0 to 1: as a strip as wide as the capsule covers the zone's
/// diameter where the two are nearest.
fn covered(way: [Vec3; 2], length: f32, capsule: &Capsule, wavelength: f32) -> f32 {
    let [near, far] = nearest(way, capsule.ends);
    let to_tag = way[1].distance(near);
    let radius = (wavelength * to_tag * (length - to_tag).max(0.0) / length.max(f32::EPSILON)).sqrt();
    let zone = (CLEAR_SHARE * radius).max(THINNEST_ZONE_M);
    let distance = near.distance(far);
    let strip = (distance + capsule.radius).min(zone) - (distance - capsule.radius).max(-zone);
    (strip / (2.0 * zone)).max(0.0)
}

/// The points of two segments that are nearest to each other (Ericson, "Real-Time Collision Detection", 5.1.9).
fn nearest(first: [Vec3; 2], second: [Vec3; 2]) -> [Vec3; 2] {
    let (d1, d2, between) = (first[1] - first[0], second[1] - second[0], first[0] - second[0]);
    let (a, e, f) = (d1.length_squared(), d2.length_squared(), d2.dot(between));
    let (b, c) = (d1.dot(d2), d1.dot(between));
    let share =
        |over: f32, under: f32| if under > f32::EPSILON { (over / under).clamp(0.0, 1.0) } else { 0.0 };
    let mut s = share(b * f - c * e, a * e - b * b);
    let t = share(b * s + f, e);
    s = share(b * t - c, a);
    [first[0] + d1 * s, second[0] + d2 * t]
}

/// What comes of a field.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Link {
    /// Power at the tag's chip, dBm.
    pub tag_dbm: f64,
    /// Power of its answer at the reader, dBm.
    pub rssi_dbm: f64,
    /// Phase of the way there and back, rad; it grows with distance.
    pub phase: f64,
}

impl Link {
    /// With this transmit power and a tag's own loss one way.
    pub fn new(field: Complex<f64>, transmit_dbm: f64, loss_db: f64) -> Self {
        let gain_db = db::of_power(field.norm_sqr()) - loss_db;
        Self {
            tag_dbm: transmit_dbm + gain_db,
            rssi_dbm: transmit_dbm + 2.0 * gain_db + MODULATION_DB,
            phase: -2.0 * libm::atan2(field.im, field.re),
        }
    }
}
