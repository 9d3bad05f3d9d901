//! Encode, decode, equal; and any bytes end without a panic.

use proptest::prelude::*;
use rfhoi_firmware::llrp::capabilities::Capabilities;
use rfhoi_firmware::llrp::decode::Incoming;
use rfhoi_firmware::llrp::event::{ConnectionAttempt, Event, EventNotification, RoSpecChange};
use rfhoi_firmware::llrp::frame::Framer;
use rfhoi_firmware::llrp::fuzz;
use rfhoi_firmware::llrp::message::{MessageType, ParameterType};
use rfhoi_firmware::llrp::param::Fault;
use rfhoi_firmware::llrp::reader_side::{self, MAX_REPORT_BYTES, ReaderModel};
use rfhoi_firmware::llrp::report::{TagReport, TagReports};
use rfhoi_firmware::llrp::status::{Status, StatusCode};
use rfhoi_shared::tag::MAX_EPC_BYTES;
use rfhoi_shared::units::{
    AntennaPort, CentiDbm, ChannelIndex, DopplerCode, Kilohertz, PhaseCode, ReaderTime,
};
use rfhoi_shared::wire::MAX_CHANNELS;

type Opt<T> = proptest::option::OptionStrategy<T>;

fn opt<T: Arbitrary>() -> Opt<T::Strategy> {
    proptest::option::of(any::<T>())
}

prop_compose! {
    fn report(epc: &'static [u8])(
        length in 0..=MAX_EPC_BYTES,
        (rospec, antenna, peak_rssi_dbm, channel, count) in
            (opt::<u32>(), opt::<u16>(), opt::<i8>(), opt::<u16>(), opt::<u16>()),
        times in any::<[Option<u64>; 4]>(),
        (phase, peak_rssi, doppler) in
            (proptest::option::of(0..PhaseCode::CODES_PER_TURN), opt::<i16>(), opt::<i16>()),
    ) -> TagReport<'static> {
        let [first_seen_utc, first_seen_uptime, last_seen_utc, last_seen_uptime] =
            times.map(|t| t.map(ReaderTime));
        TagReport {
            epc: &epc[..length],
            rospec,
            antenna: antenna.map(AntennaPort),
            peak_rssi_dbm,
            channel: channel.map(ChannelIndex),
            first_seen_utc,
            first_seen_uptime,
            last_seen_utc,
            last_seen_uptime,
            count,
            phase: phase.map(PhaseCode),
            peak_rssi: peak_rssi.map(CentiDbm),
            doppler: doppler.map(DopplerCode),
            unknown: 0,
        }
    }
}

const EPC: [u8; MAX_EPC_BYTES] = [0xA5; MAX_EPC_BYTES];

fn event() -> impl Strategy<Value = Event<'static>> {
    use ConnectionAttempt as C;
    let attempts = [
        C::Success,
        C::ReaderInitiatedConnectionExists,
        C::ClientInitiatedConnectionExists,
        C::Failed,
        C::AnotherAttempted,
    ];
    let changes = [RoSpecChange::Start, RoSpecChange::End, RoSpecChange::Preempted];
    prop_oneof![
        any::<(u16, u16)>().prop_map(|(table, next)| Event::Hopping { table, next: ChannelIndex(next) }),
        (proptest::sample::select(changes.to_vec()), any::<u32>())
            .prop_map(|(change, rospec)| Event::RoSpec { change, rospec }),
        any::<u8>().prop_map(Event::BufferLevel),
        Just(Event::BufferOverflow),
        Just(Event::Exception("antenna port 2: überhitzt")),
        any::<(u16, bool)>()
            .prop_map(|(port, connected)| Event::Antenna { port: AntennaPort(port), connected }),
        proptest::sample::select(attempts.to_vec()).prop_map(Event::ConnectionAttempt),
        Just(Event::ConnectionClose),
        Just(Event::Other(ParameterType::Tlv(254))),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn reports(reports in proptest::collection::vec(report(&EPC), 0..20)) {
        let mut buffer = [0; 20 * MAX_REPORT_BYTES];
        let bytes = reader_side::ro_access_report(&mut buffer, 3, &reports).unwrap();
        let mut framer = Framer::<16>::default();
        prop_assert!(framer.next(&mut &*bytes).is_ok());
        let decoded: Result<Vec<_>, _> = TagReports::new(&bytes[10..]).collect();
        prop_assert_eq!(decoded.unwrap(), reports);
    }

    #[test]
    fn a_report_of_one_read_fits(report in report(&EPC)) {
        let mut buffer = [0; MAX_REPORT_BYTES];
        prop_assert!(reader_side::ro_access_report(&mut buffer, 3, [&report]).is_ok());
    }

    #[test]
    fn events(time in any::<u64>(), events in proptest::collection::vec(event(), 0..10)) {
        let mut buffer = [0; 600];
        let time = ReaderTime(time);
        let bytes = reader_side::event_notification(&mut buffer, 0, time, events.iter().copied()).unwrap();
        let notification = EventNotification::decode(&bytes[10..]).unwrap();
        prop_assert_eq!(notification.time, time);
        let decoded: Result<Vec<_>, _> = notification.collect();
        prop_assert_eq!(decoded.unwrap(), events);
    }

    #[test]
    fn capabilities(
        antennas in 0u16..=32,
        model in any::<[u32; 2]>(),
        powers in proptest::collection::vec(any::<i16>().prop_map(CentiDbm), 0..100),
        hop_table in opt::<u8>(),
        channels in proptest::collection::vec(any::<u32>().prop_map(Kilohertz), 0..MAX_CHANNELS + 10),
    ) {
        let described =
            ReaderModel { antennas, model, firmware: "1.2", powers: &powers, hop_table, channels: &channels };
        let mut buffer = [0; 3000];
        let bytes = reader_side::capabilities_response(&mut buffer, 0, &described).unwrap();
        let decoded = Capabilities::decode(&bytes[10..]).unwrap();
        prop_assert_eq!(decoded.antennas, antennas);
        prop_assert_eq!([decoded.manufacturer, decoded.model], model);
        prop_assert_eq!(decoded.power_levels, powers.len() as u16);
        prop_assert_eq!(decoded.max_power, powers.iter().copied().max());
        prop_assert_eq!(decoded.hopping, hop_table.is_some());
        let table = decoded.channels.unwrap();
        prop_assert_eq!(table.table, hop_table.map_or(0, u16::from));
        let kept = channels.len().min(MAX_CHANNELS);
        prop_assert_eq!(table.channels.as_slice(), &channels[..kept]);
        prop_assert_eq!(usize::from(decoded.channels_omitted), channels.len() - kept);
    }

    #[test]
    fn any_bytes_are_walked(body in proptest::collection::vec(any::<u8>(), 0..600)) {
        fuzz::bodies(&body);
        fuzz::client(&body);
    }

    #[test]
    fn any_cuts_of_any_stream_agree(
        bytes in proptest::collection::vec(any::<u8>(), 0..600),
        cuts in proptest::collection::vec(any::<u8>(), 1..20),
    ) {
        prop_assert_eq!(fuzz::stream(&bytes, &cuts), fuzz::stream(&bytes, &[0]));
    }

    #[test]
    fn mutated_messages_are_walked(
        reports in proptest::collection::vec(report(&EPC), 1..4),
        mutations in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
        cuts in proptest::collection::vec(any::<u8>(), 1..20),
    ) {
        let mut buffer = [0; 3000];
        let mut stream = reader_side::ro_access_report(&mut buffer, 3, &reports).unwrap().to_vec();
        stream.extend(reader_side::keepalive(&mut buffer, 1).unwrap());
        for (at, byte) in mutations {
            let at = at.index(stream.len());
            stream[at] = byte;
        }
        prop_assert_eq!(fuzz::stream(&stream, &cuts), fuzz::stream(&stream, &[0]));
        fuzz::bodies(&stream[10..]);
    }
}

#[test]
fn a_malformed_report_does_not_take_its_neighbours_along() {
    let good = TagReport { epc: &EPC[..12], phase: Some(PhaseCode(9)), ..TagReport::default() };
    let mut buffer = [0; 600];
    let bytes = reader_side::ro_access_report(&mut buffer, 0, [&good, &good, &good]).unwrap();
    let mut body = bytes[10..].to_vec();
    let each = body.len() / 3;
    body[2 * each - 2] = 0x10; // phase 0x1009: beyond one turn
    let decoded: Vec<_> = TagReports::new(&body).collect();
    assert_eq!(decoded[0], Ok(good));
    assert_eq!(decoded[1].unwrap_err().fault, Fault::Value);
    assert_eq!(decoded[1].unwrap_err().offset, 2 * each - 2);
    assert_eq!(decoded[2], Ok(good));
}

#[test]
fn unknown_parameters_are_counted() {
    // TagReportData { EPCData of no bits, TLV 1000, custom of another vendor, AntennaID 3 }, then a custom parameter.
    let body = [
        0x00, 0xF0, 0, 29, 0x00, 0xF1, 0, 6, 0, 0, 0x03, 0xE8, 0, 4, 0x03, 0xFF, 0, 12, 0, 0, 0, 1, 0, 0, 0,
        52, 0x81, 0, 3, //
        0x03, 0xFF, 0, 12, 0, 0, 0, 1, 0, 0, 0, 1,
    ];
    let mut reports = TagReports::new(&body);
    let report = reports.next().unwrap().unwrap();
    assert_eq!(report, TagReport { antenna: Some(AntennaPort(3)), unknown: 2, ..TagReport::default() });
    assert!(reports.next().is_none());
    assert_eq!(reports.others(), 1);
}

#[test]
fn a_status_tells_the_innermost_parameter_and_field() {
    // LLRPStatus 100 { ParameterError 177 { ParameterError 183 { FieldError 2 } } }
    let body = [
        0x01, 0x1F, 0, 34, 0, 100, 0, 2, b'n', b'o', //
        0x01, 0x21, 0, 24, 0, 177, 0, 100, //
        0x01, 0x21, 0, 16, 0, 183, 0, 101, //
        0x01, 0x20, 0, 8, 0, 2, 0, 101,
    ];
    let message =
        rfhoi_firmware::llrp::message::Message { kind: MessageType::ADD_ROSPEC_RESPONSE, id: 0, body: &body };
    let Ok(Incoming::Response(MessageType::ADD_ROSPEC_RESPONSE, status)) = Incoming::decode(&message) else {
        panic!("a response");
    };
    let expected =
        Status { code: StatusCode::PARAMETER_ERROR, description: "no", parameter: Some(183), field: Some(2) };
    assert_eq!(status, expected);
}
