//! Commands to a bridge over a socket. In: requests. Out: answers, or a sentence that says what to check.

use std::hash::{BuildHasher, RandomState};
use std::io::{self, ErrorKind};
use std::net::{Ipv4Addr, SocketAddr, SocketAddrV4, UdpSocket};
use std::time::{Duration, Instant};

use rfhoi_shared::config::{Address, BridgeConfig};
use rfhoi_shared::wire::{Hello, MAX_PACKET, Message, Refusal, Request};

use super::BridgeError;
use super::conversation::{Answer, Conversation, Failure, Outcome, Step};
use super::discovery;

/// Longest wait for a datagram before Ctrl-C is looked for.
const TICK: Duration = Duration::from_millis(100);
/// How long a bridge may take to come back after a restart: erasing and writing its configuration, starting, and an
/// How long radar and reader may take to stop: command line, recorder and reader each wait for an answer.
const STOPPING: Duration = Duration::from_secs(8);
/// address by DHCP.
const COMEBACK: Duration = Duration::from_secs(20);
/// From one search for a restarted bridge to the next.
const SEARCH: Duration = Duration::from_millis(1000);

/// A UDP socket that may broadcast.
#[derive(Debug)]
pub struct Socket {
    udp: UdpSocket,
    buffer: Vec<u8>,
}

impl Socket {
    /// A socket on `port` of this computer, 0 for any that is free.
    ///
    /// # Errors
    /// [`BridgeError::Socket`].
    pub fn open(port: u16) -> Result<Self, BridgeError> {
        let open = || {
            let udp = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, port))?;
            udp.set_broadcast(true)?;
            Ok(udp)
        };
        let udp = open().map_err(|source| BridgeError::Socket { port, source })?;
        // A longer datagram is no packet, and shows by filling the buffer.
        Ok(Self { udp, buffer: vec![0; MAX_PACKET + 1] })
    }

    /// A number that differs from run to run.
    pub(super) fn seed(&self) -> u16 {
        RandomState::new().hash_one(self.udp.local_addr().map_or(0, |a| a.port())) as u16
    }

    /// Sends one datagram.
    ///
    /// # Errors
    /// [`BridgeError::Send`].
    pub(super) fn send(&mut self, peer: SocketAddrV4, bytes: &[u8]) -> Result<(), BridgeError> {
        match self.udp.send_to(bytes, peer) {
            Err(source) if !is_transient(&source) => Err(BridgeError::Send { peer, source }),
            _ => Ok(()),
        }
    }

    /// The next datagram with its sender, or `None` if none came by `until` or within a tick.
    ///
    /// # Errors
    /// [`BridgeError::Receive`].
    pub(super) fn receive(&mut self, until: Instant) -> Result<Option<(SocketAddrV4, &[u8])>, BridgeError> {
        // A time-out of zero would wait for ever.
        const SHORTEST: Duration = Duration::from_millis(1);
        let wait = until.saturating_duration_since(Instant::now()).clamp(SHORTEST, TICK);
        self.udp.set_read_timeout(Some(wait)).map_err(BridgeError::Receive)?;
        match self.udp.recv_from(&mut self.buffer) {
            Ok((bytes, SocketAddr::V4(source))) => Ok(Some((source, &self.buffer[..bytes]))),
            Ok(_) => Ok(None),
            Err(error) if is_transient(&error) => Ok(None),
            Err(error) => Err(BridgeError::Receive(error)),
        }
    }
}

/// Whether the next call may go well: nothing there, a signal, or an earlier datagram that met a closed port.
fn is_transient(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        ErrorKind::WouldBlock
            | ErrorKind::TimedOut
            | ErrorKind::Interrupted
            | ErrorKind::ConnectionReset
            | ErrorKind::ConnectionRefused
    )
}

/// The host's side of one bridge.
#[derive(Debug)]
pub struct Client {
    socket: Socket,
    peer: SocketAddrV4,
    conversation: Conversation,
    notices: Vec<String>,
}

impl Client {
    /// Speaks with the bridge at `peer` over `socket`. Nothing is sent yet.
    pub fn new(socket: Socket, peer: SocketAddrV4) -> Self {
        let conversation = Conversation::new(SocketAddr::V4(peer), socket.seed(), Instant::now());
        Self { socket, peer, conversation, notices: Vec::new() }
    }

    /// The bridge.
    pub fn peer(&self) -> SocketAddrV4 {
        self.peer
    }

    /// Port of this computer, 0 if the system does not say.
    pub fn local_port(&self) -> u16 {
        self.socket.udp.local_addr().map_or(0, |a| a.port())
    }

    /// Address of this computer from which the bridge is reached.
    pub fn local_ip(&self) -> Option<Ipv4Addr> {
        // Nothing is sent: connecting a UDP socket only looks for the way.
        let probe = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, 0)).ok()?;
        probe.connect(self.peer).ok()?;
        match probe.local_addr().ok()? {
            SocketAddr::V4(address) => Some(*address.ip()),
            SocketAddr::V6(_) => None,
        }
    }

    /// Takes what the bridge wanted a person to know while it was asked something else.
    pub fn take_notices(&mut self) -> Vec<String> {
        std::mem::take(&mut self.notices)
    }

    /// Asks until there is an answer.
    ///
    /// # Errors
    /// If there is none, the answer is a refusal, or `go_on` says to stop.
    pub fn ask(
        &mut self,
        request: Request,
        go_on: &mut dyn FnMut(f64) -> bool,
    ) -> Result<Answer, BridgeError> {
        let peer = self.peer;
        self.conversation.ask(request, Instant::now());
        loop {
            match self.conversation.step(Instant::now()) {
                Step::Send(bytes) => self.socket.send(peer, &bytes)?,
                Step::Wait(until) => {
                    if !go_on(0.0) {
                        return Err(BridgeError::Interrupted);
                    }
                    let Some((source, bytes)) = self.socket.receive(until)? else { continue };
                    let packet = self.conversation.take(SocketAddr::V4(source), bytes);
                    if let Some(Message::Notice(notice)) = packet.map(|p| p.message) {
                        self.notices.push(notice.text.as_str().to_owned());
                    }
                }
                Step::Answered(Answer { outcome: Outcome::Refused(refusal), .. }) => {
                    return Err(BridgeError::Refused { peer, refusal });
                }
                Step::Answered(answer) => return Ok(answer),
                Step::Failed(Failure::Unanswered) => return Err(BridgeError::Unanswered { peer }),
                Step::Failed(Failure::Version(error)) => return Err(BridgeError::Version { peer, error }),
            }
        }
    }

    /// Who the bridge is; from now on it sends here.
    ///
    /// # Errors
    /// As [`Self::ask`].
    pub fn hello(&mut self, go_on: &mut dyn FnMut(f64) -> bool) -> Result<Hello, BridgeError> {
        self.who(Request::Hello, go_on)
    }

    /// Who the bridge is; it sends where it did before.
    ///
    /// # Errors
    /// As [`Self::ask`].
    pub fn identify(&mut self, go_on: &mut dyn FnMut(f64) -> bool) -> Result<Hello, BridgeError> {
        self.who(Request::Identify, go_on)
    }

    fn who(&mut self, request: Request, go_on: &mut dyn FnMut(f64) -> bool) -> Result<Hello, BridgeError> {
        let answer = self.ask(request, go_on)?;
        // The conversation answers with a hello or not at all.
        answer.hello.ok_or(BridgeError::Unanswered { peer: self.peer })
    }

    /// The configuration in force.
    ///
    /// # Errors
    /// As [`Self::ask`].
    pub fn config(&mut self, go_on: &mut dyn FnMut(f64) -> bool) -> Result<BridgeConfig, BridgeError> {
        let answer = self.ask(Request::GetConfig, go_on)?;
        answer.config.ok_or(BridgeError::Unanswered { peer: self.peer })
    }

    /// Says hello without waiting for the answer, so that the bridge sends here.
    ///
    /// # Errors
    /// [`BridgeError::Send`].
    pub fn greet(&mut self) -> Result<(), BridgeError> {
        let bytes = self.conversation.datagram(Request::Hello, Instant::now());
        self.socket.send(self.peer, &bytes)
    }

    /// The bytes of the bridge's next packet, or `None` if none came by `until` or within a tenth of a second.
    ///
    /// # Errors
    /// [`BridgeError::Receive`].
    pub fn receive(&mut self, until: Instant) -> Result<Option<&[u8]>, BridgeError> {
        let Some((source, bytes)) = self.socket.receive(until)? else { return Ok(None) };
        Ok(self.conversation.take(SocketAddr::V4(source), bytes).is_some().then_some(bytes))
    }

    /// Restarts the bridge and waits until it is back.
    ///
    /// # Errors
    /// As [`Self::ask`], or [`BridgeError::NotBack`].
    pub fn restart(&mut self, go_on: &mut dyn FnMut(f64) -> bool) -> Result<Hello, BridgeError> {
        let before = self.identify(go_on)?;
        let boot = self.conversation.boot();
        let answer = self.ask(Request::Restart, go_on)?;
        self.wait_until_back(&before, boot.unwrap_or(answer.boot), &[], go_on)
    }

    /// Stops radar and reader, sends `config`, waits until the bridge is back with it, wherever it is then. `hello` is
    /// who it was before.
    ///
    /// # Errors
    /// As [`Self::ask`], [`BridgeError::NotBack`] or [`BridgeError::NotInForce`].
    pub fn configure(
        &mut self,
        config: &BridgeConfig,
        hello: &Hello,
        go_on: &mut dyn FnMut(f64) -> bool,
    ) -> Result<Hello, BridgeError> {
        let answer = self.ask(Request::Stop, go_on)?;
        let began = Instant::now();
        loop {
            match self.ask(Request::Configure(config.clone()), go_on) {
                Ok(_) => break,
                // Radar and reader take their time to stop.
                Err(BridgeError::Refused { refusal: Refusal::Busy, .. }) if began.elapsed() < STOPPING => {
                    std::thread::sleep(TICK);
                    if !go_on(0.0) {
                        return Err(BridgeError::Interrupted);
                    }
                }
                Err(error) => return Err(error),
            }
        }
        let elsewhere = match config.address {
            Address::Static { address, .. } if Ipv4Addr::from(address) == *self.peer.ip() => vec![],
            Address::Static { address, .. } => {
                vec![SocketAddrV4::new(address.into(), self.peer.port())]
            }
            Address::Dhcp => discovery::broadcasts(),
        };
        let back = self.wait_until_back(hello, answer.boot, &elsewhere, go_on)?;
        if in_force(&self.config(go_on)?, config) {
            Ok(back)
        } else {
            Err(BridgeError::NotInForce { peer: self.peer })
        }
    }

    /// Searches at the old address and `elsewhere` until the bridge answers with another boot number.
    fn wait_until_back(
        &mut self,
        known: &Hello,
        boot: u16,
        elsewhere: &[SocketAddrV4],
        go_on: &mut dyn FnMut(f64) -> bool,
    ) -> Result<Hello, BridgeError> {
        let began = Instant::now();
        let targets = [&[self.peer], elsewhere].concat();
        while began.elapsed() < COMEBACK {
            let mut back = None;
            let mut found = |f: discovery::Found| {
                let hello = f.hello.ok().filter(|h| h.id == known.id && f.boot != boot);
                back = hello.map(|h| (f.address, h));
                back.is_none()
            };
            let share = began.elapsed().as_secs_f64() / COMEBACK.as_secs_f64();
            match discovery::discover(&mut self.socket, &targets, SEARCH, &mut found, &mut |_| go_on(share)) {
                // While its link is down there may be no way to it.
                Err(BridgeError::Send { .. }) => std::thread::sleep(TICK),
                other => other?,
            }
            if let Some((address, hello)) = back {
                if address != self.peer {
                    self.peer = address;
                    self.conversation =
                        Conversation::new(SocketAddr::V4(address), self.socket.seed(), Instant::now());
                }
                return Ok(hello);
            }
        }
        Err(BridgeError::NotBack { seconds: COMEBACK.as_secs(), elsewhere: !elsewhere.is_empty() })
    }
}

/// Whether `reported` is `wanted`. A bridge without a host of its own may report the one that said hello.
pub fn in_force(reported: &BridgeConfig, wanted: &BridgeConfig) -> bool {
    let host = wanted.host.or(reported.host);
    *reported == BridgeConfig { host, ..wanted.clone() }
}
