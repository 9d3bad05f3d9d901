use glam::{Vec2, Vec3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::{Brief, BriefError, Generated, Manner, SHORTEST_S};
use crate::hoi::{Action, CATEGORIES, Category, Object, UNSEEN};
use crate::simulate::Performance;
use crate::simulate::body::{Body, Joint, Side};
use crate::simulate::scene::{Person, Place};

const RADAR: Vec3 = Vec3::new(0.0, 0.0, 1.0);
const PEOPLE: [(f32, f32); 3] = [(1.63, 0.85), (1.75, 1.0), (1.91, 1.25)];

fn person(number: usize) -> Person {
    let (height_m, build) = PEOPLE[number % PEOPLE.len()];
    Person { name: "somebody".to_owned(), height_m, build, manner: None }
}

fn place(number: usize) -> Place {
    let facing_rad = [0.0, 1.57, -1.57, 0.5][number % 4];
    Place { position: Vec2::new(-0.7 + 0.4 * number as f32, 2.0), facing_rad }
}

/// Six objects, the label's among them.
fn objects(label: Option<Category>, seed: u64) -> Vec<Object> {
    let mut objects: Vec<Object> = label.map(|l| l.object).into_iter().collect();
    let mut next = seed as usize;
    while objects.len() < 6 {
        let object = Object::ALL[next % Object::ALL.len()];
        if !objects.contains(&object) {
            objects.push(object);
        }
        next += 5;
    }
    objects.rotate_left(seed as usize % 6);
    objects
}

fn sample(label: Option<Category>, manner: Manner, seed: u64) -> Generated {
    let objects = objects(label, seed);
    let person = person(seed as usize);
    let brief = Brief {
        person: &person,
        place: place(seed as usize / 3),
        radar: RADAR,
        offsets: &[],
        label,
        objects: &objects,
        within_reach: &[],
        manner,
        covers_db: 0.0,
        behind_m: None,
        stay: None,
    };
    Generated::new(&brief, &mut ChaCha8Rng::seed_from_u64(seed)).unwrap()
}

fn labels() -> impl Iterator<Item = Option<Category>> {
    CATEGORIES.iter().chain(&UNSEEN).copied().map(Some).chain([None])
}

/// Samples of all labels and manners, the label with each.
fn samples(seeds: u64) -> impl Iterator<Item = (Option<Category>, Manner, u64, Generated)> {
    labels().enumerate().flat_map(move |(i, label)| {
        let manners = Manner::ALL.into_iter();
        let all = manners.flat_map(move |manner| (0..seeds).map(move |s| (manner, s * 37 + i as u64)));
        all.map(move |(manner, seed)| (label, manner, seed, sample(label, manner, seed)))
    })
}

fn times(generated: &Generated, step_s: f64) -> impl Iterator<Item = f64> + use<> {
    (0..=(generated.duration_s() / step_s) as usize).map(move |i| i as f64 * step_s)
}

/// A hand's fastest, m/s.
fn peak_speed(generated: &Generated, at: impl Fn(f64) -> Vec3) -> f32 {
    const STEP_S: f64 = 0.005;
    times(generated, STEP_S).map(|t| (at(t + STEP_S) - at(t)).length() / STEP_S as f32).fold(0.0, f32::max)
}

#[test]
fn bones_keep_their_lengths_and_feet_stay_on_the_floor() {
    use Joint::*;
    let bones = [
        (HipCentre, Spine),
        (Spine, ShoulderCentre),
        (ShoulderCentre, Head),
        (ShoulderLeft, ElbowLeft),
        (ElbowLeft, WristLeft),
        (WristLeft, HandLeft),
        (ShoulderRight, ElbowRight),
        (ElbowRight, WristRight),
        (HipLeft, KneeLeft),
        (KneeLeft, AnkleLeft),
        (KneeRight, AnkleRight),
        (AnkleRight, FootRight),
        (ShoulderLeft, ShoulderRight),
    ];
    for (label, manner, seed, generated) in samples(4) {
        let lengths = |t: f64| {
            let joints = generated.joints(t);
            bones.map(|(a, b)| joints[a.index()].distance(joints[b.index()]))
        };
        let first = lengths(0.0);
        let feet = generated.joints(0.0);
        let mut worst: f32 = 0.0;
        for t in times(&generated, 0.033) {
            for (a, b) in lengths(t).iter().zip(first) {
                worst = worst.max((a - b).abs());
            }
            let joints = generated.joints(t);
            for ankle in [AnkleLeft, AnkleRight].map(Joint::index) {
                let moved = joints[ankle].distance(feet[ankle]);
                assert!(label.is_none() || moved < 5e-4, "{label:?} {seed}: a foot slid by {moved} m");
                assert!(joints[ankle].z > feet[ankle].z - 1e-3);
            }
        }
        assert!(worst < 5e-4, "{label:?} {manner:?} {seed}: a bone changes by {worst} m");
    }
}

#[test]
fn nothing_is_below_the_floor_and_people_are_as_tall_as_they_are() {
    let mut vertices = Vec::new();
    for (label, manner, seed, generated) in samples(4) {
        let height = person(seed as usize).height_m;
        for t in times(&generated, 0.1) {
            generated.vertices(t, &mut vertices);
            assert!(vertices.iter().all(|v| v.is_finite() && v.z > -1e-3), "{label:?} {seed} at {t}");
        }
        let seated_first = label.is_some_and(|l| l.action == Action::StandUp);
        generated.vertices(if seated_first { generated.duration_s() } else { 0.0 }, &mut vertices);
        // The body's come first.
        let own = Body::new(height, 1.0).vertex_count();
        let top = vertices[..own].iter().map(|v| v.z).fold(0.0, f32::max);
        assert!((top - height).abs() < 0.02, "{label:?} {manner:?} {seed}: {top} of {height}");
        let surface = generated.surface();
        assert_eq!(surface.triangles.len(), surface.reflectivity.len());
        assert!(surface.triangles.iter().flatten().all(|&v| (v as usize) < vertices.len()));
        let (fixed, places) = generated.fixtures();
        assert!(fixed.triangles.iter().flatten().all(|&v| (v as usize) < places.len()));
        assert!(places.iter().all(|v| v.z > -1e-4));
    }
}

#[test]
fn tags_move_with_what_moves_them() {
    for (label, manner, seed, generated) in samples(12) {
        let what = format!("{label:?} {manner:?} {seed}");
        assert_eq!(generated.tags(), 6);
        let end = generated.duration_s();
        for tag in (0..6).filter(|&i| Some(i) != generated.target()) {
            assert!(
                generated.tag(tag, 0.0) == generated.tag(tag, end),
                "{what}: tag {tag} is not the target"
            );
        }
        let Some((label, target)) = label.zip(generated.target()) else { continue };
        let tag = |t: f64| generated.tag(target, t);
        let way = tag(end).distance(tag(0.0));
        // From hand to tag where the hand moves fastest with the thing.
        let apart = |t: f64| generated.hand(t).distance(tag(t));
        match label.action {
            Action::SitDown | Action::StandUp | Action::Wipe => assert!(way == 0.0, "{what}: {way}"),
            Action::PickUp | Action::PutDown => {
                assert!(way > 0.15, "{what}: the tag moved by {way} m only");
                let [at, after] = if label.action == Action::PickUp { [end, end - 0.4] } else { [0.0, 0.4] };
                assert!((apart(at) - apart(after)).abs() < 1e-3, "{what}: {} {}", apart(at), apart(after));
                assert!(apart(at) < 0.25, "{what}: {}", apart(at));
            }
            Action::Open | Action::Close => {
                assert!(way > 0.1, "{what}: {way}");
                // On a circle: the same distance from the middle of three of its points, all along.
                let moved: Vec<Vec3> = times(&generated, 0.02).map(tag).collect();
                let half = moved.iter().position(|p| p.distance(moved[0]) > 0.5 * way).unwrap();
                let centre = circle_centre(moved[0], moved[half], tag(end));
                let radius = moved[0].distance(centre);
                let off = moved.iter().map(|p| (p.distance(centre) - radius).abs()).fold(0.0, f32::max);
                assert!(off < 2e-3, "{what}: {off} m off a circle of {radius} m");
            }
        }
    }
}

fn circle_centre(a: Vec3, b: Vec3, c: Vec3) -> Vec3 {
    let (u, v) = (b - a, c - a);
    let normal = u.cross(v);
    a + (normal.cross(u) * v.length_squared() + v.cross(normal) * u.length_squared())
        / (2.0 * normal.length_squared())
}

/// Hands arrive where the plan has things, and stay at the edge of a door while it swings.
#[test]
fn hands_are_where_things_are_taken() {
    let (mut worst, mut slipped): (f32, f32) = (0.0, 0.0);
    for (label, manner, seed, generated) in samples(40) {
        let Some((label, target)) = label.zip(generated.target()) else { continue };
        let seats = matches!(label.action, Action::SitDown | Action::StandUp);
        assert_eq!(generated.contact().is_none(), seats, "{label}");
        let Some((time_s, place)) = generated.contact() else { continue };
        let off = generated.hand(time_s).distance(place);
        worst = worst.max(off);
        assert!(off < 0.01, "{label} {manner:?} {seed}: the hand is {off} m off at {time_s} s");
        let tag = |t: f64| generated.tag(target, t);
        let apart = |t: f64| generated.hand(t).distance(tag(t));
        match label.action {
            Action::PickUp => assert!(tag(0.0).distance(tag(time_s)) < 1e-4, "{label} {seed}: moved before"),
            Action::PutDown => {
                let left = tag(generated.duration_s()).distance(tag(time_s));
                assert!(left < 0.005, "{label} {manner:?} {seed}: {left} m from where it is left");
            }
            Action::Open | Action::Close => {
                let end = tag(generated.duration_s());
                let all: Vec<f64> = times(&generated, 0.005).filter(|&t| t >= time_s).collect();
                let last = all.iter().position(|&t| tag(t).distance(end) < 2e-3).unwrap();
                let slip = all[..last].iter().map(|&t| (apart(t) - apart(time_s)).abs()).fold(0.0, f32::max);
                assert!(slip < 0.01, "{label} {manner:?} {seed}: the hand leaves the edge by {slip} m");
                slipped = slipped.max(slip);
            }
            _ => {}
        }
    }
    eprintln!("hands at most {:.1} mm off, {:.1} mm along a swing", 1e3 * worst, 1e3 * slipped);
}

#[test]
fn speeds_are_those_of_people() {
    let (mut low, mut high, mut jerky): (f32, f32, f32) = (9.0, 0.0, 0.0);
    let mut durations = Vec::new();
    let step_s = 0.02;
    for (label, manner, seed, generated) in samples(16) {
        let what = format!("{label:?} {manner:?} {seed}");
        let duration_s = generated.duration_s();
        assert!((SHORTEST_S..9.0).contains(&duration_s), "{what}: {duration_s} s");
        let interaction_s = generated.interaction_s();
        assert!(interaction_s.start >= 0.0 && interaction_s.end <= duration_s);
        let hand = |t: f64| generated.hand(t);
        let speed = peak_speed(&generated, hand);
        if label.is_some() {
            assert!((0.3..3.0).contains(&speed), "{what}: {speed} m/s");
            (low, high) = (low.min(speed), high.max(speed));
            durations.push(duration_s);
        }
        for joint in [Side::Left.hand(), Side::Right.hand(), Joint::Head, Joint::HipCentre, Joint::KneeLeft] {
            let at = |t: f64| generated.joints(t)[joint.index()];
            let inner = times(&generated, step_s).filter(|t| (step_s..duration_s - step_s).contains(t));
            let fastest = inner
                .map(|t| (at(t + step_s) - 2.0 * at(t) + at(t - step_s)).length() / (step_s * step_s) as f32)
                .fold(0.0, f32::max);
            assert!(fastest < 50.0, "{what}: {joint:?} accelerates by {fastest} m/s^2");
            jerky = jerky.max(fastest);
        }
        // No jumps: from millisecond to millisecond nothing moves by more than the highest speed allows.
        let mut vertices = [Vec::new(), Vec::new()];
        for t in times(&generated, 0.05) {
            generated.vertices(t, &mut vertices[0]);
            generated.vertices(t + 0.001, &mut vertices[1]);
            let [now, then] = &vertices;
            let jump = now.iter().zip(then).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max);
            assert!(jump < 0.005, "{what}: {jump} m in a millisecond at {t} s");
        }
    }
    eprintln!("hands {low:.2} to {high:.2} m/s at their fastest, accelerations to {jerky:.1} m/s^2");
    durations.sort_by(f64::total_cmp);
    let quantiles = [0, 10, 50, 90, 100].map(|percent| durations[percent * (durations.len() - 1) / 100]);
    eprintln!("labelled samples take {quantiles:.2?} s");
}

#[test]
fn the_same_seed_gives_the_same() {
    for label in labels() {
        for manner in Manner::ALL {
            let [a, b] = [sample(label, manner, 5), sample(label, manner, 5)];
            let other = sample(label, manner, 5 + 12 * 6);
            assert_eq!(a.duration_s().to_bits(), b.duration_s().to_bits());
            let (mut va, mut vb) = (Vec::new(), Vec::new());
            for t in times(&a, 0.37) {
                a.vertices(t, &mut va);
                b.vertices(t, &mut vb);
                assert!(
                    va.iter()
                        .zip(&vb)
                        .all(|(a, b)| a.to_array().map(f32::to_bits) == b.to_array().map(f32::to_bits))
                );
            }
            assert_ne!(a.hand(1.5), other.hand(1.5));
        }
    }
}

/// Time to the peak of the hand's speed, as a share of the time from when it has a tenth of the peak until it has again: a
/// half for symmetric strokes.
fn symmetry(generated: &Generated) -> Option<f64> {
    let window = generated.interaction_s();
    let step_s = 0.01;
    let at = |i: usize| window.start + i as f64 * step_s;
    let count = ((window.end - window.start) / step_s) as usize;
    let speed: Vec<f32> =
        (0..count).map(|i| generated.hand(at(i + 1)).distance(generated.hand(at(i)))).collect();
    let top = (0..count).max_by(|&a, &b| speed[a].total_cmp(&speed[b]))?;
    let slow = |i: &usize| speed[*i] < 0.1 * speed[top];
    let (from, to) = ((0..top).rev().find(slow)?, (top..count).find(slow)?);
    Some((top - from) as f64 / (to - from) as f64)
}

#[test]
fn manners_differ() {
    let mean = |manner: Manner| {
        let label = Some(CATEGORIES[0]);
        let all: Vec<f64> = (0..60).filter_map(|seed| symmetry(&sample(label, manner, seed))).collect();
        all.iter().sum::<f64>() / all.len() as f64
    };
    let [train, _, site] = Manner::ALL.map(mean);
    eprintln!("the fastest moment is after {train:.2} of a stroke, and after {site:.2}");
    // The trunk's part in a reach comes early, so that even symmetric strokes make hands a little faster at first.
    assert!((0.36..0.52).contains(&train) && site < train - 0.05, "{train} {site}");
}

#[test]
fn impossible_briefs_are_refused() {
    let tall = Person { height_m: 2.5, ..person(0) };
    let usual = person(0);
    let label = Some(CATEGORIES[0]);
    let refused = |person: &Person, label: Option<Category>, objects: &[Object]| {
        let brief = Brief {
            person,
            place: place(0),
            radar: RADAR,
            offsets: &[],
            label,
            objects,
            within_reach: &[],
            manner: Manner::MinimumJerk,
            covers_db: 0.0,
            behind_m: None,
            stay: None,
        };
        Generated::new(&brief, &mut ChaCha8Rng::seed_from_u64(0)).unwrap_err()
    };
    assert!(matches!(refused(&tall, label, &[Object::Phone]), BriefError::Size { .. }));
    assert_eq!(refused(&usual, label, &[Object::Pen]), BriefError::NoTarget(CATEGORIES[0]));
    assert_eq!(refused(&usual, None, &[Object::Pen, Object::Pen]), BriefError::Twice(Object::Pen));
    let odd = Category { action: Action::Open, object: Object::Pen };
    assert_eq!(refused(&usual, Some(odd), &[Object::Pen]), BriefError::NoCategory(odd));
}

#[test]
fn asking_is_cheap() {
    let generated = sample(Some(CATEGORIES[0]), Manner::SigmaLognormal, 1);
    let mut vertices = Vec::new();
    let each = |count: u32, ask: &mut dyn FnMut(f64)| {
        let start = std::time::Instant::now();
        (0..count).for_each(|i| ask(f64::from(i) * 3e-4));
        start.elapsed().as_secs_f64() / f64::from(count) * 1e6
    };
    let mesh = each(3000, &mut |t| generated.vertices(t, &mut vertices));
    let tag = each(30_000, &mut |t| assert!(generated.tag(generated.target().unwrap(), t).is_finite()));
    let hand = each(30_000, &mut |t| assert!(generated.hand(t).is_finite()));
    let whole =
        each(20, &mut |t| assert!(sample(None, Manner::MinimumJerk, (t * 1e4) as u64).duration_s() > 1.0));
    eprintln!("vertices {mesh:.1} us, tag {tag:.2} us, hand {hand:.2} us, a sample {:.1} ms", whole / 1e3);
    let [moving, fixed] = [generated.surface(), generated.fixtures().0].map(|s| s.triangles.len());
    eprintln!("{moving} triangles move, {fixed} are fixed");
    // Bounds of a slow machine with others at work.
    assert!(mesh < 200.0 && tag < 10.0 && hand < 10.0);
}
