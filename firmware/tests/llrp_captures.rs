//! Recorded LLRP against what other decoders made of it. Without the recordings these tests say so and pass.

use std::collections::BTreeMap;
use std::fs;

use rfhoi_firmware::llrp::capabilities::Capabilities;
use rfhoi_firmware::llrp::client::MAX_MESSAGE_BYTES;
use rfhoi_firmware::llrp::decode::Incoming;
use rfhoi_firmware::llrp::event::{ConnectionAttempt, Event, EventNotification};
use rfhoi_firmware::llrp::frame::Framer;
use rfhoi_firmware::llrp::message::{IMPINJ, Message, MessageType, ParameterType};
use rfhoi_firmware::llrp::report::{TagReport, TagReports};
use rfhoi_firmware::llrp::request::TransmitChannel;
use rfhoi_firmware::llrp::status::StatusCode;
use rfhoi_shared::units::{CentiDbm, ReaderTime};
use serde_json::Value;

#[path = "../../tests/recorded.rs"]
mod recorded;
use recorded::recorded;

/// Messages of a recording, as (type, ID, body); fails if a byte is left over or a message skipped.
fn messages(name: &str, cut: usize) -> Option<Vec<(MessageType, u32, Vec<u8>)>> {
    let bytes = fs::read(recorded("llrp")?.join("ltk").join(name)).unwrap();
    let mut framer = Framer::<MAX_MESSAGE_BYTES>::new();
    let mut messages = Vec::new();
    let mut used = 0;
    for mut chunk in bytes.chunks(cut) {
        while let Some(m) = framer.next(&mut chunk).unwrap() {
            used += 10 + m.body.len();
            messages.push((m.kind, m.id, m.body.to_vec()));
        }
    }
    assert_eq!((used, framer.oversized()), (bytes.len(), 0), "{name}");
    Some(messages)
}

fn count(messages: &[(MessageType, u32, Vec<u8>)]) -> BTreeMap<u16, usize> {
    let mut counts = BTreeMap::new();
    for (kind, ..) in messages {
        *counts.entry(kind.0).or_default() += 1;
    }
    counts
}

/// Decodes all that a reader sends; returns tag reports and events.
fn decode_all(messages: &[(MessageType, u32, Vec<u8>)]) -> (Vec<TagReport<'_>>, Vec<Event<'_>>) {
    let (mut reports, mut events) = (Vec::new(), Vec::new());
    for (kind, id, body) in messages {
        match Incoming::decode(&Message { kind: *kind, id: *id, body }) {
            Ok(Incoming::Reports(walk)) => reports.extend(walk.map(|r| r.unwrap())),
            Ok(Incoming::Events(walk)) => events.extend(walk.map(|e| e.unwrap())),
            Ok(_) => {}
            Err(error) => panic!("{kind} {id}: {error}"),
        }
    }
    (reports, events)
}

/// Text of the first innermost element of this name.
fn element<'x>(xml: &'x str, name: &str) -> Option<&'x str> {
    let (before, _) = xml.split_once(&format!("</{name}>"))?;
    before.rsplit('>').next()
}

fn number<T: std::str::FromStr>(xml: &str, name: &str) -> Option<T> {
    element(xml, name).map(|text| text.parse().ok().expect("a number"))
}

/// Microseconds of the day in `2007-03-07T17:02:44.310403Z`.
fn time_of_day(text: &str) -> u64 {
    let (_, time) = text.trim_end_matches('Z').split_once('T').unwrap();
    let parts: Vec<u64> = time.split([':', '.']).map(|p| p.parse().unwrap()).collect();
    ((parts[0] * 60 + parts[1]) * 60 + parts[2]) * 1_000_000 + parts[3]
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02X}")).collect()
}

/// Compares `reports` with the `TagReportData` elements of the recording's XML.
fn compare_with_xml(name: &str, reports: &[TagReport<'_>]) {
    let xml = fs::read_to_string(recorded("llrp").unwrap().join("ltk").join(name)).unwrap();
    let elements: Vec<_> = xml.split("<TagReportData>").skip(1).collect();
    assert_eq!(elements.len(), reports.len());
    for (xml, report) in elements.iter().zip(reports) {
        let xml = xml.split_once("</TagReportData>").unwrap().0;
        assert_eq!(Some(hex(report.epc).as_str()), element(xml, "EPC"));
        assert_eq!(report.antenna.map(|a| a.0), number(xml, "AntennaID"));
        assert_eq!(report.peak_rssi_dbm, number(xml, "PeakRSSI"));
        assert_eq!(report.channel.map(|c| c.0), number(xml, "ChannelIndex"));
        assert_eq!(report.rospec, number(xml, "ROSpecID"));
        assert_eq!(report.count, number(xml, "TagCount"));
        let first_seen = xml.split_once("<FirstSeenTimestampUTC>");
        assert_eq!(
            report.first_seen_utc.map(|t| t.0 % 86_400_000_000),
            first_seen.map(|(_, xml)| time_of_day(element(xml, "Microseconds").unwrap()))
        );
    }
}

#[test]
fn a_whole_session() {
    let Some(messages) = messages("dx101_a.bin", 1460) else { return };
    assert_eq!(messages.len(), 934);
    let counts = count(&messages);
    assert_eq!((counts[&61], counts[&63]), (3, 891));
    let (reports, events) = decode_all(&messages);
    assert_eq!(reports.len(), 130);
    let events = |of: fn(&Event<'_>) -> bool| events.iter().filter(|e| of(e)).count();
    assert_eq!(events(|e| matches!(e, Event::Hopping { .. })), 884);
    assert_eq!(events(|e| matches!(e, Event::RoSpec { .. })), 2);
    assert_eq!(events(|e| matches!(e, Event::ConnectionAttempt(_))), 1);
    const GPI: ParameterType = ParameterType::Tlv(248);
    const AI_SPEC: ParameterType = ParameterType::Tlv(254);
    assert_eq!(events(|e| matches!(e, Event::Other(GPI))), 1);
    assert_eq!(events(|e| matches!(e, Event::Other(AI_SPEC))), 3);
    compare_with_xml("dx101_a.xml", &reports);
    let (kind, id, body) = &messages[1];
    assert_eq!((*kind, *id, body.as_slice()), (MessageType::SET_READER_CONFIG, 101, &[0x80][..]));
}

#[test]
fn epcs_of_every_form() {
    let Some(messages) = messages("dx101_b.bin", 7) else { return };
    assert_eq!(count(&messages), BTreeMap::from([(61, 24)]));
    let (reports, _) = decode_all(&messages);
    assert_eq!(reports.len(), 132);
    assert_eq!(reports.iter().filter(|r| r.epc.len() == 12).count(), 22);
    compare_with_xml("dx101_b.xml", &reports);
}

#[test]
fn custom_parameters_everywhere() {
    let Some(messages) = messages("dx101_e.bin", 100) else { return };
    let counts = count(&messages);
    assert_eq!((counts[&61], counts[&63], counts[&1023]), (75, 275, 50));
    let (reports, events) = decode_all(&messages);
    assert_eq!((messages.len(), reports.len()), (750, 237));
    assert!(events.len() >= counts[&63], "no notification is without an event");
}

#[test]
fn error_messages() {
    let Some(messages) = messages("dx301_a.bin", 1) else { return };
    assert_eq!(count(&messages), BTreeMap::from([(100, 78)]));
    for (kind, id, body) in &messages {
        let Ok(Incoming::Error(status)) = Incoming::decode(&Message { kind: *kind, id: *id, body }) else {
            panic!("an ERROR_MESSAGE");
        };
        assert_eq!((status.code, status.description), (StatusCode::SUCCESS, ""));
    }
}

/// Body and expected decode of each recording of a Speedway R420 whose name begins with `kind`.
fn edgex(kind: &str, expected: usize) -> Vec<(Vec<u8>, Value)> {
    let Some(folder) = recorded("llrp") else { return Vec::new() };
    let mut recordings = Vec::new();
    for entry in fs::read_dir(folder.join("edgex")).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap();
        if name.starts_with(kind) && name.ends_with(".bytes") {
            let json = fs::read_to_string(path.with_extension("json")).unwrap();
            recordings.push((fs::read(&path).unwrap(), serde_json::from_str(&json).unwrap()));
        }
    }
    assert_eq!(recordings.len(), expected, "recordings of {kind}");
    recordings
}

fn base64(text: &str) -> Vec<u8> {
    const DIGITS: &str = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let digits = text.trim_end_matches('=').chars();
    let bits: String = digits.map(|c| format!("{:06b}", DIGITS.find(c).unwrap())).collect();
    bits.as_bytes()
        .chunks_exact(8)
        .map(|b| u8::from_str_radix(std::str::from_utf8(b).unwrap(), 2).unwrap())
        .collect()
}

#[test]
fn r420_reports() {
    for (body, json) in edgex("ROAccessReport", 9) {
        let reports: Vec<_> = TagReports::new(&body).map(Result::unwrap).collect();
        let expected = json["TagReportData"].as_array().unwrap();
        assert_eq!(reports.len(), expected.len());
        for (report, json) in reports.iter().zip(expected) {
            assert_eq!(report.epc, base64(json["EPC96"]["EPC"].as_str().unwrap()));
            assert_eq!(report.antenna.map(|a| u64::from(a.0)), json["AntennaID"].as_u64());
            assert_eq!(report.peak_rssi_dbm.map(i64::from), json["PeakRSSI"].as_i64());
            assert_eq!(report.channel.map(|c| u64::from(c.0)), json["ChannelIndex"].as_u64());
            assert_eq!(report.first_seen_utc.map(|t| t.0), json["FirstSeenUTC"].as_u64());
            assert_eq!(report.last_seen_utc.map(|t| t.0), json["LastSeenUTC"].as_u64());
            assert_eq!(report.count.map(u64::from), json["TagSeenCount"].as_u64());
            assert_eq!((report.phase, report.unknown), (None, 0));
        }
    }
}

#[test]
fn r420_capabilities() {
    for (body, json) in edgex("GetReaderCapabilitiesResponse", 1) {
        let capabilities = Capabilities::decode(&body).unwrap();
        let general = &json["GeneralDeviceCapabilities"];
        assert_eq!(u64::from(capabilities.antennas), general["MaxSupportedAntennas"].as_u64().unwrap());
        assert_eq!(capabilities.has_utc_clock, general["HasUTCClock"].as_bool().unwrap());
        assert_eq!(capabilities.manufacturer, IMPINJ);
        assert_eq!(u64::from(capabilities.model), general["Model"].as_u64().unwrap());
        let band = &json["RegulatoryCapabilities"]["UHFBandCapabilities"];
        let powers = band["TransmitPowerLevels"].as_array().unwrap();
        assert_eq!(usize::from(capabilities.power_levels), powers.len());
        let highest = powers.iter().map(|p| p["TransmitPowerValue"].as_i64().unwrap()).max();
        assert_eq!(capabilities.max_power, highest.map(|p| CentiDbm(p as i16)));
        let information = &band["FrequencyInformation"];
        assert_eq!(capabilities.hopping, information["Hopping"].as_bool().unwrap());
        let json = &information["FrequencyHopTables"][0];
        let table = capabilities.channels.as_ref().unwrap();
        assert_eq!(u64::from(table.table), json["HopTableID"].as_u64().unwrap());
        let kilohertz: Vec<_> = table.channels.iter().map(|k| u64::from(k.0)).collect();
        let expected = json["Frequencies"].as_array().unwrap();
        assert_eq!(kilohertz, expected.iter().map(|f| f.as_u64().unwrap()).collect::<Vec<_>>());
        assert_eq!((table.channels.len(), capabilities.channels_omitted), (50, 0));
        assert_eq!(capabilities.transmit_channel(), TransmitChannel { hop_table: 1, channel: 0 });
    }
}

#[test]
fn r420_events_and_statuses() {
    for (body, json) in edgex("ReaderEventNotification", 1) {
        let mut notification = EventNotification::decode(&body).unwrap();
        let json = &json["ReaderEventNotificationData"];
        assert_eq!(Some(notification.time.0), json["UTCTimestamp"].as_u64());
        assert_eq!(notification.next(), Some(Ok(Event::ConnectionClose)));
        assert_eq!(notification.next(), None);
    }
    for (kind, name) in [
        (MessageType::CLOSE_CONNECTION_RESPONSE, "CloseConnectionResponse"),
        (MessageType::GET_ACCESSSPECS_RESPONSE, "GetAccessSpecsResponse"),
        (MessageType::GET_ROSPECS_RESPONSE, "GetROSpecsResponse"),
        (MessageType::GET_READER_CONFIG_RESPONSE, "GetReaderConfigResponse"),
        (MessageType::GET_READER_CAPABILITIES_RESPONSE, "GetReaderCapabilitiesResponse"),
    ] {
        for (body, json) in edgex(name, 1) {
            let Ok(Incoming::Response(decoded, status)) =
                Incoming::decode(&Message { kind, id: 0, body: &body })
            else {
                panic!("{name}");
            };
            assert_eq!(decoded, kind);
            assert_eq!(Some(u64::from(status.code.0)), json["LLRPStatus"]["Status"].as_u64());
            assert_eq!(Some(status.description), json["LLRPStatus"]["ErrorDescription"].as_str());
        }
    }
}

#[test]
fn the_session_begins_with_success() {
    let Some(messages) = messages("dx101_a.bin", 1 << 20) else { return };
    let (kind, _, body) = &messages[0];
    assert_eq!(*kind, MessageType::READER_EVENT_NOTIFICATION);
    let mut notification = EventNotification::decode(body).unwrap();
    // 2007-03-07T17:01:18.714842Z
    assert_eq!(notification.time, ReaderTime(1_173_286_878_714_842));
    assert_eq!(notification.next(), Some(Ok(Event::ConnectionAttempt(ConnectionAttempt::Success))));
}
