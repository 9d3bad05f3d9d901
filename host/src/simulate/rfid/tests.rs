//! Physics with bounds, on simulated reads.

use std::f64::consts::{PI, TAU};

use glam::Vec3;
use num_complex::Complex;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rfhoi_shared::radar::RadarProfile;
use rfhoi_shared::tag::{Epc, TagRead};
use rfhoi_shared::units::{BridgeTime, ChannelIndex, PhaseCode, SPEED_OF_LIGHT};
use rfhoi_shared::wire::HopTable;

use super::gen2::{AirMode, QAlgorithm};
use super::link::{BLOCKAGE_DB, Link, Surroundings};
use super::measurement::{SLOW_DBM, SLOW_FLIPS};
use super::*;
use crate::hoi::Object;
use crate::phase::circular::{Resultant, wrap};
use crate::phase::{ChannelPlan, Settings, analyse};
use crate::simulate::effects::{Domain, Effects};
use crate::simulate::scene::{RadarPose, Reader, ReaderAntenna, Room, Scene, Stated, Tag};
use crate::simulate::{Capsule, Performance, Surface};

/// Half a 12-bit code each for two phases, and a little for `f32` positions.
const CODE: f64 = TAU / 4096.0 + 1e-4;

fn scene(antennas: usize) -> Scene {
    let antenna = |n: usize| ReaderAntenna { position: Vec3::new(0.2 * n as f32, 0.1, 1.0), facing: Vec3::Y };
    Scene {
        name: "test".into(),
        stated: Stated::default(),
        room: Room { min: Vec3::new(-3.0, 0.0, 0.0), max: Vec3::new(3.0, 5.0, 2.6), reflectivity: 0.2 },
        furniture: Vec::new(),
        radar: RadarPose {
            position: Vec3::new(0.0, 0.1, 1.0),
            yaw_rad: 0.0,
            pitch_rad: 0.0,
            depth_m: 3.05,
            profile: RadarProfile::bridge(),
        },
        reader: Reader { antennas: (0..antennas).map(antenna).collect(), power_dbm: 30.0 },
        tags: Vec::new(),
        people: Vec::new(),
        places: Vec::new(),
    }
}

fn tags(count: usize) -> Vec<Tag> {
    let epc = |n: usize| Epc::new(&[0xe2, 0x80, 0, 0, 0, 0, 0, 0, 0, 0, 0, n as u8]).unwrap();
    (0..count).map(|n| Tag { epc: epc(n), object: Object::Cup, offset: Vec3::ZERO }).collect()
}

/// Nobody moves; these stand in the way.
pub(crate) struct Still(pub(crate) Vec<Capsule>);

impl Performance for Still {
    fn duration_s(&self) -> f64 {
        4.0
    }
    fn surface(&self) -> &Surface {
        unreachable!("the reader sees no surfaces")
    }
    fn vertices(&self, _: f64, _: &mut Vec<Vec3>) {}
    fn tags(&self) -> usize {
        0
    }
    fn tag(&self, _: usize, _: f64) -> Vec3 {
        Vec3::ZERO
    }
    fn blockers(&self, _: f64, blockers: &mut Vec<Capsule>) {
        blockers.clone_from(&self.0);
    }
}

struct Run {
    antennas: usize,
    tags: usize,
    effects: Effects,
    from_s: f64,
    until_s: f64,
    seed: u64,
}

impl Run {
    fn of(antennas: usize, tags: usize, effects: Effects) -> Self {
        Self { antennas, tags, effects, from_s: 0.0, until_s: 4.0, seed: 1 }
    }

    fn reads(&self, position: impl Fn(usize, f64) -> Vec3) -> (Vec<TagRead>, ReaderSession) {
        let (scene, tags) = (scene(self.antennas), tags(self.tags));
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        let session = ReaderSession::draw(self.antennas, self.tags, &self.effects, &mut rng);
        let situation = Situation {
            scene: &scene,
            performance: &Still(Vec::new()),
            position: &position,
            tags: &tags,
            effects: self.effects,
        };
        let epoch = BridgeTime(20_000_000);
        let options = Options::between(self.from_s, self.until_s, epoch);
        (simulate(situation, &session, options, &mut rng), session)
    }
}

fn ahead(metres: f64) -> Vec3 {
    Vec3::new(0.0, 0.1 + metres as f32, 1.0)
}

fn radians(read: &TagRead) -> f64 {
    f64::from(read.phase.unwrap().radians())
}

#[test]
fn moving_a_tag_turns_the_phase_by_4_pi_d_over_lambda_on_each_of_50_channels() {
    let effects = Effects { hopping: true, inventory: true, ..Effects::NONE };
    let run = Run { until_s: 11.0, ..Run::of(1, 1, effects) };
    let ((near, session), (far, _)) = (run.reads(|_, _| ahead(1.5)), run.reads(|_, _| ahead(1.6)));
    let moved = f64::from(ahead(1.6).y - ahead(1.5).y);
    let mut seen = [0; 50];
    assert_eq!(near.len(), far.len());
    for (near, far) in near.iter().zip(&far) {
        let channel = usize::from(near.channel.0) - 1;
        let turn = 4.0 * PI * moved * session.hertz(channel) / SPEED_OF_LIGHT;
        assert!(wrap(radians(far) - radians(near) - turn).abs() < CODE, "{near:?} {far:?}");
        seen[channel] += 1;
    }
    assert!(seen.iter().all(|&reads| reads >= 8), "{seen:?}");
    let mut sorted = session.channels.clone();
    sorted.sort();
    assert!(session.channels != sorted, "in an order of its own");
    assert_eq!((sorted[0].0, sorted[49].0), (902_750, 927_250));
}

#[test]
fn a_hop_shifts_phases_and_leaves_differences_within_a_channel() {
    let effects = Effects { hopping: true, inventory: true, ..Effects::NONE };
    let (reads, session) =
        Run { until_s: 11.0, ..Run::of(1, 2, effects) }.reads(|n, _| ahead(1.0 + n as f64));
    let mut by_channel = std::collections::BTreeMap::<_, [Resultant; 2]>::new();
    for read in &reads {
        let tag = usize::from(*read.epc.bytes().last().unwrap());
        by_channel.entry(read.channel).or_default()[tag].add(radians(read));
    }
    assert_eq!(by_channel.len(), 50);
    let means: Vec<_> = by_channel.values().map(|[tag, _]| tag.mean().unwrap()).collect();
    assert!(by_channel.values().flatten().all(|tag| tag.standard_deviation().unwrap() < 1e-5));
    // Evenly spread offsets: the mean resultant length of 50 is below 0.3 in 99 of 100 sessions.
    let mut spread = Resultant::default();
    means.iter().for_each(|&mean| spread.add(mean));
    assert!(spread.mean_length().unwrap() < 0.3);
    // Two tags share the reader's part and differ by their own.
    let own = |tag: usize, channel| session.offset(channel, 0, tag) - session.offset(channel, 0, 0);
    assert!((0..50).any(|channel| (own(1, channel) - own(1, 0)).abs() > 0.01));
    assert!((0..50).all(|channel| (own(1, channel) - own(1, 0)).abs() < 3.0));
}

#[test]
fn equal_paths_add_up_as_waves() {
    let link = |turn: f64| Link::new(Complex::new(1e-2, 0.0) * (1.0 + Complex::cis(turn)), 30.0, 0.0);
    let alone = Link::new(Complex::new(1e-2, 0.0), 30.0, 0.0);
    let gains = |turn| (link(turn).tag_dbm - alone.tag_dbm, link(turn).rssi_dbm - alone.rssi_dbm);
    let close = |(a, b): (f64, f64), (c, d): (f64, f64)| (a - c).abs() < 0.01 && (b - d).abs() < 0.01;
    assert!(close(gains(0.0), (6.02, 12.04)), "in phase: {:?}", gains(0.0));
    assert!(close(gains(PI / 2.0), (3.01, 6.02)), "a quarter turn: {:?}", gains(PI / 2.0));
    assert!(close(gains(TAU / 3.0), (0.0, 0.0)), "a third: {:?}", gains(TAU / 3.0));
    assert!(gains(PI).1 < -200.0, "opposite: {:?}", gains(PI));
    // Half the angle between them, there and back.
    assert!((wrap(link(1.0).phase + 1.0)).abs() < 1e-12);
}

#[test]
fn walls_are_mirrors() {
    let scene = scene(1);
    let (antenna, tag, hertz) = (scene.reader.antennas[0], Vec3::new(0.7, 2.0, 0.8), 915e6);
    let effects = Effects { tag_multipath: true, ..Effects::NONE };
    let direct = Surroundings::new(&scene.room, &[], &Effects::NONE);
    let all = Surroundings::new(&scene.room, &[], &effects).one_way(&antenna, tag, hertz);
    let Room { min, max, .. } = scene.room;
    let images = [
        Vec3::new(2.0 * min.x - tag.x, tag.y, tag.z),
        Vec3::new(2.0 * max.x - tag.x, tag.y, tag.z),
        Vec3::new(tag.x, 2.0 * min.y - tag.y, tag.z),
        Vec3::new(tag.x, 2.0 * max.y - tag.y, tag.z),
        Vec3::new(tag.x, tag.y, 2.0 * min.z - tag.z),
        Vec3::new(tag.x, tag.y, 2.0 * max.z - tag.z),
    ];
    let expected = images.iter().fold(direct.one_way(&antenna, tag, hertz), |sum, &image| {
        sum - 0.4 * direct.one_way(&antenna, image, hertz)
    });
    assert!((all - expected).norm() < 1e-6 * all.norm());
    // One direct path is Friis': 30 + 2 (9 - 3 + 2 - 31.67) - 6 at 1 m and 915 MHz.
    let link = Link::new(direct.one_way(&antenna, ahead(1.0), hertz), 30.0, 0.0);
    assert!((link.rssi_dbm + 23.35).abs() < 0.02, "{link:?}");
    assert!((link.tag_dbm - 6.33).abs() < 0.01, "{link:?}");
}

#[test]
fn strength_falls_with_the_fourth_power_of_distance() {
    let strength = |metres| {
        let (reads, _) =
            Run::of(1, 1, Effects { inventory: true, ..Effects::NONE }).reads(|_, _| ahead(metres));
        assert!(reads.iter().all(|read| read.rssi == reads[0].rssi && read.rssi.0 % 50 == 0));
        reads[0].rssi.dbm()
    };
    let levels = [0.5, 1.0, 2.0, 4.0].map(strength);
    // 12.04 dB for each doubling, in steps of 0.5 dB.
    assert!(levels.windows(2).all(|pair| (pair[0] - pair[1] - 12.04).abs() <= 0.5), "{levels:?}");
}

#[test]
fn a_hand_on_the_way_takes_8_3_db_and_less_as_it_leaves() {
    let scene = scene(1);
    let effects = Effects { blockage: true, tag_multipath: true, ..Effects::NONE };
    let tag = ahead(2.0);
    let rssi = |hand: Vec3, effects: &Effects| {
        let blockers = [Capsule { ends: [hand, hand + Vec3::X * 0.01], radius: 0.05 }];
        let around = Surroundings::new(&scene.room, &blockers, effects);
        Link::new(around.one_way(&scene.reader.antennas[0], tag, 915e6), 30.0, 5.0).rssi_dbm
    };
    let one_path = Effects { tag_multipath: false, ..effects };
    let open = rssi(tag + Vec3::Z, &one_path);
    assert!((rssi(tag, &Effects::NONE) - open).abs() < 1e-9, "switched off");
    assert!((open - rssi(tag, &one_path) - BLOCKAGE_DB).abs() < 1e-3);
    // A hand around the tag weakens each path.
    assert!((rssi(tag + Vec3::Z, &effects) - rssi(tag, &effects) - BLOCKAGE_DB).abs() < 1e-3);
    // Up and away, 4 cm before the tag: no step is larger than a twentieth of the whole.
    let losses: Vec<_> =
        (0..300).map(|mm| open - rssi(tag + Vec3::new(0.0, -0.04, 1e-3 * mm as f32), &one_path)).collect();
    assert!(losses[0] > 6.0 && losses[299] == 0.0, "{} to {}", losses[0], losses[299]);
    for pair in losses.windows(2) {
        assert!(pair[0] >= pair[1] - 1e-4 && pair[0] - pair[1] < BLOCKAGE_DB / 20.0, "{pair:?}");
    }
    // Two hands are not two blockages.
    let both = [Capsule { ends: [tag; 2], radius: 0.05 }; 2];
    let around = Surroundings::new(&scene.room, &both, &one_path);
    let twice = Link::new(around.one_way(&scene.reader.antennas[0], tag, 915e6), 30.0, 5.0).rssi_dbm;
    assert!((open - twice - BLOCKAGE_DB).abs() < 1e-3);
}

#[test]
fn each_tag_is_read_less_often_among_more_tags_and_by_more_antennas() {
    let effects = Effects { inventory: true, ..Effects::NONE };
    let rate = |antennas, count: usize| {
        let (reads, _) = Run::of(antennas, count, effects).reads(|_, _| ahead(1.0));
        let read = |n: usize, port| {
            reads.iter().filter(|r| r.epc == tags(n + 1)[n].epc && r.antenna.0 == port).count()
        };
        assert!((0..count).all(|n| (1..=antennas as u16).all(|port| read(n, port) > 0)));
        read(0, 1) as f64 / 4.0
    };
    let falling = |setups: [(usize, usize); 3]| {
        let rates = setups.map(|(antennas, count)| rate(antennas, count));
        assert!(rates.windows(2).all(|pair| pair[0] > 1.15 * pair[1]), "{setups:?}: {rates:?}");
        rates
    };
    let [alone, ..] = falling([(1, 1), (1, 6), (1, 20)]);
    falling([(1, 6), (2, 6), (4, 6)]);
    // A round each 14.03 ms, of which 8 % are missed.
    assert!((alone - 0.92 / 0.014_03).abs() < 3.0, "{alone}");
}

#[test]
fn slots_collide_and_q_follows_the_number_of_tags() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let mode = AirMode::MAX_THROUGHPUT;
    for count in [1_usize, 6, 30, 200] {
        let answers: Vec<_> = (0..count).map(|tag| (12, tag)).collect();
        let mut q = QAlgorithm::new(1);
        let mut all = gen2::Slots::default();
        for _ in 0..50 {
            let mut seen = Vec::new();
            let (length, slots) = q.round(&mode, &answers, &mut rng, |tag, at| seen.push((at, tag)));
            assert!(seen.is_sorted_by(|a, b| a.0 < b.0) && seen.last().unwrap().0 < length);
            seen.sort_by_key(|&(_, tag)| tag);
            assert!(seen.iter().map(|&(_, tag)| tag).eq(0..count), "each once");
            let quickest = count as f64 * (mode.identified_s(12) + mode.next_s());
            assert!(length >= quickest && length < 3.0 * quickest + 0.002, "{count}: {length}");
            all.add(slots);
        }
        assert_eq!(all.single, 50 * count as u64);
        assert_eq!(all.collided > 0, count > 1, "{all:?}");
        // Slotted ALOHA at its best identifies a tag in each e-th slot; half as often is still fair.
        let efficiency = all.single as f64 / (all.single + all.empty + all.collided) as f64;
        assert!(efficiency > 0.18, "{count}: {efficiency}");
    }
    assert!((mode.query_s() + mode.identified_s(12) + mode.next_s() - 0.000_79).abs() < 1e-5);
}

#[test]
fn the_phase_pipeline_finds_a_movement_again() {
    let effects = Effects { hopping: true, inventory: true, phase_error: true, ..Effects::NONE };
    // 0.3 m away from the antenna within 1.5 s, with a largest speed of 0.31 m/s.
    let metres = |t: f64| 1.2 + 0.15 * (1.0 - (PI * (t / 1.5).clamp(0.0, 1.0)).cos());
    let run = Run { from_s: -10.5, until_s: 2.0, ..Run::of(1, 2, effects) };
    let (reads, session) = run.reads(|n, t| if n == 0 { ahead(metres(t)) } else { ahead(1.7) });
    let table = HopTable { table: 1, channels: session.channels.iter().copied().collect() };
    let settings = Settings { channels: ChannelPlan::from(&table), ..Settings::default() };
    let (samples, report) = analyse(&reads, settings.clone());
    assert_eq!(report.calibrated_groups, 100);
    for (n, tag) in tags(2).iter().enumerate() {
        let mut found = 0.0;
        let (mut steps, mut lost) = (0, 0);
        for sample in samples.iter().filter(|s| s.key.epc == tag.epc && s.time.0 > 20_000_000) {
            let wavelength =
                f64::from(settings.channels.frequency(sample.key.channel).unwrap().wavelength().0);
            match sample.step.unwrap().turned {
                Ok(turned) => (found, steps) = (found + turned * wavelength / (4.0 * PI), steps + 1),
                Err(_) => lost += 1,
            }
        }
        let moved = if n == 0 { 0.3 } else { 0.0 };
        assert!(steps > 90 && lost <= 2, "{steps} steps, {lost} lost");
        assert!((found - moved).abs() < 0.015, "{found} m of {moved} m");
    }
}

#[test]
fn the_same_seed_gives_the_same_reads() {
    let site = Run { from_s: -1.0, ..Run::of(4, 6, Effects::of(Domain::Site)) };
    let place = |n: usize, t: f64| Vec3::new(0.3 * n as f32, 2.0 + 0.1 * t as f32, 0.8);
    let (first, session) = site.reads(place);
    assert_eq!((first.clone(), session), site.reads(place));
    assert_ne!(first, Run { seed: 2, ..site }.reads(place).0);
    assert!(first.is_sorted_by_key(|read| read.time));
    let times = first.iter().map(|read| read.time.0);
    assert!(times.clone().min().unwrap() < 19_100_000 && times.max().unwrap() < 24_000_000);
}

#[test]
fn weak_tags_flip_by_half_a_turn_where_that_is_on_and_weaker_ones_are_silent() {
    let scene = scene(1);
    let tag = tags(1);
    for (loss_db, flips) in [(16.0, false), (26.1, true), (40.0, false)] {
        let effects = Effects { inventory: true, phase_error: true, pi_ambiguity: true, ..Effects::NONE };
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut session = ReaderSession::draw(1, 1, &effects, &mut rng);
        session.tags[0].loss_db = loss_db;
        session.tags[0].sensitivity_dbm = -22.0;
        let position = |_, _| ahead(1.0);
        let situation = Situation {
            scene: &scene,
            performance: &Still(Vec::new()),
            position: &position,
            tags: &tag,
            effects,
        };
        let options = Options::between(0.0, 30.0, BridgeTime(0));
        let reads = simulate(situation, &session, options, &mut rng);
        if loss_db == 40.0 {
            assert!(reads.is_empty());
            continue;
        }
        let weak = reads.iter().filter(|read| f64::from(read.rssi.dbm()) < SLOW_DBM).count();
        assert_eq!(flips, weak * 2 > reads.len(), "{weak} of {}", reads.len());
        let (_, report) = analyse(&reads, Settings::default());
        let share = report.pi_ambiguous.values().next().copied();
        assert_eq!(share.is_some(), flips);
        assert!(share.is_none_or(|share| (share - SLOW_FLIPS).abs() < 0.04), "{share:?}");
    }
}

#[test]
fn the_papers_recipe_is_one_channel_with_even_reads_and_loss() {
    let (reads, session) = Run::of(4, 6, Effects::of(Domain::Train)).reads(|_, _| ahead(1.0));
    assert!(reads.iter().all(|read| read.channel == ChannelIndex(26)), "in the middle");
    assert_eq!(session.channels[25].0, 915_250);
    let expected = 4.0 * 25.0 * 24.0 * 0.8;
    assert!((reads.len() as f64 - expected).abs() < 4.0 * (expected * 0.2).sqrt(), "{}", reads.len());
    assert!((0..4).all(|antenna| (0..6).all(|tag| session.offset(25, antenna, tag) == 0.0)));
    // Each slot of time belongs to one tag and antenna: multiples of 1 / 600 s.
    assert!(reads.iter().all(|read| ((read.time.0 - 20_000_000) * 600).is_multiple_of(100)));
}

#[test]
fn codes_are_true_to_half_a_step() {
    let (reads, session) =
        Run::of(1, 1, Effects { inventory: true, ..Effects::NONE }).reads(|_, _| ahead(1.234));
    let turns = 2.0 * f64::from(ahead(1.234).y - 0.1) * session.hertz(25) / SPEED_OF_LIGHT;
    let expected = (turns.rem_euclid(1.0) * 4096.0).round() as i32;
    let close = |code: PhaseCode| (i32::from(code.0) - expected).rem_euclid(4096) % 4095 <= 1;
    assert!(
        !reads.is_empty() && reads.iter().all(|read| close(read.phase.unwrap())),
        "{expected} {:?}",
        reads[0]
    );
    let (noisy, _) = Run::of(1, 1, Effects { inventory: true, phase_error: true, ..Effects::NONE })
        .reads(|_, _| ahead(1.234));
    assert!(noisy.iter().all(|read| read.phase.unwrap().0.is_multiple_of(4)));
}

#[test]
fn nothing_is_read_before_the_bridge_started() {
    let (reads, _) = Run { from_s: -60.0, until_s: -15.0, ..Run::of(1, 1, Effects::of(Domain::Site)) }
        .reads(|_, _| ahead(1.0));
    assert!(reads[0].time.0 < 50_000 && reads.len() > 100);
}
