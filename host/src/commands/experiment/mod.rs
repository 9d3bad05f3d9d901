//! `rfhoi experiment`: trainings side by side, as tables.

mod branch;
mod modality;
mod real_radar;
mod real_reads;
mod runs;

use clap::{Args, Subcommand};

/// `rfhoi experiment`.
#[derive(Debug, Args)]
pub(super) struct Experiment {
    #[command(subcommand)]
    which: Which,
}

#[derive(Debug, Subcommand)]
enum Which {
    /// What each radio brings: fusion, no fusion, RFID alone, radar alone (table of section 5.2 of the paper).
    Modality(modality::Modality),
    /// The tags' branch with an action's head on real reads of people who were not learnt from.
    RealReads(real_reads::RealReads),
    /// The radar's branch with an action's head on real recordings of other radars.
    RealRadar(real_radar::RealRadar),
}

impl Experiment {
    pub(super) fn run(&self, json: bool) -> anyhow::Result<()> {
        match &self.which {
            Which::Modality(modality) => modality.run(json),
            Which::RealReads(real) => real.run(json),
            Which::RealRadar(real) => real.run(json),
        }
    }
}
