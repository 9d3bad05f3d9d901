//! Recorded motion of real people through the readers. Bounds are what was measured on the recordings.
//!
//! Without the recordings each test says SKIPPED and passes.

use std::path::{Path, PathBuf};

use rfhoi::motion::{Kind, Motion, actions};

#[path = "../../tests/recorded.rs"]
mod recorded;
use recorded::recorded;

/// Files of a folder of recordings whose names begin and end so, sorted; none, with a line that says so, without it.
fn files(folder: &str, begin: &str, end: &str) -> Vec<PathBuf> {
    let Some(folder) = recorded(folder) else { return Vec::new() };
    let entries = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path());
    let named = |p: &PathBuf| {
        let name = p.file_name().unwrap().to_str().unwrap();
        name.starts_with(begin) && name.ends_with(end)
    };
    let mut files: Vec<_> = entries.filter(named).collect();
    files.sort();
    files
}

fn labelled(path: &Path) -> Vec<actions::Action> {
    actions::beside(path).unwrap().expect("the index is in the folder above").1
}

/// Height, and usual top speed and peak speed of the fastest joint.
fn figures(motion: &Motion) -> (f32, f32, f32) {
    let (_, speed) = motion.fastest().unwrap();
    (motion.height_m().unwrap(), speed.usual_top_m_s, speed.peak_m_s)
}

#[test]
fn skeletons_are_as_tall_as_people() {
    for (path, wanted) in files("mocap/hdm05", "", ".asf").iter().zip([1.59, 1.76, 1.66]) {
        let (kind, rest) = Motion::open(path).unwrap();
        assert_eq!((kind, rest.joints().len(), rest.frames().len()), (Kind::Asf, 31, 1));
        let height = rest.height_m().unwrap();
        assert!((height - wanted).abs() < 0.01, "{path:?}: {height}");
    }
}

#[test]
fn bones_keep_their_lengths_and_clips_theirs() {
    for path in files("mocap/hdm05", "", ".amc") {
        let (kind, motion) = Motion::open(&path).unwrap();
        assert_eq!((kind, motion.joints().len()), (Kind::Amc, 31));
        let [clip] = &labelled(&path)[..] else { panic!("{path:?}: one action a clip") };
        assert_eq!(motion.numbers().first(), Some(&clip.start));
        assert_eq!((motion.numbers().last(), motion.frames().len()), (Some(&clip.end), clip.end as usize));
        for joint in 1..motion.joints().len() {
            let lengths: Vec<f32> = motion.bone_lengths_m(joint).unwrap().collect();
            assert!(lengths.iter().all(|l| (l - lengths[0]).abs() < 1e-6), "{path:?}, joint {joint}");
        }
        // Measured: 1.57 to 1.83 m; hands and toes up to 4.3 m/s.
        let (height, usual, peak) = figures(&motion);
        assert!((1.55..1.85).contains(&height), "{path:?}: {height}");
        assert!((1.5..4.0).contains(&usual) && peak < 4.5, "{path:?}: {usual}, {peak}");
        let floor = motion.frames().flatten().map(|p| p[2]).fold(f32::INFINITY, f32::min);
        assert!(floor.abs() < 0.06, "{path:?}: the lowest joint is at {floor} m");
    }
}

/// The index tells, from other software's forward kinematics, when and where the right hand was lowest or highest.
#[test]
fn hands_are_where_other_software_puts_them() {
    let mut compared = 0;
    for path in files("mocap/hdm05", "", ".amc") {
        let (_, motion) = Motion::open(&path).unwrap();
        let (table, _) = actions::beside(&path).unwrap().unwrap();
        let table = std::fs::read_to_string(table).unwrap();
        let name = path.file_name().unwrap().to_str().unwrap();
        let row = table.lines().find(|l| l.contains(name)).unwrap();
        let words: Vec<&str> = row.split("right hand ").nth(1).unwrap().split([' ', ',']).collect();
        let [which, wanted, "m", "at", "frame", frame, ..] = words[..] else { panic!("{row}") };
        let sign = if which == "highest" { 1.0 } else { -1.0 };
        let (wanted, frame): (f32, u32) = (wanted.parse().unwrap(), frame.parse().unwrap());
        let hand = motion.joints().iter().position(|j| j.name == "rhand").unwrap();
        let ups: Vec<f32> = motion.frames().map(|f| f[hand][2]).collect();
        let extreme = (0..ups.len()).max_by(|&a, &b| (sign * ups[a]).total_cmp(&(sign * ups[b]))).unwrap();
        assert_eq!(motion.numbers()[extreme], frame, "{name}");
        // The index does not say which floor its heights are above; the lowest joints are up to 6 cm from 0.
        let up = ups[extreme];
        assert!((up - wanted).abs() < 0.06, "{name}, frame {frame}: {up} m, elsewhere {wanted} m");
        compared += 1;
    }
    assert!(compared == 12 || compared == 0);
}

#[test]
fn kinect_sees_people_of_plausible_size() {
    let mut counts = Vec::new();
    for path in files("mocap/utkinect", "joints_", ".txt") {
        let (kind, motion) = Motion::open(&path).unwrap();
        assert_eq!((kind, motion.joints().len()), (Kind::JointList, 20));
        counts.push(motion.frames().len());
        let actions = labelled(&path);
        let within = |n: u32| (motion.numbers()[0]..=*motion.numbers().last().unwrap()).contains(&n);
        assert!(actions.len() == 10 && actions.iter().all(|a| within(a.start)), "{path:?}");
        // Measured: 1.54 to 1.72 m; usual top speeds 1.2 to 2.5 m/s, the tracker's jumps up to 13.4 m/s.
        let (height, usual, peak) = figures(&motion);
        assert!((1.5..1.75).contains(&height), "{path:?}: {height}");
        assert!((1.2..2.6).contains(&usual) && peak < 13.5, "{path:?}: {usual}, {peak}");
        // Persons are in front of the camera.
        assert!(motion.frames().flatten().all(|p| p[1] > 0.5), "{path:?}");
    }
    // Lines of the files less those that repeat a frame's number.
    assert!(
        counts.is_empty() || counts == [545, 634, 587, 733, 742, 830, 535, 1_271, 819, 526, 655, 692],
        "{counts:?}"
    );
}
