use proptest::prelude::*;

use super::actions::Action;
use super::{Kind, Motion, MotionError, Position, actions, amc, asf, bvh, joint_list};

/// Root, a thigh of 18 units down, a shin of 18 units; its axis turned by 90 degrees about z.
const ASF: &str = "# made by hand\n:version 1.10\n:units\n length 0.45\n angle deg\n:root\n order TX TY TZ RX RY RZ\n axis XYZ\n \
     position 0 0 0\n orientation 0 0 0\n:bonedata\n begin\n id 2\n name shin\n direction 0 -1 0\n length 18\n axis 0 0 90 XYZ\n \
     dof rx ry\n limits (-1 1)\n (-1 1)\n end\n begin\n name thigh\n direction 0 -1 0\n length 18\n axis 0 0 0 XYZ\n end\n\
     :hierarchy\n begin\n root thigh\n thigh shin\n end\n";
const INCH: f32 = 0.0254;

fn near(found: Position, wanted: Position) {
    for (f, w) in found.iter().zip(wanted) {
        assert!((f - w).abs() < 1e-4, "{found:?} is not {wanted:?}");
    }
}

fn frame(motion: &Motion, index: usize) -> &[Position] {
    motion.frames().nth(index).unwrap()
}

#[test]
fn a_skeleton_at_rest_hangs_down() {
    let rest = asf::parse(ASF).unwrap().rest().unwrap();
    let names: Vec<_> = rest.joints().iter().map(|j| (j.name.as_str(), j.parent)).collect();
    assert_eq!(names, [("root", None), ("thigh", Some(0)), ("shin", Some(1))], "parents first");
    near(frame(&rest, 0)[1], [0.0, 0.0, -40.0 * INCH]);
    near(frame(&rest, 0)[2], [0.0, 0.0, -80.0 * INCH]);
    assert!((rest.height_m().unwrap() - 80.0 * INCH).abs() < 1e-4);
}

#[test]
fn a_bone_turns_about_its_own_axes_after_its_parent() {
    let skeleton = asf::parse(ASF).unwrap();
    let text = "#!OML\n:FULLY-SPECIFIED\n:DEGREES\n3\nroot 0 9 0 0 0 0\nshin 0 0\n\
                5\nroot 0 9 0 0 0 0\nshin 0 90\n6\nroot 0 9 0 0 0 90\nshin 45 90\n";
    let motion = amc::parse(text, &skeleton).unwrap();
    assert_eq!(motion.numbers(), [3, 5, 6]);
    assert_eq!(motion.times_s(), [0.0, 2.0 / 120.0, 3.0 / 120.0]);
    near(frame(&motion, 0)[2], [0.0, 0.0, -60.0 * INCH]);
    // The shin's y is the world's -x at rest: by 90 degrees about it, down turns forward.
    near(frame(&motion, 1)[2], [0.0, 40.0 * INCH, -20.0 * INCH]);
    // The root about z: the thigh lies along +x, to the left. The shin's x lies along it, so that its first turn, about
    // x, does nothing, and the second one turns it forward again.
    near(frame(&motion, 2)[1], [-40.0 * INCH, 0.0, 20.0 * INCH]);
    near(frame(&motion, 2)[2], [-40.0 * INCH, 40.0 * INCH, 20.0 * INCH]);
    for length in motion.bone_lengths_m(2).unwrap() {
        assert!((length - 40.0 * INCH).abs() < 1e-4);
    }
}

const BVH: &str = "HIERARCHY\nROOT Hips\n{\n OFFSET 0 0 0\n CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation\n \
     JOINT Spine\n {\n OFFSET 0 60 0\n CHANNELS 3 Zrotation Xrotation Yrotation\n End Site\n {\n OFFSET 0 100 0\n }\n }\n}\n\
     MOTION\nFrames: 2\nFrame Time: 0.5\n0 90 0 0 0 0 0 0 0\n0 90 0 90 0 0 0 90 0\n";

#[test]
fn a_hierarchy_turns_from_left_to_right() {
    let motion = bvh::parse(BVH).unwrap();
    assert_eq!(motion.joints()[2].name, "Spine_end");
    assert_eq!(motion.times_s(), [0.0, 0.5]);
    near(frame(&motion, 0)[2], [0.0, 0.0, 2.5]);
    // By 90 degrees about z the spine lies along -x, to the right; its x then points up, and turns the rest to +z.
    near(frame(&motion, 1)[1], [0.6, 0.0, 0.9]);
    near(frame(&motion, 1)[2], [0.6, 1.0, 0.9]);
    assert!(motion.notes[0].contains("centimetres"), "{:?}", motion.notes);
}

fn kinect(frame: u32, x: f32) -> String {
    format!("{frame}{}\n", format!(" {x} 1 2").repeat(20))
}

#[test]
fn joint_lists_have_gaps_and_repeats() {
    let text = [kinect(10, 0.0), kinect(13, 0.1), kinect(13, 0.2), kinect(40, 0.3)].concat();
    assert_eq!(Kind::of(text.as_bytes()), Some(Kind::JointList));
    let motion = joint_list::parse(&text).unwrap();
    assert_eq!(motion.numbers(), [10, 13, 40]);
    near(frame(&motion, 1)[0], [-0.1, 2.0, 1.0]);
    let speed = motion.speed(0).unwrap();
    assert!(
        (speed.peak_m_s - 1.0).abs() < 1e-4 && (speed.path_m - 0.1).abs() < 1e-6,
        "not over the gap: {speed:?}"
    );
    let back = joint_list::parse(&[kinect(10, 0.0), kinect(9, 0.1)].concat()).unwrap_err();
    assert_eq!(back.line, 2);
}

#[test]
fn faults_name_their_line() {
    let asf = |from: &str, to: &str| asf::parse(&ASF.replace(from, to)).unwrap_err();
    let with = |(line, word): (usize, &str), fault: super::Fault| {
        assert!(fault.line == line && fault.reason.contains(word), "{fault:?}");
    };
    with((15, "need 3 numbers"), asf("direction 0 -1 0", "direction 0 -1"));
    with((16, "`inf`"), asf("length 18", "length inf"));
    with((18, "`rq`"), asf("dof rx", "dof rq"));
    with((31, "`knee`"), asf("thigh shin", "thigh knee"));
    with((31, "not in the hierarchy"), asf(" thigh shin\n", ""));
    with((31, "two parents"), asf("thigh shin", "thigh thigh"));
    let skeleton = asf::parse(ASF).unwrap();
    let amc = |text: &str| amc::parse(text, &skeleton).unwrap_err();
    with((1, "no frames"), amc(""));
    with((2, "`knee`"), amc("1\nknee 1\n"));
    with((2, "needs 6 values"), amc("1\nroot 1\n"));
    with((3, "without bone `shin`"), amc("1\nroot 0 0 0 0 0 0\n2\n"));
    let bvh = |from: &str, to: &str| bvh::parse(&BVH.replace(from, to)).unwrap_err();
    with((19, "1 of 2"), bvh("0 90 0 0 0 0 0 0 0\n", ""));
    with((5, "number of channels"), bvh("CHANNELS 6", "CHANNELS 7"));
    with((16, "no known unit"), bvh("OFFSET 0 100 0", "OFFSET 0 2 0"));
    with((15, "does not belong"), bvh(" }\n}\nMOTION", " }\nMOTION"));
}

#[test]
fn a_missing_skeleton_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("07_cut_1.amc");
    std::fs::write(&path, ":FULLY-SPECIFIED\n1\nroot 0 0 0 0 0 0\nshin 0 0\n").unwrap();
    let MotionError::NoSkeleton { tried, .. } = Motion::open(&path).unwrap_err() else { panic!() };
    assert_eq!(tried, ["07_cut_1.asf", "07_cut.asf", "07.asf"]);
    std::fs::write(folder.path().join("07.asf"), ASF).unwrap();
    assert_eq!(Motion::open(&path).unwrap().0, Kind::Amc);
}

#[test]
fn actions_are_those_of_the_file() {
    let table = "file\taction\tstart\tend\nm/a.amc\tput\t20\t30\nm/b.amc\tput\t1\tx\nm/a.amc\ttake\t3\t9\n";
    let take = Action { name: "take".to_owned(), start: 3, end: 9 };
    assert_eq!(actions::parse(table, "a.amc").unwrap()[0], take);
    assert_eq!(actions::parse(table, "b.amc").unwrap_err().line, 3);
    assert_eq!(actions::parse(table, "c.amc").unwrap(), []);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(actions::NAME);
    std::fs::write(&path, table).unwrap();
    assert!(matches!(actions::all(&path), Err(MotionError::Line { fault, .. }) if fault.line == 3));
    std::fs::write(&path, table.replace('x', "7") + "\n").unwrap();
    let named: Vec<(String, u32)> =
        actions::all(&path).unwrap().into_iter().map(|(file, action)| (file, action.end)).collect();
    assert_eq!(named, [("a.amc", 30), ("b.amc", 7), ("a.amc", 9)].map(|(file, end)| (file.to_owned(), end)));
}

/// Reads `text` as every kind: an error or a motion whose parts fit together.
fn read_as_all(text: &str) {
    let skeleton = asf::parse(ASF).unwrap();
    let rest = asf::parse(text).and_then(|s| s.rest());
    for motion in [rest, amc::parse(text, &skeleton), bvh::parse(text), joint_list::parse(text)] {
        let Ok(motion) = motion else { continue };
        assert_eq!(motion.frames().len(), motion.times_s().len());
        assert!(motion.frames().flatten().flatten().all(|x| x.is_finite()));
        assert!(motion.joints().iter().enumerate().all(|(i, j)| j.parent.is_none_or(|p| p < i)));
        motion.height_m();
        motion.fastest();
    }
    let _ = actions::parse(text, "a");
    Kind::of(text.as_bytes());
}

proptest! {
    #[test]
    fn arbitrary_text_is_an_error_or_a_motion(text in "(?s).{0,400}") {
        read_as_all(&text);
    }

    /// Good files with words replaced, lines dropped or cut reach further into the parsers.
    #[test]
    fn damaged_files_are_an_error_or_a_motion(
        which in 0..4_usize,
        damage in prop::collection::vec((any::<prop::sample::Index>(), 0..9_usize), 1..6),
    ) {
        let amc = ":DEGREES\n1\nroot 0 9 0 0 0 0\nshin 0 0\n2\nroot 0 9 0 0 0 0\nshin 0 90\n";
        let good = [ASF, BVH, amc, &[kinect(1, 0.0), kinect(2, 1.0)].concat()][which].to_owned();
        let mut words: Vec<&str> = good.split_inclusive([' ', '\n']).collect();
        for (at, how) in damage {
            let at = at.index(words.len());
            match how {
                0 => words.truncate(at + 1),
                1 => { words.remove(at); }
                _ => words[at] = ["nan ", "-1e6 ", "1e300 ", "{\n", "}\n", "root ", "\u{fc}\n"][how - 2],
            }
            if words.is_empty() { break }
        }
        read_as_all(&words.concat());
    }
}
