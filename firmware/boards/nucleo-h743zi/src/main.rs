//! The bridge on ST's NUCLEO-H743ZI and NUCLEO-H743ZI2. Not yet tried on a board.
//!
//! | what | pins | where on both boards |
//! |---|---|---|
//! | radar's command line, 115,200 baud | TX PD5, RX PD6 (USART2) | CN9 D53, D52 |
//! | radar's data, 921,600 baud | RX PD0 (UART4) | CN9 D67 |
//! | Ethernet | RMII, LAN8742A | RJ45 |
//! | log | RTT over the ST-LINK | USB |
//! | light: on with a network address, else blinking | PB0 | LD1 |
//!
//! Two executors: an interrupt runs network and devices, thread mode what computes.
#![no_std]
#![no_main]

mod board;
mod clocks;
mod fault;
mod idle;
mod keep;
mod memory;
mod phy;
mod restart;
mod temperature;

use defmt_rtt as _;
use embassy_executor::{InterruptExecutor, SpawnError, Spawner};
use embassy_net::{Stack, StackResources};
use embassy_stm32::eth::{self, Ethernet, Sma};
use embassy_stm32::gpio::{Level, Output, Speed};
use embassy_stm32::interrupt::{InterruptExt, Priority};
use embassy_stm32::rng::{self, Rng};
use embassy_stm32::usart::{self, BufferedUart, RingBufferedUartRx, UartRx};
use embassy_stm32::wdg::IndependentWatchdog;
use embassy_stm32::{bind_interrupts, dma, interrupt, pac, peripherals, uid};
use embassy_time::{Duration, Ticker};
use embedded_io_async::Read as _;
use static_cell::{ConstStaticCell, StaticCell};

use board::Nucleo;
use clocks::Revision;
use memory::Memory;
use phy::Lan8742;
use temperature::Thermometer;

bind_interrupts!(struct Irqs {
    ETH => eth::InterruptHandler;
    RNG => rng::InterruptHandler<peripherals::RNG>;
    USART2 => usart::BufferedInterruptHandler<peripherals::USART2>;
    UART4 => usart::InterruptHandler<peripherals::UART4>;
    DMA1_STREAM0 => dma::InterruptHandler<peripherals::DMA1_CH0>;
});

type Network = Ethernet<'static, peripherals::ETH, Lan8742<Sma<'static, peripherals::ETH_SMA>>>;

/// Baud of the SDK's command line and of its data.
const CLI_BAUD: u32 = 115_200;
const DATA_BAUD: u32 = 921_600;
/// Below every driver's interrupt, above thread mode.
const NETWORK_PRIORITY: Priority = Priority::P6;

static NETWORK: InterruptExecutor = InterruptExecutor::new();

/// The board has no HDMI, so the interrupt of its control line runs the network's executor.
#[interrupt]
unsafe fn CEC() {
    // SAFETY: this is the interrupt's handler, which `start` enables.
    unsafe { NETWORK.on_interrupt() }
}

#[embassy_executor::task]
async fn network(mut runner: embassy_net::Runner<'static, Network>) -> ! {
    runner.run().await
}

/// Starts what runs in the network's executor.
#[embassy_executor::task]
async fn devices(
    mut board: Nucleo,
    driver: Network,
    cli: BufferedUart<'static>,
    data: RingBufferedUartRx<'static>,
    light: Output<'static>,
) {
    static RESOURCES: StaticCell<StackResources<3>> = StaticCell::new();
    let resources = RESOURCES.init(StackResources::new());
    let ip = embassy_net::Config::dhcpv4(Default::default());
    let (stack, runner) = embassy_net::new(driver, ip, resources, board.seed());
    // SAFETY: a task is given its own executor's spawner.
    let spawner = unsafe { Spawner::for_current_executor().await };
    let spawned = (|| {
        spawner.spawn(network(runner)?);
        spawner.spawn(life(board, stack, light)?);
        spawner.spawn(command_line(cli)?);
        spawner.spawn(radar_data(data)?);
        Ok::<_, SpawnError>(())
    })();
    if spawned.is_err() {
        defmt::unreachable!("one task of each kind");
    }
}

/// Feeds the watchdog and shows life.
#[embassy_executor::task]
async fn life(mut board: Nucleo, stack: Stack<'static>, mut light: Output<'static>) -> ! {
    let mut count = 0u32;
    let mut buffer = [0; 4];
    if let Some(kept) = board.kept(&mut buffer).and_then(|b| <[u8; 4]>::try_from(b).ok()) {
        count = u32::from_le_bytes(kept) + 1;
    }
    if let Err(error) = board.keep(&count.to_le_bytes()) {
        defmt::error!("{}", error);
    }
    defmt::info!("start {}", count);
    let mut second = Ticker::every(Duration::from_secs(1));
    loop {
        second.next().await;
        board.feed_watchdog();
        match stack.config_v4() {
            Some(_) => light.set_high(),
            None => light.toggle(),
        }
        defmt::info!("{} dC, idle {} us", board.decicelsius(), board.idle_us());
    }
}

#[embassy_executor::task]
async fn command_line(mut uart: BufferedUart<'static>) -> ! {
    let mut buffer = [0; 64];
    loop {
        match uart.read(&mut buffer).await {
            Ok(n) => defmt::info!("command line: {} bytes", n),
            Err(error) => defmt::warn!("command line: {}", error),
        }
    }
}

#[embassy_executor::task]
async fn radar_data(mut uart: RingBufferedUartRx<'static>) -> ! {
    let mut buffer = [0; 1024];
    loop {
        match uart.read(&mut buffer).await {
            Ok(n) => defmt::info!("radar: {} bytes", n),
            Err(error) => defmt::warn!("radar: {}", error),
        }
    }
}

#[cortex_m_rt::entry]
fn main() -> ! {
    let revision = Revision::read();
    let p = embassy_stm32::init(clocks::config(revision));
    let mut core = defmt::unwrap!(cortex_m::Peripherals::take());
    let memory = defmt::unwrap!(Memory::take(&mut core, revision));
    let (restart_reason, last_words) = restart::take();
    defmt::info!("revision {}, {}", revision, restart_reason);
    if let Some(words) = last_words {
        defmt::error!("the run before ended by: {}", words.text());
    }

    // A halted core does not feed the watchdog.
    pac::DBGMCU.apb4fzr1().modify(|w| w.set_iwdg1(true));
    let mut watchdog = IndependentWatchdog::new(p.IWDG1, board::WATCHDOG_US);
    watchdog.unleash();

    let board = Nucleo {
        id: board::mac_address(uid::uid()),
        restart_reason,
        random: Rng::new(p.RNG, Irqs),
        watchdog,
        thermometer: Thermometer::new(p.ADC3),
        record: keep::Record::new(p.FLASH),
    };

    let (mut cli_config, mut data_config) = (usart::Config::default(), usart::Config::default());
    (cli_config.baudrate, data_config.baudrate) = (CLI_BAUD, DATA_BAUD);
    static CLI_TX: ConstStaticCell<[u8; 256]> = ConstStaticCell::new([0; 256]);
    static CLI_RX: ConstStaticCell<[u8; 512]> = ConstStaticCell::new([0; 512]);
    let cli = defmt::unwrap!(BufferedUart::new(
        p.USART2,
        p.PD6,
        p.PD5,
        CLI_TX.take(),
        CLI_RX.take(),
        Irqs,
        cli_config
    ));
    let data = defmt::unwrap!(UartRx::new(p.UART4, p.PD0, p.DMA1_CH0, Irqs, data_config))
        .into_ring_buffered(memory.radar_ring);

    let transceiver = Lan8742::new(Sma::new(p.ETH_SMA, p.PA2, p.PC1), 0);
    let driver = Ethernet::new_with_phy(
        memory.packets,
        p.ETH,
        Irqs,
        p.PA1,
        p.PA7,
        p.PC4,
        p.PC5,
        p.PG13,
        p.PB13,
        p.PG11,
        board.id(),
        transceiver,
    );
    let light = Output::new(p.PB0, Level::Low, Speed::Low);

    interrupt::CEC.set_priority(NETWORK_PRIORITY);
    match devices(board, driver, cli, data, light) {
        Ok(task) => NETWORK.start(interrupt::CEC).spawn(task),
        Err(_) => defmt::unreachable!("one task of each kind"),
    }
    defmt::info!("{} cells for cubes", memory.cubes.len());
    idle::run(|_spawner| {})
}
