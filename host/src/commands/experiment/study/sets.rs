//! The data sets that studies take, each by the command that makes it.

use std::path::PathBuf;

use clap::Args;

use crate::commands::experiment::runs::{Job, Runs};
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

/// A set: its name, what `rfhoi simulate` is told, and its samples in full and in a quick form.
struct Recipe {
    name: &'static str,
    words: &'static str,
    samples: [u32; 2],
}

/// Site and train are those of the model's card.
const RECIPES: [Recipe; 8] = [
    Recipe {
        name: TRAIN,
        words: "--domain train --with all --rooms 80 --nothing 0.12 --seed 3",
        samples: [12_000, 24],
    },
    Recipe { name: SITE, words: "--domain site --nothing 0.0787 --seed 2", samples: [2_600, 80] },
    // The paper's 78 setups (section 4.2).
    Recipe { name: SETUPS, words: "--domain site --setups 78 --seed 5", samples: [2_600, 80] },
    Recipe { name: UNSEEN, words: "--domain site --categories unseen --seed 6", samples: [600, 10] },
    Recipe { name: STILL, words: "--domain site --seed 7", samples: [510, 17] },
    Recipe { name: HAND, words: "--domain site --seed 7 --circumstance hand", samples: [510, 17] },
    Recipe { name: BODY, words: "--domain site --seed 7 --circumstance body", samples: [510, 17] },
    Recipe { name: SECOND, words: "--domain site --seed 7 --circumstance second-person", samples: [510, 17] },
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
            let mut words = vec!["simulate".to_owned()];
            words.extend(recipe.words.split(' ').map(str::to_owned));
            words.extend(["--count".into(), recipe.samples[usize::from(self.quick)].to_string()]);
            Job { option: "--set", out: self.out.join(recipe.name), words }
        });
        Runs { workers: 1 }.all(&jobs)
    }
}
