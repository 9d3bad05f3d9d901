//! `READER_EVENT_NOTIFICATION`: what a reader tells unasked (LLRP 1.0.1 section 13.1.7 and 13.2.6).

use rfhoi_shared::units::{AntennaPort, ChannelIndex, ReaderTime};

use super::message::ParameterType as P;
use super::param::{DecodeError, Fault, Fields, Parameters};

/// Types of event that can be turned on and off (`EventNotificationState`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u16)]
pub enum EventType {
    /// The reader hops to another channel.
    Hopping = 0,
    /// A general purpose input changed.
    Gpi = 1,
    /// An ROSpec began, ended or was preempted.
    RoSpec = 2,
    /// The report buffer fills up.
    ReportBufferFill = 3,
    /// Something failed in the reader.
    ReaderException = 4,
    /// An RF survey began or ended.
    RfSurvey = 5,
    /// An AISpec ended.
    AiSpec = 6,
    /// An AISpec ended, with details of the singulation.
    AiSpecWithDetails = 7,
    /// An antenna was connected or disconnected.
    Antenna = 8,
}

/// Outcome of a connection attempt.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ConnectionAttempt {
    /// The connection is this client's.
    Success,
    /// Refused: the reader itself holds a connection to a client.
    ReaderInitiatedConnectionExists,
    /// Refused: another client holds the reader.
    ClientInitiatedConnectionExists,
    /// Refused for another reason.
    Failed,
    /// Another client tried to connect while this one holds the reader.
    AnotherAttempted,
}

impl ConnectionAttempt {
    const ALL: [Self; 5] = [
        Self::Success,
        Self::ReaderInitiatedConnectionExists,
        Self::ClientInitiatedConnectionExists,
        Self::Failed,
        Self::AnotherAttempted,
    ];

    /// Code on the wire.
    pub fn code(self) -> u16 {
        self as u16
    }

    fn from_code(code: u16) -> Option<Self> {
        Self::ALL.get(usize::from(code)).copied()
    }
}

/// What an ROSpec did.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum RoSpecChange {
    /// Began.
    Start,
    /// Ended.
    End,
    /// Was preempted by another.
    Preempted,
}

/// One event.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Event<'a> {
    /// The reader hops.
    Hopping {
        /// Hop table.
        table: u16,
        /// Channel to which it goes.
        next: ChannelIndex,
    },
    /// An ROSpec began or ended.
    RoSpec {
        /// What it did.
        change: RoSpecChange,
        /// Which.
        rospec: u32,
    },
    /// The report buffer is filled to so many per cent.
    BufferLevel(u8),
    /// The report buffer overflowed: reads are lost.
    BufferOverflow,
    /// Something failed in the reader.
    Exception(&'a str),
    /// An antenna was connected or disconnected.
    Antenna {
        /// Which port.
        port: AntennaPort,
        /// Whether there is one now.
        connected: bool,
    },
    /// Outcome of a connection attempt.
    ConnectionAttempt(ConnectionAttempt),
    /// The reader closes the connection.
    ConnectionClose,
    /// An event that is none of the above.
    Other(P),
}

/// A notification: its time, and an iterator over its events.
#[derive(Debug, Clone, Copy)]
pub struct EventNotification<'a> {
    /// When, by the reader's UTC clock or, if it has none, since it started.
    pub time: ReaderTime,
    events: Parameters<'a>,
}

impl<'a> EventNotification<'a> {
    /// From a message's body.
    ///
    /// # Errors
    /// If the body or its timestamp is malformed.
    pub fn decode(body: &'a [u8]) -> Result<Self, DecodeError> {
        let data = Parameters::new(body).find(P::READER_EVENT_NOTIFICATION_DATA)?;
        let missing = data.error(Fault::Missing(P::UTC_TIMESTAMP));
        let mut events = data.parameters();
        let first = events.next().ok_or(missing)??;
        let mut fields = first.fields;
        match first.kind {
            P::UTC_TIMESTAMP | P::UPTIME => Ok(Self { time: ReaderTime(fields.u64()?), events }),
            _ => Err(missing),
        }
    }
}

impl<'a> Iterator for EventNotification<'a> {
    type Item = Result<Event<'a>, DecodeError>;

    fn next(&mut self) -> Option<Self::Item> {
        let parameter = self.events.next()?;
        Some(parameter.and_then(|p| event(p.kind, p.fields)))
    }
}

fn event(kind: P, mut fields: Fields<'_>) -> Result<Event<'_>, DecodeError> {
    let start = fields;
    let value = || start.error(Fault::Value);
    Ok(match kind {
        P::HOPPING_EVENT => Event::Hopping { table: fields.u16()?, next: ChannelIndex(fields.u16()?) },
        P::ROSPEC_EVENT => {
            let change = match fields.u8()? {
                0 => RoSpecChange::Start,
                1 => RoSpecChange::End,
                2 => RoSpecChange::Preempted,
                _ => return Err(value()),
            };
            Event::RoSpec { change, rospec: fields.u32()? }
        }
        P::REPORT_BUFFER_LEVEL_WARNING_EVENT => Event::BufferLevel(fields.u8()?),
        P::REPORT_BUFFER_OVERFLOW_ERROR_EVENT => Event::BufferOverflow,
        P::READER_EXCEPTION_EVENT => Event::Exception(fields.text()?),
        P::ANTENNA_EVENT => {
            let connected = match fields.u8()? {
                0 => false,
                1 => true,
                _ => return Err(value()),
            };
            Event::Antenna { port: AntennaPort(fields.u16()?), connected }
        }
        P::CONNECTION_ATTEMPT_EVENT => {
            Event::ConnectionAttempt(ConnectionAttempt::from_code(fields.u16()?).ok_or(value())?)
        }
        P::CONNECTION_CLOSE_EVENT => Event::ConnectionClose,
        other => Event::Other(other),
    })
}
