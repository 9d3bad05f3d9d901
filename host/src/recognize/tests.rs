use std::cell::RefCell;
use std::num::NonZeroUsize;
use std::ops::Range;
use std::rc::Rc;

use rfhoi_firmware::dsp::level::SCALE;
use rfhoi_firmware::uplink::{MapPacker, Uplink};
use rfhoi_network::config::NetworkConfig;
use rfhoi_network::execute::quantize;
use rfhoi_network::model::{Description, Model};
use rfhoi_network::names::Names;
use rfhoi_network::sample::{Answer, Frame, Frames, InputError, READ_CHANNELS, Runner, SCALARS, Sample};
use rfhoi_shared::radar::RadarProfile;
use rfhoi_shared::tag::{Epc, TagRead};
use rfhoi_shared::units::{AntennaPort, BridgeTime, CentiDbm, ChannelIndex, PhaseCode};
use rfhoi_shared::wire::{Covariance, FrameInfo, HopTable, MapKind, Message};
use serde_json::json;

use super::tags::TagNames;
use super::*;

const PERIOD_US: u64 = 100_000;
const GATE: rfhoi_shared::radar::RangeGate = rfhoi_shared::radar::RangeGate { first: 0, bins: 72 };

fn names() -> Names {
    model::names().unwrap()
}

fn description() -> Description {
    let profile = RadarProfile::bridge();
    let maps = json!({
        "profile_fingerprint": profile.fingerprint(), "frame_period_us": profile.frame_period_us, "first_range_bin": 0,
        "range_bins": 72, "range_bin_m": profile.range_bin().0, "doppler_bins": 64,
        "velocity_bin_m_s": profile.velocity_bin().0, "range_time_columns": 8, "virtual_antennas": 12,
        "floor_db": SCALE.floor_db, "step_db": SCALE.step_db,
    });
    let names = names();
    let config = NetworkConfig::small(names.dimensions());
    let mut description = Description::new(config, maps, "bartlett".to_owned(), names.fingerprint());
    description.actions = crate::hoi::Action::ALL.iter().map(|action| action.name().to_owned()).collect();
    description.least_probability = 0.5;
    description
}

/// What a network was asked.
#[derive(Debug, Default)]
struct Asked {
    frames: usize,
    clears: usize,
    /// Tags of the last frame.
    tags: usize,
    answers: Vec<Range<usize>>,
}

/// A network that is always sure: "open", of the last tag.
struct Sure {
    asked: Rc<RefCell<Asked>>,
    kept: usize,
    tags: Option<usize>,
    p: f32,
}

impl Runner for Sure {
    fn push(&mut self, frame: Frame<'_>) -> Result<(), InputError> {
        let tags = frame.reads.len() / (4 * READ_CHANNELS);
        assert_eq!(*self.tags.get_or_insert(tags), tags, "the number of tags stays");
        assert_eq!(frame.maps.len(), 3 * 32 * 32);
        assert!(frame.scalars.iter().chain(frame.reads).all(|value| value.is_finite()));
        self.kept += 1;
        let mut asked = self.asked.borrow_mut();
        asked.frames += 1;
        asked.tags = tags;
        Ok(())
    }

    fn answer(&mut self, frames: Range<usize>, names: &[f32]) -> Result<Answer, InputError> {
        assert!(!frames.is_empty() && frames.end <= self.kept, "{frames:?} of {}", self.kept);
        let tags = self.tags.unwrap();
        assert_eq!(names.len(), tags * super::tests::names().dimensions());
        self.asked.borrow_mut().answers.push(frames);
        let mut actions = vec![(1.0 - self.p) / 7.0; 8];
        actions[2] = self.p;
        let mut targets = vec![0.0; tags];
        targets[tags - 1] = 1.0;
        Ok(Answer { actions, targets })
    }

    fn clear(&mut self) {
        (self.kept, self.tags) = (0, None);
        self.asked.borrow_mut().clears += 1;
    }
}

/// Two devices and a bridge.
struct Room {
    uplink: Uplink,
    profile: u32,
    packets: Vec<Vec<u8>>,
    frame: u32,
    /// Numbers of the tags that are read, and the antennas that read.
    tags: Range<u8>,
    antennas: Range<u16>,
    radar: bool,
    /// Codes of the strongest cell and the others.
    codes: [u8; 2],
    covariance: f32,
}

impl Room {
    fn new() -> Self {
        let mut room = Self {
            uplink: Uplink::new(1),
            profile: RadarProfile::bridge().fingerprint(),
            packets: Vec::new(),
            frame: 0,
            tags: 1..5,
            antennas: 1..5,
            radar: true,
            codes: [200, 40],
            covariance: 1e-6,
        };
        let table =
            HopTable { table: 1, channels: [rfhoi_shared::units::Kilohertz(920_000)].into_iter().collect() };
        room.send(BridgeTime(0), Message::HopTable(table));
        room
    }

    fn send(&mut self, now: BridgeTime, message: Message<'_>) {
        let packets = &mut self.packets;
        self.uplink.send(now, message, |_, packet| {
            packets.push(packet.to_vec());
            true
        });
    }

    /// Frames in which so many cells move, and the first tag that is read turns so far in each, in codes.
    fn frames(mut self, count: usize, cells: u32, turn: u32) -> Self {
        for _ in 0..count {
            let begin = BridgeTime(1_000_000 + u64::from(self.frame) * PERIOD_US);
            for (slot, tag) in self.tags.clone().enumerate() {
                for antenna in self.antennas.clone() {
                    let after_us = 4_000 + 20_000 * u64::from(antenna) + 100 * slot as u64;
                    let phase = if slot == 0 { self.frame * turn % 4096 } else { 0 };
                    let read = TagRead {
                        time: begin.after(after_us),
                        epc: epc(tag),
                        antenna: AntennaPort(antenna),
                        channel: ChannelIndex(1),
                        phase: Some(PhaseCode(phase as u16)),
                        rssi: CentiDbm(-5_000),
                        doppler: None,
                    };
                    self.send(read.time.after(2_000), Message::Tags([read].into_iter().collect()));
                }
            }
            if self.radar {
                self.radar(begin, cells);
            }
            self.frame += 1;
        }
        self
    }

    fn radar(&mut self, begin: BridgeTime, cells: u32) {
        let frame = self.frame;
        let [peak, floor] = self.codes;
        for (kind, columns) in [(MapKind::RangeDoppler, 64), (MapKind::RangeTime, 8_u16)] {
            let mut packer = MapPacker::new(kind);
            packer.begin(frame, GATE, columns, SCALE);
            let Self { uplink, packets, .. } = self;
            let mut emit = |message: Message<'_>| {
                uplink.send(begin, message, |_, packet| {
                    packets.push(packet.to_vec());
                    true
                });
            };
            for bin in 0..GATE.bins {
                let code = |column: u16| {
                    let near = bin.abs_diff(30) <= 2 && column.abs_diff(columns * 3 / 4) <= 2;
                    if near {
                        peak
                    } else {
                        floor.saturating_add(((bin * 7 + column * 3) % 5) as u8).min(peak.max(floor))
                    }
                };
                packer.row((0..columns).map(code), &mut emit);
            }
            packer.flush(&mut emit);
        }
        let diagonal = |i: usize| {
            if [0, 23, 44, 63, 80, 95, 108, 119, 128, 135, 140, 143].contains(&i) { 1.0 } else { 0.01 }
        };
        let packed = (0..144).map(|i| self.covariance * diagonal(i)).collect();
        self.send(begin, Message::Covariance(Covariance { frame, antennas: 12, packed }));
        let info = FrameInfo {
            frame,
            profile: self.profile,
            chirps: 192,
            moving_cells: cells,
            ..FrameInfo::default()
        };
        self.send(begin, Message::Frame(info));
    }
}

fn epc(number: u8) -> Epc {
    Epc::new(&[0xe2, 0x80, 0x69, 0x95, 0, 0, 0x50, 0x18, 0, 0, 0, number]).unwrap()
}

fn settings() -> Settings {
    Settings { profile: None, tags: TagNames::simulated(), least: None, threads: NonZeroUsize::MIN }
}

fn sure(p: f32) -> (Recognizer, Rc<RefCell<Asked>>) {
    let asked = Rc::new(RefCell::new(Asked::default()));
    let runner = Sure { asked: Rc::clone(&asked), kept: 0, tags: None, p };
    let recognizer = Recognizer::with_runner(Box::new(runner), &description(), &names(), settings()).unwrap();
    (recognizer, asked)
}

fn run<'a>(recognizer: &mut Recognizer, packets: impl IntoIterator<Item = &'a Vec<u8>>) -> Vec<Recognition> {
    packets.into_iter().for_each(|packet| recognizer.push(packet).unwrap());
    recognizer.finish().unwrap();
    std::iter::from_fn(|| recognizer.next()).collect()
}

/// What a sure network makes of a room.
fn told(room: &Room) -> Vec<Recognition> {
    run(&mut sure(0.9).0, &room.packets)
}

/// The one reason why nothing is told.
fn reason(room: &Room) -> Why {
    let told = told(room);
    match &told[..] {
        [Recognition { outcome: Outcome::CannotTell { why, .. }, .. }] => why.clone(),
        _ => panic!("{told:?}"),
    }
}

#[test]
fn a_tuple_is_told_with_its_times() {
    let room = Room::new().frames(20, 0, 0).frames(30, 20, 300).frames(20, 0, 0);
    let (mut recognizer, asked) = sure(0.9);
    let told = run(&mut recognizer, &room.packets);
    let [Recognition { begin_s, end_s, outcome: Outcome::Tuple(guess) }] = &told[..] else {
        panic!("{told:?}")
    };
    // The first packet was a second before the first frame.
    assert!((begin_s - 2.4).abs() < 0.06 && (end_s - 6.6).abs() < 0.06, "{begin_s} to {end_s}");
    assert_eq!(guess.to_string(), "<open, bottle>");
    assert_eq!((guess.epc.clone(), guess.p), (epc(4), 0.9));
    let asked = asked.borrow();
    // 70 frames and what came before; the tags were all there with the first.
    assert_eq!((asked.answers.len(), asked.tags), (1, 4));
    assert!((70..90).contains(&asked.frames) && asked.clears <= 2, "{asked:?}");
    assert_eq!(
        recognizer.tags().map(|(_, name)| name.unwrap()).collect::<Vec<_>>(),
        ["phone", "book", "pen", "bottle"]
    );
    // Less sure.
    let (mut recognizer, _) = sure(0.4);
    let told = run(&mut recognizer, &room.packets);
    let Outcome::CannotTell { why, guess: Some(guess) } = &told[0].outcome else { panic!("{told:?}") };
    assert_eq!((why.reason(), guess.p), ("low_probability", 0.4));
}

#[test]
fn nothing_is_told_of_nothing() {
    let quiet = Room::new().frames(100, 0, 0);
    assert_eq!(told(&quiet), []);
    assert_eq!(told(&Room::new()), []);
    assert_eq!(told(&Room::new().frames(1, 500, 300)), []);
    assert_eq!(run(&mut sure(0.9).0, &[vec![], vec![0; 1400], vec![0xff; 20]]), []);
}

#[test]
fn without_tags_it_cannot_tell() {
    let room = Room { tags: 0..0, ..Room::new() }.frames(20, 0, 0).frames(30, 20, 0).frames(20, 0, 0);
    assert_eq!(reason(&room), Why::NoTags);
    let room = Room { tags: 0..0, ..Room::new().frames(20, 0, 0) }.frames(30, 20, 0);
    assert!(matches!(reason(&room), Why::ReaderSilent { share } if share > 0.7));
    // The last tag, of which the network is sure, has left a second before.
    let room = Room { tags: 1..4, ..Room::new().frames(20, 0, 0) };
    let room = room.frames(10, 0, 0).frames(30, 20, 0).frames(20, 0, 0);
    assert_eq!(reason(&room), Why::TargetUnread);
}

#[test]
fn without_the_radar_it_cannot_tell() {
    let room = Room { radar: false, ..Room::new() }.frames(20, 0, 0).frames(30, 0, 700).frames(40, 0, 0);
    assert!(matches!(reason(&room), Why::RadarMissing { share } if share == 1.0));
    // It goes away while somebody moves.
    let room = Room { radar: false, ..Room::new().frames(20, 0, 0).frames(10, 20, 700) }.frames(15, 0, 700);
    assert!(matches!(reason(&room), Why::RadarMissing { .. }));
}

#[test]
fn maps_that_cannot_be_trusted_tell_nothing() {
    for codes in [[0, 0], [40, 40]] {
        let room = Room { codes, ..Room::new() }.frames(20, 0, 0).frames(30, 20, 300).frames(20, 0, 0);
        let why = reason(&room);
        assert_eq!(why, Why::MapsInvalid { reason: "empty", share: 1.0 });
        assert!(
            why.to_string().ends_with("nothing rises over the noise; point the radar at the people"),
            "{why}"
        );
    }
}

#[test]
fn what_cannot_be_is_borne() {
    let rooms = [
        Room { covariance: f32::NAN, ..Room::new() },
        Room { covariance: 0.0, ..Room::new() },
        Room { covariance: f32::INFINITY, ..Room::new() },
        Room { codes: [255, 255], ..Room::new() },
        Room { antennas: 1..4, ..Room::new() },
        Room { tags: 1..2, ..Room::new() },
        Room { tags: 1..31, ..Room::new() },
        Room { tags: 1..100, antennas: 1..2, ..Room::new() },
    ];
    for room in rooms {
        let tags = room.tags.len();
        let room = room.frames(20, 0, 0).frames(30, u32::MAX, 300).frames(20, 0, 0);
        let (mut recognizer, asked) = sure(0.9);
        assert_eq!(run(&mut recognizer, &room.packets).len(), 1);
        assert_eq!(asked.borrow().tags, tags.min(64));
    }
    // A minute in which all moves, cut into pieces.
    let told = told(&Room::new().frames(600, 50, 300));
    assert!((8..=15).contains(&told.len()), "{told:?}");
    assert!(told.windows(2).all(|pair| (pair[0].end_s - pair[1].begin_s).abs() < 1e-6));
}

#[test]
fn one_packet_of_five_is_lost() {
    let room = Room::new().frames(20, 0, 0).frames(30, 20, 300).frames(20, 0, 0);
    let mut random = 7_u32;
    let arrives = |_: &&Vec<u8>| {
        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        random >> 16 >= 65_536 / 5
    };
    let (mut recognizer, _) = sure(0.9);
    let told = run(&mut recognizer, room.packets.iter().filter(arrives));
    // Most frames have a hole: it is said, or there is enough to go by; nothing is torn apart.
    assert_eq!(told.len(), 1, "{told:?}");
    assert!(recognizer.counts().link.packets_lost > 100);
}

#[test]
fn time_goes_on_where_a_bridge_restarts() {
    let before = Room::new().frames(20, 0, 0).frames(10, 20, 300);
    let after =
        Room { uplink: Uplink::new(2), ..Room::new() }.frames(20, 0, 0).frames(30, 20, 300).frames(20, 0, 0);
    let (mut recognizer, _) = sure(0.9);
    let told = run(&mut recognizer, before.packets.iter().chain(&after.packets));
    let [first, second] = &told[..] else { panic!("{told:?}") };
    assert!(first.end_s <= 4.1 && second.begin_s > first.end_s && second.begin_s < 8.0, "{told:?}");
}

#[test]
fn a_tag_that_appears_late_is_taken_up() {
    let room = Room { tags: 1..6, ..Room::new().frames(300, 0, 0) }.frames(30, 20, 300).frames(20, 0, 0);
    let (mut recognizer, asked) = sure(0.9);
    let told = run(&mut recognizer, &room.packets);
    let Outcome::Tuple(guess) = &told[0].outcome else { panic!("{told:?}") };
    assert_eq!(guess.object.as_deref(), Some("microwave"));
    // The work of the window again, no more.
    let asked = asked.borrow();
    assert!(asked.tags == 5 && asked.frames < 350 + 150, "{asked:?}");
}

#[test]
fn tags_on_a_list_count_and_no_others() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("tags.csv");
    std::fs::write(&path, format!("{},my red mug\n{},zzyzx\n", epc(2), epc(3))).unwrap();
    let settings = Settings { tags: TagNames::read(&path).unwrap(), ..settings() };
    let asked = Rc::new(RefCell::new(Asked::default()));
    let runner = Sure { asked: Rc::clone(&asked), kept: 0, tags: None, p: 0.9 };
    let mut recognizer =
        Recognizer::with_runner(Box::new(runner), &description(), &names(), settings).unwrap();
    let remarks = recognizer.remarks().join("; ");
    assert!(
        remarks.contains("'my red mug' is taken as 'mug'") && remarks.contains("'zzyzx' is not known"),
        "{remarks}"
    );
    let room = Room::new().frames(20, 0, 0).frames(30, 20, 300).frames(20, 0, 0);
    let told = run(&mut recognizer, &room.packets);
    let Outcome::Tuple(guess) = &told[0].outcome else { panic!("{told:?}") };
    assert_eq!((guess.to_string().as_str(), asked.borrow().tags), ("<open, zzyzx>", 2));
    // Without a list, a tag that nobody has named goes by its EPC.
    let room = Room { tags: 1..20, ..Room::new() }.frames(20, 0, 0).frames(30, 20, 300).frames(20, 0, 0);
    let Outcome::Tuple(guess) = &super::tests::told(&room)[0].outcome else { panic!() };
    assert_eq!(guess.to_string(), format!("<open, {}>", epc(19)));
}

#[test]
fn another_radar_is_refused() {
    let refused = |error: RecognizeError| {
        let sentence = error.to_string();
        assert!(sentence.contains("record with the profile `bridge`"), "{sentence}");
        sentence
    };
    let other = RadarProfile { samples: 64, sample_rate_ksps: 1_100, loops: 32, ..RadarProfile::bridge() };
    let settings = Settings { profile: Some(other), ..settings() };
    let runner = Box::new(Sure { asked: Rc::default(), kept: 0, tags: None, p: 0.9 });
    let error = Recognizer::with_runner(runner, &description(), &names(), settings).err().unwrap();
    let sentence = refused(error);
    assert!(sentence.contains("32 Doppler bins instead of 64"), "{sentence}");
    assert!(sentence.contains("64 range bins, of which 72 are needed"), "{sentence}");

    let push = |room: &Room| {
        let (mut recognizer, _) = sure(0.9);
        room.packets.iter().find_map(|packet| recognizer.push(packet).err()).unwrap()
    };
    let sentence =
        refused(push(&Room { profile: RadarProfile::fine().fingerprint(), ..Room::new() }.frames(1, 0, 0)));
    assert!(sentence.contains("the bridge runs `fine`, "), "{sentence}");
    let sentence = refused(push(&Room { profile: 7, ..Room::new() }.frames(1, 0, 0)));
    assert!(sentence.contains("fingerprint 00000007"), "{sentence}");

    let others = Description { names: 7, ..description() };
    let runner = Box::new(Sure { asked: Rc::default(), kept: 0, tags: None, p: 0.9 });
    let error = Recognizer::with_runner(runner, &others, &names(), super::tests::settings()).err().unwrap();
    assert!(error.to_string().contains("other vectors of names (00000007)"), "{error}");
}

#[test]
fn what_is_kept_does_not_grow() {
    let (mut recognizer, asked) = sure(0.9);
    let mut room = Room::new();
    for _ in 0..30 {
        room = room.frames(60, 0, 0).frames(40, 20, 300);
        for packet in room.packets.drain(..) {
            recognizer.push(&packet).unwrap();
        }
        while recognizer.next().is_some() {}
    }
    assert_eq!(asked.borrow().answers.len(), 29);
    assert!(recognizer.window.numbers().len() <= recognizer.segmenter.reach());
    assert!(asked.borrow().frames < 3_000 + 200, "each frame once");
}

/// Networks of random weights, f32 and int8.
fn untrained() -> [Model; 2] {
    let mut model = Model::untrained(description().config, 3).unwrap();
    model.description = Description { least_probability: 0.0, ..description() };
    let names = names();
    let mut frames = Frames::new(32, 2, 4);
    for number in 0..20_u8 {
        let maps: Vec<u8> = (0..3 * 32 * 32).map(|cell| (cell as u8).wrapping_mul(number)).collect();
        let reads = vec![f32::from(number) / 20.0; 2 * 4 * READ_CHANNELS];
        frames.push(Frame { maps: &maps, scalars: &[0.5; SCALARS], reads: &reads, covariance: &[] });
    }
    let sample =
        Sample { frames, objects: vec![0, 1], action: Some(0), target: Some(0), ..Sample::default() };
    let vectors = [0, 1].map(|place| names.vector(place).to_vec());
    let int8 = quantize(&model, &[&sample], &vectors).unwrap();
    [model, int8]
}

#[test]
fn a_network_that_always_tells_tells_nothing_of_nothing() {
    let nothing = || {
        [
            Room { tags: 0..0, ..Room::new() },
            Room { codes: [0, 0], ..Room::new() },
            Room { codes: [0, 0], covariance: f32::NAN, ..Room::new() },
        ]
    };
    let something = || {
        [
            Room::new(),
            Room { tags: 1..2, ..Room::new() },
            Room { tags: 1..31, ..Room::new() },
            Room { antennas: 1..4, ..Room::new() },
            Room { covariance: f32::NAN, ..Room::new() },
        ]
    };
    for model in untrained() {
        let told = |room: Room, moving: usize| {
            let room = room.frames(20, 0, 0).frames(moving, 20, 300).frames(20, 0, 0);
            let mut recognizer = Recognizer::new(&model, &names(), settings()).unwrap();
            run(&mut recognizer, &room.packets)
        };
        for room in nothing() {
            let told = told(room, 30);
            assert!(
                matches!(told[..], [Recognition { outcome: Outcome::CannotTell { guess: None, .. }, .. }]),
                "{told:?}"
            );
        }
        for room in something() {
            let told = told(room, 30);
            let [Recognition { outcome: Outcome::Tuple(_) | Outcome::Nothing { .. }, .. }] = told[..] else {
                panic!("{told:?}")
            };
        }
        assert!(told(Room::new(), 600).len() >= 8);
        assert_eq!(told(Room::new(), 1), []);
    }
}
