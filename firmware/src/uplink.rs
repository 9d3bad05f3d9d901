//! Messages to packets, and rows of maps to as few packets as hold them.

use heapless::Vec;
use rfhoi_shared::radar::RangeGate;
use rfhoi_shared::tag::TagRead;
use rfhoi_shared::units::BridgeTime;
use rfhoi_shared::wire::{
    self, LogScale, MAX_MAP_BYTES, MAX_PACKET, MAX_READS, MapKind, MapRows, Message, Sequencer, Stream,
};

use crate::dsp::level;

/// Numbers and encodes messages. Whoever sends a stream owns one; streams are numbered apart.
#[derive(Debug)]
pub struct Uplink {
    sequencer: Sequencer,
    buffer: [u8; MAX_PACKET],
    unsent: u32,
}

impl Uplink {
    /// An uplink that has just started; `boot` should differ from its last start.
    pub fn new(boot: u16) -> Self {
        Self { sequencer: Sequencer::new(boot), buffer: [0; MAX_PACKET], unsent: 0 }
    }

    /// Encodes `message` and hands the packet to `send`, which says whether it took it.
    pub fn send(
        &mut self,
        time: BridgeTime,
        message: Message<'_>,
        mut send: impl FnMut(Stream, &[u8]) -> bool,
    ) {
        let stream = message.stream();
        let header = self.sequencer.header(time, stream);
        let taken = wire::encode(&header, &message, &mut self.buffer).is_ok_and(|bytes| send(stream, bytes));
        self.unsent = self.unsent.wrapping_add(u32::from(!taken));
    }

    /// Packets that were not taken; the host sees them as lost too.
    pub fn unsent(&self) -> u32 {
        self.unsent
    }
}

/// Collects the rows of one map until a packet is full.
#[derive(Debug)]
pub struct MapPacker {
    map: MapKind,
    frame: u32,
    gate: RangeGate,
    first_row: u16,
    columns: u16,
    scale: LogScale,
    codes: Vec<u8, MAX_MAP_BYTES>,
}

impl MapPacker {
    /// A packer of `map` that has not begun a frame.
    pub const fn new(map: MapKind) -> Self {
        let gate = RangeGate { first: 0, bins: 0 };
        Self { map, frame: 0, gate, first_row: 0, columns: 0, scale: level::SCALE, codes: Vec::new() }
    }

    /// Begins a frame whose rows have `columns` codes on `scale`, at most [`MAX_MAP_BYTES`].
    pub fn begin(&mut self, frame: u32, gate: RangeGate, columns: u16, scale: LogScale) {
        self.frame = frame;
        self.gate = gate;
        self.first_row = 0;
        self.columns = columns;
        self.scale = scale;
        self.codes.clear();
    }

    /// Adds the next row, filled up with zeros; calls `emit` with what is full.
    pub fn row(&mut self, codes: impl Iterator<Item = u8>, emit: impl FnOnce(Message<'_>)) {
        if self.codes.len() + usize::from(self.columns) > MAX_MAP_BYTES {
            self.flush(emit);
        }
        let filled = self.codes.len();
        // There is room, by the check above and the bound on columns.
        let _ = self.codes.resize(filled + usize::from(self.columns), 0);
        let mut places = self.codes.iter_mut().skip(filled);
        // A loop inside the iterator: rows are chained of two halves.
        codes.for_each(|code| {
            if let Some(place) = places.next() {
                *place = code;
            }
        });
    }

    /// Calls `emit` with what is left.
    pub fn flush(&mut self, emit: impl FnOnce(Message<'_>)) {
        let rows = self.codes.len().checked_div(self.columns.into()).unwrap_or(0);
        if rows > 0 {
            emit(Message::MapRows(MapRows {
                map: self.map,
                frame: self.frame,
                gate: self.gate,
                first_row: self.first_row,
                columns: self.columns,
                scale: self.scale,
                codes: &self.codes,
            }));
        }
        self.first_row += rows as u16;
        self.codes.clear();
    }
}

/// Collects tag reads until a packet is full or the oldest read has waited.
#[derive(Debug, Default)]
pub struct ReadPacker {
    reads: Vec<TagRead, MAX_READS>,
    since: BridgeTime,
}

impl ReadPacker {
    /// How long a read may wait for others, us: a tenth of a radar frame.
    pub const PATIENCE_US: u64 = 10_000;

    /// Adds a read; calls `emit` when a packet is full.
    pub fn push(&mut self, now: BridgeTime, read: TagRead, emit: impl FnOnce(Message<'_>)) {
        if self.reads.is_empty() {
            self.since = now;
        }
        // Never full here: it is emptied as soon as it is.
        let _ = self.reads.push(read);
        if self.reads.is_full() {
            self.flush(emit);
        }
    }

    /// When [`Self::tick`] is next due.
    pub fn deadline(&self) -> Option<BridgeTime> {
        (!self.reads.is_empty()).then(|| self.since.after(Self::PATIENCE_US))
    }

    /// Calls `emit` with reads that have waited long enough.
    pub fn tick(&mut self, now: BridgeTime, emit: impl FnOnce(Message<'_>)) {
        if self.deadline().is_some_and(|due| due <= now) {
            self.flush(emit);
        }
    }

    /// Calls `emit` with what is left.
    pub fn flush(&mut self, emit: impl FnOnce(Message<'_>)) {
        if !self.reads.is_empty() {
            emit(Message::Tags(core::mem::take(&mut self.reads)));
        }
    }
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use rfhoi_shared::tag::Epc;
    use rfhoi_shared::units::{AntennaPort, CentiDbm, ChannelIndex, PhaseCode};
    use rfhoi_shared::wire::Packet;

    use super::*;

    #[test]
    fn a_map_is_cut_between_rows_and_loses_none() {
        let gate = RangeGate { first: 3, bins: 72 };
        let mut packer = MapPacker::new(MapKind::RangeDoppler);
        let mut got: Vec<u8> = Vec::new();
        let mut packets = 0;
        let mut take = |message: Message<'_>| {
            let Message::MapRows(rows) = message else { panic!("only maps come") };
            assert_eq!(usize::from(rows.first_row) * 64, got.len());
            assert_eq!((rows.frame, rows.gate, rows.columns), (9, gate, 64));
            assert!(rows.codes.len().is_multiple_of(64));
            got.extend(rows.codes);
            packets += 1;
        };
        packer.begin(9, gate, 64, level::SCALE);
        for row in 0..72u8 {
            packer.row((0..60).map(|i| row ^ i), &mut take);
        }
        packer.flush(&mut take);
        packer.flush(|_| panic!("nothing is left"));
        assert_eq!(packets, 4);
        let want = (0..72u8).flat_map(|row| (0..60).map(move |i| row ^ i).chain([0; 4]));
        assert!(want.eq(got));
    }

    #[test]
    fn reads_wait_for_others_but_not_long() {
        let read = TagRead {
            time: BridgeTime(0),
            epc: Epc::new(&[1; 12]).unwrap(),
            antenna: AntennaPort(1),
            channel: ChannelIndex(1),
            phase: Some(PhaseCode(1)),
            rssi: CentiDbm(-5000),
            doppler: None,
        };
        let mut sizes = Vec::new();
        let mut take = |message: Message<'_>| {
            let Message::Tags(reads) = message else { panic!("only reads come") };
            sizes.push(reads.len());
        };
        let mut packer = ReadPacker::default();
        for i in 0..MAX_READS as u64 + 3 {
            packer.push(BridgeTime(i), read.clone(), &mut take);
        }
        let due = packer.deadline().unwrap();
        packer.tick(BridgeTime(due.0 - 1), &mut take);
        packer.tick(due, &mut take);
        assert_eq!(packer.deadline(), None);
        packer.tick(due, &mut take);
        assert_eq!(sizes, [MAX_READS, 3]);
    }

    #[test]
    fn packets_that_are_not_taken_are_counted_and_numbered() {
        let mut uplink = Uplink::new(1);
        let mut sequences = Vec::new();
        for i in 0..4 {
            uplink.send(BridgeTime(i), Message::Tags(Default::default()), |stream, bytes| {
                assert_eq!(stream, Stream::Tags);
                sequences.push(Packet::decode(bytes).unwrap().header.sequence);
                i % 2 == 0
            });
        }
        assert_eq!((sequences, uplink.unsent()), (Vec::from([0, 1, 2, 3]), 2));
    }
}
