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

use study::Name;

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
    /// What each radio brings: fusion, no fusion, tags alone, radar alone, against the amount of fine-tuning data.
    Modality(StudyArgs),
    /// With and without pre-training, against the amount of fine-tuning data.
    PreTraining(StudyArgs),
    /// Setups (room, person, place, direction) that were not learnt from, against how many were.
    Setups(StudyArgs),
    /// A direction, distance, person or room that was not learnt from.
    Factors(StudyArgs),
    /// Pairs of an action and an object that were not fine-tuned on.
    Pairs(StudyArgs),
    /// Things that were never learnt from, with and without algorithm 1.
    Objects(StudyArgs),
    /// How the branches are joined.
    Fusion(StudyArgs),
    /// Encoders of the radar.
    Encoders(StudyArgs),
    /// One to four antennas of the reader.
    Antennas(StudyArgs),
    /// Weight of the target's loss.
    LossWeight(StudyArgs),
    /// Amount of simulated data to pre-train on.
    Synthetic(StudyArgs),
    /// The target's tag under the hand, other things behind the person.
    Occlusion(StudyArgs),
    /// Somebody else busy in the room.
    SecondPerson(StudyArgs),
    /// Time to fine-tune.
    FineTuning(StudyArgs),
    /// Three scenes, each seen as it needs and as the paper would: accuracy, and what is saved.
    Scenes(StudyArgs),
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
        let (args, name) = match &self.which {
            Which::Sets(sets) => return sets.run(),
            Which::Latency(latency) => return latency.run(json),
            Which::RealReads(real) => return real.run(json),
            Which::RealRadar(real) => return real.run(json),
            Which::RealMotion(real) => return real.run(json),
            Which::Run(run) => return run.run(json),
            Which::Report(report) => return report.run(json),
            Which::All(args) => return args.run(&Name::ALL, json),
            Which::Modality(args) => (args, Name::Modality),
            Which::PreTraining(args) => (args, Name::PreTraining),
            Which::Setups(args) => (args, Name::Setups),
            Which::Factors(args) => (args, Name::Factors),
            Which::Pairs(args) => (args, Name::Pairs),
            Which::Objects(args) => (args, Name::Objects),
            Which::Fusion(args) => (args, Name::Fusion),
            Which::Encoders(args) => (args, Name::Encoders),
            Which::Antennas(args) => (args, Name::Antennas),
            Which::LossWeight(args) => (args, Name::LossWeight),
            Which::Synthetic(args) => (args, Name::Synthetic),
            Which::Occlusion(args) => (args, Name::Occlusion),
            Which::SecondPerson(args) => (args, Name::SecondPerson),
            Which::FineTuning(args) => (args, Name::FineTuning),
            Which::Scenes(args) => (args, Name::Scenes),
        };
        args.run(&[name], json)
    }
}
