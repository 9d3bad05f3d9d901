//! Writes recordings: the same calls give the same bytes.
//!
//! Packets are Ethernet, IPv4, UDP or TCP, with right lengths and checksums, so that Wireshark follows them. A station's
//! hardware address is `02:00` and the four bytes of its IPv4 address (locally administered).

use std::collections::BTreeMap;
use std::io::{self, Write};
use std::net::{Ipv4Addr, SocketAddrV4};
use std::path::{Path, PathBuf};

use etherparse::{IpHeaders, PacketBuilder, PacketBuilderStep, TcpHeader};
use flate2::write::GzEncoder;
use flate2::{Compression, GzBuilder};
use pcap_file::pcap::{PcapHeader, PcapWriter, RawPcapPacket};
use pcap_file::{DataLink, Endianness, PcapError, TsResolution};

use crate::atomic::{AtomicFile, WriteError};

/// Address of the DCA1000EVM (factory setting).
pub const RADAR_IP: Ipv4Addr = Ipv4Addr::new(192, 168, 33, 180);
/// Address to which the DCA1000EVM sends (factory setting): the bridge.
pub const BRIDGE_IP: Ipv4Addr = Ipv4Addr::new(192, 168, 33, 30);
/// Address of the RFID reader in recordings made here.
pub const READER_IP: Ipv4Addr = Ipv4Addr::new(192, 168, 33, 40);
/// Address of the host in recordings made here.
pub const HOST_IP: Ipv4Addr = Ipv4Addr::new(192, 168, 33, 20);

/// Longest UDP payload over IPv4 (65535 - 20 - 8).
const MAX_UDP_PAYLOAD: usize = 65_507;
/// Payload of a full TCP segment on Ethernet (1500 - 20 - 20).
const SEGMENT: usize = 1_460;
/// Snapshot length that tcpdump writes by default.
const SNAPSHOT: u32 = 262_144;
const TIME_TO_LIVE: u8 = 64;
const WINDOW: u16 = 65_535;
const MICROSECONDS: u64 = 1_000_000;

/// Why a recording cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum WriterError {
    /// The file.
    #[error(transparent)]
    File(#[from] WriteError),
    /// The time does not fit pcap's 32-bit seconds.
    #[error(
        "{path}: a packet at {time_us} us: a pcap recording holds 2^32 seconds; count from the recording's start"
    )]
    Time {
        /// The file.
        path: PathBuf,
        /// Time of the packet.
        time_us: u64,
    },
    /// A datagram that IPv4 cannot carry.
    #[error("{path}: a datagram of {bytes} bytes: IPv4 carries {MAX_UDP_PAYLOAD} at most; send it in parts")]
    TooLong {
        /// The file.
        path: PathBuf,
        /// Bytes of its payload.
        bytes: usize,
    },
}

/// A recording in the making; it appears under its name when it is [finished](Self::finish).
///
/// ```
/// # let directory = tempfile::tempdir().unwrap();
/// # let path = directory.path().join("session.pcap.gz");
/// use std::net::SocketAddrV4;
///
/// use rfhoi::recording::{BRIDGE_IP, RADAR_IP, Recording, Writer};
///
/// let (radar, bridge) = (SocketAddrV4::new(RADAR_IP, 4098), SocketAddrV4::new(BRIDGE_IP, 4098));
/// let mut writer = Writer::create(&path)?;
/// writer.udp(0, radar, bridge, b"first")?;
/// writer.udp(370, radar, bridge, b"second")?;
/// writer.finish()?;
///
/// let times: Result<Vec<u64>, _> = Recording::open(&path)?.map(|r| r.map(|r| r.time_us)).collect();
/// assert_eq!(times?, [0, 370]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Writer {
    pcap: PcapWriter<Output>,
    path: PathBuf,
    /// Next sequence number of each direction of the open connections: of (sender, receiver).
    next: BTreeMap<(SocketAddrV4, SocketAddrV4), u32>,
    connections: u32,
    packet: Vec<u8>,
}

impl Writer {
    /// Starts a recording, gzip-compressed if the name ends in `.gz`.
    ///
    /// # Errors
    /// [`WriterError::File`].
    pub fn create(path: impl AsRef<Path>) -> Result<Self, WriterError> {
        let path = path.as_ref().to_path_buf();
        let file = AtomicFile::create(&path)?;
        let output = if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("gz")) {
            // No time and no operating system, so that the same packets give the same file.
            const UNKNOWN_OS: u8 = 255;
            let builder = GzBuilder::new().mtime(0).operating_system(UNKNOWN_OS);
            Output::Gzip(Box::new(builder.write(file, Compression::default())))
        } else {
            Output::Plain(file)
        };
        let header = PcapHeader {
            snaplen: SNAPSHOT,
            datalink: DataLink::ETHERNET,
            ts_resolution: TsResolution::MicroSecond,
            endianness: Endianness::Little,
            ..PcapHeader::default()
        };
        let pcap = PcapWriter::with_header(output, header).map_err(|e| write_error(&path, e))?;
        Ok(Self { pcap, path, next: BTreeMap::new(), connections: 0, packet: Vec::new() })
    }

    /// Writes a datagram at `time_us` after the recording's start, or in UTC where that is known.
    ///
    /// # Errors
    /// Any [`WriterError`].
    pub fn udp(
        &mut self,
        time_us: u64,
        source: SocketAddrV4,
        destination: SocketAddrV4,
        payload: &[u8],
    ) -> Result<(), WriterError> {
        if payload.len() > MAX_UDP_PAYLOAD {
            return Err(WriterError::TooLong { path: self.path.clone(), bytes: payload.len() });
        }
        self.packet.clear();
        ip(source, destination)
            .udp(source.port(), destination.port())
            .write(&mut self.packet, payload)
            .map_err(|e| self.built(e))?;
        self.write_packet(time_us)
    }

    /// Writes the next bytes from `source` to `destination` at `time_us` after the recording's start, in segments as
    /// Ethernet carries them. The first bytes between two endpoints are preceded by the handshake; the one with the lower
    /// port listens.
    ///
    /// # Errors
    /// [`WriterError::File`] or [`WriterError::Time`].
    pub fn tcp(
        &mut self,
        time_us: u64,
        source: SocketAddrV4,
        destination: SocketAddrV4,
        bytes: &[u8],
    ) -> Result<(), WriterError> {
        if !self.next.contains_key(&(source, destination)) {
            self.handshake(time_us, source, destination)?;
        }
        let mut chunks = bytes.chunks(SEGMENT).peekable();
        while let Some(chunk) = chunks.next() {
            let flags = flags(|h| h.psh = chunks.peek().is_none());
            self.segment(time_us, source, destination, flags, chunk)?;
        }
        Ok(())
    }

    /// Closes the connection between two endpoints, `source` first, if it is open; later bytes open a new one.
    ///
    /// # Errors
    /// [`WriterError::File`] or [`WriterError::Time`].
    pub fn close(
        &mut self,
        time_us: u64,
        source: SocketAddrV4,
        destination: SocketAddrV4,
    ) -> Result<(), WriterError> {
        if self.next.contains_key(&(source, destination)) {
            let (fin, ack) = (flags(|h| h.fin = true), flags(|_| {}));
            self.segment(time_us, source, destination, fin.clone(), &[])?;
            self.segment(time_us, destination, source, fin, &[])?;
            self.segment(time_us, source, destination, ack, &[])?;
            self.next.remove(&(source, destination));
            self.next.remove(&(destination, source));
        }
        Ok(())
    }

    /// Completes the recording and puts it in its place.
    ///
    /// # Errors
    /// [`WriterError::File`].
    pub fn finish(self) -> Result<(), WriterError> {
        let file = match self.pcap.into_writer() {
            Output::Plain(file) => file,
            Output::Gzip(gzip) => {
                gzip.finish().map_err(|source| WriteError::Write { path: self.path.clone(), source })?
            }
        };
        Ok(file.commit()?)
    }

    fn handshake(&mut self, time_us: u64, a: SocketAddrV4, b: SocketAddrV4) -> Result<(), WriterError> {
        let (client, server) = if a.port() < b.port() { (b, a) } else { (a, b) };
        for direction in [(client, server), (server, client)] {
            // Far apart, so that no two streams of a recording look alike.
            self.connections = self.connections.wrapping_add(1);
            self.next.insert(direction, self.connections << 24);
        }
        // The very first SYN acknowledges nothing.
        let syn = TcpHeader { syn: true, ..TcpHeader::default() };
        self.segment(time_us, client, server, syn, &[])?;
        self.segment(time_us, server, client, flags(|h| h.syn = true), &[])?;
        self.segment(time_us, client, server, flags(|_| {}), &[])
    }

    /// Writes one segment of an open connection and moves its sequence number on.
    fn segment(
        &mut self,
        time_us: u64,
        source: SocketAddrV4,
        destination: SocketAddrV4,
        flags: TcpHeader,
        payload: &[u8],
    ) -> Result<(), WriterError> {
        let sequence_number = self.next.get(&(source, destination)).copied().unwrap_or_default();
        let expected = self.next.get(&(destination, source)).copied().unwrap_or_default();
        let header = TcpHeader {
            source_port: source.port(),
            destination_port: destination.port(),
            sequence_number,
            acknowledgment_number: if flags.ack { expected } else { 0 },
            window_size: WINDOW,
            ..flags
        };
        // SYN and FIN take one number each (RFC 9293, 3.4).
        let taken = payload.len() as u32 + u32::from(header.syn) + u32::from(header.fin);
        self.next.insert((source, destination), sequence_number.wrapping_add(taken));
        self.packet.clear();
        ip(source, destination)
            .tcp_header(header)
            .write(&mut self.packet, payload)
            .map_err(|e| self.built(e))?;
        self.write_packet(time_us)
    }

    fn write_packet(&mut self, time_us: u64) -> Result<(), WriterError> {
        let Ok(ts_sec) = u32::try_from(time_us / MICROSECONDS) else {
            return Err(WriterError::Time { path: self.path.clone(), time_us });
        };
        let length = self.packet.len() as u32;
        let raw = RawPcapPacket {
            ts_sec,
            ts_frac: (time_us % MICROSECONDS) as u32,
            incl_len: length,
            orig_len: length,
            data: self.packet.as_slice().into(),
        };
        self.pcap.write_raw_packet(&raw).map_err(|e| write_error(&self.path, e))?;
        Ok(())
    }

    fn built(&self, error: etherparse::err::packet::BuildWriteError) -> WriterError {
        WriteError::Write { path: self.path.clone(), source: io::Error::other(error) }.into()
    }
}

enum Output {
    Plain(AtomicFile),
    Gzip(Box<GzEncoder<AtomicFile>>),
}

impl Write for Output {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self {
            Self::Plain(file) => file.write(bytes),
            Self::Gzip(gzip) => gzip.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match self {
            Self::Plain(file) => file.flush(),
            Self::Gzip(gzip) => gzip.flush(),
        }
    }
}

fn flags(set: impl FnOnce(&mut TcpHeader)) -> TcpHeader {
    let mut header = TcpHeader { ack: true, ..TcpHeader::default() };
    set(&mut header);
    header
}

fn ip(source: SocketAddrV4, destination: SocketAddrV4) -> PacketBuilderStep<IpHeaders> {
    let hardware = |ip: Ipv4Addr| {
        let [a, b, c, d] = ip.octets();
        [0x02, 0x00, a, b, c, d]
    };
    let (from, to) = (*source.ip(), *destination.ip());
    PacketBuilder::ethernet2(hardware(from), hardware(to)).ipv4(from.octets(), to.octets(), TIME_TO_LIVE)
}

fn write_error(path: &Path, error: PcapError) -> WriteError {
    let source = match error {
        PcapError::IoError(source) => source,
        other => io::Error::other(other),
    };
    WriteError::Write { path: path.to_path_buf(), source }
}
