//! Frames out of chunks of any size: keeps the bytes of a frame that is not yet whole, and only those.

use super::framer::{Counts, Framer, Step};
use super::{Frame, HeaderFormat, MAGIC, SEGMENT};

/// Capacity for any stock frame of 256 range bins x 16 Doppler bins x 12 antennas: both heat maps (8 192 + 12 288
/// bytes), both profiles (1 024), 500 points with side information (10 000), statistics, temperatures and headers
/// (172), and the magic after it.
pub const DEFAULT_CAPACITY: usize = 32 * 1024;

/// Finds frames of up to `N - 8` bytes in a stream.
///
/// A frame whose TLVs do not fit its lengths, or within which the next magic comes, has lost bytes: it counts as
/// truncated, and the frame after it is found inside of what it claimed. Padding may be missing.
///
/// ```
/// # use rfhoi_firmware::mmwave::tlv::{FrameHeader, FrameWriter, HeaderFormat, StreamParser};
/// # let mut buffer = [0; 64];
/// # let chunk = FrameWriter::new(&mut buffer, HeaderFormat::Subframe)?.finish(FrameHeader::default())?;
/// let mut parser = StreamParser::<4096>::new(HeaderFormat::Subframe);
/// let mut input = chunk; // what a read of the UART gave
/// while let Some(frame) = parser.next(&mut input) {
///     for view in frame.views() { /* ... */ }
/// }
/// assert_eq!(parser.counts().complete, 1);
/// # Ok::<(), rfhoi_firmware::mmwave::tlv::WriteError>(())
/// ```
#[derive(Debug, Clone)]
pub struct StreamParser<const N: usize = DEFAULT_CAPACITY> {
    framer: Framer,
    /// Bytes kept from one chunk to the next are at `start..end`.
    start: usize,
    end: usize,
    buffer: [u8; N],
}

impl<const N: usize> StreamParser<N> {
    /// A parser at the beginning of a stream.
    pub const fn new(format: HeaderFormat) -> Self {
        const {
            assert!(N >= HeaderFormat::Subframe.bytes() + SEGMENT + MAGIC.len(), "no frame fits this buffer");
        }
        Self { framer: Framer::new(format, N), start: 0, end: 0, buffer: [0; N] }
    }

    /// Counts so far.
    pub fn counts(&self) -> &Counts {
        &self.framer.counts
    }

    /// The next frame of the stream that goes on with `input`; bytes are taken off its front.
    ///
    /// Call it until it gives `None`: then all of `input` has been taken. A frame that lies within `input` is not
    /// copied.
    pub fn next<'a, 'i: 'a>(&'a mut self, input: &mut &'i [u8]) -> Option<Frame<'a>> {
        loop {
            if self.start == self.end {
                let window = *input;
                match self.framer.step(window, false) {
                    Step::Wait(_) => {
                        self.start = 0;
                        self.end = 0;
                        let kept = self.buffer.get_mut(..window.len())?;
                        kept.copy_from_slice(window);
                        self.end = window.len();
                        *input = &[];
                        return None;
                    }
                    Step::Skip(bytes) => *input = window.get(bytes..).unwrap_or_default(),
                    Step::Deliver(bytes) => {
                        let (frame, rest) = window.split_at_checked(bytes)?;
                        *input = rest;
                        return Frame::new(frame, self.framer.format);
                    }
                }
            } else {
                match self.step_buffered(false) {
                    Step::Wait(bytes) => {
                        if input.is_empty() {
                            return None;
                        }
                        self.fill(bytes, input);
                    }
                    Step::Skip(bytes) => self.start = self.end.min(self.start.saturating_add(bytes)),
                    Step::Deliver(bytes) => return self.deliver(bytes),
                }
            }
        }
    }

    /// Ends the stream: call it until it gives `None`, for the frames that were waiting for bytes to confirm them.
    /// What is left of an incomplete frame counts as truncated. The parser can then begin another stream.
    pub fn finish(&mut self) -> Option<Frame<'_>> {
        while self.start < self.end {
            match self.step_buffered(true) {
                // Nothing more will come; no step asks for it.
                Step::Wait(_) => break,
                Step::Skip(bytes) => self.start = self.end.min(self.start.saturating_add(bytes)),
                Step::Deliver(bytes) => return self.deliver(bytes),
            }
        }
        self.framer.restart();
        None
    }

    fn deliver(&mut self, bytes: usize) -> Option<Frame<'_>> {
        let window = self.buffer.get(self.start..self.end)?;
        self.start = self.end.min(self.start.saturating_add(bytes));
        Frame::new(window.get(..bytes)?, self.framer.format)
    }

    /// Moves bytes from `input` to the buffer until the window has `wanted`.
    fn fill(&mut self, wanted: usize, input: &mut &[u8]) {
        if self.start.saturating_add(wanted) > N {
            if let Some(window) = self.buffer.get_mut(..self.end)
                && self.start <= window.len()
            {
                window.copy_within(self.start.., 0);
            }
            self.end = self.end.saturating_sub(self.start);
            self.start = 0;
        }
        let missing = wanted.saturating_sub(self.end.saturating_sub(self.start));
        let (taken, rest) = input.split_at_checked(missing).unwrap_or((*input, &[]));
        if let Some(free) = self.buffer.get_mut(self.end..).and_then(|free| free.get_mut(..taken.len())) {
            free.copy_from_slice(taken);
            self.end += taken.len();
        }
        *input = rest;
    }

    fn step_buffered(&mut self, ended: bool) -> Step {
        let window = self.buffer.get(self.start..self.end).unwrap_or_default();
        self.framer.step(window, ended)
    }
}
