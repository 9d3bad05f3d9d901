//! What a bridge sends of a simulated sample, packet by packet, as often as one wants.
//!
//! The reader's lead-in comes once; then the sample repeats, with the bridge's clock and the frames' numbers going on.

use rfhoi::simulate::draw::{Wanted, draw};
use rfhoi::simulate::effects::{Domain, Effects};
use rfhoi::simulate::sample::{Maker, Sample, epoch};
use rfhoi::simulate::scene::Scene;
use rfhoi_firmware::dsp::level;
use rfhoi_firmware::uplink::{MapPacker, ReadPacker, Uplink};
use rfhoi_shared::config::{Processing, RadarConfig, RadarInput};
use rfhoi_shared::tag::TagRead;
use rfhoi_shared::units::BridgeTime;
use rfhoi_shared::wire::{Covariance, FrameInfo, HopTable, MapKind, Message};

/// From the begin of a frame to the packets of its maps, us.
const PROCESSED_US: u64 = 60_000;
/// From a read to the packet that could carry it, us.
const REPORTED_US: u64 = 3_000;

/// Packets of a simulated sample that repeats.
pub struct Traffic {
    sample: Sample,
    config: RadarConfig,
    epoch: BridgeTime,
    uplink: Uplink,
    packer: ReadPacker,
    frame: u32,
    /// Number of the next read in the sample.
    read: usize,
    started: bool,
}

impl Traffic {
    /// A sample of the domain `site` in a scene that comes with the program, with the default profile.
    pub fn new(scene: &str, seed: u64) -> Self {
        let scenes = [Scene::named(scene).expect("the scene is known")];
        let wanted = Wanted::one(Domain::Site, seed, &rfhoi::hoi::CATEGORIES);
        let effects = Effects::of(Domain::Site);
        let mut maker = Maker::new(Domain::Site, seed, effects, &scenes).expect("the scene can be simulated");
        let sample = maker.make(&draw(&wanted, &scenes)[0]).expect("somebody can act there");
        let profile = scenes[0].radar.profile.clone();
        let processing = Processing::with_gate(&profile, scenes[0].gate());
        let config = RadarConfig { profile, input: RadarInput::Uart, processing };
        Self {
            sample,
            config,
            epoch: epoch(&effects),
            uplink: Uplink::new(1),
            packer: ReadPacker::default(),
            frame: 0,
            read: 0,
            started: false,
        }
    }

    /// What the bridge is configured for.
    pub fn config(&self) -> &RadarConfig {
        &self.config
    }

    /// Frames of one turn of the sample.
    pub fn frames(&self) -> usize {
        self.sample.frames.len()
    }

    fn period_us(&self) -> u64 {
        self.config.profile.frame_period_us.into()
    }

    /// The bridge's time at which frame `frame` begins.
    fn begin(&self, frame: u32) -> BridgeTime {
        self.epoch.after(u64::from(frame) * self.period_us())
    }

    /// Sends all packets until the end of the next frame.
    pub fn frame(&mut self, mut send: impl FnMut(&[u8])) {
        if !std::mem::replace(&mut self.started, true) {
            let channels = self.sample.channels.iter().copied().collect();
            self.uplink.send(
                BridgeTime(0),
                Message::HopTable(HopTable { table: 1, channels }),
                |_, packet| {
                    send(packet);
                    true
                },
            );
        }
        let number = self.frame;
        let begin = self.begin(number);
        self.reads(begin.after(PROCESSED_US), &mut send);
        self.maps(number, begin, &mut send);
        self.reads(begin.after(self.period_us()), &mut send);
        self.frame += 1;
    }

    /// Sends the reads that were made before `until`.
    fn reads(&mut self, until: BridgeTime, send: &mut impl FnMut(&[u8])) {
        let turn_us = self.sample.frames.len() as u64 * self.period_us();
        loop {
            let turn = u64::from(self.frame) / self.sample.frames.len() as u64;
            let Some(read) = self.sample.reads.get(self.read) else {
                // The next turn begins where the lead-in ends.
                if until < self.epoch.after((turn + 1) * turn_us) {
                    return;
                }
                self.read = self.sample.reads.partition_point(|read| read.time < self.epoch);
                return;
            };
            let time = read.time.after(turn * turn_us);
            if time >= until || time >= self.epoch.after((turn + 1) * turn_us) {
                return;
            }
            let read = TagRead { time, ..read.clone() };
            self.read += 1;
            let now = time.after(REPORTED_US);
            let Self { uplink, packer, .. } = self;
            let mut emit = |at: BridgeTime, message: Message<'_>| {
                uplink.send(at, message, |_, packet| {
                    send(packet);
                    true
                });
            };
            if let Some(due) = packer.deadline().filter(|due| *due <= now) {
                packer.tick(due, |message| emit(due, message));
            }
            packer.push(now, read, |message| emit(now, message));
        }
    }

    /// Sends the maps of frame `number`.
    fn maps(&mut self, number: u32, begin: BridgeTime, send: &mut impl FnMut(&[u8])) {
        let maps = &self.sample.frames[number as usize % self.sample.frames.len()];
        let RadarConfig { profile, processing, .. } = &self.config;
        let uplink = &mut self.uplink;
        let mut emit = |message: Message<'_>| {
            uplink.send(begin, message, |_, packet| {
                send(packet);
                true
            });
        };
        for (kind, codes) in
            [(MapKind::RangeTime, &maps.range_time), (MapKind::RangeDoppler, &maps.range_doppler)]
        {
            let columns = codes.len() / usize::from(processing.gate.bins);
            let mut packer = MapPacker::new(kind);
            packer.begin(number, processing.gate, columns as u16, level::SCALE);
            for row in codes.chunks_exact(columns) {
                packer.row(row.iter().copied(), &mut emit);
            }
            packer.flush(&mut emit);
        }
        let packed = maps.covariance.iter().copied().collect();
        let antennas = profile.virtual_count() as u8;
        emit(Message::Covariance(Covariance { frame: number, antennas, packed }));
        emit(Message::Frame(FrameInfo {
            frame: number,
            profile: profile.fingerprint(),
            chirps: profile.chirps_per_frame(),
            moving_cells: maps.moving_cells,
            ..FrameInfo::default()
        }));
    }
}
