//! Every key of a scene file, with unit, default and bounds: what the parser checks and the documentation shows.

/// A key that the parser knows.
#[derive(Debug)]
pub(super) struct Key {
    /// Section as its header is written; empty for the keys before the first header.
    pub(super) section: &'static str,
    pub(super) name: &'static str,
    pub(super) value: Value,
    /// A value as it may stand in a file.
    pub(super) example: &'static str,
    /// What it is.
    pub(super) text: &'static str,
}

/// What a key holds.
#[derive(Debug, Clone, Copy)]
pub(super) enum Value {
    /// A text; it must be given.
    Text,
    /// True or false; without a default, what is left away follows from the scene.
    Flag { default: Option<bool> },
    /// Numbers within bounds; they must be given unless there is a default.
    Numbers { count: Count, unit: &'static str, least: f64, most: f64, default: Option<&'static [f64]> },
}

/// How many numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Count {
    /// One, not in a list.
    One,
    /// A list of so many.
    List(usize),
    /// One, or a list of up to so many.
    UpTo(usize),
}

/// Headers of the sections.
pub(super) const TOP: &str = "";
pub(super) const ROOM: &str = "[room]";
pub(super) const RADAR: &str = "[radar]";
pub(super) const NEEDS: &str = "[needs]";
pub(super) const READER: &str = "[reader]";
pub(super) const ANTENNAS: &str = "[[reader.antennas]]";
pub(super) const FURNITURE: &str = "[[furniture]]";
pub(super) const TAGS: &str = "[[tags]]";
pub(super) const PEOPLE: &str = "[[people]]";
pub(super) const PLACES: &str = "[[places]]";

/// Coordinates farther from the origin are typing errors, m.
const FARTHEST: f64 = 50.0;
const LEVEL: Option<&[f64]> = Some(&[0.0]);
/// Speeds of hands and tags, m/s.
const SPEEDS: (f64, f64) = (0.05, 30.0);

const fn numbers(
    count: Count,
    unit: &'static str,
    (least, most): (f64, f64),
    default: Option<&'static [f64]>,
) -> Value {
    Value::Numbers { count, unit, least, most, default }
}

const fn point(count: usize) -> Value {
    numbers(Count::List(count), "m", (-FARTHEST, FARTHEST), None)
}

macro_rules! keys {
    ($($const:ident = $section:ident $name:literal, $value:expr, $example:literal, $text:literal;)+) => {
        $(pub(super) const $const: Key =
            Key { section: $section, name: $name, value: $value, example: $example, text: $text };)+
        /// All of them, in the order of a file.
        pub(super) const ALL: &[Key] = &[$($const),+];
    };
}

keys! {
    NAME = TOP "name", Value::Text, "\"kitchen\"", "what people call the scene";
    ROOM_X = ROOM "x_m", point(2), "[-2.0, 2.0]", "left and right wall";
    ROOM_Y = ROOM "y_m", point(2), "[0.0, 4.5]", "wall behind the radar and wall before it";
    ROOM_Z = ROOM "z_m", point(2), "[0.0, 2.6]", "floor and ceiling";
    WALLS = ROOM "wall_reflectivity", numbers(Count::One, "", (0.0, 1.0), Some(&[0.15])), "0.15",
        "share of the power that walls, floor and ceiling reflect at 77 GHz";
    RADAR_POSITION = RADAR "position_m", point(3), "[0.0, 0.2, 1.0]", "middle of its antennas";
    RADAR_YAW = RADAR "yaw_deg", numbers(Count::One, "degrees", (-180.0, 180.0), LEVEL), "0",
        "turn of its boresight from y, clockwise as seen from above";
    RADAR_PITCH = RADAR "pitch_deg", numbers(Count::One, "degrees", (-45.0, 45.0), LEVEL), "0",
        "turn of its boresight upwards";
    DEPTH = RADAR "depth_m", numbers(Count::One, "m", (1.0, FARTHEST), Some(&[3.05])), "3.05",
        "range to which its maps reach; all places are nearer";
    FASTEST_HAND = NEEDS "fastest_hand_m_s", numbers(Count::One, "m/s", SPEEDS, Some(&[4.0])), "4.0",
        "fastest radial speed of a hand or body";
    FASTEST_TAG = NEEDS "fastest_tag_m_s", numbers(Count::One, "m/s", SPEEDS, Some(&[1.5])), "1.5",
        "fastest radial speed of a tag on a handled thing";
    RANGE_RESOLUTION = NEEDS "range_resolution_m", numbers(Count::One, "m", (0.02, 1.0), Some(&[0.043])), "0.043",
        "finest step of range that tells actions apart";
    VELOCITY_RESOLUTION = NEEDS "velocity_resolution_m_s", numbers(Count::One, "m/s", (0.01, 2.0), Some(&[0.141])), "0.141",
        "finest step of radial speed that tells actions apart";
    AZIMUTH = NEEDS "azimuth", Value::Flag { default: Some(true) }, "true", "whether actions are told apart by where they are from left to right";
    ELEVATION = NEEDS "elevation", Value::Flag { default: None }, "false", "whether actions are told apart by their height";
    POWER = READER "power_dbm", numbers(Count::One, "dBm", (10.0, 32.5), Some(&[30.0])), "30.0",
        "transmit power";
    ANTENNA_POSITION = ANTENNAS "position_m", point(3), "[0.45, 0.2, 1.0]", "where it is";
    ANTENNA_YAW = ANTENNAS "yaw_deg", numbers(Count::One, "degrees", (-180.0, 180.0), LEVEL), "0",
        "where it looks, as of the radar";
    ANTENNA_PITCH = ANTENNAS "pitch_deg", numbers(Count::One, "degrees", (-90.0, 90.0), LEVEL), "0",
        "where it looks, as of the radar";
    FURNITURE_NAME = FURNITURE "name", Value::Text, "\"counter\"", "what people call it";
    CENTRE = FURNITURE "centre_m", point(3), "[1.0, 2.0, 0.45]", "its centre";
    SIZE = FURNITURE "size_m", numbers(Count::List(3), "m", (0.01, 20.0), None), "[1.2, 0.6, 0.9]",
        "width (x), depth (y) and height of the box";
    FURNITURE_YAW = FURNITURE "yaw_deg", numbers(Count::One, "degrees", (-180.0, 180.0), LEVEL), "0",
        "turn about the vertical, clockwise as seen from above";
    REFLECTIVITY = FURNITURE "reflectivity", numbers(Count::One, "", (0.0, 1.0), Some(&[0.3])), "0.3",
        "share of the power that it scatters at 77 GHz: wood 0.2, metal 0.9";
    EPC = TAGS "epc", Value::Text, "\"e28069950000501800000002\"", "its EPC, hexadecimal, mostly 24 digits";
    OBJECT = TAGS "object", Value::Text, "\"book\"", "what it is on";
    OFFSET = TAGS "offset_m", numbers(Count::List(3), "m", (-0.3, 0.3), Some(&[0.0, 0.0, 0.0])),
        "[0.0, 0.0, 0.05]", "where on the object: to its right, forward and up from where such a tag usually is";
    PERSON_NAME = PEOPLE "name", Value::Text, "\"P1\"", "what people call them";
    HEIGHT = PEOPLE "height_m", numbers(Count::One, "m", (1.4, 2.1), None), "1.75", "height";
    BUILD = PEOPLE "build", numbers(Count::One, "", (0.7, 1.5), Some(&[1.0])), "1.0",
        "girth relative to an average person of that height";
    PLACE_POSITION = PLACES "position_m", point(2), "[0.0, 2.2]", "where a person stands, x and y";
    FACING = PLACES "facing_deg", numbers(Count::UpTo(16), "degrees", (-180.0, 180.0), LEVEL), "[-45, 0, 45]",
        "where they look: 0 towards the radar, growing to their left; a list makes as many places";
}

impl Key {
    /// The keys of one section.
    pub(super) fn of(section: &str) -> impl Iterator<Item = &'static Key> {
        ALL.iter().filter(move |k| k.section == section)
    }
}
