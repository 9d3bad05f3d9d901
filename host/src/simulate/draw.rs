//! What each sample of a data set is about, drawn from a seed.
//!
//! Categories take turns, in an order drawn anew each time, and so come out even; who, where, and which things lie about is drawn for each sample from a stream of
//! its own, so that a sample is the same whichever others are made.

use glam::Vec2;
use rand::seq::{IndexedRandom, SliceRandom};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

use super::circumstance::Circumstance;
use super::effects::Domain;
use super::scene::{Place, SAMPLE_TAGS, Scene};
use crate::hoi::{CATEGORIES, Category, Object};

/// Distances from the radar at which people act in `train`, m (section 4.2 of the paper).
const DISTANCE_M: core::ops::Range<f32> = 1.0..3.0;
/// Between a person's middle and the end of what the radar sees, m: their back is not past it.
const BODY_M: f32 = 0.05;
/// Bearings to either side, deg.
const BEARING_DEG: f32 = 45.0;
/// Most objects within reach, the target included.
const MOST_WITHIN_REACH: usize = 3;
/// Points that are tried for one at which somebody may stand.
const TRIES: usize = 200;
/// Directions in which people look, deg; 0 is towards the radar.
pub const FACING_DEG: [f32; 7] = [-90.0, -60.0, -30.0, 0.0, 30.0, 60.0, 90.0];

/// Within a setup, so far people stand from its place each way, m, and look past its direction to either side, deg: they come
/// back to a mark on the floor.
const MARK_M: f32 = 0.05;
const MARK_DEG: f32 = 5.0;

/// Which samples are wanted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wanted<'a> {
    /// Whose data it stands for.
    pub domain: Domain,
    /// Seed of everything.
    pub seed: u64,
    /// Number of samples.
    pub samples: u32,
    /// What is done in them, in turn.
    pub categories: &'a [Category],
    /// Share of samples in which nothing of that is done.
    pub nothing: f64,
    /// Whether objects are replaced where the action would be the same (algorithm 1 of the paper).
    pub expand: bool,
    /// Setups among which all samples of `site` are spread: a room, a person, a place and a direction to look in each. The
    /// paper has 78 (section 4.2). `None` draws all of that anew for each sample.
    pub setups: Option<u32>,
    /// What makes it harder, if anything.
    pub circumstance: Option<Circumstance>,
}

impl<'a> Wanted<'a> {
    /// One sample of these categories, or of nothing where there are none.
    pub fn one(domain: Domain, seed: u64, categories: &'a [Category]) -> Self {
        let nothing = if categories.is_empty() { 1.0 } else { 0.0 };
        Self {
            domain,
            seed,
            samples: 1,
            categories,
            nothing,
            expand: false,
            setups: None,
            circumstance: None,
        }
    }
}

/// One sample before it is made.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Draw {
    /// Its number.
    pub sample: u32,
    /// What it is labelled with; `None` is no interaction.
    pub label: Option<Category>,
    /// What is moved in it; differs from the label after [`Wanted::expand`].
    pub performed: Option<Category>,
    /// What the tags are on, in the order of their numbers, by label.
    pub objects: Vec<Object>,
    /// Number of the target's tag.
    pub target: Option<usize>,
    /// Number of the setup, where the set has [`Wanted::setups`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub setup: Option<usize>,
    /// Number of the scene.
    pub scene: usize,
    /// Number of the person in the scene.
    pub person: usize,
    /// From the radar to the person, m.
    pub distance_m: f32,
    /// Bearing of the person, to the right of the radar's boresight, deg.
    pub bearing_deg: f32,
    /// Where the person looks, deg; 0 is towards the radar.
    pub facing_deg: f32,
    /// What is within reach, besides the target: what could have been acted on.
    pub within_reach: Vec<Object>,
    /// Whether it is one of several performances between which things stay where they are.
    #[serde(skip)]
    pub stays: bool,
    /// What makes it harder; the manifest says it of all samples at once.
    #[serde(skip)]
    pub circumstance: Option<Circumstance>,
    #[serde(skip)]
    place: Vec2,
}

/// What a stream of random numbers is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Purpose {
    /// Who, where, with what.
    Draw,
    /// In which order categories take turns.
    Labels,
    /// How they move.
    Motion,
    /// Noise of the radar.
    Radar,
    /// The reader's session and its reads.
    Rfid,
    /// Which setups there are.
    Setups,
    /// Which rooms there are.
    Rooms,
    /// Where things are during several performances.
    Stay,
    /// What a circumstance adds.
    Circumstance,
}

/// Who stands where.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Setup {
    scene: usize,
    person: usize,
    place: Place,
}

/// `count` rooms drawn around the radar, the reader and the tags of `scene`; the first are the same however many there are.
pub fn rooms(domain: Domain, seed: u64, scene: &Scene, count: u32) -> Vec<Scene> {
    (0..count)
        .map(|n| {
            let rng = &mut stream(domain, seed, n, Purpose::Rooms);
            scene.other_room(n as usize + 1, domain.manner_in_rooms(), rng)
        })
        .collect()
}

/// How many setups scenes have.
pub fn most_setups(scenes: &[Scene]) -> usize {
    all_setups(scenes).len()
}

/// Every person at every place, looking every way that leaves room for their hands.
fn all_setups(scenes: &[Scene]) -> Vec<Setup> {
    let mut all = Vec::new();
    for (number, scene) in scenes.iter().enumerate() {
        let mut positions: Vec<Vec2> = scene.places.iter().map(|place| place.position).collect();
        // A place is listed once for each way to look that its file knows.
        positions.dedup();
        for (person, position) in (0..scene.people.len()).flat_map(|n| positions.iter().map(move |p| (n, *p)))
        {
            let ways = FACING_DEG.map(|deg| Place { position, facing_rad: deg.to_radians() });
            let free = ways.into_iter().filter(|place| scene.is_free(place));
            all.extend(free.map(|place| Setup { scene: number, person, place }));
        }
    }
    all
}

/// The wanted setups, no two the same; fewer if the scenes have no more of them.
fn setups(wanted: &Wanted<'_>, count: u32, scenes: &[Scene]) -> Vec<Setup> {
    let mut setups = all_setups(scenes);
    setups.shuffle(&mut stream(wanted.domain, wanted.seed, 0, Purpose::Setups));
    setups.truncate(count as usize);
    setups
}

impl Setup {
    /// Where they stand this time.
    fn again(&self, scenes: &[Scene], rng: &mut ChaCha8Rng) -> Place {
        let mut off = |most: f32| rng.random_range(-most..most);
        let position = self.place.position + Vec2::new(off(MARK_M), off(MARK_M));
        let place = Place { position, facing_rad: self.place.facing_rad + off(MARK_DEG).to_radians() };
        if scenes[self.scene].is_free(&place) { place } else { self.place }
    }
}

/// The stream of random numbers for one purpose of one sample; domains share none.
pub fn stream(domain: Domain, seed: u64, sample: u32, purpose: Purpose) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream((domain as u64) << 40 | (purpose as u64) << 32 | u64::from(sample));
    rng
}

/// All labels, in the order of the samples.
fn labels(wanted: &Wanted<'_>) -> Vec<Option<Category>> {
    let (mut labels, mut block) = (Vec::new(), Vec::new());
    let mut interactions = 0;
    for sample in 0..wanted.samples {
        // As many are nothing as are due by now.
        let due = |samples: u32| (f64::from(samples) * wanted.nothing).round() as u32;
        if due(sample + 1) > due(sample) || wanted.categories.is_empty() {
            labels.push(None);
            continue;
        }
        if block.is_empty() {
            block = wanted.categories.to_vec();
            block.shuffle(&mut stream(wanted.domain, wanted.seed, interactions, Purpose::Labels));
        }
        labels.push(block.pop());
        interactions += 1;
    }
    labels
}

/// Draws all samples.
///
/// # Panics
/// If there are no scenes, or one of them lacks people or places.
pub fn draw(wanted: &Wanted<'_>, scenes: &[Scene]) -> Vec<Draw> {
    let setups = wanted.setups.map(|count| setups(wanted, count, scenes));
    let labels = (0..).zip(labels(wanted));
    labels.map(|(sample, label)| one(wanted, scenes, setups.as_deref(), sample, label)).collect()
}

fn one(
    wanted: &Wanted<'_>,
    scenes: &[Scene],
    setups: Option<&[Setup]>,
    sample: u32,
    performed: Option<Category>,
) -> Draw {
    let rng = &mut stream(wanted.domain, wanted.seed, sample, Purpose::Draw);
    let setup = setups.map(|setups| rng.random_range(0..setups.len()));
    let (scene, person, place) = match setups.zip(setup) {
        Some((setups, number)) => {
            let setup = &setups[number];
            (setup.scene, setup.person, setup.again(scenes, rng))
        }
        None => {
            let scene = rng.random_range(0..scenes.len());
            let person = rng.random_range(0..scenes[scene].people.len());
            (scene, person, stand(wanted.domain, &scenes[scene], rng))
        }
    };
    // Objects that the set does not know stay out of it.
    let known = |object: &Object| {
        wanted.expand
            || CATEGORIES.iter().any(|c| c.object == *object)
            || wanted.categories.iter().any(|c| c.object == *object)
    };
    let tagged = |object: &Object| scenes[scene].tags.iter().any(|t| t.object == *object);
    let mut others: Vec<Object> = Object::ALL.iter().copied().filter(known).filter(tagged).collect();
    others.retain(|o| performed.is_none_or(|p| p.object != *o));
    others.shuffle(rng);
    let mut objects: Vec<Object> =
        performed.iter().map(|p| p.object).chain(others).take(SAMPLE_TAGS).collect();
    objects.shuffle(rng);
    let target = performed.and_then(|p| objects.iter().position(|o| *o == p.object));
    let label = match (performed, target) {
        (Some(performed), Some(target)) if wanted.expand && performed.action.is_object_agnostic() => {
            let carried: Vec<Object> =
                Object::ALL.iter().copied().filter(|o| o.is_carried() && tagged(o)).collect();
            let new = carried.choose(rng).copied().unwrap_or(performed.object);
            // One of each kind: the other one of that name takes the old name.
            if let Some(other) = objects.iter().position(|o| *o == new) {
                objects[other] = performed.object;
            }
            objects[target] = new;
            Some(Category { object: new, ..performed })
        }
        _ => performed,
    };
    let mut draw = Draw {
        sample,
        label,
        performed,
        objects,
        target,
        setup,
        scene,
        person,
        distance_m: 0.0,
        bearing_deg: 0.0,
        facing_deg: place.facing_rad.to_degrees(),
        within_reach: Vec::new(),
        stays: false,
        circumstance: wanted.circumstance,
        place: place.position,
    };
    draw.move_to(place.position, &scenes[draw.scene]);
    // Where nothing is done up to as many: what lies ready does not tell which.
    let targets = usize::from(performed.is_some());
    let others = rng.random_range(targets..=MOST_WITHIN_REACH) - targets;
    draw.within_reach = draw.performed_objects();
    draw.within_reach.retain(|object| performed.is_none_or(|performed| performed.object != *object));
    draw.within_reach.shuffle(rng);
    draw.within_reach.truncate(others);
    if wanted.circumstance == Some(Circumstance::Body) {
        // What is carried lies behind the person, where a chair would stand in its way.
        draw.within_reach.retain(|object| !object.is_carried() && *object != Object::Chair);
    }
    draw
}

/// Where somebody stands: in `train` anywhere the paper had people, as far as the room is free there, in `site` at one of the
/// scene's places; facing where the room lets their hands be.
fn stand(domain: Domain, scene: &Scene, rng: &mut ChaCha8Rng) -> Place {
    let facing = |rng: &mut ChaCha8Rng| FACING_DEG.choose(rng).copied().unwrap_or(0.0).to_radians();
    match domain {
        Domain::Train => {
            // A coarse profile may see less far than the paper's people were.
            let farthest = (scene.radar.depth_m - BODY_M).clamp(DISTANCE_M.start + BODY_M, DISTANCE_M.end);
            let mut anywhere = || {
                let distance_m = rng.random_range(DISTANCE_M.start..farthest);
                let bearing = scene.radar.yaw_rad + rng.random_range(-BEARING_DEG..BEARING_DEG).to_radians();
                let way = Vec2::new(libm::sinf(bearing), libm::cosf(bearing)) * distance_m;
                Place { position: scene.radar.position.truncate() + way, facing_rad: facing(rng) }
            };
            let free = (0..TRIES).map(|_| anywhere()).find(|place| scene.admits(place));
            free.unwrap_or_else(|| scene.places[rng.random_range(0..scene.places.len())])
        }
        Domain::Site => {
            let place = scene.places[rng.random_range(0..scene.places.len())];
            let turned = Place { facing_rad: facing(rng), ..place };
            // The file's own way to look is known to be free.
            if scene.is_free(&turned) { turned } else { place }
        }
    }
}

impl Draw {
    /// Moves the person to `position`, x and y in `scene`, m; they look as before.
    pub fn move_to(&mut self, position: Vec2, scene: &Scene) {
        let way = position - scene.radar.position.truncate();
        self.place = position;
        self.distance_m = way.length();
        self.bearing_deg = (libm::atan2f(way.x, way.y) - scene.radar.yaw_rad).to_degrees();
    }

    /// Where the person stands and looks.
    pub fn place(&self) -> Place {
        Place { position: self.place, facing_rad: self.facing_deg.to_radians() }
    }

    /// What the tags are really on, in the order of their numbers.
    pub fn performed_objects(&self) -> Vec<Object> {
        let mut objects = self.objects.clone();
        if let (Some(performed), Some(target)) = (self.performed, self.target) {
            let labelled = objects[target];
            if let Some(other) = objects.iter().position(|o| *o == performed.object) {
                objects[other] = labelled;
            }
            objects[target] = performed.object;
        }
        objects
    }
}

#[cfg(test)]
mod tests {
    use std::collections::{BTreeMap, BTreeSet};

    use super::*;

    fn wanted(domain: Domain) -> Wanted<'static> {
        Wanted {
            domain,
            seed: 7,
            samples: 340,
            categories: &CATEGORIES,
            nothing: 0.0,
            expand: false,
            setups: None,
            circumstance: None,
        }
    }

    fn scenes() -> Vec<Scene> {
        ["working-space", "kitchen"].map(|name| Scene::named(name).unwrap()).to_vec()
    }

    #[test]
    fn categories_come_out_even_and_targets_everywhere() {
        let draws = draw(&wanted(Domain::Site), &scenes());
        let mut counts = BTreeMap::new();
        for d in &draws {
            *counts.entry(d.label.unwrap()).or_insert(0) += 1;
            assert_eq!(d.objects.iter().collect::<BTreeSet<_>>().len(), SAMPLE_TAGS);
            assert_eq!(d.objects[d.target.unwrap()], d.label.unwrap().object);
            assert!(d.objects.iter().all(|o| o.index() < 8), "unseen objects stay unseen");
            assert!((0.9..3.05).contains(&d.distance_m) && d.bearing_deg.abs() < 46.0, "{d:?}");
        }
        assert!(counts.values().all(|&n| n == 20), "{counts:?}");
        assert_eq!(draws.iter().map(|d| d.target).collect::<BTreeSet<_>>().len(), SAMPLE_TAGS);
        assert_eq!(draws.iter().map(|d| d.facing_deg as i32).collect::<BTreeSet<_>>().len(), 7);
    }

    #[test]
    fn a_sample_does_not_depend_on_how_many_there_are_but_on_seed_and_domain() {
        let site = draw(&wanted(Domain::Site), &scenes());
        let fewer = draw(&Wanted { samples: 45, nothing: 0.0, ..wanted(Domain::Site) }, &scenes());
        assert_eq!(fewer, site[..45]);
        assert_eq!(site, draw(&wanted(Domain::Site), &scenes()));
        assert_ne!(site, draw(&Wanted { seed: 8, ..wanted(Domain::Site) }, &scenes()));
        assert_ne!(site[0].objects, draw(&wanted(Domain::Train), &scenes())[0].objects);
    }

    #[test]
    fn a_share_is_no_interaction() {
        let draws = draw(&Wanted { nothing: 0.1, ..wanted(Domain::Train) }, &scenes());
        let nothing = draws.iter().filter(|d| d.label.is_none());
        assert_eq!(nothing.clone().count(), 34);
        assert!(nothing.clone().all(|d| d.target.is_none() && d.objects.len() == SAMPLE_TAGS));
    }

    #[test]
    fn what_is_within_reach_does_not_tell_whether_something_is_done() {
        let draws = draw(&Wanted { nothing: 0.5, ..wanted(Domain::Site) }, &scenes());
        let mean = |done: bool| {
            let counts = draws.iter().filter(|d| d.label.is_some() == done);
            let counts = counts.map(|d| d.within_reach.len() + usize::from(done)).collect::<Vec<_>>();
            counts.iter().sum::<usize>() as f64 / counts.len() as f64
        };
        // 1 to 3 where something is done, its object among them; 0 to 3 else.
        assert!((1.8..2.2).contains(&mean(true)) && (1.3..1.7).contains(&mean(false)));
        for d in &draws {
            let reach: BTreeSet<_> = d.within_reach.iter().collect();
            assert!(reach.len() == d.within_reach.len() && reach.iter().all(|o| d.objects.contains(o)));
            assert!(d.label.is_none_or(|label| !reach.contains(&label.object)));
        }
        assert!(draws.iter().any(|d| d.label.is_none() && d.within_reach.contains(&Object::Chair)));
    }

    #[test]
    fn people_of_train_stand_free_in_any_room() {
        let hall = Scene::named("open-room").unwrap();
        let scenes = rooms(Domain::Train, 3, &hall, 6);
        assert_eq!(scenes[..2], rooms(Domain::Train, 3, &hall, 2));
        let draws = draw(&wanted(Domain::Train), &scenes);
        for d in &draws {
            assert!(scenes[d.scene].admits(&d.place()), "{d:?}");
        }
        assert_eq!(draws.iter().map(|d| d.scene).collect::<BTreeSet<_>>().len(), 6);
    }

    #[test]
    fn setups_are_few_and_people_come_back_to_their_marks() {
        let scenes = scenes();
        let draws = draw(&Wanted { setups: Some(12), ..wanted(Domain::Site) }, &scenes);
        let mut of_setup: BTreeMap<usize, Vec<&Draw>> = BTreeMap::new();
        draws.iter().for_each(|draw| of_setup.entry(draw.setup.unwrap()).or_default().push(draw));
        assert_eq!(of_setup.len(), 12);
        for draws in of_setup.values() {
            let first = draws[0];
            for draw in draws {
                assert_eq!((draw.scene, draw.person), (first.scene, first.person));
                let apart = draw.place.distance(first.place);
                assert!(
                    apart <= 2.9 * MARK_M && (draw.facing_deg - first.facing_deg).abs() <= 2.0 * MARK_DEG
                );
            }
            let places: BTreeSet<u32> = draws.iter().map(|draw| draw.place.x.to_bits()).collect();
            assert!(places.len() > draws.len() / 2, "never quite the same");
        }
        assert!(most_setups(&scenes) > 78, "{}", most_setups(&scenes));
    }

    #[test]
    fn expansion_replaces_objects_of_actions_that_do_not_care() {
        let draws = draw(&Wanted { expand: true, ..wanted(Domain::Train) }, &scenes());
        let changed = draws.iter().filter(|d| d.label != d.performed).collect::<Vec<_>>();
        // 8 of 17 categories, 8 of 9 draws.
        assert!((120..165).contains(&changed.len()), "{}", changed.len());
        for d in &draws {
            let (label, performed, target) = (d.label.unwrap(), d.performed.unwrap(), d.target.unwrap());
            assert_eq!((label.action, d.objects[target]), (performed.action, label.object));
            assert!(label == performed || label.action.is_object_agnostic());
            let really = d.performed_objects();
            assert_eq!(really[target], performed.object);
            assert_eq!(really.iter().collect::<BTreeSet<_>>().len(), SAMPLE_TAGS);
        }
        assert!(changed.iter().any(|d| d.label.unwrap().object == Object::Jar));
    }
}
