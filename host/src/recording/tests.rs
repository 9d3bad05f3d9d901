use std::io::Cursor;

use etherparse::PacketBuilder;
use flate2::Compression;
use flate2::write::GzEncoder;
use proptest::prelude::*;

use super::*;

const RADAR: SocketAddrV4 = SocketAddrV4::new(RADAR_IP, 4098);
const BRIDGE: SocketAddrV4 = SocketAddrV4::new(BRIDGE_IP, 4098);
const CLIENT: SocketAddrV4 = SocketAddrV4::new(BRIDGE_IP, 50_000);
const READER: SocketAddrV4 = SocketAddrV4::new(READER_IP, 5084);

fn written(name: &str, write: impl Fn(&mut Writer)) -> Vec<u8> {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join(name);
    let mut writer = Writer::create(&path).unwrap();
    write(&mut writer);
    writer.finish().unwrap();
    std::fs::read(path).unwrap()
}

fn read(bytes: &[u8]) -> (Vec<Record>, Counts) {
    let mut recording = Recording::from_reader("test.pcap", Cursor::new(bytes.to_vec())).unwrap();
    let records = recording.by_ref().collect::<Result<_, _>>().unwrap();
    (records, recording.counts())
}

/// The streams of all directions, joined.
fn joined(records: &[Record], source: SocketAddrV4) -> Vec<u8> {
    records.iter().filter(|r| r.source == source).flat_map(|r| r.payload.clone()).collect()
}

/// A pcap file of these link-layer packets, one a millisecond.
fn pcap(packets: &[Vec<u8>], link_type: u32) -> Vec<u8> {
    let mut file = Vec::new();
    for word in [0xa1b2_c3d4_u32, 0x0004_0002, 0, 0, 65_535, link_type] {
        file.extend(word.to_le_bytes());
    }
    for (number, packet) in packets.iter().enumerate() {
        let length = packet.len() as u32;
        for word in [100, number as u32 * 1_000, length, length] {
            file.extend(word.to_le_bytes());
        }
        file.extend(packet);
    }
    file
}

fn segment(sequence: u32, payload: &[u8]) -> Vec<u8> {
    let mut packet = Vec::new();
    PacketBuilder::ethernet2([2; 6], [4; 6])
        .ipv4(READER.ip().octets(), CLIENT.ip().octets(), 64)
        .tcp(READER.port(), CLIENT.port(), sequence, 1024)
        .ack(1)
        .write(&mut packet, payload)
        .unwrap();
    packet
}

fn pieces(packets: &[Vec<u8>]) -> (Vec<(bool, Vec<u8>)>, Counts) {
    let (records, counts) = read(&pcap(packets, 1));
    let piece = |r: Record| match r.protocol {
        Protocol::Tcp { continues } => (continues, r.payload),
        Protocol::Udp => panic!("no datagrams here"),
    };
    (records.into_iter().map(piece).collect(), counts)
}

#[test]
fn the_same_calls_give_the_same_bytes() {
    let write = |w: &mut Writer| {
        w.udp(5, RADAR, BRIDGE, &[1, 2, 3]).unwrap();
        w.tcp(7, READER, CLIENT, b"hello").unwrap();
        w.close(9, CLIENT, READER).unwrap();
    };
    for name in ["a.pcap", "a.pcap.gz"] {
        assert_eq!(written(name, write), written(name, write), "{name}");
    }
    assert_eq!(read(&written("a.pcap", write)), read(&written("a.pcap.gz", write)));
}

#[test]
fn streams_of_a_recording_come_back_with_their_restarts() {
    let long: Vec<u8> = (0..5_000_u32).map(|n| n as u8).collect();
    let (records, counts) = read(&written("s.pcap", |w| {
        w.tcp(100, READER, CLIENT, &long).unwrap();
        w.tcp(200, CLIENT, READER, b"ask").unwrap();
        w.close(300, READER, CLIENT).unwrap();
        w.tcp(400, READER, CLIENT, b"again").unwrap();
    }));
    let of_reader: Vec<_> = records.iter().filter(|r| r.source == READER).collect();
    let continues: Vec<_> =
        of_reader.iter().map(|r| r.protocol == Protocol::Tcp { continues: true }).collect();
    assert_eq!(continues, [false, true, true, true, false], "four segments, then a new connection");
    assert_eq!(joined(&records, READER), [&long[..], b"again"].concat());
    assert_eq!(joined(&records, CLIENT), b"ask");
    assert_eq!(records.last().unwrap().time_us, 300, "counted from the first packet");
    assert_eq!((counts.missing_bytes, counts.retransmitted, counts.out_of_order), (0, 0, 0));
}

#[test]
fn lost_segments_are_counted_and_marked() {
    let (pieces, counts) = pieces(&[segment(1_000, b"abc"), segment(1_010, b"xyz"), segment(1_013, b"!")]);
    let expected = [(false, b"abc".to_vec()), (false, b"xyz".to_vec()), (true, b"!".to_vec())];
    assert_eq!(pieces, expected);
    assert_eq!(counts.missing_bytes, 7);
    assert_eq!(counts.out_of_order, 2);
}

#[test]
fn retransmissions_and_overlaps_are_trimmed() {
    let packets = [segment(0, b"abcd"), segment(0, b"abcd"), segment(2, b"cdef"), segment(u32::MAX, b"?")];
    let (pieces, counts) = pieces(&packets);
    assert_eq!(pieces, [(false, b"abcd".to_vec()), (true, b"ef".to_vec())]);
    assert_eq!(counts.retransmitted, 3);
}

#[test]
fn memory_for_waiting_segments_is_bounded() {
    let mut packets = vec![segment(0, b"a")];
    packets.extend((0..600_u32).map(|n| segment(2 + n * 1_000, &[7; 1_000])));
    let (pieces, counts) = pieces(&packets);
    assert_eq!(counts.missing_bytes, 1);
    assert_eq!(pieces.iter().map(|(_, b)| b.len()).sum::<usize>(), 600_001);
    assert_eq!(pieces.iter().filter(|(continues, _)| !continues).count(), 2, "one start, one hole");
}

#[test]
fn a_connection_whose_start_was_missed_is_taken_up() {
    let (pieces, counts) =
        pieces(&[segment(5, b"old"), segment(0x9000_0000, b"new"), segment(0x9000_0003, b"er")]);
    assert_eq!(pieces, [(false, b"old".to_vec()), (false, b"new".to_vec()), (true, b"er".to_vec())]);
    assert_eq!(counts.resynchronised, 1);
}

#[test]
fn what_is_no_use_is_counted() {
    let mut fragment = Vec::new();
    PacketBuilder::ethernet2([2; 6], [4; 6])
        .ipv4([1; 4], [2; 4], 64)
        .udp(1, 2)
        .write(&mut fragment, &[0; 32])
        .unwrap();
    // More-fragments flag; the header's checksum is not verified.
    fragment[14 + 6] = 0x20;
    let arp = [&[0xff; 12][..], &[0x08, 0x06], &[0; 28]].concat();
    let malformed = [&[0xff; 12][..], &[0x08, 0x00], &[0x45; 8]].concat();
    let mut file = pcap(&[fragment, arp, malformed, segment(1, b"cut")], 1);
    // The last packet's original length says that more was on the wire.
    let last = file.len() - segment(1, b"cut").len() - 4;
    file[last..last + 4].copy_from_slice(&2_000_u32.to_le_bytes());
    let (records, counts) = read(&file);
    assert!(records.is_empty());
    let expected = Counts { packets: 4, fragments: 1, other: 1, malformed: 1, cut: 1, ..Counts::default() };
    assert_eq!(counts, expected);
}

#[test]
fn link_types_of_linux_and_raw_ip() {
    let ethernet = segment(1, b"x");
    let ip = &ethernet[14..];
    let sll = [&[0, 0, 0, 1, 0, 6, 2, 2, 2, 2, 2, 2, 0, 0, 0x08, 0x00], ip].concat();
    let sll2 = [&[0x08, 0x00, 0, 0, 0, 0, 0, 2, 0, 1, 0, 6, 2, 2, 2, 2, 2, 2, 0, 0], ip].concat();
    for (packet, link_type) in [(&ethernet[..], 1), (ip, 101), (ip, 228), (&sll, 113), (&sll2, 276)] {
        let (records, counts) = read(&pcap(&[packet.to_vec()], link_type));
        assert_eq!(records.len(), 1, "link type {link_type}: {counts:?}");
        assert_eq!(records[0].payload, b"x");
    }
    let recording = Recording::from_reader("w.pcap", Cursor::new(pcap(&[ethernet], 105))).unwrap();
    let error = recording.last().unwrap().unwrap_err().to_string();
    assert!(
        error.contains("w.pcap") && error.contains("link type 105") && error.contains("byte 24"),
        "{error}"
    );
}

fn pcapng(big_endian: bool, resolution: Option<u8>, ticks: &[u64]) -> Vec<u8> {
    let word = |w: u32| if big_endian { w.to_be_bytes() } else { w.to_le_bytes() };
    let half = |h: u16| if big_endian { h.to_be_bytes() } else { h.to_le_bytes() };
    let block = |kind: u32, mut body: Vec<u8>| {
        body.resize(body.len().next_multiple_of(4), 0);
        let length = word(body.len() as u32 + 12);
        [&word(kind)[..], &length, &body, &length].concat()
    };
    let mut file = block(0x0a0d_0d0a, [&word(0x1a2b_3c4d)[..], &half(1), &half(0), &[0xff; 8]].concat());
    let mut interface = [&half(1)[..], &half(0), &word(0)].concat();
    if let Some(code) = resolution {
        interface.extend([&half(9)[..], &half(1), &[code, 0, 0, 0], &word(0)].concat());
    }
    file.extend(block(1, interface));
    for (number, &t) in ticks.iter().enumerate() {
        let packet = segment(1 + number as u32, b"x");
        let length = word(packet.len() as u32);
        let fields = [word(0), word((t >> 32) as u32), word(t as u32), length, length].concat();
        file.extend(block(6, [fields, packet].concat()));
    }
    file
}

#[test]
fn pcapng_of_either_byte_order_and_any_clock() {
    for big_endian in [false, true] {
        for (resolution, ticks) in [(None, 1_500_000), (Some(9), 1_500_000_000), (Some(0x80 | 10), 1_536)] {
            let (records, _) = read(&pcapng(big_endian, resolution, &[0, ticks]));
            let times: Vec<_> = records.iter().map(|r| r.time_us).collect();
            assert_eq!(times, [0, 1_500_000], "{big_endian} {resolution:?}");
        }
    }
    let whole = pcapng(false, None, &[0, 1]);
    let second = whole.len() - (12 + 20 + segment(1, b"x").len().next_multiple_of(4));
    let mut recording =
        Recording::from_reader("c.pcapng", Cursor::new(whole[..whole.len() - 1].to_vec())).unwrap();
    assert!(recording.next().unwrap().is_ok());
    match recording.next() {
        Some(Err(RecordingError::Truncated { number: 2, offset, .. })) => assert_eq!(offset, second as u64),
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_cut_file_names_file_and_byte_after_the_good_records() {
    let whole = written("t.pcap", |w| {
        w.udp(0, RADAR, BRIDGE, &[0; 100]).unwrap();
        w.udp(1, RADAR, BRIDGE, &[0; 100]).unwrap();
    });
    let second = (whole.len() - 24) / 2 + 24;
    for length in second + 1..whole.len() {
        let mut recording =
            Recording::from_reader("cut.pcap", Cursor::new(whole[..length].to_vec())).unwrap();
        assert!(recording.next().unwrap().is_ok());
        let error = recording.next().unwrap().unwrap_err().to_string();
        assert!(error.contains("cut.pcap") && error.contains(&format!("byte {second}")), "{error}");
        assert!(recording.next().is_none());
    }
    let mut gzip = GzEncoder::new(Vec::new(), Compression::default());
    io::Write::write_all(&mut gzip, &whole).unwrap();
    let gzip = gzip.finish().unwrap();
    let cut = Recording::from_reader("cut.gz", Cursor::new(gzip[..gzip.len() - 12].to_vec())).unwrap();
    assert!(matches!(cut.last(), Some(Err(RecordingError::Truncated { .. }))));
}

#[test]
fn other_files_are_refused_by_name() {
    let text =
        Recording::from_reader("notes.txt", Cursor::new(b"hello world, again".to_vec())).err().unwrap();
    assert!(text.to_string().contains("notes.txt is no pcap"), "{text}");
    assert!(matches!(Recording::open("/nonexistent.pcap"), Err(RecordingError::Open { .. })));
    let empty = Recording::from_reader("e", Cursor::new(Vec::new())).err().unwrap();
    assert!(matches!(empty, RecordingError::NotARecording { .. }));
}

#[test]
fn what_pcap_cannot_hold_is_refused() {
    let directory = tempfile::tempdir().unwrap();
    let mut writer = Writer::create(directory.path().join("x.pcap")).unwrap();
    assert!(matches!(
        writer.udp(0, RADAR, BRIDGE, &[0; 65_508]),
        Err(WriterError::TooLong { bytes: 65_508, .. })
    ));
    assert!(matches!(writer.udp(u64::MAX, RADAR, BRIDGE, &[]), Err(WriterError::Time { .. })));
}

proptest! {
    #[test]
    fn datagrams_round_trip(
        start in 0..1_u64 << 40,
        datagrams in prop::collection::vec((0..1_000_000_u64, any::<u32>(), any::<u16>(), prop::collection::vec(any::<u8>(), 0..2_000)), 0..20),
        gzip in any::<bool>(),
    ) {
        let mut time_us = start;
        let mut expected = Vec::new();
        for (later, ip, port, payload) in datagrams {
            if !expected.is_empty() {
                time_us += later;
            }
            let source = SocketAddrV4::new(ip.into(), port);
            expected.push(Record { time_us, source, destination: BRIDGE, protocol: Protocol::Udp, payload });
        }
        let bytes = written(if gzip { "p.pcap.gz" } else { "p.pcap" }, |w| {
            for r in &expected {
                w.udp(r.time_us, r.source, r.destination, &r.payload).unwrap();
            }
        });
        for r in &mut expected {
            r.time_us -= start;
        }
        prop_assert_eq!(read(&bytes).0, expected);
    }

    #[test]
    fn streams_come_back_from_any_order_and_repetition(
        lengths in prop::collection::vec(1..1_400_usize, 1..40),
        first in any::<u32>(),
        order in prop::collection::vec(any::<prop::sample::Index>(), 0..80),
    ) {
        let stream: Vec<u8> = (0..lengths.iter().sum::<usize>()).map(|n| (n * 31 / 7) as u8).collect();
        let mut segments = Vec::new();
        let mut at = 0;
        for length in lengths {
            segments.push(segment(first.wrapping_add(at as u32), &stream[at..at + length]));
            at += length;
        }
        // The first segment stays first: without a SYN it defines where the stream starts.
        let mut packets = vec![segments[0].clone()];
        packets.extend(order.iter().map(|i| i.get(&segments).clone()));
        packets.extend(segments);
        let (pieces, counts) = pieces(&packets);
        prop_assert_eq!(pieces.iter().flat_map(|(_, b)| b.clone()).collect::<Vec<_>>(), stream);
        prop_assert_eq!(pieces.iter().filter(|(continues, _)| !continues).count(), 1);
        prop_assert_eq!(counts.missing_bytes, 0);
    }

    #[test]
    fn arbitrary_bytes_never_panic(
        bytes in prop::collection::vec(any::<u8>(), 0..600),
        start in prop::sample::select(vec![
            vec![],
            pcap(&[], 1),
            pcap(&[segment(9, b"x")], 1),
            pcapng(false, Some(6), &[1]),
            pcapng(true, None, &[1]),
            vec![0x1f, 0x8b, 8, 0, 0, 0, 0, 0, 0, 255],
        ]),
        flip in any::<prop::sample::Index>(),
        with in any::<u8>(),
    ) {
        let mut file = [start, bytes].concat();
        if !file.is_empty() {
            let at = flip.index(file.len());
            file[at] ^= with;
        }
        if let Ok(recording) = Recording::from_reader("fuzz", Cursor::new(file)) {
            for record in recording {
                if record.is_err() { break; }
            }
        }
    }
}
