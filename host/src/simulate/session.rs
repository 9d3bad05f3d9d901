//! Performances one after the other, in one session of the reader.
//!
//! Between two of them everything is at rest for [`PAUSE_S`]; in the middle of it the next scene is set, as a film is cut. Things
//! stay where they are, but for the one that was acted on: it is back where it was, or where what comes next finds it.

use glam::Vec3;
use rand_chacha::ChaCha8Rng;
use rfhoi_shared::radar::RadarProfile;
use rfhoi_shared::tag::TagRead;
use rfhoi_shared::units::Kilohertz;

use super::draw::Draw;
use super::effects::Effects;
use super::sample::Take;
use super::scene::Tag;
use super::{Capsule, Performance, Surface};
use crate::hoi::{Category, Object};

/// Rest between two performances, s.
pub const PAUSE_S: f64 = 2.0;

/// Draws of `then` after `first`: the same person at the same place among the same things, of which some are replaced where one
/// is needed that is not there. `None` where more are needed than there are.
pub fn draws(mut first: Draw, then: &[Option<Category>]) -> Option<Vec<Draw>> {
    let labels: Vec<Option<Category>> = [first.label].into_iter().chain(then.iter().copied()).collect();
    first.stays = !then.is_empty();
    let needed: Vec<Object> = labels.iter().flatten().map(|label| label.object).collect();
    for object in &needed {
        if !first.objects.contains(object) {
            let spare = first.objects.iter_mut().find(|other| !needed.contains(other));
            *spare? = *object;
        }
    }
    first.within_reach.extend(needed);
    let draw = |(sample, label): (u32, Option<Category>)| {
        let mut draw = first.clone();
        draw.sample = sample;
        draw.target = label.and_then(|label| first.objects.iter().position(|o| *o == label.object));
        (draw.label, draw.performed) = (label, label);
        draw
    };
    Some((0..).zip(labels).map(draw).collect())
}

/// One take after the other.
pub struct Session<'a> {
    takes: Vec<Take<'a>>,
    /// When each begins, s.
    begins_s: Vec<f64>,
    duration_s: f64,
    /// The reader does not look at surfaces.
    surface: Surface,
}

impl<'a> Session<'a> {
    /// Of `first` and what follows, all with the same scene, tags and effects.
    pub fn new(first: Take<'a>, then: impl IntoIterator<Item = Take<'a>>) -> Self {
        let takes: Vec<Take<'a>> = [first].into_iter().chain(then).collect();
        let mut begins_s = Vec::with_capacity(takes.len());
        let mut duration_s = 0.0;
        for take in &takes {
            duration_s += if begins_s.is_empty() { 0.0 } else { PAUSE_S };
            begins_s.push(duration_s);
            duration_s += take.performance.duration_s();
        }
        Self { takes, begins_s, duration_s, surface: Surface::default() }
    }

    /// The takes.
    pub fn takes(&self) -> &[Take<'a>] {
        &self.takes
    }

    /// When each take begins, s.
    pub fn begins_s(&self) -> &[f64] {
        &self.begins_s
    }

    /// The tags.
    pub fn tags(&self) -> &[Tag] {
        self.takes[0].tags
    }

    /// What is simulated.
    pub fn effects(&self) -> Effects {
        self.takes[0].effects
    }

    /// Which take is on at `time_s`, and when that is in it, s.
    pub fn at(&self, time_s: f64) -> (usize, f64) {
        let begun = self.begins_s.iter().skip(1).take_while(|begin_s| time_s >= **begin_s - PAUSE_S / 2.0);
        let take = begun.count();
        (take, time_s - self.begins_s[take])
    }

    /// As [`Take::frame_times`], over all takes.
    pub fn frame_times(&self, profile: &RadarProfile) -> impl ExactSizeIterator<Item = f64> + use<> {
        Take { performance: self, ..self.takes[0] }.frame_times(profile)
    }

    /// As [`Take::reads`], over all takes.
    pub fn reads(&self, rng: &mut ChaCha8Rng) -> (Vec<TagRead>, Vec<Kilohertz>) {
        Take { performance: self, ..self.takes[0] }.reads(rng)
    }
}

/// What the reader is told.
impl Performance for Session<'_> {
    fn duration_s(&self) -> f64 {
        self.duration_s
    }

    fn surface(&self) -> &Surface {
        &self.surface
    }

    fn vertices(&self, _time_s: f64, vertices: &mut Vec<Vec3>) {
        vertices.clear();
    }

    fn tags(&self) -> usize {
        self.takes[0].performance.tags()
    }

    fn tag(&self, tag: usize, time_s: f64) -> Vec3 {
        let (take, time_s) = self.at(time_s);
        self.takes[take].performance.tag(tag, time_s)
    }

    fn proxy(&self, tag: usize, time_s: f64) -> Vec3 {
        let (take, time_s) = self.at(time_s);
        self.takes[take].performance.proxy(tag, time_s)
    }

    fn covered_db(&self, tag: usize, time_s: f64) -> f32 {
        let (take, time_s) = self.at(time_s);
        self.takes[take].performance.covered_db(tag, time_s)
    }

    fn blockers(&self, time_s: f64, blockers: &mut Vec<Capsule>) {
        let (take, time_s) = self.at(time_s);
        self.takes[take].performance.blockers(time_s, blockers);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hoi::CATEGORIES;
    use crate::simulate::draw::{Wanted, draw};
    use crate::simulate::effects::Domain;
    use crate::simulate::sample::perform;
    use crate::simulate::scene::Scene;

    #[test]
    fn one_after_the_other_with_the_same_tags() {
        let scenes = [Scene::named("kitchen").unwrap()];
        let first = draw(&Wanted::one(Domain::Site, 5, &CATEGORIES[1..2]), &scenes).swap_remove(0);
        let then = [None, Some(CATEGORIES[9])];
        let draws = draws(first.clone(), &then).unwrap();
        assert!(draws.iter().all(|d| d.objects == draws[0].objects && d.place() == first.place()));
        assert_eq!(
            draws.iter().map(|d| d.label).collect::<Vec<_>>(),
            [Some(CATEGORIES[1]), None, Some(CATEGORIES[9])]
        );
        let acted: Vec<_> = draws.iter().map(|d| perform(Domain::Site, 5, d, &scenes[0]).unwrap()).collect();
        let take = |(generated, tags)| Take::of(&scenes[0], generated, tags, Effects::of(Domain::Site));
        let mut takes = acted.iter().map(|(generated, tags)| take((generated, tags)));
        let session = Session::new(takes.next().unwrap(), takes);
        let [a, b, c] = [0, 1, 2].map(|n| acted[n].0.duration_s());
        assert!((session.duration_s() - (a + b + c + 2.0 * PAUSE_S)).abs() < 1e-9);
        assert_eq!(session.at(-3.0), (0, -3.0));
        assert_eq!(session.at(a + 0.9).0, 0);
        assert_eq!(session.at(a + 1.1).0, 1);
        let (take, s) = session.at(session.begins_s()[2] + 0.5);
        assert!(take == 2 && (s - 0.5).abs() < 1e-9);
        let target = draws[2].target.unwrap();
        assert_eq!(session.tag(target, session.begins_s()[2] + 1.0), acted[2].0.tag(target, 1.0));
        // What nobody touches stays where it is, through all of it.
        let still = |tag: &usize| draws.iter().all(|draw| draw.target != Some(*tag));
        let untouched: Vec<usize> = (0..first.objects.len()).filter(still).collect();
        assert!(untouched.len() > 3);
        for tag in untouched {
            let at = session.tag(tag, 0.0);
            assert!(
                [a + 1.5, session.duration_s()].iter().all(|time_s| session.tag(tag, *time_s) == at),
                "{tag}"
            );
        }
        // More things than there are tags.
        let all: Vec<_> = CATEGORIES.iter().copied().map(Some).collect();
        assert_eq!(super::draws(first, &all), None);
    }
}
