//! The executor of network and devices, and the tasks whose types are the board's.

use embassy_executor::{InterruptExecutor, Spawner};
use embassy_net::{Runner, Stack, StackResources};
use embassy_stm32::eth::{self, Ethernet, Sma};
use embassy_stm32::gpio::Output;
use embassy_stm32::interrupt::{InterruptExt, Priority};
use embassy_stm32::usart::{self, BufferedUart, RingBufferedUartRx};
use embassy_stm32::{bind_interrupts, dma, interrupt, peripherals, rng};
use embassy_time::{Duration, Ticker};
use rfhoi_bridge::{Bridge, Parts, SOCKETS, Tap};
use static_cell::StaticCell;

use crate::phy::Lan8742;

bind_interrupts!(pub struct Irqs {
    ETH => eth::InterruptHandler;
    RNG => rng::InterruptHandler<peripherals::RNG>;
    USART2 => usart::BufferedInterruptHandler<peripherals::USART2>;
    UART4 => usart::InterruptHandler<peripherals::UART4>;
    DMA1_STREAM0 => dma::InterruptHandler<peripherals::DMA1_CH0>;
});

/// The Ethernet controller with its transceiver.
pub type Network = Ethernet<'static, peripherals::ETH, Lan8742<Sma<'static, peripherals::ETH_SMA>>>;

/// Below every driver's interrupt, above thread mode.
const PRIORITY: Priority = Priority::P6;
/// How often the light is looked at.
const LIGHT: Duration = Duration::from_millis(500);

static EXECUTOR: InterruptExecutor = InterruptExecutor::new();

/// The board has no HDMI: the interrupt of its control line runs the executor.
#[interrupt]
unsafe fn CEC() {
    // SAFETY: this is the interrupt's handler, which `start` enables.
    unsafe { EXECUTOR.on_interrupt() }
}

/// What the executor gets.
pub struct Devices {
    /// For the IP stack's ports and numbers.
    pub seed: u64,
    /// What the bridge is made of.
    pub parts: Parts,
    /// The Ethernet controller.
    pub network: Network,
    /// The radar's command line.
    pub console: BufferedUart<'static>,
    /// The radar's data.
    pub data: RingBufferedUartRx<'static>,
    /// The light that shows a network address.
    pub light: Output<'static>,
}

/// Starts the executor.
///
/// # Panics
/// When called twice.
pub fn start(devices: Devices) {
    interrupt::CEC.set_priority(PRIORITY);
    match run(devices) {
        Ok(task) => EXECUTOR.start(interrupt::CEC).spawn(task),
        Err(_) => defmt::unreachable!("started twice"),
    }
}

#[embassy_executor::task]
async fn run(devices: Devices) {
    let Devices { seed, parts, network, console, data, light } = devices;
    static RESOURCES: StaticCell<StackResources<SOCKETS>> = StaticCell::new();
    static BRIDGE: StaticCell<Bridge> = StaticCell::new();
    let ip = rfhoi_bridge::ip_configuration(&parts.config);
    let bridge = BRIDGE.init_with(|| Bridge::new(parts));
    let resources = RESOURCES.init(StackResources::new());
    let (stack, runner) = embassy_net::new(bridge.tap(network), ip, resources, seed);
    // SAFETY: a task is given its own executor's spawner.
    let spawner = unsafe { Spawner::for_current_executor().await };
    let spawned = (|| {
        spawner.spawn(ip_stack(runner)?);
        spawner.spawn(radar_control(bridge, stack, console)?);
        spawner.spawn(radar_uart(bridge, data)?);
        spawner.spawn(show_address(stack, light)?);
        bridge.spawn(spawner, stack)
    })();
    defmt::assert!(spawned.is_ok(), "each task starts once");
}

#[embassy_executor::task]
async fn ip_stack(mut runner: Runner<'static, Tap<Network, &'static Bridge>>) -> ! {
    runner.run().await
}

#[embassy_executor::task]
async fn radar_control(bridge: &'static Bridge, stack: Stack<'static>, console: BufferedUart<'static>) {
    let (to_console, from_console) = console.split();
    rfhoi_bridge::radar_control(bridge, stack, from_console, to_console).await;
}

#[embassy_executor::task]
async fn radar_uart(bridge: &'static Bridge, data: RingBufferedUartRx<'static>) {
    rfhoi_bridge::radar_uart(bridge, data).await;
}

#[embassy_executor::task]
async fn show_address(stack: Stack<'static>, mut light: Output<'static>) -> ! {
    let mut ticker = Ticker::every(LIGHT);
    loop {
        if stack.is_link_up() && stack.is_config_up() {
            light.set_high()
        } else {
            light.toggle()
        }
        ticker.next().await;
    }
}
