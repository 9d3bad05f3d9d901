//! A smoke test of the board's drivers: what each does, in the log.
//!
//! It takes an address by DHCP, counts the radar's datagrams and what they cost, greets a TCP server at the host's port
//! 5084 if there is one, counts bytes on UART1, and obeys letters on UART0: `r` restarts, `p` panics, `f` faults, `w`
//! stops feeding the watchdog, `k` keeps a configuration.
#![no_std]
#![no_main]

use core::panic::PanicInfo;
use core::sync::atomic::{AtomicU32, Ordering};

use board::idle::{self, Load};
use board::kept::{self, Restart};
use board::lan9118::{self, Lan9118};
use board::tap::Tap;
use board::uart::{Receiver, Sender, UART0, UART1};
use board::{interrupts, timer, watchdog};
use embassy_executor::Spawner;
use embassy_net::tcp::TcpSocket;
use embassy_net::{Config, Ipv4Address, Runner, Stack, StackResources};
use embassy_time::{Duration, Ticker, with_timeout};
use embedded_io_async::{Read, Write};
use static_cell::StaticCell;

/// Port of the DCA1000's samples.
const SAMPLES_PORT: u16 = 4098;
/// The host as QEMU's user-mode network shows it, and LLRP's port.
const READER: (Ipv4Address, u16) = (Ipv4Address::new(10, 0, 2, 2), 5084);
/// Locally administered.
const MAC: [u8; 6] = [0x02, 0x00, 0x00, 0x00, 0x00, 0x01];
const WATCHDOG_MS: u32 = 5000;

static DATAGRAMS: AtomicU32 = AtomicU32::new(0);
static BYTES: AtomicU32 = AtomicU32::new(0);

type Network = Tap<Lan9118, fn(&[u8])>;

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    kept::restart_after(info)
}

fn count(datagram: &[u8]) {
    core::hint::black_box(datagram);
    DATAGRAMS.fetch_add(1, Ordering::Relaxed);
}

#[embassy_executor::task]
async fn network() {
    static RESOURCES: StaticCell<StackResources<3>> = StaticCell::new();
    // SAFETY: a task of embassy's executor.
    let spawner = unsafe { Spawner::for_current_executor() }.await;
    let driver = match Lan9118::start(MAC) {
        Ok(driver) => driver,
        Err(error) => {
            defmt::error!("network: {}", error);
            return;
        }
    };
    let (stack, runner) = embassy_net::new(
        Tap::new(driver, SAMPLES_PORT, count as fn(&[u8])),
        Config::dhcpv4(Default::default()),
        RESOURCES.init(StackResources::new()),
        1,
    );
    spawner.spawn(defmt::unwrap!(run(runner)));
    spawner.spawn(defmt::unwrap!(greet(stack)));
}

#[embassy_executor::task]
async fn run(mut runner: Runner<'static, Network>) -> ! {
    runner.run().await
}

#[embassy_executor::task]
async fn greet(stack: Stack<'static>) {
    stack.wait_config_up().await;
    defmt::info!("address: {}", stack.config_v4().map(|c| c.address));
    let (mut rx, mut tx) = ([0; 1500], [0; 1500]);
    let mut socket = TcpSocket::new(stack, &mut rx, &mut tx);
    socket.set_timeout(Some(Duration::from_secs(3)));
    if let Err(error) = socket.connect(READER).await {
        defmt::info!("TCP to {}: {}", READER, error);
        return;
    }
    let mut answer = [0; 64];
    let sent = socket.write_all(b"hello\n").await;
    let received = with_timeout(Duration::from_secs(1), socket.read(&mut answer)).await;
    defmt::info!("TCP to {}: sent {}, received {}", READER, sent, received);
    socket.close();
}

#[embassy_executor::task]
async fn data(mut uart: Receiver) {
    let mut buffer = [0; 256];
    loop {
        let Ok(read) = uart.read(&mut buffer).await;
        BYTES.fetch_add(read as u32, Ordering::Relaxed);
    }
}

#[embassy_executor::task]
async fn console(mut receiver: Receiver, mut sender: Sender) {
    let mut letter = [0];
    loop {
        let Ok(()) = sender.write_all(b"> ").await;
        let Ok(_) = receiver.read(&mut letter).await;
        match letter {
            [b'r'] => kept::restart(Restart::Command),
            [b'p'] => panic!("as asked"),
            // SAFETY: nothing is there to read; the bus fault is what is wanted.
            [b'f'] => _ = unsafe { core::ptr::read_volatile(0xf000_0000 as *const u32) },
            [b'w'] => loop {
                cortex_m::asm::nop();
            },
            [b'k'] => defmt::info!("kept: {}", kept::store_configuration(b"configuration")),
            other => _ = sender.write_all(&other).await,
        }
    }
}

#[embassy_executor::task]
async fn report() {
    let mut second = Ticker::every(Duration::from_secs(1));
    watchdog::start(WATCHDOG_MS);
    let (mut before, mut datagrams_before) = (Load::now(), 0);
    loop {
        second.next().await;
        watchdog::feed();
        let (now, datagrams) = (Load::now(), DATAGRAMS.load(Ordering::Relaxed));
        let (busy, all) = now.since(before);
        defmt::info!(
            "{} datagrams, +{}; busy {} of {} us; {}; UART1 {} bytes, overruns {} {}",
            datagrams,
            datagrams.wrapping_sub(datagrams_before),
            busy / 25,
            all / 25,
            lan9118::losses(),
            BYTES.load(Ordering::Relaxed),
            UART0.overruns(),
            UART1.overruns(),
        );
        // The log is not the load.
        (before, datagrams_before) = (Load::now(), datagrams);
    }
}

#[cortex_m_rt::entry]
fn main() -> ! {
    timer::start();
    let (reason, note) = kept::take_restart();
    let mut buffer = [0; kept::CONFIGURATION_BYTES];
    defmt::info!(
        "start: {} {=str}; configuration {=[u8]:a}",
        reason,
        note,
        kept::load_configuration(&mut buffer).unwrap_or(&[])
    );
    interrupts::start_network_executor().spawn(defmt::unwrap!(network()));
    idle::run(|spawner| {
        let (receiver, sender) = UART0.open(115_200);
        spawner.spawn(defmt::unwrap!(console(receiver, sender)));
        spawner.spawn(defmt::unwrap!(data(UART1.open(921_600).0)));
        spawner.spawn(defmt::unwrap!(report()));
    })
}
