//! The SDK demo's data UART: TLV frames to packets.

use embassy_time::{Duration, Timer};
use embedded_io_async::Read;
use rfhoi_firmware::bridge::UartPath;
use rfhoi_firmware::uplink::Uplink;
use rfhoi_shared::config::RadarInput;

use crate::bridge::Bridge;
use crate::now;

/// Bytes of a TLV frame, at most: what 921,600 baud carry in a frame period of 100 ms and a half.
const FRAME: usize = 16 * 1024;
/// Pause after an error of the UART, which may come back at once.
const PAUSE: Duration = Duration::from_millis(10);

/// The task of the radar's data UART, 921 600 baud 8N1. Returns at once where the configuration has raw samples.
pub async fn radar_uart(bridge: &'static Bridge, mut uart: impl Read) {
    if bridge.config.radar.input != RadarInput::Uart {
        return;
    }
    let mut path = UartPath::<FRAME>::new(&bridge.config.radar);
    let mut uplink = Uplink::new(bridge.boot);
    let mut bytes = [0; 256];
    loop {
        let Ok(length) = uart.read(&mut bytes).await else {
            Timer::after(PAUSE).await;
            continue;
        };
        let bytes = bytes.get(..length).unwrap_or(&[]);
        path.push(now(), bytes, &mut uplink, |_, packet| bridge.enqueue(None, packet));
        bridge.uart_frames.set(path.frames());
        bridge.radar_celsius.set(path.radar_celsius());
    }
}
