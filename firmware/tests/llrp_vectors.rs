//! Golden vectors: what two independent LLRP libraries write, and parts of a real reader's responses.

use rfhoi_firmware::llrp::event::EventType;
use rfhoi_firmware::llrp::message::MessageType;
use rfhoi_firmware::llrp::reader_side::{self, ReaderModel};
use rfhoi_firmware::llrp::report::{TagReport, TagReports};
use rfhoi_firmware::llrp::request::{self, MAX_REQUEST_BYTES, ReaderSettings, TransmitChannel};
use rfhoi_firmware::llrp::status::StatusCode;
use rfhoi_shared::config::{MAX_READER_ANTENNAS, ReaderConfig};
use rfhoi_shared::scene::Scene;
use rfhoi_shared::units::{
    AntennaPort, CentiDbm, ChannelIndex, DopplerCode, Kilohertz, PhaseCode, ReaderTime,
};

const HOPPING: TransmitChannel = TransmitChannel { hop_table: 1, channel: 0 };

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02x}")).collect()
}

fn config() -> ReaderConfig {
    ReaderConfig {
        antennas: [AntennaPort(1)].into_iter().collect(),
        population: 4,
        ..ReaderConfig::for_scene([192, 168, 1, 2], &Scene::default())
    }
}

#[test]
fn short_messages() {
    let b = &mut [0; MAX_REQUEST_BYTES];
    assert_eq!(hex(request::enable_extensions(b, 5).unwrap()), "07ff00000013000000050000651a1500000000");
    assert_eq!(hex(request::keepalive_ack(b, 0x1122_3344).unwrap()), "04480000000a11223344");
    assert_eq!(hex(request::enable_events_and_reports(b, 7).unwrap()), "04400000000a00000007");
    assert_eq!(hex(request::get_reader_capabilities(b, 1).unwrap()), "04010000000b0000000100");
    assert_eq!(hex(request::close_connection(b, 2).unwrap()), "040e0000000a00000002");
    assert_eq!(hex(request::delete_rospec(b, 3, 0).unwrap()), "04150000000e0000000300000000");
    assert_eq!(hex(request::delete_accessspec(b, 3, 0).unwrap()), "04290000000e0000000300000000");
    assert_eq!(hex(request::start_rospec(b, 3, 1).unwrap()), "04160000000e0000000300000001");
    assert_eq!(hex(request::stop_rospec(b, 3, 1).unwrap()), "04170000000e0000000300000001");
    assert_eq!(hex(request::enable_rospec(b, 3, 1).unwrap()), "04180000000e0000000300000001");
    assert_eq!(hex(reader_side::keepalive(b, 9).unwrap()), "043e0000000a00000009");
}

#[test]
fn set_reader_config() {
    let b = &mut [0; MAX_REQUEST_BYTES];
    let plain = ReaderSettings { keepalive_ms: Some(5000), ..ReaderSettings::default() };
    assert_eq!(
        hex(request::set_reader_config(b, 6, &plain).unwrap()),
        "040300000014000000060000dc00090100001388"
    );
    let impinj = ReaderSettings { link_down_threshold: Some(3), low_latency: true, ..plain };
    assert_eq!(
        hex(request::set_reader_config(b, 6, &impinj).unwrap()),
        "040300000032000000060000dc0009010000138803ff00100000651a000000260001000303ff000e0000651a000000270001"
    );
    let reset = ReaderSettings { reset_to_factory_default: true, ..ReaderSettings::default() };
    assert_eq!(hex(request::set_reader_config(b, 0x65, &reset).unwrap()), "04030000000b0000006580");
    // Parameters as in a Speedway R420's GET_READER_CONFIG_RESPONSE.
    let events = [(EventType::ReaderException, true), (EventType::Hopping, false)];
    let events =
        ReaderSettings { events: &events, hold_upon_reconnect: Some(false), ..ReaderSettings::default() };
    assert_eq!(
        hex(request::set_reader_config(b, 1, &events).unwrap()),
        "040300000022000000010000f4001200f5000700048000f500070000\
         0000e2000500"
    );
}

#[test]
fn add_rospec() {
    let b = &mut [0; MAX_REQUEST_BYTES];
    assert_eq!(
        hex(request::add_rospec(b, 8, &config(), HOPPING, true).unwrap()),
        "0414000000ad0000000800b100a300000001000000b2001200b300050000b60009000000000000b700440001000100b80009\
         000000000000ba003300010100de002c0001014a002600014f0008000000000150000b4000040000000003ff000e0000651a\
         00000017000200ed004302000100ee00061f8003ff00360000651a0000003203ff000e0000651a00000034000103ff000e00\
         00651a00000035000103ff000e0000651a000000430001"
    );
}

#[test]
fn add_rospec_without_extensions_has_no_custom_parameter() {
    const CUSTOM_BYTES: usize = 14 + 0x36;
    let (b, c) = (&mut [0; MAX_REQUEST_BYTES], &mut [0; MAX_REQUEST_BYTES]);
    let without = request::add_rospec(b, 8, &config(), HOPPING, false).unwrap();
    let with = request::add_rospec(c, 8, &config(), HOPPING, true).unwrap();
    assert!(!hex(without).contains("0000651a"));
    assert_eq!(without.len() + CUSTOM_BYTES, with.len());
}

#[test]
fn add_rospec_with_power_names_the_transmitter() {
    let b = &mut [0; MAX_REQUEST_BYTES];
    let powered = ReaderConfig { power_index: 81, ..config() };
    let hopping = hex(request::add_rospec(b, 8, &powered, HOPPING, true).unwrap());
    // As a Speedway R420 reports its own setting.
    assert!(hopping.contains("00e0000a000100000051"), "{hopping}");
    let fixed = TransmitChannel { hop_table: 0, channel: 1 };
    let fixed = hex(request::add_rospec(b, 8, &powered, fixed, true).unwrap());
    assert!(fixed.contains("00e0000a000000010051"), "{fixed}");
}

#[test]
fn the_longest_request_fits() {
    let b = &mut [0; MAX_REQUEST_BYTES];
    let antennas = (1..=MAX_READER_ANTENNAS as u16).map(AntennaPort).collect();
    let config = ReaderConfig { antennas, power_index: 1, ..config() };
    let bytes = request::add_rospec(b, 8, &config, HOPPING, true).unwrap();
    assert!(bytes.len() > MAX_REQUEST_BYTES * 9 / 10, "the room is not wasted: {}", bytes.len());
}

#[test]
fn ro_access_report() {
    let golden = "043d000000620000000900f000588d3000aabbccddeeff0011223381000186cb87000e8200060a24182022408400060a\
                  241820224088000103ff000e0000651a000000380a3003ff000e0000651a00000039eb4c03ff000e0000651a000000\
                  44ffd8";
    let epc = [0x30, 0x00, 0xaa, 0xbb, 0xcc, 0xdd, 0xee, 0xff, 0x00, 0x11, 0x22, 0x33];
    let report = TagReport {
        epc: &epc,
        antenna: Some(AntennaPort(1)),
        peak_rssi_dbm: Some(-53),
        channel: Some(ChannelIndex(14)),
        first_seen_utc: Some(ReaderTime(1_700_000_000_123_456)),
        last_seen_utc: Some(ReaderTime(1_700_000_000_123_456)),
        count: Some(1),
        phase: Some(PhaseCode(2608)),
        peak_rssi: Some(CentiDbm(-5300)),
        doppler: Some(DopplerCode(-40)),
        ..TagReport::default()
    };
    let mut b = [0; reader_side::MAX_REPORT_BYTES];
    let bytes = reader_side::ro_access_report(&mut b, 9, [&report]).unwrap();
    assert_eq!(hex(bytes), golden);
    let decoded: Vec<_> = TagReports::new(&bytes[10..]).collect();
    assert_eq!(decoded, [Ok(report)]);
}

#[test]
fn responses() {
    let b = &mut [0; 64];
    let close = MessageType::CLOSE_CONNECTION_RESPONSE;
    // The body is that of a Speedway R420.
    let close = reader_side::status_response(b, close, 3, StatusCode::SUCCESS, "").unwrap();
    assert_eq!(hex(close), "04040000001200000003011f000800000000");
    let extensions = reader_side::extensions_response(b, 5, StatusCode::SUCCESS).unwrap();
    assert_eq!(hex(extensions), "07ff00000017000000050000651a16011f000800000000");
    // Parts of a Speedway R420's response, with one of its powers and channels.
    let model = ReaderModel {
        antennas: 4,
        model: [25_882, 2_001_002],
        firmware: "5.14.0.240",
        powers: &[CentiDbm(1000)],
        hop_table: Some(1),
        channels: &[Kilohertz(909_250)],
    };
    let mut b = [0; 512];
    let bytes = hex(reader_side::capabilities_response(&mut b, 1, &model).unwrap());
    let parts = [
        "000440000000651a001e886a000a352e31342e302e323430",
        "03480001",
        "00910008000103e800920011800093000c01000001000ddfc2",
    ];
    for part in parts {
        assert!(bytes.contains(part), "{part} in {bytes}");
    }
}
