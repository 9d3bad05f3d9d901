//! How long this computer takes for a frame of a plan.

use std::hint::black_box;
use std::time::{Duration, Instant};

use super::uplink::frames;
use super::{Plan, radar};
use crate::aoa::Bartlett;
use crate::receive::{Received, Receiver};

/// Time over which is measured.
const FOR: Duration = Duration::from_millis(100);

/// The median time that this computer takes from a frame's packets to its angle map.
pub fn host_time(plan: &Plan) -> Duration {
    let config = radar(&plan.config, &plan.needs);
    let bartlett = Bartlett::new(&config.profile, plan.config.angle_points.into());
    let mut receiver = Receiver::new();
    let mut times = Vec::new();
    let begin = Instant::now();
    frames(&config, |packets| {
        let start = Instant::now();
        for packet in packets {
            // They are the bridge's own, so they decode.
            let _ = receiver.push(packet);
        }
        while let Some(received) = receiver.next() {
            if let (Received::Frame(frame), Some(bartlett)) = (received, &bartlett) {
                black_box(frame.covariance.as_ref().and_then(|c| bartlett.spectrum(c)));
            }
        }
        times.push(start.elapsed());
        begin.elapsed() < FOR
    });
    times.sort_unstable();
    times.get(times.len() / 2).copied().unwrap_or_default()
}
