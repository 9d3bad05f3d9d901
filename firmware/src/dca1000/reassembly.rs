//! Datagrams in, rows of chirps out.
//!
//! Frames do not end where datagrams end, so a position in the byte stream is all there is: frame `k` starts at byte
//! `k x frame_bytes`. A datagram that never came leaves a hole; its bytes become zeros and the chirps that they touch
//! are marked, so nothing after a hole is ever shifted. What comes after its place was given up is dropped.
//!
//! What is handed out is a row, one receiver's samples of a chirp: it is shorter than a datagram, so most rows lie in one
//! and are lent from there; only those that straddle two are copied.
//!
//! A datagram is believed if its sequence number and its byte count moved together. The recorder starts again at
//! sequence 1 and byte 0; if that very datagram is lost, a run of datagrams that follow each other, but not the stream,
//! is taken as a restart.

use core::num::NonZeroU64;

use rfhoi_shared::radar::RadarProfile;
use rfhoi_shared::wire::{DatagramCounts, FrameCounts};

use super::datagram::Datagram;

/// Datagrams in a row that follow each other but not the stream, before they become the stream.
const RESTART_RUN: u8 = 16;
/// How many of the latest sequence numbers are remembered, to tell a duplicate from a late datagram.
const REMEMBERED: u32 = u64::BITS;

/// What reassembly says, in the order of the stream.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Event<'a> {
    /// The recorder began anew; a frame under way is ended first.
    Restarted,
    /// So many whole frames are missing.
    FramesLost(u32),
    /// A frame begins.
    FrameStart {
        /// Number of the frame, from 0, growing across restarts.
        frame: u32,
    },
    /// The next row of the frame: all receivers of a chirp, then the next chirp.
    Row {
        /// Number of the chirp in its frame: `loop x slots + slot`.
        chirp: u32,
        /// Number of the receiver among those in use.
        receiver: u32,
        /// The samples; zeros where they were lost.
        bytes: &'a [u8],
        /// Whether all bytes of the chirp came so far. Once it is false it stays so to the end of the chirp, which is then
        /// worth nothing: rows of it that were handed out before are to be taken back.
        intact: bool,
    },
    /// A frame ends.
    FrameEnd {
        /// Number of the frame.
        frame: u32,
        /// Chirps that were not intact.
        chirps_lost: u32,
    },
}

#[derive(Debug, Clone, Copy)]
struct Position {
    sequence: u32,
    byte_count: u64,
}

impl Position {
    /// Where the datagram after `datagram` is expected.
    fn after(datagram: &Datagram<'_>) -> Self {
        let byte_count = datagram.byte_count.wrapping_add(datagram.payload.len() as u64);
        Self {
            sequence: datagram.sequence.wrapping_add(1),
            byte_count: byte_count % Datagram::BYTE_COUNT_MODULUS,
        }
    }

    fn is(&self, datagram: &Datagram<'_>) -> bool {
        self.sequence == datagram.sequence && self.byte_count == datagram.byte_count
    }

    /// Datagrams and bytes from here to `datagram`; negative for one that is behind.
    fn distance_to(&self, datagram: &Datagram<'_>) -> (i32, i64) {
        // Sign-extends the difference modulo 2^48.
        const SPARE: u32 = 16;
        let bytes = (datagram.byte_count.wrapping_sub(self.byte_count) << SPARE) as i64 >> SPARE;
        (datagram.sequence.wrapping_sub(self.sequence) as i32, bytes)
    }
}

/// The state between two datagrams. `ROW` bounds the bytes of a row.
#[derive(Debug)]
pub struct Reassembly<const ROW: usize> {
    row_bytes: u32,
    receivers: u32,
    chirps_per_frame: u32,
    /// Where the next datagram is expected; `None` before the first.
    next: Option<Position>,
    /// Bytes of a full datagram, by which loss is recognised.
    full: u32,
    /// Bit `i`: the datagram `i + 1` before the expected one came.
    seen: u64,
    /// Datagrams that do not follow the stream but each other.
    stray: Option<(Position, u8)>,
    /// Frame, chirp and row under way, and how much of the row is there.
    frame: u32,
    chirp: u32,
    receiver: u32,
    filled: u32,
    in_frame: bool,
    /// Bytes of the chirp under way are lost.
    hole: bool,
    chirps_lost: u32,
    buffer: [u8; ROW],
    datagrams: DatagramCounts,
    frames: FrameCounts,
}

impl<const ROW: usize> Reassembly<ROW> {
    /// Reassembly of `profile`'s chirps, or `None` where a row is longer than `ROW` bytes, or a frame is empty.
    pub fn new(profile: &RadarProfile) -> Option<Self> {
        let (row_bytes, receivers) = (profile.row_bytes(), profile.rx_count() as u32);
        let chirps_per_frame = profile.chirps_per_frame();
        if row_bytes as usize > ROW || [row_bytes, receivers, chirps_per_frame].contains(&0) {
            return None;
        }
        Some(Self {
            row_bytes,
            receivers,
            chirps_per_frame,
            next: None,
            full: 0,
            seen: 0,
            stray: None,
            frame: 0,
            chirp: 0,
            receiver: 0,
            filled: 0,
            in_frame: false,
            hole: false,
            chirps_lost: 0,
            buffer: [0; ROW],
            datagrams: DatagramCounts::default(),
            frames: FrameCounts::default(),
        })
    }

    /// Counts of datagrams.
    pub fn datagrams(&self) -> DatagramCounts {
        self.datagrams
    }

    /// Counts of frames; one under way is not counted.
    pub fn frames(&self) -> FrameCounts {
        self.frames
    }

    /// Bytes of the frame under way that have come or are known lost.
    pub fn frame_bytes_done(&self) -> u32 {
        (self.chirp * self.receivers + self.receiver) * self.row_bytes + self.filled
    }

    fn frame_bytes(&self) -> u32 {
        self.chirps_per_frame * self.receivers * self.row_bytes
    }

    /// Takes one UDP payload.
    pub fn push(&mut self, bytes: &[u8], mut on_event: impl FnMut(Event<'_>)) {
        let Ok(datagram) = Datagram::decode(bytes) else {
            bump(&mut self.datagrams.malformed, 1);
            return;
        };
        match self.next {
            Some(next) if next.is(&datagram) => {}
            Some(next) => match self.place(next, &datagram, &mut on_event) {
                Some(()) => {}
                None => return,
            },
            None => {
                // Joined at any point of the stream, if the datagram's numbers agree with each other.
                let before = u64::from(datagram.sequence.wrapping_sub(1)) * datagram.payload.len() as u64;
                if before % Datagram::BYTE_COUNT_MODULUS != datagram.byte_count
                    && !self.follows_stray(&datagram)
                {
                    bump(&mut self.datagrams.malformed, 1);
                    return;
                }
                self.start_at(&datagram, &mut on_event);
            }
        }
        self.stray = None;
        self.full = self.full.max(datagram.payload.len() as u32);
        self.seen = self.seen << 1 | 1;
        self.next = Some(Position::after(&datagram));
        bump(&mut self.datagrams.received, 1);
        self.fill(datagram.payload, &mut on_event);
    }

    /// Ends the frame under way, as when the radar stops: what is missing of it counts as lost.
    pub fn finish(&mut self, mut on_event: impl FnMut(Event<'_>)) {
        self.end_frame(&mut on_event);
        self.next = None;
        self.stray = None;
        self.full = 0;
        self.seen = 0;
    }

    /// Finds the place of a datagram that is not the expected one; `None` if it is dropped.
    fn place(
        &mut self,
        next: Position,
        datagram: &Datagram<'_>,
        on_event: &mut impl FnMut(Event<'_>),
    ) -> Option<()> {
        let (ahead, bytes) = next.distance_to(datagram);
        let in_step = i64::from(ahead) * i64::from(self.full) == bytes;
        if in_step && ahead > 0 {
            bump(&mut self.datagrams.lost, ahead as u32);
            self.seen = self.seen.checked_shl(ahead as u32).unwrap_or(0);
            self.skip(bytes as u64, on_event);
            return Some(());
        }
        let behind = ahead.unsigned_abs();
        let recent = in_step && behind <= REMEMBERED;
        let seen_before = recent && self.seen >> (behind - 1) & 1 == 1;
        let first = datagram.sequence == 1 && datagram.byte_count == 0;
        if (first && !recent) || self.follows_stray(datagram) {
            bump(&mut self.datagrams.restarts, 1);
            self.end_frame(on_event);
            on_event(Event::Restarted);
            self.start_at(datagram, on_event);
            return Some(());
        }
        let count = if seen_before {
            &mut self.datagrams.duplicate
        } else if in_step {
            &mut self.datagrams.late
        } else {
            &mut self.datagrams.malformed
        };
        bump(count, 1);
        None
    }

    /// Whether `datagram` completes a run of strays that is long enough to be the stream.
    fn follows_stray(&mut self, datagram: &Datagram<'_>) -> bool {
        let run = match self.stray {
            Some((position, run)) if position.is(datagram) => run.saturating_add(1),
            _ => 1,
        };
        self.stray = Some((Position::after(datagram), run));
        run >= RESTART_RUN
    }

    /// Begins the stream at `datagram`, whose place in its frame follows from its byte count.
    fn start_at(&mut self, datagram: &Datagram<'_>, on_event: &mut impl FnMut(Event<'_>)) {
        self.full = 0;
        self.seen = 0;
        let Some(frame_bytes) = NonZeroU64::new(self.frame_bytes().into()) else { return };
        self.skip(datagram.byte_count % frame_bytes, on_event);
    }

    /// Appends samples.
    fn fill(&mut self, mut bytes: &[u8], on_event: &mut impl FnMut(Event<'_>)) {
        while !bytes.is_empty() {
            let missing = (self.row_bytes - self.filled) as usize;
            // A row that lies in the datagram whole needs no copy.
            if self.filled == 0
                && let Some((row, rest)) = bytes.split_at_checked(missing)
            {
                self.emit(Some(row), on_event);
                bytes = rest;
                continue;
            }
            let (part, rest) = bytes.split_at(missing.min(bytes.len()));
            self.append(part.len(), |room| room.copy_from_slice(part), on_event);
            bytes = rest;
        }
    }

    /// Appends `bytes` zeros, whole frames at once.
    fn skip(&mut self, mut bytes: u64, on_event: &mut impl FnMut(Event<'_>)) {
        // Never zero, by `new`.
        let Some(frame_bytes) = NonZeroU64::new(self.frame_bytes().into()) else { return };
        while bytes > 0 {
            if !self.in_frame && bytes >= frame_bytes.get() {
                let frames = u32::try_from(bytes / frame_bytes).unwrap_or(u32::MAX);
                bump(&mut self.frames.lost, frames);
                self.frame = self.frame.wrapping_add(frames);
                on_event(Event::FramesLost(frames));
                bytes %= frame_bytes;
                continue;
            }
            self.hole = true;
            let part = bytes.min(u64::from(self.row_bytes - self.filled));
            self.append(part as usize, |room| room.fill(0), on_event);
            bytes -= part;
        }
    }

    /// Writes `length` bytes of the row under way, which it does not overrun, and hands the row on once it is full.
    fn append(&mut self, length: usize, write: impl FnOnce(&mut [u8]), on_event: &mut impl FnMut(Event<'_>)) {
        let from = self.filled as usize;
        if let Some(room) = self.buffer.get_mut(from..from + length) {
            write(room);
        }
        if self.filled == 0 && !self.in_frame {
            self.start_frame(on_event);
        }
        self.filled += length as u32;
        if self.filled == self.row_bytes {
            self.emit(None, on_event);
        }
    }

    fn start_frame(&mut self, on_event: &mut impl FnMut(Event<'_>)) {
        self.in_frame = true;
        on_event(Event::FrameStart { frame: self.frame });
    }

    /// Hands on the row under way: `row`, or what was collected.
    fn emit(&mut self, row: Option<&[u8]>, on_event: &mut impl FnMut(Event<'_>)) {
        if !self.in_frame {
            self.start_frame(on_event);
        }
        let bytes = row.or(self.buffer.get(..self.row_bytes as usize)).unwrap_or(&[]);
        let Self { chirp, receiver, hole, .. } = *self;
        on_event(Event::Row { chirp, receiver, bytes, intact: !hole });
        self.filled = 0;
        self.receiver += 1;
        if self.receiver == self.receivers {
            self.receiver = 0;
            self.hole = false;
            self.chirps_lost += u32::from(hole);
            self.chirp += 1;
            if self.chirp == self.chirps_per_frame {
                self.close_frame(on_event);
            }
        }
    }

    /// Ends the frame under way, if any, with what is missing as lost.
    fn end_frame(&mut self, on_event: &mut impl FnMut(Event<'_>)) {
        if self.in_frame {
            let done = self.frame_bytes_done();
            self.skip(u64::from(self.frame_bytes() - done), on_event);
        }
    }

    fn close_frame(&mut self, on_event: &mut impl FnMut(Event<'_>)) {
        let (frame, chirps_lost) = (self.frame, self.chirps_lost);
        let count = if chirps_lost == 0 { &mut self.frames.complete } else { &mut self.frames.incomplete };
        bump(count, 1);
        self.in_frame = false;
        self.chirp = 0;
        self.chirps_lost = 0;
        self.frame = self.frame.wrapping_add(1);
        on_event(Event::FrameEnd { frame, chirps_lost });
    }
}

fn bump(count: &mut u32, by: u32) {
    *count = count.wrapping_add(by);
}

#[cfg(test)]
mod tests;
