//! `rfhoi stability`.

use std::path::PathBuf;

use clap::Args;
use rfhoi::stability::{self, Case, Options};
use serde_json::json;

use super::Progress;

#[derive(Debug, Args)]
pub(super) struct Stability {
    /// Cases, or beginnings of their names; by default all.
    cases: Vec<String>,
    /// List the cases.
    #[arg(long)]
    list: bool,
    /// Folder for pictures (.png) and tables (.json, .csv, .txt); made if it is not there.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Draws at each stress, with the guard and without.
    #[arg(long, default_value_t = 200, value_parser = clap::value_parser!(u32).range(1..=10_000_000))]
    trials: u32,
    /// Seed of all draws.
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

impl Stability {
    pub(super) fn run(&self, json: bool) -> anyhow::Result<()> {
        let all = stability::cases();
        let chosen = self.choose(&all)?;
        if self.list {
            for case in chosen {
                if json {
                    println!("{}", json!({ "case": case.name(), "about": case.about() }));
                } else {
                    println!("{:22} {}", case.name(), case.about());
                }
            }
            return Ok(());
        }
        let options = Options { trials: self.trials, seed: self.seed };
        let progress = Progress::new(format!("{} cases, simulated", chosen.len()))?;
        let results = stability::run(&chosen, options, &mut |share| progress.show(share))?;
        drop(progress);
        let files = self.out.as_ref().map(|out| stability::write(&results, out)).transpose()?;
        if json {
            println!("{}", serde_json::to_string(&json!({ "cases": results, "outputs": files }))?);
        } else {
            print!("{}", stability::table(&results));
            for file in files.iter().flatten() {
                println!("{}", file.display());
            }
        }
        Ok(())
    }

    fn choose<'a>(&self, all: &'a [Box<dyn Case>]) -> anyhow::Result<Vec<&'a dyn Case>> {
        for name in &self.cases {
            anyhow::ensure!(
                all.iter().any(|case| case.name().starts_with(name)),
                "there is no case {name}; `rfhoi stability --list` names them"
            );
        }
        let wanted = |name: &str| self.cases.is_empty() || self.cases.iter().any(|c| name.starts_with(&**c));
        Ok(all.iter().map(|case| &**case).filter(|case| wanted(case.name())).collect())
    }
}
