//! A second person, who does one thing after the other beside the first: what they add to a performance.
//!
//! They are busy with one untagged thing: they pick it up and put it down, open and close it, wipe, or sit down and stand up,
//! and in between do nothing in particular. Of all that there is themselves and what they move; table, chair and case are left
//! out, so that what is clutter is the same without them.

use glam::Vec3;
use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{Brief, BriefError, Generated, Manner};
use crate::hoi::{Action, CATEGORIES, Category, UNSEEN};
use crate::simulate::grasp::minimum_jerk;
use crate::simulate::scene::{Person, Place};
use crate::simulate::shape::append;
use crate::simulate::stage::Stage;
use crate::simulate::{Capsule, Performance, Surface};

/// From the end of a deed to the next, s: they go over to the posture in which it begins.
const CHANGE_S: f64 = 0.6;
/// They began up to this long before the sample, s, and go on a little after it: its last frame may.
const BEFORE_S: f64 = 2.0;
const AFTER_S: f64 = 0.5;
/// How likely they do nothing in particular, where they are free to.
const IDLE: f64 = 0.3;

/// The second person.
#[derive(Debug, Clone)]
pub(super) struct Company {
    place: Place,
    /// Deeds one after the other, the first from before the sample on.
    deeds: Vec<Deed>,
    until_s: f64,
    /// Of both people.
    surface: Surface,
}

#[derive(Debug, Clone)]
struct Deed {
    begin_s: f64,
    generated: Generated,
    /// Number of the deed that tells where the thing is: this one, or where nothing is moved the one before it, else after it.
    thing: usize,
}

impl Company {
    /// `person`, who stands at the first of `place` and moves in `manner`, while `first` lasts; the radar is at the second.
    pub(super) fn new(
        first: &Stage,
        person: &Person,
        manner: Manner,
        (place, radar): (Place, Vec3),
        rng: &mut ChaCha8Rng,
    ) -> Result<Self, BriefError> {
        let until_s = first.duration_s() + AFTER_S;
        // The hand that acts, and where the thing is, are the same all along.
        let layout = ChaCha8Rng::from_rng(rng);
        let mut deeds = Vec::new();
        let mut begin_s = -rng.random_range(0.0..BEFORE_S);
        let known: Vec<Category> = CATEGORIES.iter().chain(&UNSEEN).copied().collect();
        let mut next = *known.choose(rng).unwrap_or(&CATEGORIES[0]);
        while begin_s < until_s {
            // Who holds something puts it down, who sits stands up.
            let busy = matches!(next.action, Action::PutDown | Action::StandUp);
            let label = (busy || !rng.random_bool(IDLE)).then_some(next);
            if label.is_some() {
                next.action = next.action.reversed();
            }
            let brief = Brief {
                person,
                place,
                radar,
                label,
                objects: &[next.object],
                within_reach: &[next.object],
                offsets: &[],
                manner,
                covers_db: 0.0,
                behind_m: None,
                stay: Some(layout.clone()),
            };
            let generated = Generated::new(&brief, rng)?;
            let end_s = begin_s + generated.duration_s() + CHANGE_S;
            deeds.push(Deed { begin_s, generated, thing: 0 });
            begin_s = end_s;
        }
        let moves = |deed: &Deed| deed.generated.stage.vertex_count() > deed.generated.stage.body_vertices();
        // Without anything that moves, any will do.
        let mut thing = deeds.iter().position(moves).unwrap_or_default();
        for (n, deed) in deeds.iter_mut().enumerate() {
            if moves(deed) {
                thing = n;
            }
            deed.thing = thing;
        }
        let mut surface = first.surface().clone();
        append(&mut surface, deeds[thing].generated.surface(), first.vertex_count());
        Ok(Self { place, deeds, until_s, surface })
    }

    /// Where they stand and look.
    pub(super) fn place(&self) -> Place {
        self.place
    }

    /// Triangles of the first person with what they move, then of this one with what they move.
    pub(super) fn surface(&self) -> &Surface {
        &self.surface
    }

    /// Which deed is on at `time_s`, and how much of the way to the next is done.
    fn at(&self, time_s: f64) -> (usize, f32) {
        let number = self.deeds.partition_point(|deed| deed.begin_s <= time_s).saturating_sub(1);
        let Deed { begin_s, generated, .. } = &self.deeds[number];
        (number, minimum_jerk((time_s - begin_s - generated.duration_s()) / CHANGE_S))
    }

    /// What `of` says of the deed at `time_s`; on the way to the next, `between` that and what it says of the next.
    fn blended<T>(
        &self,
        time_s: f64,
        of: impl Fn(&Deed, f64) -> Vec<T>,
        between: impl Fn(&T, &T, f32) -> T,
    ) -> Vec<T> {
        let time_s = time_s.clamp(0.0, self.until_s);
        let (number, share) = self.at(time_s);
        let now = of(&self.deeds[number], time_s);
        match self.deeds.get(number + 1).filter(|_| share > 0.0) {
            Some(next) => now.iter().zip(of(next, time_s)).map(|(a, b)| between(a, &b, share)).collect(),
            None => now,
        }
    }

    /// Vertices at `time_s`, m.
    pub(super) fn vertices(&self, time_s: f64) -> Vec<Vec3> {
        let vertices = |deed: &Deed, time_s: f64| {
            let mut vertices = Vec::new();
            deed.generated.vertices(time_s - deed.begin_s, &mut vertices);
            let holder = &self.deeds[deed.thing];
            let body = deed.generated.stage.body_vertices();
            if vertices.len() == body && holder.generated.stage.vertex_count() > body {
                let mut theirs = Vec::new();
                holder.generated.vertices(time_s - holder.begin_s, &mut theirs);
                vertices.extend_from_slice(&theirs[body..]);
            }
            vertices
        };
        self.blended(time_s, vertices, |a, b, share| a.lerp(*b, share))
    }

    /// Their body in the way of tags at `time_s`.
    pub(super) fn blockers(&self, time_s: f64) -> Vec<Capsule> {
        let blockers = |deed: &Deed, time_s: f64| {
            let mut blockers = Vec::new();
            deed.generated.blockers(time_s - deed.begin_s, &mut blockers);
            blockers
        };
        self.blended(time_s, blockers, |a, b, share| Capsule {
            ends: [0, 1].map(|end| a.ends[end].lerp(b.ends[end], share)),
            ..*a
        })
    }
}
