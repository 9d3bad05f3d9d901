//! One host's conversation with one bridge. In: requests, datagrams, the time. Out: datagrams, and each request's answer.
//!
//! UDP loses and doubles. A request is therefore sent again with the same number until it is answered, at most
//! [`attempts`] times; the bridge answers a repeated number again without doing it twice. Only a bridge that restarted
//! has forgotten the number: where the restart is what was asked for, it is the answer.

use std::net::SocketAddr;
use std::time::{Duration, Instant};

use rfhoi_shared::config::BridgeConfig;
use rfhoi_shared::units::BridgeTime;
use rfhoi_shared::wire::{
    Ack, Command, Hello, MAX_PACKET, Message, Packet, Refusal, Request, Sequencer, WireError,
};

/// From one sending of a request to the next.
pub const RESEND_AFTER: Duration = Duration::from_millis(400);

/// How often `request` is sent at most.
pub fn attempts(request: &Request) -> u32 {
    match request {
        // Erasing a sector of flash stops some MCUs for seconds.
        Request::Configure(_) => 20,
        _ => 6,
    }
}

/// What a request led to.
#[derive(Debug, Clone, PartialEq)]
pub struct Answer {
    /// What became of it.
    pub outcome: Outcome,
    /// Boot number of the bridge that answered.
    pub boot: u16,
    /// Who the bridge is, in answer to [`Request::Hello`] or [`Request::Identify`].
    pub hello: Option<Hello>,
    /// The configuration in force, in answer to [`Request::GetConfig`].
    pub config: Option<BridgeConfig>,
}

/// What became of a request.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Outcome {
    /// Done.
    Done,
    /// Not done.
    Refused(Refusal),
    /// To [`Request::Configure`] and [`Request::Restart`]: the bridge has restarted, its acknowledgement was lost.
    Restarted,
}

/// Why a request has no answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Failure {
    /// All attempts were in vain.
    Unanswered,
    /// The bridge speaks another version of the wire.
    Version(WireError),
}

/// What to do next.
#[derive(Debug, Clone, PartialEq)]
#[allow(clippy::large_enum_variant, reason = "an answer is handed on at once")]
pub enum Step {
    /// Send these bytes to the bridge, then ask again.
    Send(Vec<u8>),
    /// Wait for a datagram until then.
    Wait(Instant),
    /// The request is answered.
    Answered(Answer),
    /// The request failed.
    Failed(Failure),
}

#[derive(Debug)]
struct Pending {
    id: u16,
    request: Request,
    attempts_left: u32,
    resend_at: Instant,
    /// Boot number of the bridge before the request.
    boot_before: Option<u16>,
    outcome: Option<(Outcome, u16)>,
    hello: Option<Hello>,
    config: Option<BridgeConfig>,
    failure: Option<Failure>,
}

impl Pending {
    /// Whether all parts of the answer are there.
    fn is_answered(&self) -> bool {
        match (self.outcome, &self.request) {
            (None, _) => false,
            (Some((Outcome::Done, _)), Request::Hello | Request::Identify) => self.hello.is_some(),
            (Some((Outcome::Done, _)), Request::GetConfig) => self.config.is_some(),
            (Some(_), _) => true,
        }
    }

    fn take(&mut self, boot: u16, message: &Message<'_>) {
        let restarts = matches!(self.request, Request::Configure(_) | Request::Restart);
        if restarts && self.boot_before.is_some_and(|before| before != boot) {
            self.outcome = Some((Outcome::Restarted, boot));
            return;
        }
        match message {
            Message::Ack(Ack { id, outcome, .. }) if *id == self.id => {
                let outcome = outcome.map_or_else(Outcome::Refused, |()| Outcome::Done);
                self.outcome = Some((outcome, boot));
            }
            Message::Hello(hello) => self.hello = Some(hello.clone()),
            Message::Config(config) => self.config = Some(config.clone()),
            _ => {}
        }
    }
}

/// A conversation with one bridge, one request at a time.
#[derive(Debug)]
pub struct Conversation {
    peer: SocketAddr,
    sequencer: Sequencer,
    began: Instant,
    next_id: u16,
    boot: Option<u16>,
    pending: Option<Pending>,
}

impl Conversation {
    /// A conversation with the bridge at `peer`. `seed` should differ from one run of the host to the next: requests are
    /// numbered from there, and a bridge takes the number of its last request for a repetition.
    pub fn new(peer: SocketAddr, seed: u16, now: Instant) -> Self {
        Self { peer, sequencer: Sequencer::new(seed), began: now, next_id: seed, boot: None, pending: None }
    }

    /// The bridge.
    pub fn peer(&self) -> SocketAddr {
        self.peer
    }

    /// Boot number of the bridge, once a packet came.
    pub fn boot(&self) -> Option<u16> {
        self.boot
    }

    /// Begins a request, and forgets one that is under way.
    pub fn ask(&mut self, request: Request, now: Instant) {
        self.pending = Some(Pending {
            id: self.take_id(),
            attempts_left: attempts(&request),
            request,
            resend_at: now,
            boot_before: self.boot,
            outcome: None,
            hello: None,
            config: None,
            failure: None,
        });
    }

    /// The bytes of a request that is sent once and not waited for.
    pub fn datagram(&mut self, request: Request, now: Instant) -> Vec<u8> {
        let id = self.take_id();
        self.encode(Command { id, request }, now)
    }

    /// What to do about the request under way.
    pub fn step(&mut self, now: Instant) -> Step {
        let Some(pending) = &mut self.pending else {
            return Step::Wait(now + RESEND_AFTER);
        };
        if let Some(failure) = pending.failure {
            self.pending = None;
            return Step::Failed(failure);
        }
        if let (true, Some((outcome, boot))) = (pending.is_answered(), pending.outcome) {
            let (hello, config) = (pending.hello.take(), pending.config.take());
            self.pending = None;
            return Step::Answered(Answer { outcome, boot, hello, config });
        }
        if now < pending.resend_at {
            return Step::Wait(pending.resend_at);
        }
        if pending.attempts_left == 0 {
            self.pending = None;
            return Step::Failed(Failure::Unanswered);
        }
        pending.attempts_left -= 1;
        pending.resend_at = now + RESEND_AFTER;
        let command = Command { id: pending.id, request: pending.request.clone() };
        Step::Send(self.encode(command, now))
    }

    /// Takes a datagram from `source`. Returns its packet if it is this bridge's.
    pub fn take<'b>(&mut self, source: SocketAddr, bytes: &'b [u8]) -> Option<Packet<'b>> {
        if source != self.peer {
            return None;
        }
        match Packet::decode(bytes) {
            Ok(packet) => {
                if let Some(pending) = &mut self.pending {
                    pending.take(packet.header.boot, &packet.message);
                }
                self.boot = Some(packet.header.boot);
                Some(packet)
            }
            Err(error @ WireError::Version { .. }) => {
                if let Some(pending) = &mut self.pending {
                    pending.failure = Some(Failure::Version(error));
                }
                None
            }
            Err(_) => None,
        }
    }

    fn take_id(&mut self) -> u16 {
        let id = self.next_id;
        self.next_id = id.wrapping_add(1);
        id
    }

    fn encode(&mut self, command: Command, now: Instant) -> Vec<u8> {
        let time = BridgeTime(u64::try_from((now - self.began).as_micros()).unwrap_or(u64::MAX));
        let mut buffer = [0; MAX_PACKET];
        let packet = self.sequencer.wrap(time, Message::Command(command));
        // The largest command is an eighth of a packet (the table of the wire contract).
        packet.encode(&mut buffer).map(<[u8]>::to_vec).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests;
