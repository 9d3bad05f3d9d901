//! A host on the network: it sends commands, and keeps what comes.

use std::cell::{Cell, Ref, RefCell};
use std::rc::Rc;

use embassy_net::udp::UdpSocket;
use embassy_time::{Duration, Instant, Timer};
use rfhoi::receive::Received;
use rfhoi_shared::config::Endpoint;
use rfhoi_shared::wire::{Ack, Command, MAX_PACKET, Message, Notice, Refusal, Request, Sequencer, Telemetry};

use super::clock;
use super::station::remote;
use super::switch::Arrival;
use crate::simulated::world::Host;

/// How long an answer is waited for.
const PATIENCE: Duration = Duration::from_millis(500);
/// Times that a request is sent before the bridge counts as absent.
const TRIES: usize = 8;
/// How often it looks for an answer.
const LOOK: Duration = Duration::from_micros(500);

struct State {
    socket: UdpSocket<'static>,
    bridge: Endpoint,
    host: RefCell<Host>,
    packets: RefCell<Vec<Arrival>>,
    sequencer: RefCell<Sequencer>,
    last_id: Cell<u16>,
}

/// A host's program with its port; clones are the same one.
#[derive(Clone)]
pub struct NetworkHost(Rc<State>);

impl NetworkHost {
    pub(super) fn new(socket: UdpSocket<'static>, bridge: Endpoint) -> Self {
        Self(Rc::new(State {
            socket,
            bridge,
            host: RefCell::default(),
            packets: RefCell::default(),
            sequencer: RefCell::new(Sequencer::new(0)),
            last_id: Cell::default(),
        }))
    }

    /// Takes what comes.
    pub(super) async fn receive(self) {
        let mut buffer = [0; MAX_PACKET];
        loop {
            let Ok((length, _)) = self.0.socket.recv_from(&mut buffer).await else { continue };
            let bytes = &buffer[..length];
            self.0.host.borrow_mut().take(bytes);
            self.0.packets.borrow_mut().push((clock::now(), bytes.to_vec()));
        }
    }

    /// Sends a request with a new number and waits for its outcome; `None` if none comes.
    pub async fn ask(&self, request: Request) -> Option<Result<(), Refusal>> {
        let id = self.0.last_id.get() + 1;
        self.0.last_id.set(id);
        self.ask_as(id, request).await.map(|ack| ack.outcome)
    }

    /// The same, again and again where no answer comes: after a restart the bridge's IP stack asks for one address a second,
    /// be it the reader's, the recorder's or this host's.
    pub async fn insist(&self, request: Request) -> Option<Result<(), Refusal>> {
        let id = self.0.last_id.get() + 1;
        self.0.last_id.set(id);
        for _ in 0..TRIES {
            if let Some(ack) = self.ask_as(id, request.clone()).await {
                return Some(ack.outcome);
            }
        }
        None
    }

    /// Sends a request under this number and waits for the answer that comes after it.
    pub async fn ask_as(&self, id: u16, request: Request) -> Option<Ack> {
        let before = self.received().len();
        self.send_command(id, request).await;
        let end = Instant::now() + PATIENCE;
        while Instant::now() < end {
            Timer::after(LOOK).await;
            let received = self.received();
            let acks = received[before..].iter();
            let mut acks = acks.filter_map(|r| if let Received::Ack(a) = r { Some(*a) } else { None });
            if let Some(ack) = acks.find(|ack| ack.id == id) {
                return Some(ack);
            }
        }
        None
    }

    async fn send_command(&self, id: u16, request: Request) {
        let message = Message::Command(Command { id, request });
        let packet = self.0.sequencer.borrow_mut().wrap(clock::now(), message);
        let mut buffer = [0; MAX_PACKET];
        let bytes = packet.encode(&mut buffer).expect("a command fits");
        self.send(bytes, self.0.bridge.port).await;
    }

    /// Sends these bytes to a port of the bridge.
    ///
    /// # Panics
    /// If there is no way to it.
    pub async fn send(&self, bytes: &[u8], port: u16) {
        let to = Endpoint { port, ..self.0.bridge };
        self.0.socket.send_to(bytes, remote(to)).await.expect("there is a way to the bridge");
    }

    /// All that came, and the counts of what did not.
    pub fn host(&self) -> Ref<'_, Host> {
        self.0.host.borrow()
    }

    /// What came of the packets, in order.
    pub fn received(&self) -> Ref<'_, [Received]> {
        Ref::map(self.host(), |host| host.received.as_slice())
    }

    /// The packets with the times of their arrival.
    pub fn packets(&self) -> Ref<'_, [Arrival]> {
        Ref::map(self.0.packets.borrow(), Vec::as_slice)
    }

    /// The last telemetry.
    ///
    /// # Panics
    /// If none came.
    pub fn telemetry(&self) -> Telemetry {
        *self.host().telemetry().last().expect("telemetry came")
    }

    /// What people were told.
    pub fn notices(&self) -> Vec<String> {
        let text = |r: &Received| {
            if let Received::Notice(Notice { text }) = r { Some(text.to_string()) } else { None }
        };
        self.received().iter().filter_map(text).collect()
    }
}
