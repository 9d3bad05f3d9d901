//! A simulated room in a few numbers: an echo in noise, tags at rest of which one is moved, and the stream that sees them.

use std::f64::consts::TAU;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Exp1, StandardNormal};
use rfhoi_firmware::dsp::level;
use rfhoi_shared::config::{Processing, RadarConfig, RadarInput};
use rfhoi_shared::radar::{RadarProfile, RangeGate};
use rfhoi_shared::tag::TagRead;
use rfhoi_shared::units::BridgeTime;
use rfhoi_shared::wire::{Covariance, FrameInfo};

use crate::align::{AlignedFrame, FrameStream, MapName, Settings};
use crate::phase::circular::wrap;
use crate::receive::{HeatMap, RadarFrame};
use crate::stability::Trial;
use crate::stability::hopping::{
    CHANNELS, EPOCH_US, FRAME_US, channel, epc, place, radians_per_metre, reached, read, step_us,
};

/// From one read to the next, us: those of an R420 with one antenna.
const READ_US: f64 = 14_000.0;
/// From a read to its packet, us.
const REPORTED_US: u64 = 4_000;
/// From the begin of a frame to its packets, us.
const PROCESSED_US: u64 = 60_000;
/// The movement: a cup put aside, with least jerk (Flash and Hogan 1985).
const MOVED_M: f64 = 0.4;
const MOVING_US: u64 = 800_000;
/// Phase noise, rad.
const NOISE: f64 = 0.1;
/// Level of the radar's noise in a cell, dB relative to full scale.
const NOISE_DB: f64 = -115.0;
/// Virtual antennas over which a cell's power is the mean.
const ANTENNAS: usize = 12;
/// Gate, Doppler bins and range-time columns of its maps.
const BINS: u16 = 24;
const LOOPS: u16 = 16;
const COLUMNS: u16 = 8;

/// Which frame is asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Asked {
    /// Any in which the tag moves.
    Moving,
    /// The last.
    Last,
}

/// One draw of a room. What is public is changed before it is looked at.
#[derive(Debug, Clone)]
pub(super) struct Room {
    pub(super) tags: usize,
    pub(super) frames: u32,
    pub(super) asked: Asked,
    /// By how much reads are stamped too late, us.
    pub(super) late_us: i64,
    /// Share of the radar's frames that never come.
    pub(super) frames_lost: f64,
    /// The echo's power over the noise in its cell, dB.
    pub(super) echo_db: f64,
    echo: (u16, u16),
    /// From the movement's end to the stream's, us.
    rest_us: u64,
    /// Offset of each channel, rad.
    offsets: [f64; CHANNELS],
}

/// A read as it was made.
struct Read {
    time_us: u64,
    tag: usize,
    place: usize,
    told: TagRead,
}

impl Room {
    /// Four and a half seconds with three tags, one of which is moved, and a strong echo.
    pub(super) fn draw(rng: &mut ChaCha8Rng) -> Self {
        Self {
            tags: 3,
            frames: 45,
            asked: Asked::Moving,
            late_us: 0,
            frames_lost: 0.0,
            echo_db: 30.0,
            // Off zero Doppler and its guard.
            echo: (rng.random_range(3..BINS - 3), rng.random_range(3..LOOPS - 3) ^ 1),
            rest_us: rng.random_range(0..300_000),
            offsets: std::array::from_fn(|_| TAU * rng.random::<f64>()),
        }
    }

    fn end_us(&self) -> u64 {
        EPOCH_US + u64::from(self.frames) * FRAME_US
    }

    fn metres(&self, time_us: u64) -> f64 {
        let begin = self.end_us() - self.rest_us - MOVING_US;
        MOVED_M * reached(time_us, begin, begin + MOVING_US)
    }

    /// The tag that is moved: the last one that is seen.
    fn moved(&self) -> usize {
        self.tags.saturating_sub(1)
    }

    /// Number of the frame that is asked for.
    fn choose(&self, rng: &mut ChaCha8Rng) -> u32 {
        let last = self.frames - 1;
        match self.asked {
            Asked::Last => last,
            Asked::Moving => {
                let moving = ((self.rest_us + MOVING_US) / FRAME_US) as u32;
                last.saturating_sub(rng.random_range(0..=moving))
            }
        }
    }

    /// How far the moved tag truly goes in frame `number`, mm.
    fn truly_mm(&self, number: u32) -> f64 {
        let begin = EPOCH_US + u64::from(number) * FRAME_US;
        1e3 * (self.metres(begin + FRAME_US) - self.metres(begin))
    }

    /// Reads in the order of time.
    fn reads(&self, rng: &mut ChaCha8Rng) -> Vec<Read> {
        let mut reads = Vec::new();
        let mut time_us = EPOCH_US as f64 + READ_US * rng.random::<f64>();
        let mut turn = 0;
        while self.tags > 0 && time_us < self.end_us() as f64 {
            let (time, tag) = (time_us as u64, turn % self.tags);
            let place = place(time);
            let moved = if tag == self.moved() { self.metres(time) } else { 0.0 };
            let noise = NOISE * rng.sample::<f64, _>(StandardNormal);
            // Every tag is at a place of its own.
            let path = 1.5 + 0.037 * tag as f64 + moved;
            let phase = radians_per_metre(channel(place)) * path + self.offsets[place] + noise;
            let told = read(time, tag, 0, channel(place), phase);
            reads.push(Read { time_us: time, tag, place, told });
            time_us += step_us(READ_US, rng);
            turn += 1;
        }
        reads
    }

    /// What the radar sends of frame `number`.
    fn radar(&self, number: u32, rng: &mut ChaCha8Rng) -> RadarFrame {
        let time = BridgeTime(EPOCH_US + u64::from(number) * FRAME_US);
        let mut map = |columns: u16, echo: &dyn Fn(u16, u16) -> bool, looks: usize| {
            let codes = (0..BINS).flat_map(|row| (0..columns).map(move |column| (row, column)));
            let codes = codes.map(|cell| {
                let draws = (0..looks).map(|_| rng.sample::<f64, _>(Exp1)).sum::<f64>() / looks as f64;
                let signal = if echo(cell.0, cell.1) { 10_f64.powf(self.echo_db / 10.0) } else { 0.0 };
                level::code((10_f64.powf(NOISE_DB / 10.0) * (draws + signal)) as f32)
            });
            Some(HeatMap {
                gate: RangeGate { first: 0, bins: BINS },
                columns: columns.into(),
                scale: level::SCALE,
                codes: codes.collect(),
                arrived: vec![true; BINS.into()],
            })
        };
        let range_doppler = map(LOOPS, &|row, column| (row, column) == self.echo, ANTENNAS);
        let range_time = map(COLUMNS, &|row, _| row == self.echo.0, ANTENNAS * usize::from(LOOPS / COLUMNS));
        // From straight ahead, all antennas are alike.
        let mut packed = heapless::Vec::new();
        for row in 0..ANTENNAS {
            let _ = packed.push(1.01e-9);
            for _ in row + 1..ANTENNAS {
                let _ = packed.extend_from_slice(&[1e-9, 0.0]);
            }
        }
        let info = FrameInfo {
            frame: number,
            profile: config().profile.fingerprint(),
            chirps: config().profile.chirps_per_frame(),
            moving_cells: 30,
            ..FrameInfo::default()
        };
        RadarFrame {
            frame: number,
            time,
            info: Some(info),
            range_doppler,
            range_time,
            covariance: Some(Covariance { frame: number, antennas: ANTENNAS as u8, packed }),
            points: Vec::new(),
        }
    }

    /// Lets a stream see it all; returns the frames about the one that is asked for, and the stream.
    fn stream(&self, reads: &[Read], asked: u32, rng: &mut ChaCha8Rng) -> (Vec<AlignedFrame>, FrameStream) {
        let mut settings = Settings::new(config());
        settings.points = usize::from(LOOPS);
        settings.tags = (0..self.tags).map(epc).collect();
        let mut stream = FrameStream::new(settings).expect("the settings fit the profile");
        let mut reads = reads.iter().peekable();
        let mut kept = Vec::new();
        let last = u64::from(self.frames - 1);
        for step in 0..=last + 3 {
            let begin = EPOCH_US + step * FRAME_US;
            for until in [begin + PROCESSED_US, begin + FRAME_US] {
                while let Some(read) = reads.next_if(|read| read.time_us + REPORTED_US <= until) {
                    let sent = BridgeTime(read.time_us + REPORTED_US);
                    stream.push_reads(&[self.report(read)], sent);
                    stream.advance(sent);
                }
                if until == begin + PROCESSED_US && step <= last && rng.random::<f64>() >= self.frames_lost {
                    stream.push_frame(&self.radar(step as u32, rng));
                }
                stream.advance(BridgeTime(until));
            }
            while let Some(frame) = stream.next() {
                // A few around the one that is asked for; others give their memory back.
                if frame.number.abs_diff(asked) <= 1 { kept.push(frame) } else { stream.recycle(frame) }
            }
        }
        (kept, stream)
    }

    /// A read as the bridge tells of it.
    fn report(&self, read: &Read) -> TagRead {
        TagRead { time: BridgeTime(read.time_us.saturating_add_signed(self.late_us)), ..read.told.clone() }
    }

    /// How far the moved tag goes in frame `number` by the nearest reads and their difference, mm: the plain way.
    fn nearest_mm(&self, reads: &[Read], number: u32) -> f64 {
        let begin = EPOCH_US + u64::from(number) * FRAME_US;
        let phase = |at: u64| {
            let of_tag = reads.iter().filter(|read| read.tag == self.moved());
            let stamp = |read: &Read| read.time_us.saturating_add_signed(self.late_us);
            let nearest = of_tag.min_by_key(|read| stamp(read).abs_diff(at))?;
            // Its channels' offsets are known beforehand, better than any can be learnt.
            let still = self.offsets[nearest.place]
                + radians_per_metre(channel(nearest.place)) * (1.5 + 0.037 * nearest.tag as f64);
            Some(f64::from(nearest.told.phase?.radians()) - still)
        };
        let turned = phase(begin).zip(phase(begin + FRAME_US)).map_or(0.0, |(from, to)| wrap(to - from));
        millimetres(turned)
    }

    /// The moved tag in the frame that is asked for.
    pub(super) fn movement(&self, guard: bool, rng: &mut ChaCha8Rng) -> Trial {
        let reads = self.reads(rng);
        let asked = self.choose(rng);
        let truth = if self.tags > 0 { self.truly_mm(asked) } else { 0.0 };
        if !guard {
            let found = if self.tags > 0 { self.nearest_mm(&reads, asked) } else { 0.0 };
            return Trial { error: (found - truth).abs(), announced: None };
        }
        let (frames, stream) = self.stream(&reads, asked, rng);
        let tag = stream.epcs().position(|other| *other == epc(self.moved()));
        let found = frames.iter().find(|frame| frame.number == asked);
        let Some(frame) = found else { return Trial { error: f64::INFINITY, announced: None } };
        match tag.map(|tag| frame.phase(tag, 0)) {
            Some(Ok(turned)) => {
                Trial { error: (millimetres(f64::from(turned)) - truth).abs(), announced: None }
            }
            Some(Err(why)) => Trial { error: truth.abs(), announced: Some(why.reason()) },
            // Nothing is said of a tag that is not there, and of one too many it is counted.
            None if self.tags == 0 => Trial { error: 0.0, announced: None },
            None => {
                let counted = stream.counts().reads.other_tags > 0;
                Trial { error: truth.abs(), announced: counted.then_some("not_held") }
            }
        }
    }

    /// The frame that is asked for where frames are lost: with the guard by its time, without by its count.
    pub(super) fn frame(&self, guard: bool, rng: &mut ChaCha8Rng) -> Trial {
        let reads = self.reads(rng);
        let asked = self.choose(rng);
        let truth = self.truly_mm(asked);
        if !guard {
            // Frames that came, counted.
            let came: Vec<u32> =
                (0..self.frames).filter(|_| rng.random::<f64>() >= self.frames_lost).collect();
            let counted = came.get(asked as usize).or(came.last()).copied();
            let error = counted.map_or(f64::INFINITY, |n| (self.nearest_mm(&reads, n) - truth).abs());
            return Trial { error, announced: None };
        }
        let (frames, _) = self.stream(&reads, asked, rng);
        let Some(frame) = frames.iter().find(|frame| frame.number == asked) else {
            return Trial { error: f64::INFINITY, announced: Some("not_reached") };
        };
        let map = frame.invalid(MapName::RangeDoppler).map(|invalid| invalid.reason());
        match (map, frame.phase(0, 0)) {
            // The tags' part does not depend on the radar's.
            (Some(reason), _) => Trial { error: f64::INFINITY, announced: Some(reason) },
            (None, Ok(_)) => {
                let tag = frame.phase(self.moved(), 0);
                let error = tag.map_or(f64::INFINITY, |t| (millimetres(f64::from(t)) - truth).abs());
                Trial { error, announced: tag.err().map(|why| why.reason()) }
            }
            (None, Err(why)) => Trial { error: f64::INFINITY, announced: Some(why.reason()) },
        }
    }

    /// The strongest echo in the frame that is asked for.
    pub(super) fn echo(&self, guard: bool, rng: &mut ChaCha8Rng) -> Trial {
        let asked = self.choose(rng);
        let off = |row: f64| (row - f64::from(self.echo.0)).abs();
        if !guard {
            let frame = self.radar(asked, rng);
            let codes = frame.range_doppler.map(|map| map.codes).unwrap_or_default();
            let best = (0..codes.len()).max_by_key(|&cell| codes[cell]).unwrap_or(0);
            return Trial { error: off((best / usize::from(LOOPS)) as f64), announced: None };
        }
        let (frames, _) = self.stream(&[], asked, rng);
        let Some(frame) = frames.iter().find(|frame| frame.number == asked) else {
            return Trial { error: f64::INFINITY, announced: None };
        };
        let map = frame.map(MapName::RangeDoppler);
        let best = (0..map.len()).max_by(|&a, &b| map[a].total_cmp(&map[b])).unwrap_or(0);
        let row = (best / frame.points) as f64 + 0.5;
        let bin = row * f64::from(BINS) / frame.points as f64 - 0.5;
        let announced = frame.invalid(MapName::RangeDoppler).map(|invalid| invalid.reason());
        Trial { error: off(bin), announced }
    }
}

/// What the room's radar is configured for.
fn config() -> RadarConfig {
    let profile = RadarProfile { samples: 32, loops: LOOPS, ..RadarProfile::bridge() };
    let gate = RangeGate { first: 0, bins: BINS };
    let processing = Processing { range_time_columns: COLUMNS, ..Processing::with_gate(&profile, gate) };
    RadarConfig { profile, input: RadarInput::Uart, processing }
}

/// A turn of the phase as a change of the path, mm, in the middle of the band.
fn millimetres(turned: f64) -> f64 {
    turned * 1e3 / radians_per_metre(channel(CHANNELS / 2))
}
