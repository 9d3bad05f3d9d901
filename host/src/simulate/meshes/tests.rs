use std::fs;
use std::path::Path;

use glam::{Vec2, Vec3};

use super::{MeshError, MeshSequence, TABLE};
use crate::hoi::CATEGORIES;
use crate::simulate::Performance;
use crate::simulate::scene::Place;

const SEQUENCE: &str = "frames_per_second = 10\naction = \"pick up\"\nobject = \"phone\"\nup = \"y\"\ntag = { group = \"phone\" }\n\
     hand = { vertex = 5 }\n";

/// A body of one tetrahedron and a phone, a triangle, `x` to the left of it and `y` up.
fn frame(x: f32, y: f32) -> String {
    let phone = [(x, y), (x + 0.3, y), (x, y + 0.3)].map(|(x, y)| format!("v {x} {y} 0\n")).concat();
    format!(
        "o body\nv 0 0 0\nv 0.4 0 0\nv 0 0 0.4\nv 0 1.7 0\nf 1 2 3\nf 1 2 4\nf 2 3 4\nf 1 3 4\n{phone}o phone\nf 5 6 7\n"
    )
}

fn write(folder: &Path, frames: &[String]) {
    fs::write(folder.join(TABLE), SEQUENCE).unwrap();
    for (i, text) in frames.iter().enumerate() {
        fs::write(folder.join(format!("{i:04}.obj")), text).unwrap();
    }
}

/// Straight before the person.
const RADAR: Vec3 = Vec3::new(1.0, 0.0, 1.0);
const PLACE: Place = Place { position: Vec2::new(1.0, 2.0), facing_rad: 0.0 };

#[test]
fn a_sequence_moves_at_its_place() {
    let folder = tempfile::tempdir().unwrap();
    let frames: Vec<String> = (0..5).map(|i| frame(0.1 * i as f32, 1.0)).collect();
    write(folder.path(), &frames);
    let sequence = MeshSequence::open(folder.path(), &PLACE, RADAR).unwrap();
    assert_eq!(sequence.label(), Some(CATEGORIES[0]));
    assert!((sequence.duration_s() - 0.4).abs() < 1e-9 && sequence.surface().triangles.len() == 5);
    let mut vertices = Vec::new();
    sequence.vertices(0.25, &mut vertices);
    assert_eq!(vertices.len(), 7);
    let mean: Vec3 = vertices[4..].iter().sum::<Vec3>() / 3.0;
    assert!(mean.distance(sequence.tag(0, 0.25)) < 1e-6);
    // The phone moves to the person's left, who looks to the radar: along +x.
    let way = sequence.tag(0, 0.3) - sequence.tag(0, 0.1);
    assert!(way.distance(Vec3::X * 0.2) < 1e-5, "{way}");
    let hand = sequence.hand(0.3).unwrap() - sequence.tag(0, 0.3);
    assert!(hand.distance(Vec3::new(-0.1, 0.0, -0.1)) < 1e-5, "{hand}");
    assert!((sequence.tag(0, 0.0).z - 1.1).abs() < 1e-6, "it stands on the floor");
    assert_eq!(sequence.tag(0, 9.0), sequence.tag(0, 0.4));
}

#[test]
fn faults_name_the_file() {
    let fault = |frames: &[String], table: Option<&str>| {
        let folder = tempfile::tempdir().unwrap();
        write(folder.path(), frames);
        if let Some(table) = table {
            fs::write(folder.path().join(TABLE), table).unwrap();
        }
        MeshSequence::open(folder.path(), &PLACE, RADAR).unwrap_err().to_string()
    };
    let good = frame(0.0, 1.0);
    let two = [good.clone(), good.clone()];
    let says = |found: String, words: &[&str]| {
        assert!(words.iter().all(|word| found.contains(word)), "{found}");
    };
    says(fault(&[good.clone(), good.replace("f 1 3 4\n", "")], None), &["0001.obj", "4 triangles", "5"]);
    says(fault(&[good.clone(), good.replace("v 0 1.7 0", "v 0 nan 0")], None), &["0001.obj", "no number"]);
    says(fault(&[good.clone(), good.replace("f 5 6 7", "f 5 6 70")], None), &["0001.obj"]);
    says(fault(&[good.clone(), good.replace("v 0 1.7 0", "v 0 1.7")], None), &["0001.obj"]);
    says(fault(std::slice::from_ref(&good), None), &["1 OBJ files"]);
    says(
        fault(&two, Some(&SEQUENCE.replace("group = \"phone\"", "group = \"cup\""))),
        &["0000.obj", "`cup`", "phone"],
    );
    says(fault(&two, Some(&SEQUENCE.replace("vertex = 5", "vertex = 8"))), &["0000.obj", "vertex 8"]);
    says(fault(&two, Some(&SEQUENCE.replace("object = \"phone\"\n", ""))), &[TABLE, "both"]);
    says(fault(&two, Some(&SEQUENCE.replace("pick up", "juggle"))), &[TABLE, "juggle"]);
    let empty = tempfile::tempdir().unwrap();
    assert!(matches!(MeshSequence::open(empty.path(), &PLACE, RADAR), Err(MeshError::Open { .. })));
}
