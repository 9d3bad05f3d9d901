use proptest::prelude::*;
use rfhoi_shared::array::AntennaArray;
use rfhoi_shared::config::{Endpoint, MAX_READER_ANTENNAS};
use rfhoi_shared::radar::{IqOrder, MAX_TX_SLOTS, SampleFormat};

use super::*;

const FILE: &str = "bridge.toml";

fn parsed(text: &str) -> Result<BridgeConfig, String> {
    let path = Path::new(FILE);
    Settings::parse(path, text).and_then(|s| s.config(path)).map_err(|e| e.to_string())
}

/// Each field at its largest, as in the wire contract's table of sizes.
fn largest() -> BridgeConfig {
    let big = u32::MAX;
    let profile = RadarProfile {
        start_khz: big,
        slope_khz_per_us: big,
        idle_ns: big,
        adc_start_ns: big,
        ramp_end_ns: big,
        samples: u16::MAX,
        sample_rate_ksps: big,
        format: SampleFormat::Complex(IqOrder::IFirst),
        rx_mask: u8::MAX,
        tx_order: [u8::MAX; MAX_TX_SLOTS].into_iter().collect(),
        loops: u16::MAX,
        frame_period_us: big,
        array: AntennaArray::Iwr6843Aop,
        mounting: MOUNTINGS[3],
    };
    let endpoint = Endpoint { address: [255; 4], port: u16::MAX };
    let processing = Processing {
        gate: RangeGate { first: u16::MAX, bins: u16::MAX },
        clutter: ClutterRemoval::Background { time_constant: Seconds(f32::MAX) },
        range_time_columns: u16::MAX,
        detection: Decibels(f32::MIN_POSITIVE),
        zero_doppler_guard: u8::MAX,
    };
    BridgeConfig {
        address: Address::Static { address: [255; 4], prefix: 32, gateway: Some([255; 4]) },
        host: Some(endpoint),
        radar: RadarConfig {
            profile,
            input: RadarInput::Dca1000 { address: [255; 4], packet_delay_us: u16::MAX },
            processing,
        },
        reader: Some(ReaderConfig {
            endpoint,
            antennas: [AntennaPort(u16::MAX); MAX_READER_ANTENNAS].into_iter().collect(),
            power_index: u16::MAX,
            rf_mode: u16::MAX,
            session: u8::MAX,
            search_mode: u16::MAX,
            population: u16::MAX,
            keepalive_ms: big,
        }),
        scene: Scene {
            depth: Metres(f32::MAX),
            fastest_hand: MetresPerSecond(0.1),
            fastest_tag: MetresPerSecond(1.0 / 3.0),
            tags: u8::MAX,
            reader_antennas: u8::MAX,
        },
    }
}

#[test]
fn default_and_largest_survive_the_file() {
    let default = BridgeConfig::default();
    assert_eq!(parsed(&write(&default)), Ok(default.clone()));
    assert_eq!(parsed(&write(&largest())), Ok(largest()));
    let small = BridgeConfig {
        address: Address::Dhcp,
        radar: RadarConfig { input: RadarInput::Uart, ..default.radar.clone() },
        ..default.clone()
    };
    assert_eq!(parsed(&write(&small)), Ok(small));
    assert_eq!(parsed(""), Ok(default), "everything may be left away");
}

#[test]
fn comments_in_the_written_file_say_what_holds_without_them() {
    let reader = Some(ReaderConfig::for_scene([192, 168, 33, 40], &Scene::default()));
    let config = BridgeConfig { reader, ..BridgeConfig::default() };
    // A key that is commented out has no blank behind its `#`; the examples of keys without a value are not meant.
    let no_values = ["gateway", "host", "clutter_time_constant_s"];
    let uncommented = |text: &str| -> String {
        let line = |line: &str| match line.strip_prefix('#') {
            Some(key) if !key.starts_with(' ') && !no_values.iter().any(|n| key.starts_with(n)) => {
                format!("{key}\n")
            }
            _ => format!("{line}\n"),
        };
        text.lines().map(line).collect()
    };
    let text = uncommented(&write(&config));
    assert_eq!(parsed(&text), Ok(config.clone()), "{text}");
    let with_example = uncommented(&write(&BridgeConfig::default()));
    assert_eq!(parsed(&with_example), Ok(config), "the reader is an example where there is none");
}

#[test]
fn what_is_left_away_follows_from_the_rest() {
    let text =
        "[scene]\ndepth_m = 2.0\n[profile]\nbase = \"fine\"\nloops = 4\n[reader]\naddress = \"10.0.0.7\"\n";
    let config = parsed(text).unwrap();
    assert_eq!(config.radar.profile, RadarProfile { loops: 4, ..RadarProfile::fine() });
    assert_eq!(config.radar.processing.gate, config.radar.profile.gate_to(Metres(2.0)));
    assert_eq!(config.radar.processing.range_time_columns, 4);
    assert!(matches!(config.radar.processing.clutter, ClutterRemoval::Background { .. }));
    let reader = config.reader.as_ref().unwrap();
    assert_eq!((reader.endpoint.address, reader.endpoint.port), ([10, 0, 0, 7], 5084));
    assert_eq!(reader.antennas.len(), 4);
    assert_eq!(check(Path::new(FILE), &config, 256 * 1024).map_err(|e| e.to_string()), Ok(()));
}

#[test]
fn a_profile_can_be_a_file_beside() {
    use rfhoi_firmware::mmwave::cfg::{self, DemoOptions};
    let folder = tempfile::tempdir().unwrap();
    let mut text = String::new();
    cfg::write(&RadarProfile::paper(), &DemoOptions::default(), &mut text).unwrap();
    std::fs::write(folder.path().join("my.cfg"), text).unwrap();
    let file = folder.path().join(FILE);
    std::fs::write(&file, "[profile]\nbase = \"my.cfg\"\nloops = 64\n").unwrap();
    let profile = read(&file).unwrap().radar.profile;
    assert_eq!((profile.samples, profile.loops), (256, 64));
    std::fs::write(&file, "[profile]\nbase = \"other.cfg\"\n").unwrap();
    let error = read(&file).unwrap_err().to_string();
    assert!(error.contains("bridge.toml: base of [profile]") && error.contains("other.cfg"), "{error}");
}

#[test]
fn wrong_keys_and_values_are_named_with_their_line() {
    for (text, words) in [
        ("[scene]\ndepth_m = 2\ntagz = 3\n", &["line 3", "tagz", "fastest_tag_m_per_s"][..]),
        ("[sceen]\n", &["line 1", "sceen"]),
        ("[scene]\ntags = 300\n", &["line 2", "300", "u8"]),
        ("[scene\n", &["line 1"]),
        ("[network]\naddress = \"192.168.33.30\"\n", &["line 2", "192.168.33.30/24"]),
        ("[network]\naddress = \"dhcp\"\ngateway = \"10.0.0.1\"\n", &["network.gateway", "DHCP"]),
        ("[network]\ngateway = \"10.0.0.1\"\n", &["network.gateway"]),
        ("[radar]\ninput = \"usb\"\n", &["line 2", "usb", "dca1000", "uart"]),
        ("[radar]\ninput = \"uart\"\npacket_delay_us = 9\n", &["radar.packet_delay_us", "uart"]),
        ("[profile]\nquarter_turns = 4\n", &["profile.quarter_turns", "0 to 3"]),
        ("[profile]\ntransmitters = [1, 2, 3, 4]\n", &["profile.transmitters", "4 of them", "at most 3"]),
        ("[profile]\ntransmitters = [0]\n", &["profile.transmitters", "counted from 1"]),
        ("[profile]\ntransmitters = [\"a\"]\n", &["line 2", "number of a transmitter"]),
        ("[processing]\nclutter_time_constant_s = 1.0\n", &["clutter_time_constant_s", "background"]),
        ("[reader]\nsession = 1\n", &["line 1", "address"]),
        ("[reader]\naddress = \"reader\"\n", &["line 2", "192.168.33.40"]),
    ] {
        let error = parsed(text).unwrap_err();
        assert!(error.starts_with("bridge.toml: ") && !error.contains('\n'), "{error}");
        for word in words {
            assert!(error.contains(word), "{word} is not in: {error}");
        }
    }
}

#[test]
fn broken_rules_name_the_section_to_correct() {
    let broken = |text: &str| {
        let config = parsed(text).unwrap();
        check(Path::new(FILE), &config, 256 * 1024).unwrap_err().to_string()
    };
    let error = broken("[profile]\nsamples = 100\n");
    assert!(error.contains("100 samples a chirp") && error.ends_with("correct [profile]"), "{error}");
    let error = broken("[profile]\nbase = \"fine\"\n");
    assert!(error.contains("442368 bytes, the bridge has 262144") && error.contains("depth_m"), "{error}");
    let error = broken("[scene]\nfastest_hand_m_per_s = 6.0\n");
    assert!(error.contains("at up to 6.00 m/s") && error.contains("[scene]"), "{error}");
}

proptest! {
    #[test]
    fn any_configuration_survives_the_file(
        numbers in any::<[u32; 7]>(),
        small in any::<[u16; 6]>(),
        masks in any::<[u8; 4]>(),
        reals in prop::array::uniform4(any::<f32>().prop_filter("finite", |x| x.is_finite())),
        named in 0..4usize,
    ) {
        let mut config = largest();
        let p = &mut config.radar.profile;
        [p.start_khz, p.slope_khz_per_us, p.idle_ns, p.adc_start_ns, p.ramp_end_ns, p.sample_rate_ksps,
            p.frame_period_us] = numbers;
        [p.samples, p.loops, ..] = small;
        p.rx_mask = masks[0];
        p.tx_order = masks[1..].iter().copied().collect();
        if let Some(name) = NAMES.get(named) {
            config.radar.profile = RadarProfile::named(name).unwrap();
        }
        config.radar.processing.gate = RangeGate { first: small[2], bins: small[3] };
        config.radar.processing.range_time_columns = small[4];
        config.radar.processing.detection = Decibels(reals[0]);
        config.radar.processing.clutter = match small[5] % 3 {
            0 => ClutterRemoval::Off,
            1 => ClutterRemoval::Mean,
            _ => ClutterRemoval::Background { time_constant: Seconds(reals[1]) },
        };
        config.scene.depth = Metres(reals[2]);
        config.scene.fastest_tag = MetresPerSecond(reals[3]);
        if small[5] & 1 == 1 {
            config.reader = None;
        }
        prop_assert_eq!(parsed(&write(&config)), Ok(config));
    }
}
