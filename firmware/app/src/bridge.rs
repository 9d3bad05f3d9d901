//! What the tasks on the network's executor share.

use core::cell::{Cell, RefCell};
use core::fmt::{self, Write};
use core::sync::atomic::Ordering;

use embassy_executor::{SpawnError, Spawner};
use embassy_net::Stack;
use embassy_net_driver::Driver;
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::signal::Signal;
use heapless::String;
use num_complex::Complex;
use rfhoi_firmware::dca1000::DATA_PORT;
use rfhoi_firmware::uplink::Uplink;
use rfhoi_shared::config::{BridgeConfig, Endpoint};
use rfhoi_shared::wire::{FrameCounts, Hello, MAX_NOTICE, Message, Notice, RadarState, ReaderCounts, Stream};

use crate::board::{Board, KeepError, keep_configuration};
use crate::handover::Handover;
use crate::packet::Outgoing;
use crate::radar::Intake;
use crate::tap::Tap;
use crate::{CUBE_CELLS, host, now, reader, telemetry};

/// What a bridge is made of.
pub struct Parts {
    /// The board.
    pub board: &'static mut (dyn Board + Send),
    /// The configuration in force: [`crate::boot_configuration`]'s.
    pub config: BridgeConfig,
    /// Number of this start, other than the last one's.
    pub boot: u16,
    /// What signal processing got too.
    pub handover: &'static Handover,
    /// Memory for the cubes.
    pub cubes: &'static mut [Complex<i16>; CUBE_CELLS],
}

/// A bridge at work.
pub struct Bridge {
    pub(crate) config: BridgeConfig,
    pub(crate) boot: u16,
    pub(crate) handover: &'static Handover,
    pub(crate) intake: RefCell<Intake>,
    /// Whether the radar is to run.
    pub(crate) radar_runs: Signal<NoopRawMutex, bool>,
    /// Whether the reader is to read.
    pub(crate) reader_runs: Signal<NoopRawMutex, bool>,
    /// A new host needs what only comes once in a while.
    pub(crate) reader_tells: Signal<NoopRawMutex, ()>,
    /// A restart was asked for.
    pub(crate) restart: Signal<NoopRawMutex, ()>,
    pub(crate) reader: Cell<ReaderCounts>,
    pub(crate) radar: Cell<RadarState>,
    pub(crate) radar_celsius: Cell<Option<i16>>,
    /// Frames of the data UART.
    pub(crate) uart_frames: Cell<FrameCounts>,
    pub(crate) recorder_strays: Cell<u32>,
    pub(crate) strays: Cell<u32>,
    dropped: Cell<u32>,
    host: Cell<Option<Endpoint>>,
    /// Who said hello last.
    greeted: Cell<Option<Endpoint>>,
    /// Numbers what belongs to [`Stream::Control`].
    control: RefCell<Uplink>,
    board: RefCell<&'static mut (dyn Board + Send)>,
}

impl Bridge {
    /// A bridge that has not begun. Its configuration must be valid.
    pub fn new(parts: Parts) -> Self {
        let Parts { board, config, boot, handover, cubes } = parts;
        handover.host.store(config.host.is_some(), Ordering::Relaxed);
        let intake = Intake::new(&config.radar, cubes, handover);
        Self {
            boot,
            handover,
            intake: RefCell::new(intake),
            radar_runs: Signal::new(),
            reader_runs: Signal::new(),
            reader_tells: Signal::new(),
            restart: Signal::new(),
            reader: Cell::default(),
            radar: Cell::default(),
            radar_celsius: Cell::default(),
            uart_frames: Cell::default(),
            recorder_strays: Cell::default(),
            strays: Cell::default(),
            dropped: Cell::default(),
            host: Cell::new(config.host),
            greeted: Cell::default(),
            control: RefCell::new(Uplink::new(boot)),
            board: RefCell::new(board),
            config,
        }
    }

    /// Starts the tasks that need nothing but the network, and radar and reader with them. The board spawns
    /// [`crate::radar_control`], [`crate::radar_uart`] and the IP stack's runner, whose types are its own.
    ///
    /// # Errors
    /// If they run already.
    pub fn spawn(&'static self, spawner: Spawner, stack: Stack<'static>) -> Result<(), SpawnError> {
        spawner.spawn(host::run(self, stack)?);
        spawner.spawn(reader::run(self, stack)?);
        spawner.spawn(telemetry::run(self)?);
        self.run(true);
        Ok(())
    }

    /// `driver` with the recorder's datagrams taken out of it; the IP stack gets the rest.
    pub fn tap<D: Driver>(&'static self, driver: D) -> Tap<D, &'static Self> {
        Tap::new(driver, DATA_PORT, self)
    }

    /// Counts a datagram that is none of ours.
    pub(crate) fn stray(&self) {
        self.strays.set(self.strays.get().wrapping_add(1));
    }

    /// Starts or stops radar and reader.
    pub(crate) fn run(&self, on: bool) {
        self.radar_runs.signal(on);
        self.reader_runs.signal(on);
    }

    /// Whether radar and reader are both stopped.
    pub(crate) fn is_stopped(&self) -> bool {
        let reader = self.reader.get().state;
        self.radar.get() == RadarState::Stopped && reader == Default::default()
    }

    /// Where packets go.
    pub(crate) fn host(&self) -> Option<Endpoint> {
        self.host.get()
    }

    /// Sends packets to `host` from now on. Returns whether it is the first to say so, or another than before.
    pub(crate) fn set_host(&self, host: Endpoint) -> bool {
        self.host.set(Some(host));
        self.handover.host.store(true, Ordering::Relaxed);
        self.greeted.replace(Some(host)) != Some(host)
    }

    /// Puts a packet into the uplink's queue. Returns whether it was taken; without a host all are, and go nowhere.
    pub(crate) fn enqueue(&self, to: Option<Endpoint>, bytes: &[u8]) -> bool {
        if to.or(self.host()).is_none() {
            return true;
        }
        let taken =
            Outgoing::new(to, bytes).is_some_and(|packet| self.handover.packets.try_send(packet).is_ok());
        if !taken {
            self.drop_packets(1);
        }
        taken
    }

    /// Counts packets that could not leave.
    pub(crate) fn drop_packets(&self, count: u32) {
        self.dropped.set(self.dropped.get().wrapping_add(count));
    }

    /// Packets that could not leave since the start.
    pub(crate) fn dropped(&self) -> u32 {
        self.dropped.get().wrapping_add(self.handover.unsent.load(Ordering::Relaxed))
    }

    /// Sends a message of [`Stream::Control`] to `to`, or to the host.
    pub(crate) fn say(&self, to: Option<Endpoint>, message: Message<'_>) {
        debug_assert_eq!(message.stream(), Stream::Control);
        if let Ok(mut uplink) = self.control.try_borrow_mut() {
            uplink.send(now(), message, |_, bytes| self.enqueue(to, bytes));
        }
    }

    /// Tells a person, through the log and through the host.
    pub(crate) fn notice(&self, words: impl fmt::Display) {
        let text = text(words);
        #[cfg(feature = "defmt")]
        defmt::warn!("{=str}", text.as_str());
        self.say(None, Message::Notice(Notice { text }));
    }

    /// Tells the host what went wrong before the start, if anything did.
    pub(crate) fn tell_last_words(&self) {
        let words = self.with_board(|board| text(board.last_words())).unwrap_or_default();
        if !words.is_empty() {
            self.say(None, Message::Notice(Notice { text: words }));
        }
    }

    /// Who this bridge is.
    pub(crate) fn hello(&self) -> Hello {
        let (name, id) = self.with_board(|board| (board.name(), board.id())).unwrap_or_default();
        Hello {
            board: name.chars().collect(),
            id,
            firmware: VERSION,
            cube_bytes: cube_bytes(),
            profile: self.config.radar.profile.fingerprint(),
        }
    }

    /// Keeps a configuration for the next start.
    pub(crate) fn keep(&self, config: &BridgeConfig) -> Result<(), KeepError> {
        self.with_board(|board| keep_configuration(board, config)).unwrap_or(Err(KeepError))
    }

    /// Calls `f` with the board, unless a caller further up has it.
    pub(crate) fn with_board<R>(&self, f: impl FnOnce(&mut (dyn Board + Send)) -> R) -> Option<R> {
        self.board.try_borrow_mut().ok().map(|mut board| f(&mut **board))
    }
}

/// Memory for one cube, bytes.
pub(crate) const fn cube_bytes() -> u32 {
    (CUBE_CELLS * size_of::<Complex<i16>>()) as u32
}

/// Firmware version.
const VERSION: [u8; 3] = [
    number(env!("CARGO_PKG_VERSION_MAJOR")),
    number(env!("CARGO_PKG_VERSION_MINOR")),
    number(env!("CARGO_PKG_VERSION_PATCH")),
];

const fn number(digits: &str) -> u8 {
    match u8::from_str_radix(digits, 10) {
        Ok(number) => number,
        Err(_) => u8::MAX,
    }
}

/// `words`, cut where they are too long.
fn text(words: impl fmt::Display) -> String<MAX_NOTICE> {
    let mut text = Cut(String::new());
    // Never fails.
    let _ = write!(text, "{words}");
    text.0
}

/// Text that is cut where it is too long.
struct Cut(String<MAX_NOTICE>);

impl Write for Cut {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        for c in text.chars() {
            if self.0.push(c).is_err() {
                break;
            }
        }
        Ok(())
    }
}
