//! Messages of the reader, told apart.

use super::event::EventNotification;
use super::message::{IMPINJ, Message, MessageType, impinj_message};
use super::param::{DecodeError, Fields};
use super::report::TagReports;
use super::status::Status;

/// A message of the reader.
#[derive(Debug, Clone, Copy)]
pub enum Incoming<'a> {
    /// Response to a standard request: its type and outcome. Capabilities are in the body
    /// ([`Capabilities::decode`](super::capabilities::Capabilities::decode)).
    Response(MessageType, Status<'a>),
    /// Response to `IMPINJ_ENABLE_EXTENSIONS`.
    ExtensionsResponse(Status<'a>),
    /// `ERROR_MESSAGE`: the reader did not understand a message.
    Error(Status<'a>),
    /// Tag reads.
    Reports(TagReports<'a>),
    /// Events.
    Events(EventNotification<'a>),
    /// The reader lives, and wants to hear that the client does.
    Keepalive,
    /// A type that a reader does not send, or a vendor's own.
    Unknown,
}

impl<'a> Incoming<'a> {
    /// Tells what `message` is.
    ///
    /// # Errors
    /// If its status or timestamp is missing or malformed. Reports and events are decoded as they are walked.
    pub fn decode(message: &Message<'a>) -> Result<Self, DecodeError> {
        let mut fields = Fields::new(message.body);
        Ok(match message.kind {
            MessageType::RO_ACCESS_REPORT => Self::Reports(TagReports::new(message.body)),
            MessageType::KEEPALIVE => Self::Keepalive,
            MessageType::READER_EVENT_NOTIFICATION => Self::Events(EventNotification::decode(message.body)?),
            MessageType::ERROR_MESSAGE => Self::Error(Status::of_response(fields.parameters())?),
            kind @ (MessageType::CLOSE_CONNECTION_RESPONSE | MessageType(11..=13 | 30..=36 | 50..=54)) => {
                Self::Response(kind, Status::of_response(fields.parameters())?)
            }
            MessageType::CUSTOM_MESSAGE => match (fields.u32()?, fields.u8()?) {
                (IMPINJ, impinj_message::ENABLE_EXTENSIONS_RESPONSE) => {
                    Self::ExtensionsResponse(Status::of_response(fields.parameters())?)
                }
                _ => Self::Unknown,
            },
            _ => Self::Unknown,
        })
    }
}
