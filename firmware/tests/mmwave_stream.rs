//! The frame search on simulated streams: whole, lossy, hostile, and cut anywhere.

use proptest::collection::vec;
use proptest::prelude::*;
use rfhoi_firmware::mmwave::MAGIC;
use rfhoi_firmware::mmwave::tlv::{
    ComplexI16, Counts, DetectedPoint, Elements, FrameHeader, FrameWriter, HeaderFormat, HeatMap,
    RangeDoppler, RawTlv, SideInfo, Statistics, StreamParser, Temperatures, Tlv, TlvKind, WriteError,
};

/// Small, so that frames that are too long for it are small too.
const CAPACITY: usize = 512;

/// A delivered frame, owned.
#[derive(Debug, Clone, PartialEq)]
struct Owned {
    header: FrameHeader,
    tlvs: Vec<(u32, Vec<u8>)>,
}

/// Runs `bytes`, cut into chunks of the given sizes over and over, through a parser.
fn read(bytes: &[u8], chunks: &[usize], format: HeaderFormat) -> (Vec<Owned>, Counts) {
    let mut parser = StreamParser::<CAPACITY>::new(format);
    let mut frames = Vec::new();
    let mut take = |frame: rfhoi_firmware::mmwave::tlv::Frame<'_>| {
        let tlvs = frame.tlvs().map(|raw| (raw.code, raw.payload.to_vec())).collect();
        frames.push(Owned { header: frame.header, tlvs });
    };
    let mut rest = bytes;
    for &size in chunks.iter().cycle() {
        let (mut chunk, after) = rest.split_at(size.clamp(1, rest.len().max(1)).min(rest.len()));
        rest = after;
        let mut calls = 0;
        while let Some(frame) = parser.next(&mut chunk) {
            take(frame);
            calls += 1;
            assert!(calls <= bytes.len(), "no progress");
        }
        assert!(chunk.is_empty(), "all of a chunk is taken");
        if rest.is_empty() {
            break;
        }
    }
    while let Some(frame) = parser.finish() {
        take(frame);
    }
    (frames, *parser.counts())
}

fn read_whole(bytes: &[u8]) -> (Vec<Owned>, Counts) {
    read(bytes, &[usize::MAX], HeaderFormat::Subframe)
}

/// A frame of these TLVs over padding of these bytes.
fn write(number: u32, tlvs: &[(u32, Vec<u8>)], padding: &[u8; 31], format: HeaderFormat) -> Vec<u8> {
    let mut buffer = padding.repeat(40);
    let end: usize = tlvs.iter().map(|(_, payload)| payload.len() + 8).sum::<usize>() + format.bytes();
    buffer[end..end + 31].copy_from_slice(padding);
    let mut writer = FrameWriter::new(&mut buffer, format).expect("room");
    for (code, payload) in tlvs {
        writer.raw(*code, payload).expect("room");
    }
    writer.finish(FrameHeader { number, ..FrameHeader::default() }).expect("room").to_vec()
}

fn plain(number: u32, payload: usize) -> Vec<u8> {
    write(number, &[(2, vec![7; payload])], &[0; 31], HeaderFormat::Subframe)
}

fn numbers(frames: &[Owned]) -> Vec<u32> {
    frames.iter().map(|f| f.header.number).collect()
}

#[test]
fn a_lossless_stream_has_no_junk() {
    let stream: Vec<u8> = (0..9).flat_map(|n| plain(n, n as usize * 7)).collect();
    let (frames, counts) = read_whole(&stream);
    assert_eq!(numbers(&frames), (0..9).collect::<Vec<_>>());
    assert_eq!((counts.complete, counts.truncated, counts.resyncs, counts.junk_bytes), (9, 0, 0, 0));
    assert_eq!(counts.tlvs.of(TlvKind::RangeProfile), 9);
}

#[test]
fn a_frame_comes_with_its_last_tlv() {
    let stream = plain(1, 10);
    let end = 40 + 8 + 10;
    let mut parser = StreamParser::<CAPACITY>::new(HeaderFormat::Subframe);
    assert!(parser.next(&mut &stream[..end - 1]).is_none());
    assert!(parser.next(&mut &stream[end - 1..end]).is_some(), "its padding is not awaited");

    // Unless its end could begin a magic: the next byte decides, or the stream's end.
    let stream = write(1, &[(2, vec![0, 2, 1, 4])], &[0; 31], HeaderFormat::Subframe);
    let mut parser = StreamParser::<CAPACITY>::new(HeaderFormat::Subframe);
    assert!(parser.next(&mut &stream[..52]).is_none());
    assert!(parser.next(&mut &stream[52..53]).is_some());
    let mut parser = StreamParser::<CAPACITY>::new(HeaderFormat::Subframe);
    assert!(parser.next(&mut &stream[..52]).is_none());
    assert!(parser.finish().is_some());
}

#[test]
fn a_magic_in_the_padding_is_not_believed() {
    let mut padding = [0xEE; 31];
    padding[3..11].copy_from_slice(&MAGIC);
    let tlvs = [(2, vec![1; 17])];
    let stream: Vec<u8> = (0..5).flat_map(|n| write(n, &tlvs, &padding, HeaderFormat::Subframe)).collect();
    let (frames, counts) = read_whole(&stream);
    assert_eq!(numbers(&frames), [0, 1, 2, 3, 4]);
    assert_eq!((counts.truncated, counts.resyncs, counts.junk_bytes), (0, 0, 0));
}

#[test]
fn padding_may_be_missing() {
    // Without the padding, without its last byte, and without the last byte of a frame that has none.
    let (short, full) = (plain(1, 1), plain(2, 16));
    assert_eq!(full.len(), 64);
    let stream = [&short[..49], &short[..63], &short[..], &full[..63], &short[..], &full[..]].concat();
    let (frames, counts) = read_whole(&stream);
    assert_eq!(numbers(&frames), [1, 1, 1, 1, 2], "of the cut frame a byte is missing");
    assert_eq!((counts.truncated, counts.resyncs, counts.junk_bytes), (1, 3, 63));
}

#[test]
fn a_loss_costs_its_frame_only() {
    let stream: Vec<u8> = (0..4).flat_map(|n| plain(n, 200)).collect();
    let size = stream.len() / 4;
    for (start, length) in
        [(size, 1), (size + 3, 5), (size + 9, 4), (size + 37, 20), (size + 60, 180), (size + 8, size - 8)]
    {
        let mut lossy = stream.clone();
        lossy.drain(start..start + length);
        let (frames, counts) = read_whole(&lossy);
        assert_eq!(numbers(&frames), [0, 2, 3], "{length} bytes from {start}");
        assert_eq!(counts.junk_bytes, (size - length) as u64);
    }
}

#[test]
fn hostile_headers() {
    let patched = |offset: usize, value: u32| {
        let mut frame = plain(1, 100);
        frame[offset..offset + 4].copy_from_slice(&value.to_le_bytes());
        let (frames, counts) = read_whole(&[frame, plain(2, 0)].concat());
        assert_eq!(numbers(&frames), [2], "{value:#x} at {offset}");
        assert_eq!(counts.truncated, 1);
        counts
    };
    let (total, tlvs, length) = (12, 32, 44);
    for value in [0, 39, 100, 300] {
        assert_eq!(patched(total, value).too_long, 0);
    }
    assert_eq!(patched(total, CAPACITY as u32).too_long, 1);
    assert_eq!(patched(total, u32::MAX).too_long, 1);
    for value in [0, 3, 100, u32::MAX] {
        patched(tlvs, value);
    }
    for value in [0, 60, 500, u32::MAX - 8, u32::MAX] {
        patched(length, value);
    }
}

#[test]
fn headers_of_36_bytes() {
    let tlvs = [(1, vec![5; 30])];
    let stream: Vec<u8> = (0..3).flat_map(|n| write(n, &tlvs, &[9; 31], HeaderFormat::NoSubframe)).collect();
    let (frames, counts) = read(&stream, &[10], HeaderFormat::NoSubframe);
    assert_eq!(numbers(&frames), [0, 1, 2]);
    assert_eq!(frames[0].tlvs, tlvs);
    assert_eq!(counts.junk_bytes, 0);
}

#[test]
fn maps_have_range_outside() {
    // Codes 100 x range + Doppler bin on the wire; 3 range bins, 4 Doppler bins.
    let payload: Vec<u8> =
        (0..3u16).flat_map(|r| (0..4u16).flat_map(move |d| (100 * r + d).to_le_bytes())).collect();
    let cells = Elements::new(&payload).expect("even");
    let map = RangeDoppler::new(cells, 3).expect("3 x 4");
    let signed = |r| [-3, -2, -1, 0, 1, 2].map(|d| map.get(r, d));
    assert_eq!(signed(1), [None, Some(102), Some(103), Some(100), Some(101), None]);
    assert_eq!(signed(3), [None; 6]);
    assert_eq!(map.row(2).map(|row| row.iter().collect::<Vec<_>>()), Some(vec![200, 201, 202, 203]));
    assert_eq!(map.row(usize::MAX), None);
    assert!(RangeDoppler::new(cells, 5).is_none() && RangeDoppler::new(cells, 0).is_none());

    // The imaginary part goes first.
    let payload = [1, 0, 2, 0, 3, 0, 4, 0];
    let map = HeatMap::new(Elements::new(&payload).expect("two"), 2).expect("2 x 1");
    assert_eq!(map.row(1).and_then(|row| row.get(0)), Some(ComplexI16 { re: 4, im: 3 }));
}

#[test]
fn lengths_are_checked() {
    for (code, good, bad) in [
        (1, 32, 33),
        (2, 2, 3),
        (3, 4, 5),
        (4, 4, 6),
        (5, 2, 1),
        (6, 24, 28),
        (7, 8, 10),
        (8, 0, 2),
        (9, 28, 24),
    ] {
        let payload = [0; 64];
        assert!(matches!(Tlv::parse(RawTlv { code, payload: &payload[..good] }), Ok(Some(_))), "{code}");
        let error = Tlv::parse(RawTlv { code, payload: &payload[..bad] }).expect_err("wrong length");
        assert_eq!((error.kind.code(), error.length), (code, bad));
    }
    assert_eq!(Tlv::parse(RawTlv { code: 10, payload: &[] }), Ok(None));
}

#[test]
fn the_writer_refuses_what_does_not_fit() {
    assert_eq!(FrameWriter::new(&mut [0; 39], HeaderFormat::Subframe).err(), Some(WriteError::Full));
    let mut buffer = [0; 63];
    let mut writer = FrameWriter::new(&mut buffer, HeaderFormat::Subframe).expect("40 bytes");
    assert_eq!(writer.raw(2, &[0; 16]), Err(WriteError::Full));
    let writer = FrameWriter::new(&mut buffer, HeaderFormat::Subframe).expect("40 bytes");
    assert_eq!(writer.finish(FrameHeader::default()), Err(WriteError::Full));
}

fn any_point() -> impl Strategy<Value = (DetectedPoint, SideInfo)> {
    (any::<[f32; 4]>(), any::<[i16; 2]>()).prop_map(
        |([x_m, y_m, z_m, velocity_m_s], [snr_decidb, noise_decidb])| {
            (DetectedPoint { x_m, y_m, z_m, velocity_m_s }, SideInfo { snr_decidb, noise_decidb })
        },
    )
}

fn any_complex() -> impl Strategy<Value = ComplexI16> {
    any::<[i16; 2]>().prop_map(|[re, im]| ComplexI16 { re, im })
}

/// Frames and what a lossy line makes of them.
fn any_piece() -> impl Strategy<Value = Vec<u8>> {
    let tlvs = vec((0u32..12, vec(any::<u8>(), 0..80)), 0..4);
    let frame = (any::<u32>(), tlvs, any::<[u8; 31]>(), any::<bool>()).prop_map(
        |(number, tlvs, mut padding, stale)| {
            if stale {
                padding[2..10].copy_from_slice(&MAGIC);
            }
            write(number, &tlvs, &padding, HeaderFormat::Subframe)
        },
    );
    let frame = frame.boxed();
    prop_oneof![
        4 => frame.clone(),
        1 => (frame.clone(), any::<prop::sample::Index>()).prop_map(|(mut f, at)| { f.truncate(at.index(f.len())); f }),
        1 => (frame.clone(), any::<prop::sample::Index>(), 1usize..50).prop_map(|(mut f, at, n)| {
            let start = at.index(f.len());
            f.drain(start..(start + n).min(f.len()));
            f
        }),
        1 => (frame, 0usize..50, any::<u8>()).prop_map(|(mut f, at, value)| { let at = at % f.len(); f[at] = value; f }),
        1 => vec(any::<u8>(), 0..60),
        1 => (0..=MAGIC.len()).prop_map(|n| MAGIC[..n].to_vec()),
        1 => vec(prop::sample::select(vec![0u8, 1, 2, 3, 4, 5, 6, 7, 8, 40, 64]), 0..60),
    ]
}

proptest! {
    #[test]
    fn typed_frames_read_back(
        points in vec(any_point(), 0..5),
        (range, noise) in (vec(any::<u16>(), 0..20), vec(any::<u16>(), 0..20)),
        azimuth in vec(any_complex(), 0..8),
        doppler in vec(any::<u16>(), 0..20),
        statistics: [u32; 6],
        (status, time_ms, sensors) in (any::<i32>(), any::<u32>(), any::<[i16; 10]>()),
        (number, cpu_cycles, subframe) in any::<(u32, u32, u32)>(),
    ) {
        let [processing_us, transmit_us, frame_margin_us, chirp_margin_us, active_load_percent, idle_load_percent] = statistics;
        let statistics = Statistics { processing_us, transmit_us, frame_margin_us, chirp_margin_us, active_load_percent, idle_load_percent };
        let [r0, r1, r2, r3, t0, t1, t2, power, d0, d1] = sensors;
        let temperatures = Temperatures { status, time_ms, rx: [r0, r1, r2, r3], tx: [t0, t1, t2], power, digital: [d0, d1] };
        let header = FrameHeader { version: 0x0306_0000, platform: 0xA_1843, number, cpu_cycles, points: points.len() as u32, subframe, ..FrameHeader::default() };
        let (positions, side): (Vec<_>, Vec<_>) = points.iter().copied().unzip();

        let mut buffer = [0; 1024];
        let mut writer = FrameWriter::new(&mut buffer, HeaderFormat::Subframe).unwrap();
        writer.points(&positions, &side).unwrap();
        writer.elements(TlvKind::RangeProfile, &range).unwrap();
        writer.elements(TlvKind::NoiseProfile, &noise).unwrap();
        writer.elements(TlvKind::AzimuthElevationHeatmap, &azimuth).unwrap();
        writer.elements(TlvKind::RangeDopplerHeatmap, &doppler).unwrap();
        writer.statistics(statistics).unwrap();
        writer.temperatures(&temperatures).unwrap();
        let bytes = writer.finish(header).unwrap();
        prop_assert_eq!(bytes.len() % 32, 0);

        let mut parser = StreamParser::<1100>::new(HeaderFormat::Subframe);
        let mut input = bytes;
        let frame = match parser.next(&mut input) {
            Some(frame) => frame,
            None => { parser = StreamParser::new(HeaderFormat::Subframe); let mut input = bytes; let _ = parser.next(&mut input); parser.finish().unwrap() }
        };
        let expected = FrameHeader { total_length: bytes.len() as u32, tlvs: frame.tlvs().count() as u32, ..header };
        prop_assert_eq!(frame.header, expected);
        let bits = |p: DetectedPoint| [p.x_m, p.y_m, p.z_m, p.velocity_m_s].map(f32::to_bits);
        let read: Vec<_> = frame.points().map(|(p, s)| (bits(p), s.unwrap())).collect();
        prop_assert_eq!(read, points.iter().map(|&(p, s)| (bits(p), s)).collect::<Vec<_>>());
        for view in frame.views() {
            match view.unwrap() {
                Tlv::DetectedPoints(p) => prop_assert_eq!(p.len(), points.len()),
                Tlv::SideInfo(s) => prop_assert_eq!(s.iter().collect::<Vec<_>>(), side.clone()),
                Tlv::RangeProfile(v) => prop_assert_eq!(v.iter().collect::<Vec<_>>(), range.clone()),
                Tlv::NoiseProfile(v) => prop_assert_eq!(v.iter().collect::<Vec<_>>(), noise.clone()),
                Tlv::AzimuthElevationHeatmap(v) => prop_assert_eq!(v.iter().collect::<Vec<_>>(), azimuth.clone()),
                Tlv::RangeDopplerHeatmap(v) => prop_assert_eq!(v.iter().collect::<Vec<_>>(), doppler.clone()),
                Tlv::Statistics(s) => prop_assert_eq!(s, statistics),
                Tlv::Temperatures(t) => prop_assert_eq!(t, temperatures),
                Tlv::AzimuthHeatmap(_) => prop_assert!(false, "was not written"),
            }
        }
    }

    /// Whatever the bytes and however they are cut, the same frames come out and all bytes are accounted for.
    #[test]
    fn chunks_do_not_matter(pieces in vec(any_piece(), 0..12), chunks in vec(1usize..200, 1..8), short: bool) {
        let format = if short { HeaderFormat::NoSubframe } else { HeaderFormat::Subframe };
        let stream = pieces.concat();
        let whole = read(&stream, &[usize::MAX], format);
        prop_assert_eq!(&read(&stream, &chunks, format), &whole);
        prop_assert_eq!(&read(&stream, &[1], format), &whole);

        let (frames, counts) = whole;
        prop_assert_eq!(frames.len(), counts.complete as usize);
        let size = |f: &Owned| format.bytes() + f.tlvs.iter().map(|(_, p)| p.len() + 8).sum::<usize>();
        let (delivered, padding): (usize, usize) =
            frames.iter().map(|f| (size(f), f.header.total_length as usize - size(f))).fold((0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
        let known = delivered as u64 + counts.junk_bytes;
        prop_assert!(known <= stream.len() as u64 && known + padding as u64 >= stream.len() as u64);
    }

    #[test]
    fn frames_beside_a_loss_are_found(
        sizes in vec(32usize..150, 3..6),
        fill in 9u8..,
        (victim, start, length) in any::<(prop::sample::Index, prop::sample::Index, prop::sample::Index)>(),
        chunk in 1usize..300,
    ) {
        // Payloads are free of magics, as real ones are.
        let frames: Vec<Vec<u8>> =
            (0..).zip(&sizes).map(|(n, &size)| write(n, &[(2, vec![fill; size])], &[fill; 31], HeaderFormat::Subframe)).collect();
        let victim = victim.index(frames.len());
        let mut lossy = frames.clone();
        let start = start.index(lossy[victim].len());
        let end = start + 1 + length.index(lossy[victim].len() - start);
        lossy[victim].drain(start..end);
        let (read, counts) = read(&lossy.concat(), &[chunk], HeaderFormat::Subframe);
        let mut found = numbers(&read);
        // As many bytes of the last TLV as there is padding look like lost padding.
        let total = frames[victim].len();
        let looks_like_padding = start >= 48 && end - start <= total - 48 - sizes[victim];
        if looks_like_padding {
            prop_assert_eq!(counts.truncated, 0);
        } else {
            found.insert(found.iter().position(|&n| n > victim as u32).unwrap_or(found.len()), victim as u32);
        }
        prop_assert_eq!(found, (0..frames.len() as u32).collect::<Vec<_>>());
    }

    #[test]
    fn any_bytes_are_safe(bytes in vec(any::<u8>(), 0..2000), code in 0u32..12) {
        let _ = read(&bytes, &[97], HeaderFormat::Subframe);
        if let Ok(Some(Tlv::RangeDopplerHeatmap(cells))) = Tlv::parse(RawTlv { code, payload: &bytes })
            && let Some(map) = RangeDoppler::new(cells, u16::from(bytes.first().copied().unwrap_or(3))) {
            for doppler in [i16::MIN, -1, 0, 1, i16::MAX] {
                let _ = map.get(bytes.len(), doppler);
            }
        }
    }
}
