//! Puts TCP segments back in order, each direction of a connection by itself (RFC 9293).
//!
//! In: segments in the order of capture. Out: pieces of the byte streams. Bounds: [`MAX_FLOWS`] directions, and of each
//! [`MAX_PENDING_BYTES`] in [`MAX_PENDING_SEGMENTS`] segments that wait for bytes before them; past that the hole is
//! given up, counted, and the stream goes on behind it.

use std::collections::BTreeMap;
use std::net::SocketAddrV4;

use super::{Counts, Protocol, Record};

/// Directions of connections at a time; the one silent for longest makes room.
const MAX_FLOWS: usize = 64;
/// Segments of one direction that wait.
const MAX_PENDING_SEGMENTS: usize = 256;
/// Bytes of one direction that wait.
const MAX_PENDING_BYTES: usize = 256 * 1024;
/// Distance from the expected sequence number that no window of these devices reaches: what is farther away is another
/// connection, whose start was not captured.
const MAX_DISTANCE: u32 = 1 << 20;

/// One direction of a connection.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Flow {
    pub(super) source: SocketAddrV4,
    pub(super) destination: SocketAddrV4,
}

impl Flow {
    fn reverse(self) -> Self {
        Self { source: self.destination, destination: self.source }
    }
}

/// What matters of a segment.
#[derive(Debug, Clone, Copy)]
pub(super) struct Segment<'a> {
    pub(super) sequence: u32,
    pub(super) syn: bool,
    pub(super) rst: bool,
    pub(super) payload: &'a [u8],
}

/// Bytes that come next in a direction.
pub(super) struct Piece<'a> {
    continues: bool,
    bytes: &'a [u8],
}

impl Piece<'_> {
    pub(super) fn record(&self, flow: Flow, time_us: u64) -> Record {
        Record {
            time_us,
            source: flow.source,
            destination: flow.destination,
            protocol: Protocol::Tcp { continues: self.continues },
            payload: self.bytes.to_vec(),
        }
    }
}

/// Takes pieces of streams.
pub(super) type Sink<'s> = dyn FnMut(Flow, Piece<'_>) + 's;

/// All directions of all connections.
#[derive(Default)]
pub(super) struct Streams {
    flows: BTreeMap<Flow, Direction>,
    clock: u64,
}

impl Streams {
    /// Takes a segment in and gives what has become complete to `sink`.
    pub(super) fn push(
        &mut self,
        flow: Flow,
        segment: Segment<'_>,
        counts: &mut Counts,
        sink: &mut Sink<'_>,
    ) {
        self.clock += 1;
        if segment.rst {
            for flow in [flow, flow.reverse()] {
                if let Some(mut ended) = self.flows.remove(&flow) {
                    ended.give_up_all(flow, counts, sink);
                }
            }
            return;
        }
        if !self.flows.contains_key(&flow) && self.flows.len() == MAX_FLOWS {
            let silent =
                self.flows.iter().min_by_key(|(_, direction)| direction.last_used).map(|(flow, _)| *flow);
            if let Some((flow, mut direction)) = silent.and_then(|f| self.flows.remove_entry(&f)) {
                direction.give_up_all(flow, counts, sink);
            }
        }
        let direction = self.flows.entry(flow).or_insert_with(|| Direction::starting_at(segment.sequence));
        direction.last_used = self.clock;
        if segment.syn {
            // A SYN takes one number of the sequence (RFC 9293, 3.4); the same one again is a retransmission.
            if direction.syn != Some(segment.sequence) {
                direction.give_up_all(flow, counts, sink);
                direction.restart(segment.sequence.wrapping_add(1));
                direction.syn = Some(segment.sequence);
            }
        } else {
            direction.push(flow, segment, counts, sink);
        }
    }

    /// Gives out what still waits for bytes that never came.
    pub(super) fn end(&mut self, counts: &mut Counts, sink: &mut Sink<'_>) {
        for (flow, mut direction) in std::mem::take(&mut self.flows) {
            direction.give_up_all(flow, counts, sink);
        }
    }
}

struct Direction {
    /// Sequence number of the next byte.
    next: u32,
    /// Sequence number of the SYN, where it was captured.
    syn: Option<u32>,
    /// Whether the next byte follows the last one given out.
    continues: bool,
    pending: Vec<(u32, Vec<u8>)>,
    pending_bytes: usize,
    last_used: u64,
}

impl Direction {
    fn starting_at(next: u32) -> Self {
        Self { next, syn: None, continues: false, pending: Vec::new(), pending_bytes: 0, last_used: 0 }
    }

    fn restart(&mut self, next: u32) {
        *self = Self { last_used: self.last_used, ..Self::starting_at(next) };
    }

    /// Distance of a sequence number from the next byte's, negative for bytes already given out.
    fn distance(&self, sequence: u32) -> i32 {
        sequence.wrapping_sub(self.next) as i32
    }

    fn push(&mut self, flow: Flow, segment: Segment<'_>, counts: &mut Counts, sink: &mut Sink<'_>) {
        let Segment { sequence, payload, .. } = segment;
        if payload.is_empty() {
            return;
        }
        counts.segments += 1;
        if self.distance(sequence).unsigned_abs() > MAX_DISTANCE {
            counts.resynchronised += 1;
            self.give_up_all(flow, counts, sink);
            self.restart(sequence);
        }
        if self.distance(sequence) > 0 {
            counts.out_of_order += 1;
            self.pending_bytes += payload.len();
            self.pending.push((sequence, payload.to_vec()));
            while self.pending.len() > MAX_PENDING_SEGMENTS || self.pending_bytes > MAX_PENDING_BYTES {
                self.give_up_hole(flow, counts, sink);
            }
            return;
        }
        if self.distance(sequence) < 0 {
            counts.retransmitted += 1;
        }
        self.give_out(flow, sequence, payload, sink);
        self.give_out_pending(flow, sink);
    }

    /// Gives out what of `payload` is new; it must not start after the next byte.
    fn give_out(&mut self, flow: Flow, sequence: u32, payload: &[u8], sink: &mut Sink<'_>) {
        let known = self.distance(sequence).unsigned_abs() as usize;
        let Some(bytes @ [_, ..]) = payload.get(known..) else { return };
        sink(flow, Piece { continues: self.continues, bytes });
        self.continues = true;
        self.next = self.next.wrapping_add(bytes.len() as u32);
    }

    /// Gives out the waiting segments that the next byte has reached.
    fn give_out_pending(&mut self, flow: Flow, sink: &mut Sink<'_>) {
        while let Some(index) = self.pending.iter().position(|(sequence, _)| self.distance(*sequence) <= 0) {
            let (sequence, bytes) = self.pending.swap_remove(index);
            self.pending_bytes -= bytes.len();
            self.give_out(flow, sequence, &bytes, sink);
        }
    }

    /// Goes on at the first waiting segment.
    fn give_up_hole(&mut self, flow: Flow, counts: &mut Counts, sink: &mut Sink<'_>) {
        let first = self.pending.iter().map(|(sequence, _)| *sequence).min_by_key(|s| self.distance(*s));
        if let Some(sequence) = first {
            counts.missing_bytes += u64::from(self.distance(sequence).unsigned_abs());
            self.next = sequence;
            self.continues = false;
            self.give_out_pending(flow, sink);
        }
    }

    fn give_up_all(&mut self, flow: Flow, counts: &mut Counts, sink: &mut Sink<'_>) {
        while !self.pending.is_empty() {
            self.give_up_hole(flow, counts, sink);
        }
    }
}
