//! Types of LLRP messages and parameters, by their names in the specification (LLRP 1.0.1 section 16; Impinj's in its
//! extension definitions, vendor 25882).

use core::fmt;

/// Private enterprise number of Impinj, the vendor of its extensions.
pub const IMPINJ: u32 = 25_882;

/// One message of the stream: header taken apart, body as it came.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Message<'a> {
    /// Type.
    pub kind: MessageType,
    /// Message ID; a response repeats its request's.
    pub id: u32,
    /// What follows the header.
    pub body: &'a [u8],
}

/// Type of a message, 10 bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct MessageType(pub u16);

macro_rules! message_types {
    ($($name:ident = $value:literal,)*) => {
        impl MessageType {
            $(
                #[doc = concat!("`", stringify!($name), "`, type ", stringify!($value), ".")]
                pub const $name: Self = Self($value);
            )*

            /// Every type that LLRP 1.0.1 defines.
            pub const ALL: &[Self] = &[$(Self::$name,)*];

            /// Name in the specification, or `None` for a type that it does not define.
            pub fn name(self) -> Option<&'static str> {
                match self {
                    $(Self::$name => Some(stringify!($name)),)*
                    _ => None,
                }
            }
        }
    };
}

message_types! {
    GET_READER_CAPABILITIES = 1,
    GET_READER_CONFIG = 2,
    SET_READER_CONFIG = 3,
    CLOSE_CONNECTION_RESPONSE = 4,
    GET_READER_CAPABILITIES_RESPONSE = 11,
    GET_READER_CONFIG_RESPONSE = 12,
    SET_READER_CONFIG_RESPONSE = 13,
    CLOSE_CONNECTION = 14,
    ADD_ROSPEC = 20,
    DELETE_ROSPEC = 21,
    START_ROSPEC = 22,
    STOP_ROSPEC = 23,
    ENABLE_ROSPEC = 24,
    DISABLE_ROSPEC = 25,
    GET_ROSPECS = 26,
    ADD_ROSPEC_RESPONSE = 30,
    DELETE_ROSPEC_RESPONSE = 31,
    START_ROSPEC_RESPONSE = 32,
    STOP_ROSPEC_RESPONSE = 33,
    ENABLE_ROSPEC_RESPONSE = 34,
    DISABLE_ROSPEC_RESPONSE = 35,
    GET_ROSPECS_RESPONSE = 36,
    ADD_ACCESSSPEC = 40,
    DELETE_ACCESSSPEC = 41,
    ENABLE_ACCESSSPEC = 42,
    DISABLE_ACCESSSPEC = 43,
    GET_ACCESSSPECS = 44,
    ADD_ACCESSSPEC_RESPONSE = 50,
    DELETE_ACCESSSPEC_RESPONSE = 51,
    ENABLE_ACCESSSPEC_RESPONSE = 52,
    DISABLE_ACCESSSPEC_RESPONSE = 53,
    GET_ACCESSSPECS_RESPONSE = 54,
    GET_REPORT = 60,
    RO_ACCESS_REPORT = 61,
    KEEPALIVE = 62,
    READER_EVENT_NOTIFICATION = 63,
    ENABLE_EVENTS_AND_REPORTS = 64,
    KEEPALIVE_ACK = 72,
    ERROR_MESSAGE = 100,
    CUSTOM_MESSAGE = 1023,
}

impl MessageType {
    /// Type of the response to this request, or `None` where the protocol has none or it is the vendor's affair.
    pub fn response(self) -> Option<Self> {
        Some(match self {
            Self::CLOSE_CONNECTION => Self::CLOSE_CONNECTION_RESPONSE,
            Self(kind @ (1..=3 | 20..=26 | 40..=44)) => Self(kind + 10),
            _ => return None,
        })
    }
}

impl fmt::Display for MessageType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.name() {
            Some(name) => f.write_str(name),
            None => write!(f, "message type {}", self.0),
        }
    }
}

/// Subtypes of Impinj's custom messages.
pub mod impinj_message {
    /// `IMPINJ_ENABLE_EXTENSIONS`.
    pub const ENABLE_EXTENSIONS: u8 = 21;
    /// `IMPINJ_ENABLE_EXTENSIONS_RESPONSE`.
    pub const ENABLE_EXTENSIONS_RESPONSE: u8 = 22;
}

/// Type of a parameter and with it how it is framed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ParameterType {
    /// Type and value, 7 bits of type; the type alone fixes the length.
    Tv(u8),
    /// Type, length and value, 10 bits of type.
    Tlv(u16),
    /// TLV of type 1023: a vendor's own.
    Custom {
        /// Private enterprise number.
        vendor: u32,
        /// The vendor's number for it.
        subtype: u32,
    },
}

/// TLV type that carries custom parameters.
pub(super) const CUSTOM_PARAMETER: u16 = 1023;

macro_rules! parameter_types {
    ($($name:ident = $value:expr, $doc:literal;)*) => {
        impl ParameterType {
            $(
                #[doc = $doc]
                pub const $name: Self = $value;
            )*
        }
    };
}

const fn impinj(subtype: u32) -> ParameterType {
    ParameterType::Custom { vendor: IMPINJ, subtype }
}

use ParameterType::{Tlv, Tv};

parameter_types! {
    ANTENNA_ID = Tv(1), "`AntennaID`: u16.";
    FIRST_SEEN_UTC = Tv(2), "`FirstSeenTimestampUTC`: u64 us.";
    FIRST_SEEN_UPTIME = Tv(3), "`FirstSeenTimestampUptime`: u64 us.";
    LAST_SEEN_UTC = Tv(4), "`LastSeenTimestampUTC`: u64 us.";
    LAST_SEEN_UPTIME = Tv(5), "`LastSeenTimestampUptime`: u64 us.";
    PEAK_RSSI = Tv(6), "`PeakRSSI`: s8 dBm.";
    CHANNEL_INDEX = Tv(7), "`ChannelIndex`: u16, from 1.";
    TAG_SEEN_COUNT = Tv(8), "`TagSeenCount`: u16.";
    ROSPEC_ID = Tv(9), "`ROSpecID`: u32.";
    EPC_96 = Tv(13), "`EPC-96`: 12 bytes.";
    UTC_TIMESTAMP = Tlv(128), "`UTCTimestamp`: u64 us.";
    UPTIME = Tlv(129), "`Uptime`: u64 us.";
    GENERAL_DEVICE_CAPABILITIES = Tlv(137), "`GeneralDeviceCapabilities`.";
    RECEIVE_SENSITIVITY_TABLE_ENTRY = Tlv(139), "`ReceiveSensitivityTableEntry`: u16 index, u16 dB over the best.";
    PER_ANTENNA_AIR_PROTOCOL = Tlv(140), "`PerAntennaAirProtocol`: u16 antenna, u16 n, n x u8 protocol.";
    GPIO_CAPABILITIES = Tlv(141), "`GPIOCapabilities`: u16 inputs, u16 outputs.";
    LLRP_CAPABILITIES = Tlv(142), "`LLRPCapabilities`: 5 flags, 3 reserved, u8 priorities, u16 ms, 5 x u32 limits.";
    REGULATORY_CAPABILITIES = Tlv(143), "`RegulatoryCapabilities`.";
    UHF_BAND_CAPABILITIES = Tlv(144), "`UHFBandCapabilities`.";
    TRANSMIT_POWER_LEVEL_TABLE_ENTRY = Tlv(145), "`TransmitPowerLevelTableEntry`: u16 index, s16 dBm x 100.";
    FREQUENCY_INFORMATION = Tlv(146), "`FrequencyInformation`: u1 hopping, 7 reserved.";
    FREQUENCY_HOP_TABLE = Tlv(147), "`FrequencyHopTable`: u8 id, 8 reserved, u16 n, n x u32 kHz.";
    FIXED_FREQUENCY_TABLE = Tlv(148), "`FixedFrequencyTable`: u16 n, n x u32 kHz.";
    C1G2_LLRP_CAPABILITIES = Tlv(327), "`C1G2LLRPCapabilities`: 6 flags, 2 reserved, u16 filters.";
    UHF_C1G2_RF_MODE_TABLE = Tlv(328), "`UHFC1G2RFModeTable`.";
    UHF_C1G2_RF_MODE_TABLE_ENTRY = Tlv(329), "`UHFC1G2RFModeTableEntry`: u32 mode, flags, codings, rates.";
    ROSPEC = Tlv(177), "`ROSpec`: u32 id, u8 priority, u8 state.";
    RO_BOUNDARY_SPEC = Tlv(178), "`ROBoundarySpec`.";
    ROSPEC_START_TRIGGER = Tlv(179), "`ROSpecStartTrigger`: u8.";
    ROSPEC_STOP_TRIGGER = Tlv(182), "`ROSpecStopTrigger`: u8, u32 ms.";
    AI_SPEC = Tlv(183), "`AISpec`: u16 n, n x u16 antenna.";
    AI_SPEC_STOP_TRIGGER = Tlv(184), "`AISpecStopTrigger`: u8, u32 ms.";
    INVENTORY_PARAMETER_SPEC = Tlv(186), "`InventoryParameterSpec`: u16 id, u8 protocol.";
    KEEPALIVE_SPEC = Tlv(220), "`KeepaliveSpec`: u8 trigger, u32 ms.";
    ANTENNA_CONFIGURATION = Tlv(222), "`AntennaConfiguration`: u16 antenna.";
    RF_TRANSMITTER = Tlv(224), "`RFTransmitter`: u16 hop table, u16 channel, u16 power.";
    EVENTS_AND_REPORTS = Tlv(226), "`EventsAndReports`: u1 hold upon reconnect, 7 reserved.";
    RO_REPORT_SPEC = Tlv(237), "`ROReportSpec`: u8 trigger, u16 N.";
    TAG_REPORT_CONTENT_SELECTOR = Tlv(238), "`TagReportContentSelector`: 10 flags, 6 reserved.";
    TAG_REPORT_DATA = Tlv(240), "`TagReportData`.";
    EPC_DATA = Tlv(241), "`EPCData`: u16 bits, bytes.";
    READER_EVENT_NOTIFICATION_SPEC = Tlv(244), "`ReaderEventNotificationSpec`.";
    EVENT_NOTIFICATION_STATE = Tlv(245), "`EventNotificationState`: u16 event type, u1 on, 7 reserved.";
    READER_EVENT_NOTIFICATION_DATA = Tlv(246), "`ReaderEventNotificationData`.";
    HOPPING_EVENT = Tlv(247), "`HoppingEvent`: u16 table, u16 next channel.";
    ROSPEC_EVENT = Tlv(249), "`ROSpecEvent`: u8 type, u32 id, u32 preempting id.";
    REPORT_BUFFER_LEVEL_WARNING_EVENT = Tlv(250), "`ReportBufferLevelWarningEvent`: u8 per cent.";
    REPORT_BUFFER_OVERFLOW_ERROR_EVENT = Tlv(251), "`ReportBufferOverflowErrorEvent`.";
    READER_EXCEPTION_EVENT = Tlv(252), "`ReaderExceptionEvent`: u16 n, n bytes UTF-8.";
    ANTENNA_EVENT = Tlv(255), "`AntennaEvent`: u8 type, u16 antenna.";
    CONNECTION_ATTEMPT_EVENT = Tlv(256), "`ConnectionAttemptEvent`: u16 status.";
    CONNECTION_CLOSE_EVENT = Tlv(257), "`ConnectionCloseEvent`.";
    LLRP_STATUS = Tlv(287), "`LLRPStatus`: u16 code, u16 n, n bytes UTF-8.";
    FIELD_ERROR = Tlv(288), "`FieldError`: u16 field, u16 code.";
    PARAMETER_ERROR = Tlv(289), "`ParameterError`: u16 parameter type, u16 code.";
    C1G2_INVENTORY_COMMAND = Tlv(330), "`C1G2InventoryCommand`: u1 state aware, 7 reserved.";
    C1G2_RF_CONTROL = Tlv(335), "`C1G2RFControl`: u16 mode, u16 tari.";
    C1G2_SINGULATION_CONTROL = Tlv(336), "`C1G2SingulationControl`: u2 session, 6 reserved, u16 tags, u32 ms.";
    IMPINJ_INVENTORY_SEARCH_MODE = impinj(23), "`ImpinjInventorySearchMode`: u16.";
    IMPINJ_LINK_MONITOR_CONFIGURATION = impinj(38), "`ImpinjLinkMonitorConfiguration`: u16 mode, u16 threshold.";
    IMPINJ_REPORT_BUFFER_CONFIGURATION = impinj(39), "`ImpinjReportBufferConfiguration`: u16.";
    IMPINJ_TAG_REPORT_CONTENT_SELECTOR = impinj(50), "`ImpinjTagReportContentSelector`.";
    IMPINJ_ENABLE_RF_PHASE_ANGLE = impinj(52), "`ImpinjEnableRFPhaseAngle`: u16.";
    IMPINJ_ENABLE_PEAK_RSSI = impinj(53), "`ImpinjEnablePeakRSSI`: u16.";
    IMPINJ_RF_PHASE_ANGLE = impinj(56), "`ImpinjRFPhaseAngle`: u16, 4096 to the turn.";
    IMPINJ_PEAK_RSSI = impinj(57), "`ImpinjPeakRSSI`: s16, dBm x 100.";
    IMPINJ_ENABLE_RF_DOPPLER_FREQUENCY = impinj(67), "`ImpinjEnableRFDopplerFrequency`: u16.";
    IMPINJ_RF_DOPPLER_FREQUENCY = impinj(68), "`ImpinjRFDopplerFrequency`: s16, Hz x 16.";
}

impl ParameterType {
    /// Bytes of the value of a TV parameter (LLRP 1.0.1 section 16.2.7.3), or `None` for types that it does not
    /// define: what follows such a one cannot be found.
    pub fn tv_length(kind: u8) -> Option<usize> {
        Some(match kind {
            6 => 1,
            1 | 7 | 8 | 10..=12 | 14 | 15 | 17 | 19 | 20 => 2,
            9 | 16 | 18 => 4,
            2..=5 => 8,
            13 => 12,
            _ => return None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn responses_are_those_of_the_specification() {
        for &request in MessageType::ALL {
            let Some(response) = request.response() else { continue };
            let (request, response) = (request.name().unwrap(), response.name().unwrap());
            assert_eq!(response.strip_suffix("_RESPONSE"), Some(request));
        }
        assert_eq!(MessageType::KEEPALIVE.response(), None);
        assert_eq!(MessageType(999).name(), None);
    }
}
