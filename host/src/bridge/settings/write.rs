//! Writes a configuration for people: every key with a line that explains it, those that need not be given as comments.

use rfhoi_shared::config::{BridgeConfig, ReaderConfig};
use rfhoi_shared::radar::RadarProfile;
use serde_json::{Map, Value};

use super::{Settings, default_processing, nearest};

const HEAD: &str = "\
# Configuration of an RF-HOI bridge, for `rfhoi bridge set`. A line that starts with `#` and a key shows what holds where
# the key is left away; to change it, remove the `#`.
";

/// Sections in the order of the file, and what they are.
const SECTIONS: [(&str, &str); 6] = [
    ("network", "The bridge's place in the network."),
    ("scene", "What is to be seen. Range gate, tags and antennas follow from it."),
    ("radar", "How the radar's data comes."),
    ("profile", "What the radar is programmed with: a profile, and single numbers that replace those of it."),
    ("processing", "What the bridge makes of the radar's data."),
    ("reader", "The RFID reader; without this section there is none."),
];

/// A key's explanation.
struct Key {
    name: &'static str,
    text: &'static str,
    /// Shown where there is no value.
    example: &'static str,
    /// Written out even where it need not be.
    always: bool,
}

const fn key(name: &'static str, text: &'static str) -> Key {
    Key { name, text, example: "", always: false }
}

/// One for each key of [`Settings`], by section and name.
const KEYS: &[Key] = &[
    Key {
        always: true,
        ..key(
            "network.address",
            "Address and length of its network's prefix, or \"dhcp\". A DCA1000EVM sends to 192.168.33.30 from the factory.",
        )
    },
    Key {
        example: "\"192.168.33.1\"",
        ..key("network.gateway", "Router, if the host is in another network.")
    },
    Key {
        example: "\"192.168.33.20:4780\"",
        ..key("network.host", "Where data goes from the start; without it, to the host that said hello last.")
    },
    Key { always: true, ..key("scene.depth_m", "From the radar to the farthest point of interest, m.") },
    key("scene.fastest_hand_m_per_s", "Fastest radial speed of a hand or body, m/s."),
    key("scene.fastest_tag_m_per_s", "Fastest radial speed of a tag on a handled thing, m/s."),
    key("scene.tags", "Tags in the scene."),
    key("scene.reader_antennas", "Antennas of the reader."),
    Key {
        always: true,
        ..key(
            "radar.input",
            "\"dca1000\": raw samples over LVDS and a DCA1000EVM. \"uart\": processed data of the SDK demo.",
        )
    },
    Key { example: "\"192.168.33.180\"", ..key("radar.dca1000_address", "The DCA1000EVM.") },
    Key { example: "60", ..key("radar.packet_delay_us", "Pause between its datagrams, 5 to 500 us.") },
    Key {
        always: true,
        ..key(
            "profile.base",
            "\"bridge\", \"fine\", \"paper\", or a file beside this one: CLI profile (.cfg) or mmWave Studio's log.",
        )
    },
    key("profile.board", "\"awr1843aop\", \"xwr1843boost\", \"xwr1642boost\" or \"iwr6843aop\"."),
    key("profile.quarter_turns", "Quarter turns of the board, clockwise as seen from behind it."),
    key("profile.receivers", "Receivers in use, from 1."),
    key(
        "profile.transmitters",
        "Transmitters of a loop's chirps in the order of time; [1, 3] in the list for two at once.",
    ),
    key("profile.samples", "ADC samples of a chirp: a power of two."),
    key("profile.sample_rate_ksps", "Sample rate, 1000 samples/s."),
    key(
        "profile.sample_format",
        "\"q-first\" or \"i-first\": complex samples by their first word. \"real\".",
    ),
    key("profile.loops", "Loops of a frame: a power of two."),
    key("profile.frame_period_us", "Frame period, us."),
    key("profile.start_khz", "Start of the ramp, kHz."),
    key("profile.slope_khz_per_us", "Slope of the ramp, kHz/us."),
    key("profile.idle_ns", "Pause before each ramp, ns."),
    key("profile.adc_start_ns", "From the start of the ramp to the first sample, ns."),
    key("profile.ramp_end_ns", "Length of the ramp, ns."),
    key("processing.gate_first_bin", "First range bin that is kept."),
    key("processing.gate_bins", "Range bins that are kept: as many as the scene is deep."),
    key(
        "processing.clutter",
        "What does not move: \"mean\" over a frame's loops or slow \"background\" is taken off, or \"off\".",
    ),
    Key {
        example: "10.0",
        ..key("processing.clutter_time_constant_s", "Time constant of the background, s.")
    },
    key("processing.range_time_columns", "Columns of the range-time map of one frame: a power of two."),
    key("processing.detection_db", "How far a cell must rise over its row's noise to count as moving, dB."),
    key(
        "processing.zero_doppler_guard_bins",
        "Doppler bins on either side of zero that never count as moving.",
    ),
    Key { always: true, ..key("reader.address", "LLRP server.") },
    key("reader.antennas", "Antenna ports in use, from 1."),
    key("reader.power_index", "Index into the reader's table of transmit powers, 0 for its default."),
    key("reader.rf_mode", "RF mode; Impinj's 0 is maximum throughput, 1000 and up choose by themselves."),
    key("reader.session", "Gen2 session, 0 to 3."),
    key(
        "reader.search_mode",
        "Impinj search mode: 1 single target, 2 dual target, 3 single target with suppression.",
    ),
    key("reader.population", "Expected tags; they set the slots of the first inventory round."),
    key("reader.keepalive_ms", "Period of the reader's keepalives, 100 ms or more."),
];

/// Address of the reader in the example.
const EXAMPLE_READER: [u8; 4] = [192, 168, 33, 40];

/// `config` as a file to be edited.
pub fn write(config: &BridgeConfig) -> String {
    let defaults = defaults(config);
    let (values, defaults) = (sections(config), sections(&defaults));
    let mut text = HEAD.to_owned();
    for (section, about) in SECTIONS {
        let values = values.get(section).and_then(Value::as_object);
        // A section that is not there is shown as an example.
        let off = if values.is_some() { "" } else { "#" };
        text += &format!("\n# {about}\n{off}[{section}]\n");
        let Some(defaults) = defaults.get(section).and_then(Value::as_object) else { continue };
        for (name, default) in defaults {
            let path = format!("{section}.{name}");
            let Some(key) = KEYS.iter().find(|k| k.name == path) else { continue };
            text += &format!("# {}\n", key.text);
            text += &match values.and_then(|v| v.get(name)) {
                Some(Value::Null) => format!("#{name} = {}\n", key.example),
                Some(value) if value != default || key.always => format!("{name} = {value}\n"),
                _ => format!("#{name} = {default}\n"),
            };
        }
    }
    text
}

/// The keys of `section` and what each means.
#[cfg(test)]
pub(crate) fn explained(section: &str) -> impl Iterator<Item = (&'static str, &'static str)> {
    KEYS.iter().filter_map(move |k| Some((k.name.strip_prefix(section)?.strip_prefix('.')?, k.text)))
}

/// What would hold if all that may be left away were.
fn defaults(config: &BridgeConfig) -> BridgeConfig {
    let mut defaults = BridgeConfig::default();
    let profile = &config.radar.profile;
    defaults.radar.processing = default_processing(profile, &config.scene);
    defaults.radar.profile = RadarProfile::named(nearest(profile)).unwrap_or_default();
    let address = config.reader.as_ref().map_or(EXAMPLE_READER, |r| r.endpoint.address);
    defaults.reader = Some(ReaderConfig::for_scene(address, &config.scene));
    defaults
}

fn sections(config: &BridgeConfig) -> Map<String, Value> {
    // By way of text, so that an f32 keeps its own digits; numbers, strings and lists are the same in JSON and TOML.
    let text = serde_json::to_string(&Settings::of(config));
    text.and_then(|t| serde_json::from_str(&t)).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_key_is_explained_and_every_explanation_has_a_key() {
        let config = BridgeConfig {
            reader: Some(ReaderConfig::for_scene(EXAMPLE_READER, &Default::default())),
            ..BridgeConfig::default()
        };
        let sections = sections(&config);
        let keys = sections.iter().flat_map(|(section, keys)| {
            keys.as_object().unwrap().keys().map(move |name| format!("{section}.{name}"))
        });
        let (mut keys, mut explained): (Vec<String>, Vec<String>) =
            (keys.collect(), KEYS.iter().map(|k| k.name.to_owned()).collect());
        keys.sort();
        explained.sort();
        assert_eq!(keys, explained);
        assert!(SECTIONS.iter().all(|(name, _)| sections.contains_key(*name)));
        assert_eq!(SECTIONS.len(), sections.len());
    }
}
