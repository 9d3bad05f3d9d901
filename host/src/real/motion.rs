//! Recorded motions of real people in simulated rooms, each beside a generated one in the same situation.
//!
//! ```text
//! folder with ACTION_INDEX.tsv --[list]--> [Listed]: motions of sitting down, standing up, picking up, putting down
//!                         each motion x setup --[perform]--> two [Seen]: the recorded and the generated person, as the network takes them
//! ```
//!
//! A setup is a room of the simulated site, a person's build, a place, a way to look and six tagged things, drawn from a seed; those of
//! an action are the same for all its motions. Beside each recorded performance ([`Among`]) stands a generated one with its own
//! layout of things, which the recorded one shares, and with the same noise and reader's session. So only the motion differs, and what
//! follows from it: where the thing lies that is picked up or put down, and who stands back to reach it. What a recording does not
//! tell is the same in both: people who rest before and after (the recorded ones quite still), no fingers, no clothes, no chair that is
//! pushed. Rooms, bodies and places are those of the site, which the network that ships has been tuned on; the motion is new to it.

mod figures;

use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use rfhoi_network::sample::{MAX_FRAMES, Sample};
use serde::Serialize;

use self::figures::Acted;
pub use self::figures::Figures;
use crate::align::AlignError;
use crate::features::{Settings, of_sample};
use crate::hoi::{Action, CATEGORIES, Category};
use crate::jobs::Jobs;
use crate::motion::{Motion, MotionError, actions};
use crate::simulate::draw::{Draw, Wanted, draw};
use crate::simulate::effects::{Domain, Effects};
use crate::simulate::recorded::Among;
use crate::simulate::sample::{self, Maker, SampleError, Take, epoch};
use crate::simulate::scene::Scene;

/// What motions are looked for.
pub const ACTIONS: [Action; 4] = [Action::SitDown, Action::StandUp, Action::PickUp, Action::PutDown];
/// Whose rooms, people and generated motion stand beside.
pub const DOMAIN: Domain = Domain::Site;

/// Why there is nothing to compare.
#[derive(Debug, thiserror::Error)]
pub enum MotionsError {
    /// No table of actions.
    #[error(
        "{0} holds no {name}, which lists the frames of each action: give the folder that has it, as mocap of the captures, or write one \
         with the columns file, action, start and end, tab-separated",
        name = actions::NAME
    )]
    NoIndex(PathBuf),
    /// None of the actions.
    #[error(
        "{0} lists none of sit_down, stand_up, pick_up, put_down: add rows of them, or give another folder"
    )]
    NoActions(PathBuf),
    /// A motion is not there.
    #[error(
        "{table} lists {file}, which is neither in its folder nor in one below: put it there, or remove its rows"
    )]
    NoFile {
        /// The table.
        table: PathBuf,
        /// The motion.
        file: String,
    },
    /// A folder cannot be read.
    #[error("cannot read the folder {path}: {source}")]
    Folder {
        /// The folder.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// A motion or the table.
    #[error(transparent)]
    Motion(#[from] MotionError),
    /// None of the motions can be performed.
    #[error("none of the motions can be performed; the first: {file}: {why}")]
    Refused {
        /// The first.
        file: String,
        /// What is wrong with it.
        why: String,
    },
    /// The simulator.
    #[error(transparent)]
    Sample(#[from] SampleError),
    /// No stream for these features.
    #[error(transparent)]
    Align(#[from] AlignError),
    /// The user stopped it.
    #[error("stopped; nothing was written")]
    Interrupted,
}

/// A recorded motion of one of the [`ACTIONS`].
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Listed {
    /// Name of its file.
    pub file: String,
    /// Who moves: the part of the file's name that tells people apart, after the folder's name.
    pub person: String,
    /// What they do.
    pub action: Action,
    /// Number of the first frame.
    pub first_frame: u32,
    /// Number of the last one.
    pub last_frame: u32,
    #[serde(skip)]
    path: PathBuf,
}

/// Who moves in a performance.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// A recorded person.
    Recorded,
    /// A generated one.
    Generated,
}

/// Where motions are performed.
#[derive(Debug, Clone, Copy)]
pub struct Situations<'a> {
    /// The rooms.
    pub scenes: &'a [Scene],
    /// Seed of everything.
    pub seed: u64,
    /// Setups of each motion.
    pub setups: u32,
    /// What features are made of.
    pub settings: Settings,
    /// Threads.
    pub workers: usize,
}

/// A performance as both radios see it.
#[derive(Debug, Clone)]
pub struct Seen {
    /// Number of the motion, in the list; of a generated one, that which it stands beside.
    pub motion: usize,
    /// Number of the setup.
    pub setup: u32,
    /// Who moves.
    pub kind: Kind,
    /// Where and with what.
    pub draw: Draw,
    /// As the network takes it; objects are numbers of [`Object::ALL`](crate::hoi::Object::ALL).
    pub sample: Sample,
    /// What it looks like.
    pub figures: Figures,
}

/// What was performed.
#[derive(Debug, Clone, Default)]
pub struct Performed {
    /// By motion and setup, the recorded one before the generated one.
    pub seen: Vec<Seen>,
    /// Motions that cannot be performed, by number, and why.
    pub left_out: Vec<(usize, String)>,
}

/// The motions of [`ACTIONS`] that the table in `folder` lists, in its order; files are in the folder or in one below.
///
/// # Errors
/// If there is no table, or it lists none of them, or what is not there.
pub fn list(folder: &Path) -> Result<Vec<Listed>, MotionsError> {
    let table = folder.join(actions::NAME);
    if !table.is_file() {
        return Err(MotionsError::NoIndex(folder.to_path_buf()));
    }
    let files = files(folder)?;
    let mut listed = Vec::new();
    for (file, row) in actions::all(&table)? {
        let named = Action::named(&row.name.replace('_', " "));
        let Some(action) = named.filter(|action| ACTIONS.contains(action)) else { continue };
        let Some(path) = files.get(&file).cloned() else {
            return Err(MotionsError::NoFile { table, file });
        };
        let person = person(folder, &path);
        listed.push(Listed { file, person, action, first_frame: row.start, last_frame: row.end, path });
    }
    if listed.is_empty() { Err(MotionsError::NoActions(table)) } else { Ok(listed) }
}

/// Files of a folder and of those in it, by name; of two with one name, that which is not below.
fn files(folder: &Path) -> Result<BTreeMap<String, PathBuf>, MotionsError> {
    let entries = |folder: &Path| {
        let paths = std::fs::read_dir(folder)
            .and_then(|all| all.map(|entry| Ok(entry?.path())).collect::<io::Result<Vec<_>>>());
        paths.map(|mut paths| {
            paths.sort();
            paths
        })
    };
    let unread = |path: &Path| {
        let path = path.to_path_buf();
        |source| MotionsError::Folder { path, source }
    };
    let mut all = entries(folder).map_err(unread(folder))?;
    let below: Vec<PathBuf> = all.iter().filter(|path| path.is_dir()).cloned().collect();
    for folder in below {
        all.extend(entries(&folder).map_err(unread(&folder))?);
    }
    let mut files = BTreeMap::new();
    for path in all.into_iter().filter(|path| path.is_file()) {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        files.entry(name).or_insert(path);
    }
    Ok(files)
}

/// Names of motions are of parts with `_` between, of which the second says who it is: `joints_s01_e01.txt`,
/// `HDM_bd_grabHighR_002_120.amc`.
fn person(folder: &Path, path: &Path) -> String {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let who = stem.split('_').nth(1).unwrap_or(&stem);
    match path.parent().filter(|parent| *parent != folder).and_then(Path::file_name) {
        Some(below) => format!("{}/{who}", below.to_string_lossy()),
        None => who.to_owned(),
    }
}

/// What was performed of one motion, or why it cannot be.
type OfMotion = Result<Vec<Seen>, String>;

/// Performs all motions in all their setups. `progress` is told the share that is done, 0 to 1, and says whether to go on.
///
/// # Errors
/// If a motion cannot be read, none can be performed, or the rooms lack something.
pub fn perform(
    listed: &[Listed],
    situations: &Situations<'_>,
    progress: &mut dyn FnMut(f64) -> bool,
) -> Result<Performed, MotionsError> {
    let Situations { scenes, seed, setups, workers, .. } = *situations;
    let results: Vec<OnceLock<OfMotion>> = listed.iter().map(|_| OnceLock::new()).collect();
    let jobs = Jobs::new(listed.len(), listed.len() * setups as usize);
    jobs.run(workers, progress, |jobs| {
        let mut maker = Maker::new(DOMAIN, seed, Effects::of(DOMAIN), scenes)?;
        while let Some(number) = jobs.next() {
            // Each motion is one thread's.
            let _ = results[number].set(one(&listed[number], number, situations, &mut maker, jobs)?);
        }
        Ok::<_, MotionsError>(())
    })?;
    let mut performed = Performed::default();
    for (number, result) in results.into_iter().enumerate() {
        match result.into_inner() {
            Some(Ok(seen)) => performed.seen.extend(seen),
            Some(Err(why)) => performed.left_out.push((number, why)),
            None => {}
        }
    }
    match performed.left_out.first() {
        Some((number, why)) if performed.seen.is_empty() => {
            Err(MotionsError::Refused { file: listed[*number].file.clone(), why: why.clone() })
        }
        _ => Ok(performed),
    }
}

/// Performs motion `number` in its setups.
fn one(
    listed: &Listed,
    number: usize,
    situations: &Situations<'_>,
    maker: &mut Maker<'_>,
    jobs: &Jobs,
) -> Result<OfMotion, MotionsError> {
    let Situations { scenes, seed, setups, ref settings, .. } = *situations;
    let effects = Effects::of(DOMAIN);
    let categories: Vec<Category> = CATEGORIES.into_iter().filter(|c| c.action == listed.action).collect();
    let draws = draw(&Wanted { samples: setups, ..Wanted::one(DOMAIN, seed, &categories) }, scenes);
    let (_, motion) = Motion::open(&listed.path)?;
    let frames = listed.first_frame..=listed.last_frame;
    let mut seen = Vec::with_capacity(2 * draws.len());
    for (setup, mut draw) in (0..setups).zip(draws) {
        if jobs.stopped() {
            return Err(MotionsError::Interrupted);
        }
        // Who and where is the setup's; how things lie, how the generated person moves and all noise are this pair's own.
        draw.sample = (number as u32).wrapping_mul(setups).wrapping_add(setup);
        let scene = &scenes[draw.scene];
        let (generated, tags) = sample::perform(DOMAIN, seed, &draw, scene)?;
        let take = Take::of(scene, &generated, &tags, effects);
        let among = Among::new(&motion, frames.clone(), (scene, &draw), &generated);
        let among = among.map_err(|error| error.to_string()).and_then(|among| {
            let recorded = Take { performance: &among, ..take };
            let count = recorded.frame_times(&maker.radar(draw.scene).profile).len();
            let most = || {
                format!(
                    "it takes {count} frames of the radar, of which an answer rests on {MAX_FRAMES} at most"
                )
            };
            if count <= MAX_FRAMES { Ok(among) } else { Err(most()) }
        });
        let among = match among {
            Ok(among) => among,
            Err(why) => {
                jobs.done((setups - setup) as usize);
                return Ok(Err(why));
            }
        };
        let both = [
            (
                Kind::Recorded,
                Acted {
                    take: Take { performance: &among, ..take },
                    joints: &|time_s| among.joints(time_s),
                    side: among.side(),
                    acts_s: among.interaction_s(),
                    past_edge_m: among.past_edge_m(),
                },
            ),
            (
                Kind::Generated,
                Acted {
                    take,
                    joints: &|time_s| generated.joints(time_s),
                    side: generated.side(),
                    acts_s: generated.interaction_s(),
                    past_edge_m: 0.0,
                },
            ),
        ];
        for (kind, acted) in both {
            let measured = maker.measure(&draw, &acted.take, acted.acts_s.clone());
            let radar = maker.radar(draw.scene);
            let stream = settings.stream(radar).map_err(AlignError::from)?;
            let frames = of_sample(&measured, epoch(&effects), &stream, settings)?;
            let figures = Figures::of(&acted, &draw, &measured, &radar.profile);
            let sample = Sample {
                frames,
                objects: draw.objects.iter().map(|object| object.index()).collect(),
                action: draw.label.map(|label| label.action.index()),
                target: draw.target,
                ..Sample::default()
            };
            seen.push(Seen { motion: number, setup, kind, draw: draw.clone(), sample, figures });
        }
        jobs.done(1);
    }
    Ok(Ok(seen))
}
