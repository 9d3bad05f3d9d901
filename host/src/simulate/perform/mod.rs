//! People who act: from a person, a place and a label, a simulated [`Performance`].
//!
//! A script of overlapping strokes ([`Manner`]) moves the hips, the trunk and the hands; arms and legs follow by inverse
//! kinematics, feet stay where they stand. The thing that is acted on follows the hand from grasp to release, or turns
//! about its hinge with the hand at its edge; table and chair stay. Speed, hand, path, hesitation, posture and where things
//! lie are drawn anew each time; the same seed gives the same.

mod actions;
mod beside;
mod company;
mod idle;
mod manner;
mod planner;
mod posture;
mod script;
mod stroke;
#[cfg(test)]
mod tests;
mod workplace;

use std::ops::{Range, RangeInclusive};

use glam::{Quat, Vec3};
use rand::RngExt;
use rand::seq::IndexedRandom;
use rand_chacha::ChaCha8Rng;

use self::company::Company;
pub use self::manner::Manner;
use self::planner::Planner;
use self::workplace::Workplace;
pub(in crate::simulate) use self::workplace::{TABLE_EDGES_M, TABLE_TOPS_M};
use super::body::{Body, Joints, Side};
use super::scene::{Person, Place, Scene};
use super::shape::Solid;
use super::stage::{Instant, Mount, Moved, Pose, Stage};
use super::thing::Thing;
use super::{Capsule, Performance, Surface};
use crate::hoi::{CATEGORIES, Category, Object, UNSEEN};

/// Shortest sample, s: the paper's.
pub const SHORTEST_S: f64 = 2.4;
/// Heights of people that can be simulated, m.
pub const HEIGHTS_M: RangeInclusive<f32> = 1.4..=2.1;
/// Girths of people that can be simulated.
pub const BUILDS: RangeInclusive<f32> = 0.7..=1.5;

/// What is to be performed.
#[derive(Debug, Clone)]
pub struct Brief<'a> {
    /// Who acts.
    pub person: &'a Person,
    /// Where.
    pub place: Place,
    /// Where the radar is, m.
    pub radar: Vec3,
    /// What they do; `None` for something that is no interaction.
    pub label: Option<Category>,
    /// What lies around; tag number i is on object number i. The label's object is one of them.
    pub objects: &'a [Object],
    /// Which of these are laid out as if something were to be done to them, besides the label's.
    pub within_reach: &'a [Object],
    /// By how much each tag is off its usual place, to the thing's right, forward and up, m; those not given are not.
    pub offsets: &'a [Vec3],
    /// How they move.
    pub manner: Manner,
    /// How much the hand that acts weakens the tag of what it holds, there and back, dB; 0 where no finger is on the tag.
    pub covers_db: f32,
    /// How far behind the person the things lie that are carried and neither acted on nor within reach, m, to their middles; on
    /// the table in front where that is not given. At least 1 cm wide.
    pub behind_m: Option<Range<f32>>,
    /// What the places of things and the hand that acts are drawn from where it shares them with the performances before and
    /// after it; otherwise they are its own.
    pub stay: Option<ChaCha8Rng>,
}

/// Why a brief cannot be performed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum BriefError {
    /// The object acted on is not there.
    #[error("{0} needs its object among the objects")]
    NoTarget(Category),
    /// Nobody does that.
    #[error("{0} is none of the categories")]
    NoCategory(Category),
    /// An object is there twice.
    #[error("{0} is there twice: a sample has one of each")]
    Twice(Object),
    /// No such people.
    #[error("{name} is {height_m} m tall with a build of {build}: need {HEIGHTS_M:?} m and {BUILDS:?}")]
    Size {
        /// Their name.
        name: String,
        /// Their height, m.
        height_m: f32,
        /// Their build.
        build: f32,
    },
    /// A second person has no place.
    #[error(
        "there is no room for a second person 1 to 2 m from the first, and as far from the radar as people stand: take another place or a larger room"
    )]
    NoRoom,
}

/// A simulated sample.
#[derive(Debug, Clone)]
pub struct Generated {
    stage: Stage,
    side: Side,
    target: Option<usize>,
    interaction_s: Range<f64>,
    contact: Option<(f64, Vec3)>,
    fixtures: (Surface, Vec<Vec3>),
    covered: Option<Covered>,
    company: Option<Box<Company>>,
}

/// A tag that fingers are on.
#[derive(Debug, Clone)]
struct Covered {
    tag: usize,
    /// When, s.
    when_s: Range<f64>,
    /// What they take there and back, dB.
    db: f32,
}

impl Generated {
    /// Performs `brief`, with variation drawn from `rng`.
    ///
    /// # Errors
    /// Any [`BriefError`].
    pub fn new(brief: &Brief<'_>, rng: &mut ChaCha8Rng) -> Result<Self, BriefError> {
        let target = brief.check()?;
        let ranges = brief.manner.ranges();
        let body = Body::new(brief.person.height_m, brief.person.build);
        let lengths = *body.lengths();
        let lay_out = |rng: &mut ChaCha8Rng| {
            let side = if rng.random_bool(ranges.left) { Side::Left } else { Side::Right };
            (side, Workplace::new(brief, &lengths, side, rng))
        };
        let (side, workplace) = match &brief.stay {
            Some(shared) => lay_out(&mut shared.clone()),
            None => lay_out(rng),
        };
        let mut planner = Planner::new(lengths, side, ranges, rng);
        planner.wait(&ranges.before_s);
        let begin_s = planner.now_s;
        match brief.label.zip(target) {
            Some((label, i)) => {
                let (thing, pose) = &workplace.things[i];
                planner.act(label.action, thing, *pose, workplace.surface);
            }
            None => planner.pass_time(workplace.surface),
        }
        let end_s = planner.now_s;
        planner.wait(&ranges.after_s);
        if planner.now_s < SHORTEST_S {
            planner.now_s = SHORTEST_S;
            planner.wait(&(0.0..0.4));
        }
        let (duration_s, script, contact) = (planner.now_s, planner.script, planner.contact);

        let moving = target.filter(|_| script.held.is_some());
        let held_s = script.holds_s(contact.map(|(time_s, _)| time_s));
        let covered = moving.zip(held_s).filter(|_| brief.covers_db > 0.0);
        let covered = covered.map(|(tag, when_s)| Covered { tag, when_s, db: brief.covers_db });
        let to_room = in_room(&brief.place, brief.radar);
        let tag = |(i, (thing, pose)): (usize, &(Thing, Pose))| {
            let place = thing.tag + brief.offsets.get(i).copied().unwrap_or_default();
            if moving == Some(i) {
                Mount::Thing(place)
            } else {
                Mount::Still(to_room.point(pose.point(place)))
            }
        };
        let tags = workplace.things.iter().enumerate().map(tag).collect();
        let when_s = script.held.as_ref().map(script::Held::moved_s);
        let moves = moving.zip(when_s).map(|(tag, when_s)| Moved { tag, hand: side.hand(), when_s });
        let moved = moving.map_or_else(Solid::default, |i| workplace.things[i].0.moving.clone());
        let fixtures = workplace.fixtures(moving);
        let stage = Stage::new(duration_s, body, moved, tags, moves, |time_s| {
            let Instant { joints, breath_m, thing } = script.at(time_s);
            let thing = thing.map(|pose| to_room.after(&pose));
            Instant { joints: joints.map(|joint| to_room.point(joint)), breath_m, thing }
        });
        let fixtures = (fixtures.surface, fixtures.vertices.iter().map(|&v| to_room.point(v)).collect());
        let contact = contact.map(|(time_s, place)| (time_s, to_room.point(place)));
        let interaction_s = begin_s..end_s;
        Ok(Self { stage, side, target, interaction_s, contact, fixtures, covered, company: None })
    }

    /// The same with a second person beside the one who acts at `place`, who is number `person` of `scene`; they move in
    /// `manner` where the scene says nothing else. Who and where they are is drawn from `who`, what they do from `what`.
    ///
    /// # Errors
    /// [`BriefError::NoRoom`], or if the scene's other people are of no size that can be simulated.
    pub fn accompanied(
        mut self,
        scene: &Scene,
        (person, place): (usize, &Place),
        manner: Manner,
        who: &mut ChaCha8Rng,
        what: &mut ChaCha8Rng,
    ) -> Result<Self, BriefError> {
        let (_, fixtures) = self.fixtures();
        let place = beside::place(scene, place, fixtures, who).ok_or(BriefError::NoRoom)?;
        let others: Vec<&Person> =
            scene.people.iter().enumerate().filter(|(n, _)| *n != person).map(|(_, p)| p).collect();
        // Where a scene knows one person only, the second is as tall.
        let other = others.choose(who).copied().or(scene.people.get(person)).ok_or(BriefError::NoRoom)?;
        let manner = other.manner.unwrap_or(manner);
        let company = Company::new(&self.stage, other, manner, (place, scene.radar.position), what)?;
        self.company = Some(Box::new(company));
        Ok(self)
    }

    /// Where the second person stands and looks, if there is one.
    pub fn beside(&self) -> Option<Place> {
        self.company.as_ref().map(|company| company.place())
    }

    /// Where the hand that acts is at `time_s`, m: the paper's stand-in for the object.
    pub fn hand(&self, time_s: f64) -> Vec3 {
        self.stage.joint(self.side.hand(), time_s)
    }

    /// The hand that acts.
    pub fn side(&self) -> Side {
        self.side
    }

    /// Number of the object that is acted on.
    pub fn target(&self) -> Option<usize> {
        self.target
    }

    /// All joints at `time_s`, m.
    pub fn joints(&self, time_s: f64) -> Joints {
        self.stage.joints(time_s)
    }

    /// From the first movement to the last, s; within the sample.
    pub fn interaction_s(&self) -> Range<f64> {
        self.interaction_s.clone()
    }

    /// When, s, and where, m, the hand that acts arrives at what it takes, leaves, swings or wipes; `None` if it touches
    /// nothing.
    pub fn contact(&self) -> Option<(f64, Vec3)> {
        self.contact
    }

    /// What stays where it is, triangles and vertices in the room: furniture of the workplace, and things at rest.
    pub fn fixtures(&self) -> (&Surface, &[Vec3]) {
        (&self.fixtures.0, &self.fixtures.1)
    }
}

/// Of one person, or of two: vertices and blockers of the first, then of the second; all tags are the first's.
impl Performance for Generated {
    fn duration_s(&self) -> f64 {
        self.stage.duration_s()
    }

    fn surface(&self) -> &Surface {
        self.company.as_ref().map_or(self.stage.surface(), |company| company.surface())
    }

    fn vertices(&self, time_s: f64, vertices: &mut Vec<Vec3>) {
        self.stage.vertices(time_s, vertices);
        if let Some(company) = &self.company {
            vertices.extend(company.vertices(time_s));
        }
    }

    fn tags(&self) -> usize {
        self.stage.tags()
    }

    fn tag(&self, tag: usize, time_s: f64) -> Vec3 {
        self.stage.tag(tag, time_s)
    }

    fn proxy(&self, tag: usize, time_s: f64) -> Vec3 {
        self.stage.proxy(tag, time_s)
    }

    fn covered_db(&self, tag: usize, time_s: f64) -> f32 {
        let covered = self.covered.as_ref().filter(|c| c.tag == tag && c.when_s.contains(&time_s));
        covered.map_or(0.0, |covered| covered.db)
    }

    fn blockers(&self, time_s: f64, blockers: &mut Vec<Capsule>) {
        self.stage.blockers(time_s, blockers);
        if let Some(company) = &self.company {
            blockers.extend(company.blockers(time_s));
        }
    }
}

impl Brief<'_> {
    /// Number of the object that is acted on.
    fn check(&self) -> Result<Option<usize>, BriefError> {
        let Person { name, height_m, build, .. } = self.person;
        if !HEIGHTS_M.contains(height_m) || !BUILDS.contains(build) {
            return Err(BriefError::Size { name: name.clone(), height_m: *height_m, build: *build });
        }
        for (i, object) in self.objects.iter().enumerate() {
            if self.objects[..i].contains(object) {
                return Err(BriefError::Twice(*object));
            }
        }
        let Some(label) = self.label else { return Ok(None) };
        if !CATEGORIES.contains(&label) && !UNSEEN.contains(&label) {
            return Err(BriefError::NoCategory(label));
        }
        match self.objects.iter().position(|&o| o == label.object) {
            Some(target) => Ok(Some(target)),
            None => Err(BriefError::NoTarget(label)),
        }
    }
}

/// From the axes of a person at `place` to the room; the radar is at `radar`.
pub(crate) fn in_room(place: &Place, radar: Vec3) -> Pose {
    let front = place.front(radar);
    // Without a turn they look along y.
    let turn = Quat::from_rotation_z(libm::atan2f(-front.x, front.y));
    Pose { at: place.position.extend(0.0), turn }
}
