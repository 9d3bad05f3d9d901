//! Messages out of a TCP stream: chunks of any size go in, whole messages come out.
//!
//! Header (LLRP 1.0.1 section 16.1.1), 10 bytes, big-endian: 3 bits reserved, 3 bits version, 10 bits type; u32 length
//! including the header; u32 message ID. Nothing marks the start of a message, so a header that cannot be right is the
//! end of the stream: [`FrameError`] tells where, and the link has to be opened anew.

use core::fmt;

use super::message::{Message, MessageType};

/// Bytes of a message header.
pub const HEADER_BYTES: usize = 10;
/// Version of LLRP that is spoken.
pub const VERSION: u8 = 1;

/// A header that cannot be right.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct FrameError {
    /// Bytes of the stream before the header.
    pub offset: u64,
    /// What is wrong with it.
    pub fault: HeaderFault,
}

/// What is wrong with a header.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum HeaderFault {
    /// Another version than [`VERSION`].
    Version(u8),
    /// A length below [`HEADER_BYTES`].
    Length(u32),
}

impl fmt::Display for FrameError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.fault {
            HeaderFault::Version(v) => write!(f, "LLRP version {v}")?,
            HeaderFault::Length(n) => write!(f, "message length {n}")?,
        }
        write!(f, " in the header at byte {} of the stream", self.offset)
    }
}

impl core::error::Error for FrameError {}

#[derive(Clone, Copy)]
struct Header {
    kind: MessageType,
    length: u32,
    id: u32,
}

impl Header {
    /// The header at the start of `bytes`, or `None` if there are too few.
    fn parse(bytes: &[u8]) -> Option<Result<Self, HeaderFault>> {
        let &[v, t, l0, l1, l2, l3, i0, i1, i2, i3] = bytes.first_chunk::<HEADER_BYTES>()?;
        let version = (v >> 2) & 0b111;
        let length = u32::from_be_bytes([l0, l1, l2, l3]);
        Some(if version != VERSION {
            Err(HeaderFault::Version(version))
        } else if (length as usize) < HEADER_BYTES {
            Err(HeaderFault::Length(length))
        } else {
            let kind = MessageType(u16::from_be_bytes([v & 0b11, t]));
            Ok(Self { kind, length, id: u32::from_be_bytes([i0, i1, i2, i3]) })
        })
    }

    /// The message of this header whose bytes are `whole`.
    fn message(self, whole: &[u8]) -> Option<Message<'_>> {
        Some(Message { kind: self.kind, id: self.id, body: whole.get(HEADER_BYTES..)? })
    }
}

/// Cuts a stream into messages of at most `N` bytes, header included; longer ones are skipped and counted.
#[derive(Debug, Clone)]
pub struct Framer<const N: usize> {
    buffer: [u8; N],
    held: usize,
    /// Bytes of a message longer than `N` that are still to come.
    skip: u32,
    /// Bytes of the stream taken in.
    taken: u64,
    failed: Option<FrameError>,
    oversized: u32,
}

impl<const N: usize> Default for Framer<N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const N: usize> Framer<N> {
    /// At the start of a stream.
    pub const fn new() -> Self {
        const { assert!(N >= HEADER_BYTES, "a message has at least its header") };
        Self { buffer: [0; N], held: 0, skip: 0, taken: 0, failed: None, oversized: 0 }
    }

    /// Back to the start of a stream; the count of [`Self::oversized`] messages stays.
    pub fn reset(&mut self) {
        self.held = 0;
        self.skip = 0;
        self.taken = 0;
        self.failed = None;
    }

    /// Messages skipped for their length.
    pub fn oversized(&self) -> u32 {
        self.oversized
    }

    /// Takes the next message, moving the front of `chunk` past it; `None` when all of `chunk` is taken in and no
    /// message is complete. A message that is whole within `chunk` is not copied.
    ///
    /// # Errors
    /// At a header that cannot be right; from then on always, until [`Self::reset`].
    pub fn next<'a, 'c: 'a>(&'a mut self, chunk: &mut &'c [u8]) -> Result<Option<Message<'a>>, FrameError> {
        if let Some(error) = self.failed {
            return Err(error);
        }
        loop {
            if self.skip > 0 {
                let n = chunk.len().min(self.skip as usize);
                self.take(chunk, n);
                self.skip = self.skip.saturating_sub(n as u32);
                if self.skip > 0 {
                    return Ok(None);
                }
            }
            if self.held == 0
                && let Some(header) = self.check(Header::parse(chunk), self.taken)?
            {
                if self.too_long(header, 0) {
                    continue;
                }
                if chunk.len() >= header.length as usize {
                    let whole = self.take(chunk, header.length as usize);
                    return Ok(header.message(whole));
                }
            }
            self.gather(chunk, HEADER_BYTES);
            let start = self.taken.saturating_sub(self.held as u64);
            let header = Header::parse(self.buffer.get(..self.held).unwrap_or_default());
            let Some(header) = self.check(header, start)? else {
                return Ok(None);
            };
            if self.too_long(header, HEADER_BYTES) {
                continue;
            }
            self.gather(chunk, header.length as usize);
            if self.held < header.length as usize {
                return Ok(None);
            }
            self.held = 0;
            return Ok(self.buffer.get(..header.length as usize).and_then(|whole| header.message(whole)));
        }
    }

    /// Remembers what is wrong with the header at `offset` in the stream.
    fn check(
        &mut self,
        header: Option<Result<Header, HeaderFault>>,
        offset: u64,
    ) -> Result<Option<Header>, FrameError> {
        header.transpose().map_err(|fault| {
            let error = FrameError { offset, fault };
            self.failed = Some(error);
            error
        })
    }

    /// Whether the message does not fit; then what is left of it after its first `seen` bytes will be skipped.
    fn too_long(&mut self, header: Header, seen: usize) -> bool {
        let too_long = header.length as usize > N;
        if too_long {
            self.oversized = self.oversized.saturating_add(1);
            self.skip = header.length.saturating_sub(seen as u32);
            self.held = 0;
        }
        too_long
    }

    /// Moves bytes from `chunk` until `length` are held, or there are no more.
    fn gather(&mut self, chunk: &mut &[u8], length: usize) {
        let n = length.saturating_sub(self.held).min(chunk.len());
        let taken = self.take(chunk, n);
        if let Some(free) = self.buffer.get_mut(self.held..).and_then(|free| free.get_mut(..taken.len())) {
            free.copy_from_slice(taken);
            self.held += taken.len();
        }
    }

    fn take<'c>(&mut self, chunk: &mut &'c [u8], n: usize) -> &'c [u8] {
        let (taken, rest) = chunk.split_at_checked(n).unwrap_or((chunk, &[]));
        *chunk = rest;
        self.taken = self.taken.wrapping_add(taken.len() as u64);
        taken
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use std::vec::Vec;

    use proptest::prelude::*;

    use super::*;

    const N: usize = 64;

    fn message(kind: u16, id: u32, body: &[u8]) -> Vec<u8> {
        let mut bytes = Vec::from((0x0400 | kind).to_be_bytes());
        bytes.extend(((HEADER_BYTES + body.len()) as u32).to_be_bytes());
        bytes.extend(id.to_be_bytes());
        bytes.extend(body);
        bytes
    }

    /// Type, ID and body.
    type Owned = (u16, u32, Vec<u8>);

    /// Messages of `stream` cut at `cuts`, how many were too long, and how it ended.
    fn frame(stream: &[u8], cuts: &[usize]) -> (Vec<Owned>, u32, Option<FrameError>) {
        let mut framer = Framer::<N>::new();
        let mut messages = Vec::new();
        let mut rest = stream;
        for &cut in cuts.iter().chain([&usize::MAX]) {
            let (mut chunk, after) = rest.split_at_checked(cut).unwrap_or((rest, &[]));
            rest = after;
            loop {
                match framer.next(&mut chunk) {
                    Ok(Some(m)) => messages.push((m.kind.0, m.id, m.body.to_vec())),
                    Ok(None) => break assert!(chunk.is_empty(), "all of a chunk is taken in"),
                    Err(error) => {
                        assert_eq!(framer.next(&mut chunk), Err(error), "an error stays");
                        return (messages, framer.oversized(), Some(error));
                    }
                }
            }
        }
        (messages, framer.oversized(), None)
    }

    #[test]
    fn a_four_gigabyte_message_is_skipped_not_held() {
        let mut stream = Vec::from([0x04, 61, 0xFF, 0xFF, 0xFF, 0xFF, 0, 0, 0, 1]);
        stream.extend([0; 100]);
        assert_eq!(frame(&stream, &[3]), (Vec::new(), 1, None));
    }

    #[test]
    fn errors_tell_where() {
        let mut stream = message(62, 1, &[]);
        stream.extend([0x08, 61, 0, 0, 0, 10, 0, 0, 0, 1]);
        let wrong_version = Some(FrameError { offset: 10, fault: HeaderFault::Version(2) });
        assert_eq!(frame(&stream, &[]).2, wrong_version);
        assert_eq!(frame(&stream, &[13]).2, wrong_version);
        stream[10] = 0x04;
        stream[15] = 9;
        let wrong_length = FrameError { offset: 10, fault: HeaderFault::Length(9) };
        assert_eq!(frame(&stream, &[]).2, Some(wrong_length));
        let mut framer = Framer::<N>::new();
        let mut chunk = &stream[10..];
        framer.next(&mut chunk).unwrap_err();
        framer.reset();
        assert!(framer.next(&mut &stream[..10]).unwrap().is_some());
    }

    proptest! {
        #[test]
        fn cuts_change_nothing(
            bodies in proptest::collection::vec((0..1024_u16, any::<u32>(), 0..N + 20), 0..20),
            cuts in proptest::collection::vec(0..40_usize, 0..60),
        ) {
            let mut stream = Vec::new();
            let mut fit = Vec::new();
            for &(kind, id, length) in &bodies {
                let body: Vec<u8> = (0..length as u8).collect();
                stream.extend(message(kind, id, &body));
                if HEADER_BYTES + length <= N {
                    fit.push((kind, id, body));
                }
            }
            let oversized = (bodies.len() - fit.len()) as u32;
            prop_assert_eq!(frame(&stream, &cuts), (fit, oversized, None));
        }

        #[test]
        fn any_bytes_in_any_cuts_agree(
            stream in proptest::collection::vec(any::<u8>(), 0..400),
            cuts in proptest::collection::vec(0..40_usize, 0..60),
        ) {
            prop_assert_eq!(frame(&stream, &cuts), frame(&stream, &[]));
        }
    }
}
