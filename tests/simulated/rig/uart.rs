//! The radar's two UARTs in virtual time, as the bridge's tasks see them.

use std::cell::{Cell, RefCell};
use std::collections::VecDeque;
use std::convert::Infallible;
use std::rc::Rc;

use embassy_futures::select::select;
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::signal::Signal;
use embassy_time::{Duration, Instant, Timer};
use embedded_io_async::{ErrorType, Read, Write};
use rfhoi_shared::units::BridgeTime;

use super::clock;
use crate::simulated::console::{CHARACTER_US, Console};

/// Bytes a second of the data UART: 921 600 baud.
const DATA_BYTES_PER_SECOND: u64 = 92_160;
/// Bytes that come out of the data UART at once.
const PIECE: usize = 64;

/// Bytes under way to the bridge, each with when it is there.
#[derive(Default)]
struct Coming {
    bytes: RefCell<VecDeque<(BridgeTime, u8)>>,
    changed: Signal<NoopRawMutex, ()>,
}

impl Coming {
    fn send(&self, time: BridgeTime, bytes: &[u8]) {
        self.bytes.borrow_mut().extend(bytes.iter().map(|&byte| (time, byte)));
        self.changed.signal(());
    }

    /// At least one byte.
    async fn read(&self, buffer: &mut [u8]) -> usize {
        loop {
            let now = clock::now();
            let mut length = 0;
            while let Some(place) = buffer.get_mut(length)
                && let Some((_, byte)) = self.bytes.borrow_mut().pop_front_if(|(time, _)| *time <= now)
            {
                *place = byte;
                length += 1;
            }
            if length > 0 {
                return length;
            }
            let next = self.bytes.borrow().front().map(|(time, _)| Instant::from_micros(time.0));
            select(Timer::at(next.unwrap_or(Instant::MAX)), self.changed.wait()).await;
        }
    }
}

#[derive(Default)]
struct Line {
    coming: Coming,
    console: RefCell<Console>,
    unplugged: Cell<bool>,
    started: Signal<NoopRawMutex, ()>,
}

/// The radar's command line on its UART, 115 200 baud; clones are the same one.
#[derive(Clone, Default)]
pub struct ConsoleUart(Rc<Line>);

impl ConsoleUart {
    /// The command line.
    pub fn with<R>(&self, f: impl FnOnce(&mut Console) -> R) -> R {
        f(&mut self.0.console.borrow_mut())
    }

    /// Pulls the cable, or puts it in again.
    pub fn set_plugged(&self, plugged: bool) {
        self.0.unplugged.set(!plugged);
    }

    /// The radar says these bytes.
    pub fn say(&self, bytes: &[u8]) {
        self.0.coming.send(clock::now(), bytes);
    }

    /// Waits for the sensor to begin its first frame; when it does.
    pub(super) async fn started(&self) -> BridgeTime {
        loop {
            if let Some(time) = self.with(|console| console.started()) {
                return time;
            }
            self.0.started.wait().await;
        }
    }
}

impl ErrorType for ConsoleUart {
    type Error = Infallible;
}

impl Read for ConsoleUart {
    async fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Infallible> {
        Ok(self.0.coming.read(buffer).await)
    }
}

impl Write for ConsoleUart {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        for line in bytes.split_inclusive(|&byte| byte == b'\n') {
            Timer::after(Duration::from_micros(CHARACTER_US * line.len() as u64)).await;
            if self.0.unplugged.get() {
                continue;
            }
            let said = self.with(|console| console.hear(clock::now(), &String::from_utf8_lossy(line)));
            for (time, words) in said {
                self.0.coming.send(time, words.as_bytes());
            }
            self.0.started.signal(());
        }
        Ok(bytes.len())
    }

    async fn flush(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

/// The radar's data UART, 921 600 baud; clones are the same one.
#[derive(Clone, Default)]
pub struct DataUart(Rc<Coming>);

impl DataUart {
    /// The radar says these bytes; waits until they are out.
    pub async fn say(&self, bytes: &[u8]) {
        for piece in bytes.chunks(PIECE) {
            let piece_us = piece.len() as u64 * 1_000_000 / DATA_BYTES_PER_SECOND;
            Timer::after(Duration::from_micros(piece_us)).await;
            self.0.send(clock::now(), piece);
        }
    }
}

impl ErrorType for DataUart {
    type Error = Infallible;
}

impl Read for DataUart {
    async fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Infallible> {
        Ok(self.0.read(buffer).await)
    }
}
