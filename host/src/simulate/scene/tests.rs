use std::collections::BTreeSet;

use proptest::prelude::*;
use rfhoi_firmware::mmwave::cfg::{self, DemoOptions};

use super::keys::{ALL, Count, Key, Value};
use super::*;
use crate::bridge::settings::explained;

/// A scene that is right, with few lines.
const GOOD: &str = r#"name = "cell"
[room]
x_m = [-2.0, 2.0]
y_m = [0.0, 4.0]
z_m = [0.0, 2.5]
[radar]
position_m = [0.0, 0.2, 1.0]
[profile]
base = "bridge"
[reader]
power_dbm = 30
[[reader.antennas]]
position_m = [-0.3, 0.2, 1.0]
[[reader.antennas]]
position_m = [0.3, 0.2, 1.0]
[[furniture]]
name = "shelf"
centre_m = [1.8, 3.0, 1.0]
size_m = [0.4, 1.0, 2.0]
[[people]]
name = "A"
height_m = 1.7
[[people]]
name = "B"
height_m = 1.8
[[places]]
position_m = [0.0, 2.2]
[[tags]]
epc = "0a01"
object = "phone"
[[tags]]
epc = "0a02"
object = "book"
[[tags]]
epc = "0a03"
object = "pen"
[[tags]]
epc = "0a04"
object = "bottle"
[[tags]]
epc = "0a05"
object = "cup"
[[tags]]
epc = "0a06"
object = "jar"
"#;

fn parse(text: &str) -> Result<Scene, String> {
    Scene::parse(Path::new("scene.toml"), text).map_err(|e| e.to_string())
}

/// What is complained of when `from` of [`GOOD`] is replaced by `to`.
fn complaint(from: &str, to: &str) -> String {
    assert_eq!(GOOD.matches(from).count(), 1, "{from:?}");
    parse(&GOOD.replace(from, to)).unwrap_err()
}

/// Checks the sentence for each change.
fn all_are_told(cases: &[(&str, &str, &str)]) {
    for (from, to, expected) in cases {
        assert_eq!(&complaint(from, to), expected, "\n{from:?} -> {to:?}");
    }
}

#[test]
fn what_is_left_away_has_its_default() {
    let scene = parse(GOOD).unwrap();
    assert_eq!(scene.name, "cell");
    assert_eq!(scene.room.reflectivity, 0.15);
    assert_eq!((scene.radar.yaw_rad, scene.radar.depth_m), (0.0, 3.05));
    assert_eq!(scene.radar.profile, RadarProfile::bridge());
    assert_eq!(scene.gate(), RangeGate { first: 0, bins: 72 });
    assert_eq!((scene.needs().tags, scene.needs().reader_antennas), (6, 2));
    assert_eq!(scene.reader.antennas[1].facing, Vec3::Y);
    assert_eq!(scene.tags[0].offset, Vec3::ZERO);
    assert_eq!((scene.people[0].build, scene.places[0].facing_rad), (1.0, 0.0));
    assert_eq!(parse(&GOOD.replace("[profile]\nbase = \"bridge\"\n", "")), Ok(scene));
}

#[test]
fn a_place_may_be_looked_from_in_many_ways_and_numbers_of_the_profile_changed() {
    let text = GOOD
        .replace("position_m = [0.0, 2.2]", "position_m = [0.0, 2.2]\nfacing_deg = [-90, 0, 90.0]")
        .replace("base = \"bridge\"", "base = \"paper\"\nloops = 64");
    let scene = parse(&text).unwrap();
    let degrees: Vec<f32> = scene.places.iter().map(|p| p.facing_rad.to_degrees()).collect();
    assert_eq!(degrees, [-90.0, 0.0, 90.0]);
    assert_eq!((scene.radar.profile.samples, scene.radar.profile.loops), (256, 64));
}

#[test]
fn the_four_bad_scenes_of_every_day() {
    all_are_told(&[
        (
            "epc = \"0a02\"\nobject = \"book\"",
            "epc = \"0a02\"",
            "scene.toml, line 31: this tag is on no object; add object = \"book\", or another of phone, book, pen, bottle, \
             microwave, cabinet, table, chair, jar, lunchbox, bowl, cup, eyeglass case",
        ),
        (
            "position_m = [0.0, 2.2]",
            "position_m = [-1.8, 2.2]",
            "scene.toml, line 27: a person at [-1.80, 2.20] would stand in a wall: they need 0.35 m around them; the room \
             has x from -2 to 2, y from 0 to 4, z from 0 to 2.5",
        ),
        (
            "[0.3, 0.2, 1.0]",
            "[-0.3, 0.2, 1.005]",
            "scene.toml, line 15: this antenna is at one point with that of line 13: what two antennas see differs only if \
             they are apart (the paper's are 0.45 m apart)",
        ),
        (
            "base = \"bridge\"",
            "base = \"bridge\"\nsamples = 64\nsample_rate_ksps = 1100",
            "scene.toml, line 9: the profile \"bridge\" cannot see the room: it sees 2.75 m, depth_m (line 6) is 3.05 m; \
             take a profile that sees farther (\"paper\" 10.99 m, \"fine\" 5.50 m, \"bridge\" 5.50 m), or a smaller depth_m \
             and nearer places",
        ),
    ]);
}

#[test]
fn places_that_do_not_fit() {
    let place = "position_m = [0.0, 2.2]";
    all_are_told(&[
        (
            place,
            "position_m = [0.0, 7.0]",
            "scene.toml, line 27: a person at [0.00, 7.00] would be out of the room: they need 0.35 m around them; the room \
             has x from -2 to 2, y from 0 to 4, z from 0 to 2.5",
        ),
        (
            place,
            "position_m = [1.5, 2.8]",
            "scene.toml, line 27: a person at [1.50, 2.80] would stand in shelf (line 18): they need 0.35 m around them",
        ),
        (
            place,
            "position_m = [1.0, 2.8]\nfacing_deg = [0, 90]",
            "scene.toml, line 27: a person at [1.00, 2.80] with facing_deg 90 has shelf (line 18) before them: their hands \
             need 0.8 m for the sample's own things",
        ),
        (
            place,
            "position_m = [-1.4, 2.2]\nfacing_deg = -90",
            "scene.toml, line 27: a person at [-1.40, 2.20] with facing_deg -90 has a wall before them: their hands need \
             0.8 m; the room has x from -2 to 2, y from 0 to 4, z from 0 to 2.5",
        ),
        (
            place,
            "position_m = [0.0, 0.9]\nfacing_deg = 90",
            "scene.toml, line 27: a person at [0.00, 0.90] is 0.70 m from the radar, nearer than 0.9 m: what their hands do \
             before them would reach behind it",
        ),
        (
            place,
            "position_m = [1.6, 0.8]\nfacing_deg = -30",
            "scene.toml, line 27: the radar does not see a person at [1.60, 0.80]: they are 69 degrees to its right and 7 \
             degrees up, it sees 60 degrees either way",
        ),
        (
            place,
            "position_m = [0.0, 3.4]",
            "scene.toml, line 27: a person at [0.00, 3.40] is 3.21 m from the radar, past its range gate, which ends at \
             depth_m of 3.05 m (line 6): move the place nearer or raise depth_m",
        ),
        (
            "centre_m = [1.8, 3.0, 1.0]\nsize_m = [0.4, 1.0, 2.0]",
            "centre_m = [0.0, 1.0, 1.0]\nsize_m = [0.4, 0.2, 2.0]",
            "scene.toml, line 27: the radar does not see a person at [0.00, 2.20]: shelf (line 18) stands between them",
        ),
    ]);
}

#[test]
fn radar_antennas_and_furniture_that_do_not_fit() {
    let radar = "position_m = [0.0, 0.2, 1.0]";
    all_are_told(&[
        (
            "x_m = [-2.0, 2.0]",
            "x_m = [2.0, -2.0]",
            "scene.toml, line 3: x_m of [2, -2] runs backwards: the lower end comes first, as in [-2.0, 2.0]",
        ),
        (
            "[1.8, 3.0, 1.0]",
            "[1.9, 3.0, 1.0]",
            "scene.toml, line 18: shelf reaches out of the room, to [2.10, 2.50, 0.00]; the room has x from -2 to 2, y from \
             0 to 4, z from 0 to 2.5",
        ),
        (
            radar,
            "position_m = [0.0, -0.2, 1.0]",
            "scene.toml, line 7: the radar is out of the room, at [0.00, -0.20, 1.00]; the room has x from -2 to 2, y from \
             0 to 4, z from 0 to 2.5",
        ),
        (
            "[-0.3, 0.2, 1.0]",
            "[1.8, 3.0, 1.0]",
            "scene.toml, line 13: antenna 1 of the reader is inside of shelf (line 18), at [1.80, 3.00, 1.00]; move one of \
             them",
        ),
        (
            "[-0.3, 0.2, 1.0]",
            "[-0.3, 0.2, 1.0]\nyaw_deg = 180",
            "scene.toml, line 13: antenna 1 of the reader looks into a wall 0.20 m before it: turn it (yaw_deg, pitch_deg) \
             or move it, so that 0.5 m are free",
        ),
        (
            "position_m = [0.3, 0.2, 1.0]",
            "position_m = [1.8, 2.2, 1.0]",
            "scene.toml, line 15: antenna 2 of the reader looks into shelf 0.30 m before it: turn it (yaw_deg, pitch_deg) \
             or move it, so that 0.5 m are free",
        ),
        (
            "power_dbm = 30\n[[reader.antennas]]\nposition_m = [-0.3, 0.2, 1.0]\n[[reader.antennas]]\nposition_m = [0.3, \
             0.2, 1.0]\n",
            "power_dbm = 30\n",
            "scene.toml, line 10: the reader has 0 antennas: it has 1 to 4 sections [[reader.antennas]]",
        ),
        (
            "base = \"bridge\"",
            "base = \"bridge\"\nboard = \"xwr1642boost\"",
            "scene.toml, line 8: the profile's antennas have no known positions: it sends with several transmitters at \
             once, or with one that the board does not have; set board or transmitters of [profile]",
        ),
        (
            "base = \"bridge\"",
            "base = \"bridge\"\nidle_ns = 40000",
            "scene.toml, line 9: the profile \"bridge\" cannot follow hands: they move at up to 4.0 m/s, it is unambiguous \
             to 3.01 m/s; take a shorter idle_ns or ramp_end_ns, or fewer transmitters",
        ),
        (
            "base = \"bridge\"",
            "base = \"bridge\"\nsamples = 100",
            "scene.toml, line 8: the radar profile does not hold together: 100 samples a chirp: need a power of two from 16 \
             to 1024",
        ),
        (
            "base = \"bridge\"",
            "base = \"bridge\"\nquarter_turns = 4",
            "scene.toml, line 10: quarter_turns of [profile]: 4: need 0 to 3",
        ),
        (
            "base = \"bridge\"",
            "base = \"brigde\"",
            "scene.toml, line 9: cannot read the radar profile brigde: No such file or directory (os error 2); give a .cfg \
             file, a mmWave Studio log, or one of the names paper, fine, bridge",
        ),
    ]);
    let antennas: String =
        (0..5).map(|n| format!("[[reader.antennas]]\nposition_m = [0, 0.2, 1.{n}]\n")).collect();
    assert_eq!(
        complaint("power_dbm = 30\n", &format!("power_dbm = 30\n{antennas}")),
        "scene.toml, line 10: the reader has 7 antennas: it has 1 to 4 sections [[reader.antennas]]"
    );
}

#[test]
fn tags_and_people_that_cannot_be() {
    all_are_told(&[
        (
            "\"0a02\"",
            "\"0a01\"",
            "scene.toml, line 32: the EPC 0a01 is that of the phone in line 29 already: each tag has its own",
        ),
        (
            "\"0a02\"",
            "\"0a0\"",
            "scene.toml, line 32: the EPC \"0a0\": it has 3 digits, which is no whole number of bytes; most EPCs have 24 \
             digits",
        ),
        (
            "\"0a02\"",
            "\"0a O2\"",
            "scene.toml, line 32: the EPC \"0a O2\": ' ' is no hexadecimal digit; it may have 0 to 9 and a to f, without \
             spaces",
        ),
        (
            "\"book\"",
            "\"bok\"",
            "scene.toml, line 33: there is no object \"bok\" (did you mean book?): the objects are phone, book, pen, \
             bottle, microwave, cabinet, table, chair, jar, lunchbox, bowl, cup, eyeglass case",
        ),
        (
            "\"book\"",
            "\"phone\"",
            "scene.toml, line 33: there is a tag on the phone in line 30 already: each object is there once, with one tag",
        ),
        (
            "[[tags]]\nepc = \"0a06\"\nobject = \"jar\"\n",
            "",
            "scene.toml, line 1: the scene has 5 tags: a sample has 6, one on its object and the rest on others; add \
             [[tags]]",
        ),
        (
            "height_m = 1.8",
            "height_m = 180",
            "scene.toml, line 25: height_m of 180 m is out of bounds: it may be 1.4 to 2.1 m",
        ),
        (
            "height_m = 1.8",
            "height_m = 1.8\nbuild = 2",
            "scene.toml, line 26: build of 2 is out of bounds: it may be 0.7 to 1.5",
        ),
        (
            "\"B\"",
            "\"A\"",
            "scene.toml, line 24: there is a person \"A\" at line 21 already: give each its own name",
        ),
        (
            "[[places]]\nposition_m = [0.0, 2.2]\n",
            "",
            "scene.toml, line 1: there is no place to act: add [[places]] with position_m and facing_deg",
        ),
        (
            "power_dbm = 30",
            "power_dbm = 33",
            "scene.toml, line 11: power_dbm of 33 dBm is out of bounds: it may be 10 to 32.5 dBm",
        ),
    ]);
}

#[test]
fn keys_and_types_that_are_wrong() {
    all_are_told(&[
        (
            "height_m = 1.7",
            "heigth_m = 1.7",
            "scene.toml, line 20: [[people]] has no height_m (height); add height_m = 1.75\n\
             scene.toml, line 22: [[people]] has no key heigth_m (did you mean height_m?): it has name, height_m, build",
        ),
        (
            "[profile]\nbase = \"bridge\"",
            "[profile]\nbasis = \"bridge\"",
            "scene.toml, line 9: unknown key `basis`, expected one of `base`, `board`, `quarter_turns`, `receivers`, \
             `transmitters`, `samples`, `sample_rate_ksps`, `sample_format`, `loops`, `frame_period_us`, `start_khz`, \
             `slope_khz_per_us`, `idle_ns`, `adc_start_ns`, `ramp_end_ns`",
        ),
        (
            "name = \"cell\"",
            "name = \"cell\"\ncolour = 3",
            "scene.toml, line 2: a scene has no key colour: it has name, room, radar, profile, needs, reader, furniture, tags, \
             people, places",
        ),
        (
            "[-0.3, 0.2, 1.0]",
            "[-0.3, 0.2]",
            "scene.toml, line 13: position_m must be a list of 3 numbers, not 2 numbers; write position_m = [0.45, 0.2, 1.0]",
        ),
        (
            "height_m = 1.7",
            "height_m = \"1.7 m\"",
            "scene.toml, line 22: height_m must be a number, not the text \"1.7 m\"; write height_m = 1.75",
        ),
        (
            "name = \"shelf\"",
            "name = 7",
            "scene.toml, line 17: name must be a text in quotes, not 7; write name = \"counter\"",
        ),
        ("name = \"shelf\"", "name = \" \"", "scene.toml, line 17: name is empty; write name = \"counter\""),
        (
            "[[furniture]]",
            "[furniture]",
            "scene.toml, line 16: furniture must be sections [[furniture]] with double brackets",
        ),
        (
            "[room]\nx_m = [-2.0, 2.0]\ny_m = [0.0, 4.0]\nz_m = [0.0, 2.5]\n",
            "",
            "scene.toml, line 1: there is no section [room]; add it, with x_m = [-2.0, 2.0]",
        ),
        (
            "z_m = [0.0, 2.5]",
            "z_m = [0.0, nan]",
            "scene.toml, line 5: z_m of NaN m is out of bounds: it may be -50 to 50 m",
        ),
    ]);
}

#[test]
fn needs_are_stated_or_have_defaults() {
    assert_eq!(parse(GOOD).unwrap().stated, Stated::default());
    let needs = "[needs]\nfastest_hand_m_s = 3\nelevation = false\nrange_resolution_m = 0.1\n[reader]";
    let scene = parse(&GOOD.replace("[reader]", needs)).unwrap();
    let (range_resolution, fastest_hand) = (Metres(0.1), MetresPerSecond(3.0));
    let elevation = Some(false);
    assert_eq!(scene.stated, Stated { fastest_hand, range_resolution, elevation, ..Stated::default() });
    assert_eq!(scene.needs().fastest_hand, fastest_hand);
    all_are_told(&[
        (
            "[reader]",
            "[needs]\nelevation = \"no\"\n[reader]",
            "scene.toml, line 11: elevation must be true or false, not the text \"no\"; write elevation = false",
        ),
        (
            "[reader]",
            "[needs]\nfastest_hand_m_s = 12\n[reader]",
            "scene.toml, line 9: the profile \"bridge\" cannot follow hands: they move at up to 12.0 m/s, it is unambiguous \
             to 4.49 m/s; take a shorter idle_ns or ramp_end_ns, or fewer transmitters",
        ),
    ]);
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("scene.toml");
    std::fs::write(&path, GOOD.replace("[reader]", "[needs]\nfastest_hand_m_s = 12\n[reader]")).unwrap();
    let path = path.to_string_lossy();
    assert!(Scene::load(&path).is_err());
    assert_eq!(Scene::load_without_profile(&path).unwrap().needs().fastest_hand, MetresPerSecond(12.0));
}

#[test]
fn all_that_is_wrong_is_told_at_once_and_broken_toml_by_line() {
    let text =
        GOOD.replace("\"0a03\"", "\"xyz\"").replace("1.8\n", "9.0\n").replace("[0.0, 2.2]", "[0.0, 9.0]");
    let lines: Vec<usize> = match Scene::parse(Path::new("scene.toml"), &text) {
        Err(SceneError::Invalid { complaints, .. }) => complaints.iter().map(|c| c.line).collect(),
        other => panic!("{other:?}"),
    };
    assert_eq!(lines, [25, 27, 35]);
    let broken = complaint("power_dbm = 30", "power_dbm = ");
    assert!(broken.starts_with("scene.toml, line 11: "), "{broken}");
}

#[test]
fn files_and_names() {
    let error = Scene::load("nowhere.toml").unwrap_err().to_string();
    assert!(error.contains("nowhere.toml") && error.contains("kitchen"), "{error}");
    assert!(Scene::named("nowhere.toml").is_none());
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("scene.toml");
    let mut cfg = String::new();
    cfg::write(&RadarProfile::bridge(), &DemoOptions::default(), &mut cfg).unwrap();
    std::fs::write(directory.path().join("mine.cfg"), cfg).unwrap();
    std::fs::write(&path, GOOD.replace("\"bridge\"", "\"mine.cfg\"")).unwrap();
    let scene = Scene::load(&path.to_string_lossy()).unwrap();
    assert_eq!(scene.radar.profile.samples, RadarProfile::bridge().samples);
}

#[test]
fn rooms_are_as_the_papers() {
    let load = |name| Scene::load(name).unwrap_or_else(|e| panic!("{e}"));
    let [working, storage, kitchen] = SITE.map(load);
    let rooms = [working, storage, kitchen, load("open-room")];
    let [working, storage, kitchen, open] = &rooms;
    for room in &rooms {
        let objects: BTreeSet<Object> = room.tags.iter().map(|t| t.object).collect();
        assert_eq!(objects.len(), Object::ALL.len());
        assert!(room.tags.iter().all(|t| t.epc.bytes().len() == 12), "EPC-96");
        assert!((room.radar.position.z - 1.0).abs() < 1e-6);
        assert_eq!(room.gate(), RangeGate { first: 0, bins: 72 });
        for (n, antenna) in room.reader.antennas.iter().enumerate() {
            let next = room.reader.antennas[(n + 1) % 4].position;
            assert!((antenna.position.distance(next) - 0.45).abs() < 1e-3);
        }
        let radar = room.radar.position.truncate();
        let polar =
            room.places.iter().map(|p| p.position - radar).map(|v| (v.length(), v.x.atan2(v.y).to_degrees()));
        let (ranges, bearings): (Vec<f32>, Vec<f32>) = polar.unzip();
        let extent =
            |values: &[f32]| values.iter().fold((f32::MAX, f32::MIN), |(a, b), &v| (a.min(v), b.max(v)));
        let (nearest, farthest) = extent(&ranges);
        assert!((0.99..1.05).contains(&nearest) && (2.99..3.01).contains(&farthest), "{nearest} {farthest}");
        let (left, right) = extent(&bearings);
        assert!(left < -44.0 && right > 44.0 && left > -46.0 && right < 46.0, "{left} {right}");
    }
    assert_eq!(working.people, storage.people);
    assert_eq!(working.people, kitchen.people);
    let heights = |room: &Scene| {
        room.people.iter().map(|p| (p.height_m * 100.0).round() as u32).collect::<BTreeSet<_>>()
    };
    assert_eq!((heights(kitchen).first(), heights(kitchen).last()), (Some(&163), Some(&191)));
    assert!(heights(open).is_disjoint(&heights(kitchen)));
    // More multipath from room to room: more reflecting surface, nearer.
    let echo = |room: &Scene| -> f32 {
        let faces = room.furniture.iter().map(|f| {
            let range = f.centre.distance(room.radar.position);
            f.reflectivity * (f.size.x.max(f.size.y) * f.size.z) / range.powi(2)
        });
        faces.sum::<f32>() + room.room.reflectivity
    };
    assert!(echo(open) == 0.0 && echo(working) < echo(storage) && echo(storage) < echo(kitchen));
}

/// The row of the documentation for a key.
fn row(key: &Key) -> String {
    let (unit, default, bounds) = match key.value {
        Value::Text => ("text", "must be given".to_owned(), String::new()),
        Value::Flag { default } => {
            let default = default.map_or_else(|| "by the scene".to_owned(), |d| d.to_string());
            ("true or false", default, String::new())
        }
        Value::Numbers { count, unit, least, most, default } => {
            let default = match (default, count) {
                (None, _) => "must be given".to_owned(),
                (Some([one]), Count::One | Count::UpTo(_)) => one.to_string(),
                (Some(list), _) => format!("{list:?}"),
            };
            let each = match count {
                Count::One => String::new(),
                Count::List(n) => format!(", {n} numbers"),
                Count::UpTo(n) => format!(", or a list of up to {n}"),
            };
            (if unit.is_empty() { "number" } else { unit }, default, format!("{least} to {most}{each}"))
        }
    };
    format!("| `{}` | {} | {unit} | {default} | {bounds} |", key.name, key.text)
}

#[test]
fn the_documentation_has_every_key_with_unit_default_and_bounds() {
    let page = include_str!("../../../scenes/README.md");
    let rows =
        ALL.iter().map(row).chain(explained("profile").map(|(name, text)| format!("| `{name}` | {text} |")));
    let missing: Vec<String> = rows.filter(|row| !page.contains(row.as_str())).collect();
    assert!(missing.is_empty(), "not in host/scenes/README.md:\n{}", missing.join("\n"));
    assert!(ALL.iter().all(|k| page.contains(if k.section.is_empty() { "name" } else { k.section })));
    assert!(NAMES.iter().all(|name| page.contains(&format!("{name}.toml"))));
    assert!(Object::ALL.iter().all(|o| page.contains(o.name())));
    let rules = format!(
        "{PERSON_M} m around them and {WORKPLACE_M} m in front of them for their hands, without walls and furniture; they \
         are {NEAREST_M} m or more from the radar, within `depth_m`, within {} degrees",
        FIELD_OF_VIEW_RAD.to_degrees().round()
    );
    assert!(page.split_whitespace().collect::<Vec<_>>().join(" ").contains(&rules), "{rules}");
    // The example of the page is a scene.
    let example = page.split("```toml\n").nth(1).and_then(|t| t.split("```").next()).unwrap();
    assert!(parse(example).is_ok_and(|s| !s.furniture.is_empty()), "{:?}", parse(example));
}

#[test]
fn examples_of_keys_are_right() {
    for key in ALL.iter().filter(|k| matches!(k.value, Value::Numbers { .. })) {
        let text = format!("{} = {}", key.name, key.example);
        let (mut document, table) = Document::parse(&text);
        let section = document::Section { header: key.section, line: 1, table: &table };
        assert!(document.list(&section, key).is_some(), "{text}");
        assert!(document.complaints.is_empty());
    }
}

/// A value of any type, or no value.
fn anything() -> impl Strategy<Value = String> {
    prop_oneof![
        "[ -~\n]{0,20}",
        any::<f64>().prop_map(|v| v.to_string()),
        any::<i64>().prop_map(|v| format!("[{v}, {v}, {v}]")),
        proptest::collection::vec(-60.0..60.0_f32, 0..4).prop_map(|v| format!("{v:?}")),
        Just("[[1], {}, \"\"]".to_owned()),
        Just("{ base = 1, epc = 2 }".to_owned()),
        Just("1979-05-27T07:32:00Z".to_owned()),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(512))]

    #[test]
    fn no_text_panics(text in "(?s).{0,200}") {
        let _ = parse(&text);
    }

    #[test]
    fn no_change_of_a_scene_panics(changes in proptest::collection::vec((0..48_usize, anything(), any::<bool>()), 1..4)) {
        let mut lines: Vec<String> = GOOD.lines().map(str::to_owned).collect();
        for (number, value, whole) in changes {
            let Some(line) = lines.get_mut(number) else { continue };
            *line = match line.split_once(" = ") {
                Some((key, _)) if !whole => format!("{key} = {value}"),
                _ => value,
            };
        }
        let text = lines.join("\n");
        match Scene::parse(Path::new("scene.toml"), &text) {
            Ok(scene) => {
                let (surface, vertices) = scene.fixtures();
                prop_assert!(surface.triangles.iter().flatten().all(|&n| (n as usize) < vertices.len()));
            }
            Err(SceneError::Invalid { complaints, .. }) => {
                prop_assert!(!complaints.is_empty());
                let count = text.lines().count() + 1;
                prop_assert!(complaints.iter().all(|c| (1..=count).contains(&c.line)), "{complaints:?}");
            }
            Err(other) => prop_assert!(false, "{other}"),
        }
    }
}
