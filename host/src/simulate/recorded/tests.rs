use std::path::PathBuf;

use glam::{Vec2, Vec3};

use super::{Among, Recast, Recorded, RecordedError};
use crate::hoi::{Action, Category, Object};
use crate::motion::{Motion, actions};
use crate::simulate::Performance;
use crate::simulate::body::{Joint, Side};
use crate::simulate::draw::{Wanted, draw};
use crate::simulate::effects::Domain;
use crate::simulate::perform::Generated;
use crate::simulate::sample::perform as generate;
use crate::simulate::scene::{Person, Place, Scene};

#[path = "../../../tests/made_up/kinect.rs"]
mod kinect;

/// The recording of this name in the folder that `RFHOI_CAPTURES` names, by default `../shared/captures` beside the
/// workspace; `None`, and a word about it, without.
fn capture(name: &str) -> Option<PathBuf> {
    let beside = || PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/captures"));
    let path = std::env::var_os("RFHOI_CAPTURES").map_or_else(beside, PathBuf::from).join(name);
    if !path.exists() {
        eprintln!("SKIPPED: {} is not there (set RFHOI_CAPTURES)", path.display());
    }
    path.exists().then_some(path)
}

const PERSON: (f32, f32) = (1.75, 1.0);

fn recast(person: &Person, label: Category) -> Recast<'_> {
    let place = Place { position: Vec2::new(0.3, 2.0), facing_rad: 0.4 };
    Recast { person, place, radar: Vec3::Z, label: Some(label), side: Side::Right }
}

/// Performs the action named `action` of a capture.
fn perform(file: &str, action: &str, label: Category) -> Option<Recorded> {
    let path = capture(&format!("mocap/{file}"))?;
    let (_, motion) = Motion::open(&path).unwrap();
    let (_, all) = actions::beside(&path).unwrap().unwrap();
    let stretch = all.iter().find(|a| a.name == action).unwrap();
    let person = Person { name: "somebody".to_owned(), height_m: PERSON.0, build: PERSON.1, manner: None };
    let recorded = Recorded::new(&motion, stretch.start..=stretch.end, &recast(&person, label));
    Some(recorded.unwrap_or_else(|error| panic!("{file}: {error}")))
}

/// Heights of hips and of the acting hand, and the fastest of the hand, of the head.
struct Figures {
    hips: Vec<f32>,
    hand: Vec<f32>,
    fastest: [f32; 2],
    top: f32,
    /// The fastest elbow or knee.
    bend: f32,
}

fn figures(recorded: &Recorded) -> Figures {
    const STEP_S: f64 = 0.02;
    let times: Vec<f64> =
        (0..=(recorded.duration_s() / STEP_S) as usize).map(|i| i as f64 * STEP_S).collect();
    let height = |joint: Joint| times.iter().map(|&t| recorded.joints(t)[joint.index()].z).collect();
    let speed = |joint: Joint| {
        let at = |t: f64| recorded.joints(t)[joint.index()];
        times.iter().map(|&t| at(t + STEP_S).distance(at(t)) / STEP_S as f32).fold(0.0, f32::max)
    };
    let (mut top, mut vertices): (f32, Vec<Vec3>) = (0.0, Vec::new());
    for &t in &times {
        recorded.vertices(t, &mut vertices);
        assert!(vertices.iter().all(|v| v.is_finite() && v.z > -0.02), "at {t}");
        top = vertices.iter().map(|v| v.z).fold(top, f32::max);
    }
    let fastest = [speed(Joint::HandRight), speed(Joint::Head)];
    let bends = [Joint::ElbowLeft, Joint::ElbowRight, Joint::KneeLeft, Joint::KneeRight];
    let bend = bends.into_iter().map(speed).fold(0.0, f32::max);
    Figures { hips: height(Joint::HipCentre), hand: height(Joint::HandRight), fastest, top, bend }
}

fn plausible(name: &str, recorded: &Recorded) -> Figures {
    let found = figures(recorded);
    eprintln!(
        "{name}: {:.1} s, {:.2} m tall, hand to {:.2} m/s, head to {:.2} m/s",
        recorded.duration_s(),
        found.top,
        found.fastest[0],
        found.fastest[1]
    );
    assert!((0.3..3.0).contains(&found.fastest[0]), "{name}: hand {} m/s", found.fastest[0]);
    assert!(found.fastest[1] < 3.0, "{name}: head {} m/s", found.fastest[1]);
    // Without limits they flip over at 20 m/s.
    assert!(found.bend < 5.0, "{name}: an elbow or knee {} m/s", found.bend);
    // In no recording somebody stands upright all along: they lean a little at least.
    let share = found.top / PERSON.0;
    assert!((0.87..1.03).contains(&share), "{name}: {} m tall", found.top);
    found
}

const SUBJECTS: [&str; 8] =
    ["s01_e01", "s01_e02", "s02_e01", "s02_e02", "s03_e01", "s03_e02", "s04_e01", "s04_e02"];

#[test]
fn people_of_kinect_sit_down_stand_up_and_pick_up() {
    for subject in SUBJECTS {
        let file = format!("utkinect/joints_{subject}.txt");
        let chair = |action| Category { action, object: Object::Chair };
        let Some(sits) = perform(&file, "sit_down", chair(Action::SitDown)) else { return };
        let found = plausible(&format!("{subject} sits down"), &sits);
        let sinks = found.hips[0] - found.hips[found.hips.len() - 1];
        assert!(sinks > 0.15, "{subject}: hips sink by {sinks} m");
        assert_eq!(sits.tag(0, 0.0), sits.tag(0, 1.0));
        let Some(stands) = perform(&file, "stand_up", chair(Action::StandUp)) else { return };
        let found = plausible(&format!("{subject} stands up"), &stands);
        let rises = found.hips[found.hips.len() - 1] - found.hips[0];
        assert!(rises > 0.1, "{subject}: hips rise by {rises} m");
        let bottle = Category { action: Action::PickUp, object: Object::Bottle };
        let Some(picks) = perform(&file, "pick_up", bottle) else { return };
        plausible(&format!("{subject} picks up"), &picks);
        let contact_s = picks.contact_s().unwrap();
        assert!(picks.tag(0, contact_s).distance(picks.tag(0, 0.0)) < 1e-4);
        assert!(picks.tag(0, picks.duration_s()).distance(picks.tag(0, 0.0)) > 0.1);
    }
}

#[test]
fn people_of_hdm05_put_down_on_the_floor() {
    for cut in ["bd_depositFloorR_001", "bk_depositFloorR_009", "dg_depositFloorR_013"] {
        let bottle = Category { action: Action::PutDown, object: Object::Bottle };
        let Some(puts) = perform(&format!("hdm05/HDM_{cut}_120.amc"), "put_down", bottle) else { return };
        let found = plausible(cut, &puts);
        let lowest = found.hand.iter().copied().fold(9.0, f32::min);
        assert!(lowest < 0.35, "{cut}: the hand comes down to {lowest} m");
        let (from, to) = (puts.tag(0, 0.0), puts.tag(0, puts.duration_s()));
        assert!(from.z > to.z + 0.3 && to.z < 0.35, "{cut}: from {from} to {to}");
        let hips = puts.joints(0.0)[Joint::HipCentre.index()];
        assert!((hips.truncate() - Vec2::new(0.3, 2.0)).length() < 1e-3, "they begin at their place: {hips}");
    }
}

#[test]
fn what_is_missing_is_named() {
    let row = |frame: u32| format!("{frame}{}\n", " 0 1 2".repeat(20));
    let text: String = [0, 2, 4, 6, 8, 10, 40, 42].map(row).concat();
    let motion = crate::motion::joint_list::parse(&text).unwrap();
    let person = Person { name: "somebody".to_owned(), height_m: PERSON.0, build: PERSON.1, manner: None };
    let label = Category { action: Action::PickUp, object: Object::Pen };
    let fault = |frames| Recorded::new(&motion, frames, &recast(&person, label)).unwrap_err();
    assert!(matches!(fault(0..=4), RecordedError::TooFew { found: 3, .. }));
    assert!(matches!(fault(0..=42), RecordedError::Gap { after: 10, .. }));
    assert_eq!(fault(0..=10), RecordedError::NoSize);
    let bvh = "HIERARCHY\nROOT Hips\n{\n OFFSET 0 0 0\n CHANNELS 3 Zrotation Xrotation Yrotation\n JOINT Head\n {\n \
               OFFSET 0 1.7 0\n CHANNELS 0\n }\n}\nMOTION\nFrames: 1\nFrame Time: 0.1\n0 0 0\n";
    let motion = crate::motion::bvh::parse(bvh).unwrap();
    let fault = Recorded::new(&motion, 1..=1, &recast(&person, label)).unwrap_err();
    assert!(matches!(fault, RecordedError::NoJoint { joint: Joint::ShoulderLeft, .. }), "{fault}");
}

#[test]
fn the_hand_that_touches_is_the_one_that_hdm05_names() {
    // Frames in which the right hand is lowest, by the captures' table.
    for (cut, lowest) in [
        ("bd_depositFloorR_001", 163),
        ("bd_depositFloorR_005", 138),
        ("bk_depositFloorR_011", 143),
        ("dg_depositFloorR_013", 142),
        ("dg_depositFloorR_015", 156),
    ] {
        let bottle = Category { action: Action::PutDown, object: Object::Bottle };
        let Some(puts) = perform(&format!("hdm05/HDM_{cut}_120.amc"), "put_down", bottle) else { return };
        let (side, touched_s) = puts.touch();
        let wanted_s = f64::from(lowest - 1) / 120.0;
        assert!(side == Side::Right && (touched_s - wanted_s).abs() < 0.25, "{cut}: {side:?}, {touched_s} s");
    }
}

/// A made-up motion in the place of a generated one, with the generated one.
fn among(frames: std::ops::RangeInclusive<u32>, label: Category) -> (Among, Generated, usize) {
    let motion = crate::motion::joint_list::parse(&kinect::lines()).unwrap();
    let scenes = [Scene::named("working-space").unwrap()];
    let draw = draw(&Wanted::one(Domain::Site, 4, &[label]), &scenes).swap_remove(0);
    let (generated, _) = generate(Domain::Site, 4, &draw, &scenes[0]).unwrap();
    let among = Among::new(&motion, frames, (&scenes[0], &draw), &generated).unwrap();
    assert_eq!(among.tags(), generated.tags());
    (among, generated, draw.target.unwrap())
}

#[test]
fn who_sits_down_among_tags_sits_on_the_generated_chair() {
    let label = Category { action: Action::SitDown, object: Object::Chair };
    let (among, generated, _) = among(kinect::SITS, label);
    for tag in 0..among.tags() {
        assert_eq!(among.tag(tag, 1.0), generated.tag(tag, 0.0));
    }
    let hips = |joints: crate::simulate::body::Joints| joints[Joint::HipCentre.index()].truncate();
    let (to, there) =
        (hips(among.joints(among.duration_s())), hips(generated.joints(generated.duration_s())));
    assert!(to.distance(there) < 0.02, "{to} and {there}");
    let right = |joints: crate::simulate::body::Joints| {
        (joints[Joint::HipRight.index()] - joints[Joint::HipLeft.index()]).truncate().normalize()
    };
    let turned = right(among.joints(among.duration_s())).dot(right(generated.joints(generated.duration_s())));
    assert!(turned > 0.99, "{turned}");
    // As long at rest before and after as the generated one.
    let (acts, of_generated) = (among.interaction_s(), generated.interaction_s());
    assert_eq!(acts.start, of_generated.start);
    assert!((acts.end - acts.start - 2.0).abs() < 1e-6, "{acts:?}");
    assert_eq!(among.joints(0.0), among.joints(acts.start));
}

#[test]
fn what_is_picked_up_among_tags_goes_with_the_recorded_hand() {
    let label = Category { action: Action::PickUp, object: Object::Bottle };
    let (among, generated, target) = among(kinect::PICKS, label);
    assert_eq!(among.side(), Side::Right);
    for tag in (0..among.tags()).filter(|tag| *tag != target) {
        assert_eq!(among.tag(tag, among.duration_s()), generated.tag(tag, 0.0));
    }
    let [lies, held] = [0.0, among.duration_s()].map(|time_s| among.tag(target, time_s));
    assert!(lies.z < 0.6 && held.z > lies.z + 0.2, "from {lies} to {held}");
    assert!(generated.tag(target, 0.0).z > 0.7, "on a table");
}
