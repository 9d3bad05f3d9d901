//! The paper's section 5 on simulated data: studies of what changes accuracy, each a table by one command.
//!
//! ```text
//! sets --listings--> [studies] --arms, runs--> [plan] --run.json, each in a process of its own--> [run] --result.json-->
//!   [table] --> NAME.json, NAME.txt --> [report], [picture] --> README.md, NAME.svg
//! ```
//!
//! [`chart`] plans runs of its own and times them.
//!
//! A run's folder is named after all that decides it, so studies share runs, and what was done is not done again. A folder
//! holds what was learnt from and tested on by number: `run.json`.

mod chart;
mod picture;
mod plan;
mod report;
mod run;
mod scenes;
mod sets;
mod studies;
mod table;

use std::path::PathBuf;

use anyhow::{Context, ensure};
use clap::error::ErrorKind;
use clap::{ArgMatches, Args, Command, FromArgMatches, Subcommand};
use rfhoi::atomic;

pub(super) use report::Report;
pub(super) use run::RunArgs;
pub(super) use sets::Sets;
pub(super) use studies::STUDIES;

use super::runs::{Job, Runs, cores, path};
use crate::commands::listen_for_ctrl_c;
use plan::{Plan, Scale};
use studies::Study;
use table::Table;

/// How large the studies of a folder were.
const SCALE: &str = "scale.json";

/// Options of every study.
#[derive(Debug, Args)]
pub(in super::super) struct StudyArgs {
    /// Folder of the data sets, as `rfhoi experiment sets` makes them.
    #[arg(long, value_name = "DIR")]
    sets: PathBuf,
    /// Folder for all runs and the tables; what is there already is not done again.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Random draws of each training.
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u64).range(1..=100))]
    seeds: u64,
    /// Trainings at a time; by default one for each core.
    #[arg(long)]
    workers: Option<usize>,
    /// One epoch of a tiny network on a few samples: shows that everything runs, not what it reaches.
    #[arg(long)]
    quick: bool,
    /// Epochs of pre-training, of fine-tuning, and of training from scratch.
    #[arg(long, num_args = 3, value_names = ["PRE", "FINE", "SCRATCH"])]
    epochs: Option<Vec<u32>>,
    /// Simulated samples to pre-train on, at most.
    #[arg(long, value_name = "SAMPLES")]
    pre_training: Option<usize>,
}

impl StudyArgs {
    fn scale(&self) -> Scale {
        let mut scale = if self.quick { Scale::quick() } else { Scale::full() };
        scale.seeds = if self.quick { 1 } else { self.seeds };
        if let Some([pre, fine, scratch]) = self.epochs.as_deref() {
            (scale.pre_epochs, scale.fine_epochs, scale.scratch_epochs) = (*pre, *fine, *scratch);
        }
        scale.pre_samples = self.pre_training.unwrap_or(scale.pre_samples);
        scale
    }

    /// Folder of all runs.
    fn runs(&self) -> PathBuf {
        self.out.join("runs")
    }

    /// Does the runs that are not done yet.
    fn train(&self, plan: &Plan) -> anyhow::Result<()> {
        let runs = Runs { workers: self.workers.unwrap_or_else(cores) };
        for wave in plan.waves() {
            let mut jobs = Vec::new();
            for run in wave {
                let folder = self.runs().join(run.folder());
                if run.is_done(&folder) {
                    continue;
                }
                run.write(&folder)?;
                let words = ["experiment", "run", "--sets", &path(&self.sets), "--out", &path(&folder)];
                jobs.push(Job { words: words.map(String::from).into(), folder });
            }
            runs.all(&jobs)?;
        }
        Ok(())
    }

    /// Does all that `studies` need and writes their tables.
    pub(super) fn run(&self, studies: &[Study], json: bool) -> anyhow::Result<()> {
        listen_for_ctrl_c()?;
        let mut plan = Plan::new(&self.sets, self.scale())?;
        let arms = studies.iter().map(|study| (study.arms)(&mut plan)).collect::<anyhow::Result<Vec<_>>>()?;
        self.train(&plan)?;
        for (study, arms) in studies.iter().zip(arms) {
            let mut table = Table::of(study, &arms, &self.runs())?;
            if study.name == scenes::NAME {
                table.costs = scenes::costs()?;
            }
            ensure!(!table.rows.is_empty(), "{} has nothing to compare", study.name);
            table.write(&self.out)?;
            if json {
                println!("{}", serde_json::to_string(&table)?);
            } else {
                println!("{}", table.text());
            }
        }
        self.write_scale()
    }

    /// Leaves beside the results how large they were.
    fn write_scale(&self) -> anyhow::Result<()> {
        let scale = serde_json::to_vec_pretty(&self.scale())?;
        atomic::write(self.out.join(SCALE), &scale).context("cannot write how large it was")
    }
}

/// One study, chosen on the command line by its name.
#[derive(Debug)]
pub(super) struct Chosen {
    study: &'static Study,
    args: StudyArgs,
}

impl Chosen {
    pub(super) fn run(&self, json: bool) -> anyhow::Result<()> {
        self.args.run(std::slice::from_ref(self.study), json)
    }
}

impl FromArgMatches for Chosen {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let chosen = matches.subcommand();
        let study = chosen.and_then(|(name, args)| Some((STUDIES.iter().find(|s| s.name == name)?, args)));
        let (study, args) = study.ok_or_else(|| clap::Error::new(ErrorKind::InvalidSubcommand))?;
        Ok(Self { study, args: StudyArgs::from_arg_matches(args)? })
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

impl Subcommand for Chosen {
    fn augment_subcommands(command: Command) -> Command {
        let of = |study: &Study| StudyArgs::augment_args(Command::new(study.name)).about(study.title);
        command.subcommands(STUDIES.iter().map(of))
    }

    fn augment_subcommands_for_update(command: Command) -> Command {
        Self::augment_subcommands(command)
    }

    fn has_subcommand(name: &str) -> bool {
        STUDIES.iter().any(|study| study.name == name)
    }
}
