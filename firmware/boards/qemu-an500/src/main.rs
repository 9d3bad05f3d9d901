//! Smoke test.
#![no_std]
#![no_main]
#![allow(missing_docs)]

use board::{idle, interrupts, lan9118::Lan9118, timer, uart};
use embassy_executor::Spawner;
use embassy_net::udp::{PacketMetadata, UdpSocket};
use embassy_net::{Config, Runner, Stack, StackResources};
use embassy_time::{Duration, Instant, Timer};
use embedded_io_async::{Read, Write};
use panic_semihosting as _;
use static_cell::{ConstStaticCell, StaticCell};

#[embassy_executor::task]
async fn net(mut runner: Runner<'static, Lan9118>) -> ! {
    runner.run().await
}

static RESOURCES: StaticCell<StackResources<4>> = StaticCell::new();
static RX: ConstStaticCell<[u8; 65536]> = ConstStaticCell::new([0; 65536]);

#[embassy_executor::task]
async fn udp(stack: Stack<'static>) {
    stack.wait_config_up().await;
    defmt::info!("address {}", stack.config_v4());
    static META: ConstStaticCell<[PacketMetadata; 64]> = ConstStaticCell::new([PacketMetadata::EMPTY; 64]);
    let mut tx_meta = [PacketMetadata::EMPTY; 1];
    let mut tx = [0; 64];
    let mut socket = UdpSocket::new(stack, META.take(), RX.take(), &mut tx_meta, &mut tx);
    defmt::unwrap!(socket.bind(4098));
    let mut count = 0u32;
    let mut from = idle::Load::now();
    loop {
        socket.recv_from_with(|data, _| core::hint::black_box(data.len())).await;
        count += 1;
        if count % 100 == 0 {
            let now = idle::Load::now();
            let (busy, all) = now.since(from);
            defmt::info!(
                "{} datagrams, busy {} all {} losses {}",
                count,
                busy * 40 / 100,
                all * 40 / 100,
                board::lan9118::losses()
            );
            from = idle::Load::now();
        }
    }
}

#[embassy_executor::task]
async fn start() {
    // SAFETY: this task runs on an executor of embassy.
    let spawner2 = unsafe { Spawner::for_current_executor() }.await;
    let driver = defmt::unwrap!(Lan9118::start([2, 0, 0, 0, 0, 1]));
    let (stack, runner) = embassy_net::new(
        driver,
        Config::dhcpv4(Default::default()),
        RESOURCES.init(StackResources::new()),
        1,
    );
    spawner2.spawn(defmt::unwrap!(net(runner)));
    spawner2.spawn(defmt::unwrap!(udp(stack)));
}

#[embassy_executor::task]
async fn tick() {
    let (mut rx, mut tx) = uart::UART0.open(115_200);
    let _ = tx.write_all(b"hello\n").await;
    let mut b = [0; 64];
    let n = rx.read(&mut b).await;
    defmt::info!("uart {} {=[u8]:a}", n, b[..3]);
    loop {
        Timer::after(Duration::from_secs(1)).await;
        defmt::info!("{}", Instant::now());
    }
}

#[cortex_m_rt::entry]
fn main() -> ! {
    timer::start();
    interrupts::start_network_executor().spawn(defmt::unwrap!(start()));
    idle::run(|spawner| {
        spawner.spawn(defmt::unwrap!(tick()));
    })
}
