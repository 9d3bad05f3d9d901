//! Messages of the client, byte for byte as a reader expects them.
//!
//! Each function writes one message with the message ID `id` into `buffer` and returns its bytes, or the error of
//! [`encode::message`](super::encode::message). [`MAX_REQUEST_BYTES`] is room for any of them.

use rfhoi_shared::config::ReaderConfig;

use super::encode::{EncodeError, Writer, impinj_message, message};
use super::event::EventType;
use super::message::{MessageType, ParameterType as P, impinj_message};

/// Room for the longest message here: an `ADD_ROSPEC` for four antennas with a transmit power.
pub const MAX_REQUEST_BYTES: usize = 384;
/// The one ROSpec that the client makes.
pub const ROSPEC_ID: u32 = 1;
/// In `DELETE_ROSPEC` and `DELETE_ACCESSSPEC`: all of them, whoever made them.
pub const ALL_SPECS: u32 = 0;
/// Air protocol EPCglobal Class 1 Gen 2.
const PROTOCOL_C1G2: u8 = 1;
/// `ROReportTriggerType`: after N tags or at the end of the ROSpec.
const REPORT_UPON_N_TAGS_OR_END_OF_ROSPEC: u8 = 2;
/// `KeepaliveTriggerType`: periodic.
const KEEPALIVE_PERIODIC: u8 = 1;
/// `TagReportContentSelector`: antenna, channel, peak RSSI, first and last seen, count.
const REPORT_CONTENT: u16 = 0x1F80;
/// Keepalives without acknowledgement after which an Impinj reader gives the link up.
pub const LINK_DOWN_THRESHOLD: u16 = 3;

type Encoded<'b> = Result<&'b [u8], EncodeError>;

/// `IMPINJ_ENABLE_EXTENSIONS`: holds for the connection, so it is sent after every connect.
pub fn enable_extensions(buffer: &mut [u8], id: u32) -> Encoded<'_> {
    impinj_message(buffer, impinj_message::ENABLE_EXTENSIONS, id, |w| w.u32(0))
}

/// `GET_READER_CAPABILITIES`, all of them.
pub fn get_reader_capabilities(buffer: &mut [u8], id: u32) -> Encoded<'_> {
    message(buffer, MessageType::GET_READER_CAPABILITIES, id, |w| w.u8(0))
}

/// What `SET_READER_CONFIG` sets; what is `None`, empty or false is left as it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct ReaderSettings<'a> {
    /// Everything back to the factory's settings first; deletes all specs.
    pub reset_to_factory_default: bool,
    /// Events of these types on or off.
    pub events: &'a [(EventType, bool)],
    /// Period of keepalives, ms.
    pub keepalive_ms: Option<u32>,
    /// Whether events and reports wait for `ENABLE_EVENTS_AND_REPORTS` after a reconnect.
    pub hold_upon_reconnect: Option<bool>,
    /// Impinj: give the link up after this many keepalives without acknowledgement.
    pub link_down_threshold: Option<u16>,
    /// Impinj: send reports at once rather than in batches.
    pub low_latency: bool,
}

/// `SET_READER_CONFIG`.
pub fn set_reader_config<'b>(buffer: &'b mut [u8], id: u32, settings: &ReaderSettings<'_>) -> Encoded<'b> {
    message(buffer, MessageType::SET_READER_CONFIG, id, |w| {
        w.flag(settings.reset_to_factory_default);
        if !settings.events.is_empty() {
            w.parameter(P::READER_EVENT_NOTIFICATION_SPEC, |w| {
                for &(event, on) in settings.events {
                    w.parameter(P::EVENT_NOTIFICATION_STATE, |w| {
                        w.u16(event as u16);
                        w.flag(on);
                    });
                }
            });
        }
        if let Some(period) = settings.keepalive_ms {
            w.parameter(P::KEEPALIVE_SPEC, |w| {
                w.u8(KEEPALIVE_PERIODIC);
                w.u32(period);
            });
        }
        if let Some(hold) = settings.hold_upon_reconnect {
            w.parameter(P::EVENTS_AND_REPORTS, |w| w.flag(hold));
        }
        if let Some(threshold) = settings.link_down_threshold {
            w.parameter(P::IMPINJ_LINK_MONITOR_CONFIGURATION, |w| {
                w.u16(1);
                w.u16(threshold);
            });
        }
        if settings.low_latency {
            w.u16_parameter(P::IMPINJ_REPORT_BUFFER_CONFIGURATION, 1);
        }
    })
}

/// `DELETE_ROSPEC`; [`ALL_SPECS`] deletes those of other clients too.
pub fn delete_rospec(buffer: &mut [u8], id: u32, rospec: u32) -> Encoded<'_> {
    message(buffer, MessageType::DELETE_ROSPEC, id, |w| w.u32(rospec))
}

/// `DELETE_ACCESSSPEC`; [`ALL_SPECS`] deletes those of other clients too.
pub fn delete_accessspec(buffer: &mut [u8], id: u32, accessspec: u32) -> Encoded<'_> {
    message(buffer, MessageType::DELETE_ACCESSSPEC, id, |w| w.u32(accessspec))
}

/// `ENABLE_ROSPEC`.
pub fn enable_rospec(buffer: &mut [u8], id: u32, rospec: u32) -> Encoded<'_> {
    message(buffer, MessageType::ENABLE_ROSPEC, id, |w| w.u32(rospec))
}

/// `START_ROSPEC`.
pub fn start_rospec(buffer: &mut [u8], id: u32, rospec: u32) -> Encoded<'_> {
    message(buffer, MessageType::START_ROSPEC, id, |w| w.u32(rospec))
}

/// `STOP_ROSPEC`.
pub fn stop_rospec(buffer: &mut [u8], id: u32, rospec: u32) -> Encoded<'_> {
    message(buffer, MessageType::STOP_ROSPEC, id, |w| w.u32(rospec))
}

/// `KEEPALIVE_ACK`; `id` is that of the `KEEPALIVE`.
pub fn keepalive_ack(buffer: &mut [u8], id: u32) -> Encoded<'_> {
    message(buffer, MessageType::KEEPALIVE_ACK, id, |_| {})
}

/// `ENABLE_EVENTS_AND_REPORTS`. Has no response.
pub fn enable_events_and_reports(buffer: &mut [u8], id: u32) -> Encoded<'_> {
    message(buffer, MessageType::ENABLE_EVENTS_AND_REPORTS, id, |_| {})
}

/// `CLOSE_CONNECTION`.
pub fn close_connection(buffer: &mut [u8], id: u32) -> Encoded<'_> {
    message(buffer, MessageType::CLOSE_CONNECTION, id, |_| {})
}

/// Where a reader transmits, as `RFTransmitter` names it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct TransmitChannel {
    /// Hop table of a reader that hops, 0 for one that does not.
    pub hop_table: u16,
    /// Channel of a reader that does not hop, counted from 1, 0 for one that does.
    pub channel: u16,
}

/// `ADD_ROSPEC`: reads all tags on the antennas of `config` until stopped, with a report for each singulation (N = 1,
/// since Impinj's phase and Doppler are those of the last one of a report).
///
/// With `impinj` it asks for search mode, phase, fine RSSI and Doppler, which needs [`enable_extensions`] before.
/// `channel` is only sent together with a transmit power that is not the reader's default.
pub fn add_rospec<'b>(
    buffer: &'b mut [u8],
    id: u32,
    config: &ReaderConfig,
    channel: TransmitChannel,
    impinj: bool,
) -> Encoded<'b> {
    message(buffer, MessageType::ADD_ROSPEC, id, |w| {
        w.parameter(P::ROSPEC, |w| {
            w.u32(ROSPEC_ID);
            w.u8(0); // priority: the highest
            w.u8(0); // state: disabled
            w.parameter(P::RO_BOUNDARY_SPEC, |w| {
                w.parameter(P::ROSPEC_START_TRIGGER, |w| w.u8(0)); // none: by START_ROSPEC
                w.parameter(P::ROSPEC_STOP_TRIGGER, null_stop_trigger);
            });
            w.parameter(P::AI_SPEC, |w| {
                w.u16(config.antennas.len() as u16);
                for antenna in &config.antennas {
                    w.u16(antenna.0);
                }
                w.parameter(P::AI_SPEC_STOP_TRIGGER, null_stop_trigger);
                w.parameter(P::INVENTORY_PARAMETER_SPEC, |w| {
                    w.u16(1);
                    w.u8(PROTOCOL_C1G2);
                    for antenna in &config.antennas {
                        w.parameter(P::ANTENNA_CONFIGURATION, |w| {
                            w.u16(antenna.0);
                            antenna_configuration(w, config, channel, impinj);
                        });
                    }
                });
            });
            w.parameter(P::RO_REPORT_SPEC, |w| report_spec(w, impinj));
        });
    })
}

/// Trigger type "none" and its unused duration.
fn null_stop_trigger(w: &mut Writer<'_>) {
    w.u8(0);
    w.u32(0);
}

fn antenna_configuration(w: &mut Writer<'_>, config: &ReaderConfig, channel: TransmitChannel, impinj: bool) {
    if config.power_index != 0 {
        w.parameter(P::RF_TRANSMITTER, |w| {
            w.u16(channel.hop_table);
            w.u16(channel.channel);
            w.u16(config.power_index);
        });
    }
    w.parameter(P::C1G2_INVENTORY_COMMAND, |w| {
        w.flag(false); // not aware of inventoried state: the reader chooses what to select
        w.parameter(P::C1G2_RF_CONTROL, |w| {
            w.u16(config.rf_mode);
            w.u16(0); // tari: the mode's own
        });
        w.parameter(P::C1G2_SINGULATION_CONTROL, |w| {
            w.u8(config.session << 6);
            w.u16(config.population);
            w.u32(0); // transit time: unknown
        });
        if impinj {
            w.u16_parameter(P::IMPINJ_INVENTORY_SEARCH_MODE, config.search_mode);
        }
    });
}

fn report_spec(w: &mut Writer<'_>, impinj: bool) {
    w.u8(REPORT_UPON_N_TAGS_OR_END_OF_ROSPEC);
    w.u16(1);
    w.parameter(P::TAG_REPORT_CONTENT_SELECTOR, |w| w.u16(REPORT_CONTENT));
    if impinj {
        w.parameter(P::IMPINJ_TAG_REPORT_CONTENT_SELECTOR, |w| {
            w.u16_parameter(P::IMPINJ_ENABLE_RF_PHASE_ANGLE, 1);
            w.u16_parameter(P::IMPINJ_ENABLE_PEAK_RSSI, 1);
            w.u16_parameter(P::IMPINJ_ENABLE_RF_DOPPLER_FREQUENCY, 1);
        });
    }
}
