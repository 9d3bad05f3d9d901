//! What each stage of the host takes, frame by frame, on a bridge's packets: in, packets and what features a network takes;
//! out, medians of each stage, and the frames that the network is timed on.

use std::time::Instant;

use anyhow::{Context, ensure};
use rfhoi::align::{AlignError, AlignedFrame, FrameStream};
use rfhoi::features::Settings;
use rfhoi::learn;
use rfhoi::receive::{Received, Receiver};
use rfhoi_network::metrics::median;
use rfhoi_network::sample::{Frame, Frames, Runner};
use rfhoi_shared::config::RadarConfig;
use serde::Serialize;

/// How often the whole recording is taken; the median over all frames counts.
const ROUNDS: usize = 5;
/// Answers that are timed.
pub(super) const ANSWERS: usize = 31;

/// Medians over frames, ms, one thread.
#[derive(Debug, Clone, Copy, Serialize)]
pub(super) struct Stages {
    /// A frame's packets to rows of maps.
    pub(super) receive_ms: f64,
    /// A radar frame's square maps and angle map.
    pub(super) radar_ms: f64,
    /// Phase differences of all tags in a frame.
    pub(super) reads_ms: f64,
    /// A frame as the network takes it.
    pub(super) features_ms: f64,
}

/// What a network takes: medians, ms.
#[derive(Debug, Clone, Copy, Serialize)]
pub(super) struct OfNetwork {
    /// A frame that comes.
    pub(super) frame_ms: f64,
    /// The answer on so many frames that came.
    pub(super) answer_ms: f64,
    pub(super) window_frames: usize,
}

impl Stages {
    /// All of them.
    pub(super) fn sum_ms(&self) -> f64 {
        self.receive_ms + self.radar_ms + self.reads_ms + self.features_ms
    }
}

/// Takes `packets` of a bridge whose radar is configured for `radar`, some times. `go_on` is told the share that is done.
/// Gives the stages' times, the number of frames, and the longest part of them with the same tags.
pub(super) fn measure(
    packets: &[Vec<u8>],
    radar: &RadarConfig,
    settings: Settings,
    mut go_on: impl FnMut(f64) -> bool,
) -> anyhow::Result<(Stages, usize, Frames)> {
    let (mut times, mut kept) = (Times::default(), Vec::new());
    for round in 0..ROUNDS {
        ensure!(go_on(round as f64 / ROUNDS as f64), "stopped");
        let stream = FrameStream::new(settings.stream(radar).map_err(AlignError::from)?)?;
        let mut features = settings.frame_features(radar);
        times.round(packets, stream, |aligned| {
            let frame = features.frame(aligned);
            if round == 0 {
                keep(&mut kept, settings, aligned.phases().tags(), frame);
            }
        });
    }
    let window = kept.into_iter().max_by_key(Frames::len);
    let window = window.context("the recording has no frames of the radar: see `rfhoi inspect`")?;
    let frames = times.features.len() / ROUNDS;
    let stages = Stages {
        receive_ms: median_ms(times.receive),
        radar_ms: median_ms(times.radar),
        reads_ms: median_ms(times.reads),
        features_ms: median_ms(times.features),
    };
    Ok((stages, frames, window))
}

/// Times a network on the first frames of `frames`, up to 6 s, so many times; `vectors` are its tags' names.
pub(super) fn time(
    runner: &mut dyn Runner,
    frames: &Frames,
    vectors: &[f32],
    times: usize,
) -> anyhow::Result<OfNetwork> {
    let window_frames = learn::WINDOW.min(frames.len());
    let (mut pushes, mut answers) = (Vec::new(), Vec::new());
    for _ in 0..times {
        runner.clear();
        for number in 0..window_frames {
            let began = Instant::now();
            runner.push(frames.frame(number))?;
            pushes.push(began.elapsed().as_secs_f64());
        }
        let began = Instant::now();
        runner.answer(0..window_frames, vectors)?;
        answers.push(began.elapsed().as_secs_f64());
    }
    Ok(OfNetwork { frame_ms: median_ms(pushes), answer_ms: median_ms(answers), window_frames })
}

/// Times of stages, s, frame by frame.
#[derive(Debug, Default)]
struct Times {
    receive: Vec<f64>,
    radar: Vec<f64>,
    reads: Vec<f64>,
    features: Vec<f64>,
}

fn median_ms(seconds: Vec<f64>) -> f64 {
    1e3 * median(seconds).unwrap_or(0.0)
}

fn seconds(work: impl FnOnce()) -> f64 {
    let began = Instant::now();
    work();
    began.elapsed().as_secs_f64()
}

impl Times {
    /// Takes a recording once; hands each aligned frame to `take`, whose time is that of its features.
    fn round(&mut self, packets: &[Vec<u8>], mut stream: FrameStream, mut take: impl FnMut(&AlignedFrame)) {
        let mut receiver = Receiver::new();
        let (mut receiving_s, mut reading_s) = (0.0, 0.0);
        for packet in packets {
            let mut next = None;
            // What is no packet is counted by the receiver.
            receiving_s += seconds(|| {
                let _ = receiver.push(packet);
                next = receiver.next();
            });
            let now = receiver.time();
            while let Some(received) = next.take() {
                match received {
                    Received::Frame(frame) => {
                        self.radar.push(seconds(|| stream.push_frame(&frame)));
                        self.receive.push(std::mem::take(&mut receiving_s));
                        receiver.recycle(frame);
                    }
                    other => reading_s += seconds(|| stream.take(&other, now)),
                }
                receiving_s += seconds(|| next = receiver.next());
            }
            reading_s += seconds(|| stream.advance(now));
            while let Some(aligned) = stream.next() {
                self.reads.push(std::mem::take(&mut reading_s));
                self.features.push(seconds(|| take(&aligned)));
                stream.recycle(aligned);
            }
        }
    }
}

/// Frames that follow each other with the same tags.
fn keep(kept: &mut Vec<Frames>, settings: Settings, tags: usize, frame: Frame<'_>) {
    match kept.last_mut().filter(|frames| frames.tags == tags) {
        Some(frames) => frames.push(frame),
        None => {
            let mut frames = Frames::new(settings.points, tags, settings.antennas);
            frames.push(frame);
            kept.push(frames);
        }
    }
}
