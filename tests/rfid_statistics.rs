//! Simulated tag reads beside those of real ones: `cargo test -p rfhoi-tests --test rfid_statistics -- --nocapture` prints
//! the tables.
//!
//! The real ones are `rfid_phase/crozenboom`: an R420 with a tag at rest and one antenna (`Test15-5-0`), and with a tag that
//! a person carries along the middle of a square of 15 feet with antennas in its corners (`MoveTest1-1` to `-8`). The
//! simulated reader has as many antennas, tags and channels; the distance of the tag at rest is taken from the name (5
//! feet). Losses and the share of missed rounds were fitted to these recordings, so figures that follow from them directly
//! (level, rate of the carried tag) show that the fit holds, the others that the model does. One thing does not fit well: a
//! carried tag comes back to an antenna more regularly than with the independent misses that are simulated.
//!
//! Without the recordings each test says SKIPPED and passes.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use glam::Vec3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rfhoi::phase::circular::{Resultant, wrap};
use rfhoi::phase::{Invalid, Settings, analyse};
use rfhoi::reads::ReadTable;
use rfhoi::simulate::effects::{Domain, Effects};
use rfhoi::simulate::rfid::measurement::phase_noise;
use rfhoi::simulate::rfid::{Options, ReaderSession, simulate};
use rfhoi_shared::tag::TagRead;
use rfhoi_shared::units::{AntennaPort, BridgeTime, CentiDbm};

mod recorded;
#[path = "rfid/room.rs"]
mod room;
use recorded::recorded;
use room::{Body, Room, SIDE_M};

const FOOT_M: f32 = 0.3048;

/// A figure of both, and the largest difference: absolute, or a share where that is `true`.
struct Row {
    name: &'static str,
    real: f64,
    simulated: f64,
    bound: f64,
    relative: bool,
}

impl Row {
    fn holds(&self) -> bool {
        let allowed = if self.relative { self.bound * self.real.abs() } else { self.bound };
        (self.simulated - self.real).abs() <= allowed
    }
}

/// Prints all rows, then checks them.
fn compare(title: &str, rows: &[Row]) {
    println!("\n{title}\n{:<58}{:>10}{:>11}   bound", "", "real", "simulated");
    for row in rows {
        let bound =
            if row.relative { format!("{:.0} %", 100.0 * row.bound) } else { format!("{}", row.bound) };
        println!("{:<58}{:>10.2}{:>11.2}   {bound}", row.name, row.real, row.simulated);
    }
    for row in rows {
        assert!(row.holds(), "{}: {} measured, {} simulated", row.name, row.real, row.simulated);
    }
}

fn quantile(mut values: Vec<f64>, share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    values[((values.len() - 1) as f64 * share).round() as usize]
}

fn deviation(values: &[f64]) -> f64 {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / values.len() as f64).sqrt()
}

fn radians(read: &TagRead) -> f64 {
    f64::from(read.phase.unwrap().radians())
}

fn gap_ms(pair: &[TagRead]) -> f64 {
    pair[1].time.since(pair[0].time) as f64 / 1e3
}

/// Strengths as the recordings hold them: whole dBm.
fn in_whole_dbm(mut reads: Vec<TagRead>) -> Vec<TagRead> {
    for read in &mut reads {
        read.rssi = CentiDbm::from_whole_dbm(read.rssi.dbm().round() as i8);
    }
    reads
}

/// Figures of a tag at rest before one antenna.
fn at_rest(reads: &[TagRead]) -> Vec<f64> {
    let seconds = reads[reads.len() - 1].time.since(reads[0].time) as f64 * 1e-6;
    let visits: Vec<&[TagRead]> = reads.chunk_by(|a, b| a.channel == b.channel).collect();
    // The first and last may be cut.
    let whole = &visits[1..visits.len() - 1];
    let (mut within, mut noise, mut spread, mut rssi) = (vec![], vec![], vec![], vec![]);
    for visit in whole {
        let mut phases = Resultant::default();
        visit.iter().for_each(|read| phases.add(radians(read)));
        let mean = phases.mean().unwrap();
        spread.extend(visit.iter().map(|read| wrap(radians(read) - mean).to_degrees()));
        let level = visit.iter().map(|read| f64::from(read.rssi.dbm())).sum::<f64>() / visit.len() as f64;
        rssi.extend(visit.iter().map(|read| f64::from(read.rssi.dbm()) - level));
        for pair in visit.windows(2) {
            within.push(gap_ms(pair));
            noise.push(wrap(radians(&pair[1]) - radians(&pair[0])).to_degrees() / 2_f64.sqrt());
        }
    }
    let hops = reads.windows(2).filter(|pair| pair[0].channel != pair[1].channel);
    let dwell = whole.windows(2).map(|pair| pair[1][0].time.since(pair[0][0].time) as f64 / 1e3);
    let mut channels = BTreeMap::<_, (Resultant, Vec<f64>)>::new();
    for read in reads {
        let channel = channels.entry(read.channel).or_default();
        channel.0.add(radians(read));
        channel.1.push(f64::from(read.rssi.dbm()));
    }
    let mut offsets = Resultant::default();
    channels.values().for_each(|(phases, _)| offsets.add(phases.mean().unwrap()));
    let levels: Vec<_> = channels.values().map(|(_, l)| l.iter().sum::<f64>() / l.len() as f64).collect();
    let doppler: Vec<_> = reads.iter().map(|r| f64::from(r.doppler.unwrap().hertz())).collect();
    let (_, report) = analyse(reads, Settings::default());
    let visit_reads = whole.iter().map(|visit| visit.len() as f64).collect();
    vec![
        reads.len() as f64 / seconds,
        quantile(within.clone(), 0.5),
        deviation(&within),
        quantile(hops.map(gap_ms).collect(), 0.5),
        quantile(dwell.collect(), 0.5),
        quantile(visit_reads, 0.5),
        channels.len() as f64,
        offsets.mean_length().unwrap(),
        deviation(&noise),
        deviation(&spread),
        report.phase_std_within_channel_deg.unwrap(),
        report.phase_std_after_correction_deg.unwrap(),
        quantile(reads.iter().map(|r| f64::from(r.rssi.dbm())).collect(), 0.5),
        deviation(&rssi),
        deviation(&levels),
        deviation(&doppler),
        report.intervals_valid_share.unwrap(),
        reads.iter().filter(|r| r.phase.unwrap().0 % 4 == 0).count() as f64 / reads.len() as f64,
    ]
}

#[test]
fn a_tag_at_rest() {
    let Some(path) = recorded("rfid_phase/crozenboom/Test15-5-0.csv") else { return };
    let real = ReadTable::open(path).unwrap().reads;
    let seconds = real[real.len() - 1].time.seconds();
    let room = Room::square(1, &[12]);
    let effects = Effects::of(Domain::Site);
    let mut rng = ChaCha8Rng::seed_from_u64(15);
    let mut session = ReaderSession::draw(1, 1, &effects, &mut rng);
    session.tags[0].loss_db = 4.7;
    let diagonal = 5.0 * FOOT_M / 2_f32.sqrt();
    let position = |_, _| room.place(diagonal, diagonal);
    let options = Options { missed: 0.0, ..Options::between(0.0, seconds, BridgeTime(0)) };
    let reads = simulate(room.situation(&position, effects), &session, options, &mut rng);

    let (real, simulated) = (at_rest(&real), at_rest(&in_whole_dbm(reads)));
    let names = [
        ("reads, 1/s", 0.02, true),
        ("gap within a channel, median, ms", 0.01, true),
        ("its standard deviation, ms", 0.15, false),
        ("gap across a hop, median, ms", 0.05, true),
        ("time on a channel, median, ms", 0.02, true),
        ("reads of a visit, median", 1.0, false),
        ("channels", 0.0, false),
        ("mean resultant length of the channels' offsets", 0.3, false),
        ("phase noise from read to read, deg", 0.15, false),
        ("phase within a visit, standard deviation, deg", 0.35, false),
        ("phase within a channel, standard deviation, deg", 0.6, false),
        ("phase after correction, standard deviation, deg", 0.9, false),
        ("signal strength, median, dBm", 3.0, false),
        ("signal strength within a visit, standard deviation, dB", 0.15, false),
        ("channels' mean signal strengths, standard deviation, dB", 0.5, false),
        ("Doppler, standard deviation, Hz", 0.25, true),
        ("valid steps, share", 0.01, false),
        ("phases that are multiples of 4 codes, share", 0.0, false),
    ];
    let rows: Vec<_> = names
        .into_iter()
        .zip(real.into_iter().zip(simulated))
        .map(|((name, bound, relative), (real, simulated))| Row { name, real, simulated, bound, relative })
        .collect();
    compare("A tag at rest, 1 antenna, 50 channels, 45 s", &rows);
}

/// Sums of all runs of a carried tag.
#[derive(Default)]
struct Carried {
    reads: f64,
    seconds: f64,
    same_antenna_ms: Vec<f64>,
    any_antenna_ms: Vec<f64>,
    again: f64,
    rssi: Vec<f64>,
    too_long: f64,
    steps: f64,
}

impl Carried {
    fn add(&mut self, reads: &[TagRead]) {
        self.reads += reads.len() as f64;
        self.seconds += reads[reads.len() - 1].time.since(reads[0].time) as f64 * 1e-6;
        self.any_antenna_ms.extend(reads.windows(2).map(gap_ms));
        self.again +=
            reads.windows(2).filter(|p| p[0].antenna == p[1].antenna && gap_ms(p) < 20.0).count() as f64;
        for port in 1..=4 {
            let one: Vec<_> = reads.iter().filter(|r| r.antenna == AntennaPort(port)).cloned().collect();
            self.same_antenna_ms.extend(one.windows(2).map(gap_ms));
        }
        self.rssi.extend(reads.iter().map(|r| f64::from(r.rssi.dbm())));
        let (_, report) = analyse(reads, Settings::default());
        self.too_long += report.intervals.invalid(Invalid::TooLong) as f64;
        self.steps += report.intervals.total() as f64;
    }

    fn figures(&self) -> [f64; 10] {
        let same = |share| quantile(self.same_antenna_ms.clone(), share);
        let rssi = |share| quantile(self.rssi.clone(), share);
        [
            self.reads / self.seconds,
            quantile(self.any_antenna_ms.clone(), 0.5),
            same(0.25),
            same(0.5),
            same(0.75),
            self.again / self.reads,
            rssi(0.05),
            rssi(0.5),
            rssi(0.95),
            self.too_long / self.steps,
        ]
    }
}

#[test]
fn a_carried_tag() {
    let (mut real, mut simulated) = (Carried::default(), Carried::default());
    for run in 1..=8 {
        let name = format!("rfid_phase/crozenboom/MoveTest1-{run}.csv");
        let Some(path) = recorded(&name) else { return };
        let reads = ReadTable::open(path).unwrap().reads;
        let seconds = reads[reads.len() - 1].time.seconds();
        real.add(&reads);

        // From 14 to 1 feet, or back from the fifth run on; the person is an arm's length behind.
        let ends = if run <= 4 { [14.0, 1.0] } else { [1.0, 14.0] };
        let along = move |t: f64| {
            let share = (t / seconds).clamp(0.0, 1.0) as f32;
            FOOT_M * (ends[0] + (ends[1] - ends[0]) * share)
        };
        let behind = 0.4 * (ends[0] - ends[1]).signum();
        let mut room = Room::square(4, &[12]);
        room.body = Some(Body(Box::new(move |t| Vec3::new(SIDE_M / 2.0, along(t) + behind, 0.0))));
        let position = |_, t| room.place(SIDE_M / 2.0, along(t));
        let effects = Effects::of(Domain::Site);
        let mut rng = ChaCha8Rng::seed_from_u64(run);
        let mut session = ReaderSession::draw(4, 1, &effects, &mut rng);
        session.tags[0].loss_db = 9.2;
        let options = Options { missed: 0.79, ..Options::between(0.0, seconds, BridgeTime(0)) };
        simulated.add(&in_whole_dbm(simulate(
            room.situation(&position, effects),
            &session,
            options,
            &mut rng,
        )));
    }
    let names = [
        ("reads, 1/s", 0.15, true),
        ("gap, median, ms", 0.25, true),
        ("gap by the same antenna, first quartile, ms", 0.35, true),
        ("gap by the same antenna, median, ms", 0.35, true),
        ("gap by the same antenna, third quartile, ms", 0.35, true),
        ("reads twice in a turn, share", 0.12, false),
        ("signal strength, 5 % quantile, dBm", 4.0, false),
        ("signal strength, median, dBm", 3.0, false),
        ("signal strength, 95 % quantile, dBm", 4.0, false),
        ("steps too long for 1.5 m/s, share", 0.1, false),
    ];
    let rows: Vec<_> = names
        .into_iter()
        .zip(real.figures().into_iter().zip(simulated.figures()))
        .map(|((name, bound, relative), (real, simulated))| Row { name, real, simulated, bound, relative })
        .collect();
    compare("A carried tag, 4 antennas, 50 channels, 8 runs of 12 s", &rows);
}

/// The law of the noise against the RDA samples, whose figures were taken with numpy (`simulate::rfid::measurement` tells
/// how).
#[test]
fn phase_noise_by_signal_strength() {
    const MEASURED: [(i16, f64); 12] = [
        (-79, 8.11),
        (-77, 6.63),
        (-75, 4.98),
        (-71, 8.85),
        (-69, 7.74),
        (-67, 5.90),
        (-65, 4.79),
        (-63, 3.69),
        (-61, 2.95),
        (-59, 2.21),
        (-57, 1.84),
        (-55, 1.47),
    ];
    let rows = MEASURED.map(|(dbm, real)| Row {
        name: Box::leak(format!("phase noise of a read at {dbm} dBm, deg").into_boxed_str()),
        real,
        simulated: phase_noise(f64::from(dbm)).to_degrees(),
        bound: 0.15,
        relative: true,
    });
    compare("The law of the noise, and worn tags that keep still", &rows);
}

#[test]
fn a_sample_takes_little_time() {
    let mut room = Room::square(4, &[12; 6]);
    room.body = Some(Body(Box::new(|_| Vec3::new(2.0, 2.5, 0.0))));
    let effects = Effects::of(Domain::Site);
    let position = |tag: usize, t: f64| room.place(1.0 + 0.4 * tag as f32, 2.0 + 0.1 * t as f32);
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let session = ReaderSession::draw(4, 6, &effects, &mut rng);
    let sample = |rng: &mut ChaCha8Rng| {
        let start = Instant::now();
        let options = Options::between(0.0, 4.0, BridgeTime(0));
        let reads = simulate(room.situation(&position, effects), &session, options, rng);
        (start.elapsed(), reads.len())
    };
    let (time, reads) = (0..10).map(|_| sample(&mut rng)).min().unwrap();
    println!("\n4 s, 6 tags, 4 antennas: {reads} reads in {time:?} at best of ten");
    assert!(time < Duration::from_millis(10), "{time:?}");
}
