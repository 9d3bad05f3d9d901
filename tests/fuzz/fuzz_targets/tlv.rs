//! The SDK demo's data UART: frame search, views, and the path to packets.
//!
//! The first byte of a part says what it becomes: bytes as they are, a TLV of the frame that is being written, or that
//! frame, whole or with bytes missing.
#![no_main]

use libfuzzer_sys::fuzz_target;
use rfhoi_firmware::bridge::UartPath;
use rfhoi_firmware::mmwave::tlv::{
    Counts, FrameHeader, FrameWriter, HeaderFormat, HeatMap, RangeDoppler, StreamParser, Tlv,
};
use rfhoi_firmware::uplink::Uplink;
use rfhoi_shared::config::{Processing, RadarConfig, RadarInput};
use rfhoi_shared::radar::{RadarProfile, RangeGate};
use rfhoi_shared::units::BridgeTime;
use rfhoi_shared::wire::Packet;

const CAPACITY: usize = 512;

/// Range bins of [`config`]; its Doppler map fits a frame.
const BINS: u16 = 16;

fn config() -> RadarConfig {
    let profile = RadarProfile {
        samples: BINS,
        rx_mask: 1,
        loops: 4,
        frame_period_us: 10_000,
        ..RadarProfile::bridge()
    };
    let processing = Processing::with_gate(&profile, RangeGate { first: 2, bins: BINS - 2 });
    RadarConfig { profile, input: RadarInput::Uart, processing }
}

fn stream(data: &[u8], format: HeaderFormat) -> Vec<u8> {
    let mut stream = Vec::new();
    let mut tlvs: Vec<(u32, &[u8])> = Vec::new();
    let mut number = 0;
    let mut rest = data;
    while let Some((&kind, after)) = rest.split_first() {
        let (&length, after) = after.split_first().unwrap_or((&0, after));
        let (part, after) = after.split_at_checked(length.into()).unwrap_or((after, &[]));
        rest = after;
        match kind {
            0..=99 => stream.extend(part),
            100..=199 => tlvs.push((u32::from(kind) % 12, part)),
            _ => {
                let mut buffer = [kind; 2 * CAPACITY];
                let header = FrameHeader { version: 0x0306_0000, number, ..FrameHeader::default() };
                number += 1;
                let mut writer = FrameWriter::new(&mut buffer, format).expect("a header fits");
                let fits = tlvs.drain(..).all(|(code, payload)| writer.raw(code, payload).is_ok());
                let frame = if fits { writer.finish(header).unwrap_or_default() } else { &[] };
                let missing = if kind < 220 { part.len().min(frame.len()) } else { 0 };
                let at = part.first().map_or(0, |&b| usize::from(b) * (frame.len() - missing) / 256);
                stream.extend(&frame[..at]);
                stream.extend(&frame[at + missing..]);
            }
        }
    }
    stream
}

/// What a parser delivers: numbers and TLVs of its frames, and its counts.
type Delivered = (Vec<(u32, Vec<(u32, Vec<u8>)>)>, Counts);

fn parse<'a>(chunks: impl Iterator<Item = &'a [u8]>, format: HeaderFormat) -> Delivered {
    let mut parser = StreamParser::<CAPACITY>::new(format);
    let mut frames = Vec::new();
    let mut bytes = 0;
    let mut frame_bytes = 0;
    let mut take = |frame: rfhoi_firmware::mmwave::tlv::Frame<'_>| {
        frame_bytes += u64::from(frame.header.total_length);
        frame.views().flatten().for_each(walk);
        assert!(
            frame.points().all(|(point, side)| point.to_wire(side).snr_decidb.is_some() == side.is_some())
        );
        let tlvs = frame.tlvs().map(|raw| (raw.code, raw.payload.to_vec())).collect();
        frames.push((frame.header.number, tlvs));
    };
    for mut chunk in chunks {
        bytes += chunk.len() as u64;
        while let Some(frame) = parser.next(&mut chunk) {
            take(frame);
        }
        assert!(chunk.is_empty(), "all of a chunk is taken");
    }
    while let Some(frame) = parser.finish() {
        take(frame);
    }
    let counts = *parser.counts();
    assert_eq!(counts.complete as usize, frames.len());
    // Padding may be missing, so frames may claim more than there is, but none of the rest is unaccounted for.
    assert!(counts.junk_bytes <= bytes && counts.junk_bytes + frame_bytes >= bytes);
    assert!(counts.leading_junk_bytes <= counts.junk_bytes && counts.too_long <= counts.truncated);
    (frames, counts)
}

fn walk(view: Tlv<'_>) {
    match view {
        Tlv::RangeDopplerHeatmap(cells) => {
            let Some(map) = RangeDoppler::new(cells, BINS) else { return };
            let half = (map.doppler_bins() / 2) as i16;
            for range in 0..usize::from(BINS) {
                let row = map.row(range).expect("a row for each range");
                let signed = -half..map.doppler_bins() as i16 - half;
                let mut signed: Vec<_> = signed.map(|d| map.get(range, d).expect("a cell")).collect();
                signed.rotate_left(half as usize);
                assert!(row.iter().eq(signed));
            }
        }
        Tlv::AzimuthHeatmap(cells) | Tlv::AzimuthElevationHeatmap(cells) => {
            if let Some(map) = HeatMap::new(cells, BINS) {
                assert!(
                    (0..usize::from(BINS)).all(|r| map.row(r).is_some_and(|row| row.len() == map.antennas()))
                );
            }
        }
        Tlv::Temperatures(temperatures) => {
            let _ = temperatures.hottest();
        }
        _ => {}
    }
}

fn packets(stream: &[u8]) {
    let mut path = UartPath::<CAPACITY>::new(&config());
    let mut uplink = Uplink::new(1);
    let mut send = |stream, bytes: &[u8]| {
        assert_eq!(Packet::decode(bytes).expect("what is sent decodes").header.stream, stream);
        true
    };
    path.push(BridgeTime(0), stream, &mut uplink, &mut send);
    path.finish(BridgeTime(0), &mut uplink, &mut send);
    assert_eq!(uplink.unsent(), 0, "every message fits a packet");
}

fuzz_target!(|data: &[u8]| {
    let Some((&cut, data)) = data.split_first() else { return };
    let format = if cut & 1 == 0 { HeaderFormat::Subframe } else { HeaderFormat::NoSubframe };
    for stream in [data, &stream(data, format)] {
        let whole = parse(std::iter::once(stream), format);
        assert_eq!(parse(stream.chunks(usize::from(cut / 2) + 1), format), whole);
        packets(stream);
    }
});
