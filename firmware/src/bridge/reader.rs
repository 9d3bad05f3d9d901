//! The reader's connection to packets.

use rfhoi_shared::config::{Endpoint, ReaderConfig};
use rfhoi_shared::units::BridgeTime;
use rfhoi_shared::wire::{HopTable, Message, ReaderState, Stream};

use crate::llrp::client::{Client, Counts, Notice, Output};
use crate::uplink::{ReadPacker, Uplink};

/// What the reader's path wants done on the network, or has to say.
#[derive(Debug, Clone, PartialEq)]
pub enum ReaderAction<'a> {
    /// Open a TCP connection.
    Connect(Endpoint),
    /// Close it.
    Close,
    /// Send these bytes on it.
    Send(&'a [u8]),
    /// The state of the link changed.
    State(ReaderState),
    /// Something that a person may want to know.
    Notice(Notice),
}

/// What happened to the TCP connection, or on it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ReaderInput<'a> {
    /// Begin to connect, if stopped.
    Start,
    /// The connection asked for is open.
    Connected,
    /// It could not be opened.
    ConnectFailed,
    /// The other side closed it.
    Closed,
    /// Bytes arrived.
    Received(&'a [u8]),
    /// Time has passed.
    Tick,
    /// End the session in order.
    Stop,
}

/// LLRP client and packets of its reads. `N` bounds the bytes of a message.
#[derive(Debug)]
pub struct ReaderPath<const N: usize> {
    client: Client<N>,
    reads: ReadPacker,
    channels: Option<HopTable>,
}

impl<const N: usize> ReaderPath<N> {
    /// A path that is stopped. `seed` should differ between bridges.
    pub fn new(config: ReaderConfig, seed: u64) -> Self {
        Self { client: Client::new(config, seed), reads: ReadPacker::default(), channels: None }
    }

    /// Takes what happened at `now`; sends packets of reads, and says what is to be done.
    pub fn handle(
        &mut self,
        now: BridgeTime,
        input: ReaderInput<'_>,
        uplink: &mut Uplink,
        mut send: impl FnMut(Stream, &[u8]) -> bool,
        mut act: impl FnMut(ReaderAction<'_>),
    ) {
        let Self { client, reads, channels } = self;
        reads.tick(now, |m| uplink.send(now, m, &mut send));
        let out = &mut |output: Output<'_>| match output {
            Output::Connect(endpoint) => act(ReaderAction::Connect(endpoint)),
            Output::Close => act(ReaderAction::Close),
            Output::Send(bytes) => act(ReaderAction::Send(bytes)),
            Output::State(state) => act(ReaderAction::State(state)),
            Output::Notice(notice) => act(ReaderAction::Notice(notice)),
            Output::Read(read) => reads.push(now, read, |m| uplink.send(now, m, &mut send)),
            Output::HopTable(table) => {
                *channels = Some(table.clone());
                uplink.send(now, Message::HopTable(table.clone()), &mut send);
            }
        };
        match input {
            ReaderInput::Start => client.start(now, out),
            ReaderInput::Connected => client.connected(now, out),
            ReaderInput::ConnectFailed => client.connect_failed(now, out),
            ReaderInput::Closed => client.closed(now, out),
            ReaderInput::Received(bytes) => client.received(now, bytes, out),
            ReaderInput::Tick => client.tick(now, out),
            ReaderInput::Stop => client.stop(now, out),
        }
    }

    /// Sends the reader's channels again, as for a host that came later.
    pub fn tell(&self, now: BridgeTime, uplink: &mut Uplink, send: impl FnMut(Stream, &[u8]) -> bool) {
        if let Some(channels) = &self.channels {
            uplink.send(now, Message::HopTable(channels.clone()), send);
        }
    }

    /// When [`ReaderInput::Tick`] is next due, or `None` when stopped.
    pub fn deadline(&self) -> Option<BridgeTime> {
        [self.client.deadline(), self.reads.deadline()].into_iter().flatten().min()
    }

    /// State of the link.
    pub fn state(&self) -> ReaderState {
        self.client.state()
    }

    /// Counts since the path was made.
    pub fn counts(&self) -> Counts {
        self.client.counts()
    }
}
