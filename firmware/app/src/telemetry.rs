//! Once a second: telemetry, and the watchdog, which is fed only while thread mode runs too. In between it looks how
//! late its executor is, which is reception's too, while a frame is worked on.

use core::sync::atomic::Ordering;

use embassy_futures::select::{Either, select};
use embassy_time::{Duration, Instant, Timer};
use rfhoi_firmware::uplink::Uplink;
use rfhoi_shared::wire::{Message, Telemetry};

use crate::BRIDGES;
use crate::bridge::Bridge;

const PERIOD: Duration = Duration::from_secs(1);
/// How often it looks.
const LOOK: Duration = Duration::from_millis(10);
/// From a restart's acknowledgement to the restart, so that the packet leaves.
const FAREWELL: Duration = Duration::from_millis(250);

#[embassy_executor::task(pool_size = BRIDGES)]
pub(crate) async fn run(bridge: &'static Bridge) {
    let mut uplink = Uplink::new(bridge.boot);
    let mut due = Instant::now() + PERIOD;
    let mut late = Duration::MIN;
    loop {
        let look = Instant::now() + LOOK;
        if let Either::Second(()) = select(Timer::at(look), bridge.restart.wait()).await {
            Timer::after(FAREWELL).await;
            bridge.with_board(|board| board.restart());
            continue;
        }
        let now = Instant::now();
        if bridge.handover.working.load(Ordering::Relaxed) {
            // Rounded up.
            late = late.max(now.saturating_duration_since(look) + Duration::from_ticks(1));
        }
        if now < due {
            continue;
        }
        due += PERIOD;
        if bridge.handover.alive.swap(false, Ordering::Relaxed) {
            bridge.with_board(|board| board.feed_watchdog());
        }
        let late_us = u32::try_from(late.as_micros()).unwrap_or(u32::MAX);
        late = Duration::MIN;
        let telemetry = Message::Telemetry(Telemetry { late_us, ..telemetry(bridge) });
        uplink.send(crate::now(), telemetry, |_, bytes| bridge.enqueue(None, bytes));
    }
}

fn telemetry(bridge: &Bridge) -> Telemetry {
    let board = bridge.with_board(|b| (b.idle_us(), b.decicelsius(), b.restart_reason()));
    let (idle_us, bridge_decicelsius, restart) = board.unwrap_or_default();
    let mut telemetry = Telemetry {
        reader: bridge.reader.get(),
        uplink_dropped: bridge.dropped(),
        strays: bridge.strays.get().wrapping_add(bridge.recorder_strays.get()),
        radar: bridge.radar.get(),
        restart,
        busy_us: crate::now().0.saturating_sub(idle_us),
        bridge_decicelsius,
        radar_decicelsius: bridge.radar_celsius.get().map(|celsius| celsius.saturating_mul(10)),
        ..Telemetry::default()
    };
    telemetry.frames = bridge.uart_frames.get();
    if let Ok(intake) = bridge.intake.try_borrow() {
        if intake.is_raw() {
            telemetry.frames = intake.frames();
        }
        telemetry.datagrams = intake.datagrams();
        telemetry.overruns = intake.overruns();
    }
    telemetry
}
