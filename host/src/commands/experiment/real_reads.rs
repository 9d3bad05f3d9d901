//! `rfhoi experiment real-reads`.

use std::path::PathBuf;

use anyhow::{Context, ensure};
use clap::Args;
use rfhoi::atomic;
use rfhoi::real::reads;
use rfhoi_network::config::{Branch, Fusion, NetworkConfig};
use rfhoi_network::train::{Augment, Recipe};
use serde_json::json;

use super::branch::{together, without};
use crate::commands::train::RecipeArgs;
use crate::commands::{Progress, listen_for_ctrl_c};

/// Epochs, if nothing else is said.
const EPOCHS: u32 = 40;
/// Twice as wide as the network that ships: the action is told from the mean of all tags, of which many are worn.
const WIDTH: usize = 128;
/// Frames of a token: in 1 s one of many tags is read a few times.
const STACK: usize = 10;

/// `rfhoi experiment real-reads`.
#[derive(Debug, Args)]
pub(super) struct RealReads {
    /// Folder or archive (.tar.xz) of labelled reads: a line is person, tag, time in us, Doppler in Hz, RSSI in dBm, phase in rad,
    /// activity.
    #[arg(long, value_name = "DIR|TAR")]
    data: PathBuf,
    /// People to be tested on, as 7,8,9; all others are learnt from. Give it again for another training.
    #[arg(long, value_name = "PEOPLE", required = true)]
    test: Vec<String>,
    /// Folder for the runs and results.json.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    #[command(flatten)]
    recipe: RecipeArgs,
}

impl RealReads {
    pub(super) fn run(&self, json: bool) -> anyhow::Result<()> {
        listen_for_ctrl_c()?;
        let groups = self.test.iter().map(|text| people(text)).collect::<anyhow::Result<Vec<_>>>()?;
        let progress = Progress::new(format!("reading {}", self.data.display()))?;
        let real = reads::load(&self.data, &mut |share| progress.show(share))?;
        drop(progress);
        let mut everyone = real.people.clone();
        everyone.sort_unstable();
        everyone.dedup();
        for person in groups.iter().flatten() {
            ensure!(
                everyone.contains(person),
                "there is nobody with number {person}: there are {everyone:?}"
            );
        }
        let small = NetworkConfig::small(real.names.len());
        let config = NetworkConfig {
            points: reads::POINTS,
            antennas: reads::SETTINGS.antennas,
            tags: Branch { width: WIDTH, feed_forward: 2 * WIDTH, stack: STACK, ..small.tags },
            fusion: Fusion::Rfid,
            actions: real.classes.len(),
            ..small
        };
        let augment = Augment { crop: 6, tag: 0.15, exchange: 0.6, ..Augment::NONE };
        let recipe = self.recipe.apply(Recipe { epochs: EPOCHS, augment, ..Recipe::pre_training(1) })?;
        let mut reached = Vec::new();
        for test in &groups {
            let name = test.iter().map(u32::to_string).collect::<Vec<_>>().join("-");
            reached.push(without(&real, test, format!("people-{name}"), (&config, &recipe), &self.out)?);
        }
        let all = together(&reached);
        let result = json!({
            "simulated": false,
            "samples": real.samples.len(),
            "classes": real.classes,
            "network": config,
            "recipe": recipe,
            "all": all.to_string(),
            "trials": reached,
        });
        atomic::write(self.out.join("results.json"), &serde_json::to_vec_pretty(&result)?)?;
        if json {
            println!("{result}");
        } else {
            for trial in &reached {
                println!(
                    "{}: {} of {}, learnt from {}",
                    trial.name, trial.accuracy, trial.right.of, trial.learnt
                );
            }
        }
        Ok(())
    }
}

fn people(text: &str) -> anyhow::Result<Vec<u32>> {
    let numbers = text.split(',').map(|number| number.trim().parse());
    numbers
        .collect::<Result<_, _>>()
        .with_context(|| format!("--test {text}: give numbers of people, as 7,8,9"))
}
