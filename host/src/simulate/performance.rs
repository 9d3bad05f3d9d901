//! What moves, as both radios take it.

use glam::Vec3;

/// Triangles of what moves. Vertices move, triangles do not change.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Surface {
    /// Indices of three vertices each, counter-clockwise as seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Share of the power that each triangle scatters, 0 to 1.
    pub reflectivity: Vec<f32>,
}

/// A rod with round ends that stands in the way of tags.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Capsule {
    /// Its ends, m.
    pub ends: [Vec3; 2],
    /// Its radius, m.
    pub radius: f32,
}

/// People and things in motion for a while. Positions are smooth over time and defined outside `0..=duration_s` too,
/// where everything is at rest.
pub trait Performance: Send + Sync {
    /// Length, s.
    fn duration_s(&self) -> f64;

    /// Triangles of all that moves.
    fn surface(&self) -> &Surface;

    /// Writes the positions of all vertices at `time_s` to `vertices`, which is cleared first.
    fn vertices(&self, time_s: f64, vertices: &mut Vec<Vec3>);

    /// Number of tags.
    fn tags(&self) -> usize;

    /// Where tag number `tag` is at `time_s`.
    fn tag(&self, tag: usize, time_s: f64) -> Vec3;

    /// Where tag number `tag` would be if the hand stood for the object that it moves, and all else were at rest: the paper's
    /// recipe (section 3.4). Without a hand that is known, where it is.
    fn proxy(&self, tag: usize, time_s: f64) -> Vec3 {
        self.tag(tag, time_s)
    }

    /// How much fingers weaken tag number `tag` at `time_s`, there and back, dB, besides what is in its way
    /// ([`Circumstance::Hand`](super::circumstance::Circumstance::Hand)).
    fn covered_db(&self, _tag: usize, _time_s: f64) -> f32 {
        0.0
    }

    /// Writes what stands in the way of tags at `time_s` to `blockers`, which is cleared first: the body, limb by limb, and
    /// the hands.
    fn blockers(&self, time_s: f64, blockers: &mut Vec<Capsule>);
}
