//! `rfhoi experiment`: trainings side by side, as tables.

mod branch;
mod latency;
mod real_motion;
mod real_radar;
mod real_reads;
mod runs;
mod stages;
mod study;

use clap::{Args, Subcommand};

pub(super) use study::StudyArgs;

use study::STUDIES;

/// `rfhoi experiment`.
#[derive(Debug, Args)]
pub(super) struct Experiment {
    #[command(subcommand)]
    which: Which,
}

#[derive(Debug, Subcommand)]
enum Which {
    /// Make the simulated data sets that the studies below take.
    Sets(study::Sets),
    /// All studies below.
    All(StudyArgs),
    #[command(flatten)]
    Study(study::Chosen),
    /// What each stage takes, from a bridge's packets to the answer.
    Latency(latency::Latency),
    /// The tags' branch with an action's head on real reads of people who were not learnt from.
    RealReads(real_reads::RealReads),
    /// The radar's branch with an action's head on real recordings of other radars.
    RealRadar(real_radar::RealRadar),
    /// A network on the recorded motion of real people in simulated rooms, beside generated motion.
    RealMotion(real_motion::RealMotion),
    /// All tables of a folder as one page with pictures.
    Report(study::Report),
    /// One training of a study, in its folder; studies start it.
    #[command(hide = true)]
    Run(study::RunArgs),
}

impl Experiment {
    pub(super) fn run(&self, json: bool) -> anyhow::Result<()> {
        match &self.which {
            Which::Sets(sets) => sets.run(),
            Which::All(args) => args.run(&STUDIES, json),
            Which::Study(study) => study.run(json),
            Which::Latency(latency) => latency.run(json),
            Which::RealReads(real) => real.run(json),
            Which::RealRadar(real) => real.run(json),
            Which::RealMotion(real) => real.run(json),
            Which::Report(report) => report.run(json),
            Which::Run(run) => run.run(json),
        }
    }
}
