//! Packets of a pcap or pcapng file, plain or gzip-compressed, with their place in the file.

use std::io::{self, Cursor, Read};
use std::path::{Path, PathBuf};

use flate2::read::MultiGzDecoder;
use pcap_file::pcap::PcapReader;
use pcap_file::pcapng::PcapNgReader;
use pcap_file::pcapng::blocks::interface_description::{
    InterfaceDescriptionBlock, InterfaceDescriptionOption,
};
use pcap_file::pcapng::blocks::{ENHANCED_PACKET_BLOCK, INTERFACE_DESCRIPTION_BLOCK, SECTION_HEADER_BLOCK};
use pcap_file::{DataLink, Endianness, PcapError, TsResolution};

use super::RecordingError;

/// Bytes of a classic pcap file's header, and of each packet's.
const PCAP_HEADER: u64 = 24;
const PCAP_PACKET_HEADER: u64 = 16;

const GZIP_MAGIC: [u8; 2] = [0x1f, 0x8b];
const PCAPNG_MAGIC: [u8; 4] = SECTION_HEADER_BLOCK.to_be_bytes();
const PCAPNG_BIG_ENDIAN: [u8; 4] = [0x1a, 0x2b, 0x3c, 0x4d];
/// Classic pcap with microseconds and with nanoseconds.
const PCAP_MAGICS: [u32; 2] = [0xa1b2_c3d4, 0xa1b2_3c4d];
/// Bytes that tell the format, and where the first block of pcapng ends.
const PEEKED: u64 = 12;

const MICROSECONDS: u64 = 1_000_000;

/// What the captured bytes start with (<https://www.tcpdump.org/linktypes.html>).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Link {
    Ethernet,
    LinuxSll,
    LinuxSll2,
    RawIp,
}

impl Link {
    fn new(link_type: DataLink) -> Result<Self, u32> {
        match link_type {
            DataLink::ETHERNET => Ok(Self::Ethernet),
            DataLink::LINUX_SLL => Ok(Self::LinuxSll),
            DataLink::LINUX_SLL2 => Ok(Self::LinuxSll2),
            DataLink::RAW | DataLink::IPV4 => Ok(Self::RawIp),
            other => Err(other.into()),
        }
    }
}

/// What the file says of a packet besides its bytes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Frame {
    /// Microseconds of the recorder's clock, since 1970.
    pub(super) time_us: u64,
    pub(super) link: Link,
    /// Whether the capture kept only the beginning.
    pub(super) cut: bool,
}

type Input = Box<dyn Read + Send>;

enum Format {
    Pcap(PcapReader<Input>),
    PcapNg(PcapNgReader<Input>, Vec<Interface>),
}

/// Packets one after the other.
pub(super) struct PacketFile {
    path: PathBuf,
    format: Format,
    /// Start of the next packet.
    offset: u64,
    /// Number of the next packet, from 1.
    number: u64,
}

impl PacketFile {
    pub(super) fn new(path: PathBuf, reader: impl Read + Send + 'static) -> Result<Self, RecordingError> {
        let unreadable = |source| RecordingError::Read { path: path.clone(), offset: 0, source };
        let (mut start, mut input) = peek(Box::new(reader)).map_err(unreadable)?;
        if start.starts_with(&GZIP_MAGIC) {
            (start, input) = peek(Box::new(MultiGzDecoder::new(input))).map_err(unreadable)?;
        }
        let magic = start.first_chunk().copied().unwrap_or_default();
        let (format, offset) = if magic == PCAPNG_MAGIC {
            let format = PcapNgReader::new(input).map(|reader| Format::PcapNg(reader, Vec::new()));
            (format, section_header_bytes(&start))
        } else if PCAP_MAGICS.contains(&u32::from_be_bytes(magic))
            || PCAP_MAGICS.contains(&u32::from_le_bytes(magic))
        {
            (PcapReader::new(input).map(Format::Pcap), PCAP_HEADER)
        } else {
            return Err(RecordingError::NotARecording { path, start });
        };
        let format = format.map_err(|e| Place { path: &path, number: 1, offset: 0 }.error(e))?;
        Ok(Self { path, format, offset, number: 1 })
    }

    /// Reads the next packet's bytes into `buffer`; `None` at the end of the file.
    pub(super) fn next(&mut self, buffer: &mut Vec<u8>) -> Result<Option<Frame>, RecordingError> {
        let frame = match &mut self.format {
            Format::Pcap(reader) => {
                let place = Place { path: &self.path, number: self.number, offset: self.offset };
                let header = reader.header();
                // Not `next_packet`: that takes packets longer than the snapshot length for errors.
                let Some(packet) = reader.next_raw_packet() else { return Ok(None) };
                let packet = packet.map_err(|e| place.error(e))?;
                let link = Link::new(header.datalink).map_err(|l| place.link_error(l))?;
                self.offset += PCAP_PACKET_HEADER + u64::from(packet.incl_len);
                buffer.clear();
                buffer.extend_from_slice(&packet.data);
                let fraction_us = match header.ts_resolution {
                    TsResolution::MicroSecond => packet.ts_frac,
                    TsResolution::NanoSecond => packet.ts_frac / 1_000,
                };
                let time_us = u64::from(packet.ts_sec) * MICROSECONDS + u64::from(fraction_us);
                Some(Frame { time_us, link, cut: packet.incl_len < packet.orig_len })
            }
            Format::PcapNg(reader, interfaces) => loop {
                let place = Place { path: &self.path, number: self.number, offset: self.offset };
                // Blocks of a section are in the byte order of its header, which comes before them.
                let big_endian = reader.section().endianness == Endianness::Big;
                let Some(block) = reader.next_raw_block() else { break None };
                let block = block.map_err(|e| place.error(e))?;
                self.offset += u64::from(block.initial_len);
                match block.type_ {
                    SECTION_HEADER_BLOCK => interfaces.clear(),
                    INTERFACE_DESCRIPTION_BLOCK => {
                        interfaces.extend(reader.interfaces().last().map(Interface::new))
                    }
                    ENHANCED_PACKET_BLOCK => {
                        let packet = EnhancedPacket::parse(&block.body, big_endian)
                            .ok_or_else(|| place.damaged("its lengths contradict each other"))?;
                        let interface = interfaces
                            .get(packet.interface as usize)
                            .ok_or_else(|| place.damaged("its interface is not described"))?;
                        let link = interface.link.map_err(|l| place.link_error(l))?;
                        buffer.clear();
                        buffer.extend_from_slice(packet.bytes);
                        break Some(Frame {
                            time_us: interface.microseconds(packet.ticks),
                            link,
                            cut: packet.cut,
                        });
                    }
                    _ => {}
                }
            },
        };
        self.number += u64::from(frame.is_some());
        Ok(frame)
    }
}

/// An interface of a pcapng section.
#[derive(Clone, Copy)]
struct Interface {
    link: Result<Link, u32>,
    ticks_per_s: u128,
}

impl Interface {
    fn new(block: &InterfaceDescriptionBlock<'_>) -> Self {
        // Option if_tsresol: a power of ten, or of two if the highest bit is set; microseconds by default.
        let resolution = block.options.iter().find_map(|option| match option {
            InterfaceDescriptionOption::IfTsResol(code) => Some(*code),
            _ => None,
        });
        let code = resolution.unwrap_or(6);
        let (base, power) = if code & 0x80 == 0 { (10_u128, code) } else { (2, code & 0x7f) };
        Self { link: Link::new(block.linktype), ticks_per_s: base.saturating_pow(u32::from(power)) }
    }

    fn microseconds(&self, ticks: u64) -> u64 {
        let us = u128::from(ticks) * u128::from(MICROSECONDS) / self.ticks_per_s;
        u64::try_from(us).unwrap_or(u64::MAX)
    }
}

/// Enhanced Packet Block of pcapng (draft-ietf-opsawg-pcapng, 4.3). The block types of `pcap_file` take every time
/// stamp for nanoseconds, so the fields are read here.
struct EnhancedPacket<'a> {
    interface: u32,
    ticks: u64,
    bytes: &'a [u8],
    cut: bool,
}

impl<'a> EnhancedPacket<'a> {
    fn parse(body: &'a [u8], big_endian: bool) -> Option<Self> {
        let word = |index: usize| {
            let bytes = body.get(4 * index..)?.first_chunk().copied()?;
            Some(if big_endian { u32::from_be_bytes(bytes) } else { u32::from_le_bytes(bytes) })
        };
        let (interface, captured, original) = (word(0)?, word(3)?, word(4)?);
        let ticks = u64::from(word(1)?) << 32 | u64::from(word(2)?);
        let bytes = body.get(20..)?.get(..captured as usize)?;
        Some(Self { interface, ticks, bytes, cut: captured < original })
    }
}

/// Where in which file an error is.
struct Place<'a> {
    path: &'a Path,
    number: u64,
    offset: u64,
}

impl Place<'_> {
    fn error(&self, error: PcapError) -> RecordingError {
        let Self { path, number, offset } = *self;
        let path = path.to_path_buf();
        match error {
            PcapError::IoError(e) if e.kind() == io::ErrorKind::UnexpectedEof => {
                RecordingError::Truncated { path, number, offset }
            }
            PcapError::IoError(source) => RecordingError::Read { path, offset, source },
            other => self.damaged(&other.to_string()),
        }
    }

    fn damaged(&self, reason: &str) -> RecordingError {
        let Self { path, number, offset } = *self;
        RecordingError::Damaged { path: path.to_path_buf(), number, offset, reason: reason.to_owned() }
    }

    fn link_error(&self, link_type: u32) -> RecordingError {
        RecordingError::LinkType { path: self.path.to_path_buf(), offset: self.offset, link_type }
    }
}

/// The first [`PEEKED`] bytes of `reader`, and all of it again.
fn peek(mut reader: Box<dyn Read + Send>) -> io::Result<(Vec<u8>, Input)> {
    let mut start = Vec::new();
    reader.by_ref().take(PEEKED).read_to_end(&mut start)?;
    Ok((start.clone(), Box::new(Cursor::new(start).chain(reader))))
}

/// Length of the section header at the start of a pcapng file; its byte order is told by the word after the length.
fn section_header_bytes(start: &[u8]) -> u64 {
    let word = |at: usize| start.get(at..).and_then(|b| b.first_chunk().copied()).unwrap_or_default();
    let length =
        if word(8) == PCAPNG_BIG_ENDIAN { u32::from_be_bytes(word(4)) } else { u32::from_le_bytes(word(4)) };
    u64::from(length)
}
