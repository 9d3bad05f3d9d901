//! CLI profiles: faults that must be named, and texts that must read back.

use proptest::collection::vec;
use proptest::prelude::*;
use rfhoi_firmware::mmwave::cfg::{
    self, Board, CliProfile, DemoOptions, GuiMonitor, LvdsData, LvdsStream, PointOutput, TEXT_CAPACITY,
};
use rfhoi_firmware::mmwave::studio::StudioProfile;
use rfhoi_firmware::mmwave::{Problem, Unsupported};
use rfhoi_shared::array::{AntennaArray, Mounting};
use rfhoi_shared::radar::{IqOrder, ProfileError, RadarProfile, SampleFormat};

type Text = heapless::String<TEXT_CAPACITY>;

fn written(profile: &RadarProfile, demo: &DemoOptions) -> Text {
    let mut text = Text::new();
    cfg::write(profile, demo, &mut text).expect("the capacity is enough for any profile");
    text
}

fn board(profile: &RadarProfile) -> Board {
    Board { array: profile.array, mounting: profile.mounting }
}

/// Line, command and fault of the stock AOP text with `old` replaced.
fn fault(old: &str, new: &str) -> (u32, &'static str, Problem) {
    let profile = RadarProfile::bridge();
    let text = written(&profile, &DemoOptions::default());
    assert!(text.contains(old), "`{old}` is in\n{text}");
    let error = CliProfile::parse(&text.replace(old, new), board(&profile)).expect_err(new);
    (error.line, error.command, error.problem)
}

#[test]
fn the_bridge_profile_is_the_stock_set() {
    let demo = DemoOptions { lvds: LvdsStream::RAW, ..DemoOptions::default() };
    expect_test::expect![[r"
        sensorStop
        flushCfg
        dfeDataOutputMode 1
        channelCfg 15 7 0
        adcCfg 2 1
        adcbufCfg -1 0 1 1 1
        profileCfg 0 77 5.3 6 65 0 0 60 1 128 2200 0 0 30
        chirpCfg 0 0 0 0 0 0 0 1
        chirpCfg 1 1 0 0 0 0 0 2
        chirpCfg 2 2 0 0 0 0 0 4
        frameCfg 0 2 64 0 100 1 0
        lowPower 0 0
        guiMonitor -1 1 1 0 0 0 1
        cfarCfg -1 0 2 8 4 3 0 15 1
        cfarCfg -1 1 0 8 4 4 1 15 1
        multiObjBeamForming -1 1 0.5
        clutterRemoval -1 0
        calibDcRangeSig -1 0 -5 8 256
        extendedMaxVelocity -1 0
        lvdsStreamCfg -1 0 1 0
        compRangeBiasAndRxChanPhase 0.0 1 0 1 0 1 0 1 0 1 0 1 0 1 0 1 0 1 0 1 0 1 0 1 0
        measureRangeBiasAndRxChanPhase 0 1.5 0.2
        CQRxSatMonitor 0 3 6 119 0
        CQSigImgMonitor 0 63 4
        analogMonitor 0 0
        aoaFovCfg -1 -90 90 -90 90
        cfarFovCfg -1 0 0 5.50
        cfarFovCfg -1 1 -4.49 4.49
        calibData 0 0 0
        sensorStart
    "]]
    .assert_eq(&written(&RadarProfile::bridge(), &demo));
}

/// The commands whose values are derived, against those of the visualiser's own files.
#[test]
fn monitors_are_those_of_the_stock_profiles() {
    let stock =
        |samples, sample_rate_ksps| RadarProfile { samples, sample_rate_ksps, ..RadarProfile::bridge() };
    for (profile, saturation, image) in [
        (stock(256, 5_209), "CQRxSatMonitor 0 3 5 121 0", "CQSigImgMonitor 0 127 4"),
        (stock(128, 12_499), "CQRxSatMonitor 0 3 4 31 0", "CQSigImgMonitor 0 63 4"),
        (stock(64, 3_764), "CQRxSatMonitor 0 3 4 51 0", "CQSigImgMonitor 0 31 4"),
        (stock(64, 2_000), "CQRxSatMonitor 0 3 4 99 0", "CQSigImgMonitor 0 31 4"),
    ] {
        let text = written(&profile, &DemoOptions::default());
        assert!(text.contains(saturation) && text.contains(image), "{text}");
    }
}

#[test]
fn faults_are_named_with_their_line() {
    use Problem as P;
    let profile_line = "profileCfg 0 77 5.3 6 65 0 0 60 1 128 2200 0 0 30";
    let without = |old: &str| fault(old, "");
    assert_eq!(without("channelCfg 15 7 0"), (30, "channelCfg", P::Missing));
    assert_eq!(without("adcCfg 2 1"), (30, "adcCfg", P::Missing));
    assert_eq!(without("adcbufCfg -1 0 1 1 1"), (30, "adcbufCfg", P::Missing));
    assert_eq!(without(profile_line), (30, "profileCfg", P::Missing));
    assert_eq!(without("frameCfg 0 2 64 0 100 1 0"), (30, "frameCfg", P::Missing));
    assert_eq!(without("chirpCfg 1 1 0 0 0 0 0 2"), (11, "frameCfg", P::ChirpUndefined(1)));

    assert_eq!(fault("adcCfg 2 1", "adcCfg 2"), (5, "adcCfg", P::TooFewArguments(1)));
    assert_eq!(fault("frameCfg 0 2 64", "frameCfg 0 2 6x4"), (11, "frameCfg", P::Number(3)));
    assert_eq!(fault("Cfg 0 77 5.3", "Cfg 0 77 -5.3"), (7, "profileCfg", P::Number(3)));
    assert_eq!(fault("profileCfg 0", "profileCfg 4"), (7, "profileCfg", P::Number(1)));
    assert_eq!(fault("frameCfg 0 2", "frameCfg 2 0"), (11, "frameCfg", P::ChirpOrder));
    assert_eq!(fault("frameCfg 0 2", "frameCfg 0 511"), (11, "frameCfg", P::TooManySlots(512)));
    assert_eq!(fault("profileCfg 0", "profileCfg 1"), (11, "frameCfg", P::ProfileUndefined(0)));
    assert_eq!(fault("channelCfg 15 7", "channelCfg 15 3"), (10, "chirpCfg", P::TxNotEnabled(4)));
    assert_eq!(fault("adcbufCfg -1 0", "adcbufCfg -1 1"), (6, "adcbufCfg", P::FormatMismatch));

    let unsupported = |old, new, line, command, what| {
        assert_eq!(fault(old, new), (line, command, P::Unsupported(what)), "{new}");
    };
    unsupported("Mode 1", "Mode 3", 3, "dfeDataOutputMode", Unsupported::FrameMode);
    unsupported("sensorStart", "advFrameCfg 2 0 0 1 0", 30, "advFrameCfg", Unsupported::FrameMode);
    unsupported("sensorStart", "bpmCfg -1 1 0 1", 30, "bpmCfg", Unsupported::BinaryPhase);
    unsupported("adcCfg 2 1", "adcCfg 1 1", 5, "adcCfg", Unsupported::AdcBits);
    unsupported("adcCfg 2 1", "adcCfg 2 2", 5, "adcCfg", Unsupported::Complex2x);
    unsupported("adcbufCfg -1 0 1 1", "adcbufCfg -1 0 1 0", 6, "adcbufCfg", Unsupported::Interleaved);
    unsupported("chirpCfg 1 1 0 0 0", "chirpCfg 1 1 0 0 0.05", 9, "chirpCfg", Unsupported::ChirpVariation);
    unsupported("chirpCfg 1 1 0", "chirpCfg 1 1 1", 11, "frameCfg", Unsupported::SeveralProfiles);

    let broken = |old, new, line, command, why| {
        assert_eq!(fault(old, new), (line, command, P::Profile(why)), "{new}");
    };
    broken("128 2200", "100 2200", 7, "profileCfg", ProfileError::Samples(100));
    broken("60 1 128", "0 1 128", 7, "profileCfg", ProfileError::ZeroParameter);
    broken("64 0 100 1", "64 0 0 1", 11, "frameCfg", ProfileError::ZeroParameter);
    broken("64 0 100 1", "48 0 100 1", 11, "frameCfg", ProfileError::Loops(48));
    broken("64 0 100 1", "64 0 10 1", 11, "frameCfg", ProfileError::FrameTooLong(13_497, 10_000));
    broken("channelCfg 15", "channelCfg 16", 4, "channelCfg", ProfileError::RxMask(16));
    broken("2 2 0 0 0 0 0 4", "2 2 0 0 0 0 0 0", 10, "chirpCfg", ProfileError::TxOrder);
}

#[test]
fn errors_read_as_sentences() {
    let error = CliProfile::parse("channelCfg 15 x 0\n", Board::default()).expect_err("x is no mask");
    assert_eq!(error.to_string(), "line 1, channelCfg: argument 2 is no number or out of range");
    let error = CliProfile::parse("", Board::default()).expect_err("empty");
    assert_eq!(error.to_string(), "line 0, channelCfg: is missing");
}

#[test]
fn layout_of_the_text_does_not_matter() {
    let profile = RadarProfile::bridge();
    let text = written(&profile, &DemoOptions::default());
    let parse = |text: &str| CliProfile::parse(text, board(&profile)).expect(text).radar;
    assert_eq!(parse(&text.replace('\n', "  \t\r\n")), profile);
    assert_eq!(parse(&text.replace(' ', "   ")), profile);
    assert_eq!(parse(&text.replace('\n', " % comment\n\n# comment\n")), profile);
    // One command for all chirps that share a transmitter, and one chirp defined again.
    let ranged = text
        .replace("chirpCfg 0 0 0 0 0 0 0 1", "chirpCfg 0 2 0 0 0 0 0 1")
        .replace("chirpCfg 2 2 0 0 0 0 0 4", "chirpCfg 2 2 0 0.0 0.0 0 0 2\nchirpCfg 2 2 0 0 0 0 0 4");
    assert_eq!(parse(&ranged), profile);
    // Boost order, a second profile that the frame does not use, and chirps past the frame.
    let extra = text.replace("Cfg 1 1 0 0 0 0 0 2", "Cfg 1 1 0 0 0 0 0 4").replace(
        "Cfg 2 2 0 0 0 0 0 4",
        "Cfg 2 2 0 0 0 0 0 2\nchirpCfg 3 9 1 0 0 0 0 1\nprofileCfg 1 78 1 1 9 0 0 1 1 16 9 0 0 0",
    );
    assert_eq!(parse(&extra).tx_order.as_slice(), [1, 4, 2]);
}

#[test]
fn a_flush_forgets_what_came_before() {
    let profile = RadarProfile::bridge();
    let old = RadarProfile { tx_order: [1, 2].into_iter().collect(), ..RadarProfile::paper() };
    let demo = DemoOptions::default();
    let mut text = std::string::String::from(written(&old, &demo).as_str());
    text += &written(&profile, &demo);
    assert_eq!(CliProfile::parse(&text, board(&profile)).expect("two texts").radar, profile);
    let flushed = written(&profile, &demo).replace("lowPower 0 0", "flushCfg");
    let error = CliProfile::parse(&flushed, board(&profile)).expect_err("flushed");
    assert_eq!((error.command, error.problem), ("frameCfg", Problem::Missing));
}

#[test]
fn a_platform_comment_names_the_board() {
    let text = written(&RadarProfile::bridge(), &DemoOptions::default());
    let array = |platform: &str| {
        let text = format!("% Platform:{platform}\r\n{}", text.as_str());
        let board = Board { array: AntennaArray::Iwr6843Aop, ..Board::default() };
        CliProfile::parse(&text, board).expect("valid").radar.array
    };
    assert_eq!(array("xWR18xx_AOP"), AntennaArray::Awr1843Aop);
    assert_eq!(array("xWR18xx"), AntennaArray::Xwr1843Boost);
    assert_eq!(array("xWR16xx"), AntennaArray::Xwr1642Boost);
    assert_eq!(array("xWR64xx"), AntennaArray::Iwr6843Aop);
}

/// A log made like Studio's, of three transmitters.
fn studio_log() -> String {
    let lines = [
        "IsFPGA:,0,0,",
        "API:select_chip_version,XWR1843,0,",
        "API:ChannelConfig,7,15,0,",
        "API:AdcOutConfig,2,1,0,",
        "API:DataFmtConfig,15,2,1,1,1,0,",
        "API:DataPathConfig,1,1,0,2,0,",
        "API:ProfileConfig,0,1435384036,10000,600,13000,0,0,621,0,256,10000,0,0,30,0,",
        "API:ChirpConfig,0,2,0,0,0,0,0,1,0,",
        "API:ChirpConfig,1,1,0,0,0,0,0,2,0,",
        "API:ChirpConfig,2,2,0,0,0,0,0,4,0,",
        "API:ChirpConfig,2,2,0,0,0,0,0,7,-5,",
        "API:FrameConfig,0,2,8,16,20000000,0,512,0,",
    ];
    lines.map(|line| format!("02-Jan-2026 17:15:04: {line}\r\n")).concat()
}

#[test]
fn studio_calls() {
    let log = studio_log();
    let read = StudioProfile::parse(&log, Board::default()).expect("a log");
    assert_eq!(read.radar.tx_order.as_slice(), [1, 2, 4], "the call that failed is of no effect");
    assert_eq!((read.radar.loops, read.frames, read.radar.frame_period_us), (16, 8, 100_000));
    assert_eq!(read.radar.format, SampleFormat::Complex(IqOrder::QFirst));

    let sixty = StudioProfile::parse(&log.replace("XWR1843", "XWR6843"), Board::default()).expect("a log");
    assert_eq!(sixty.radar.start_khz, 57_750_000, "three quarters");
    assert_eq!(sixty.radar.slope_khz_per_us, 22_486);

    let fault = |old: &str, new: &str| {
        assert!(log.contains(old));
        let e = StudioProfile::parse(&log.replace(old, new), Board::default()).expect_err(new);
        (e.line, e.command, e.problem)
    };
    use Problem as P;
    assert_eq!(fault("DataFmtConfig", "x"), (12, "DataFmtConfig", P::Missing));
    assert_eq!(
        fault("DataPathConfig,1,1", "DataPathConfig,1,6"),
        (6, "DataPathConfig", P::Unsupported(Unsupported::DataPath))
    );
    assert_eq!(
        fault("DataFmtConfig,15,2,1,1,1", "DataFmtConfig,15,2,1,1,0"),
        (5, "DataFmtConfig", P::Unsupported(Unsupported::Interleaved))
    );
    assert_eq!(fault("0,0,621", "0,0,-621"), (7, "ProfileConfig", P::Number(8)));
    assert_eq!(
        fault("IsFPGA:,0", "API:AdvancedFrameConfig,2,0"),
        (1, "AdvancedFrameConfig", P::Unsupported(Unsupported::FrameMode))
    );
    assert_eq!(
        fault("256,10000", "512,3000"),
        (7, "ProfileConfig", P::Profile(ProfileError::SamplingPastRamp(176_666, 130_000)))
    );
}

fn any_array() -> impl Strategy<Value = AntennaArray> {
    use AntennaArray as A;
    prop::sample::select(vec![A::Awr1843Aop, A::Xwr1843Boost, A::Xwr1642Boost, A::Iwr6843Aop])
}

fn any_mounting() -> impl Strategy<Value = Mounting> {
    use Mounting as M;
    prop::sample::select(vec![M::Upright, M::Quarter, M::Half, M::ThreeQuarters])
}

prop_compose! {
    /// Any valid profile.
    fn any_profile()(
        (start_khz, slope_khz_per_us) in (1u32..=90_000_000, 1u32..=300_000),
        (idle_ns, adc_start_ns, slack_ns) in (0u32..=5_000_000, 0u32..=100_000, 0u32..=100_000),
        (samples, sample_rate_ksps) in (4u32..=10, 1_000u32..=40_000),
        format in prop::sample::select(vec![
            SampleFormat::Real, SampleFormat::Complex(IqOrder::IFirst), SampleFormat::Complex(IqOrder::QFirst),
        ]),
        (rx_mask, tx_order) in (1u8..=15, vec(1u8..=7, 1..=3)),
        (loops, pause_us) in (0u32..=8, 0u32..=1_000_000),
        (array, mounting) in (any_array(), any_mounting()),
    ) -> RadarProfile {
        let samples = 1u16 << samples;
        let sampling_ns = u32::from(samples) * 1_000_000 / sample_rate_ksps;
        let mut profile = RadarProfile {
            start_khz, slope_khz_per_us, idle_ns, adc_start_ns, samples, sample_rate_ksps, format, rx_mask, array, mounting,
            ramp_end_ns: adc_start_ns + sampling_ns + slack_ns,
            tx_order: tx_order.into_iter().collect(),
            loops: 1 << loops,
            frame_period_us: 0,
        };
        let active_us = profile.chirp_period_ns() * u64::from(profile.chirps_per_frame()) / 1_000;
        profile.frame_period_us = u32::try_from(active_us * 100 / 99).expect("under 5 s") + 1 + pause_us;
        profile
    }
}

prop_compose! {
    fn any_demo()(
        frames: u16,
        flags: [bool; 8],
        data in prop::sample::select(vec![LvdsData::Off, LvdsData::Adc, LvdsData::CpAdcCq]),
        points in prop::sample::select(vec![PointOutput::Off, PointOutput::WithSideInfo, PointOutput::Alone]),
    ) -> DemoOptions {
        let [header, software, clutter_removal, range_profile, noise_profile, azimuth_heatmap, range_doppler_heatmap, statistics] = flags;
        DemoOptions {
            frames,
            lvds: LvdsStream { header, data, software },
            gui: GuiMonitor { points, range_profile, noise_profile, azimuth_heatmap, range_doppler_heatmap, statistics },
            clutter_removal,
        }
    }
}

proptest! {
    #[test]
    fn written_profiles_read_back(profile in any_profile(), demo in any_demo()) {
        prop_assert_eq!(profile.validate(), Ok(()));
        let text = written(&profile, &demo);
        let read = CliProfile::parse(&text, board(&profile)).map_err(|e| TestCaseError::fail(e.to_string()))?;
        prop_assert_eq!(read, CliProfile { radar: profile, demo });
    }

    #[test]
    fn any_text_is_safe(text: String) {
        let _ = CliProfile::parse(&text, Board::default());
        let _ = StudioProfile::parse(&text, Board::default());
    }

    /// Numbers and words of a valid text replaced by others.
    #[test]
    fn mutated_texts_are_safe(
        at: prop::sample::Index,
        token in "[0-9.-]{0,12}|[a-zA-Z]{0,12}|[ \n%#]{1,3}|65535|4294967295|18446744073709551615",
        log: bool,
    ) {
        let text = if log { studio_log() } else { written(&RadarProfile::bridge(), &DemoOptions::default()).as_str().into() };
        let places: Vec<usize> = text.match_indices([' ', ',', '\n']).map(|(i, _)| i + 1).collect();
        let start = places[at.index(places.len())];
        let end = text[start..].find([' ', ',', '\n']).map_or(text.len(), |i| start + i);
        let mutated = format!("{}{token}{}", &text[..start], &text[end..]);
        for result in [
            CliProfile::parse(&mutated, Board::default()).map(|p| p.radar),
            StudioProfile::parse(&mutated, Board::default()).map(|p| p.radar),
        ].into_iter().flatten() {
            prop_assert_eq!(result.validate(), Ok(()));
        }
    }
}
