//! A DCA1000EVM on the network: it answers commands, and streams what the radar behind it samples.

use std::cell::{Cell, RefCell};
use std::rc::Rc;

use embassy_net::Stack;
use embassy_net::udp::UdpSocket;
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::signal::Signal;
use embassy_time::{Instant, Timer};
use rfhoi_firmware::dca1000::command::{Answer, Command};
use rfhoi_firmware::dca1000::{CONFIG_PORT, DATA_PORT};
use rfhoi_shared::config::Endpoint;
use rfhoi_shared::wire::MAX_PACKET;

use super::station::{remote, udp_socket};
use super::uart::ConsoleUart;
use crate::simulated::radar::Measurement;

struct State {
    commands: UdpSocket<'static>,
    data: UdpSocket<'static>,
    bridge: Endpoint,
    console: ConsoleUart,
    measurement: Measurement,
    taken: RefCell<Vec<Command>>,
    /// Number of the recording under way.
    recording: Cell<Option<usize>>,
    began: Signal<NoopRawMutex, ()>,
    muted: Cell<bool>,
    sent: Cell<usize>,
}

/// The recorder; clones are the same one.
#[derive(Clone)]
pub struct Recorder(Rc<State>);

impl Recorder {
    /// A recorder that streams to `bridge` what `measurement` says, from when the sensor behind `console` starts.
    pub(super) fn new(
        stack: Stack<'static>,
        bridge: [u8; 4],
        console: ConsoleUart,
        measurement: Measurement,
    ) -> Self {
        Self(Rc::new(State {
            commands: udp_socket(stack, CONFIG_PORT),
            data: udp_socket(stack, DATA_PORT),
            bridge: Endpoint { address: bridge, port: DATA_PORT },
            console,
            measurement,
            taken: RefCell::default(),
            recording: Cell::default(),
            began: Signal::new(),
            muted: Cell::default(),
            sent: Cell::default(),
        }))
    }

    /// Commands that it took.
    pub fn taken(&self) -> Vec<Command> {
        self.0.taken.borrow().clone()
    }

    /// Datagrams of samples that it sent.
    pub fn sent(&self) -> usize {
        self.0.sent.get()
    }

    /// The radar behind it sends nothing, or does again.
    pub fn set_muted(&self, muted: bool) {
        self.0.muted.set(muted);
    }

    /// Sends these bytes from its data port.
    ///
    /// # Panics
    /// If there is no way to the bridge.
    pub async fn send(&self, bytes: &[u8], to: Endpoint) {
        self.0.data.send_to(bytes, remote(to)).await.expect("there is a way to the bridge");
    }

    /// Its answers.
    pub(super) async fn answer(self) {
        let State { commands, taken, recording, began, .. } = &*self.0;
        let mut buffer = [0; MAX_PACKET];
        loop {
            let Ok((length, from)) = commands.recv_from(&mut buffer).await else { continue };
            let Ok(command) = Command::decode(&buffer[..length]) else { continue };
            taken.borrow_mut().push(command);
            match command {
                Command::RecordStart => {
                    recording.set(Some(taken.borrow().len()));
                    began.signal(());
                }
                Command::RecordStop => recording.set(None),
                _ => {}
            }
            let answer = Answer { code: command.code(), status: 0 };
            commands.send_to(&answer.encode(), from).await.expect("there is a way back");
        }
    }

    /// Its data.
    ///
    /// # Panics
    /// If there is no way to the bridge.
    pub(super) async fn stream(self) {
        let State { console, measurement, recording, began, muted, sent, bridge, .. } = &*self.0;
        loop {
            began.wait().await;
            let mine = recording.get();
            let start = console.started().await;
            let runs = || recording.get() == mine && console.with(|c| c.started()) == Some(start);
            for (time, datagram) in (Measurement { start, ..measurement.clone() }).datagrams() {
                Timer::at(Instant::from_micros(time.0)).await;
                if !runs() {
                    break;
                }
                if !muted.get() {
                    self.send(&datagram, *bridge).await;
                    sent.set(sent.get() + 1);
                }
            }
        }
    }
}
