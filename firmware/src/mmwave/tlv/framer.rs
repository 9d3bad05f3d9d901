//! Where frames begin and end in the byte stream of the data UART.
//!
//! The stream has no checksum; bytes get lost, and the padding of a frame may hold an old magic. So a frame is taken
//! when all of this holds:
//! - its header is plausible: its TLVs can fit its total length, and that fits the buffer;
//! - its TLVs, walked by their lengths, end less than one padding ([`SEGMENT`]) before the total length;
//! - no other magic begins before its TLVs end. One that does is the next frame, reached too early because bytes were
//!   lost; by chance a payload holds one once in 2^64 places.
//!
//! Else the frame counts as truncated, as soon as that shows, and the search goes on inside of what it claimed. After a
//! frame the next one is where the total length says; a magic in the padding is believed only if there is none. Then
//! bytes of the padding are missing or, which looks the same, bytes of the last TLV: [`Counts::resyncs`] tells.
//!
//! A frame is delivered with the last byte of its last TLV, unless its last bytes could begin a magic: then the bytes
//! that decide are awaited. What is delivered and counted depends on the bytes alone, not on how they are cut.

use super::{FrameHeader, HeaderFormat, MAGIC, SEGMENT, TLV_HEADER, TlvKind, Tlvs, u32_at};

/// TLVs by kind.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct TlvCounts {
    known: [u32; TlvKind::ALL.len()],
    /// TLVs of a kind that is none of the demo's.
    pub unknown: u32,
}

impl TlvCounts {
    /// TLVs of this kind.
    pub fn of(&self, kind: TlvKind) -> u32 {
        TlvKind::ALL.into_iter().zip(self.known).find(|(k, _)| *k == kind).map_or(0, |(_, count)| count)
    }

    fn add(&mut self, code: u32) {
        let known = TlvKind::ALL.into_iter().zip(&mut self.known).find(|(kind, _)| kind.code() == code);
        let count = known.map_or(&mut self.unknown, |(_, count)| count);
        *count = count.saturating_add(1);
    }
}

/// What a stream has carried so far. Complete frames, their padding and `junk_bytes` are all of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Counts {
    /// Frames delivered.
    pub complete: u32,
    /// Frames that began and were not complete: bytes were lost, or the stream ended.
    pub truncated: u32,
    /// Truncated frames whose header claims more than the buffer holds.
    pub too_long: u32,
    /// Times that a frame was found elsewhere than where the one before said.
    pub resyncs: u32,
    /// Bytes before the first magic.
    pub leading_junk_bytes: u64,
    /// Bytes of no complete frame, those before the first magic and of truncated frames included.
    pub junk_bytes: u64,
    /// TLVs of the frames delivered.
    pub tlvs: TlvCounts,
}

/// What to do with the window, the bytes from a place in the stream on.
#[derive(Debug, Clone, Copy)]
pub(super) enum Step {
    /// Wait until it is this long.
    Wait(usize),
    /// Drop bytes from its front.
    Skip(usize),
    /// It begins with a frame of this many bytes, padding excluded; drop them.
    Deliver(usize),
}

/// What is at the front of the window.
#[derive(Debug, Clone, Copy)]
enum State {
    /// Anything.
    Search,
    /// A magic.
    Frame(Walk),
    /// The end of a frame's TLVs, this many bytes before the frame's end.
    Padding(usize),
}

/// How far a frame has been looked at; offsets from its magic.
#[derive(Debug, Clone, Copy, Default)]
struct Walk {
    /// Total length; `None` until the header is there.
    total: Option<usize>,
    /// TLVs not yet walked.
    left: u32,
    /// Where the next TLV begins.
    next: usize,
    /// No magic but the frame's own begins before this offset.
    scanned: usize,
}

enum Verdict {
    Wait(usize),
    Broken,
    TooLong,
    Complete { end: usize, padding: usize },
}

/// The rules of the [module](self), a step at a time; the caller keeps the bytes.
#[derive(Debug, Clone)]
pub(super) struct Framer {
    pub(super) format: HeaderFormat,
    /// Longest window that may be asked for.
    window: usize,
    state: State,
    /// The first magic has been seen.
    synced: bool,
    /// The next frame is not where the one before said.
    astray: bool,
    pub(super) counts: Counts,
}

/// Offset of the first whole magic in `bytes`.
fn find_magic(bytes: &[u8]) -> Option<usize> {
    bytes.windows(MAGIC.len()).position(|window| window == MAGIC)
}

/// Bytes at the end of `bytes` that could begin a magic, less than a whole one.
fn magic_begun(bytes: &[u8]) -> usize {
    (1..MAGIC.len()).rev().find(|&n| MAGIC.get(..n).is_some_and(|begin| bytes.ends_with(begin))).unwrap_or(0)
}

/// Whether `bytes` has a magic at `offset`.
fn magic_at(bytes: &[u8], offset: usize) -> bool {
    bytes.get(offset..).is_some_and(|rest| rest.starts_with(&MAGIC))
}

/// Whether a magic begins in some part of a window.
enum Begins {
    /// None begins there.
    None,
    /// One does, here.
    Magic(usize),
    /// The window's end could be the beginning of one that begins there, here.
    Perhaps(usize),
}

/// Looks for a magic that begins at `from..to` of `window`.
fn begins(window: &[u8], from: usize, to: usize) -> Begins {
    let end = window.len().min(to.saturating_add(MAGIC.len() - 1));
    let zone = window.get(from..end).unwrap_or_default();
    if let Some(offset) = find_magic(zone) {
        return Begins::Magic(from + offset);
    }
    let begun = if end == window.len() { magic_begun(zone) } else { 0 };
    let place = end - begun;
    if begun > 0 && place < to { Begins::Perhaps(place) } else { Begins::None }
}

impl Framer {
    pub(super) const fn new(format: HeaderFormat, window: usize) -> Self {
        Self {
            format,
            window,
            state: State::Search,
            synced: false,
            astray: false,
            counts: Counts {
                complete: 0,
                truncated: 0,
                too_long: 0,
                resyncs: 0,
                leading_junk_bytes: 0,
                junk_bytes: 0,
                tlvs: TlvCounts { known: [0; TlvKind::ALL.len()], unknown: 0 },
            },
        }
    }

    /// Forgets the stream, not the counts.
    pub(super) fn restart(&mut self) {
        self.state = State::Search;
        self.synced = false;
        self.astray = false;
    }

    /// Looks at the front of `window`; `ended` says that no bytes follow it, and then nothing is waited for unless the
    /// window is empty.
    pub(super) fn step(&mut self, window: &[u8], ended: bool) -> Step {
        match self.state {
            State::Search => self.search(window, ended),
            State::Frame(walk) => self.frame(walk, window, ended),
            State::Padding(left) => self.padding(left, window, ended),
        }
    }

    fn junk(&mut self, bytes: usize) {
        self.counts.junk_bytes = self.counts.junk_bytes.saturating_add(bytes as u64);
        if !self.synced {
            self.counts.leading_junk_bytes = self.counts.leading_junk_bytes.saturating_add(bytes as u64);
        }
        self.astray |= bytes > 0;
    }

    fn search(&mut self, window: &[u8], ended: bool) -> Step {
        if let Some(offset) = find_magic(window) {
            self.junk(offset);
            if self.astray && self.synced {
                self.counts.resyncs = self.counts.resyncs.saturating_add(1);
            }
            self.synced = true;
            self.astray = false;
            self.state = State::Frame(Walk::default());
            return Step::Skip(offset);
        }
        let begun = if ended { 0 } else { magic_begun(window) };
        let dropped = window.len() - begun;
        if dropped == 0 {
            return Step::Wait(MAGIC.len());
        }
        self.junk(dropped);
        Step::Skip(dropped)
    }

    fn frame(&mut self, mut walk: Walk, window: &[u8], ended: bool) -> Step {
        match walk.look(window, self.format, self.window, ended) {
            Verdict::Wait(bytes) if !ended => {
                self.state = State::Frame(walk);
                Step::Wait(bytes)
            }
            Verdict::Complete { end, padding } => {
                self.counts.complete = self.counts.complete.saturating_add(1);
                let body = window.get(self.format.bytes()..end).unwrap_or_default();
                Tlvs { rest: body }.for_each(|tlv| self.counts.tlvs.add(tlv.code));
                self.state = State::Padding(padding);
                Step::Deliver(end)
            }
            verdict => {
                let too_long = u32::from(matches!(verdict, Verdict::TooLong));
                self.counts.too_long = self.counts.too_long.saturating_add(too_long);
                self.counts.truncated = self.counts.truncated.saturating_add(1);
                self.junk(MAGIC.len());
                self.state = State::Search;
                Step::Skip(MAGIC.len())
            }
        }
    }

    fn padding(&mut self, left: usize, window: &[u8], ended: bool) -> Step {
        if window.len() < left && !ended {
            return Step::Wait(left);
        }
        let early = begins(window, 0, left);
        let decided = window.len() >= left + MAGIC.len() || ended;
        if !decided && !matches!(early, Begins::None) {
            return Step::Wait(left + MAGIC.len());
        }
        self.state = State::Search;
        let as_announced = magic_at(window, left) || (ended && window.len() == left);
        match early {
            Begins::Magic(offset) if !as_announced => {
                self.astray = true;
                Step::Skip(offset)
            }
            _ => Step::Skip(left.min(window.len())),
        }
    }
}

impl Walk {
    fn look(&mut self, window: &[u8], format: HeaderFormat, longest: usize, ended: bool) -> Verdict {
        let total = match self.total {
            Some(total) => total,
            None => {
                let Some(header) = FrameHeader::read(window, format) else {
                    return Verdict::Wait(format.bytes());
                };
                let total = header.total_length as usize;
                let shortest = u64::from(header.tlvs) * TLV_HEADER as u64 + format.bytes() as u64;
                if (total as u64) < shortest {
                    return Verdict::Broken;
                }
                if total > longest.saturating_sub(MAGIC.len()) {
                    return Verdict::TooLong;
                }
                *self = Self {
                    total: Some(total),
                    left: header.tlvs,
                    next: format.bytes(),
                    scanned: MAGIC.len(),
                };
                total
            }
        };
        let end = loop {
            if self.left == 0 {
                break Some(self.next);
            }
            let Some(length) = u32_at(window, self.next + 4) else { break None };
            let end = (self.next + TLV_HEADER).saturating_add(length as usize);
            self.left -= 1;
            // The headers of the TLVs after it must fit too; there are no more than fit the whole.
            if end.saturating_add(self.left as usize * TLV_HEADER) > total {
                return Verdict::Broken;
            }
            self.next = end;
        };
        if end.is_some_and(|end| total - end >= SEGMENT) {
            return Verdict::Broken;
        }
        let inside = end.unwrap_or(self.next + TLV_HEADER);
        let begun = match begins(window, self.scanned, inside) {
            Begins::Magic(_) => return Verdict::Broken,
            Begins::Perhaps(place) => Some(place),
            Begins::None => None,
        };
        self.scanned = begun.unwrap_or(inside.min(window.len())).max(self.scanned);
        match (end, begun) {
            (Some(end), Some(place)) if window.len() >= end && !ended => Verdict::Wait(place + MAGIC.len()),
            (Some(end), _) if window.len() >= end => Verdict::Complete { end, padding: total - end },
            _ => Verdict::Wait(inside),
        }
    }
}
