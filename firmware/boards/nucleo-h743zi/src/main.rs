//! The bridge on ST's NUCLEO-H743ZI and NUCLEO-H743ZI2. Not yet tried on a board.
//!
//! | what | pins | where on both boards |
//! |---|---|---|
//! | radar's command line, 115,200 baud | TX PD5, RX PD6 (USART2) | CN9 D53, D52 |
//! | radar's data, 921,600 baud | RX PD0 (UART4) | CN9 D67 |
//! | Ethernet | RMII, LAN8742A | RJ45 |
//! | log | RTT over the ST-LINK | USB |
//! | light: on with link and address, else blinking | PB0 | LD1 |
//!
//! The pins take 3.3 V; check the radar's side, and join the grounds. `cargo run` here flashes and follows the log.
//!
//! Two executors: an interrupt runs network and devices, thread mode the signal processing (see `rfhoi_bridge`).
#![no_std]
#![no_main]

mod board;
mod clocks;
mod devices;
mod fault;
mod idle;
mod keep;
mod memory;
mod phy;
mod restart;
mod stack;
mod temperature;

use defmt_rtt as _;
use embassy_stm32::eth::{Ethernet, Sma};
use embassy_stm32::gpio::{Level, Output, Speed};
use embassy_stm32::rng::Rng;
use embassy_stm32::usart::{self, BufferedUart, UartRx};
use embassy_stm32::wdg::IndependentWatchdog;
use embassy_stm32::{pac, uid};
use rfhoi_bridge::{Board, Handover, Parts};
use rfhoi_firmware::dsp::DopplerStage;
use rfhoi_shared::config::RadarConfig;
use static_cell::{ConstStaticCell, StaticCell};

use board::Nucleo;
use clocks::Revision;
use devices::{Devices, Irqs};
use memory::Memory;
use phy::Lan8742;
use temperature::Thermometer;

/// Baud of the SDK's command line and of its data.
const CONSOLE_BAUD: u32 = 115_200;
const DATA_BAUD: u32 = 921_600;
/// Address of the Ethernet transceiver.
const PHY_ADDRESS: u8 = 0;

#[cortex_m_rt::entry]
fn main() -> ! {
    let (devices, dsp) = set_up();
    devices::start(devices);
    #[unsafe(link_section = ".dtcm")]
    static STAGE: ConstStaticCell<DopplerStage> = ConstStaticCell::new(DopplerStage::new());
    let Dsp { handover, radar, boot } = dsp;
    idle::run(|spawner| {
        defmt::assert!(rfhoi_bridge::spawn_dsp(spawner, handover, radar, boot, STAGE.take()).is_ok());
    })
}

/// What signal processing gets.
struct Dsp {
    handover: &'static Handover,
    radar: RadarConfig,
    boot: u16,
}

/// Brings the chip up.
// Apart from `main`, which never gives its frame back.
#[inline(never)]
fn set_up() -> (Devices, Dsp) {
    let revision = Revision::read();
    let p = embassy_stm32::init(clocks::config(revision));
    let mut core = defmt::unwrap!(cortex_m::Peripherals::take());
    let memory = defmt::unwrap!(Memory::take(&mut core, revision));
    let (restart_reason, last_words) = restart::take();
    defmt::info!("revision {}, {}", revision, restart_reason);
    if let Some(words) = &last_words {
        defmt::error!("the run before ended by: {}", words.text());
    }

    // A halted core does not feed the watchdog.
    pac::DBGMCU.apb4fzr1().modify(|w| w.set_iwdg1(true));
    let mut watchdog = IndependentWatchdog::new(p.IWDG1, board::WATCHDOG_US);
    watchdog.unleash();

    static BOARD: StaticCell<Nucleo> = StaticCell::new();
    let board = BOARD.init(Nucleo {
        id: board::mac_address(uid::uid()),
        restart_reason,
        last_words,
        random: Rng::new(p.RNG, Irqs),
        watchdog,
        thermometer: Thermometer::new(p.ADC3),
        record: keep::Record::new(p.FLASH),
        stack_used: 0,
    });
    let config = rfhoi_bridge::boot_configuration(board);
    let boot = restart::number(board.seed());

    let (mut console, mut data) = (usart::Config::default(), usart::Config::default());
    (console.baudrate, data.baudrate) = (CONSOLE_BAUD, DATA_BAUD);
    static CONSOLE_TX: ConstStaticCell<[u8; 512]> = ConstStaticCell::new([0; 512]);
    static CONSOLE_RX: ConstStaticCell<[u8; 1024]> = ConstStaticCell::new([0; 1024]);
    let (tx, rx) = (CONSOLE_TX.take(), CONSOLE_RX.take());
    let console = defmt::unwrap!(BufferedUart::new(p.USART2, p.PD6, p.PD5, tx, rx, Irqs, console));
    let data = defmt::unwrap!(UartRx::new(p.UART4, p.PD0, p.DMA1_CH0, Irqs, data));

    let transceiver = Lan8742::new(Sma::new(p.ETH_SMA, p.PA2, p.PC1), PHY_ADDRESS);
    let network = Ethernet::new_with_phy(
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

    let handover = memory.handover;
    let dsp = Dsp { handover, radar: config.radar.clone(), boot };
    let devices = Devices {
        seed: board.seed(),
        parts: Parts { board, config, boot, handover, cubes: memory.cubes },
        network,
        console,
        data: data.into_ring_buffered(memory.radar_ring),
        light: Output::new(p.PB0, Level::Low, Speed::Low),
    };
    (devices, dsp)
}
