//! The reader: LLRP over TCP.

use embassy_futures::select::{Either, Either3, Either5, select, select3, select5};
use embassy_net::Stack;
use embassy_net::tcp::TcpSocket;
use embassy_time::{Duration, Timer, with_timeout};
use heapless::Vec;
use rfhoi_firmware::bridge::{ReaderAction, ReaderInput, ReaderPath};
use rfhoi_firmware::uplink::Uplink;
use rfhoi_shared::config::Endpoint;

use crate::bridge::Bridge;
use crate::net::remote;
use crate::{BRIDGES, instant, now};

/// Bytes of a message, at most: twice the capabilities of a Speedway R420; longer ones are skipped and counted.
const MESSAGE: usize = 4096;
/// Bytes of requests that wait for the connection.
const OUT: usize = 2048;
/// How long the last bytes of a connection may take to leave.
const FAREWELL: Duration = Duration::from_millis(200);

/// What the path wants done.
#[derive(Default)]
struct Wanted {
    connect: Option<Endpoint>,
    close: bool,
    bytes: Vec<u8, OUT>,
}

impl Wanted {
    /// Takes away the first bytes, which were written.
    fn wrote(&mut self, written: usize) {
        let rest = self.bytes.get(written..).and_then(|rest| Vec::from_slice(rest).ok());
        self.bytes = rest.unwrap_or_default();
    }
}

struct Reader {
    path: ReaderPath<MESSAGE>,
    uplink: Uplink,
    wanted: Wanted,
    bridge: &'static Bridge,
}

impl Reader {
    fn handle(&mut self, input: ReaderInput<'_>) {
        let Self { path, uplink, wanted, bridge } = self;
        let send = |_, bytes: &[u8]| bridge.enqueue(None, bytes);
        path.handle(now(), input, uplink, send, |action| match action {
            ReaderAction::Connect(endpoint) => {
                wanted.connect = Some(endpoint);
                wanted.bytes.clear();
            }
            ReaderAction::Close => wanted.close = true,
            // A message is left out whole where there is no room.
            ReaderAction::Send(bytes) => drop(wanted.bytes.extend_from_slice(bytes)),
            ReaderAction::State(_) => {}
            ReaderAction::Notice(notice) => bridge.notice(notice),
        });
        bridge.reader.set(path.counts().link);
    }

    fn tell(&mut self) {
        let Self { path, uplink, bridge, .. } = self;
        path.tell(now(), uplink, |_, bytes| bridge.enqueue(None, bytes));
    }

    fn run(&mut self, on: bool) {
        self.handle(if on { ReaderInput::Start } else { ReaderInput::Stop });
    }
}

#[embassy_executor::task(pool_size = BRIDGES)]
pub(crate) async fn run(bridge: &'static Bridge, stack: Stack<'static>) {
    let Some(config) = bridge.config.reader.clone() else { return };
    let mut rx = [0; 4096];
    let mut tx = [0; OUT];
    let mut reader = Reader {
        path: ReaderPath::new(config, bridge.boot.into()),
        uplink: Uplink::new(bridge.boot),
        wanted: Wanted::default(),
        bridge,
    };
    loop {
        // One that follows a session's end at once was asked for during that.
        if let Some(endpoint) = reader.wanted.connect.take() {
            reader.wanted.close = false;
            let mut socket = TcpSocket::new(stack, &mut rx, &mut tx);
            socket.set_nagle_enabled(false);
            if connect(&mut reader, &mut socket, endpoint).await {
                converse(&mut reader, &mut socket).await;
            }
            continue;
        }
        let due = Timer::at(instant(reader.path.deadline()));
        match select(bridge.reader_runs.wait(), due).await {
            Either::First(on) => reader.run(on),
            Either::Second(()) => reader.handle(ReaderInput::Tick),
        }
    }
}

/// Opens the connection; false if it could not be opened or is no longer wanted.
async fn connect(reader: &mut Reader, socket: &mut TcpSocket<'_>, endpoint: Endpoint) -> bool {
    let bridge = reader.bridge;
    let mut opening = core::pin::pin!(socket.connect(remote(endpoint)));
    loop {
        let due = Timer::at(instant(reader.path.deadline()));
        match select3(&mut opening, bridge.reader_runs.wait(), due).await {
            Either3::First(Ok(())) => {
                reader.handle(ReaderInput::Connected);
                return true;
            }
            Either3::First(Err(_)) => {
                reader.handle(ReaderInput::ConnectFailed);
                return false;
            }
            Either3::Second(on) => reader.run(on),
            Either3::Third(()) => reader.handle(ReaderInput::Tick),
        }
        if reader.wanted.close {
            return false;
        }
    }
}

/// Speaks on the open connection until either side closes it.
async fn converse(reader: &mut Reader, socket: &mut TcpSocket<'_>) {
    let bridge = reader.bridge;
    while !reader.wanted.close {
        let due = Timer::at(instant(reader.path.deadline()));
        let waiting = !reader.wanted.bytes.is_empty();
        let (mut incoming, mut outgoing) = socket.split();
        let write =
            async { if waiting { outgoing.wait_write_ready().await } else { core::future::pending().await } };
        // Waits for bytes or the connection's end, where waiting for bytes alone would not notice the end.
        let read = incoming.read_with(|bytes| {
            reader.handle(ReaderInput::Received(bytes));
            (bytes.len(), ())
        });
        match select5(read, write, bridge.reader_runs.wait(), due, bridge.reader_tells.wait()).await {
            Either5::First(Ok(())) => {}
            Either5::First(Err(_)) => {
                reader.handle(ReaderInput::Closed);
                break;
            }
            Either5::Second(()) => match outgoing.write(&reader.wanted.bytes).await {
                Ok(written) => reader.wanted.wrote(written),
                Err(_) => {
                    reader.handle(ReaderInput::Closed);
                    break;
                }
            },
            Either5::Third(on) => reader.run(on),
            Either5::Fourth(()) => reader.handle(ReaderInput::Tick),
            Either5::Fifth(()) => reader.tell(),
        }
    }
    // A goodbye that does not leave in time is not waited for.
    let goodbye = async {
        while !reader.wanted.bytes.is_empty()
            && let Ok(written) = socket.write(&reader.wanted.bytes).await
        {
            reader.wanted.wrote(written);
        }
        socket.close();
        socket.flush().await
    };
    if with_timeout(FAREWELL, goodbye).await.is_err() {
        // The reader learns it from the reset, which leaves with the flush.
        socket.abort();
        let _ = with_timeout(FAREWELL, socket.flush()).await;
    }
}
