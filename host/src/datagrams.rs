//! Cuts the radar's byte stream into the datagrams of a DCA1000EVM in raw mode.
//!
//! In: the bytes of the LVDS link, from a file ([`Datagrams`]) or as a simulated radar makes them ([`Cutter`]). Out: UDP
//! payloads of at most [`DATAGRAM`] bytes: sequence number (u32 LE, from 1), payload bytes sent before (u48 LE), samples.
//! Frames do not end on a datagram's end.

use std::io::{self, Read};

use rfhoi_firmware::dca1000::{self, HEADER_BYTES};
use rfhoi_shared::radar::DCA1000_PAYLOAD;

/// Bytes of a full datagram.
pub const DATAGRAM: usize = HEADER_BYTES + PAYLOAD;
const PAYLOAD: usize = DCA1000_PAYLOAD as usize;

/// One datagram.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Datagram {
    /// Number in the recording, from 1.
    pub sequence: u32,
    /// Bytes of samples in the datagrams before this one.
    pub byte_count: u64,
    /// The UDP payload: header and samples.
    pub bytes: Vec<u8>,
}

impl Datagram {
    /// The samples.
    pub fn samples(&self) -> &[u8] {
        &self.bytes[HEADER_BYTES..]
    }
}

/// Numbers datagrams as after the recorder's RECORD_START.
#[derive(Debug, Default)]
struct Numbering {
    sequence: u32,
    byte_count: u64,
}

impl Numbering {
    fn next(&mut self, samples: &[u8]) -> Datagram {
        self.sequence = self.sequence.wrapping_add(1);
        let (sequence, byte_count) = (self.sequence, self.byte_count);
        self.byte_count += samples.len() as u64;
        let header = dca1000::Datagram::header(sequence, byte_count % dca1000::Datagram::BYTE_COUNT_MODULUS);
        Datagram { sequence, byte_count, bytes: [&header, samples].concat() }
    }
}

/// Cuts bytes as they are made: full datagrams leave at once, the rest waits for more.
#[derive(Debug, Default)]
pub struct Cutter {
    numbering: Numbering,
    waiting: Vec<u8>,
}

impl Cutter {
    /// Takes the next bytes of the stream; the datagrams that they fill.
    pub fn push(&mut self, bytes: &[u8]) -> Vec<Datagram> {
        self.waiting.extend(bytes);
        let full = self.waiting.len() / PAYLOAD * PAYLOAD;
        let rest = self.waiting.split_off(full);
        let filled = std::mem::replace(&mut self.waiting, rest);
        filled.chunks(PAYLOAD).map(|samples| self.numbering.next(samples)).collect()
    }

    /// The last datagram, if any bytes wait for it.
    pub fn finish(&mut self) -> Option<Datagram> {
        let rest = std::mem::take(&mut self.waiting);
        (!rest.is_empty()).then(|| self.numbering.next(&rest))
    }
}

/// Iterator of the datagrams of a stream. All are full but the last; an error of the reader ends it.
///
/// ```
/// use rfhoi::datagrams::{DATAGRAM, Datagrams};
///
/// let stream = vec![0; 2_000];
/// let datagrams = Datagrams::new(stream.as_slice()).collect::<Result<Vec<_>, _>>()?;
/// assert_eq!(datagrams.len(), 2);
/// assert_eq!(datagrams[0].bytes.len(), DATAGRAM);
/// assert_eq!(datagrams[1].byte_count, 1_456);
/// # Ok::<(), std::io::Error>(())
/// ```
#[derive(Debug)]
pub struct Datagrams<R> {
    stream: R,
    numbering: Numbering,
    ended: bool,
}

impl<R: Read> Datagrams<R> {
    /// Cuts `stream` from its start, as after the recorder's RECORD_START.
    pub fn new(stream: R) -> Self {
        Self { stream, numbering: Numbering::default(), ended: false }
    }
}

impl<R: Read> Iterator for Datagrams<R> {
    type Item = io::Result<Datagram>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.ended {
            return None;
        }
        let mut samples = Vec::with_capacity(PAYLOAD);
        let read = self.stream.by_ref().take(u64::from(DCA1000_PAYLOAD)).read_to_end(&mut samples);
        self.ended = samples.len() < PAYLOAD;
        if let Err(e) = read {
            self.ended = true;
            return Some(Err(e));
        }
        if samples.is_empty() {
            return None;
        }
        Some(Ok(self.numbering.next(&samples)))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn second_datagram_has_the_header_of_a_real_one() {
        // Captured from a DCA1000EVM with sequence 2, 1456 bytes before.
        let real = [0x02, 0, 0, 0, 0xb0, 0x05, 0, 0, 0, 0, 0xbb, 0x06, 0xb4, 0x00, 0xd8, 0x07];
        let stream = [&[0; 1_456][..], &real[HEADER_BYTES..]].concat();
        let datagrams: Vec<_> = Datagrams::new(stream.as_slice()).map(Result::unwrap).collect();
        assert_eq!(datagrams[1].bytes, real);
    }

    #[test]
    fn an_error_of_the_stream_ends_it() {
        struct Broken;
        impl Read for Broken {
            fn read(&mut self, _: &mut [u8]) -> io::Result<usize> {
                Err(io::Error::other("gone"))
            }
        }
        let results: Vec<_> = Datagrams::new([0; 1_456].as_slice().chain(Broken)).collect();
        assert_eq!(results.iter().map(Result::is_ok).collect::<Vec<_>>(), [true, false]);
    }

    proptest! {
        #[test]
        fn datagrams_carry_the_stream_whole(stream in prop::collection::vec(any::<u8>(), 0..10_000)) {
            let datagrams: Vec<_> = Datagrams::new(stream.as_slice()).map(Result::unwrap).collect();
            let mut read: Vec<u8> = Vec::new();
            for (number, datagram) in datagrams.iter().enumerate() {
                let mut count = [0; 8];
                count[..6].copy_from_slice(&datagram.bytes[4..HEADER_BYTES]);
                prop_assert_eq!(&datagram.bytes[..4], &(number as u32 + 1).to_le_bytes());
                prop_assert_eq!(u64::from_le_bytes(count), read.len() as u64);
                prop_assert!(datagram.bytes.len() > HEADER_BYTES && datagram.bytes.len() <= DATAGRAM);
                read.extend(datagram.samples());
            }
            prop_assert_eq!(&read, &stream);
            let mut cutter = Cutter::default();
            let mut cut: Vec<_> = stream.chunks(777).flat_map(|bytes| cutter.push(bytes)).collect();
            cut.extend(cutter.finish());
            prop_assert_eq!(cut, datagrams);
        }
    }
}
