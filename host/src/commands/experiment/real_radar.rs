//! `rfhoi experiment real-radar`.

use std::collections::BTreeMap;
use std::path::PathBuf;

use clap::Args;
use rfhoi::atomic;
use rfhoi::real::Real;
use rfhoi::real::radar::{self, Clip, Recordings};
use rfhoi_network::config::{Branch, Fusion, NetworkConfig};
use rfhoi_network::sample::{Frames, Sample};
use rfhoi_network::train::{Augment, Recipe};
use serde_json::{Value, json};

use super::branch::{Reached, Trial, together, without};
use crate::commands::train::RecipeArgs;
use crate::commands::{Progress, listen_for_ctrl_c};

/// Epochs, if nothing else is said: of people's recordings, of gestures, of labels of single frames.
const PEOPLE_EPOCHS: u32 = 30;
const EPOCHS: u32 = 40;
const FRAME_EPOCHS: u32 = 8;
/// Share of each class's clips, the last ones, that is tested on.
const TESTED: f64 = 0.25;
/// Of the frames to learn from every so many is taken: neighbours hardly differ.
const EVERY: usize = 3;
/// Frames of a clip, where it has such.
type Part = fn(&Clip) -> Option<Frames>;

/// What is no gesture.
const BACKGROUND: &str = "background";

/// `rfhoi experiment real-radar`.
#[derive(Debug, Args)]
pub(super) struct RealRadar {
    /// Folder or archive (.tar.xz) with an index.csv: recordings of several people (RadarHAR), of whom each is left out once, or
    /// clips with a label for each frame (KKT60).
    #[arg(long, value_name = "DIR|TAR")]
    data: PathBuf,
    /// Folder for the runs and results.json.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    #[command(flatten)]
    recipe: RecipeArgs,
}

impl RealRadar {
    pub(super) fn run(&self, json: bool) -> anyhow::Result<()> {
        listen_for_ctrl_c()?;
        let progress = Progress::new(format!("reading {}", self.data.display()))?;
        let recordings = radar::load(&self.data, &mut |share| progress.show(share))?;
        drop(progress);
        let say = |line: &str| {
            if !json {
                println!("{line}");
            }
        };
        let result = match recordings {
            Recordings::Spectrograms(real) => self.people(&real, &say)?,
            Recordings::Heatmaps(clips) => self.clips(&clips, &say)?,
        };
        atomic::write(self.out.join("results.json"), &serde_json::to_vec_pretty(&result)?)?;
        if json {
            println!("{result}");
        }
        Ok(())
    }

    /// Leaves each person out once.
    fn people(&self, real: &Real, say: &dyn Fn(&str)) -> anyhow::Result<Value> {
        // Few people: much is left out, so that the network does not learn them by heart.
        let config = NetworkConfig { dropout: 0.3, ..config([true; 3], real.classes.len()) };
        let augment = Augment { crop: 2, noise: 5, ..Augment::NONE };
        let recipe = Recipe { epochs: PEOPLE_EPOCHS, batch: 8, learning_rate: 1e-3, augment, ..recipe() };
        let recipe = self.recipe.apply(Recipe { weight_decay: 0.05, smoothing: 0.1, ..recipe })?;
        let mut reached: Vec<Reached> = Vec::new();
        for (number, who) in real.who.iter().enumerate() {
            let (name, shape) = (format!("without-{who}"), (&config, &recipe));
            reached.push(without(real, &[number as u32], name, shape, &self.out)?);
            say(&format!("{}: {}", reached[number].name, reached[number].accuracy));
        }
        let all = together(&reached).to_string();
        say(&format!("each person left out once: {all}"));
        Ok(json!({
            "simulated": false,
            "samples": real.samples.len(),
            "classes": real.classes,
            "network": config,
            "recipe": recipe,
            "all": all,
            "trials": reached,
        }))
    }

    /// The gestures, whether frames before them tell the same, and the label of each frame.
    fn clips(&self, clips: &[Clip], say: &dyn Fn(&str)) -> anyhow::Result<Value> {
        let (learn, test) = later(clips);
        let mut classes: Vec<String> = clips.iter().map(|clip| clip.class.clone()).collect();
        classes.sort();
        classes.dedup();
        classes.retain(|class| class != BACKGROUND);
        let config = config([false, true, true], classes.len());
        let augment = Augment { crop: 2, noise: 6, ..Augment::NONE };
        let recipe = self.recipe.apply(Recipe { epochs: EPOCHS, augment, ..recipe() })?;
        let gestures = |clips: &[&Clip], part: Part| -> Vec<Sample> {
            let one = |clip: &&Clip| {
                let action = Some(classes.iter().position(|class| *class == clip.class)?);
                Some(Sample { frames: part(clip)?, objects: vec![0], action, ..Sample::default() })
            };
            clips.iter().filter_map(one).collect()
        };
        let mut figures = BTreeMap::new();
        let parts: [(&str, Part); 2] = [
            ("gestures", |clip| clip.gesture().map(|times| clip.without_rest(times.clone(), 0..times.start))),
            ("placebo", |clip| clip.gesture().map(|times| clip.without_rest(0..times.start, 0..times.start))),
        ];
        for (name, part) in parts {
            let (learn, test) = (gestures(&learn, part), gestures(&test, part));
            let trial = Trial {
                name: name.to_owned(),
                config: &config,
                recipe: &recipe,
                names: &[vec![1.0]],
                classes: &classes,
                learn: &learn.iter().collect::<Vec<_>>(),
                test: &test.iter().collect::<Vec<_>>(),
            };
            let (reached, _) = trial.run(&self.out)?;
            let most = reached.confusion.iter().map(|row| row.iter().sum::<u32>()).max().unwrap_or(0);
            let chance = f64::from(most) / f64::from(reached.right.of);
            let accuracy = &reached.accuracy;
            say(&format!("{name}: {accuracy}; the most frequent class is {:.1} %", 100.0 * chance));
            figures.insert(name, json!({ "reached": reached, "most_frequent": chance, "classes": classes }));
        }
        figures.insert("frames", self.frames(&learn, &test, say)?);
        Ok(
            json!({ "simulated": false, "clips": clips.len(), "network": config, "recipe": recipe, "tasks": figures }),
        )
    }

    /// The label of each frame.
    fn frames(&self, learn: &[&Clip], test: &[&Clip], say: &dyn Fn(&str)) -> anyhow::Result<Value> {
        let samples = |clips: &[&Clip], every: usize| -> Vec<Sample> {
            let of = |clip: &&Clip| {
                let labels = clip.label.clone();
                let sample = move |(frames, label)| Sample {
                    frames,
                    objects: vec![0],
                    action: Some(usize::from(label)),
                    ..Sample::default()
                };
                clip.around().into_iter().zip(labels).map(sample).step_by(every).collect::<Vec<_>>()
            };
            clips.iter().flat_map(of).collect()
        };
        let config = config([true; 3], 2);
        let augment = Augment { noise: 6, map: 0.05, ..Augment::NONE };
        let recipe = self.recipe.apply(Recipe { epochs: FRAME_EPOCHS, augment, ..recipe() })?;
        let (learn, test) = (samples(learn, EVERY), samples(test, 1));
        let trial = Trial {
            name: "frames".to_owned(),
            config: &config,
            recipe: &recipe,
            names: &[vec![1.0]],
            classes: &["rest".to_owned(), "gesture".to_owned()],
            learn: &learn.iter().collect::<Vec<_>>(),
            test: &test.iter().collect::<Vec<_>>(),
        };
        let (reached, answers) = trial.run(&self.out)?;
        let scored =
            answers.iter().zip(&test).map(|(answer, sample)| (answer.actions[1], sample.action == Some(1)));
        let area = area_under_curve(scored.collect());
        say(&format!("frames: {}, area under the curve {area:.3}", reached.accuracy));
        Ok(json!({ "reached": reached, "area_under_curve": area, "recipe": recipe }))
    }
}

fn config(maps: [bool; 3], actions: usize) -> NetworkConfig {
    let small = NetworkConfig::small(1);
    NetworkConfig {
        points: radar::POINTS,
        maps,
        antennas: 1,
        // Frame by frame: one of the tasks is a label for each.
        radar: Branch { stack: 1, ..small.radar },
        fusion: Fusion::Radar,
        actions,
        ..small
    }
}

fn recipe() -> Recipe {
    Recipe { pose_weight: 0.0, ..Recipe::pre_training(1) }
}

/// All but the last clips of each class, and these: they are sorted by time, and a class is of one day.
fn later(clips: &[Clip]) -> (Vec<&Clip>, Vec<&Clip>) {
    let mut of_class: BTreeMap<&str, Vec<&Clip>> = BTreeMap::new();
    clips.iter().for_each(|clip| of_class.entry(&clip.class).or_default().push(clip));
    let (mut learn, mut test) = (Vec::new(), Vec::new());
    for mut all in of_class.into_values() {
        let late = all.split_off(all.len() - (all.len() as f64 * TESTED) as usize);
        learn.extend(all);
        test.extend(late);
    }
    (learn, test)
}

/// How likely one that is positive has a higher score than one that is not; equal scores count half (Mann and Whitney 1947).
fn area_under_curve(mut scored: Vec<(f32, bool)>) -> f64 {
    scored.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (mut below, mut wins, mut positives) = (0.0, 0.0, 0.0);
    for equal in scored.chunk_by(|a, b| a.0 == b.0) {
        let hits = equal.iter().filter(|(_, positive)| *positive).count() as f64;
        let others = equal.len() as f64 - hits;
        wins += hits * (below + others / 2.0);
        (below, positives) = (below + others, positives + hits);
    }
    wins / (below * positives)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn area_is_that_of_the_books() {
        let scored = |pairs: &[(f32, bool)]| area_under_curve(pairs.to_vec());
        assert_eq!(scored(&[(0.1, false), (0.4, false), (0.35, true), (0.8, true)]), 0.75);
        assert_eq!(scored(&[(0.5, false), (0.5, true)]), 0.5);
        assert_eq!(scored(&[(0.9, true), (0.1, false)]), 1.0);
    }
}
