//! A running bridge in figures: packets in; rates since the last look, losses and what a person should know out.

use std::collections::BTreeMap;
use std::fmt;
use std::time::Duration;

use rfhoi_shared::tag::Epc;
use rfhoi_shared::units::BridgeTime;
use serde::Serialize;

use super::health::Health;
use crate::receive::{LinkCounts, RadarFrame, Received, Receiver};

/// What came since the last look.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Moment {
    /// Packets of any kind.
    pub packets: u64,
    /// Radar frames a second.
    pub frames_per_s: f64,
    /// Frames with something missing.
    pub frames_with_holes: u64,
    /// Packets that never came.
    pub packets_lost: u64,
    /// Mean time from the arrival of a frame's last bytes at the bridge to its last packet, ms.
    pub latency_mean_ms: Option<f64>,
    /// The longest of these times, ms.
    pub latency_max_ms: Option<f64>,
    /// Range-Doppler cells that moved, in the last frame.
    pub moving_cells: Option<u32>,
    /// Tag reads a second.
    pub reads_per_s: f64,
    /// Reads a second of each tag, by its EPC.
    pub tags_reads_per_s: BTreeMap<String, f64>,
    /// The last telemetry.
    pub health: Option<Health>,
}

/// What came since the beginning.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Totals {
    /// How long it was watched, s.
    pub seconds: f64,
    /// The packets.
    #[serde(flatten)]
    pub link: LinkCounts,
    /// Tag reads.
    pub reads: u64,
    /// Tags that were read.
    pub tags: usize,
    /// Longest time from the arrival of a frame's last bytes at the bridge to its last packet, ms.
    pub latency_max_ms: Option<f64>,
}

#[derive(Debug, Default)]
struct Window {
    frames: u64,
    latencies_us: Vec<u32>,
    moving_cells: Option<u32>,
    reads: BTreeMap<Epc, u64>,
}

/// Follows one bridge.
#[derive(Debug, Default)]
pub struct Live {
    receiver: Receiver,
    window: Window,
    counts_before: LinkCounts,
    reads: BTreeMap<Epc, u64>,
    latency_max_us: Option<u32>,
    telemetry_before: Option<(BridgeTime, u64)>,
    health: Option<Health>,
    restarted: bool,
    notices: Vec<String>,
}

impl Live {
    /// Takes the bytes of one packet.
    pub fn push(&mut self, bytes: &[u8]) {
        // What is wrong is counted.
        let _ = self.receiver.push(bytes);
        while let Some(received) = self.receiver.next() {
            match received {
                Received::Frame(frame) => {
                    self.frame(&frame);
                    self.receiver.recycle(frame);
                }
                Received::Reads(reads) => {
                    for read in reads {
                        *self.reads.entry(read.epc.clone()).or_default() += 1;
                        *self.window.reads.entry(read.epc).or_default() += 1;
                    }
                }
                Received::Telemetry(telemetry) => {
                    let time = self.receiver.time();
                    let health = Health::new(time, &telemetry, self.telemetry_before);
                    if std::mem::take(&mut self.restarted) {
                        self.notices.push(format!("the bridge has restarted: {}", health.restart_reason));
                    }
                    self.telemetry_before = Some((time, telemetry.busy_us));
                    self.health = Some(health);
                }
                Received::Notice(notice) => self.notices.push(notice.text.as_str().to_owned()),
                Received::Restarted => {
                    self.restarted = true;
                    self.telemetry_before = None;
                }
                Received::HopTable(_) | Received::Hello(_) | Received::Config(_) | Received::Ack(_) => {}
            }
        }
    }

    fn frame(&mut self, frame: &RadarFrame) {
        self.window.frames += 1;
        if let Some(info) = frame.info {
            self.window.latencies_us.push(info.latency_us);
            self.window.moving_cells = Some(info.moving_cells);
            self.latency_max_us = self.latency_max_us.max(Some(info.latency_us));
        }
    }

    /// Takes what the bridge wanted a person to know, and its restarts, since the last look.
    pub fn take_notices(&mut self) -> Vec<String> {
        std::mem::take(&mut self.notices)
    }

    /// Takes the last telemetry, if one came since it was taken.
    pub fn take_health(&mut self) -> Option<Health> {
        self.health.take()
    }

    /// What came in the `length` since the last look.
    pub fn look(&mut self, length: Duration) -> Moment {
        let Window { frames, latencies_us, moving_cells, reads } = std::mem::take(&mut self.window);
        let counts = self.receiver.counts();
        let before = std::mem::replace(&mut self.counts_before, counts);
        let seconds = length.as_secs_f64().max(f64::MIN_POSITIVE);
        let rate = |n: u64| n as f64 / seconds;
        let latency_sum: u64 = latencies_us.iter().map(|&l| u64::from(l)).sum();
        let mean_us = |n: usize| (n > 0).then(|| latency_sum as f64 / n as f64);
        Moment {
            packets: counts.packets - before.packets,
            frames_per_s: rate(frames),
            frames_with_holes: counts.frames_with_holes - before.frames_with_holes,
            packets_lost: counts.packets_lost - before.packets_lost,
            latency_mean_ms: mean_us(latencies_us.len()).map(|us| us / 1e3),
            latency_max_ms: latencies_us.iter().max().map(|&us| f64::from(us) / 1e3),
            moving_cells,
            reads_per_s: rate(reads.values().sum()),
            tags_reads_per_s: reads.into_iter().map(|(epc, n)| (epc.to_string(), rate(n))).collect(),
            health: self.health.clone(),
        }
    }

    /// What came in the `length` since the beginning.
    pub fn totals(&self, length: Duration) -> Totals {
        Totals {
            seconds: length.as_secs_f64(),
            link: self.receiver.counts(),
            reads: self.reads.values().sum(),
            tags: self.reads.len(),
            latency_max_ms: self.latency_max_us.map(|us| f64::from(us) / 1e3),
        }
    }
}

impl fmt::Display for Moment {
    /// One line, the tags by the ends of their EPCs.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        /// Digits of an EPC and tags that a line has room for.
        const DIGITS: usize = 4;
        const TAGS: usize = 6;
        if self.packets == 0 {
            return write!(f, "nothing received");
        }
        write!(f, "{:.1} frames/s", self.frames_per_s)?;
        for (count, name) in [(self.frames_with_holes, "with holes"), (self.packets_lost, "packets lost")] {
            if count > 0 {
                write!(f, ", {count} {name}")?;
            }
        }
        if let (Some(mean), Some(max)) = (self.latency_mean_ms, self.latency_max_ms) {
            write!(f, ", latency {mean:.1} ms (at most {max:.1})")?;
        }
        write!(f, " | {:.1} reads/s", self.reads_per_s)?;
        for (epc, rate) in self.tags_reads_per_s.iter().take(TAGS) {
            let end = epc.get(epc.len().saturating_sub(DIGITS)..).unwrap_or(epc);
            write!(f, " ..{end} {rate:.1}")?;
        }
        if self.tags_reads_per_s.len() > TAGS {
            write!(f, " and {} tags more", self.tags_reads_per_s.len() - TAGS)?;
        }
        match &self.health {
            Some(health) => write!(f, " | {health}"),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use rfhoi_shared::tag::TagRead;
    use rfhoi_shared::units::{AntennaPort, CentiDbm, ChannelIndex};
    use rfhoi_shared::wire::{FrameInfo, MAX_PACKET, Message, Notice, RestartReason, Sequencer, Telemetry};

    use super::*;

    fn read(epc: &str) -> TagRead {
        TagRead {
            time: BridgeTime(0),
            epc: Epc::from_hex(epc).unwrap(),
            antenna: AntennaPort(1),
            channel: ChannelIndex(1),
            phase: None,
            rssi: CentiDbm(-5000),
            doppler: None,
        }
    }

    #[test]
    fn rates_losses_and_latency_since_the_last_look() {
        let (mut sequencer, mut live) = (Sequencer::new(1), Live::default());
        let mut send = |live: &mut Live, message, arrives| {
            let packet = sequencer.wrap(BridgeTime(2_000_000), message);
            if arrives {
                live.push(packet.encode(&mut [0; MAX_PACKET]).unwrap());
            }
        };
        let frame =
            |frame, latency_us| Message::Frame(FrameInfo { frame, latency_us, ..FrameInfo::default() });
        for (i, arrives) in [true, true, false, true].into_iter().enumerate() {
            send(&mut live, frame(i as u32, 1000 * (i as u32 + 1)), arrives);
        }
        let reads = ["aa01", "aa02", "aa01"].map(read).into_iter().collect();
        send(&mut live, Message::Tags(reads), true);
        send(&mut live, Message::Telemetry(Telemetry { busy_us: 500_000, ..Telemetry::default() }), true);
        let moment = live.look(Duration::from_millis(500));
        assert_eq!((moment.frames_per_s, moment.packets_lost, moment.frames_with_holes), (6.0, 1, 0));
        assert_eq!((moment.latency_max_ms, moment.latency_mean_ms), (Some(4.0), Some(7.0 / 3.0)));
        assert_eq!((moment.reads_per_s, moment.tags_reads_per_s["aa01"]), (6.0, 4.0));
        assert_eq!(moment.health.as_ref().unwrap().load, 0.25);
        let line = moment.to_string();
        assert!(line.contains("6.0 frames/s, 1 packets lost, latency 2.3 ms"), "{line}");
        assert!(line.contains("..aa01 4.0 ..aa02 2.0"), "{line}");

        let quiet = live.look(Duration::from_secs(1));
        assert_eq!(quiet.to_string(), "nothing received");
        assert_eq!((quiet.frames_per_s, quiet.packets_lost, quiet.latency_max_ms), (0.0, 0, None));
        let totals = live.totals(Duration::from_secs(2));
        assert_eq!((totals.link.frames, totals.reads, totals.tags), (3, 3, 2));
        assert_eq!(totals.latency_max_ms, Some(4.0));
    }

    #[test]
    fn restarts_and_notices_are_told_once() {
        let mut live = Live::default();
        for boot in [1, 2] {
            let mut sequencer = Sequencer::new(boot);
            let telemetry = Telemetry { restart: RestartReason::Watchdog, ..Telemetry::default() };
            let notice = Notice { text: "the reader is occupied".try_into().unwrap() };
            for message in [Message::Telemetry(telemetry), Message::Notice(notice)] {
                live.push(sequencer.wrap(BridgeTime(1), message).encode(&mut [0; MAX_PACKET]).unwrap());
            }
        }
        let want = [
            "the reader is occupied",
            "the bridge has restarted: watchdog: the firmware hung",
            "the reader is occupied",
        ];
        assert_eq!(live.take_notices(), want);
        assert!(live.take_notices().is_empty());
    }
}
