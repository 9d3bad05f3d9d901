//! A simulated reader behind a TCP port.

use std::cell::{Cell, RefCell};
use std::rc::Rc;

use embassy_futures::select::{Either3, select3};
use embassy_net::Stack;
use embassy_net::tcp::TcpSocket;
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::signal::Signal;
use embassy_time::{Duration, Instant, Timer};
use embedded_io_async::Write;
use rfhoi_shared::config::LLRP_PORT;

use super::clock;
use super::station::tcp_socket;
use crate::simulated::reader::SimulatedReader;

/// The reader's TCP gives a client up that has acknowledged nothing for so long.
const ABANDON: Duration = Duration::from_secs(3);

/// What is done to its connection.
enum Deed {
    Reset,
    Close,
    Say(Vec<u8>),
}

struct State {
    reader: RefCell<SimulatedReader>,
    deed: Signal<NoopRawMutex, Deed>,
    listens: Cell<bool>,
    opened: Signal<NoopRawMutex, ()>,
    connections: Cell<u32>,
}

/// The reader at the network; clones are the same one.
#[derive(Clone)]
pub struct NetworkReader(Rc<State>);

impl NetworkReader {
    pub(super) fn new(reader: SimulatedReader) -> Self {
        Self(Rc::new(State {
            reader: RefCell::new(reader),
            deed: Signal::new(),
            listens: Cell::new(true),
            opened: Signal::new(),
            connections: Cell::new(0),
        }))
    }

    /// The reader itself.
    pub fn with<R>(&self, f: impl FnOnce(&mut SimulatedReader) -> R) -> R {
        f(&mut self.0.reader.borrow_mut())
    }

    /// Connections that it took.
    pub fn connections(&self) -> u32 {
        self.0.connections.get()
    }

    /// Resets the connection and listens no more, as when its software restarts.
    pub fn go_down(&self) {
        self.0.listens.set(false);
        self.0.deed.signal(Deed::Reset);
    }

    /// Closes the connection in order and listens no more.
    pub fn shut_down(&self) {
        self.0.listens.set(false);
        self.0.deed.signal(Deed::Close);
    }

    /// Listens again.
    pub fn come_up(&self) {
        self.0.listens.set(true);
        self.0.opened.signal(());
    }

    /// Puts these bytes into its stream.
    pub fn say(&self, bytes: &[u8]) {
        self.0.deed.signal(Deed::Say(bytes.to_vec()));
    }

    /// Takes one client after the other.
    pub(super) async fn serve(self, stack: Stack<'static>) {
        let State { listens, opened, deed, connections, .. } = &*self.0;
        let mut socket = tcp_socket(stack);
        socket.set_timeout(Some(ABANDON));
        socket.set_nagle_enabled(false);
        loop {
            while !listens.get() {
                opened.wait().await;
            }
            deed.reset();
            if socket.accept(LLRP_PORT).await.is_ok() {
                connections.set(connections.get() + 1);
                self.converse(&mut socket).await;
                self.with(SimulatedReader::disconnect);
            }
            socket.abort();
            // Without this the reset is never sent.
            let _ = socket.flush().await;
        }
    }

    /// Speaks with a client until either side ends it, or the connection breaks.
    async fn converse(&self, socket: &mut TcpSocket<'static>) {
        let greeting = self.with(|reader| reader.accept(clock::now()));
        let mut saying = greeting;
        let mut buffer = [0; 1024];
        loop {
            if socket.write_all(&saying).await.is_err() {
                return;
            }
            saying.clear();
            if self.with(|reader| reader.is_closing()) {
                socket.close();
                let _ = socket.flush().await;
                return;
            }
            let next = self.with(|reader| reader.next_message());
            let next = next.map_or(Instant::MAX, |time| Instant::from_micros(time.0));
            match select3(socket.read(&mut buffer), Timer::at(next), self.0.deed.wait()).await {
                Either3::First(Ok(length @ 1..)) => {
                    saying = self.with(|reader| reader.receive(clock::now(), &buffer[..length]));
                }
                Either3::First(_) | Either3::Third(Deed::Reset) => return,
                Either3::Second(()) => {
                    saying = self.with(|reader| reader.message(clock::now())).unwrap_or_default();
                }
                Either3::Third(Deed::Close) => {
                    socket.close();
                    let _ = socket.flush().await;
                    return;
                }
                Either3::Third(Deed::Say(bytes)) => saying = bytes,
            }
        }
    }
}
