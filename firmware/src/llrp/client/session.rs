//! The state machine behind [`Client`](super::Client), after framing.

use rfhoi_shared::config::ReaderConfig;
use rfhoi_shared::units::{AntennaPort, BridgeTime};
use rfhoi_shared::wire::ReaderState;

use super::Sink;
use super::backoff::Backoff;
use super::outcome::{Counts, Loss, Notice, Output, Rejection, text};
use super::step::Step;
use crate::llrp::capabilities::Capabilities;
use crate::llrp::clock::ReaderClock;
use crate::llrp::decode::Incoming;
use crate::llrp::encode::EncodeError;
use crate::llrp::event::{ConnectionAttempt, Event, EventNotification, EventType, RoSpecChange};
use crate::llrp::message::{Message, MessageType};
use crate::llrp::param::DecodeError;
use crate::llrp::report::{Repeated, TagReport, TagReports};
use crate::llrp::request::{self, ALL_SPECS, ROSPEC_ID, ReaderSettings, TransmitChannel};
use crate::llrp::status::{Status, StatusCode};

/// Time to open a TCP connection, us.
const CONNECT_US: u64 = 5_000_000;
/// Time for the reader to say whether the connection is ours, and to answer a request, us.
const RESPONSE_US: u64 = 5_000_000;
/// Time for the reader to answer a goodbye, us.
const GOODBYE_US: u64 = 1_000_000;
/// Keepalives that may be missing.
const MISSED_KEEPALIVES: u64 = 3;
/// A link that has read for so long was a good one: the next wait is short again, us.
const STABLE_US: u64 = 30_000_000;

/// Events that the client wants, and those that it does not in case an earlier client did.
const EVENTS: [(EventType, bool); 6] = [
    (EventType::Hopping, false),
    (EventType::RoSpec, true),
    (EventType::ReportBufferFill, true),
    (EventType::ReaderException, true),
    (EventType::AiSpec, false),
    (EventType::Antenna, true),
];

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Phase {
    Stopped,
    /// Before the next attempt.
    Waiting {
        until: BridgeTime,
    },
    /// The TCP connection is being opened.
    Opening {
        until: BridgeTime,
    },
    /// It is open, and the reader has not said whose it is.
    Greeting {
        until: BridgeTime,
    },
    /// A request is under way.
    Asking {
        step: Step,
        id: u32,
        until: BridgeTime,
    },
    /// Reads arrive; the last message came at `heard`.
    Reading {
        since: BridgeTime,
        heard: BridgeTime,
    },
    /// Goodbye was said; with `restart`, to connect anew after it.
    Closing {
        id: u32,
        until: BridgeTime,
        restart: bool,
    },
}

#[derive(Debug)]
pub(super) struct Session {
    config: ReaderConfig,
    phase: Phase,
    backoff: Backoff,
    clock: ReaderClock,
    repeated: Repeated,
    /// Whether this link's reader took Impinj's extensions.
    impinj: bool,
    channel: TransmitChannel,
    last_id: u32,
    counts: Counts,
}

fn count(counter: &mut u32) {
    *counter = counter.saturating_add(1);
}

impl Session {
    pub(super) fn new(config: ReaderConfig, seed: u64) -> Self {
        Self {
            config,
            phase: Phase::Stopped,
            backoff: Backoff::new(seed),
            clock: ReaderClock::default(),
            repeated: Repeated::default(),
            impinj: false,
            channel: TransmitChannel { hop_table: 0, channel: 0 },
            last_id: 0,
            counts: Counts::default(),
        }
    }

    pub(super) fn counts(&self) -> Counts {
        Counts { clock_steps: self.clock.steps(), ..self.counts }
    }

    /// Whether a TCP connection is open, as far as the client is concerned.
    pub(super) fn is_linked(&self) -> bool {
        !matches!(self.phase, Phase::Stopped | Phase::Waiting { .. } | Phase::Opening { .. })
    }

    pub(super) fn deadline(&self) -> Option<BridgeTime> {
        match self.phase {
            Phase::Stopped => None,
            Phase::Waiting { until }
            | Phase::Opening { until }
            | Phase::Greeting { until }
            | Phase::Asking { until, .. }
            | Phase::Closing { until, .. } => Some(until),
            Phase::Reading { heard, .. } => {
                let period = u64::from(self.config.keepalive_ms).saturating_mul(1000);
                Some(heard.after(period.saturating_mul(MISSED_KEEPALIVES)))
            }
        }
    }

    pub(super) fn start(&mut self, now: BridgeTime, out: &mut Sink<'_>) {
        match &mut self.phase {
            Phase::Stopped => self.open(now, out),
            Phase::Closing { restart, .. } => *restart = true,
            _ => {}
        }
    }

    fn open(&mut self, now: BridgeTime, out: &mut Sink<'_>) {
        self.phase = Phase::Opening { until: now.after(CONNECT_US) };
        self.set_state(ReaderState::Connecting, out);
        out(Output::Connect(self.config.endpoint));
    }

    pub(super) fn connected(&mut self, now: BridgeTime, out: &mut Sink<'_>) {
        if !matches!(self.phase, Phase::Opening { .. }) {
            // Given up meanwhile.
            return out(Output::Close);
        }
        self.phase = Phase::Greeting { until: now.after(RESPONSE_US) };
        self.clock.reset();
        self.repeated = Repeated::default();
        self.impinj = false;
    }

    pub(super) fn connect_failed(&mut self, now: BridgeTime, out: &mut Sink<'_>) {
        if matches!(self.phase, Phase::Opening { .. }) {
            self.wait(now, Loss::ConnectFailed, out);
        }
    }

    pub(super) fn closed(&mut self, now: BridgeTime, out: &mut Sink<'_>) {
        match self.phase {
            Phase::Closing { .. } => self.stopped(now, out),
            _ if self.is_linked() => {
                self.count_loss();
                self.wait(now, Loss::Closed, out);
            }
            _ => {}
        }
    }

    pub(super) fn stop(&mut self, now: BridgeTime, out: &mut Sink<'_>) {
        match &mut self.phase {
            Phase::Stopped => {}
            Phase::Closing { restart, .. } => *restart = false,
            Phase::Waiting { .. } => self.stopped(now, out),
            Phase::Opening { .. } | Phase::Greeting { .. } => {
                out(Output::Close);
                self.stopped(now, out);
            }
            Phase::Asking { .. } | Phase::Reading { .. } => {
                // Their responses are not waited for: the reader may have none of this ROSpec.
                self.send(out, |b, id| request::stop_rospec(b, id, ROSPEC_ID)).ok();
                self.send(out, |b, id| request::delete_rospec(b, id, ROSPEC_ID)).ok();
                match self.send(out, request::close_connection) {
                    Ok(id) => {
                        self.phase = Phase::Closing { id, until: now.after(GOODBYE_US), restart: false };
                    }
                    Err(_) => {
                        out(Output::Close);
                        self.stopped(now, out);
                    }
                }
            }
        }
    }

    fn stopped(&mut self, now: BridgeTime, out: &mut Sink<'_>) {
        let restart = matches!(self.phase, Phase::Closing { restart: true, .. });
        self.phase = Phase::Stopped;
        self.backoff.reset();
        self.set_state(ReaderState::None, out);
        if restart {
            self.open(now, out);
        }
    }

    pub(super) fn tick(&mut self, now: BridgeTime, out: &mut Sink<'_>) {
        if self.deadline().is_none_or(|deadline| now < deadline) {
            return;
        }
        match self.phase {
            Phase::Stopped => {}
            Phase::Waiting { .. } => self.open(now, out),
            Phase::Opening { .. } => {
                out(Output::Close);
                self.wait(now, Loss::ConnectTimeout, out);
            }
            Phase::Greeting { .. } => self.lose(now, Loss::NoGreeting, out),
            Phase::Asking { step, .. } => self.lose(now, Loss::Timeout(step.request()), out),
            Phase::Reading { .. } => self.lose(now, Loss::Silent, out),
            Phase::Closing { .. } => {
                out(Output::Close);
                self.stopped(now, out);
            }
        }
    }

    /// Gives up the open link.
    pub(super) fn lose(&mut self, now: BridgeTime, loss: Loss, out: &mut Sink<'_>) {
        if let Phase::Closing { .. } = self.phase {
            out(Output::Close);
            return self.stopped(now, out);
        }
        if matches!(self.phase, Phase::Asking { .. } | Phase::Reading { .. }) {
            // So that a reader that still listens does not hold a session for a client that is gone.
            self.send(out, request::close_connection).ok();
        }
        self.count_loss();
        out(Output::Close);
        self.wait(now, loss, out);
    }

    /// A link counts as lost if it was ours.
    fn count_loss(&mut self) {
        if matches!(self.phase, Phase::Asking { .. } | Phase::Reading { .. }) {
            count(&mut self.counts.link.link_losses);
        }
    }

    fn wait(&mut self, now: BridgeTime, loss: Loss, out: &mut Sink<'_>) {
        if let Phase::Reading { since, .. } = self.phase
            && now.since(since) >= STABLE_US
        {
            self.backoff.reset();
        }
        self.phase = Phase::Waiting { until: now.after(self.backoff.wait_us()) };
        out(Output::Notice(Notice::Lost(loss)));
        let occupied = matches!(loss, Loss::Refused(attempt) if attempt != ConnectionAttempt::Failed);
        self.set_state(if occupied { ReaderState::Occupied } else { ReaderState::Waiting }, out);
    }

    fn set_state(&mut self, state: ReaderState, out: &mut Sink<'_>) {
        if self.counts.link.state != state {
            self.counts.link.state = state;
            out(Output::State(state));
        }
    }

    /// Sends a message under a new message ID and returns that.
    fn send(
        &mut self,
        out: &mut Sink<'_>,
        write: impl FnOnce(&mut [u8], u32) -> Result<&[u8], EncodeError>,
    ) -> Result<u32, EncodeError> {
        // 0 is what readers give their own messages.
        self.last_id = self.last_id.checked_add(1).unwrap_or(1);
        let mut buffer = [0; request::MAX_REQUEST_BYTES];
        out(Output::Send(write(&mut buffer, self.last_id)?));
        Ok(self.last_id)
    }

    fn ask(&mut self, now: BridgeTime, step: Step, out: &mut Sink<'_>) {
        let (impinj, channel) = (self.impinj, self.channel);
        let sent = match step {
            Step::Extensions => self.send(out, request::enable_extensions),
            Step::Capabilities => self.send(out, request::get_reader_capabilities),
            Step::Settings => {
                let settings = ReaderSettings {
                    reset_to_factory_default: false,
                    events: &EVENTS,
                    keepalive_ms: Some(self.config.keepalive_ms),
                    hold_upon_reconnect: Some(false),
                    link_down_threshold: impinj.then_some(request::LINK_DOWN_THRESHOLD),
                    low_latency: impinj,
                };
                self.send(out, |b, id| request::set_reader_config(b, id, &settings))
            }
            Step::DeleteAccessSpecs => self.send(out, |b, id| request::delete_accessspec(b, id, ALL_SPECS)),
            Step::DeleteRoSpecs => self.send(out, |b, id| request::delete_rospec(b, id, ALL_SPECS)),
            Step::DeleteOwnRoSpec => self.send(out, |b, id| request::delete_rospec(b, id, ROSPEC_ID)),
            Step::AddRoSpec => {
                let config = self.config.clone();
                self.send(out, |b, id| request::add_rospec(b, id, &config, channel, impinj))
            }
            Step::EnableRoSpec => self.send(out, |b, id| request::enable_rospec(b, id, ROSPEC_ID)),
            Step::StartRoSpec => self
                .send(out, request::enable_events_and_reports)
                .and_then(|_| self.send(out, |b, id| request::start_rospec(b, id, ROSPEC_ID))),
        };
        match sent {
            Ok(id) => self.phase = Phase::Asking { step, id, until: now.after(RESPONSE_US) },
            Err(error) => self.lose(now, Loss::Unencodable(error), out),
        }
    }

    /// Takes a message of the reader.
    pub(super) fn message(&mut self, now: BridgeTime, message: &Message<'_>, out: &mut Sink<'_>) {
        if let Phase::Reading { heard, .. } = &mut self.phase {
            *heard = now;
        }
        match Incoming::decode(message) {
            Ok(Incoming::Response(MessageType::CLOSE_CONNECTION_RESPONSE, _)) if matches!(self.phase, Phase::Closing { id, .. } if id == message.id) =>
            {
                out(Output::Close);
                self.stopped(now, out);
            }
            Ok(Incoming::Response(kind, status)) => {
                self.response(now, message, status, out, |step| step.request().response() == Some(kind));
            }
            Ok(Incoming::ExtensionsResponse(status)) => {
                self.response(now, message, status, out, |step| step == Step::Extensions);
            }
            Ok(Incoming::Error(status)) => self.error(now, message.id, status, out),
            Ok(Incoming::Reports(reports)) => self.reports(now, reports, out),
            Ok(Incoming::Events(notification)) => self.events(now, notification, out),
            Ok(Incoming::Keepalive) => {
                let mut buffer = [0; request::MAX_REQUEST_BYTES];
                if let Ok(ack) = request::keepalive_ack(&mut buffer, message.id) {
                    out(Output::Send(ack));
                    count(&mut self.counts.keepalives);
                }
            }
            Ok(Incoming::Unknown) => count(&mut self.counts.link.unknown),
            Err(error) => self.malformed(message.kind, error, out),
        }
    }

    fn malformed(&mut self, kind: MessageType, error: DecodeError, out: &mut Sink<'_>) {
        count(&mut self.counts.link.malformed);
        out(Output::Notice(Notice::Malformed(kind, error)));
    }

    /// A response; `answers` tells whether its type is that of a step.
    fn response(
        &mut self,
        now: BridgeTime,
        message: &Message<'_>,
        status: Status<'_>,
        out: &mut Sink<'_>,
        answers: impl FnOnce(Step) -> bool,
    ) {
        match self.phase {
            Phase::Asking { step, id, .. } if id == message.id && answers(step) => {
                if status.code == StatusCode::SUCCESS {
                    self.granted(now, step, message.body, out);
                } else {
                    self.rejected(now, step, &status, out);
                }
            }
            // Stopping or deleting an ROSpec that was never added may fail.
            Phase::Closing { .. } => {}
            _ => count(&mut self.counts.unexpected),
        }
    }

    /// `ERROR_MESSAGE` is the answer to the request under way if it has its ID, or none.
    fn error(&mut self, now: BridgeTime, id: u32, status: Status<'_>, out: &mut Sink<'_>) {
        match self.phase {
            Phase::Asking { step, id: asked, .. } if id == asked || id == 0 => {
                self.rejected(now, step, &status, out);
            }
            Phase::Closing { .. } => {}
            _ => out(Output::Notice(Notice::Error(Rejection::new(MessageType::ERROR_MESSAGE, &status)))),
        }
    }

    fn rejected(&mut self, now: BridgeTime, step: Step, status: &Status<'_>, out: &mut Sink<'_>) {
        count(&mut self.counts.rejected);
        out(Output::Notice(Notice::Rejected(Rejection::new(step.request(), status))));
        if step == Step::Extensions {
            out(Output::Notice(Notice::NoExtensions));
        }
        match step.after_refusal() {
            Some(next) => self.ask(now, next, out),
            None => self.lose(now, Loss::Rejected(step.request()), out),
        }
    }

    fn granted(&mut self, now: BridgeTime, step: Step, body: &[u8], out: &mut Sink<'_>) {
        match step {
            Step::Extensions => self.impinj = true,
            Step::Capabilities => match Capabilities::decode(body) {
                Ok(capabilities) => self.capabilities(&capabilities, out),
                Err(error) => {
                    count(&mut self.counts.link.malformed);
                    return self.lose(now, Loss::Capabilities(error), out);
                }
            },
            _ => {}
        }
        match step.after_success() {
            Some(next) => self.ask(now, next, out),
            None => {
                self.phase = Phase::Reading { since: now, heard: now };
                self.set_state(ReaderState::Reading, out);
            }
        }
    }

    fn capabilities(&mut self, capabilities: &Capabilities, out: &mut Sink<'_>) {
        self.channel = capabilities.transmit_channel();
        match &capabilities.channels {
            Some(table) => out(Output::HopTable(table)),
            None => out(Output::Notice(Notice::NoChannels)),
        }
        if capabilities.channels_omitted > 0 {
            out(Output::Notice(Notice::ChannelsOmitted(capabilities.channels_omitted)));
        }
        let ports = capabilities.antennas;
        if self.config.antennas.iter().any(|antenna| antenna.0 > ports) {
            out(Output::Notice(Notice::MissingAntennas { ports }));
        }
    }

    fn events(&mut self, now: BridgeTime, notification: EventNotification<'_>, out: &mut Sink<'_>) {
        self.clock.observe(notification.time, now);
        for event in notification {
            match event {
                Ok(event) => self.event(now, event, out),
                Err(error) => self.malformed(MessageType::READER_EVENT_NOTIFICATION, error, out),
            }
            if !self.is_linked() {
                return;
            }
        }
    }

    fn event(&mut self, now: BridgeTime, event: Event<'_>, out: &mut Sink<'_>) {
        let greeting = matches!(self.phase, Phase::Greeting { .. });
        match event {
            Event::ConnectionAttempt(ConnectionAttempt::Success) if greeting => {
                self.set_state(ReaderState::Configuring, out);
                self.ask(now, Step::FIRST, out);
            }
            Event::ConnectionAttempt(refused) if greeting => self.lose(now, Loss::Refused(refused), out),
            Event::ConnectionAttempt(ConnectionAttempt::AnotherAttempted) => {
                out(Output::Notice(Notice::OtherClient));
            }
            Event::ConnectionClose => self.lose(now, Loss::ClosedByReader, out),
            Event::RoSpec { change: RoSpecChange::End | RoSpecChange::Preempted, rospec: ROSPEC_ID }
                if matches!(self.phase, Phase::Reading { .. }) =>
            {
                self.lose(now, Loss::RoSpecEnded, out);
            }
            Event::BufferLevel(percent) => out(Output::Notice(Notice::BufferLevel(percent))),
            Event::BufferOverflow => out(Output::Notice(Notice::BufferOverflow)),
            Event::Exception(words) => out(Output::Notice(Notice::Exception(text(words)))),
            Event::Antenna { port, connected } => {
                out(Output::Notice(Notice::Antenna { port, connected }));
            }
            Event::Other(_) => count(&mut self.counts.link.unknown),
            Event::ConnectionAttempt(_) | Event::RoSpec { .. } | Event::Hopping { .. } => {}
        }
    }

    fn reports(&mut self, now: BridgeTime, mut reports: TagReports<'_>, out: &mut Sink<'_>) {
        let ours =
            matches!(self.phase, Phase::Reading { .. } | Phase::Asking { step: Step::StartRoSpec, .. });
        for report in &mut reports {
            match report {
                Ok(mut report) => {
                    self.repeated.fill(&mut report);
                    let unknown = &mut self.counts.link.unknown;
                    *unknown = unknown.saturating_add(u32::from(report.unknown));
                    if ours {
                        self.read(now, &report, out);
                    } else {
                        count(&mut self.counts.foreign);
                    }
                }
                Err(error) => self.malformed(MessageType::RO_ACCESS_REPORT, error, out),
            }
        }
        let unknown = &mut self.counts.link.unknown;
        *unknown = unknown.saturating_add(u32::from(reports.others()));
    }

    fn read(&mut self, now: BridgeTime, report: &TagReport<'_>, out: &mut Sink<'_>) {
        let time = report.time().map_or(now, |time| self.clock.observe(time, now));
        // The only antenna need not be named.
        let only = match self.config.antennas.as_slice() {
            &[only] => only,
            _ => AntennaPort(0),
        };
        let Some(read) = report.to_read(time, only) else {
            return count(&mut self.counts.long_epcs);
        };
        if self.impinj && report.phase.is_none() {
            count(&mut self.counts.without_phase);
        }
        count(&mut self.counts.link.reads);
        out(Output::Read(read));
    }
}
