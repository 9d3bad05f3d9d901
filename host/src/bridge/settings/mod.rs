//! The configuration of a bridge as a file that a person edits: TOML, units in the names of the keys.
//!
//! In: the text, or a [`BridgeConfig`]. Out: the other one. A key that is left away has the value that follows from the
//! others (the range gate from the scene's depth, the processing from the loops), so that a file says only what is
//! special; [`Settings::of`] says everything, and [`write`](write()) writes what is not special as comments.

mod values;
mod write;

use std::path::{Path, PathBuf};

use rfhoi_firmware::mmwave::cfg::Board;
use rfhoi_shared::config::{
    Address, BridgeConfig, ClutterRemoval, ConfigError, Processing, RadarConfig, RadarInput, ReaderConfig,
};
use rfhoi_shared::radar::{RadarProfile, RangeGate};
use rfhoi_shared::scene::Scene;
use rfhoi_shared::units::{AntennaPort, Decibels, Metres, MetresPerSecond, Seconds};
use serde::{Deserialize, Serialize};

pub use values::{Clutter, Input, NetworkAddress, ReaderAddress, Samples, Slot};
#[cfg(test)]
pub(crate) use write::explained;
pub use write::write;

use crate::profile::{self, BoardName, MOUNTINGS, NAMES, ProfileFileError};

/// Why a file is no configuration.
#[derive(Debug, thiserror::Error)]
pub enum SettingsError {
    /// It cannot be read.
    #[error("cannot read {path}: {source}; `rfhoi bridge config --out {path}` writes one to start from")]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// It is not TOML, or has a wrong key or value.
    #[error("{path}: line {line}: {message}")]
    Parse {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// What is wrong.
        message: String,
    },
    /// The radar profile that it names.
    #[error("{path}: base of [profile]: {error}")]
    Profile {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        error: ProfileFileError,
    },
    /// A value does not fit or means nothing.
    #[error("{path}: {key}: {reason}")]
    Value {
        /// The file.
        path: PathBuf,
        /// Section and key.
        key: &'static str,
        /// What is wrong.
        reason: String,
    },
    /// It breaks a rule of bridges.
    #[error("{path}: {error}: correct {}", place(.error))]
    Invalid {
        /// The file.
        path: PathBuf,
        /// The rule.
        error: ConfigError,
    },
}

/// A configuration as it is written. What is `None` follows from the rest.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// The bridge's place in the network.
    pub network: NetworkSettings,
    /// The way of the radar's data.
    pub radar: RadarSettings,
    /// What the radar is programmed with.
    pub profile: ProfileSettings,
    /// What the bridge makes of it.
    pub processing: ProcessingSettings,
    /// The scene.
    pub scene: SceneSettings,
    /// The reader; without this section there is none.
    pub reader: Option<ReaderSettings>,
}

/// Section `network`: [`BridgeConfig::address`] and [`BridgeConfig::host`].
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[allow(missing_docs, reason = "keys are documented in write.rs, for users")]
pub struct NetworkSettings {
    pub address: Option<NetworkAddress>,
    pub gateway: Option<std::net::Ipv4Addr>,
    pub host: Option<std::net::SocketAddrV4>,
}

/// Section `radar`: [`RadarInput`].
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[allow(missing_docs, reason = "keys are documented in write.rs, for users")]
pub struct RadarSettings {
    pub input: Option<Input>,
    pub dca1000_address: Option<std::net::Ipv4Addr>,
    pub packet_delay_us: Option<u16>,
}

/// Section `profile`: [`RadarProfile`].
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[allow(missing_docs, reason = "keys are documented in write.rs, for users")]
pub struct ProfileSettings {
    pub base: Option<String>,
    pub board: Option<BoardName>,
    pub quarter_turns: Option<u8>,
    pub receivers: Option<Vec<u8>>,
    pub transmitters: Option<Vec<Slot>>,
    pub samples: Option<u16>,
    pub sample_rate_ksps: Option<u32>,
    pub sample_format: Option<Samples>,
    pub loops: Option<u16>,
    pub frame_period_us: Option<u32>,
    pub start_khz: Option<u32>,
    pub slope_khz_per_us: Option<u32>,
    pub idle_ns: Option<u32>,
    pub adc_start_ns: Option<u32>,
    pub ramp_end_ns: Option<u32>,
}

/// Section `processing`: [`Processing`].
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[allow(missing_docs, reason = "keys are documented in write.rs, for users")]
pub struct ProcessingSettings {
    pub gate_first_bin: Option<u16>,
    pub gate_bins: Option<u16>,
    pub clutter: Option<Clutter>,
    pub clutter_time_constant_s: Option<f32>,
    pub range_time_columns: Option<u16>,
    pub detection_db: Option<f32>,
    pub zero_doppler_guard_bins: Option<u8>,
}

/// Section `scene`: [`Scene`].
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[allow(missing_docs, reason = "keys are documented in write.rs, for users")]
pub struct SceneSettings {
    pub depth_m: Option<f32>,
    pub fastest_hand_m_per_s: Option<f32>,
    pub fastest_tag_m_per_s: Option<f32>,
    pub tags: Option<u8>,
    pub reader_antennas: Option<u8>,
}

/// Section `reader`: [`ReaderConfig`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs, reason = "keys are documented in write.rs, for users")]
pub struct ReaderSettings {
    pub address: ReaderAddress,
    pub antennas: Option<Vec<u16>>,
    pub power_index: Option<u16>,
    pub rf_mode: Option<u16>,
    pub session: Option<u8>,
    pub search_mode: Option<u16>,
    pub population: Option<u16>,
    pub keepalive_ms: Option<u32>,
}

/// The configuration in the file at `path`. Radar profiles are looked for beside it.
///
/// # Errors
/// If it cannot be read, or has a wrong key or value. Rules of bridges are checked by [`check`].
pub fn read(path: &Path) -> Result<BridgeConfig, SettingsError> {
    let text = std::fs::read_to_string(path)
        .map_err(|source| SettingsError::Read { path: path.to_path_buf(), source })?;
    Settings::parse(path, &text)?.config(path)
}

/// Checks `config`, read from `path`, for a bridge with this memory.
///
/// # Errors
/// [`SettingsError::Invalid`].
pub fn check(path: &Path, config: &BridgeConfig, cube_bytes: u32) -> Result<(), SettingsError> {
    config.validate(cube_bytes).map_err(|error| SettingsError::Invalid { path: path.to_path_buf(), error })
}

impl Settings {
    /// Parses `text`, which was read from `path`.
    ///
    /// # Errors
    /// [`SettingsError::Parse`].
    pub fn parse(path: &Path, text: &str) -> Result<Self, SettingsError> {
        toml::from_str(text).map_err(|error| {
            let offset = error.span().map_or(0, |s| s.start).min(text.len());
            SettingsError::Parse {
                path: path.to_path_buf(),
                line: 1 + text.as_bytes()[..offset].iter().filter(|&&b| b == b'\n').count(),
                message: error.message().replace('\n', ", "),
            }
        })
    }

    /// The configuration that was read from `path`, its gaps filled.
    ///
    /// # Errors
    /// If a value does not fit.
    pub fn config(&self, path: &Path) -> Result<BridgeConfig, SettingsError> {
        let wrong = |key, reason: String| SettingsError::Value { path: path.to_path_buf(), key, reason };
        let default = BridgeConfig::default();
        let scene = self.scene.over(default.scene);
        let profile = self.profile.load(path)?;
        let input = self.radar.input().map_err(|(key, reason)| wrong(key, reason))?;
        let processing =
            self.processing.over(&profile, &scene).map_err(|(key, reason)| wrong(key, reason))?;
        let reader = match &self.reader {
            Some(reader) => Some(reader.over(&scene).map_err(|(key, reason)| wrong(key, reason))?),
            None => None,
        };
        let address = match (self.network.address, self.network.gateway) {
            (Some(NetworkAddress::Dhcp), Some(_)) => {
                return Err(wrong("network.gateway", "DHCP brings its own; leave it away".into()));
            }
            (Some(NetworkAddress::Dhcp), None) => Address::Dhcp,
            (Some(NetworkAddress::Static { address, prefix }), gateway) => {
                Address::Static { address: address.octets(), prefix, gateway: gateway.map(|g| g.octets()) }
            }
            (None, Some(_)) => {
                return Err(wrong("network.gateway", "has no meaning without network.address".into()));
            }
            (None, None) => default.address,
        };
        Ok(BridgeConfig {
            address,
            host: self.network.host.map(values::endpoint),
            radar: RadarConfig { profile, input, processing },
            reader,
            scene,
        })
    }

    /// All of `config`, with nothing left to follow from the rest.
    pub fn of(config: &BridgeConfig) -> Self {
        let BridgeConfig { address, host, radar, reader, scene } = config;
        let (address, gateway) = match *address {
            Address::Dhcp => (NetworkAddress::Dhcp, None),
            Address::Static { address, prefix, gateway } => {
                (NetworkAddress::Static { address: address.into(), prefix }, gateway.map(Into::into))
            }
        };
        let (input, dca1000) = match radar.input {
            RadarInput::Dca1000 { address, packet_delay_us } => {
                (Input::Dca1000, Some((address, packet_delay_us)))
            }
            RadarInput::Uart => (Input::Uart, None),
        };
        Self {
            network: NetworkSettings {
                address: Some(address),
                gateway,
                host: host.map(|h| values::socket_address(&h)),
            },
            radar: RadarSettings {
                input: Some(input),
                dca1000_address: dca1000.map(|(address, _)| address.into()),
                packet_delay_us: dca1000.map(|(_, delay)| delay),
            },
            profile: ProfileSettings::of(&radar.profile),
            processing: ProcessingSettings::of(&radar.processing),
            scene: SceneSettings {
                depth_m: Some(scene.depth.0),
                fastest_hand_m_per_s: Some(scene.fastest_hand.0),
                fastest_tag_m_per_s: Some(scene.fastest_tag.0),
                tags: Some(scene.tags),
                reader_antennas: Some(scene.reader_antennas),
            },
            reader: reader.as_ref().map(ReaderSettings::of),
        }
    }
}

/// A key and what is wrong with its value.
type Wrong = (&'static str, String);

impl RadarSettings {
    fn input(&self) -> Result<RadarInput, Wrong> {
        let RadarInput::Dca1000 { address, packet_delay_us } = BridgeConfig::default().radar.input else {
            return Ok(RadarInput::Uart);
        };
        let unused = |key| Err((key, "has no meaning with radar.input = \"uart\"; leave it away".to_owned()));
        match self.input.unwrap_or(Input::Dca1000) {
            Input::Dca1000 => Ok(RadarInput::Dca1000 {
                address: self.dca1000_address.map_or(address, |a| a.octets()),
                packet_delay_us: self.packet_delay_us.unwrap_or(packet_delay_us),
            }),
            Input::Uart if self.dca1000_address.is_some() => unused("radar.dca1000_address"),
            Input::Uart if self.packet_delay_us.is_some() => unused("radar.packet_delay_us"),
            Input::Uart => Ok(RadarInput::Uart),
        }
    }
}

impl ProfileSettings {
    /// The profile of the file at `path`.
    ///
    /// # Errors
    /// [`SettingsError::Profile`] of the base, [`SettingsError::Value`] of any other key.
    pub(crate) fn load(&self, path: &Path) -> Result<RadarProfile, SettingsError> {
        let wrong = |(key, reason)| SettingsError::Value { path: path.to_path_buf(), key, reason };
        let turns = usize::from(self.quarter_turns.unwrap_or(0));
        let mounting = *MOUNTINGS
            .get(turns)
            .ok_or_else(|| wrong(("profile.quarter_turns", format!("{turns}: need 0 to 3"))))?;
        let board = Board { array: self.board.map_or_else(Default::default, Into::into), mounting };
        let base = self.base.as_deref().unwrap_or(DEFAULT_BASE);
        let beside = path.parent().unwrap_or(Path::new("")).join(base);
        let source = if NAMES.contains(&base) { base.into() } else { beside.to_string_lossy() };
        let profile = profile::load(&source, board)
            .map_err(|error| SettingsError::Profile { path: path.to_path_buf(), error })?;
        self.over(profile).map_err(wrong)
    }

    fn over(&self, base: RadarProfile) -> Result<RadarProfile, Wrong> {
        let tx_order = match &self.transmitters {
            Some(slots) => values::tx_order(slots).map_err(|e| ("profile.transmitters", e))?,
            None => base.tx_order,
        };
        let rx_mask = match &self.receivers {
            Some(numbers) => values::mask(numbers).map_err(|e| ("profile.receivers", e))?,
            None => base.rx_mask,
        };
        Ok(RadarProfile {
            start_khz: self.start_khz.unwrap_or(base.start_khz),
            slope_khz_per_us: self.slope_khz_per_us.unwrap_or(base.slope_khz_per_us),
            idle_ns: self.idle_ns.unwrap_or(base.idle_ns),
            adc_start_ns: self.adc_start_ns.unwrap_or(base.adc_start_ns),
            ramp_end_ns: self.ramp_end_ns.unwrap_or(base.ramp_end_ns),
            samples: self.samples.unwrap_or(base.samples),
            sample_rate_ksps: self.sample_rate_ksps.unwrap_or(base.sample_rate_ksps),
            format: self.sample_format.map_or(base.format, Into::into),
            rx_mask,
            tx_order,
            loops: self.loops.unwrap_or(base.loops),
            frame_period_us: self.frame_period_us.unwrap_or(base.frame_period_us),
            // The board's, already in the base.
            array: base.array,
            mounting: base.mounting,
        })
    }

    fn of(profile: &RadarProfile) -> Self {
        let turns = MOUNTINGS.iter().position(|&m| m == profile.mounting).unwrap_or(0);
        Self {
            base: Some(nearest(profile).to_owned()),
            board: Some(profile.array.into()),
            quarter_turns: Some(turns as u8),
            receivers: Some(values::numbers(profile.rx_mask)),
            transmitters: Some(profile.tx_order.iter().map(|&mask| Slot::of(mask)).collect()),
            samples: Some(profile.samples),
            sample_rate_ksps: Some(profile.sample_rate_ksps),
            sample_format: Some(profile.format.into()),
            loops: Some(profile.loops),
            frame_period_us: Some(profile.frame_period_us),
            start_khz: Some(profile.start_khz),
            slope_khz_per_us: Some(profile.slope_khz_per_us),
            idle_ns: Some(profile.idle_ns),
            adc_start_ns: Some(profile.adc_start_ns),
            ramp_end_ns: Some(profile.ramp_end_ns),
        }
    }
}

/// Name of the profile where none is given: [`RadarProfile::default`].
const DEFAULT_BASE: &str = "bridge";

/// Name of the profile that shares samples, rate and loops with `profile`, or of the default.
fn nearest(profile: &RadarProfile) -> &'static str {
    let key = |p: &RadarProfile| (p.samples, p.sample_rate_ksps, p.loops);
    let same = |name: &&str| RadarProfile::named(name).is_some_and(|p| key(&p) == key(profile));
    NAMES.into_iter().find(same).unwrap_or(DEFAULT_BASE)
}

impl ProcessingSettings {
    fn over(&self, profile: &RadarProfile, scene: &Scene) -> Result<Processing, Wrong> {
        let default = default_processing(profile, scene);
        let gate = default.gate;
        let clutter = match (self.clutter, self.clutter_time_constant_s) {
            (None, None) => default.clutter,
            (None, Some(_)) | (Some(Clutter::Off | Clutter::Mean), Some(_)) => {
                let reason = "has meaning only with processing.clutter = \"background\"".to_owned();
                return Err(("processing.clutter_time_constant_s", reason));
            }
            (Some(Clutter::Off), None) => ClutterRemoval::Off,
            (Some(Clutter::Mean), None) => ClutterRemoval::Mean,
            (Some(Clutter::Background), seconds) => {
                ClutterRemoval::Background { time_constant: Seconds(seconds.unwrap_or(TIME_CONSTANT_S)) }
            }
        };
        Ok(Processing {
            gate: RangeGate {
                first: self.gate_first_bin.unwrap_or(gate.first),
                bins: self.gate_bins.unwrap_or(gate.bins),
            },
            clutter,
            range_time_columns: self.range_time_columns.unwrap_or(default.range_time_columns),
            detection: self.detection_db.map_or(default.detection, Decibels),
            zero_doppler_guard: self.zero_doppler_guard_bins.unwrap_or(default.zero_doppler_guard),
        })
    }

    fn of(processing: &Processing) -> Self {
        let (clutter, time_constant) = match processing.clutter {
            ClutterRemoval::Off => (Clutter::Off, None),
            ClutterRemoval::Mean => (Clutter::Mean, None),
            ClutterRemoval::Background { time_constant } => (Clutter::Background, Some(time_constant.0)),
        };
        Self {
            gate_first_bin: Some(processing.gate.first),
            gate_bins: Some(processing.gate.bins),
            clutter: Some(clutter),
            clutter_time_constant_s: time_constant,
            range_time_columns: Some(processing.range_time_columns),
            detection_db: Some(processing.detection.0),
            zero_doppler_guard_bins: Some(processing.zero_doppler_guard),
        }
    }
}

/// Time constant of the background where none is given, s.
const TIME_CONSTANT_S: f32 = 10.0;

/// What follows from a profile and a scene; an empty gate where the profile itself is wrong, which [`check`] tells.
fn default_processing(profile: &RadarProfile, scene: &Scene) -> Processing {
    let gate = match profile.validate() {
        Ok(()) => profile.gate_to(scene.depth),
        Err(_) => RangeGate { first: 0, bins: 0 },
    };
    Processing::with_gate(profile, gate)
}

impl SceneSettings {
    fn over(&self, base: Scene) -> Scene {
        Scene {
            depth: self.depth_m.map_or(base.depth, Metres),
            fastest_hand: self.fastest_hand_m_per_s.map_or(base.fastest_hand, MetresPerSecond),
            fastest_tag: self.fastest_tag_m_per_s.map_or(base.fastest_tag, MetresPerSecond),
            tags: self.tags.unwrap_or(base.tags),
            reader_antennas: self.reader_antennas.unwrap_or(base.reader_antennas),
        }
    }
}

impl ReaderSettings {
    fn over(&self, scene: &Scene) -> Result<ReaderConfig, Wrong> {
        let endpoint = values::endpoint(self.address.0);
        let default = ReaderConfig::for_scene(endpoint.address, scene);
        let antennas = match &self.antennas {
            Some(ports) => values::bounded(ports.iter().copied().map(AntennaPort))
                .map_err(|reason| ("reader.antennas", reason))?,
            None => default.antennas,
        };
        Ok(ReaderConfig {
            endpoint,
            antennas,
            power_index: self.power_index.unwrap_or(default.power_index),
            rf_mode: self.rf_mode.unwrap_or(default.rf_mode),
            session: self.session.unwrap_or(default.session),
            search_mode: self.search_mode.unwrap_or(default.search_mode),
            population: self.population.unwrap_or(default.population),
            keepalive_ms: self.keepalive_ms.unwrap_or(default.keepalive_ms),
        })
    }

    fn of(reader: &ReaderConfig) -> Self {
        Self {
            address: ReaderAddress(values::socket_address(&reader.endpoint)),
            antennas: Some(reader.antennas.iter().map(|p| p.0).collect()),
            power_index: Some(reader.power_index),
            rf_mode: Some(reader.rf_mode),
            session: Some(reader.session),
            search_mode: Some(reader.search_mode),
            population: Some(reader.population),
            keepalive_ms: Some(reader.keepalive_ms),
        }
    }
}

/// Where in the file a broken rule is mended.
fn place(error: &ConfigError) -> &'static str {
    match error {
        ConfigError::Profile(_) => "[profile]",
        ConfigError::Scene(_) => "[scene], or take a [profile] that sees more",
        ConfigError::Gate(_) => "gate_first_bin and gate_bins of [processing], or leave them away",
        ConfigError::CubeTooLarge { .. } => {
            "depth_m of [scene], or loops, receivers or transmitters of [profile]"
        }
        ConfigError::ChirpTooLarge { .. } => "samples or receivers of [profile]",
        ConfigError::RangeTimeColumns(_) => "range_time_columns of [processing]",
        ConfigError::MeanOfOneLoop => "clutter of [processing]",
        ConfigError::NotPositive => {
            "depth_m and speeds of [scene], or detection_db and clutter_time_constant_s of [processing]"
        }
        ConfigError::PacketDelay(_) => "packet_delay_us of [radar]",
        ConfigError::ReaderAntennas => "antennas of [reader]",
        ConfigError::Session(_) => "session of [reader]",
        ConfigError::Keepalive(_) => "keepalive_ms of [reader]",
        ConfigError::Prefix(_) => "address of [network]",
    }
}

#[cfg(test)]
mod tests;
