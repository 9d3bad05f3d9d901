//! What telemetry says, in words and shares. In: telemetry with the time of its packet. Out: one object of figures.

use std::fmt;

use rfhoi_shared::radar::RadarProfile;
use rfhoi_shared::units::BridgeTime;
use rfhoi_shared::wire::{Hello, RadarState, ReaderState, RestartReason, Telemetry};
use serde::Serialize;

/// Health of a bridge. Counts are since it started.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Health {
    /// Since it started, s.
    pub up_s: f64,
    /// Share of the time that its processor worked, 0 to 1: since the telemetry before, or since it started.
    pub load: f64,
    /// State of the radar.
    pub radar: &'static str,
    /// State of the link to the reader.
    pub reader: &'static str,
    /// Why it started.
    pub restart_reason: &'static str,
    /// Frames without a hole.
    pub frames_complete: u32,
    /// Frames with a hole.
    pub frames_incomplete: u32,
    /// Frames of which nothing came.
    pub frames_lost: u32,
    /// Frames for which the processor was too slow.
    pub overruns: u32,
    /// Datagrams or serial reads from the radar.
    pub datagrams: u32,
    /// Datagrams that never came.
    pub datagrams_lost: u32,
    /// Datagrams that came twice.
    pub datagrams_duplicate: u32,
    /// Datagrams that came too late.
    pub datagrams_late: u32,
    /// Datagrams that do not belong.
    pub datagrams_malformed: u32,
    /// Times the recorder began anew.
    pub recorder_restarts: u32,
    /// Tag reads forwarded.
    pub reads: u32,
    /// Times the reader's link was lost.
    pub reader_link_losses: u32,
    /// LLRP messages and parameters of unknown type.
    pub llrp_unknown: u32,
    /// LLRP messages that were malformed.
    pub llrp_malformed: u32,
    /// Packets to the host that the network did not take.
    pub uplink_dropped: u32,
    /// Datagrams on the bridge's ports that mean nothing.
    pub strays: u32,
    /// How late the executor of network and devices was while a frame was worked on, at most, in the last second, us.
    pub reception_late_us: u32,
    /// Temperature of the bridge's MCU, degrees Celsius.
    pub bridge_celsius: Option<f64>,
    /// Temperature of the radar, degrees Celsius.
    pub radar_celsius: Option<f64>,
}

impl Health {
    /// What `telemetry` says, sent at `time`; `before` is the time and the working time of the telemetry before it.
    pub fn new(time: BridgeTime, telemetry: &Telemetry, before: Option<(BridgeTime, u64)>) -> Self {
        let Telemetry { frames, datagrams, reader, .. } = telemetry;
        let (since, busy_before) = before.unwrap_or_default();
        let busy_us = telemetry.busy_us.saturating_sub(busy_before);
        let celsius = |tenths: Option<i16>| tenths.map(|t| f64::from(t) / 10.0);
        Self {
            up_s: time.seconds(),
            load: busy_us as f64 / time.since(since).max(1) as f64,
            radar: radar_state(telemetry.radar),
            reader: reader_state(reader.state),
            restart_reason: restart_reason(telemetry.restart),
            frames_complete: frames.complete,
            frames_incomplete: frames.incomplete,
            frames_lost: frames.lost,
            overruns: telemetry.overruns,
            datagrams: datagrams.received,
            datagrams_lost: datagrams.lost,
            datagrams_duplicate: datagrams.duplicate,
            datagrams_late: datagrams.late,
            datagrams_malformed: datagrams.malformed,
            recorder_restarts: datagrams.restarts,
            reads: reader.reads,
            reader_link_losses: reader.link_losses,
            llrp_unknown: reader.unknown,
            llrp_malformed: reader.malformed,
            uplink_dropped: telemetry.uplink_dropped,
            strays: telemetry.strays,
            reception_late_us: telemetry.late_us,
            bridge_celsius: celsius(telemetry.bridge_decicelsius),
            radar_celsius: celsius(telemetry.radar_decicelsius),
        }
    }
}

impl fmt::Display for Health {
    /// One line: states and load, then what is not as it should be.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "radar {}, reader {}, load {:.0} %", self.radar, self.reader, self.load * 100.0)?;
        for (name, celsius) in [("bridge", self.bridge_celsius), ("radar", self.radar_celsius)] {
            if let Some(celsius) = celsius {
                write!(f, ", {name} {celsius:.1} C")?;
            }
        }
        for (count, name) in [
            (self.frames_incomplete, "frames with holes"),
            (self.frames_lost, "frames lost"),
            (self.overruns, "overruns"),
            (self.datagrams_lost, "datagrams lost"),
            (self.reader_link_losses, "losses of the reader"),
            (self.uplink_dropped, "packets dropped"),
        ] {
            if count > 0 {
                write!(f, ", {count} {name}")?;
            }
        }
        Ok(())
    }
}

/// Who a bridge is, for a person.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Identity {
    /// Board.
    pub board: String,
    /// MAC address.
    pub id: String,
    /// Version of its firmware.
    pub firmware: String,
    /// Memory for one gated cube.
    pub cube_bytes: u32,
    /// Fingerprint of the profile in force.
    pub profile_fingerprint: String,
    /// Name of that profile, if it is one of ours.
    pub profile: Option<&'static str>,
}

impl From<&Hello> for Identity {
    fn from(hello: &Hello) -> Self {
        let [major, minor, patch] = hello.firmware;
        Self {
            board: hello.board.as_str().to_owned(),
            id: hello.id.map(|byte| format!("{byte:02x}")).join(":"),
            firmware: format!("{major}.{minor}.{patch}"),
            cube_bytes: hello.cube_bytes,
            profile_fingerprint: format!("{:08x}", hello.profile),
            profile: crate::profile::NAMES
                .into_iter()
                .find(|name| RadarProfile::named(name).is_some_and(|p| p.fingerprint() == hello.profile)),
        }
    }
}

fn radar_state(state: RadarState) -> &'static str {
    match state {
        RadarState::Stopped => "stopped",
        RadarState::Waiting => "waiting to try again",
        RadarState::Recorder => "setting up the DCA1000EVM",
        RadarState::Programming => "being programmed",
        RadarState::Silent => "silent",
        RadarState::Streaming => "streaming",
    }
}

fn reader_state(state: ReaderState) -> &'static str {
    match state {
        ReaderState::None => "not configured",
        ReaderState::Waiting => "waiting to try again",
        ReaderState::Connecting => "connecting",
        ReaderState::Configuring => "being configured",
        ReaderState::Reading => "reading",
        ReaderState::Occupied => "held by another client",
    }
}

fn restart_reason(reason: RestartReason) -> &'static str {
    match reason {
        RestartReason::Unknown => "unknown",
        RestartReason::PowerOn => "power on",
        RestartReason::BrownOut => "supply sagged",
        RestartReason::Pin => "reset button or pin",
        RestartReason::Command => "command or new configuration",
        RestartReason::Watchdog => "watchdog: the firmware hung",
        RestartReason::Panic => "panic: the firmware found an error in itself",
    }
}

#[cfg(test)]
mod tests {
    use rfhoi_shared::wire::{FrameCounts, ReaderCounts};

    use super::*;

    #[test]
    fn load_is_of_the_time_since_the_telemetry_before() {
        let telemetry = |busy_us| Telemetry { busy_us, ..Telemetry::default() };
        let first = Health::new(BridgeTime(4_000_000), &telemetry(1_000_000), None);
        assert_eq!((first.load, first.up_s), (0.25, 4.0));
        let before = Some((BridgeTime(4_000_000), 1_000_000));
        assert_eq!(Health::new(BridgeTime(5_000_000), &telemetry(1_900_000), before).load, 0.9);
    }

    #[test]
    fn the_line_names_what_is_wrong_and_only_that() {
        let mut telemetry = Telemetry {
            radar: RadarState::Streaming,
            reader: ReaderCounts { state: ReaderState::Reading, ..ReaderCounts::default() },
            bridge_decicelsius: Some(415),
            ..Telemetry::default()
        };
        let line = |t: &Telemetry| Health::new(BridgeTime(1_000_000), t, None).to_string();
        assert_eq!(line(&telemetry), "radar streaming, reader reading, load 0 %, bridge 41.5 C");
        telemetry.frames = FrameCounts { complete: 9, incomplete: 2, lost: 0 };
        assert!(line(&telemetry).ends_with(", 2 frames with holes"), "{}", line(&telemetry));
    }

    #[test]
    fn profiles_are_known_by_their_fingerprints() {
        let mut hello = Hello {
            board: Default::default(),
            id: [2, 0, 0, 0xab, 0, 1],
            firmware: [1, 20, 3],
            cube_bytes: 0,
            profile: RadarProfile::fine().fingerprint(),
        };
        let identity = Identity::from(&hello);
        assert_eq!((identity.profile, identity.firmware.as_str()), (Some("fine"), "1.20.3"));
        assert_eq!(identity.id, "02:00:00:ab:00:01");
        hello.profile += 1;
        assert_eq!(Identity::from(&hello).profile, None);
    }
}
