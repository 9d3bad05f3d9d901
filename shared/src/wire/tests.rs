extern crate std;

use std::format;
use std::string::String;
use std::vec::Vec;

use expect_test::expect;
use proptest::prelude::*;

use super::*;
use crate::config::*;
use crate::radar::*;
use crate::scene::*;
use crate::tag::*;
use crate::units::*;

fn largest_config() -> BridgeConfig {
    let big = u32::MAX;
    let profile = RadarProfile {
        start_khz: big,
        slope_khz_per_us: big,
        idle_ns: big,
        adc_start_ns: big,
        ramp_end_ns: big,
        samples: u16::MAX,
        sample_rate_ksps: big,
        format: SampleFormat::Complex(IqOrder::QFirst),
        rx_mask: u8::MAX,
        tx_order: [u8::MAX; MAX_TX_SLOTS].into_iter().collect(),
        loops: u16::MAX,
        frame_period_us: big,
        ..RadarProfile::paper()
    };
    let mut processing = Processing::with_gate(&profile, RangeGate { first: u16::MAX, bins: u16::MAX });
    processing.clutter = ClutterRemoval::Background { time_constant: Seconds(1.0) };
    processing.range_time_columns = u16::MAX;
    let endpoint = Endpoint { address: [255; 4], port: u16::MAX };
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
            session: 3,
            search_mode: u16::MAX,
            population: u16::MAX,
            keepalive_ms: big,
        }),
        scene: Scene::default(),
    }
}

fn smallest_config() -> BridgeConfig {
    let mut config = BridgeConfig { address: Address::Dhcp, ..BridgeConfig::default() };
    config.radar.profile.tx_order.truncate(1);
    config.radar.input = RadarInput::Uart;
    config.radar.processing.clutter = ClutterRemoval::Off;
    config
}

fn read(bytes: usize) -> TagRead {
    let full = bytes > 0;
    TagRead {
        time: BridgeTime(if full { u64::MAX } else { 0 }),
        epc: Epc::new(&[0xe2; MAX_EPC_BYTES][..bytes]).unwrap(),
        antenna: AntennaPort(if full { u16::MAX } else { 1 }),
        channel: ChannelIndex(if full { u16::MAX } else { 1 }),
        phase: full.then_some(PhaseCode(4095)),
        rssi: CentiDbm(if full { i16::MIN } else { 0 }),
        doppler: full.then_some(DopplerCode(i16::MIN)),
    }
}

/// Smallest and largest instance of each message.
fn extremes() -> Vec<(&'static str, Message<'static>, Message<'static>)> {
    let big = u32::MAX;
    let gate = RangeGate { first: 0, bins: 1 };
    let rows = |codes, n: u32| {
        Message::MapRows(MapRows {
            map: MapKind::RangeDoppler,
            frame: n,
            gate: if n == 0 { gate } else { RangeGate { first: u16::MAX, bins: u16::MAX } },
            first_row: n as u16,
            columns: n as u16,
            scale: LogScale { floor_db: -130.0, step_db: 0.5 },
            codes,
        })
    };
    let info = |n| {
        Message::Frame(FrameInfo {
            frame: n,
            profile: n,
            chirps: n,
            chirps_lost: n,
            clipped: n,
            moving_cells: n,
            latency_us: n,
        })
    };
    let covariance = |frame, antennas, n| {
        Message::Covariance(Covariance { frame, antennas, packed: core::iter::repeat_n(1.0, n).collect() })
    };
    let point = Point { position_m: [1.0; 3], velocity_m_s: 1.0, snr_decidb: Some(i16::MIN) };
    let points =
        |frame, n| Message::Points(Points { frame, points: core::iter::repeat_n(point, n).collect() });
    let tags = |n, bytes| Message::Tags(core::iter::repeat_n(read(bytes), n).collect());
    let hop = |table, n| {
        Message::HopTable(HopTable { table, channels: core::iter::repeat_n(Kilohertz(big), n).collect() })
    };
    let telemetry = Telemetry {
        frames: FrameCounts { complete: big, incomplete: big, lost: big },
        datagrams: DatagramCounts {
            received: big,
            lost: big,
            duplicate: big,
            late: big,
            malformed: big,
            restarts: big,
        },
        reader: ReaderCounts {
            state: ReaderState::Occupied,
            reads: big,
            link_losses: big,
            unknown: big,
            malformed: big,
        },
        uplink_dropped: big,
        overruns: big,
        strays: big,
        radar: RadarState::Streaming,
        restart: RestartReason::Panic,
        busy_us: u64::MAX,
        late_us: big,
        bridge_decicelsius: Some(i16::MIN),
        radar_decicelsius: Some(i16::MIN),
    };
    let hello = |board: &str, n, v| {
        let board = heapless::String::try_from(board).unwrap();
        Message::Hello(Hello { board, id: [v; 6], firmware: [v; 3], cube_bytes: n, profile: n })
    };
    let ack = |id, at, outcome| Message::Ack(Ack { id, at: BridgeTime(at), outcome });
    let too_large = ConfigError::CubeTooLarge { needed: big, available: big };
    let notice = |text: &str| Message::Notice(Notice { text: heapless::String::try_from(text).unwrap() });
    let command = |id, request| Message::Command(Command { id, request });
    Vec::from([
        ("Frame", info(0), info(big)),
        ("MapRows", rows(&[0], 0), rows(&[255; MAX_MAP_BYTES], big)),
        ("Covariance", covariance(0, 1, 1), covariance(big, 12, MAX_COVARIANCE)),
        ("Points", points(0, 0), points(big, MAX_POINTS)),
        ("Tags", tags(0, 0), tags(MAX_READS, MAX_EPC_BYTES)),
        ("HopTable", hop(0, 0), hop(u16::MAX, MAX_CHANNELS)),
        ("Telemetry", Message::Telemetry(Telemetry::default()), Message::Telemetry(telemetry)),
        ("Hello", hello("", 0, 0), hello("0123456789abcdef", big, u8::MAX)),
        ("Config", Message::Config(smallest_config()), Message::Config(largest_config())),
        ("Ack", ack(0, 0, Ok(())), ack(u16::MAX, u64::MAX, Err(Refusal::Config(too_large)))),
        ("Command", command(0, Request::Hello), command(u16::MAX, Request::Configure(largest_config()))),
        ("Notice", notice(""), notice(&"x".repeat(MAX_NOTICE))),
    ])
}

fn packet(message: Message<'_>, largest: bool) -> Packet<'_> {
    let mut sequencer = Sequencer::new(if largest { u16::MAX } else { 0 });
    let mut packet = sequencer.wrap(BridgeTime(if largest { u64::MAX } else { 0 }), message);
    packet.header.sequence = if largest { u32::MAX } else { 0 };
    packet
}

#[test]
fn the_modules_table_has_every_message_with_its_sizes() {
    let documentation: Vec<String> = include_str!("mod.rs")
        .lines()
        .filter_map(|line| line.strip_prefix("//! | `"))
        .map(|row| {
            let cells: Vec<&str> = row.split('|').map(str::trim).collect();
            format!("{} {} {}", cells[0].trim_end_matches('`'), cells[2], cells[4])
        })
        .collect();
    let mut measured = Vec::new();
    for (name, small, large) in extremes() {
        let stream = format!("{:?}", small.stream()).to_lowercase();
        let size = |m, largest| packet(m, largest).encode(&mut [0; MAX_PACKET]).unwrap().len();
        let (small, large) = (size(small, false), size(large, true));
        measured.push(format!("{name} {stream} {small} to {large}"));
    }
    assert_eq!(documentation, measured);
}

#[test]
fn layout_of_version_2() {
    // A change here is a change of the contract: it needs a new VERSION.
    let mut text = String::new();
    for (name, small, _) in extremes() {
        let mut buffer = [0; MAX_PACKET];
        let bytes = packet(small, false).encode(&mut buffer).unwrap().iter().map(|b| format!("{b:02x}"));
        text += &format!("{name}: {}\n", bytes.collect::<String>());
    }
    expect![[r#"
        Frame: 5246484f02000000000000000000000000
        MapRows: 5246484f020000000001010000010000000002c30000003f0100
        Covariance: 5246484f0200000000020001010000803f
        Points: 5246484f0200000000030000
        Tags: 5246484f02000100000400
        HopTable: 5246484f0200010000050000
        Telemetry: 5246484f0200020000060000000000000000000000000000000000000000000000
        Hello: 5246484f020003000007000000000000000000000000
        Config: 5246484f0200030000080000c0dadb24e0d403b429f02ee8fb038001981100010f010140a08d060000010048000800004041010033334340000080400000c03f0604
        Ack: 5246484f020003000009000000
        Command: 5246484f02000300000a0000
        Notice: 5246484f02000300000b00
    "#]].assert_eq(&text);
}

#[test]
fn other_versions_are_refused_by_name() {
    let mut buffer = [0; MAX_PACKET];
    let ping = Message::Command(Command { id: 7, request: Request::Hello });
    let length = packet(ping, false).encode(&mut buffer).unwrap().len();
    for theirs in (0..=255).filter(|&v| v != VERSION) {
        buffer[4] = theirs;
        let error = Packet::decode(&buffer[..length]).unwrap_err();
        assert_eq!(error, WireError::Version { theirs, ours: VERSION });
        let side = if theirs < VERSION { "update the other side" } else { "update the side that reports" };
        assert!(format!("{error}").contains(side), "{error}");
        // Whatever follows: the refusal needs no more than five bytes.
        assert_eq!(Packet::decode(&buffer[..5]), Err(error));
    }
    assert_eq!(Packet::decode(&buffer[..4]), Err(WireError::Malformed));
    assert_eq!(Packet::decode(b"GET / HTTP/1.1"), Err(WireError::NotRfHoi));
    assert_eq!(Packet::decode(b""), Err(WireError::NotRfHoi));
}

#[test]
fn trailing_bytes_are_malformed() {
    let mut buffer = [0; MAX_PACKET];
    let length = packet(Message::Telemetry(Telemetry::default()), false).encode(&mut buffer).unwrap().len();
    assert!(Packet::decode(&buffer[..length]).is_ok());
    assert_eq!(Packet::decode(&buffer[..length + 1]), Err(WireError::Malformed));
    assert_eq!(Packet::decode(&buffer[..length - 1]), Err(WireError::Malformed));
}

#[test]
fn streams_are_numbered_apart() {
    let mut sequencer = Sequencer::new(3);
    let telemetry = || Message::Telemetry(Telemetry::default());
    let tags = || Message::Tags(heapless::Vec::new());
    let mut next = |m| sequencer.wrap(BridgeTime(5), m).header.sequence;
    assert_eq!([next(telemetry()), next(tags()), next(telemetry()), next(tags())], [0, 0, 1, 1]);
}

#[test]
fn a_packet_over_the_limit_is_refused_when_written() {
    let (_, _, large) = extremes().remove(1);
    assert_eq!(packet(large.clone(), true).encode(&mut [0; 100]), Err(WireError::TooLong));
    let Message::MapRows(mut rows) = large else { panic!("the second message is MapRows") };
    rows.codes = &[0; MAX_PACKET];
    assert_eq!(packet(Message::MapRows(rows), true).encode(&mut [0; 4096]), Err(WireError::TooLong));
}

fn any_message() -> impl Strategy<Value = (Vec<u8>, u8)> {
    (prop::collection::vec(any::<u8>(), 0..MAX_MAP_BYTES), any::<u8>())
}

/// A message of one of the kinds, its numbers drawn from `bytes`.
fn message_of(bytes: &[u8], kind: u8) -> Message<'_> {
    let byte = |i: usize| bytes.get(i).copied().unwrap_or(i as u8);
    let word = |i: usize| u32::from_le_bytes([byte(i), byte(i + 1), byte(i + 2), byte(i + 3)]);
    let half = |i: usize| word(i) as u16;
    match kind % 5 {
        0 => Message::MapRows(MapRows {
            map: if byte(0) & 1 == 0 { MapKind::RangeTime } else { MapKind::RangeDoppler },
            frame: word(1),
            gate: RangeGate { first: half(2), bins: half(3) },
            first_row: half(4),
            columns: half(5),
            scale: LogScale { floor_db: f32::from(half(6)), step_db: f32::from(half(7)) },
            codes: bytes,
        }),
        1 => Message::Tags(
            bytes
                .chunks(20)
                .take(MAX_READS)
                .map(|epc| TagRead {
                    time: BridgeTime(u64::from(word(3)) << (byte(4) % 32)),
                    epc: Epc::new(epc).unwrap(),
                    antenna: AntennaPort(half(1)),
                    channel: ChannelIndex(half(2)),
                    phase: (byte(1) > 99).then_some(PhaseCode(half(5))),
                    rssi: CentiDbm(half(6) as i16),
                    doppler: (byte(2) > 99).then_some(DopplerCode(half(7) as i16)),
                })
                .collect(),
        ),
        2 => Message::Covariance(Covariance {
            frame: word(0),
            antennas: byte(5),
            packed: bytes.iter().take(MAX_COVARIANCE).map(|&b| f32::from(b) - 99.5).collect(),
        }),
        3 => Message::Ack(Ack {
            id: half(0),
            at: BridgeTime(word(1).into()),
            outcome: if byte(3) & 1 == 0 {
                Ok(())
            } else {
                Err(Refusal::Config(ConfigError::CubeTooLarge { needed: word(4), available: word(9) }))
            },
        }),
        _ => Message::HopTable(HopTable {
            table: half(0),
            channels: bytes
                .iter()
                .take(MAX_CHANNELS)
                .map(|&b| Kilohertz(u32::from(b) * 500 + 902_750))
                .collect(),
        }),
    }
}

proptest! {
    #[test]
    fn packets_survive_both_framings((bytes, kind) in any_message(), boot: u16, time: u64) {
        let packet = Sequencer::new(boot).wrap(BridgeTime(time), message_of(&bytes, kind));
        let mut buffer = [0; MAX_PACKET];
        let encoded = packet.encode(&mut buffer).unwrap();
        prop_assert_eq!(&Packet::decode(encoded).unwrap(), &packet);

        let mut frame = [0; serial::MAX_FRAME];
        let framed = serial::encode(encoded, &mut frame).unwrap();
        prop_assert_eq!(framed.iter().filter(|&&b| b == 0).count(), 1);
        let mut decoder = serial::Decoder::new();
        let mut seen = 0;
        for chunk in framed.chunks(7) {
            decoder.push(chunk, |p| {
                assert_eq!(p.as_ref(), Ok(&packet));
                seen += 1;
            });
        }
        prop_assert_eq!(seen, 1);
    }

    #[test]
    fn arbitrary_bytes_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..2048), version: bool) {
        let mut bytes = bytes;
        if version && bytes.len() > 5 {
            bytes[..4].copy_from_slice(&MAGIC);
            bytes[4] = VERSION;
        }
        let _ = Packet::decode(&bytes);
        serial::Decoder::new().push(&bytes, |_| {});
    }

    #[test]
    fn a_damaged_serial_frame_costs_only_itself((bytes, kind) in any_message(), at: prop::sample::Index, flip in 1u8..) {
        let packet = Sequencer::new(0).wrap(BridgeTime(1), message_of(&bytes, kind));
        let mut frame = [0; serial::MAX_FRAME];
        let mut buffer = [0; MAX_PACKET];
        let good = serial::encode(packet.encode(&mut buffer).unwrap(), &mut frame).unwrap().to_vec();
        let mut bad = good.clone();
        let index = at.index(good.len() - 1);
        bad[index] ^= flip;
        let mut decoder = serial::Decoder::new();
        let mut results = Vec::new();
        for line in [&bad, &good] {
            decoder.push(line, |p| results.push(p.is_ok()));
        }
        prop_assert_eq!(results.last(), Some(&true));
        prop_assert!(results[..results.len() - 1].iter().all(|ok| !ok), "a damaged frame was taken");
        prop_assert_eq!(decoder.counts().good, 1);
    }
}

#[test]
fn an_endless_serial_frame_is_dropped() {
    let mut decoder = serial::Decoder::new();
    for _ in 0..100 {
        decoder.push(&[1; 1000], |_| panic!("no packet yet"));
    }
    let mut results = Vec::new();
    decoder.push(&[0], |p| results.push(p.map(|_| ())));
    assert_eq!(results, [Err(WireError::TooLong)]);
    assert_eq!(decoder.counts(), serial::SerialCounts { good: 0, bad: 1 });
}
