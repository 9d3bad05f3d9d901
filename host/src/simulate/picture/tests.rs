//! A made-up sample: someone takes a book off a table. Radar and tags follow its motion by plain formulas, not by the
//! simulator. `RFHOI_PICTURES=folder` keeps the pictures.

use std::f64::consts::{PI, TAU};

use super::*;
use crate::hoi::Object;
use crate::simulate::scene::Place;

const FRAMES: usize = 40;
const FRAME_S: f64 = 0.1;
const BINS: usize = 72;
const DOPPLER: usize = 64;
const COLUMNS: usize = 8;
const ANGLES: usize = 41;
const INTERACTION_S: (f64, f64) = (0.9, 2.7);

/// Shoulder, elbow, hand and the rest of a person who reaches out and back, as rods with radii.
fn rods(place: &Place, radar: Vec3, time_s: f64) -> (Vec<(Vec3, Vec3, f32)>, Vec3) {
    let share = ((time_s - INTERACTION_S.0) / (INTERACTION_S.1 - INTERACTION_S.0)).clamp(0.0, 1.0);
    let out = (PI * share).sin().powi(2) as f32;
    let front = place.front(radar).extend(0.0);
    let right = front.cross(Vec3::Z);
    let at = |forward: f32, side: f32, up: f32| place.position.extend(up) + front * forward + right * side;
    let lean = 0.25 * out;
    let (hip, neck) = (at(0.0, 0.0, 0.95), at(lean, 0.0, 1.5 - 0.1 * out));
    let shoulder = neck + right * 0.2 - Vec3::Z * 0.08;
    // Lifted on the way back.
    let lift = if share > 0.5 { 0.35 * (1.0 - out) } else { 0.0 };
    let hand = at(0.2, 0.22, 0.85).lerp(at(0.6, 0.15, 0.8), out) + Vec3::Z * lift;
    let elbow = shoulder.lerp(hand, 0.5) + right * 0.06 - Vec3::Z * 0.1;
    let mut rods = vec![
        (hip, neck, 0.15),
        (neck + Vec3::Z * 0.05, neck + Vec3::Z * 0.22 + front * 0.03, 0.1),
        (shoulder, elbow, 0.05),
        (elbow, hand, 0.045),
        (neck - right * 0.2 - Vec3::Z * 0.08, at(0.05, -0.25, 0.9), 0.05),
    ];
    rods.extend([-0.1, 0.1].map(|side| (at(0.0, side, 0.95), at(0.0, side, 0.05), 0.08)));
    (rods, hand)
}

/// Appends a tube with closed ends.
fn tube((from, to, radius): (Vec3, Vec3, f32), vertices: &mut Vec<Vec3>, triangles: &mut Vec<[u32; 3]>) {
    const SIDES: u32 = 12;
    let along = (to - from).normalize();
    let u = along.any_orthonormal_vector();
    let v = along.cross(u);
    let first = vertices.len() as u32;
    // Rings that close like a capsule.
    let rings = [(from - along * radius, 0.3), (from, 1.0), (to, 1.0), (to + along * radius, 0.3)];
    for (middle, share) in rings {
        for side in 0..SIDES {
            let (sin, cos) = (TAU as f32 * side as f32 / SIDES as f32).sin_cos();
            vertices.push(middle + (u * cos + v * sin) * radius * share);
        }
    }
    for ring in 0..3 {
        for side in 0..SIDES {
            let corner = |ring: u32, side: u32| first + ring * SIDES + side % SIDES;
            let (a, b) = (corner(ring, side), corner(ring, side + 1));
            let (c, d) = (corner(ring + 1, side + 1), corner(ring + 1, side));
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    for side in 1..SIDES - 1 {
        let end = first + 3 * SIDES;
        triangles.extend([[first, first + side + 1, first + side], [end, end + side, end + side + 1]]);
    }
}

/// What is there at a time: vertices, triangles, things and points that scatter.
fn pose(scene: &Scene, place: &Place, time_s: f64) -> (Vec<Vec3>, Vec<[u32; 3]>, Vec<Vec3>, Vec<Vec3>) {
    let (rods, hand) = rods(place, scene.radar.position, time_s);
    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    rods.iter().for_each(|&rod| tube(rod, &mut vertices, &mut triangles));
    let scatterers = rods.iter().flat_map(|r| [r.0, r.0.lerp(r.1, 0.5), r.1]).collect();
    let (reached, front) =
        ((INTERACTION_S.0 + INTERACTION_S.1) / 2.0, place.front(scene.radar.position).extend(0.0));
    let on_table =
        |forward: f32, side: f32| place.position.extend(0.78) + front * forward + front.cross(Vec3::Z) * side;
    let held = if time_s > reached { hand } else { on_table(0.6, 0.15) };
    let mut things = vec![on_table(0.55, -0.3), held, on_table(0.62, -0.1), on_table(0.45, 0.35)];
    things.extend([Vec3::new(1.6, 2.9, 1.0), Vec3::new(-1.7, 2.2, 0.85)]);
    (vertices, triangles, things, scatterers)
}

fn map(rows: usize, columns: usize, level: impl Fn(f64, f64) -> f64) -> Array2<f32> {
    Array2::from_shape_fn((rows, columns), |(r, c)| {
        let speckle = ((r * 7_919 + c * 104_729 + r * c * 31) % 97) as f64 / 97.0;
        let power = level((r as f64 + 0.5) / rows as f64, (c as f64 + 0.5) / columns as f64);
        (10.0 * (power + 1e-4 * (0.3 + speckle)).log10()) as f32
    })
}

fn moment(scene: &Scene, place: &Place, axes: &MapAxes, frame: usize) -> Moment {
    let (time_s, radar) = (frame as f64 * FRAME_S, scene.radar.position);
    let (vertices, _, things, now) = pose(scene, place, time_s);
    let later = pose(scene, place, time_s + FRAME_S).3;
    let seen: Vec<[f64; 4]> = now
        .iter()
        .zip(&later)
        .map(|(&now, &later)| {
            let (range, next) = (now.distance(radar), later.distance(radar));
            let local = scene.radar.axes() * (now - radar);
            let velocity = f64::from(next - range) / FRAME_S;
            [
                range.into(),
                velocity,
                local.x.atan2(local.y).to_degrees().into(),
                (local.z / range).asin().to_degrees().into(),
            ]
        })
        .collect();
    let value = |(from, to): (f64, f64), share: f64| from + share * (to - from);
    let bell = |x: f64, width: f64| (-(x / width).powi(2)).exp();
    let sum = |f: &dyn Fn(&[f64; 4]) -> f64| seen.iter().map(f).sum::<f64>();
    let paths = now.iter().flat_map(|&point| {
        let direct = SignalPath { points: vec![radar, point], level_db: -30.0 };
        let image = scene.room.images(point)[1];
        let turn = radar.lerp(image, (scene.room.max.x - radar.x) / (image.x - radar.x));
        [direct, SignalPath { points: vec![radar, turn, point], level_db: -55.0 }]
    });
    Moment {
        vertices,
        things,
        paths: paths.collect(),
        range_doppler: map(BINS, DOPPLER, |r, d| {
            let (r, d) = (value(axes.range_m, r), value(axes.velocity_m_s, d));
            sum(&|s| bell(r - s[0], 0.06) * bell(d - s[1], 0.2))
        }),
        range_time: map(BINS, COLUMNS, |r, t| {
            let r = value(axes.range_m, r);
            sum(&|s| bell(r - s[0] - s[1] * FRAME_S * t, 0.06))
        }),
        angles: map(ANGLES, ANGLES, |e, a| {
            let (e, a) = (value(axes.elevation_deg, e), value(axes.azimuth_deg, a));
            sum(&|s| bell(a - s[2], 14.0) * bell(e - s[3], 20.0))
        }),
    }
}

fn sample() -> Sample {
    let scene = Scene::named("kitchen").unwrap();
    let place =
        scene.places.iter().copied().find(|p| p.facing_rad.abs() < 1e-3 && p.position.y > 2.2).unwrap();
    let axes = MapAxes {
        range_m: (0.0, 3.1),
        velocity_m_s: (-4.5, 4.5),
        azimuth_deg: (-60.0, 60.0),
        elevation_deg: (-60.0, 60.0),
    };
    let objects =
        [Object::Phone, Object::Book, Object::Cup, Object::Bottle, Object::Cabinet, Object::EyeglassCase];
    let things: Vec<Thing> =
        objects.iter().map(|o| Thing { name: o.name().into(), target: *o == Object::Book }).collect();
    let moments: Vec<Moment> = (0..FRAMES).map(|n| moment(&scene, &place, &axes, n)).collect();
    let antennas = scene.reader.antennas.iter().map(|a| a.position);
    let differences = antennas.enumerate().flat_map(|(port, antenna)| {
        let moments = &moments;
        (0..objects.len()).map(move |thing| {
            let way = |n: usize| moments[n].things[thing].distance(antenna);
            let point = |n: usize| {
                let noise = ((n * 37 + thing * 11 + port * 5) % 13) as f64 / 13.0 - 0.5;
                let turned = f64::from(way(n) - way(n - 1)) * 2.0 * TAU / 0.328;
                let lost = (n + thing) % 17 < 2 || (thing == 4 && !n.is_multiple_of(3));
                (n as f64 * FRAME_S + 0.01 * port as f64, (!lost).then_some(turned + 0.1 * noise))
            };
            Differences { thing, antenna: port as u16 + 1, points: (1..FRAMES).map(point).collect() }
        })
    });
    let differences = differences.collect();
    Sample {
        title: "Simulated <pick up, book>, P3, kitchen, 2.0 m".into(),
        frame_s: FRAME_S,
        interaction_s: Some(INTERACTION_S),
        triangles: pose(&scene, &place, 0.0).1,
        fixtures: Default::default(),
        things,
        axes,
        moments,
        differences,
        scene,
    }
}

#[test]
fn all_pictures_are_written_and_repeat_byte_for_byte() {
    let mut sample = sample();
    let folder = tempfile::tempdir().unwrap();
    let kept = std::env::var_os("RFHOI_PICTURES").map(PathBuf::from);
    if kept.is_none() {
        // Half a film is as good for a test, and takes half as long.
        sample.moments.truncate(FRAMES / 2);
    }
    let frames = sample.moments.len();
    let written = sample.write(kept.as_deref().unwrap_or(folder.path())).unwrap();
    let bytes: Vec<Vec<u8>> = written.iter().map(|p| std::fs::read(p).unwrap()).collect();
    assert_eq!(
        (&bytes[0][1..4], &bytes[1][1..4], &bytes[2][..6]),
        (&b"PNG"[..], &b"PNG"[..], &b"GIF89a"[..])
    );
    let film = gif::DecodeOptions::new().read_info(&bytes[2][..]).unwrap();
    let delays: Vec<u16> = film.into_iter().map(|frame| frame.unwrap().delay).collect();
    assert_eq!(delays.len(), frames);
    assert!(delays[..frames - 1].iter().all(|&d| d == 10), "ten pictures a second: {delays:?}");
    let again = tempfile::tempdir().unwrap();
    sample.figure().save(again.path().join("sample.png")).unwrap();
    assert_eq!(std::fs::read(again.path().join("sample.png")).unwrap(), bytes[0]);
}

#[test]
fn what_lacks_tags_paths_bodies_or_maps_is_drawn_all_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let whole = sample();
    let bare = || Moment {
        vertices: vec![Vec3::NAN],
        things: vec![],
        paths: vec![SignalPath { points: vec![], level_db: f32::NAN }],
        range_doppler: Array2::default((0, 0)),
        range_time: Array2::default((0, 0)),
        angles: Array2::from_elem((1, 3), f32::NAN),
    };
    let moments = vec![bare(), bare()];
    Sample { moments, differences: vec![], interaction_s: None, ..whole.clone() }
        .write(folder.path())
        .unwrap();
    let none = Sample { moments: vec![], ..whole };
    none.figure().save(folder.path().join("none.png")).unwrap();
    assert!(none.write(folder.path()).is_err(), "there is nothing for a strip or a film");
}

#[test]
fn the_target_comes_first_and_the_liveliest_frame_is_in_the_interaction() {
    let sample = sample();
    let panels = tags::panels(&sample);
    let titles: Vec<&str> = panels
        .iter()
        .map(|p| match p {
            Panel::Lines(lines) => lines.title.as_str(),
            _ => "",
        })
        .collect();
    assert_eq!(titles[..2], ["Tag on the book, the target", "Tag on the phone"]);
    let liveliest = Maps::new(&sample).liveliest() as f64 * FRAME_S;
    assert!((INTERACTION_S.0..INTERACTION_S.1).contains(&liveliest), "{liveliest}");
}
