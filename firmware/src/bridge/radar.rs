//! Raw samples to packets.

use core::borrow::BorrowMut;

use num_complex::Complex;
use rfhoi_shared::config::{ConfigError, RadarConfig};
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

/// The half that works as chirps arrive: reassembly and range FFT into a cube. `CHIRP` bounds the bytes of a chirp.
#[derive(Debug)]
pub struct Capture<const CHIRP: usize> {
    reassembly: Reassembly<CHIRP>,
    range: RangeStage,
    started: BridgeTime,
    clipped: u32,
}

impl<const CHIRP: usize> Capture<CHIRP> {
    /// A capture with a configuration that is valid, or `None` where its chirps are longer than `CHIRP`.
    pub fn new(config: &RadarConfig) -> Option<Self> {
        let mut range = RangeStage::new();
        range.configure(&config.profile, config.processing.gate);
        let reassembly = Reassembly::new(&config.profile)?;
        Some(Self { reassembly, range, started: BridgeTime::default(), clipped: 0 })
    }

    /// Takes a UDP payload that arrived at `now`; `on_frame` is called with the cube of a frame that it completed, and
    /// must leave a cube of the same shape.
    pub fn push<'m>(
        &mut self,
        now: BridgeTime,
        datagram: &[u8],
        cube: &mut Cube<'m>,
        on_frame: impl FnMut(&mut Cube<'m>, FrameDone),
    ) {
        let Self { reassembly, range, started, clipped } = self;
        reassembly.push(datagram, chirps_into(cube, range, now, started, clipped, on_frame));
    }

    /// Ends the frame under way, as when the radar stops.
    pub fn finish<'m>(
        &mut self,
        now: BridgeTime,
        cube: &mut Cube<'m>,
        on_frame: impl FnMut(&mut Cube<'m>, FrameDone),
    ) {
        let Self { reassembly, range, started, clipped } = self;
        reassembly.finish(chirps_into(cube, range, now, started, clipped, on_frame));
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

fn chirps_into<'m>(
    cube: &mut Cube<'m>,
    range: &mut RangeStage,
    now: BridgeTime,
    started: &mut BridgeTime,
    clipped: &mut u32,
    mut on_frame: impl FnMut(&mut Cube<'m>, FrameDone),
) -> impl FnMut(Event<'_>) {
    move |event| match event {
        Event::FrameStart { .. } => {
            *started = now;
            *clipped = 0;
            cube.clear();
        }
        // A chirp with a hole is worth nothing: a step in its samples spreads over all range bins.
        Event::Chirp { intact: false, .. } => {}
        Event::Chirp { index, bytes, intact: true } => {
            *clipped = clipped.saturating_add(range.chirp(index, bytes, cube));
        }
        Event::FrameEnd { frame, chirps_lost } => {
            on_frame(cube, FrameDone { frame, time: *started, last: now, chirps_lost, clipped: *clipped });
        }
        Event::Restarted | Event::FramesLost(_) => {}
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
pub struct RadarPath<'m, const CHIRP: usize> {
    capture: Capture<CHIRP>,
    mapping: Mapping,
    cube: Cube<'m>,
}

impl<'m, const CHIRP: usize> RadarPath<'m, CHIRP> {
    /// A path with `memory` for one gated cube.
    ///
    /// # Errors
    /// What is wrong with the configuration, also where its cube or chirps do not fit this bridge.
    pub fn new(config: &RadarConfig, memory: &'m mut [Complex<i16>]) -> Result<Self, ConfigError> {
        let available = core::mem::size_of_val(memory) as u32;
        config.validate(available)?;
        let mut cube = Cube::new(memory);
        let too_large = ConfigError::CubeTooLarge {
            needed: config.profile.cube_bytes(config.processing.gate),
            available,
        };
        if !cube.reshape(CubeShape::of(config)) {
            return Err(too_large);
        }
        let capture = Capture::new(config).ok_or(ConfigError::ChirpTooLarge {
            needed: config.profile.chirp_bytes(),
            available: CHIRP as u32,
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
