//! The data sets that studies take, each by the command that makes it.

use std::path::PathBuf;

use clap::Args;

use crate::commands::experiment::runs::{Job, Runs, path};
use crate::commands::listen_for_ctrl_c;

/// Simulated rooms and people to pre-train on.
pub(super) const TRAIN: &str = "train";
/// The simulated site: three other rooms, five other people, who move by another law.
pub(super) const SITE: &str = "site";
/// The site again, in setups: a room, a person, a place and a way to look each.
pub(super) const SETUPS: &str = "setups";
/// The site with things that are in no other set.
pub(super) const UNSEEN: &str = "unseen";
/// The site once more, and the same performances with the tag under the hand, with things behind the person, and with
/// somebody else in the room.
pub(super) const STILL: &str = "still";
pub(super) const HAND: &str = "hand";
pub(super) const BODY: &str = "body";
pub(super) const SECOND: &str = "second-person";

/// A radar's profile that the chart holds against the default: the set of the site's performances that it sees, and what
/// `rfhoi simulate` is told of it.
pub(super) struct Radar {
    pub(super) set: &'static str,
    pub(super) words: &'static str,
}

/// The default, of all other sets too.
pub(super) const BRIDGE: Radar = Radar { set: SITE, words: "" };
/// Velocity bins twice as wide.
pub(super) const FEWER_LOOPS: Radar = Radar { set: "site-32-loops", words: "--loops 32" };
/// Range bins twice as wide.
pub(super) const FEWER_SAMPLES: Radar = Radar { set: "site-64-samples", words: "--samples 64" };
/// Two transmitters of three: no elevation.
pub(super) const FEWER_TRANSMITTERS: Radar = Radar { set: "site-2-transmitters", words: "--transmitters 2" };

/// The paper's profile (its section 4.1).
const PAPER: &str = "--profile paper";
/// A scene that is seen as it needs, and as the paper would: two sets of the same performances.
pub(super) struct Seen {
    pub(super) scene: &'static str,
    pub(super) as_needed: &'static str,
    pub(super) as_paper: &'static str,
    words: &'static str,
}

/// From the least to the most that is needed. Their files' profiles are the planner's choices.
pub(super) const SCENES: [Seen; 3] = [
    Seen {
        scene: "cabinet",
        as_needed: "cabinet",
        as_paper: "cabinet-paper",
        words: "--domain site --scene cabinet --seed 8",
    },
    Seen {
        scene: "kitchen",
        as_needed: "kitchen",
        as_paper: "kitchen-paper",
        words: "--domain site --scene kitchen --seed 8",
    },
    Seen {
        scene: "work-room",
        as_needed: "work-room",
        as_paper: "work-room-paper",
        words: "--domain site --scene work-room --seed 8",
    },
];

/// A set: its name, what `rfhoi simulate` is told besides the radar, the radar, and its samples in full and in a quick form.
struct Recipe {
    name: &'static str,
    words: &'static str,
    radar: Radar,
    samples: [u32; 2],
}

/// What makes the site.
const SITE_WORDS: &str = "--domain site --nothing 0.0787 --seed 2";

/// By the default radar.
const fn recipe(name: &'static str, words: &'static str, samples: [u32; 2]) -> Recipe {
    Recipe { name, words, radar: BRIDGE, samples }
}

/// The site by another radar.
const fn site_by(radar: Radar) -> Recipe {
    Recipe { name: radar.set, words: SITE_WORDS, radar, samples: [2_600, 48] }
}

const fn as_needed(seen: &Seen) -> Recipe {
    recipe(seen.as_needed, seen.words, [510, 6])
}

const fn as_paper(seen: &Seen) -> Recipe {
    let radar = Radar { set: seen.as_paper, words: PAPER };
    Recipe { name: radar.set, words: seen.words, radar, samples: [510, 6] }
}

/// Site and train are those of the model's card.
const RECIPES: [Recipe; 17] = [
    recipe(TRAIN, "--domain train --with all --rooms 80 --nothing 0.12 --seed 3", [12_000, 24]),
    recipe(SITE, SITE_WORDS, [2_600, 48]),
    // The paper's 78 setups (section 4.2).
    recipe(SETUPS, "--domain site --setups 78 --seed 5", [2_600, 40]),
    recipe(UNSEEN, "--domain site --categories unseen --seed 6", [600, 10]),
    recipe(STILL, "--domain site --seed 7", [510, 12]),
    recipe(HAND, "--domain site --seed 7 --circumstance hand", [510, 12]),
    recipe(BODY, "--domain site --seed 7 --circumstance body", [510, 12]),
    recipe(SECOND, "--domain site --seed 7 --circumstance second-person", [510, 12]),
    site_by(FEWER_LOOPS),
    site_by(FEWER_SAMPLES),
    site_by(FEWER_TRANSMITTERS),
    as_needed(&SCENES[0]),
    as_needed(&SCENES[1]),
    as_needed(&SCENES[2]),
    as_paper(&SCENES[0]),
    as_paper(&SCENES[1]),
    as_paper(&SCENES[2]),
];

/// `rfhoi experiment sets`.
#[derive(Debug, Args)]
pub(in super::super) struct Sets {
    /// Folder for the sets' folders; what is there already is not made again.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// A few samples of each, for `--quick`.
    #[arg(long)]
    quick: bool,
}

impl Sets {
    pub(in super::super) fn run(&self) -> anyhow::Result<()> {
        listen_for_ctrl_c()?;
        // One after the other: each takes all cores.
        let jobs = RECIPES.map(|recipe| {
            let folder = self.out.join(recipe.name);
            let mut words = vec!["simulate".to_owned()];
            let told = [recipe.words, recipe.radar.words];
            words.extend(told.iter().flat_map(|words| words.split_whitespace()).map(str::to_owned));
            words.extend(["--count".into(), recipe.samples[usize::from(self.quick)].to_string()]);
            words.extend(["--set".into(), path(&folder)]);
            Job { folder, words }
        });
        Runs { workers: 1 }.all(&jobs)
    }
}
