//! Who acts in one sample: a generated performance, a recorded motion, or a sequence of meshes.

use std::ops::{Range, RangeInclusive};
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use clap::Args;
use rfhoi::hoi::{Action, Category};
use rfhoi::motion::{Motion, actions};
use rfhoi::simulate::Performance;
use rfhoi::simulate::body::Side;
use rfhoi::simulate::draw::Draw;
use rfhoi::simulate::effects::{Domain, Effects};
use rfhoi::simulate::meshes::MeshSequence;
use rfhoi::simulate::perform::Generated;
use rfhoi::simulate::recorded::{Recast, Recorded};
use rfhoi::simulate::sample::{Take, perform, tag_on};
use rfhoi::simulate::scene::{Scene, Tag};

#[derive(Debug, Args)]
#[command(next_help_heading = "One sample, after a recording")]
pub(super) struct SourceArgs {
    /// Recorded motion that is performed instead of a generated one: .amc with its .asf beside it, .bvh, Kinect joints.
    #[arg(long, value_name = "FILE", conflicts_with = "set")]
    motion: Option<PathBuf>,
    /// Which frames of the motion, by their numbers in the file.
    #[arg(long, value_name = "FIRST..=LAST", value_parser = frames, requires = "motion", conflicts_with = "labelled")]
    frames: Option<RangeInclusive<u32>>,
    /// Which of the actions that ACTION_INDEX.tsv, beside the motion or a folder above, lists for it.
    #[arg(long, value_name = "ACTION", requires = "motion")]
    labelled: Option<String>,
    /// The left hand acts in the motion; otherwise the right.
    #[arg(long, requires = "motion")]
    left_hand: bool,
    /// Meshes that are performed instead: a folder of OBJ files with sequence.toml, which also says what is done.
    #[arg(long, value_name = "DIR", conflicts_with_all = ["set", "motion", "action", "object", "person"])]
    meshes: Option<PathBuf>,
}

fn frames(text: &str) -> Result<RangeInclusive<u32>, String> {
    let ends = text.split_once("..=").map(|(first, last)| (first.parse(), last.parse()));
    match ends {
        Some((Ok(first), Ok(last))) if first <= last => Ok(first..=last),
        _ => Err("give the numbers of the first and the last frame, as 120..=245".to_owned()),
    }
}

impl SourceArgs {
    /// The action that `--labelled` names, if it is one of those that are known.
    pub(super) fn action(&self) -> Option<Action> {
        Action::named(&self.labelled.as_ref()?.replace('_', " "))
    }

    /// The numbers of the frames of the motion at `path`.
    fn numbers(&self, path: &Path) -> anyhow::Result<RangeInclusive<u32>> {
        let file = path.display();
        let listed = actions::beside(path)?;
        let names = |all: &[actions::Action]| {
            let listed = |a: &actions::Action| format!("`{}` ({}..={})", a.name, a.start, a.end);
            all.iter().map(listed).collect::<Vec<_>>().join(", ")
        };
        match (&self.frames, &self.labelled, listed) {
            (Some(frames), ..) => Ok(frames.clone()),
            (None, Some(wanted), Some((table, all))) => {
                let found = all.iter().find(|a| a.name == *wanted || a.name == wanted.replace(' ', "_"));
                let found = found.with_context(|| {
                    format!("{} lists no `{wanted}` for {file}: it has {}", table.display(), names(&all))
                })?;
                Ok(found.start..=found.end)
            }
            (None, Some(_), None) => {
                bail!(
                    "no {} is beside {file} or a folder above: give --frames FIRST..=LAST instead of --labelled",
                    actions::NAME
                )
            }
            (None, None, Some((table, all))) if !all.is_empty() => {
                bail!(
                    "say which part of {file}: --frames FIRST..=LAST, or --labelled with one of {}: {}",
                    table.display(),
                    names(&all)
                )
            }
            (None, None, _) => bail!("say which part of {file}: --frames FIRST..=LAST"),
        }
    }

    /// What is performed for `drawn` in `scene`.
    pub(super) fn act(
        &self,
        domain: Domain,
        seed: u64,
        drawn: &Draw,
        scene: &Scene,
    ) -> anyhow::Result<Acted> {
        let (place, radar) = (drawn.place(), scene.radar.position);
        let tags = |label: Option<Category>| -> anyhow::Result<Vec<Tag>> {
            Ok(label.map(|l| tag_on(scene, l.object)).transpose()?.into_iter().collect())
        };
        if let Some(path) = &self.motion {
            let (_, motion) = Motion::open(path)?;
            let numbers = self.numbers(path)?;
            let side = if self.left_hand { Side::Left } else { Side::Right };
            let recast =
                Recast { person: &scene.people[drawn.person], place, radar, label: drawn.label, side };
            let part = format!("frames {} to {}", numbers.start(), numbers.end());
            let recorded = Recorded::new(&motion, numbers, &recast)
                .with_context(|| format!("cannot perform {}", path.display()))?;
            let source = format!("{part} of {}", named(path));
            let tags = tags(drawn.label)?;
            return Ok(Acted {
                what: What::Recorded(recorded),
                tags,
                label: drawn.label,
                source: Some(source),
            });
        }
        if let Some(folder) = &self.meshes {
            let sequence = MeshSequence::open(folder, &place, radar)?;
            let label = sequence.label();
            let mut tags = tags(label)?;
            if tags.is_empty() {
                // Its tag is on nothing that has a name: any one will do.
                tags.extend(scene.tags.first().cloned());
            }
            let source = Some(format!("meshes of {}", named(folder)));
            return Ok(Acted { what: What::Meshes(sequence), tags, label, source });
        }
        let (generated, tags) = perform(domain, seed, drawn, scene)?;
        Ok(Acted { what: What::Generated(generated), tags, label: drawn.label, source: None })
    }
}

/// Last part of a path.
fn named(path: &Path) -> String {
    path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}

enum What {
    Generated(Generated),
    Recorded(Recorded),
    Meshes(MeshSequence),
}

/// A performance, with its tags.
pub(super) struct Acted {
    what: What,
    tags: Vec<Tag>,
    /// What is done.
    pub(super) label: Option<Category>,
    /// The recording that it follows.
    pub(super) source: Option<String>,
}

impl Acted {
    /// It in `scene`.
    pub(super) fn take<'a>(&'a self, scene: &'a Scene, effects: Effects) -> Take<'a> {
        let bare = |performance: &'a dyn Performance| Take {
            scene,
            performance,
            fixtures: None,
            tags: &self.tags,
            effects,
        };
        match &self.what {
            What::Generated(generated) => Take::of(scene, generated, &self.tags, effects),
            What::Recorded(recorded) => bare(recorded),
            What::Meshes(sequence) => bare(sequence),
        }
    }

    /// Number of the target's tag.
    pub(super) fn target(&self) -> Option<usize> {
        match &self.what {
            What::Generated(generated) => generated.target(),
            What::Recorded(_) | What::Meshes(_) => self.label.map(|_| 0),
        }
    }

    /// When the interaction is, s; recordings do not tell.
    pub(super) fn interaction_s(&self) -> Option<Range<f64>> {
        match &self.what {
            What::Generated(generated) => self.label.map(|_| generated.interaction_s()),
            What::Recorded(_) | What::Meshes(_) => None,
        }
    }
}
