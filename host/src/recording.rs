//! Recordings of what went over the wire: `.pcap` files as tcpdump and Wireshark make and open them.
//!
//! In: classic pcap (microseconds or nanoseconds) or pcapng, plain or gzip-compressed, of Ethernet, Linux "any" device or
//! raw IP. Out: [`Record`]s, one for each UDP datagram over IPv4 and one for each piece of a TCP stream, put in order
//! per direction. To record radar, reader and bridge:
//!
//! ```text
//! tcpdump -i eth0 -s 0 -w session.pcap 'udp port 4098 or udp port 4096 or tcp port 5084'
//! ```
//!
//! Memory stays bounded whatever the file's length: of each direction of a TCP connection, at most 256 KiB wait for a
//! missing segment before the hole is given up. What cannot be used
//! (fragments, packets cut by the snapshot length, other protocols) is [counted](Counts), not fatal; a file that ends
//! inside a packet, or is damaged, is an error that names the byte.
//!
//! [`Writer`] makes such files, byte for byte the same for the same input.

mod decode;
mod file;
mod tcp;
mod writer;

use std::collections::VecDeque;
use std::io::{self, Read};
use std::net::SocketAddrV4;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

pub use writer::{BRIDGE_IP, HOST_IP, RADAR_IP, READER_IP, Writer, WriterError};

use decode::Content;
use file::PacketFile;

/// One UDP datagram, or the next bytes of one direction of a TCP connection.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Record {
    /// When it was captured, microseconds since the first packet of the file. Bytes that had to wait for a lost segment
    /// have the time of the packet that filled the hole, as a program would have got them.
    pub time_us: u64,
    /// Sender.
    pub source: SocketAddrV4,
    /// Receiver.
    pub destination: SocketAddrV4,
    /// How it travelled.
    pub protocol: Protocol,
    /// The bytes.
    pub payload: Vec<u8>,
}

/// How a record travelled.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Protocol {
    /// A datagram.
    Udp,
    /// Part of a byte stream.
    Tcp {
        /// Whether the bytes follow the last ones of this direction. If not (a new connection, the first bytes seen of
        /// one, bytes missing in between), an unfinished message before them is to be dropped.
        continues: bool,
    },
}

/// What a recording held so far.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counts {
    /// Packets of any kind.
    pub packets: u64,
    /// UDP datagrams.
    pub datagrams: u64,
    /// TCP segments with bytes.
    pub segments: u64,
    /// TCP segments of which all or part had been seen before.
    pub retransmitted: u64,
    /// TCP segments that came before bytes that precede them.
    pub out_of_order: u64,
    /// Bytes of TCP streams that are in no packet of the file.
    pub missing_bytes: u64,
    /// TCP segments so far from their stream that they were taken as a connection whose start is not in the file.
    pub resynchronised: u64,
    /// Fragments of IP packets, skipped: radar, reader and bridge send none.
    pub fragments: u64,
    /// Packets of which the capture kept only the beginning, skipped (`tcpdump -s 0` keeps all).
    pub cut: u64,
    /// Packets of other protocols, skipped.
    pub other: u64,
    /// Packets with malformed headers, skipped.
    pub malformed: u64,
}

/// Why a recording cannot be read. Byte offsets count in the uncompressed recording.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    /// The file cannot be opened.
    #[error("cannot open the recording {path}: {source}")]
    Open {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// Neither pcap nor pcapng.
    #[error(
        "{path} is no pcap or pcapng recording: it starts with {start:02x?}; \
         record with `tcpdump -s 0 -w` or save from Wireshark"
    )]
    NotARecording {
        /// The file.
        path: PathBuf,
        /// Its first bytes.
        start: Vec<u8>,
    },
    /// A link layer that is not understood.
    #[error(
        "{path}: packet at byte {offset} has link type {link_type}, which is not supported; \
         record on an Ethernet device (`tcpdump -i eth0`)"
    )]
    LinkType {
        /// The file.
        path: PathBuf,
        /// Start of the packet.
        offset: u64,
        /// Number of the link type (<https://www.tcpdump.org/linktypes.html>).
        link_type: u32,
    },
    /// The file ends within a packet.
    #[error(
        "{path} ends inside packet {number}, which starts at byte {offset}: the recording was cut short, \
         or a length before that is damaged; the packets before it are good"
    )]
    Truncated {
        /// The file.
        path: PathBuf,
        /// Number of the packet, from 1.
        number: u64,
        /// Start of the packet.
        offset: u64,
    },
    /// A packet's frame in the file breaks the format.
    #[error("{path}: packet {number} at byte {offset} is damaged: {reason}; the packets before it are good")]
    Damaged {
        /// The file.
        path: PathBuf,
        /// Number of the packet, from 1.
        number: u64,
        /// Start of the packet.
        offset: u64,
        /// What is wrong.
        reason: String,
    },
    /// Reading failed.
    #[error("cannot read {path} at byte {offset}: {source}")]
    Read {
        /// The file.
        path: PathBuf,
        /// Start of the packet that was to be read.
        offset: u64,
        /// What the system, or the decompressor, said.
        source: io::Error,
    },
}

/// A recording that is being read; an iterator of records in the order of the file.
///
/// After an error the iterator ends.
pub struct Recording {
    file: PacketFile,
    buffer: Vec<u8>,
    streams: tcp::Streams,
    ready: VecDeque<Record>,
    counts: Counts,
    start_us: Option<u64>,
    last_us: u64,
    ended: bool,
    /// Bytes of the file read so far, and all of them.
    read: Arc<AtomicU64>,
    length: u64,
}

/// A file that tells how much of it was read.
struct Counted {
    file: std::fs::File,
    read: Arc<AtomicU64>,
}

impl Read for Counted {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let bytes = self.file.read(buffer)?;
        self.read.fetch_add(bytes as u64, Ordering::Relaxed);
        Ok(bytes)
    }
}

impl Recording {
    /// Opens the recording at `path`.
    ///
    /// # Errors
    /// [`RecordingError::Open`], [`RecordingError::NotARecording`] or [`RecordingError::Read`].
    pub fn open(path: impl AsRef<Path>) -> Result<Self, RecordingError> {
        let path = path.as_ref();
        let file = std::fs::File::open(path)
            .map_err(|source| RecordingError::Open { path: path.to_path_buf(), source })?;
        let length = file.metadata().map_or(0, |m| m.len());
        let read = Arc::new(AtomicU64::new(0));
        let counted = Counted { file, read: Arc::clone(&read) };
        Ok(Self { read, length, ..Self::from_reader(path, counted)? })
    }

    /// Reads a recording from `reader`; `name` stands for the path in errors.
    ///
    /// # Errors
    /// [`RecordingError::NotARecording`] or [`RecordingError::Read`].
    pub fn from_reader(
        name: impl AsRef<Path>,
        reader: impl Read + Send + 'static,
    ) -> Result<Self, RecordingError> {
        Ok(Self {
            file: PacketFile::new(name.as_ref().to_path_buf(), reader)?,
            buffer: Vec::new(),
            streams: tcp::Streams::default(),
            ready: VecDeque::new(),
            counts: Counts::default(),
            start_us: None,
            last_us: 0,
            ended: false,
            read: Arc::default(),
            length: 0,
        })
    }

    /// Share of the file that was read, 0 to 1, of its compressed form too; 0 for what is not a file.
    pub fn share_read(&self) -> f64 {
        self.read.load(Ordering::Relaxed) as f64 / self.length.max(1) as f64
    }

    /// What was read so far.
    pub fn counts(&self) -> Counts {
        self.counts
    }

    /// Time of the first packet, microseconds of the recorder's UTC clock; `None` before it was read.
    pub fn start_us(&self) -> Option<u64> {
        self.start_us
    }

    /// Reads packets until there is a record or the file ends.
    fn read_on(&mut self) -> Result<(), RecordingError> {
        while self.ready.is_empty() && !self.ended {
            let Some(frame) = self.file.next(&mut self.buffer)? else {
                self.ended = true;
                let (ready, time_us) = (&mut self.ready, self.last_us);
                self.streams
                    .end(&mut self.counts, &mut |flow, piece| ready.push_back(piece.record(flow, time_us)));
                break;
            };
            self.counts.packets += 1;
            let time_us = frame.time_us.saturating_sub(*self.start_us.get_or_insert(frame.time_us));
            self.last_us = time_us;
            if frame.cut {
                self.counts.cut += 1;
                continue;
            }
            match decode::decode(frame.link, &self.buffer) {
                Content::Udp { source, destination, payload } => {
                    self.counts.datagrams += 1;
                    let payload = payload.to_vec();
                    let record = Record { time_us, source, destination, protocol: Protocol::Udp, payload };
                    self.ready.push_back(record);
                }
                Content::Tcp { source, destination, segment } => {
                    let ready = &mut self.ready;
                    self.streams.push(
                        tcp::Flow { source, destination },
                        segment,
                        &mut self.counts,
                        &mut |flow, piece| {
                            ready.push_back(piece.record(flow, time_us));
                        },
                    );
                }
                Content::Fragment => self.counts.fragments += 1,
                Content::Other => self.counts.other += 1,
                Content::Malformed => self.counts.malformed += 1,
            }
        }
        Ok(())
    }
}

impl Iterator for Recording {
    type Item = Result<Record, RecordingError>;

    fn next(&mut self) -> Option<Self::Item> {
        if let Err(e) = self.read_on() {
            self.ended = true;
            return Some(Err(e));
        }
        self.ready.pop_front().map(Ok)
    }
}

#[cfg(test)]
mod tests;
