//! What the host may set on a bridge. A configuration is taken or refused as a whole.

use core::fmt;

use heapless::Vec;
use serde::{Deserialize, Serialize};

use crate::radar::{MAX_GATE_BINS, ProfileError, RadarProfile, RangeGate};
use crate::scene::{Scene, Unmet};
use crate::units::{AntennaPort, Decibels, Seconds};

/// Antenna ports of a reader, at most (Impinj R420: 4; with hubs more, which a scene does not need).
pub const MAX_READER_ANTENNAS: usize = 4;
/// Pause between datagrams that a DCA1000EVM takes, us (SPRUIJ4A, table 19).
pub const PACKET_DELAY_US: core::ops::RangeInclusive<u16> = 5..=500;
/// Pause with which a 100 Mbit/s port behind a switch keeps up: a datagram of 1466 bytes has 1532 on the wire (8 UDP, 20
/// IP, 18 Ethernet, 20 preamble and gap), 122.6 us at 100 Mbit/s and 12.3 us at the recorder's 1 Gbit/s, so from 111 us on
/// nothing piles up in the switch. At this one a frame of `fine` leaves in 69 ms of 100.
pub const DEFAULT_PACKET_DELAY_US: u16 = 115;
/// TCP port of LLRP (IANA).
pub const LLRP_PORT: u16 = 5084;

/// An IPv4 address.
pub type Ipv4 = [u8; 4];

/// Everything that a bridge needs to know.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct BridgeConfig {
    /// The bridge's own address.
    pub address: Address,
    /// Where heatmaps, reads and telemetry go; `None` until a host has said hello.
    pub host: Option<Endpoint>,
    /// Radar and its signal processing.
    pub radar: RadarConfig,
    /// Reader, where there is one.
    pub reader: Option<ReaderConfig>,
    /// The scene that both serve.
    pub scene: Scene,
}

/// How the bridge gets its address.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Address {
    /// By DHCP.
    Dhcp,
    /// Fixed.
    Static {
        /// Address of the bridge.
        address: Ipv4,
        /// Length of the network's prefix in bits.
        prefix: u8,
        /// Router, if any.
        gateway: Option<Ipv4>,
    },
}

/// An address and a port.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Endpoint {
    /// IPv4 address.
    pub address: Ipv4,
    /// UDP or TCP port.
    pub port: u16,
}

/// Radar and its signal processing.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct RadarConfig {
    /// What the radar is programmed with.
    pub profile: RadarProfile,
    /// How its data arrives.
    pub input: RadarInput,
    /// What the bridge makes of it.
    pub processing: Processing,
}

/// The radar's data path.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum RadarInput {
    /// Raw samples over LVDS and a DCA1000EVM.
    Dca1000 {
        /// Address of the DCA1000EVM's FPGA, 192.168.33.180 by default.
        address: Ipv4,
        /// Pause between its datagrams, us; 5 to 500.
        packet_delay_us: u16,
    },
    /// Processed data over the UART of the SDK demo (TLV frames).
    Uart,
}

/// Removal of what does not move.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ClutterRemoval {
    /// None.
    Off,
    /// Subtracts the mean over a frame's loops, weighted by the Doppler window, per virtual antenna and range bin. Erases
    /// people who sit still.
    Mean,
    /// Subtracts an exponential average of the frames' means, so that only what stays for much longer than the
    /// time constant is erased.
    Background {
        /// Time constant.
        time_constant: Seconds,
    },
}

/// Settings of the bridge's signal processing.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Processing {
    /// Range bins that are kept.
    pub gate: RangeGate,
    /// Removal of static clutter.
    pub clutter: ClutterRemoval,
    /// Columns of the range-time map of one frame: loops are averaged in this many groups. A power of two.
    pub range_time_columns: u16,
    /// How far a range-Doppler cell must rise over its row's noise to count as moving.
    pub detection: Decibels,
    /// Doppler bins on either side of zero that never count as moving.
    pub zero_doppler_guard: u8,
}

impl Processing {
    /// The defaults for `profile` and `scene`.
    ///
    /// # Errors
    /// If the profile does not see the scene.
    pub fn for_scene(profile: &RadarProfile, scene: &Scene) -> Result<Self, Unmet> {
        Ok(Self::with_gate(profile, scene.gate(profile)?))
    }

    /// The defaults for `profile` with this gate.
    pub fn with_gate(profile: &RadarProfile, gate: RangeGate) -> Self {
        // A mean over fewer loops takes much of a slow mover away too.
        const MIN_LOOPS_FOR_MEAN: u16 = 8;
        // Within a frame's 13 ms a hand stays in its bin: more columns than this show no more.
        const COLUMNS: u16 = 8;
        let clutter = if profile.loops >= MIN_LOOPS_FOR_MEAN {
            ClutterRemoval::Mean
        } else {
            ClutterRemoval::Background { time_constant: Seconds(10.0) }
        };
        Self {
            gate,
            clutter,
            range_time_columns: COLUMNS.min(profile.loops),
            detection: Decibels(12.0),
            zero_doppler_guard: 1,
        }
    }
}

/// How the reader reads.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ReaderConfig {
    /// LLRP server, port [`LLRP_PORT`] by default.
    pub endpoint: Endpoint,
    /// Antenna ports in use, counted from 1.
    pub antennas: Vec<AntennaPort, MAX_READER_ANTENNAS>,
    /// Index into the reader's table of transmit powers, 0 for its default.
    pub power_index: u16,
    /// RF mode; Impinj's 0 is maximum throughput, 1000 and up choose by themselves.
    pub rf_mode: u16,
    /// Gen2 session, 0 to 3. Session 1 with dual target keeps reading tags that stay in the field.
    pub session: u8,
    /// Impinj search mode: 1 single target, 2 dual target, 3 single target with suppression.
    pub search_mode: u16,
    /// Expected tags, which sets the first inventory round's slots.
    pub population: u16,
    /// Period of the reader's keepalives, ms; a link silent for three of them is taken as lost.
    pub keepalive_ms: u32,
}

impl ReaderConfig {
    /// The defaults for a reader at `address` in `scene`.
    pub fn for_scene(address: Ipv4, scene: &Scene) -> Self {
        Self {
            endpoint: Endpoint { address, port: LLRP_PORT },
            antennas: (1..=u16::from(scene.reader_antennas))
                .map(AntennaPort)
                .take(MAX_READER_ANTENNAS)
                .collect(),
            power_index: 0,
            rf_mode: 0,
            session: 1,
            search_mode: 2,
            population: u16::from(scene.tags).max(1),
            keepalive_ms: 5_000,
        }
    }
}

/// Why a configuration is refused.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ConfigError {
    /// The radar profile breaks a rule.
    Profile(ProfileError),
    /// The profile does not see the scene.
    Scene(Unmet),
    /// The gate is empty, reaches past the profile's range bins, or, of raw samples, has more than [`MAX_GATE_BINS`].
    Gate(RangeGate),
    /// The gated cube needs more bytes than this bridge has.
    CubeTooLarge {
        /// Bytes of one gated cube.
        needed: u32,
        /// Bytes of the bridge's cube memory.
        available: u32,
    },
    /// A chirp has more bytes than this bridge can collect.
    ChirpTooLarge {
        /// Bytes of one chirp of one receiver.
        needed: u32,
        /// Bytes of the bridge's buffer.
        available: u32,
    },
    /// Columns of the range-time map must be a power of two, at most the loops.
    RangeTimeColumns(u16),
    /// Mean removal with a single loop leaves nothing.
    MeanOfOneLoop,
    /// A number that must be finite and positive is not.
    NotPositive,
    /// Packet delay of the DCA1000EVM outside 5 to 500 us.
    PacketDelay(u16),
    /// No antenna of the reader, or port 0.
    ReaderAntennas,
    /// Gen2 sessions are 0 to 3.
    Session(u8),
    /// Keepalive period under 100 ms.
    Keepalive(u32),
    /// A network prefix has at most 32 bits.
    Prefix(u8),
}

impl fmt::Display for ConfigError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Profile(e) => write!(f, "radar profile: {e}"),
            Self::Scene(e) => write!(f, "{e}"),
            Self::Gate(g) => write!(
                f,
                "range gate of {} bins from bin {}: need 1 to {MAX_GATE_BINS} of raw samples, and none past the profile's last bin",
                g.bins, g.first
            ),
            Self::CubeTooLarge { needed, available } => {
                write!(f, "the gated cube needs {needed} bytes, the bridge has {available}")
            }
            Self::ChirpTooLarge { needed, available } => {
                write!(f, "a chirp has {needed} bytes a receiver, the bridge collects {available}")
            }
            Self::RangeTimeColumns(n) => {
                write!(f, "{n} range-time columns: need a power of two, at most the loops of a frame")
            }
            Self::MeanOfOneLoop => {
                write!(f, "mean clutter removal needs two loops or more; use the background")
            }
            Self::NotPositive => {
                write!(f, "depth, speeds, detection and time constant must be finite and above zero")
            }
            Self::PacketDelay(us) => write!(f, "packet delay of {us} us: the DCA1000EVM takes 5 to 500"),
            Self::ReaderAntennas => {
                write!(f, "the reader needs antenna ports, counted from 1, each named once")
            }
            Self::Session(s) => write!(f, "Gen2 session {s}: need 0 to 3"),
            Self::Keepalive(ms) => write!(f, "keepalive of {ms} ms: need 100 or more"),
            Self::Prefix(p) => write!(f, "network prefix of {p} bits: need at most 32"),
        }
    }
}

impl core::error::Error for ConfigError {}

impl RadarConfig {
    /// Checks the profile and what is made of it; `cube_bytes` is the memory that the bridge has for one cube.
    ///
    /// # Errors
    /// The first rule that is broken.
    pub fn validate(&self, cube_bytes: u32) -> Result<(), ConfigError> {
        let Self { profile, input, processing } = self;
        profile.validate().map_err(ConfigError::Profile)?;
        let gate = processing.gate;
        let past_end = u32::from(gate.first) + u32::from(gate.bins) > u32::from(profile.range_bins());
        // Raw samples need memory for each bin; what comes over the UART is passed on.
        let too_many = matches!(input, RadarInput::Dca1000 { .. }) && usize::from(gate.bins) > MAX_GATE_BINS;
        if gate.bins == 0 || too_many || past_end {
            return Err(ConfigError::Gate(gate));
        }
        let needed = profile.cube_bytes(gate);
        if needed > cube_bytes {
            return Err(ConfigError::CubeTooLarge { needed, available: cube_bytes });
        }
        let columns = processing.range_time_columns;
        if !columns.is_power_of_two() || columns > profile.loops {
            return Err(ConfigError::RangeTimeColumns(columns));
        }
        match processing.clutter {
            ClutterRemoval::Mean if profile.loops < 2 => return Err(ConfigError::MeanOfOneLoop),
            ClutterRemoval::Background { time_constant } => positive(time_constant.0)?,
            _ => {}
        }
        positive(processing.detection.0)?;
        match *input {
            RadarInput::Dca1000 { packet_delay_us, .. } if !PACKET_DELAY_US.contains(&packet_delay_us) => {
                Err(ConfigError::PacketDelay(packet_delay_us))
            }
            _ => Ok(()),
        }
    }
}

impl ReaderConfig {
    /// Checks the reader's settings.
    ///
    /// # Errors
    /// The first rule that is broken.
    pub fn validate(&self) -> Result<(), ConfigError> {
        let twice = |(i, port): (usize, &AntennaPort)| self.antennas.iter().skip(i + 1).any(|p| p == port);
        if self.antennas.is_empty()
            || self.antennas.contains(&AntennaPort(0))
            || self.antennas.iter().enumerate().any(twice)
        {
            return Err(ConfigError::ReaderAntennas);
        }
        if self.session > 3 {
            return Err(ConfigError::Session(self.session));
        }
        if self.keepalive_ms < 100 {
            return Err(ConfigError::Keepalive(self.keepalive_ms));
        }
        Ok(())
    }
}

impl BridgeConfig {
    /// Checks the whole; `cube_bytes` is the memory that the bridge has for one cube.
    ///
    /// # Errors
    /// The first rule that is broken.
    pub fn validate(&self, cube_bytes: u32) -> Result<(), ConfigError> {
        let scene = &self.scene;
        for value in [scene.depth.0, scene.fastest_hand.0, scene.fastest_tag.0] {
            positive(value)?;
        }
        self.radar.validate(cube_bytes)?;
        scene.gate(&self.radar.profile).map_err(ConfigError::Scene)?;
        if let Some(reader) = &self.reader {
            reader.validate()?;
        }
        match self.address {
            Address::Static { prefix, .. } if prefix > 32 => Err(ConfigError::Prefix(prefix)),
            _ => Ok(()),
        }
    }
}

fn positive(value: f32) -> Result<(), ConfigError> {
    if value.is_finite() && value > 0.0 { Ok(()) } else { Err(ConfigError::NotPositive) }
}

impl Default for BridgeConfig {
    /// The `bridge` profile on the default scene, a DCA1000EVM at its factory address, no reader.
    fn default() -> Self {
        let scene = Scene::default();
        let profile = RadarProfile::bridge();
        let gate = profile.gate_to(scene.depth);
        Self {
            // The DCA1000EVM sends to this address unless its EEPROM says otherwise (SPRUIJ4A, 2.3).
            address: Address::Static { address: [192, 168, 33, 30], prefix: 24, gateway: None },
            host: None,
            radar: RadarConfig {
                processing: Processing::with_gate(&profile, gate),
                profile,
                input: RadarInput::Dca1000 {
                    address: [192, 168, 33, 180],
                    packet_delay_us: DEFAULT_PACKET_DELAY_US,
                },
            },
            reader: None,
            scene,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::{Metres, MetresPerSecond};

    const CUBE: u32 = 256 * 1024;

    fn refused(change: impl FnOnce(&mut BridgeConfig)) -> ConfigError {
        let mut config = BridgeConfig { reader: Some(reader()), ..BridgeConfig::default() };
        assert_eq!(config.validate(CUBE), Ok(()));
        change(&mut config);
        config.validate(CUBE).expect_err("the changed configuration is wrong")
    }

    fn reader() -> ReaderConfig {
        ReaderConfig::for_scene([192, 168, 33, 40], &Scene::default())
    }

    #[test]
    fn every_rule_refuses() {
        use ConfigError as E;
        let gate = |first, bins| RangeGate { first, bins };
        assert_eq!(refused(|c| c.radar.profile.samples = 100), E::Profile(ProfileError::Samples(100)));
        assert!(matches!(refused(|c| c.scene.depth = Metres(8.0)), E::Scene(Unmet::Depth { .. })));
        assert_eq!(refused(|c| c.radar.processing.gate = gate(100, 72)), E::Gate(gate(100, 72)));
        assert_eq!(refused(|c| c.radar.processing.gate = gate(0, 0)), E::Gate(gate(0, 0)));
        assert_eq!(
            refused(|c| c.radar.processing.gate = gate(0, 128)),
            E::CubeTooLarge { needed: 393_216, available: CUBE }
        );
        assert_eq!(refused(|c| c.radar.processing.range_time_columns = 3), E::RangeTimeColumns(3));
        assert_eq!(refused(|c| c.radar.processing.range_time_columns = 128), E::RangeTimeColumns(128));
        assert_eq!(
            refused(|c| {
                c.radar.profile.loops = 1;
                c.radar.processing.range_time_columns = 1;
            }),
            E::MeanOfOneLoop
        );
        assert_eq!(refused(|c| c.scene.fastest_tag = MetresPerSecond(f32::NAN)), E::NotPositive);
        assert_eq!(refused(|c| c.radar.processing.detection = Decibels(0.0)), E::NotPositive);
        let background = ClutterRemoval::Background { time_constant: Seconds(-1.0) };
        assert_eq!(refused(|c| c.radar.processing.clutter = background), E::NotPositive);
        let input = RadarInput::Dca1000 { address: [0; 4], packet_delay_us: 4 };
        assert_eq!(refused(|c| c.radar.input = input), E::PacketDelay(4));
        let set = |edit: fn(&mut ReaderConfig)| {
            refused(|c| {
                let mut r = reader();
                edit(&mut r);
                c.reader = Some(r);
            })
        };
        assert_eq!(set(|r| r.antennas.clear()), E::ReaderAntennas);
        assert_eq!(set(|r| r.antennas = [AntennaPort(0)].into_iter().collect()), E::ReaderAntennas);
        assert_eq!(set(|r| r.antennas = [AntennaPort(2); 2].into_iter().collect()), E::ReaderAntennas);
        assert_eq!(set(|r| r.session = 4), E::Session(4));
        assert_eq!(set(|r| r.keepalive_ms = 99), E::Keepalive(99));
        let address = Address::Static { address: [10, 0, 0, 1], prefix: 33, gateway: None };
        assert_eq!(refused(|c| c.address = address), E::Prefix(33));
    }
}
