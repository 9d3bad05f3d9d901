//! The parsers on recordings of real devices.

use std::collections::BTreeMap;

use rfhoi_firmware::mmwave::cfg::{Board, CliProfile, DemoOptions, LvdsData, PointOutput};
use rfhoi_firmware::mmwave::studio::StudioProfile;
use rfhoi_firmware::mmwave::tlv::{Counts, HeaderFormat, StreamParser, Tlv, TlvKind};
use rfhoi_shared::array::{AntennaArray, Mounting};
use rfhoi_shared::radar::{IqOrder, RadarProfile, SampleFormat};

#[path = "../../tests/recorded.rs"]
mod recorded;
use recorded::recorded;

fn capture(name: &str) -> Option<Vec<u8>> {
    recorded(name).map(|path| std::fs::read(path).unwrap())
}

fn text(name: &str) -> Option<String> {
    capture(name).map(|bytes| String::from_utf8(bytes).expect("profiles are ASCII"))
}

/// What a stream holds.
struct Stream {
    numbers: Vec<u32>,
    /// Frames whose header counts other points than its TLV has.
    points_differ: u32,
    /// Kinds in the order of their appearance in a frame, with the number of frames.
    kinds: BTreeMap<Vec<u32>, usize>,
    counts: Counts,
    length: u64,
}

fn read(bytes: &[u8], chunk: usize) -> Stream {
    let mut parser = StreamParser::<8192>::new(HeaderFormat::Subframe);
    let (mut numbers, mut kinds, mut points_differ) = (Vec::new(), BTreeMap::new(), 0);
    let mut take = |frame: rfhoi_firmware::mmwave::tlv::Frame<'_>| {
        numbers.push(frame.header.number);
        *kinds.entry(frame.tlvs().map(|tlv| tlv.code).collect()).or_insert(0) += 1;
        assert_eq!(frame.views().filter(Result::is_err).count(), 0, "lengths fit their kinds");
        points_differ += u32::from(frame.points().count() != frame.header.points as usize);
    };
    for mut input in bytes.chunks(chunk) {
        while let Some(frame) = parser.next(&mut input) {
            take(frame);
        }
    }
    while let Some(frame) = parser.finish() {
        take(frame);
    }
    Stream { numbers, points_differ, kinds, counts: *parser.counts(), length: bytes.len() as u64 }
}

#[test]
fn awr1642_stream_without_loss() {
    let Some(bytes) = capture("uart_tlv/AWR1642_test_data_SDK_3_6_0.dat") else { return };
    for chunk in [1, 7, 64, 1000, bytes.len()] {
        let stream = read(&bytes, chunk);
        assert_eq!(stream.numbers, (69..=168).collect::<Vec<_>>(), "chunks of {chunk}");
        assert_eq!(stream.kinds, BTreeMap::from([(vec![1, 7, 2, 6, 9], 100)]));
        assert_eq!(stream.points_differ, 0);
        assert_eq!(stream.counts.complete, 100);
        assert_eq!(stream.counts.truncated, 1);
        assert_eq!(stream.counts.resyncs, 0);
        assert_eq!(stream.counts.leading_junk_bytes, 376);
        // The truncated last frame is the only other junk.
        assert_eq!(stream.counts.junk_bytes, 376 + 128);
        assert_eq!(stream.counts.tlvs.of(TlvKind::RangeProfile), 100);
        assert_eq!(stream.counts.tlvs.unknown, 0);
    }
}

#[test]
fn awr1642_values_are_those_of_a_room() {
    let Some(bytes) = capture("uart_tlv/AWR1642_test_data_SDK_3_6_0.dat") else { return };
    let mut parser = StreamParser::<8192>::new(HeaderFormat::Subframe);
    let mut input = bytes.as_slice();
    let frame = parser.next(&mut input).expect("there are 100");
    assert_eq!(frame.header.version, 0x0306_0000);
    assert_eq!(frame.header.platform, 0xA_1642);
    let points: Vec<_> = frame.points().collect();
    assert_eq!(points.len(), 6);
    for (point, side) in points {
        let range = point.x_m.hypot(point.y_m).hypot(point.z_m);
        assert!(range > 0.0 && range < 9.02, "range {range} m within the profile's span");
        assert!(
            side.expect("sent with the points").snr_decidb >= 150,
            "over the profile's threshold of 15 dB"
        );
    }
    for view in frame.views() {
        match view.expect("lengths fit") {
            Tlv::RangeProfile(levels) => assert_eq!(levels.len(), 256),
            Tlv::Statistics(s) => {
                assert_eq!((s.processing_us, s.transmit_us, s.active_load_percent), (4281, 9417, 4));
            }
            Tlv::Temperatures(t) => {
                assert_eq!((t.status, t.time_ms), (0, 655_887));
                assert_eq!(t.rx, [49, 49, 48, 48]);
                assert_eq!(t.hottest(), Some(51));
            }
            _ => {}
        }
    }
}

/// The logger of these streams wrote each frame without its last byte, so that the next one comes a byte before its
/// time; and bytes were lost. It also took the bytes for text: no byte 0x0D is in them, a 0x0A stands in its place, so
/// that even the values of complete frames are not those of the radar everywhere.
#[test]
fn iwr6843_streams_with_loss() {
    for (name, headers, expected) in [
        ("uart_tlv/iwr6843aop_static_2024-11-28.dat", 100, (89, 11)),
        ("uart_tlv/iwr6843aop_straightline_2024-12-09.dat", 200, (176, 24)),
    ] {
        let Some(bytes) = capture(name) else { continue };
        assert!(!bytes.contains(&b'\r'));
        for chunk in [1, 13, 1000, bytes.len()] {
            let stream = read(&bytes, chunk);
            let counts = stream.counts;
            println!("{name}, chunks of {chunk}: {counts:?}");
            assert_eq!((counts.complete, counts.truncated), expected, "{name}");
            assert_eq!(counts.complete + counts.truncated, headers, "each magic is one or the other");
            assert_eq!(stream.kinds, BTreeMap::from([(vec![1, 7, 2, 6, 9], counts.complete as usize)]));
            assert_eq!(counts.leading_junk_bytes, 0);
            assert!(counts.junk_bytes < stream.length);
        }
    }
}

#[test]
fn stock_profiles() {
    let board = Board { array: AntennaArray::Xwr1843Boost, mounting: Mounting::Quarter };
    let parse = |name: &str| text(name).map(|text| CliProfile::parse(&text, board).expect("a stock profile"));

    if let Some(CliProfile { radar, demo }) = parse("uart_tlv/AWR1642-SDK_3_6_0.cfg") {
        let expected = RadarProfile {
            start_khz: 77_000_000,
            slope_khz_per_us: 70_000,
            idle_ns: 429_000,
            adc_start_ns: 7_000,
            ramp_end_ns: 57_140,
            samples: 256,
            sample_rate_ksps: 5_209,
            format: SampleFormat::Complex(IqOrder::QFirst),
            rx_mask: 15,
            tx_order: [1, 2].into_iter().collect(),
            loops: 16,
            frame_period_us: 100_000,
            array: AntennaArray::Xwr1642Boost,
            mounting: Mounting::Quarter,
        };
        assert_eq!(radar, expected);
        assert!(radar.fits_stock_firmware());
        // The comments of the file itself.
        assert!((radar.range_bin().0 - 0.044).abs() < 5e-4);
        assert!((radar.range_span().0 - 11.155).abs() < 0.001, "all bins; the file counts 80 % of them");
        // The file reckons with the carrier at the ramp's start, the profile with the sampled band's middle.
        let at_start = radar.centre_hz() / (f64::from(radar.start_khz) * 1e3);
        assert!((f64::from(radar.velocity_span().0) * at_start - 1.0).abs() < 0.005);
        assert!((f64::from(radar.velocity_bin().0) * at_start - 0.125).abs() < 0.001);
        assert_eq!(demo, DemoOptions::default());
        assert_eq!(demo.lvds.data, LvdsData::Off);
    }
    if let Some(CliProfile { radar, demo }) = parse("uart_tlv/iwr6843aop_profile_azim60_elev30_optimized.cfg")
    {
        assert_eq!(
            (radar.start_khz, radar.slope_khz_per_us, radar.frame_period_us),
            (60_000_000, 82_237, 33_333)
        );
        assert_eq!((radar.samples, radar.loops, radar.tx_order.as_slice()), (128, 128, &[1, 2][..]));
        assert_eq!(radar.array, AntennaArray::Iwr6843Aop);
        assert_eq!((demo.gui.points, demo.gui.range_profile), (PointOutput::WithSideInfo, false));
        assert!(!demo.gui.sends(TlvKind::Statistics));
    }
    if let Some(CliProfile { radar, demo }) =
        parse("radar_misc/iwr6843aop_range_doppler_csv/config_file_64x64.cfg")
    {
        assert_eq!((radar.samples, radar.loops, radar.tx_order.as_slice()), (64, 64, &[1, 4][..]));
        assert_eq!(radar.array, board.array, "xWR68xx without AOP is no board of ours: the caller's");
        assert!(demo.gui.sends(TlvKind::RangeDopplerHeatmap) && demo.gui.sends(TlvKind::Temperatures));
        assert_eq!(demo.gui.points, PointOutput::Off);
    }
    if let Some(CliProfile { radar, demo }) = parse("radar_misc/awr1642_gesture_points/1642config.cfg") {
        assert_eq!((radar.samples, radar.sample_rate_ksps, radar.frame_period_us), (64, 2_000, 40_000));
        assert_eq!(radar.format, SampleFormat::Complex(IqOrder::IFirst));
        assert!(demo.clutter_removal);
    }
}

#[test]
fn studio_log() {
    let Some(log) = text("raw_adc/awr1642_pipe_LogFile_0.txt") else { return };
    let board = Board { array: AntennaArray::Xwr1642Boost, mounting: Mounting::Upright };
    let StudioProfile { radar, frames } = StudioProfile::parse(&log, board).expect("a log of Studio 2.1");
    let expected = RadarProfile {
        start_khz: 77_000_000,
        slope_khz_per_us: 29_982,
        idle_ns: 100_000,
        adc_start_ns: 6_000,
        ramp_end_ns: 130_000,
        samples: 256,
        sample_rate_ksps: 10_000,
        format: SampleFormat::Complex(IqOrder::IFirst),
        rx_mask: 15,
        tx_order: [1].into_iter().collect(),
        loops: 1,
        frame_period_us: 1_000,
        array: AntennaArray::Xwr1642Boost,
        mounting: Mounting::Upright,
    };
    assert_eq!(radar, expected);
    assert_eq!(frames, 1000);
    // The raw capture made with it: 4,096,000 bytes in 1000 frames; 767 MHz and 0.195 m a bin by its description.
    assert_eq!(radar.frame_bytes(), 4096);
    assert!((radar.sampled_bandwidth_hz() / 1e6 - 767.5).abs() < 0.1);
    assert!((radar.range_bin().0 - 0.195).abs() < 5e-4);
}
