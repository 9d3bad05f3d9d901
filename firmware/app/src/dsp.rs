//! Signal processing in thread mode: complete frames to packets.

use core::sync::atomic::Ordering;

use embassy_executor::{SpawnError, Spawner};
use embassy_futures::select::{Either, select};
use embassy_futures::yield_now;
use embassy_time::{Duration, Timer};
use rfhoi_firmware::bridge::Mapping;
use rfhoi_firmware::dsp::DopplerStage;
use rfhoi_firmware::uplink::Uplink;
use rfhoi_shared::config::RadarConfig;

use crate::handover::Handover;
use crate::{BRIDGES, now};

/// How often thread mode shows that it is alive where no frames come.
const HEARTBEAT: Duration = Duration::from_millis(500);

/// Starts signal processing of frames with `config`; `boot` numbers the start and `stage` is its memory.
///
/// # Errors
/// If it runs already.
// The task is made on the stack, and `main`, which calls this, never gives its frame back.
#[inline(never)]
pub fn spawn(
    spawner: Spawner,
    handover: &'static Handover,
    config: RadarConfig,
    boot: u16,
    stage: &'static mut DopplerStage,
) -> Result<(), SpawnError> {
    spawner.spawn(run(handover, config, boot, stage)?);
    Ok(())
}

#[embassy_executor::task(pool_size = BRIDGES)]
async fn run(handover: &'static Handover, config: RadarConfig, boot: u16, stage: &'static mut DopplerStage) {
    let mut mapping = Mapping::new(&config, stage);
    let mut uplink = Uplink::new(boot);
    loop {
        handover.alive.store(true, Ordering::Relaxed);
        let (cube, done) = match select(handover.frames.receive(), Timer::after(HEARTBEAT)).await {
            Either::First(frame) => frame,
            Either::Second(()) => continue,
        };
        let mut send = |_, bytes: &[u8]| handover.send(bytes);
        handover.working.store(true, Ordering::Relaxed);
        mapping.begin(cube, done);
        // A board that runs everything on one executor gets to its other tasks in between.
        while mapping.range_bin(cube, &mut uplink, &mut send) {
            yield_now().await;
        }
        mapping.finish(now(), &mut uplink, &mut send);
        handover.working.store(false, Ordering::Relaxed);
        handover.unsent.store(uplink.unsent(), Ordering::Relaxed);
        // There are two cubes at most and this is one of them: there is room.
        let _ = handover.spare.try_send(cube);
    }
}
