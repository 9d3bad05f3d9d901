//! How long this computer takes for a frame of a plan.

use std::hint::black_box;
use std::time::{Duration, Instant};

use super::uplink::frames;
use super::{Plan, radar};
use crate::align::{FrameStream, Settings};

/// Time over which is measured.
const FOR: Duration = Duration::from_millis(100);

/// The median time that this computer takes from a frame's packets to its three maps; zero where the profile has no angles.
pub fn host_time(plan: &Plan) -> Duration {
    let config = radar(&plan.config, &plan.needs);
    let settings = Settings { points: plan.config.map_points.into(), ..Settings::new(config.clone()) };
    let Ok(mut stream) = FrameStream::new(settings) else { return Duration::ZERO };
    let mut times = Vec::new();
    let begin = Instant::now();
    frames(&config, |packets| {
        let start = Instant::now();
        for packet in packets {
            // They are the bridge's own, so they decode.
            let _ = stream.push(packet);
        }
        while let Some(frame) = stream.next() {
            stream.recycle(black_box(frame));
        }
        times.push(start.elapsed());
        begin.elapsed() < FOR
    });
    times.sort_unstable();
    times.get(times.len() / 2).copied().unwrap_or_default()
}
