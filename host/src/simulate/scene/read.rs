//! From sections and keys to the parts of a scene, each with its line. What is wrong is left out and complained of.

use std::path::Path;

use glam::{Mat3, Vec2, Vec3};
use rfhoi_shared::array::virtual_antennas;
use rfhoi_shared::radar::RadarProfile;
use rfhoi_shared::tag::{Epc, MAX_EPC_BYTES};
use rfhoi_shared::units::{Metres, MetresPerSecond};
use serde::Deserialize;
use toml::de::{DeTable, ValueDeserializer};

use super::document::{At, Document, Section, hint};
use super::{
    Furniture, Person, Place, RadarPose, ReaderAntenna, Room, Scene, Stated, Tag, keys, orientation,
};
use crate::bridge::settings::{ProfileSettings, SettingsError};
use crate::hoi::Object;

/// The parts of a scene with the lines to complain of.
pub(super) struct Draft {
    pub(super) name: Option<String>,
    /// With the line of its section.
    pub(super) room: Option<At<Room>>,
    /// With the line of its position.
    pub(super) radar: Option<At<RadarPose>>,
    /// Line of the radar's depth, or of its section.
    pub(super) depth_line: usize,
    /// Line of the profile, or of the radar where it is left away, and what it is called.
    pub(super) profile: At<String>,
    pub(super) power_dbm: Option<f32>,
    /// `None` where one of its keys is wrong.
    pub(super) stated: Option<Stated>,
    /// Line of the reader's section.
    pub(super) reader_line: usize,
    /// With the lines of their positions.
    pub(super) antennas: Vec<At<ReaderAntenna>>,
    /// With the lines of their centres.
    pub(super) furniture: Vec<At<Furniture>>,
    /// Tags with the lines of their EPCs, and lines of their objects.
    pub(super) tags: Vec<(At<Tag>, usize)>,
    /// With the lines of their names.
    pub(super) people: Vec<At<Person>>,
    /// With the lines of their positions.
    pub(super) places: Vec<At<Place>>,
    /// Number of sections of tags, antennas, people and places, good or bad.
    pub(super) listed: Listed,
}

/// How many sections a file has of a kind.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Listed {
    pub(super) antennas: usize,
    pub(super) tags: usize,
    pub(super) people: usize,
    pub(super) places: usize,
}

impl Draft {
    /// The scene; `None` if anything is missing, which was complained of.
    pub(super) fn scene(self) -> Option<Scene> {
        fn values<T>(items: Vec<At<T>>) -> Vec<T> {
            items.into_iter().map(|at| at.value).collect()
        }
        Some(Scene {
            name: self.name?,
            room: self.room?.value,
            stated: self.stated?,
            furniture: values(self.furniture),
            radar: self.radar?.value,
            reader: super::Reader { antennas: values(self.antennas), power_dbm: self.power_dbm? },
            tags: self.tags.into_iter().map(|(at, _)| at.value).collect(),
            people: values(self.people),
            places: values(self.places),
        })
    }
}

/// Reads the document `table` of the file `path`.
pub(super) fn draft(document: &mut Document<'_>, table: &DeTable<'_>, path: &Path) -> Draft {
    let sections = ["room", "radar", "profile", "needs", "reader", "furniture", "tags", "people", "places"];
    let top = document.top(table, &sections);
    let name = document.text(&top, &keys::NAME).map(|at| at.value);
    let room = room(document, &top);
    let stated = stated(document, &top);
    let reader = document.section(&top, ("reader", keys::READER), &["antennas"]);
    let power_dbm = reader.as_ref().and_then(|r| document.number(r, &keys::POWER));
    let reader_line = reader.as_ref().map_or(1, |r| r.line);
    let antennas = reader.map_or_else(Vec::new, |r| document.sections(&r, ("antennas", keys::ANTENNAS)));
    let furniture = document.sections(&top, ("furniture", keys::FURNITURE));
    let tags = document.sections(&top, ("tags", keys::TAGS));
    let people = document.sections(&top, ("people", keys::PEOPLE));
    let places = document.sections(&top, ("places", keys::PLACES));
    let listed =
        Listed { antennas: antennas.len(), tags: tags.len(), people: people.len(), places: places.len() };
    let (radar, depth_line, profile) = radar(document, &top, path);
    Draft {
        name,
        room,
        radar,
        depth_line,
        profile,
        power_dbm,
        stated,
        reader_line,
        antennas: antennas.iter().filter_map(|s| antenna(document, s)).collect(),
        furniture: furniture.iter().filter_map(|s| furniture_piece(document, s)).collect(),
        tags: tags.iter().filter_map(|s| tag(document, s)).collect(),
        people: people.iter().filter_map(|s| person(document, s)).collect(),
        places: places.iter().filter_map(|s| same_place(document, s)).flatten().collect(),
        listed,
    }
}

fn room(document: &mut Document<'_>, top: &Section<'_>) -> Option<At<Room>> {
    let section = document.section(top, ("room", keys::ROOM), &[])?;
    let (mut min, mut max, mut whole) = (Vec3::ZERO, Vec3::ZERO, true);
    for (axis, key) in [keys::ROOM_X, keys::ROOM_Y, keys::ROOM_Z].iter().enumerate() {
        let Some(At { line, value: [low, high] }) = document.numbers(&section, key) else {
            whole = false;
            continue;
        };
        (min[axis], max[axis]) = (low, high);
        if low >= high {
            whole = false;
            let sentence = format!(
                "{} of [{low}, {high}] runs backwards: the lower end comes first, as in {}",
                key.name, key.example
            );
            document.complain(line, sentence);
        } else if axis == 2 && low != 0.0 {
            whole = false;
            document.complain(
                line,
                format!("the floor is where z is 0, not {low}: write z_m = [0, {}]", high - low),
            );
        }
    }
    let reflectivity = document.number(&section, &keys::WALLS)?;
    whole.then_some(At { line: section.line, value: Room { min, max, reflectivity } })
}

/// What the file says of its needs, each left away with its default.
fn stated(document: &mut Document<'_>, top: &Section<'_>) -> Option<Stated> {
    let nothing = DeTable::default();
    let section = document.optional_section(top, ("needs", keys::NEEDS));
    let section = section.unwrap_or(Section { header: keys::NEEDS, line: 1, table: &nothing });
    let [hand, tag, range, velocity] =
        [keys::FASTEST_HAND, keys::FASTEST_TAG, keys::RANGE_RESOLUTION, keys::VELOCITY_RESOLUTION]
            .map(|key| document.number(&section, &key));
    let [azimuth, elevation] = [keys::AZIMUTH, keys::ELEVATION].map(|key| document.flag(&section, &key));
    Some(Stated {
        fastest_hand: MetresPerSecond(hand?),
        fastest_tag: MetresPerSecond(tag?),
        range_resolution: Metres(range?),
        velocity_resolution: MetresPerSecond(velocity?),
        azimuth: azimuth?,
        elevation,
    })
}

/// The radar, the line of its depth, and the profile by name.
fn radar(
    document: &mut Document<'_>,
    top: &Section<'_>,
    path: &Path,
) -> (Option<At<RadarPose>>, usize, At<String>) {
    let section = document.section(top, ("radar", keys::RADAR), &[]);
    let line = section.as_ref().map_or(1, |s| s.line);
    let (profile, name) = profile(document, top, line, path);
    let Some(section) = section else { return (None, line, name) };
    let position = document.numbers(&section, &keys::RADAR_POSITION);
    let angles = [keys::RADAR_YAW, keys::RADAR_PITCH].map(|key| document.number(&section, &key));
    let depth = document.numbers::<1>(&section, &keys::DEPTH);
    let depth_line = depth.as_ref().map_or(line, |d| d.line);
    let radar = || {
        let [yaw, pitch] = angles;
        let At { line, value } = position?;
        let radar = RadarPose {
            position: value.into(),
            yaw_rad: yaw?.to_radians(),
            pitch_rad: pitch?.to_radians(),
            depth_m: depth?.value[0],
            profile: profile?,
        };
        Some(At { line, value: radar })
    };
    (radar(), depth_line, name)
}

/// The profile and what it is called; `radar_line` is where its section would be missed.
fn profile(
    document: &mut Document<'_>,
    top: &Section<'_>,
    radar_line: usize,
    path: &Path,
) -> (Option<RadarProfile>, At<String>) {
    let value = top.table.get("profile");
    let table = value.and_then(|v| v.get_ref().as_table());
    let section_line = value.map_or(radar_line, |v| document.line(&v.span()));
    // Line of one of its keys, or else of the section.
    let line_of = |document: &Document<'_>, key: &str| {
        table.and_then(|t| t.get(key)).map_or(section_line, |v| document.line(&v.span()))
    };
    let base_line = line_of(document, "base");
    let settings = match value {
        None => Ok(ProfileSettings::default()),
        Some(value) => ProfileSettings::deserialize(ValueDeserializer::from(value.clone())),
    };
    let settings = match settings {
        Ok(settings) => settings,
        Err(error) => {
            document.complain_of(&error);
            return (None, At { line: section_line, value: String::new() });
        }
    };
    let name = At { line: base_line, value: settings.base.clone().unwrap_or_else(|| "bridge".to_owned()) };
    let profile = match settings.load(path) {
        Ok(profile) => profile,
        Err(SettingsError::Value { key, reason, .. }) => {
            let key = key.strip_prefix("profile.").unwrap_or(key);
            document.complain(line_of(document, key), format!("{key} of [profile]: {reason}"));
            return (None, name);
        }
        Err(SettingsError::Profile { error, .. }) => {
            document.complain(base_line, error.to_string());
            return (None, name);
        }
        Err(error) => {
            document.complain(section_line, error.to_string());
            return (None, name);
        }
    };
    if let Err(error) = profile.validate() {
        document.complain(section_line, format!("the radar profile does not hold together: {error}"));
    } else if virtual_antennas(&profile).is_none() {
        let sentence = "the profile's antennas have no known positions: it sends with several transmitters at once, or \
                        with one that the board does not have; set board or transmitters of [profile]";
        document.complain(section_line, sentence);
    } else {
        return (Some(profile), name);
    }
    (None, name)
}

fn antenna(document: &mut Document<'_>, section: &Section<'_>) -> Option<At<ReaderAntenna>> {
    let position = document.numbers::<3>(section, &keys::ANTENNA_POSITION);
    let angles = [keys::ANTENNA_YAW, keys::ANTENNA_PITCH].map(|key| document.number(section, &key));
    let [yaw, pitch] = angles;
    let axes: Mat3 = orientation(yaw?.to_radians(), pitch?.to_radians());
    let At { line, value } = position?;
    Some(At { line, value: ReaderAntenna { position: value.into(), facing: axes.row(1) } })
}

fn furniture_piece(document: &mut Document<'_>, section: &Section<'_>) -> Option<At<Furniture>> {
    let name = document.text(section, &keys::FURNITURE_NAME);
    let centre = document.numbers::<3>(section, &keys::CENTRE);
    let size = document.numbers::<3>(section, &keys::SIZE);
    let yaw = document.number(section, &keys::FURNITURE_YAW);
    let reflectivity = document.number(section, &keys::REFLECTIVITY);
    let At { line, value } = centre?;
    let furniture = Furniture {
        name: name?.value,
        centre: value.into(),
        size: size?.value.into(),
        yaw_rad: yaw?.to_radians(),
        reflectivity: reflectivity?,
    };
    Some(At { line, value: furniture })
}

fn tag(document: &mut Document<'_>, section: &Section<'_>) -> Option<(At<Tag>, usize)> {
    let epc = document.text(section, &keys::EPC).and_then(|text| epc(document, &text));
    let object = if section.table.contains_key(keys::OBJECT.name) {
        document.text(section, &keys::OBJECT).and_then(|text| object(document, &text))
    } else {
        let sentence =
            format!("this tag is on no object; add object = \"book\", or another of {}", objects());
        document.complain(section.line, sentence);
        None
    };
    let offset = document.numbers::<3>(section, &keys::OFFSET);
    let (At { line, value: epc }, object) = (epc?, object?);
    let tag = Tag { epc, object: object.value, offset: offset?.value.into() };
    Some((At { line, value: tag }, object.line))
}

fn epc(document: &mut Document<'_>, text: &At<String>) -> Option<At<Epc>> {
    let At { line, value: digits } = text;
    let reason = if let Some(other) = digits.chars().find(|c| !c.is_ascii_hexdigit()) {
        format!("{other:?} is no hexadecimal digit; it may have 0 to 9 and a to f, without spaces")
    } else if !digits.len().is_multiple_of(2) {
        format!("it has {} digits, which is no whole number of bytes; most EPCs have 24 digits", digits.len())
    } else if let Some(epc) = Epc::from_hex(digits) {
        return Some(At { line: *line, value: epc });
    } else {
        format!("it has {} digits; an EPC has at most {}", digits.len(), 2 * MAX_EPC_BYTES)
    };
    document.complain(*line, format!("the EPC {digits:?}: {reason}"));
    None
}

fn object(document: &mut Document<'_>, text: &At<String>) -> Option<At<Object>> {
    let At { line, value: name } = text;
    let object = Object::named(name);
    if object.is_none() {
        let known: Vec<&str> = Object::ALL.iter().map(|o| o.name()).collect();
        let hint = hint(name, &known);
        document.complain(*line, format!("there is no object {name:?}{hint}: the objects are {}", objects()));
    }
    Some(At { line: *line, value: object? })
}

/// All objects, as a list to read.
fn objects() -> String {
    Object::ALL.iter().map(|o| o.name()).collect::<Vec<_>>().join(", ")
}

fn person(document: &mut Document<'_>, section: &Section<'_>) -> Option<At<Person>> {
    let name = document.text(section, &keys::PERSON_NAME);
    let height = document.number(section, &keys::HEIGHT);
    let build = document.number(section, &keys::BUILD);
    let At { line, value: name } = name?;
    Some(At { line, value: Person { name, height_m: height?, build: build?, manner: None } })
}

/// One place for each way to look.
fn same_place(document: &mut Document<'_>, section: &Section<'_>) -> Option<Vec<At<Place>>> {
    let position = document.numbers::<2>(section, &keys::PLACE_POSITION);
    let facings = document.list(section, &keys::FACING);
    let At { line, value } = position?;
    let place = |facing: f32| Place { position: Vec2::from(value), facing_rad: facing.to_radians() };
    Some(facings?.value.into_iter().map(|facing| At { line, value: place(facing) }).collect())
}
