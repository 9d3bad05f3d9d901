//! A simulated person who acts before both devices, and what a recognizer makes of what came through a bridge.

use std::collections::VecDeque;

use rfhoi::datagrams::Cutter;
use rfhoi::hoi::Category;
use rfhoi::receive::{RadarFrame, Received};
use rfhoi::recognize::{Recognition, Recognizer};
use rfhoi::simulate::draw::{Purpose, Wanted, draw, stream};
use rfhoi::simulate::effects::{Domain, Effects};
use rfhoi::simulate::radar::Radar;
use rfhoi::simulate::sample::{Take, epoch, perform};
use rfhoi::simulate::scene::Scene;
use rfhoi_shared::config::RadarConfig;
use rfhoi_shared::tag::TagRead;
use rfhoi_shared::units::BridgeTime;
use rfhoi_shared::wire::HopTable;

/// From a read to the packet that carries it, us.
const REPORTED_US: u64 = 4_000;

/// What both devices send.
#[derive(Debug)]
pub struct Acted {
    /// What the bridge's radar is configured for.
    pub config: RadarConfig,
    /// Datagrams of the recorder.
    pub datagrams: Vec<Vec<u8>>,
    /// Frames of the radar.
    pub frames: u32,
    /// When the first frame begins; the reader has read since time 0.
    epoch: BridgeTime,
    reads: Vec<TagRead>,
    channels: HopTable,
}

/// Somebody who does `category` in the room called `scene`, with all effects.
///
/// # Panics
/// If that room does not have it.
pub fn act(scene: &str, category: Category, seed: u64) -> Acted {
    let scenes = [Scene::named(scene).expect("a room of the simulator")];
    let wanted = Wanted::one(Domain::Site, seed, std::slice::from_ref(&category));
    let drawn = draw(&wanted, &scenes).swap_remove(0);
    let (performance, tags) = perform(Domain::Site, seed, &drawn, &scenes[0]).expect("it can be done there");
    let effects = Effects::of(Domain::Site);
    let take = Take::of(&scenes[0], &performance, &tags, effects);
    let noise = |purpose| stream(Domain::Site, seed, drawn.sample, purpose);
    let mut radar = Radar::new(take.scene, effects).expect("its antennas are known");
    radar.begin(take.fixtures, &mut noise(Purpose::Radar));
    let config = radar.config().clone();
    let (mut cutter, mut datagrams) = (Cutter::default(), Vec::new());
    let mut chirp = vec![0; config.profile.chirp_bytes() as usize];
    let times = take.frame_times(&config.profile);
    let frames = times.len() as u32;
    for time_s in times {
        radar.look(&performance, time_s);
        for index in 0..config.profile.chirps_per_frame() {
            radar.chirp(index, &mut chirp);
            datagrams.extend(cutter.push(&chirp).into_iter().map(|datagram| datagram.bytes));
        }
    }
    datagrams.extend(cutter.finish().map(|datagram| datagram.bytes));
    let (reads, channels) = take.reads(&mut noise(Purpose::Rfid));
    let channels = HopTable { table: 1, channels: channels.into_iter().collect() };
    Acted { config, datagrams, frames, epoch: epoch(&effects), reads, channels }
}

impl Acted {
    /// What `recognizer` makes of the reads and of `frames`, which came out of a bridge: as if it had taken them evenly.
    ///
    /// # Panics
    /// If the recognizer refuses them.
    pub fn recognise(&self, frames: &[RadarFrame], recognizer: &mut Recognizer) -> Vec<Recognition> {
        let period_us = u64::from(self.config.profile.frame_period_us);
        let mut reads: VecDeque<&TagRead> = self.reads.iter().collect();
        let take = |recognizer: &mut Recognizer, received: &Received, sent| {
            recognizer.take(received, sent).expect("it is what the model takes");
        };
        take(recognizer, &Received::HopTable(self.channels.clone()), BridgeTime(0));
        let mut until = |recognizer: &mut Recognizer, now: BridgeTime| {
            while let Some(read) = reads.pop_front_if(|read| read.time.after(REPORTED_US) <= now) {
                let received = Received::Reads([read.clone()].into_iter().collect());
                take(recognizer, &received, read.time.after(REPORTED_US));
            }
        };
        for frame in frames {
            let time = self.epoch.after(u64::from(frame.frame) * period_us);
            until(recognizer, time);
            take(recognizer, &Received::Frame(RadarFrame { time, ..frame.clone() }), time);
        }
        until(recognizer, BridgeTime(u64::MAX));
        recognizer.finish().expect("it is what the model takes");
        std::iter::from_fn(|| recognizer.next()).collect()
    }
}
