//! The bridge on QEMU's mps2-an500.
//!
//! The network's executor runs in an interrupt and has everything but signal processing, which has thread mode.
#![no_std]
#![no_main]

use core::panic::PanicInfo;

use board::device::An500;
use board::lan9118::Lan9118;
use board::{idle, interrupts, kept, timer, uart, watchdog};
use defmt::unwrap;
use embassy_executor::Spawner;
use embassy_net::{Runner, Stack, StackResources};
use num_complex::Complex;
use rfhoi_bridge::{
    Board, Bridge, CUBE_CELLS, Handover, Parts, SOCKETS, Tap, boot_configuration, ip_configuration,
    radar_control, radar_uart, spawn_dsp,
};
use rfhoi_firmware::dsp::DopplerStage;
use static_cell::{ConstStaticCell, StaticCell};

/// Rates of the radar's UARTs (SDK demo).
const CONSOLE_BAUD: u32 = 115_200;
const DATA_BAUD: u32 = 921_600;

/// The application feeds the watchdog once a second.
const WATCHDOG_MS: u32 = 5_000;

type Network = Tap<Lan9118, &'static Bridge>;

static CUBES: ConstStaticCell<[Complex<i16>; CUBE_CELLS]> =
    ConstStaticCell::new([Complex::new(0, 0); CUBE_CELLS]);
static DOPPLER: ConstStaticCell<DopplerStage> = ConstStaticCell::new(DopplerStage::new());
static HANDOVER: Handover = Handover::new();
static BOARD: StaticCell<An500> = StaticCell::new();
static BRIDGE: StaticCell<Bridge> = StaticCell::new();
static SOCKET_MEMORY: StaticCell<StackResources<SOCKETS>> = StaticCell::new();

#[cortex_m_rt::entry]
fn main() -> ! {
    timer::start();
    watchdog::start(WATCHDOG_MS);
    let board = BOARD.init(An500::new());
    let boot = board.seed() as u16;
    let config = boot_configuration(board);
    let radar = config.radar.clone();
    let parts = Parts { board, config, boot, handover: &HANDOVER, cubes: CUBES.take() };
    interrupts::start_network_executor().spawn(unwrap!(network(parts)));
    idle::run(|spawner| unwrap!(spawn_dsp(spawner, &HANDOVER, radar, boot, DOPPLER.take())))
}

/// Starts everything that has to do with the network, on its executor.
#[embassy_executor::task]
async fn network(parts: Parts) {
    // SAFETY: this is a task of embassy's executor.
    let spawner = unsafe { Spawner::for_current_executor() }.await;
    let (id, seed, ip) = (parts.board.id(), parts.board.seed(), ip_configuration(&parts.config));
    let bridge: &'static Bridge = BRIDGE.init(Bridge::new(parts));
    let driver = bridge.tap(unwrap!(Lan9118::start(id)));
    let (stack, runner) = embassy_net::new(driver, ip, SOCKET_MEMORY.init(StackResources::new()), seed);
    spawner.spawn(unwrap!(run_stack(runner)));
    spawner.spawn(unwrap!(control(bridge, stack)));
    spawner.spawn(unwrap!(data(bridge)));
    unwrap!(bridge.spawn(spawner, stack));
}

#[embassy_executor::task]
async fn run_stack(mut runner: Runner<'static, Network>) -> ! {
    runner.run().await
}

#[embassy_executor::task]
async fn control(bridge: &'static Bridge, stack: Stack<'static>) {
    let (heard, said) = uart::UART0.open(CONSOLE_BAUD);
    radar_control(bridge, stack, heard, said).await;
}

#[embassy_executor::task]
async fn data(bridge: &'static Bridge) {
    let (heard, _) = uart::UART1.open(DATA_BAUD);
    radar_uart(bridge, heard).await;
}

/// Notes what went wrong, and restarts; the next start says it.
#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    kept::restart_after(info)
}
