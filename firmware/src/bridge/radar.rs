//! Raw samples to packets.

use core::borrow::BorrowMut;

use num_complex::Complex;
use rfhoi_shared::config::{ConfigError, RadarConfig};
use rfhoi_shared::radar::MAX_GATE_BINS;
use rfhoi_shared::units::BridgeTime;
use rfhoi_shared::wire::{Covariance, DatagramCounts, FrameCounts, FrameInfo, MapKind, Message, Stream};

use crate::dca1000::{Event, Reassembly};
use crate::dsp::{Cube, CubeShape, DopplerStage, RangeStage, level};
use crate::uplink::{MapPacker, Uplink};

/// A frame whose chirps are all in the cube or lost.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct FrameDone {
    /// Number of the frame.
    pub frame: u32,
    /// When its first datagram came.
    pub time: BridgeTime,
    /// When its last datagram came.
    pub last: BridgeTime,
    /// Chirps of which bytes were lost.
    pub chirps_lost: u32,
    /// Words at the ADC's limits.
    pub clipped: u32,
}

/// The half that works as chirps arrive: reassembly and range FFT into a cube. `ROW` bounds the bytes of a chirp of one
/// receiver.
#[derive(Debug)]
pub struct Capture<const ROW: usize> {
    reassembly: Reassembly<ROW>,
    filling: Filling,
}

/// The frame whose rows go into the cube.
#[derive(Debug)]
struct Filling {
    range: RangeStage,
    started: BridgeTime,
    /// Words at the ADC's limits, of the frame and of what came before the chirp under way.
    clipped: u32,
    clipped_before: u32,
}

impl<const ROW: usize> Capture<ROW> {
    /// A capture with a configuration that is valid, or `None` where its rows are longer than `ROW`.
    pub fn new(config: &RadarConfig) -> Option<Self> {
        let mut range = RangeStage::new();
        range.configure(&config.profile, config.processing.gate);
        let reassembly = Reassembly::new(&config.profile)?;
        let filling = Filling { range, started: BridgeTime::default(), clipped: 0, clipped_before: 0 };
        Some(Self { reassembly, filling })
    }

    /// Takes a UDP payload that arrived at `now`; `on_frame` is called with the cube of a frame that it completed, and
    /// must leave a cube of the same shape, or [`Cube::nothing`]. `C` is a cube or a borrow of one.
    pub fn push<'m, C: BorrowMut<Cube<'m>>>(
        &mut self,
        now: BridgeTime,
        datagram: &[u8],
        cube: &mut C,
        mut on_frame: impl FnMut(&mut C, FrameDone),
    ) {
        let Self { reassembly, filling } = self;
        reassembly.push(datagram, |event| filling.take(now, event, cube, &mut on_frame));
    }

    /// Ends the frame under way, as when the radar stops.
    pub fn finish<'m, C: BorrowMut<Cube<'m>>>(
        &mut self,
        now: BridgeTime,
        cube: &mut C,
        mut on_frame: impl FnMut(&mut C, FrameDone),
    ) {
        let Self { reassembly, filling } = self;
        reassembly.finish(|event| filling.take(now, event, cube, &mut on_frame));
    }

    /// Whether no frame is under way.
    pub fn is_between_frames(&self) -> bool {
        self.reassembly.frame_bytes_done() == 0
    }

    /// Counts of datagrams.
    pub fn datagrams(&self) -> DatagramCounts {
        self.reassembly.datagrams()
    }

    /// Counts of frames.
    pub fn frames(&self) -> FrameCounts {
        self.reassembly.frames()
    }
}

impl Filling {
    fn take<'m, C: BorrowMut<Cube<'m>>>(
        &mut self,
        now: BridgeTime,
        event: Event<'_>,
        cube: &mut C,
        on_frame: &mut impl FnMut(&mut C, FrameDone),
    ) {
        match event {
            Event::FrameStart { .. } => {
                self.started = now;
                self.clipped = 0;
                cube.borrow_mut().clear();
            }
            Event::Row { chirp, receiver, bytes, intact } => {
                if receiver == 0 {
                    self.clipped_before = self.clipped;
                }
                if intact {
                    self.clipped = self.clipped.saturating_add(self.range.row(
                        chirp,
                        receiver,
                        bytes,
                        cube.borrow_mut(),
                    ));
                } else {
                    // A chirp with a hole is worth nothing: the receivers are compared with each other.
                    self.range.take_back(chirp, cube.borrow_mut());
                    self.clipped = self.clipped_before;
                }
            }
            Event::FrameEnd { frame, chirps_lost } => {
                let Self { started, clipped, .. } = *self;
                on_frame(cube, FrameDone { frame, time: started, last: now, chirps_lost, clipped });
            }
            Event::Restarted | Event::FramesLost(_) => {}
        }
    }
}

/// The half that works on a complete frame: Doppler stage and packets.
///
/// [`Self::begin`], [`Self::range_bin`] until it returns false, then [`Self::finish`]: a scheduler may do something else
/// in between. `D` is the Doppler stage or a borrow of it.
#[derive(Debug)]
pub struct Mapping<D = DopplerStage> {
    doppler: D,
    range_doppler: MapPacker,
    range_time: MapPacker,
    config: RadarConfig,
    profile: u32,
    /// The frame at hand, and its next range bin.
    done: FrameDone,
    bin: usize,
}

impl<D: BorrowMut<DopplerStage>> Mapping<D> {
    /// A mapping with a configuration that is valid.
    pub fn new(config: &RadarConfig, mut doppler: D) -> Self {
        doppler.borrow_mut().configure(config);
        Self {
            doppler,
            range_doppler: MapPacker::new(MapKind::RangeDoppler),
            range_time: MapPacker::new(MapKind::RangeTime),
            profile: config.profile.fingerprint(),
            config: config.clone(),
            done: FrameDone::default(),
            bin: 0,
        }
    }

    /// Begins with a frame.
    pub fn begin(&mut self, cube: &Cube<'_>, done: FrameDone) {
        let RadarConfig { profile, processing, .. } = &self.config;
        self.range_doppler.begin(done.frame, processing.gate, profile.loops, level::SCALE);
        self.range_time.begin(done.frame, processing.gate, processing.range_time_columns, level::SCALE);
        self.doppler.borrow_mut().begin(cube);
        self.done = done;
        self.bin = 0;
    }

    /// Computes the next range bin and sends what is full. Returns whether more bins follow.
    pub fn range_bin(
        &mut self,
        cube: &Cube<'_>,
        uplink: &mut Uplink,
        send: &mut impl FnMut(Stream, &[u8]) -> bool,
    ) -> bool {
        let Self { doppler, range_doppler, range_time, done: FrameDone { time, .. }, bin, .. } = self;
        if *bin < cube.shape().bins {
            let row = doppler.borrow_mut().range_bin(cube, *bin);
            range_doppler.row(row.doppler().map(level::code), |m| uplink.send(*time, m, &mut *send));
            range_time.row(row.time.iter().copied().map(level::code), |m| uplink.send(*time, m, &mut *send));
            *bin += 1;
        }
        *bin < cube.shape().bins
    }

    /// Sends the rest; `now` is the time at its end.
    pub fn finish(
        &mut self,
        now: BridgeTime,
        uplink: &mut Uplink,
        send: &mut impl FnMut(Stream, &[u8]) -> bool,
    ) {
        let Self { doppler, range_doppler, range_time, config, profile, done, .. } = self;
        let FrameDone { frame, time, last, chirps_lost, clipped } = *done;
        range_doppler.flush(|m| uplink.send(time, m, &mut *send));
        range_time.flush(|m| uplink.send(time, m, &mut *send));
        let moving = doppler.borrow_mut().finish();
        let covariance = Covariance {
            frame,
            antennas: config.profile.virtual_count() as u8,
            packed: moving.covariance().collect(),
        };
        uplink.send(time, Message::Covariance(covariance), &mut *send);
        let info = FrameInfo {
            frame,
            profile: *profile,
            chirps: config.profile.chirps_per_frame(),
            chirps_lost,
            clipped,
            moving_cells: moving.cells(),
            latency_us: u32::try_from(now.since(last)).unwrap_or(u32::MAX),
        };
        uplink.send(time, Message::Frame(info), &mut *send);
    }

    /// Turns a frame into packets at one go, at `now`.
    pub fn frame(
        &mut self,
        now: BridgeTime,
        cube: &Cube<'_>,
        done: FrameDone,
        uplink: &mut Uplink,
        send: &mut impl FnMut(Stream, &[u8]) -> bool,
    ) {
        self.begin(cube, done);
        while self.range_bin(cube, uplink, send) {}
        self.finish(now, uplink, send);
    }
}

/// Both halves on one cube: datagrams in, packets out.
#[derive(Debug)]
pub struct RadarPath<'m, const ROW: usize> {
    capture: Capture<ROW>,
    mapping: Mapping,
    cube: Cube<'m>,
}

impl<'m, const ROW: usize> RadarPath<'m, ROW> {
    /// A path with `memory` for one gated cube.
    ///
    /// # Errors
    /// What is wrong with the configuration, also where its cube or chirps do not fit this bridge.
    pub fn new(config: &RadarConfig, memory: &'m mut [Complex<i16>]) -> Result<Self, ConfigError> {
        let available = core::mem::size_of_val(memory) as u32;
        config.validate(available)?;
        let gate = config.processing.gate;
        if usize::from(gate.bins) > MAX_GATE_BINS {
            return Err(ConfigError::Gate(gate));
        }
        let mut cube = Cube::new(memory);
        let too_large = ConfigError::CubeTooLarge {
            needed: config.profile.cube_bytes(config.processing.gate),
            available,
        };
        if !cube.reshape(CubeShape::of(config)) {
            return Err(too_large);
        }
        let capture = Capture::new(config).ok_or(ConfigError::ChirpTooLarge {
            needed: config.profile.row_bytes(),
            available: ROW as u32,
        })?;
        Ok(Self { capture, mapping: Mapping::new(config, DopplerStage::new()), cube })
    }

    /// Takes a UDP payload that arrived at `now` and sends the packets of a frame that it completed.
    pub fn push(
        &mut self,
        now: BridgeTime,
        datagram: &[u8],
        uplink: &mut Uplink,
        mut send: impl FnMut(Stream, &[u8]) -> bool,
    ) {
        let Self { capture, mapping, cube } = self;
        capture.push(now, datagram, cube, |cube, done| mapping.frame(now, cube, done, uplink, &mut send));
    }

    /// Ends the frame under way, as when the radar stops.
    pub fn finish(
        &mut self,
        now: BridgeTime,
        uplink: &mut Uplink,
        mut send: impl FnMut(Stream, &[u8]) -> bool,
    ) {
        let Self { capture, mapping, cube } = self;
        capture.finish(now, cube, |cube, done| mapping.frame(now, cube, done, uplink, &mut send));
    }

    /// Counts of datagrams.
    pub fn datagrams(&self) -> DatagramCounts {
        self.capture.datagrams()
    }

    /// Counts of frames.
    pub fn frames(&self) -> FrameCounts {
        self.capture.frames()
    }
}

#[cfg(test)]
mod tests {
    use std::vec;
    use std::vec::Vec;

    use rfhoi_shared::config::{Processing, RadarInput};
    use rfhoi_shared::radar::{DCA1000_PAYLOAD, RadarProfile};
    use rfhoi_shared::units::Metres;

    use super::*;
    use crate::dca1000::Datagram;

    #[test]
    fn a_chirp_with_a_hole_leaves_nothing_behind() {
        let profile = RadarProfile::bridge();
        let processing = Processing::with_gate(&profile, profile.gate_to(Metres(1.0)));
        let config = RadarConfig { profile, input: RadarInput::Uart, processing };
        let shape = CubeShape::of(&config);
        let mut memory = vec![Complex::default(); shape.cells()];
        let mut cube = Cube::new(&mut memory);
        assert!(cube.reshape(shape));
        let mut capture = Capture::<512>::new(&config).unwrap();
        // All words are at the ADC's limits, so the chirps that count can be counted.
        let chirp_words = config.profile.chirp_bytes() / 2;
        let frame = i16::MAX.to_le_bytes().repeat((chirp_words * config.profile.chirps_per_frame()) as usize);
        let datagrams: Vec<_> = (0..)
            .zip(frame.chunks(DCA1000_PAYLOAD as usize))
            .map(|(i, part)| {
                [&Datagram::header(i + 1, u64::from(i) * u64::from(DCA1000_PAYLOAD)), part].concat()
            })
            .collect();
        let mut frames = 0;
        for lost in 0..datagrams.len() - 1 {
            // Each frame begins as after the recorder's start.
            for (_, datagram) in datagrams.iter().enumerate().filter(|&(i, _)| i != lost) {
                capture.push(BridgeTime(0), datagram, &mut cube, |cube, done| {
                    let stored = |v| cube.scales(v).map(|s| s.is_some()).collect::<Vec<_>>();
                    for v in 0..shape.virtuals {
                        assert_eq!(
                            stored(v),
                            stored(v / 4 * 4),
                            "receivers of a chirp come or are lost together"
                        );
                    }
                    let chirps = [0, 4, 8].map(|v| stored(v).iter().filter(|s| **s).count() as u32);
                    let came: u32 = chirps.iter().sum();
                    assert_eq!(came + done.chirps_lost, config.profile.chirps_per_frame());
                    assert_eq!(done.clipped, came * chirp_words);
                    frames += u32::from(done.chirps_lost > 0);
                });
            }
        }
        assert_eq!(frames as usize, datagrams.len() - 1);
    }
}
