use std::collections::BTreeSet;

use glam::Quat;
use rfhoi_shared::radar::RadarProfile;

use super::*;
use crate::hoi::{Action, CATEGORIES, Category, Object};
use crate::simulate::Performance;
use crate::simulate::draw::{Draw, Purpose, Wanted, draw, stream};
use crate::simulate::effects::{Domain, Effects};
use crate::simulate::perform::{Generated, in_room};
use crate::simulate::sample::{Maker, Take, epoch, perform};
use crate::simulate::session;

const SEED: u64 = 7;

/// Rooms whose maps are made fast.
fn scenes(names: &[&str]) -> Vec<Scene> {
    let profile = RadarProfile { loops: 16, frame_period_us: 500_000, ..RadarProfile::bridge() };
    names.iter().map(|name| Scene::named(name).unwrap().with_profile(&profile).unwrap()).collect()
}

fn wanted(samples: u32, circumstance: Option<Circumstance>) -> Wanted<'static> {
    Wanted { samples, circumstance, ..Wanted::one(Domain::Site, SEED, &CATEGORIES) }
}

fn acted(draw: &Draw, scenes: &[Scene]) -> Generated {
    perform(Domain::Site, SEED, draw, &scenes[draw.scene]).unwrap().0
}

/// Whether a hand holds the target of this.
fn holds(label: Category) -> bool {
    matches!(label.action, Action::PickUp | Action::PutDown | Action::Open | Action::Close)
}

/// Signal strengths of the target's tag, dBm, at times for which `covered` says so, and at the others.
fn levels(draw: &Draw, scenes: &[Scene], effects: Effects, covered: &Generated) -> [Vec<f64>; 2] {
    let scene = &scenes[draw.scene];
    let (performance, tags) = perform(Domain::Site, SEED, draw, scene).unwrap();
    let take = Take::of(scene, &performance, &tags, effects);
    let target = draw.target.unwrap();
    let (reads, _) = take.reads(&mut stream(Domain::Site, SEED, draw.sample, Purpose::Rfid));
    let mut levels = [Vec::new(), Vec::new()];
    for read in reads.iter().filter(|read| read.epc == tags[target].epc) {
        let time_s = read.time.seconds() - epoch(&effects).seconds();
        let of = usize::from(covered.covered_db(target, time_s) == 0.0);
        levels[of].push(f64::from(read.rssi.0) / 100.0);
    }
    levels
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

#[test]
fn fingers_take_8_3_db_of_the_tag_while_the_hand_holds_it() {
    let scenes = scenes(&["working-space", "storage-room", "kitchen"]);
    let [free, under] = [None, Some(Circumstance::Hand)].map(|c| draw(&wanted(34, c), &scenes));
    // Without slots, powers and noise, reads are the same but for the hand.
    let quiet = Effects { phase_error: false, pi_ambiguity: false, ..Effects::of(Domain::Site) };
    let even = Effects { inventory: false, ..quiet };
    let [mut taken, mut site] = [Vec::new(), Vec::new()];
    let (mut silent, mut heard) = (0, 0);
    for (free, under) in free.iter().zip(&under) {
        let target = free.target.unwrap();
        let covered = acted(under, &scenes);
        let plain = acted(free, &scenes);
        let holds = holds(free.label.unwrap());
        let times: Vec<f64> = (0..90).map(|n| f64::from(n) * 0.1).collect();
        let most = times.iter().map(|&t| covered.covered_db(target, t)).fold(0.0, f32::max);
        assert_eq!(most > 0.0, holds, "{:?}", free.label);
        for &t in &times {
            let db = covered.covered_db(target, t);
            assert!(db == 0.0 || COVERED_DB.contains(&db), "{db} dB");
            assert!((0..6).filter(|tag| *tag != target).all(|tag| covered.covered_db(tag, t) == 0.0));
            assert_eq!(plain.covered_db(target, t), 0.0);
            // What is moved, is held.
            let moves = covered.tag(target, t + 0.01).distance(covered.tag(target, t)) > 1e-3;
            assert!(!moves || db > 0.0 || t > covered.interaction_s().end, "{:?} at {t} s", free.label);
            assert_eq!(covered.tag(target, t), plain.tag(target, t));
        }
        let [with, without] = [under, free].map(|draw| levels(draw, &scenes, even, &covered));
        assert!(with[1] == without[1], "{:?}: while nobody holds it, and before", free.label);
        assert_eq!(with[0].len(), without[0].len());
        if holds {
            taken.push(mean(&without[0]) - mean(&with[0]));
            assert!((taken[taken.len() - 1] - f64::from(most)).abs() < 0.3, "{taken:?}, {most} dB");
            let [with, without] =
                [under, free].map(|d| levels(d, &scenes, Effects::of(Domain::Site), &covered));
            (silent, heard) = (silent + with[0].len(), heard + without[0].len());
            if with[0].len() > 20 {
                site.push(mean(&without[0]) - mean(&with[0]));
            }
        }
    }
    let (taken_db, site_db) = (mean(&taken), mean(&site));
    eprintln!(
        "fingers take {taken_db:.2} dB, of what is still read {site_db:.2} dB; {silent} reads of {heard}"
    );
    assert!((taken_db - BLOCKAGE_DB).abs() < 1.0, "{taken_db} dB");
    assert!((site_db - BLOCKAGE_DB).abs() < 3.0, "{site_db} dB");
    assert!(silent < heard, "a tag with less power falls silent: {silent} of {heard}");
    assert!(taken.iter().any(|db| *db < 7.0) && taken.iter().any(|db| *db > 9.5), "{taken:?}");
}

#[test]
fn several_deeds_are_all_under_the_circumstance() {
    let scenes = scenes(&["kitchen"]);
    let first = draw(&wanted(1, Some(Circumstance::Body)), &scenes).swap_remove(0);
    let then = [Some(CATEGORIES[10]), Some(CATEGORIES[3])];
    let draws = session::draws(first.clone(), &then).unwrap();
    let places: Vec<Vec<_>> = draws
        .iter()
        .map(|d| acted(d, &scenes))
        .map(|g| (0..6).map(|tag| g.tag(tag, -1.0)).collect())
        .collect();
    for tag in (0..6).filter(|tag| draws.iter().all(|draw| draw.target != Some(*tag))) {
        assert!(places.iter().all(|all| all[tag] == places[0][tag]), "{:?} moved", draws[0].objects[tag]);
    }
    let under = |circumstance| {
        let mut first = first.clone();
        first.circumstance = Some(circumstance);
        let draws = session::draws(first, &then).unwrap();
        let scene = &scenes[0];
        let acted: Vec<_> = draws.iter().map(|d| perform(Domain::Site, SEED, d, scene).unwrap()).collect();
        let mut takes = acted.iter().map(|(g, tags)| Take::of(scene, g, tags, Effects::of(Domain::Site)));
        let session = session::Session::new(takes.next().unwrap(), takes);
        let covered = |n: usize| {
            let tag = draws[n].target.unwrap();
            (0..40).any(|t| session.covered_db(tag, session.begins_s()[n] + 0.1 * f64::from(t)) > 0.0)
        };
        let beside: Vec<_> = acted.iter().map(|(generated, _)| generated.beside()).collect();
        ([1, 2].map(covered), beside)
    };
    assert_eq!(under(Circumstance::Hand), ([true; 2], vec![None; 3]));
    let (covered, beside) = under(Circumstance::SecondPerson);
    assert!(beside[0].is_some() && beside.iter().all(|place| *place == beside[0]), "{beside:?}");
    assert_eq!(covered, [false; 2]);
}

#[test]
fn carried_things_that_nothing_is_done_to_lie_behind_the_person() {
    let scenes = scenes(&["working-space", "storage-room", "kitchen"]);
    let [free, under] = [None, Some(Circumstance::Body)].map(|c| draw(&wanted(51, c), &scenes));
    let mut behind = 0;
    for (free, under) in free.iter().zip(&under) {
        assert_eq!((&free.objects, free.label, free.place()), (&under.objects, under.label, under.place()));
        assert!(under.within_reach.iter().all(|object| !object.is_carried()));
        let scene = &scenes[under.scene];
        let pose = in_room(&under.place(), scene.radar.position);
        let turn: Quat = pose.turn.conjugate();
        let range = behind_m(scene, &under.place());
        assert!(BEHIND_M.start == range.start && range.end <= BEHIND_M.end);
        let seated = under.label.is_some_and(|label| label.object == Object::Chair);
        let generated = acted(under, &scenes);
        for (tag, object) in under.performed_objects().into_iter().enumerate() {
            let at = turn * (generated.tag(tag, 0.0) - pose.at);
            // Tags are up to a hand's width off the middle of what they are on.
            let off = 0.1;
            if object.is_carried() && Some(tag) != under.target {
                let chair = if seated { 0.35..0.45 } else { 0.0..1e-6 };
                let (near, far) = (range.start + chair.start - off, range.end + chair.end + off);
                assert!((near..far).contains(&-at.y), "{object}: {at}, {range:?}");
                assert!(at.x.abs() < 0.25 + off && (0.7..1.05).contains(&at.z), "{object}: {at}");
                behind += 1;
            } else if object != Object::Chair {
                assert!(at.y > 0.0, "{object}: {at}");
            }
            let room = &scene.room;
            assert!(room.contains(generated.tag(tag, 0.0)), "{object} of {}", scene.name);
        }
    }
    assert!(behind > 100, "{behind}");
}

#[test]
fn a_second_person_moves_beside_the_first() {
    let scenes = scenes(&["working-space", "storage-room", "kitchen"]);
    let [free, under] = [None, Some(Circumstance::SecondPerson)].map(|c| draw(&wanted(24, c), &scenes));
    let (mut alone, mut both, mut later) = (Vec::new(), Vec::new(), Vec::new());
    let (mut blockers, mut second) = (Vec::new(), Vec::new());
    let mut still_s = 0.0;
    for (free, under) in free.iter().zip(&under) {
        let (one, two) = (acted(free, &scenes), acted(under, &scenes));
        assert_eq!(one.beside(), None);
        let place = two.beside().unwrap();
        let away = place.position.distance(under.place().position);
        assert!((BESIDE_M.start - 1e-4..BESIDE_M.end + 1e-4).contains(&away), "{away} m");
        let scene = &scenes[under.scene];
        assert!(scene.has_room(&place), "{}: {place:?}", scene.name);
        assert_eq!((two.duration_s(), two.tags()), (one.duration_s(), 6));
        let (triangles, reflectivity) = (&two.surface().triangles, &two.surface().reflectivity);
        let own = one.surface().triangles.len();
        assert!(triangles.len() > own + 500 && triangles.len() == reflectivity.len());
        assert_eq!(triangles[..own], one.surface().triangles[..]);
        let mut steady = 0.0;
        for n in 0..(two.duration_s() / 0.05) as u32 {
            let t = f64::from(n) * 0.05;
            one.vertices(t, &mut alone);
            two.vertices(t, &mut both);
            two.vertices(t + 0.001, &mut later);
            assert_eq!(both[..alone.len()], alone[..], "the first does the same");
            assert!(triangles[..own].iter().flatten().all(|v| (*v as usize) < alone.len()));
            let range = alone.len() as u32..both.len() as u32;
            assert!(triangles[own..].iter().flatten().all(|v| range.contains(v)));
            let theirs = &both[alone.len()..];
            assert!(theirs.iter().all(|v| v.is_finite() && v.z > -1e-3));
            let middle = theirs.iter().sum::<glam::Vec3>() / theirs.len() as f32;
            // A step, a chair, or an outstretched arm.
            assert!(middle.truncate().distance(place.position) < 0.6, "{middle} of {place:?}");
            let moved = both.iter().zip(&later).map(|(a, b)| a.distance(*b));
            let moved = moved.skip(alone.len()).fold(0.0, f32::max);
            assert!(moved < 0.005, "{moved} m in a millisecond at {t} s");
            steady = if moved < 1e-5 { steady + 0.05 } else { 0.0 };
            still_s = f64::max(still_s, steady);
            one.blockers(t, &mut blockers);
            two.blockers(t, &mut second);
            assert!(second.len() == 2 * blockers.len() && second[..blockers.len()] == blockers[..]);
            assert!(
                (0..6)
                    .all(|tag| one.tag(tag, t) == two.tag(tag, t) && one.proxy(tag, t) == two.proxy(tag, t))
            );
        }
        two.vertices(-1.0, &mut later);
        two.vertices(0.0, &mut both);
        assert_eq!(later, both, "all is still before the sample");
        let again = acted(under, &scenes);
        again.vertices(1.3, &mut later);
        two.vertices(1.3, &mut both);
        assert_eq!((later, again.beside()), (both.clone(), two.beside()), "the same seed gives the same");
        later = Vec::new();
    }
    assert!(still_s < 1.0, "they stand still for {still_s} s");
    let places: BTreeSet<u32> =
        under.iter().map(|d| acted(d, &scenes).beside().unwrap().position.x.to_bits()).collect();
    assert_eq!(places.len(), under.len());
}

#[test]
fn each_circumstance_changes_its_own_part_and_none_nothing() {
    let scenes = scenes(&["kitchen"]);
    let effects = Effects::of(Domain::Site);
    let make = |circumstance| {
        let draws = draw(&wanted(3, circumstance), &scenes);
        let mut maker = Maker::new(Domain::Site, SEED, effects, &scenes).unwrap();
        draws.iter().map(|draw| maker.make(draw).unwrap()).collect::<Vec<_>>()
    };
    let none = make(None);
    assert!(none == make(None));
    for circumstance in Circumstance::ALL {
        let under = make(Some(circumstance));
        assert!(under == make(Some(circumstance)), "{circumstance:?}");
        for (a, b) in none.iter().zip(&under) {
            let same = (a.frames == b.frames, a.tags_m == b.tags_m, a.duration_s == b.duration_s);
            match circumstance {
                Circumstance::Hand => assert_eq!(same, (true, true, true)),
                Circumstance::SecondPerson => assert_eq!(same, (false, true, true)),
                Circumstance::Body => assert!(!same.1),
            }
            assert_eq!((&a.epcs, &a.channels), (&b.epcs, &b.channels));
            assert_eq!(a.interaction_s == b.interaction_s, circumstance != Circumstance::Body);
        }
        assert!(none.iter().zip(&under).any(|(a, b)| a.reads != b.reads), "{circumstance:?}");
        assert_eq!(serde_json::to_value(circumstance).unwrap(), circumstance.name());
    }
}
