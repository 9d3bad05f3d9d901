//! The reader's side: the bytes that a reader would send, for simulated readers.
//!
//! Each function writes one message with the message ID `id` into `buffer` and returns its bytes, or the error of
//! [`encode::message`](super::encode::message). [`Responder`] answers a client's requests with them.

use rfhoi_shared::tag::MAX_EPC_BYTES;
use rfhoi_shared::units::{CentiDbm, Kilohertz, ReaderTime};

use super::encode::{EncodeError, Writer, impinj_message, message};
use super::event::{ConnectionAttempt, Event};
use super::message::{IMPINJ, Message, MessageType, ParameterType as P, impinj_message};
use super::param::Fields;
use super::report::TagReport;
use super::status::StatusCode;

type Encoded<'b> = Result<&'b [u8], EncodeError>;

/// Room for an `RO_ACCESS_REPORT` of one read with the longest EPC and every field.
pub const MAX_REPORT_BYTES: usize = 220;
const _: () = assert!(MAX_REPORT_BYTES >= 10 + 4 + 6 + MAX_EPC_BYTES + 5 + 3 + 2 + 3 + 4 * 9 + 3 + 3 * 14);

/// `RO_ACCESS_REPORT` of these reads.
///
/// EPCs of 12 bytes go as `EPC-96`, others as `EPCData`; [`TagReport::unknown`] is not written.
pub fn ro_access_report<'b, 'r>(
    buffer: &'b mut [u8],
    id: u32,
    reports: impl IntoIterator<Item = &'r TagReport<'r>>,
) -> Encoded<'b> {
    message(buffer, MessageType::RO_ACCESS_REPORT, id, |w| {
        for report in reports {
            w.parameter(P::TAG_REPORT_DATA, |w| tag_report(w, report));
        }
    })
}

fn tag_report(w: &mut Writer<'_>, report: &TagReport<'_>) {
    const EPC_96_BYTES: usize = 12;
    if report.epc.len() == EPC_96_BYTES {
        w.parameter(P::EPC_96, |w| w.bytes(report.epc));
    } else {
        w.parameter(P::EPC_DATA, |w| {
            w.u16(report.epc.len().saturating_mul(8) as u16);
            w.bytes(report.epc);
        });
    }
    let time = |w: &mut Writer<'_>, kind, time: Option<ReaderTime>| {
        if let Some(time) = time {
            w.parameter(kind, |w| w.u64(time.0));
        }
    };
    if let Some(rospec) = report.rospec {
        w.parameter(P::ROSPEC_ID, |w| w.u32(rospec));
    }
    if let Some(antenna) = report.antenna {
        w.u16_parameter(P::ANTENNA_ID, antenna.0);
    }
    if let Some(rssi) = report.peak_rssi_dbm {
        w.parameter(P::PEAK_RSSI, |w| w.bytes(&rssi.to_be_bytes()));
    }
    if let Some(channel) = report.channel {
        w.u16_parameter(P::CHANNEL_INDEX, channel.0);
    }
    time(w, P::FIRST_SEEN_UTC, report.first_seen_utc);
    time(w, P::FIRST_SEEN_UPTIME, report.first_seen_uptime);
    time(w, P::LAST_SEEN_UTC, report.last_seen_utc);
    time(w, P::LAST_SEEN_UPTIME, report.last_seen_uptime);
    if let Some(count) = report.count {
        w.u16_parameter(P::TAG_SEEN_COUNT, count);
    }
    if let Some(phase) = report.phase {
        w.u16_parameter(P::IMPINJ_RF_PHASE_ANGLE, phase.0);
    }
    if let Some(rssi) = report.peak_rssi {
        w.parameter(P::IMPINJ_PEAK_RSSI, |w| w.i16(rssi.0));
    }
    if let Some(doppler) = report.doppler {
        w.parameter(P::IMPINJ_RF_DOPPLER_FREQUENCY, |w| w.i16(doppler.0));
    }
}

/// `KEEPALIVE`.
pub fn keepalive(buffer: &mut [u8], id: u32) -> Encoded<'_> {
    message(buffer, MessageType::KEEPALIVE, id, |_| {})
}

/// `READER_EVENT_NOTIFICATION` of these events at `time` UTC. [`Event::Other`] is written without a value.
pub fn event_notification<'b, 'e>(
    buffer: &'b mut [u8],
    id: u32,
    time: ReaderTime,
    events: impl IntoIterator<Item = Event<'e>>,
) -> Encoded<'b> {
    message(buffer, MessageType::READER_EVENT_NOTIFICATION, id, |w| {
        w.parameter(P::READER_EVENT_NOTIFICATION_DATA, |w| {
            w.parameter(P::UTC_TIMESTAMP, |w| w.u64(time.0));
            for e in events {
                event(w, e);
            }
        });
    })
}

fn event(w: &mut Writer<'_>, event: Event<'_>) {
    match event {
        Event::Hopping { table, next } => w.parameter(P::HOPPING_EVENT, |w| {
            w.u16(table);
            w.u16(next.0);
        }),
        Event::RoSpec { change, rospec } => w.parameter(P::ROSPEC_EVENT, |w| {
            w.u8(change as u8);
            w.u32(rospec);
            w.u32(0);
        }),
        Event::BufferLevel(percent) => {
            w.parameter(P::REPORT_BUFFER_LEVEL_WARNING_EVENT, |w| w.u8(percent));
        }
        Event::BufferOverflow => w.parameter(P::REPORT_BUFFER_OVERFLOW_ERROR_EVENT, |_| {}),
        Event::Exception(words) => w.parameter(P::READER_EXCEPTION_EVENT, |w| w.text(words)),
        Event::Antenna { port, connected } => w.parameter(P::ANTENNA_EVENT, |w| {
            w.u8(u8::from(connected));
            w.u16(port.0);
        }),
        Event::ConnectionAttempt(outcome) => w.u16_parameter(P::CONNECTION_ATTEMPT_EVENT, outcome.code()),
        Event::ConnectionClose => w.parameter(P::CONNECTION_CLOSE_EVENT, |_| {}),
        Event::Other(kind) => w.parameter(kind, |_| {}),
    }
}

/// `LLRPStatus`.
fn status(w: &mut Writer<'_>, code: StatusCode, description: &str) {
    w.parameter(P::LLRP_STATUS, |w| {
        w.u16(code.0);
        w.text(description);
    });
}

/// A response of type `kind` that is nothing but a status; also `ERROR_MESSAGE`.
pub fn status_response<'b>(
    buffer: &'b mut [u8],
    kind: MessageType,
    id: u32,
    code: StatusCode,
    description: &str,
) -> Encoded<'b> {
    message(buffer, kind, id, |w| status(w, code, description))
}

/// `IMPINJ_ENABLE_EXTENSIONS_RESPONSE`.
pub fn extensions_response(buffer: &mut [u8], id: u32, code: StatusCode) -> Encoded<'_> {
    impinj_message(buffer, impinj_message::ENABLE_EXTENSIONS_RESPONSE, id, |w| status(w, code, ""))
}

/// Capabilities of a simulated reader.
#[derive(Debug, Clone, Copy)]
pub struct ReaderModel<'a> {
    /// Antenna ports.
    pub antennas: u16,
    /// Private enterprise number of the manufacturer, and its number of the model.
    pub model: [u32; 2],
    /// Version of the reader's firmware.
    pub firmware: &'a str,
    /// Transmit power of index 1, 2, ...
    pub powers: &'a [CentiDbm],
    /// Number of the hop table, or `None` for a reader of fixed frequencies.
    pub hop_table: Option<u8>,
    /// Frequency of channel 1, 2, ...
    pub channels: &'a [Kilohertz],
}

/// `GET_READER_CAPABILITIES_RESPONSE` with general and regulatory capabilities.
pub fn capabilities_response<'b>(buffer: &'b mut [u8], id: u32, model: &ReaderModel<'_>) -> Encoded<'b> {
    message(buffer, MessageType::GET_READER_CAPABILITIES_RESPONSE, id, |w| {
        status(w, StatusCode::SUCCESS, "");
        w.parameter(P::GENERAL_DEVICE_CAPABILITIES, |w| {
            let [manufacturer, number] = model.model;
            w.u16(model.antennas);
            w.u16(0x4000); // has a UTC clock
            w.u32(manufacturer);
            w.u32(number);
            w.text(model.firmware);
            // One sensitivity, the best.
            w.parameter(P::RECEIVE_SENSITIVITY_TABLE_ENTRY, |w| {
                w.u16(1);
                w.u16(0);
            });
            w.parameter(P::GPIO_CAPABILITIES, |w| {
                w.u16(0);
                w.u16(0);
            });
            for antenna in 1..=model.antennas {
                w.parameter(P::PER_ANTENNA_AIR_PROTOCOL, |w| {
                    w.u16(antenna);
                    w.u16(1);
                    w.u8(EPC_GLOBAL_C1G2);
                });
            }
        });
        w.parameter(P::LLRP_CAPABILITIES, |w| {
            w.u8(0); // nothing optional
            w.u8(1); // levels of priority
            w.u16(0); // no client requests
            // ROSpecs, their specs, inventory parameters, AccessSpecs, their operations.
            for most in [1, 1, 1, 0, 0] {
                w.u32(most);
            }
        });
        w.parameter(P::REGULATORY_CAPABILITIES, |w| {
            w.u16(840); // country: USA (ISO 3166)
            w.u16(1); // communications standard: FCC part 15
            w.parameter(P::UHF_BAND_CAPABILITIES, |w| band(w, model));
        });
        w.parameter(P::C1G2_LLRP_CAPABILITIES, |w| {
            w.u8(0); // nothing optional
            w.u16(0); // no filters
        });
    })
}

/// Air protocol of UHF Gen2.
const EPC_GLOBAL_C1G2: u8 = 1;

fn band(w: &mut Writer<'_>, model: &ReaderModel<'_>) {
    for (index, power) in (1..).zip(model.powers) {
        w.parameter(P::TRANSMIT_POWER_LEVEL_TABLE_ENTRY, |w| {
            w.u16(index);
            w.i16(power.0);
        });
    }
    w.parameter(P::FREQUENCY_INFORMATION, |w| {
        w.flag(model.hop_table.is_some());
        let channels = |w: &mut Writer<'_>| {
            w.u16(model.channels.len() as u16);
            for channel in model.channels {
                w.u32(channel.0);
            }
        };
        match model.hop_table {
            Some(table) => w.parameter(P::FREQUENCY_HOP_TABLE, |w| {
                w.u8(table);
                w.u8(0);
                channels(w);
            }),
            None => w.parameter(P::FIXED_FREQUENCY_TABLE, channels),
        }
    });
    // Mode 0: FM0 at 640 kHz, as Impinj's maximum throughput.
    w.parameter(P::UHF_C1G2_RF_MODE_TABLE, |w| {
        w.parameter(P::UHF_C1G2_RF_MODE_TABLE_ENTRY, |w| {
            w.u32(0);
            w.u8(0x40); // DR 8, EPC HAG T&C conformant
            w.u8(0); // FM0
            w.u8(2); // forward link: DSB-ASK
            w.u8(1); // spectral mask: single interrogator
            // Backscatter bit/s, PIE x 1000, Tari from, to, step in ns.
            for value in [640_000, 1_500, 6_250, 6_250, 0] {
                w.u32(value);
            }
        });
    });
}

/// Answers a client as a simulated reader of one model does.
#[derive(Debug, Clone, Copy)]
pub struct Responder<'a> {
    /// What the reader says that it can do.
    pub model: ReaderModel<'a>,
    /// A request that it refuses, and with which code.
    pub refuses: Option<(MessageType, StatusCode)>,
}

impl Responder<'_> {
    /// The first message of a connection.
    pub fn greeting<'b>(
        &self,
        buffer: &'b mut [u8],
        time: ReaderTime,
        outcome: ConnectionAttempt,
    ) -> Encoded<'b> {
        event_notification(buffer, 0, time, [Event::ConnectionAttempt(outcome)])
    }

    /// The answer to `request`, or `None` if it has none.
    ///
    /// Impinj's extensions are known to a reader of that manufacturer and an unsupported message to any other.
    pub fn answer<'b>(&self, buffer: &'b mut [u8], request: &Message<'_>) -> Option<Encoded<'b>> {
        let id = request.id;
        let refused = self.refuses.filter(|(kind, _)| *kind == request.kind).map(|(_, code)| code);
        if request.kind == MessageType::CUSTOM_MESSAGE {
            let mut fields = Fields::new(request.body);
            let [manufacturer, _] = self.model.model;
            let known = fields.u32() == Ok(IMPINJ)
                && fields.u8() == Ok(impinj_message::ENABLE_EXTENSIONS)
                && manufacturer == IMPINJ;
            return Some(if known {
                extensions_response(buffer, id, refused.unwrap_or(StatusCode::SUCCESS))
            } else {
                let code = StatusCode::UNSUPPORTED_MESSAGE;
                status_response(buffer, MessageType::ERROR_MESSAGE, id, code, "")
            });
        }
        let response = request.kind.response()?;
        Some(match refused {
            None if request.kind == MessageType::GET_READER_CAPABILITIES => {
                capabilities_response(buffer, id, &self.model)
            }
            None => status_response(buffer, response, id, StatusCode::SUCCESS, ""),
            Some(code) => status_response(buffer, response, id, code, "refused"),
        })
    }
}
