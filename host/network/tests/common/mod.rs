//! Samples that can be told apart and mean nothing else: the target's reads swing, the maps of each action are bright at
//! places of their own.
#![allow(dead_code, unreachable_pub, reason = "each test uses a part")]

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rfhoi_network::config::{Branch, Encoder, Fusion, NetworkConfig, Temporal};
use rfhoi_network::model::Description;
use rfhoi_network::sample::{Frame, Frames, MAPS, READ_CHANNELS, Runner, SCALARS, Sample, read, scalar};

pub const POINTS: usize = 8;
pub const ANTENNAS: usize = 2;
pub const NAMES: usize = 3;
/// Of the synthetic samples.
pub const ACTIONS: usize = 2;

pub fn config(fusion: Fusion) -> NetworkConfig {
    let branch = |width, stack| Branch {
        width,
        layers: 2,
        heads: 2,
        feed_forward: 2 * width,
        stack,
        temporal: Temporal::Transformer,
    };
    NetworkConfig {
        points: POINTS,
        maps: [true; MAPS],
        antennas: ANTENNAS,
        name_dimensions: NAMES,
        encoder: Encoder::Convolutions { channels: [2, 3], strides: [2, 1], pool: 2 },
        beams: None,
        radar: branch(16, 1),
        tags: branch(12, 2),
        fusion,
        actions: rfhoi_network::config::ACTIONS,
        dropout: 0.0,
    }
}

pub fn describe(config: NetworkConfig) -> Description {
    Description::new(config, serde_json::Value::Null, "bartlett".into(), 0)
}

pub fn names() -> Vec<Vec<f32>> {
    (0..6).map(|n| vec![(n as f32).sin(), (n as f32).cos(), n as f32 / 6.0]).collect()
}

pub fn sample(seed: u64, frames: usize, tags: usize) -> Sample {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let action = rng.random_range(0..ACTIONS);
    let target = rng.random_range(0..tags.max(1));
    let mut made = Frames::new(POINTS, tags, ANTENNAS);
    for number in 0..frames {
        let mut maps: Vec<u8> = (0..MAPS * POINTS * POINTS).map(|_| rng.random_range(0..60)).collect();
        for map in maps.chunks_exact_mut(POINTS * POINTS) {
            map[action * 27 + number % 8] = 255;
        }
        let mut scalars = [1.0; SCALARS];
        scalars[scalar::PEAK] = rng.random();
        scalars[scalar::CELLS] = rng.random();
        let mut reads = vec![0.0; tags * ANTENNAS * READ_CHANNELS];
        for (place, values) in reads.chunks_exact_mut(READ_CHANNELS).enumerate() {
            let swing = if place / ANTENNAS == target { 0.9 } else { 0.05 };
            values[read::DIFFERENCE] = rng.random_range(-swing..swing);
            values[read::KNOWN] = 1.0;
            values[read::TURN] = rng.random_range(-swing..swing);
            values[read::READS] = 0.5;
        }
        made.push(Frame { maps: &maps, scalars: &scalars, reads: &reads, covariance: &[] });
    }
    let objects = (0..tags).map(|tag| tag % 6).collect();
    let target = (tags > 0).then_some(target);
    Sample { frames: made, objects, action: Some(action), target, ..Sample::default() }
}

pub fn vectors(sample: &Sample) -> Vec<f32> {
    let names = names();
    sample.objects.iter().flat_map(|&object| names[object].clone()).collect()
}

/// Answer to a whole sample, a frame at a time.
pub fn run(runner: &mut dyn Runner, sample: &Sample) -> rfhoi_network::sample::Answer {
    runner.clear();
    for number in 0..sample.frames.len() {
        runner.push(sample.frames.frame(number)).unwrap();
    }
    runner.answer(0..sample.frames.len(), &vectors(sample)).unwrap()
}

pub fn farthest(a: &[f32], b: &[f32]) -> f32 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}
