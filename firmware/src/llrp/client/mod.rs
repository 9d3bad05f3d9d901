//! The LLRP client: a state machine that takes TCP events, bytes and the time, and gives bytes, reads and notices.
//!
//! ```text
//! start -> Connect ... connected -> wait for the reader's ConnectionAttemptEvent
//!   IMPINJ_ENABLE_EXTENSIONS    refused: go on without phase
//!   GET_READER_CAPABILITIES     hop table out
//!   SET_READER_CONFIG           events, keepalive, no holding; Impinj: link monitor, low latency
//!   DELETE_ACCESSSPEC 0, DELETE_ROSPEC 0     refused: go on, there may be none
//!   ADD_ROSPEC, ENABLE_ROSPEC, ENABLE_EVENTS_AND_REPORTS, START_ROSPEC
//! -> reads out, KEEPALIVEs answered
//! ```
//!
//! One request is under way at a time and each has a time limit. A refusal is told with the reader's code and what was
//! asked; other than in the cases above, the link is then given up: a reader that ignored a setting would otherwise send
//! reads that look right.
//! `ENABLE_EVENTS_AND_REPORTS` comes before the start so that what the reader held for an earlier client arrives
//! first, where it is recognised and dropped. Whatever ends a link, the client closes it, waits and tries again, until
//! [`Client::stop`], which ends the reader's session in order so that it does not block the next client.

mod backoff;
mod outcome;
mod session;
mod step;

use rfhoi_shared::config::ReaderConfig;
use rfhoi_shared::units::BridgeTime;
use rfhoi_shared::wire::ReaderState;

pub use outcome::{Counts, Loss, Notice, Output, Rejection, Text};

use super::frame::Framer;
use session::Session;

/// Default of [`Client`]'s longest message, bytes. A Speedway R420's capabilities take 1658.
pub const MAX_MESSAGE_BYTES: usize = 8192;

/// Where outputs go, in order, during a call.
pub type Sink<'s> = dyn FnMut(Output<'_>) + 's;

/// LLRP client for one reader; holds messages of at most `N` bytes.
///
/// Times given to it must not go back. After each call, [`Self::deadline`] says when [`Self::tick`] is next due.
#[derive(Debug)]
pub struct Client<const N: usize = MAX_MESSAGE_BYTES> {
    framer: Framer<N>,
    session: Session,
}

impl<const N: usize> Client<N> {
    /// A client that is stopped. `seed` should differ between bridges: it spreads their reconnects.
    pub fn new(config: ReaderConfig, seed: u64) -> Self {
        Self { framer: Framer::new(), session: Session::new(config, seed) }
    }

    /// Begins to connect, if stopped; at once, or when a [`Self::stop`] under way is done.
    pub fn start(&mut self, now: BridgeTime, out: &mut Sink<'_>) {
        self.session.start(now, out);
    }

    /// The TCP connection asked for is open.
    pub fn connected(&mut self, now: BridgeTime, out: &mut Sink<'_>) {
        self.framer.reset();
        self.session.connected(now, out);
    }

    /// The TCP connection asked for could not be opened.
    pub fn connect_failed(&mut self, now: BridgeTime, out: &mut Sink<'_>) {
        self.session.connect_failed(now, out);
    }

    /// The TCP connection was closed by the other side, or broke.
    pub fn closed(&mut self, now: BridgeTime, out: &mut Sink<'_>) {
        self.session.closed(now, out);
    }

    /// Takes bytes of the TCP connection. Those that come after the client closed it are ignored.
    pub fn received(&mut self, now: BridgeTime, mut bytes: &[u8], out: &mut Sink<'_>) {
        while self.session.is_linked() {
            match self.framer.next(&mut bytes) {
                Ok(Some(message)) => self.session.message(now, &message, out),
                Ok(None) => return,
                Err(error) => self.session.lose(now, Loss::Framing(error), out),
            }
        }
    }

    /// Does what is due at `now`.
    pub fn tick(&mut self, now: BridgeTime, out: &mut Sink<'_>) {
        self.session.tick(now, out);
    }

    /// When [`Self::tick`] is next due, or `None` when stopped.
    pub fn deadline(&self) -> Option<BridgeTime> {
        self.session.deadline()
    }

    /// Ends the session in order: stops and deletes the ROSpec, says goodbye, and closes once the reader has answered
    /// or a second has passed.
    pub fn stop(&mut self, now: BridgeTime, out: &mut Sink<'_>) {
        self.session.stop(now, out);
    }

    /// State of the link; [`ReaderState::None`] when stopped.
    pub fn state(&self) -> ReaderState {
        self.session.counts().link.state
    }

    /// Counts since the client was made.
    pub fn counts(&self) -> Counts {
        Counts { oversized: self.framer.oversized(), ..self.session.counts() }
    }
}
