//! What the client tells its owner.

use core::fmt;

use heapless::String;
use rfhoi_shared::config::Endpoint;
use rfhoi_shared::tag::TagRead;
use rfhoi_shared::units::AntennaPort;
use rfhoi_shared::wire::{HopTable, ReaderCounts, ReaderState};

use crate::llrp::encode::EncodeError;
use crate::llrp::event::ConnectionAttempt;
use crate::llrp::frame::FrameError;
use crate::llrp::message::MessageType;
use crate::llrp::param::DecodeError;
use crate::llrp::status::{Status, StatusCode};

/// What the client wants done, or has to say.
#[derive(Debug, Clone, PartialEq)]
pub enum Output<'a> {
    /// Open a TCP connection; answer with `connected` or `connect_failed`.
    Connect(Endpoint),
    /// Close the connection, or give up opening it. Needs no answer.
    Close,
    /// Send these bytes.
    Send(&'a [u8]),
    /// A tag was read.
    Read(TagRead),
    /// The reader's channels, after every connect and before its first read.
    HopTable(&'a HopTable),
    /// The state of the link changed.
    State(ReaderState),
    /// Something that a person may want to know.
    Notice(Notice),
}

/// What a person may want to know.
#[derive(Debug, Clone, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Notice {
    /// The link was lost or given up, and why. After it the client waits and tries again.
    Lost(Loss),
    /// The reader refused a request. What follows from it is told by another notice.
    Rejected(Rejection),
    /// The reader does not know Impinj's extensions: reads have no phase.
    NoExtensions,
    /// The reader names no channels: reads cannot be told apart by frequency.
    NoChannels,
    /// The reader has more channels than a hop table holds; so many are left out.
    ChannelsOmitted(u16),
    /// The reader has fewer antenna ports than the configuration names.
    MissingAntennas {
        /// Ports of the reader.
        ports: u16,
    },
    /// The reader did not understand a message, outside of any request.
    Error(Rejection),
    /// The reader's report buffer is filled to so many per cent.
    BufferLevel(u8),
    /// The reader's report buffer overflowed: reads are lost.
    BufferOverflow,
    /// Something failed in the reader, in its words.
    Exception(Text),
    /// An antenna was connected or disconnected.
    Antenna {
        /// Which port.
        port: AntennaPort,
        /// Whether there is one now.
        connected: bool,
    },
    /// Another client tried to connect and was refused.
    OtherClient,
    /// A message of this type did not decode.
    Malformed(MessageType, DecodeError),
}

impl fmt::Display for Notice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Lost(loss) => write!(f, "{loss}; the bridge will try again"),
            Self::Rejected(rejection) | Self::Error(rejection) => write!(f, "{rejection}"),
            Self::NoExtensions => {
                write!(f, "the reader does not know Impinj's extensions: reads have no phase")
            }
            Self::NoChannels => {
                write!(f, "the reader names no channels: reads cannot be told apart by frequency")
            }
            Self::ChannelsOmitted(count) => write!(f, "{count} channels of the reader are left out"),
            Self::MissingAntennas { ports } => {
                write!(f, "the reader has {ports} antenna ports, fewer than the configuration names")
            }
            Self::BufferLevel(percent) => write!(f, "the reader's report buffer is {percent} % full"),
            Self::BufferOverflow => write!(f, "the reader's report buffer overflowed: reads are lost"),
            Self::Exception(words) => write!(f, "the reader says: {words}"),
            Self::Antenna { port, connected } => {
                let what = if *connected { "connected" } else { "disconnected" };
                write!(f, "antenna {} of the reader was {what}", port.0)
            }
            Self::OtherClient => write!(f, "another client tried to take the reader"),
            Self::Malformed(kind, error) => write!(f, "{kind} of the reader is malformed: {error}"),
        }
    }
}

/// Words of the reader, cut to what is kept.
pub type Text = String<64>;

pub(super) fn text(words: &str) -> Text {
    words.chars().scan(Text::new(), |cut, c| cut.push(c).ok().map(|()| c)).collect()
}

/// What a reader refused.
#[derive(Debug, Clone, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Rejection {
    /// What was asked; `CUSTOM_MESSAGE` is `IMPINJ_ENABLE_EXTENSIONS`. `ERROR_MESSAGE` if that cannot be told.
    pub request: MessageType,
    /// The reader's code.
    pub code: StatusCode,
    /// Type of the parameter that it objects to.
    pub parameter: Option<u16>,
    /// Number of the field that it objects to, from 0.
    pub field: Option<u16>,
    /// Its words.
    pub text: Text,
}

impl Rejection {
    pub(super) fn new(request: MessageType, status: &Status<'_>) -> Self {
        let Status { code, description, parameter, field } = *status;
        Self { request, code, parameter, field, text: text(description) }
    }
}

impl fmt::Display for Rejection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "the reader refused {} with {}", self.request, self.code)?;
        if let Some(parameter) = self.parameter {
            write!(f, ", parameter type {parameter}")?;
        }
        if let Some(field) = self.field {
            write!(f, ", field {field}")?;
        }
        if !self.text.is_empty() {
            write!(f, ": {}", self.text)?;
        }
        Ok(())
    }
}

impl core::error::Error for Rejection {}

/// Why a link was lost or given up.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Loss {
    /// The TCP connection could not be opened.
    ConnectFailed,
    /// Opening the TCP connection took too long.
    ConnectTimeout,
    /// The reader did not say whether the connection is ours.
    NoGreeting,
    /// The reader refused the connection; another client may hold it.
    Refused(ConnectionAttempt),
    /// A request got no response.
    Timeout(MessageType),
    /// The reader refused a request that reading depends on.
    Rejected(MessageType),
    /// The stream cannot be cut into messages.
    Framing(FrameError),
    /// The capabilities did not decode.
    Capabilities(DecodeError),
    /// No message for three periods of the keepalive.
    Silent,
    /// The TCP connection was closed.
    Closed,
    /// The reader said that it closes the connection.
    ClosedByReader,
    /// The reader ended the ROSpec, which has no end of its own.
    RoSpecEnded,
    /// A request could not be written.
    Unencodable(EncodeError),
}

impl fmt::Display for Loss {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::ConnectFailed => write!(f, "the reader's TCP port cannot be reached"),
            Self::ConnectTimeout => write!(f, "opening the TCP connection to the reader took too long"),
            Self::NoGreeting => write!(f, "the reader took the connection and said nothing"),
            Self::Refused(ConnectionAttempt::Failed) => write!(f, "the reader refused the connection"),
            Self::Refused(_) => write!(f, "another client holds the reader"),
            Self::Timeout(request) => write!(f, "no response to {request}"),
            Self::Rejected(request) => write!(f, "{request} was refused"),
            Self::Framing(error) => write!(f, "no LLRP stream: {error}"),
            Self::Capabilities(error) => write!(f, "reader capabilities: {error}"),
            Self::Silent => write!(f, "three keepalives of the reader are missing"),
            Self::Closed => write!(f, "the reader's TCP connection was closed"),
            Self::ClosedByReader => write!(f, "the reader ended the connection"),
            Self::RoSpecEnded => write!(f, "the reader ended the ROSpec"),
            Self::Unencodable(error) => write!(f, "{error}"),
        }
    }
}

impl core::error::Error for Loss {}

/// Counts of a client since it was made. They stay at their highest value rather than wrap.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Counts {
    /// Those of the telemetry.
    pub link: ReaderCounts,
    /// Messages skipped for their length.
    pub oversized: u32,
    /// Reads without phase though the reader took Impinj's extensions.
    pub without_phase: u32,
    /// Reads dropped because the EPC is longer than Gen2 allows.
    pub long_epcs: u32,
    /// Reads dropped because they came before this client's ROSpec was started.
    pub foreign: u32,
    /// Responses that nobody waited for.
    pub unexpected: u32,
    /// Requests that the reader refused.
    pub rejected: u32,
    /// Keepalives answered.
    pub keepalives: u32,
    /// Steps of the reader's clock.
    pub clock_steps: u32,
}
