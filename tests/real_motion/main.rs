//! Recorded people beside generated ones, as the simulated radar sees both:
//! `cargo test -p rfhoi-tests --test real_motion -- --nocapture` prints the tables; `RFHOI_PICTURES=folder` keeps
//! `real_motion.png`, recorded maps on the left, generated ones on the right.
//!
//! The recorded ones sit down, stand up and pick up from the floor before a Kinect (UTKinect-Action3D, 20 joints at 15
//! frames a second) and put down on the floor in a motion capture laboratory (HDM05, 120 frames a second). The generated
//! ones do the same in both manners; they pick up from and put down on a table. All have one body, one place and one
//! radar, with all effects of `site`.
//!
//! Without the recordings the test says SKIPPED and passes.

#[path = "../recorded.rs"]
mod captures;
mod profile;

use std::path::PathBuf;

use glam::Vec3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rfhoi::hoi::{Action, Category, Object};
use rfhoi::motion::{Motion, actions};
use rfhoi::plot::{Axis, ColourScale, Figure, Heatmap, Panel, Reduce};
use rfhoi::simulate::body::{Joint, Side};
use rfhoi::simulate::effects::{Domain, Effects};
use rfhoi::simulate::perform::{Brief, Generated, Manner};
use rfhoi::simulate::radar::Radar;
use rfhoi::simulate::recorded::{Recast, Recorded};
use rfhoi::simulate::sample::Take;
use rfhoi::simulate::scene::{Person, Place, Scene};
use rfhoi::simulate::{Performance, Surface};

use captures::recorded;
use profile::{Profile, distance, profile, strongest_ranges};

/// Generated performances of an action in each manner.
const GENERATED: u64 = 4;

/// What is compared: the name in `ACTION_INDEX.tsv`, the files, and what it is in the project's words.
const ACTIONS: [(&str, [&str; 6], Category); 4] = [
    ("sit_down", KINECT, Category { action: Action::SitDown, object: Object::Chair }),
    ("stand_up", KINECT, Category { action: Action::StandUp, object: Object::Chair }),
    ("pick_up", KINECT, Category { action: Action::PickUp, object: Object::Bottle }),
    ("put_down", HDM05, Category { action: Action::PutDown, object: Object::Bottle }),
];
/// Picking up from a shelf, which is nobody's generated motion either, but stands still and reaches.
const SHELF: (&str, [&str; 6], Category) =
    ("pick_up", HDM05_SHELF, Category { action: Action::PickUp, object: Object::Bottle });
const KINECT: [&str; 6] = [
    "utkinect/joints_s01_e01.txt",
    "utkinect/joints_s02_e01.txt",
    "utkinect/joints_s03_e01.txt",
    "utkinect/joints_s04_e01.txt",
    "utkinect/joints_s05_e01.txt",
    "utkinect/joints_s06_e01.txt",
];
const HDM05: [&str; 6] = [
    "hdm05/HDM_bd_depositFloorR_001_120.amc",
    "hdm05/HDM_bd_depositFloorR_005_120.amc",
    "hdm05/HDM_bk_depositFloorR_009_120.amc",
    "hdm05/HDM_bk_depositFloorR_011_120.amc",
    "hdm05/HDM_dg_depositFloorR_013_120.amc",
    "hdm05/HDM_dg_depositFloorR_015_120.amc",
];

const HDM05_SHELF: [&str; 6] = [
    "hdm05/HDM_bd_grabHighR_002_120.amc",
    "hdm05/HDM_bd_grabHighR_004_120.amc",
    "hdm05/HDM_bk_grabHighR_008_120.amc",
    "hdm05/HDM_bk_grabHighR_010_120.amc",
    "hdm05/HDM_dg_grabHighR_014_120.amc",
    "hdm05/HDM_dg_grabHighR_016_120.amc",
];

/// Who a performance is after.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Source {
    /// A recorded person, by the part of the file's name that tells people apart.
    Recorded(&'static str),
    Generated(Manner),
}

/// A performance as the radar sees it, and figures of it.
struct Seen {
    source: Source,
    duration_s: f64,
    /// Highest speeds of the faster hand and of the head, m/s.
    hand_m_s: f32,
    head_m_s: f32,
    /// Of elbows, hands, knees and ankles, m/s.
    fastest_m_s: f32,
    /// How far the hips go up and down, m.
    hips_m: f32,
    /// Highest radial speed with a level that counts, m/s.
    doppler_m_s: f32,
    /// Share of frames in which nothing is within 25 dB of the strongest.
    quiet: f32,
    /// Velocity x frame, dB.
    levels: ndarray::Array2<f32>,
    /// From the first frame that is not quiet to the last.
    profile: Profile,
}

/// The joints that move fastest.
const LIMBS: [Joint; 8] = [
    Joint::ElbowLeft,
    Joint::HandLeft,
    Joint::ElbowRight,
    Joint::HandRight,
    Joint::KneeLeft,
    Joint::AnkleLeft,
    Joint::KneeRight,
    Joint::AnkleRight,
];

struct Stage {
    scene: Scene,
    place: Place,
    person: Person,
}

impl Stage {
    fn new() -> Self {
        let scene = Scene::named("working-space").unwrap();
        // Straight ahead, 2 m away.
        let place = *scene
            .places
            .iter()
            .find(|p| p.position.to_array() == [0.0, 2.4] && p.facing_rad == 0.0)
            .unwrap();
        let person = Person { name: "somebody".to_owned(), height_m: 1.75, build: 1.0, manner: None };
        Self { scene, place, person }
    }

    fn recorded(&self, file: &'static str, action: &str, label: Category) -> Option<Seen> {
        let path = recorded(&format!("mocap/{file}"))?;
        let (_, motion) = Motion::open(&path).unwrap();
        let (_, all) = actions::beside(&path).unwrap().expect("the captures have a table");
        let found = all.iter().find(|a| a.name == action).unwrap();
        let recast = Recast {
            person: &self.person,
            place: self.place,
            radar: self.scene.radar.position,
            label: Some(label),
            side: Side::Right,
        };
        let performance = Recorded::new(&motion, found.start..=found.end, &recast).unwrap();
        let joints = |time_s| performance.joints(time_s);
        Some(self.see(Source::Recorded(person_of(file)), &performance, None, &joints, 0))
    }

    fn generated(&self, manner: Manner, seed: u64, label: Category) -> Seen {
        let rng = &mut ChaCha8Rng::seed_from_u64(seed);
        let brief = Brief {
            person: &self.person,
            place: self.place,
            radar: self.scene.radar.position,
            label: Some(label),
            objects: &[label.object],
            offsets: &[],
            manner,
            within_reach: &[],
            covers_db: 0.0,
            behind_m: None,
            stay: None,
        };
        let performance = Generated::new(&brief, rng).unwrap();
        let joints = |time_s| performance.joints(time_s);
        self.see(Source::Generated(manner), &performance, Some(performance.fixtures()), &joints, seed)
    }

    fn see(
        &self,
        source: Source,
        performance: &dyn Performance,
        fixtures: Option<(&Surface, &[Vec3])>,
        joints: &dyn Fn(f64) -> rfhoi::simulate::body::Joints,
        seed: u64,
    ) -> Seen {
        const STEP_S: f64 = 0.02;
        const COUNTS_DB: f32 = 30.0;
        const QUIET_DB: f32 = 25.0;
        let effects = Effects::of(Domain::Site);
        let mut radar = Radar::new(&self.scene, effects).unwrap();
        let take = Take { scene: &self.scene, performance, fixtures, tags: &[], effects };
        radar.begin(fixtures, &mut ChaCha8Rng::seed_from_u64(seed));
        let chirps = radar.config().profile.clone();
        let frames: Vec<_> = take
            .frame_times(&chirps)
            .map(|time_s| {
                radar.look(performance, time_s);
                radar.maps()
            })
            .collect();
        let levels = strongest_ranges(&radar, &frames);
        let top = levels.iter().copied().fold(f32::NEG_INFINITY, f32::max);
        let middle = levels.nrows() / 2;
        let fastest = levels
            .indexed_iter()
            .filter(|(_, l)| **l > top - COUNTS_DB)
            .map(|((v, _), _)| v.abs_diff(middle));
        let doppler_m_s = fastest.max().unwrap_or(0) as f32 * chirps.velocity_bin().0;
        let quiet: Vec<bool> =
            levels.columns().into_iter().map(|c| c.iter().all(|&l| l < top - QUIET_DB)).collect();
        let lively = |mut frames: std::ops::Range<usize>, back: bool| {
            let first = if back { frames.rfind(|&n| !quiet[n]) } else { frames.find(|&n| !quiet[n]) };
            first.unwrap_or_default()
        };
        let [begin, end] = [false, true].map(|back| lively(0..quiet.len(), back));

        let times: Vec<f64> =
            (0..=(take.performance.duration_s() / STEP_S) as usize).map(|i| i as f64 * STEP_S).collect();
        let at = |time_s: f64, joint: Joint| joints(time_s)[joint.index()];
        let speed = |joint: Joint| {
            times
                .iter()
                .map(|&t| at(t + STEP_S, joint).distance(at(t, joint)) / STEP_S as f32)
                .fold(0.0, f32::max)
        };
        let hips = times.iter().map(|&t| at(t, Joint::HipCentre).z);
        let (low, high) = hips.fold((f32::INFINITY, 0.0_f32), |(low, high), z| (low.min(z), high.max(z)));
        Seen {
            source,
            duration_s: performance.duration_s(),
            hand_m_s: speed(Joint::HandRight).max(speed(Joint::HandLeft)),
            head_m_s: speed(Joint::Head),
            fastest_m_s: LIMBS.into_iter().map(speed).fold(0.0, f32::max),
            hips_m: high - low,
            doppler_m_s,
            quiet: quiet.iter().filter(|&&q| q).count() as f32 / quiet.len() as f32,
            profile: profile(&levels.slice_axis(ndarray::Axis(1), (begin..=end).into()).to_owned()),
            levels,
        }
    }
}

/// The part of a file's name that tells people apart.
fn person_of(file: &'static str) -> &'static str {
    let name = file.rsplit('/').next().unwrap_or(file);
    name.split('_').nth(1).unwrap_or(name)
}

/// Recorded and generated performances of an action.
struct Compared {
    name: &'static str,
    recorded: Vec<Seen>,
    generated: Vec<Seen>,
}

/// All actions, and the recorded people at the shelf.
fn all() -> Option<(Vec<Compared>, Vec<Seen>)> {
    let stage = Stage::new();
    let recorded =
        |&(name, files, label): &(&'static str, [&'static str; 6], Category)| -> Option<Vec<Seen>> {
            files.iter().map(|file| stage.recorded(file, name, label)).collect()
        };
    let generated = |label: Category| -> Vec<Seen> {
        let seeds = || (0..GENERATED).map(|seed| 100 * label.action.index() as u64 + seed);
        let each = Manner::ALL.into_iter().flat_map(|m| seeds().map(move |seed| (m, seed)));
        each.map(|(manner, seed)| stage.generated(manner, seed, label)).collect()
    };
    std::thread::scope(|scope| {
        let shelf = scope.spawn(|| recorded(&SHELF));
        let threads = ACTIONS.iter().map(|action| {
            scope.spawn(|| {
                let recorded = recorded(action)?;
                Some(Compared { name: action.0, recorded, generated: generated(action.2) })
            })
        });
        let threads: Vec<_> = threads.collect();
        let all = threads.into_iter().map(|t| t.join().unwrap()).collect::<Option<_>>();
        Some((all?, shelf.join().unwrap()?))
    })
}

fn figures(all: &[Compared]) {
    println!("\nmedian of                     duration   hand   head   limb   hips  Doppler  quiet frames");
    println!("                                    s    m/s    m/s    m/s      m      m/s             %");
    for action in all {
        let by =
            |manner| action.generated.iter().filter(move |s| s.source == Source::Generated(manner)).collect();
        let rows: [(&str, Vec<&Seen>); 4] = [
            ("recorded", action.recorded.iter().collect()),
            ("generated, minimum jerk", by(Manner::MinimumJerk)),
            ("generated, varied", by(Manner::Varied)),
            ("generated, sigma-lognormal", by(Manner::SigmaLognormal)),
        ];
        println!("{}", action.name);
        for (name, seen) in rows {
            let median = |of: fn(&Seen) -> f64| {
                let mut values: Vec<f64> = seen.iter().map(|s| of(s)).collect();
                values.sort_by(f64::total_cmp);
                values[values.len() / 2]
            };
            println!(
                "  {name:<27}{:>8.1}{:>7.2}{:>7.2}{:>7.2}{:>7.2}{:>9.2}{:>14.0}",
                median(|s| s.duration_s),
                median(|s| s.hand_m_s.into()),
                median(|s| s.head_m_s.into()),
                median(|s| s.fastest_m_s.into()),
                median(|s| s.hips_m.into()),
                median(|s| s.doppler_m_s.into()),
                100.0 * median(|s| s.quiet.into()),
            );
        }
    }
}

/// Distances of recorded people to generated ones, action by action.
struct Row {
    /// To recorded people of the same action, but other people.
    within: f32,
    /// Mean to the generated ones of each action.
    to: Vec<f32>,
    /// For how many the generated action that is nearest is theirs.
    right: usize,
}

/// Mean distance between all of `a` and all of `b` that `apart` lets be compared.
fn mean_distance(a: &[&Seen], b: &[Seen], apart: impl Fn(&Seen, &Seen) -> bool) -> f32 {
    let pairs = a.iter().flat_map(|s| b.iter().map(move |t| (*s, t))).filter(|(s, t)| apart(s, t));
    let (sum, count) = pairs
        .map(|(s, t)| distance(&s.profile, &t.profile))
        .fold((0.0, 0), |(sum, count), d| (sum + d, count + 1));
    sum / count as f32
}

fn row(recorded: &[Seen], own: usize, all: &[Compared]) -> Row {
    let to = |seen: &[&Seen], b: &Compared| mean_distance(seen, &b.generated, |_, _| true);
    let nearest =
        |seen: &Seen| (0..all.len()).min_by(|&x, &y| to(&[seen], &all[x]).total_cmp(&to(&[seen], &all[y])));
    let seen: Vec<&Seen> = recorded.iter().collect();
    Row {
        within: mean_distance(&seen, recorded, |s, t| s.source != t.source),
        to: all.iter().map(|b| to(&seen, b)).collect(),
        right: recorded.iter().filter(|seen| nearest(seen) == Some(own)).count(),
    }
}

#[test]
fn recorded_people_look_like_generated_ones_where_these_do_the_same() {
    let Some((all, shelf)) = all() else { return };
    figures(&all);
    println!("\nmean distance, 0 to 1         to recorded       to generated ones, by action");
    print!("{:<30}{:<18}", "", "of other people");
    all.iter().for_each(|b| print!("{:>10}", b.name));
    println!("   nearest is theirs");
    let show = |name: &str, row: &Row, of: usize| {
        print!("recorded {name:<21}{:<18.3}", row.within);
        row.to.iter().for_each(|d| print!("{d:>10.3}"));
        println!("{:>8} of {of}", row.right);
        assert!(row.within.is_finite() && row.to.iter().all(|d| d.is_finite()), "{name}");
    };
    let rows: Vec<Row> = all.iter().enumerate().map(|(n, a)| row(&a.recorded, n, &all)).collect();
    for (row, action) in rows.iter().zip(&all) {
        show(action.name, row, action.recorded.len());
    }
    let picks_up = ACTIONS.iter().position(|a| a.0 == SHELF.0).expect("it is one of them");
    show("pick_up (shelf)", &row(&shelf, picks_up, &all), shelf.len());
    for a in &all {
        print!("generated {:<38}", a.name);
        let seen: Vec<&Seen> = a.generated.iter().collect();
        for b in &all {
            print!("{:>10.3}", mean_distance(&seen, &b.generated, |s, t| !std::ptr::eq(s, t)));
        }
        println!();
    }
    // People who sit down and stand up do what the generated ones do. Those who pick up from the floor and put down on it crouch,
    // which nobody who is generated does: they are as near to other actions, and nothing is asserted of them.
    for n in 0..2 {
        let (row, name) = (&rows[n], all[n].name);
        assert!(row.right >= 5, "{name}: {} are nearest to their own", row.right);
        let others = (0..all.len()).filter(|&m| m != n).map(|m| row.to[m]).fold(f32::INFINITY, f32::min);
        assert!(row.to[n] + 0.05 < others, "{name}: {} to their own, {others} to another", row.to[n]);
    }
    if let Some(folder) = std::env::var_os("RFHOI_PICTURES") {
        std::fs::create_dir_all(&folder).unwrap();
        picture(&all).save(PathBuf::from(folder).join("real_motion.png")).unwrap();
    }
}

/// The most typical of each kind, side by side.
fn picture(all: &[Compared]) -> Figure {
    let velocity = |seen: &Seen| {
        let profile = rfhoi_shared::radar::RadarProfile::bridge();
        let half = f64::from(profile.velocity_bin().0) * seen.levels.nrows() as f64 / 2.0;
        Axis::new("velocity", "m/s", -half, half)
    };
    let panel = |name: &str, what: &str, seen: &Seen| {
        let top = seen.levels.iter().copied().fold(f32::NEG_INFINITY, f32::max);
        Panel::Heatmap(Heatmap {
            title: format!("{name}, {what}"),
            values: seen.levels.clone(),
            x: Axis::new("time", "s", 0.0, seen.duration_s),
            y: velocity(seen),
            scale: ColourScale::new("level", "dB").with_range(top - 40.0, top),
            reduce: Reduce::Max,
        })
    };
    let panels = all.iter().flat_map(|action| {
        let by = |manner| {
            action.generated.iter().filter(|s| s.source == Source::Generated(manner)).collect::<Vec<_>>()
        };
        let name = action.name.replace('_', " ");
        [
            ("recorded", action.recorded.iter().collect()),
            ("generated, minimum jerk", by(Manner::MinimumJerk)),
            ("generated, varied", by(Manner::Varied)),
            ("generated, sigma-lognormal", by(Manner::SigmaLognormal)),
        ]
        .map(|(what, group): (&str, Vec<&Seen>)| panel(&name, what, typical(&group)))
    });
    Figure {
        title: Some("Velocity over time, simulated radar: recorded people, and generated ones".to_owned()),
        columns: 4,
        width: 2_480,
        panel_height: 380,
        ..Figure::new(panels.collect())
    }
}

/// The one that is nearest to the others.
fn typical<'s>(group: &[&'s Seen]) -> &'s Seen {
    let to_others =
        |seen: &Seen| group.iter().map(|other| distance(&seen.profile, &other.profile)).sum::<f32>();
    group.iter().copied().min_by(|a, b| to_others(a).total_cmp(&to_others(b))).expect("a group is not empty")
}
