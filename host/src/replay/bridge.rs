//! The bridge's logic in this process: what the devices send goes in, packets come out.

use num_complex::Complex;
use rfhoi_firmware::bridge::{RadarPath, UartPath};
use rfhoi_firmware::uplink::{ReadPacker, Uplink};
use rfhoi_shared::config::RadarConfig;
use rfhoi_shared::tag::TagRead;
use rfhoi_shared::units::BridgeTime;
use rfhoi_shared::wire::{DatagramCounts, FrameCounts, HopTable, Message, Stream};

use super::ReplayError;
use crate::inspect::{MAX_ROW, MAX_TLV_FRAME};

enum Radar<'a> {
    /// Not begun; memory for one cube.
    Idle(&'a mut [Complex<i16>]),
    Raw(Box<RadarPath<'a, MAX_ROW>>),
    Uart(Box<UartPath<MAX_TLV_FRAME>>),
}

/// A bridge that has just started.
pub(super) struct Bridge<'a> {
    radar: Radar<'a>,
    reads: ReadPacker,
    uplink: Uplink,
    emit: &'a mut dyn FnMut(BridgeTime, &[u8]),
}

impl<'a> Bridge<'a> {
    /// A bridge with memory for one `cube`, which hands its packets to `emit` with the time at which it sends them.
    pub(super) fn new(cube: &'a mut [Complex<i16>], emit: &'a mut dyn FnMut(BridgeTime, &[u8])) -> Self {
        Self { radar: Radar::Idle(cube), reads: ReadPacker::default(), uplink: Uplink::new(0), emit }
    }

    pub(super) fn use_raw_samples(&mut self, config: &RadarConfig) -> Result<(), ReplayError> {
        if let Radar::Idle(cube) = &mut self.radar {
            self.radar = Radar::Raw(Box::new(RadarPath::new(config, std::mem::take(cube))?));
        }
        Ok(())
    }

    pub(super) fn use_uart(&mut self, config: &RadarConfig) -> Result<(), ReplayError> {
        config.validate(u32::MAX)?;
        self.radar = Radar::Uart(Box::new(UartPath::new(config)));
        Ok(())
    }

    /// Radar bytes that arrived at `now`: a datagram, or what a UART gave.
    pub(super) fn radar(&mut self, now: BridgeTime, bytes: &[u8]) {
        let Self { radar, uplink, emit, .. } = self;
        let send = sender(now, emit);
        match radar {
            Radar::Idle(_) => {}
            Radar::Raw(path) => path.push(now, bytes, uplink, send),
            Radar::Uart(path) => path.push(now, bytes, uplink, send),
        }
    }

    pub(super) fn read(&mut self, now: BridgeTime, read: TagRead) {
        let Self { reads, uplink, emit, .. } = self;
        let mut send = |at, m: Message<'_>| uplink.send(at, m, sender(at, emit));
        // As a bridge's timer does, whenever the next read comes.
        if let Some(due) = reads.deadline().filter(|due| *due <= now) {
            reads.tick(due, |m| send(due, m));
        }
        reads.push(now, read, |m| send(now, m));
    }

    pub(super) fn hop_table(&mut self, now: BridgeTime, table: HopTable) {
        self.uplink.send(now, Message::HopTable(table), sender(now, &mut self.emit));
    }

    /// A packet that a bridge had sent when the recording was made.
    pub(super) fn packet(&mut self, now: BridgeTime, bytes: &[u8]) {
        (self.emit)(now, bytes);
    }

    pub(super) fn finish(&mut self, now: BridgeTime) {
        let Self { radar, reads, uplink, emit } = self;
        let mut send = sender(now, emit);
        match radar {
            Radar::Idle(_) => {}
            Radar::Raw(path) => path.finish(now, uplink, &mut send),
            Radar::Uart(path) => path.finish(now, uplink, &mut send),
        }
        reads.flush(|m| uplink.send(now, m, &mut send));
    }

    pub(super) fn counts(&self) -> (DatagramCounts, FrameCounts) {
        match &self.radar {
            Radar::Idle(_) => Default::default(),
            Radar::Raw(path) => (path.datagrams(), path.frames()),
            Radar::Uart(path) => (DatagramCounts::default(), path.frames()),
        }
    }
}

/// A wire that takes every packet.
fn sender(now: BridgeTime, emit: &mut dyn FnMut(BridgeTime, &[u8])) -> impl FnMut(Stream, &[u8]) -> bool {
    move |_, packet| {
        emit(now, packet);
        true
    }
}
