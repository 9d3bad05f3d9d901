//! One sample on the way that live packets go: its reads, the reader's lead-in first, and the maps of its frames into a
//! [`FrameStream`], what comes out into [`FrameFeatures`].

use rfhoi_firmware::dsp::level;
use rfhoi_network::sample::Frames;
use rfhoi_shared::radar::{RadarProfile, RangeGate};
use rfhoi_shared::tag::TagRead;
use rfhoi_shared::units::{BridgeTime, Kilohertz};
use rfhoi_shared::wire::{Covariance, FrameInfo, HopTable, LogScale};

use super::{FrameFeatures, Settings};
use crate::align::{self, AlignError, FrameStream};
use crate::receive::{HeatMap, RadarFrame};
use crate::simulate::sample::Sample;

/// From a read to the packet that carries it, us.
const REPORTED_US: u64 = 4_000;

/// Features of what both radios measured in `sample`, which began at `epoch`; `stream` is that of its scene's radar, whose tags
/// become the sample's.
///
/// # Errors
/// If there is no such stream.
pub fn of_sample(
    sample: &Sample,
    epoch: BridgeTime,
    stream: &align::Settings,
    settings: &Settings,
) -> Result<Frames, AlignError> {
    let radar = &stream.radar;
    let gate = radar.processing.gate;
    let passage =
        Passage::new(epoch, align::Settings { tags: sample.epcs.clone(), ..stream.clone() }, settings)?;
    let channels = sample.channels.iter().copied();
    let fill = |number: usize, frame: &mut RadarFrame| {
        let maps = &sample.frames[number];
        let codes = maps.range_doppler.iter().copied();
        put_map(&mut frame.range_doppler, gate, sample.loops, level::SCALE, codes);
        let codes = maps.range_time.iter().copied();
        put_map(&mut frame.range_time, gate, sample.columns, level::SCALE, codes);
        put_moving(frame, &radar.profile, maps.moving_cells, maps.covariance.iter().copied());
    };
    Ok(passage.pass(channels, sample.reads.iter().cloned(), sample.frames.len(), fill))
}

/// Makes `map` one with these codes, row by row, in its own memory.
pub(super) fn put_map(
    map: &mut Option<HeatMap>,
    gate: RangeGate,
    columns: usize,
    scale: LogScale,
    codes: impl Iterator<Item = u8>,
) {
    let map = map.get_or_insert_with(|| HeatMap {
        gate,
        columns,
        scale,
        codes: Vec::new(),
        arrived: vec![true; gate.bins.into()],
    });
    map.codes.clear();
    map.codes.extend(codes);
}

/// Says in `frame` what moved in it: how many cells, and their covariance, packed as on the wire.
pub(super) fn put_moving(
    frame: &mut RadarFrame,
    profile: &RadarProfile,
    moving_cells: u32,
    packed: impl Iterator<Item = f32>,
) {
    let (antennas, packed) = (profile.virtual_count() as u8, packed.collect());
    frame.covariance = Some(Covariance { frame: 0, antennas, packed });
    frame.info = Some(FrameInfo {
        profile: profile.fingerprint(),
        chirps: profile.chirps_per_frame(),
        moving_cells,
        ..FrameInfo::default()
    });
}

/// A sample on its way through a stream.
pub(super) struct Passage {
    epoch: BridgeTime,
    period_us: u64,
    stream: FrameStream,
    features: FrameFeatures,
    frames: Frames,
}

impl Passage {
    /// Of a sample that begins at `epoch`, whose tags are the stream's.
    pub(super) fn new(
        epoch: BridgeTime,
        stream: align::Settings,
        settings: &Settings,
    ) -> Result<Self, AlignError> {
        Ok(Self {
            epoch,
            period_us: stream.radar.profile.frame_period_us.into(),
            features: settings.frame_features(&stream.radar),
            frames: Frames::new(settings.points, stream.tags.len(), settings.antennas),
            stream: FrameStream::new(stream)?,
        })
    }

    /// Passes reads, which are in the order of time, on the reader's `channels`, and `count` frames, of which `fill` makes one
    /// after the other in the same memory.
    pub(super) fn pass(
        mut self,
        channels: impl Iterator<Item = Kilohertz>,
        reads: impl Iterator<Item = TagRead>,
        count: usize,
        mut fill: impl FnMut(usize, &mut RadarFrame),
    ) -> Frames {
        self.stream.push_hop_table(&HopTable { table: 1, channels: channels.collect() });
        let mut reads = reads.peekable();
        let mut frame = RadarFrame::default();
        for number in 0..count {
            let begin = self.epoch.after(number as u64 * self.period_us);
            while let Some(read) = reads.next_if(|read| read.time.after(REPORTED_US) <= begin) {
                self.read(read);
            }
            fill(number, &mut frame);
            (frame.frame, frame.time) = (number as u32, begin);
            self.stream.push_frame(&frame);
        }
        reads.for_each(|read| self.read(read));
        self.stream.finish();
        self.collect();
        self.frames
    }

    fn read(&mut self, read: TagRead) {
        let sent = read.time.after(REPORTED_US);
        self.stream.push_reads(&[read], sent);
        self.stream.advance(sent);
        self.collect();
    }

    /// Takes the frames that are complete. Those of the lead-in only tell how strong the tags usually are.
    fn collect(&mut self) {
        while let Some(frame) = self.stream.next() {
            if frame.begin >= self.epoch {
                self.frames.push(self.features.frame(&frame));
            } else {
                self.features.watch(&frame);
            }
            self.stream.recycle(frame);
        }
    }
}
