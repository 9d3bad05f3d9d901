//! What the manifest says of a set.

use std::path::{Path, PathBuf};

use rfhoi_firmware::mmwave::cfg::Board;
use rfhoi_network::sample::{Frames, Pose, Sample};
use rfhoi_shared::config::{Processing, RadarConfig, RadarInput};
use rfhoi_shared::fnv;
use rfhoi_shared::radar::{RadarProfile, RangeGate};
use rfhoi_shared::units::BridgeTime;
use rfhoi_shared::wire::LogScale;
use serde::Deserialize;
use serde_json::Value;

use super::{SetError, Setup};
use crate::profile::{self, NAMES};
use crate::simulate::effects::Domain;
use crate::simulate::set::{MANIFEST, PROFILE, VERSION};

/// A set, but for its shards.
#[derive(Debug)]
pub(super) struct Manifest {
    pub(super) path: PathBuf,
    pub(super) domain: Domain,
    pub(super) seed: u64,
    pub(super) actions: Vec<String>,
    pub(super) objects: Vec<String>,
    /// Scenes, and the people in each.
    pub(super) scenes: Vec<(String, Vec<String>)>,
    pub(super) maps: Maps,
    /// When a sample's first frame begins, by a clock that starts with the reader.
    pub(super) epoch: BridgeTime,
    pub(super) samples: Vec<Entry>,
    /// Of everything it says.
    pub(super) fingerprint: u32,
    shard_samples: usize,
}

/// What the radar's data are.
#[derive(Debug, Deserialize)]
pub(super) struct Maps {
    pub(super) profile_fingerprint: u32,
    pub(super) first_range_bin: u16,
    pub(super) range_bins: u16,
    pub(super) doppler_bins: u16,
    pub(super) range_time_columns: u16,
    pub(super) virtual_antennas: usize,
    #[serde(flatten)]
    pub(super) scale: LogScale,
}

/// A sample's label and setup, in numbers of the set's lists.
#[derive(Debug)]
pub(super) struct Entry {
    pub(super) objects: Vec<usize>,
    pub(super) action: Option<usize>,
    pub(super) target: Option<usize>,
    pub(super) setup: Setup,
}

/// The file, as far as it matters here.
#[derive(Debug, Deserialize)]
struct File {
    complete: bool,
    domain: Domain,
    seed: u64,
    actions: Vec<String>,
    object_names: Vec<String>,
    scenes: Vec<NamedScene>,
    maps: Maps,
    lead_in_us: u64,
    shard_samples: usize,
    samples: Vec<Drawn>,
}

#[derive(Debug, Deserialize)]
struct NamedScene {
    name: String,
    people: Vec<Named>,
}

#[derive(Debug, Deserialize)]
struct Named {
    name: String,
}

#[derive(Debug, Deserialize)]
struct Drawn {
    label: Option<Label>,
    objects: Vec<String>,
    target: Option<usize>,
    scene: usize,
    person: usize,
    distance_m: f32,
    bearing_deg: f32,
    facing_deg: f32,
    #[serde(default)]
    setup: Option<usize>,
}

#[derive(Debug, Deserialize)]
struct Label {
    action: String,
}

impl Manifest {
    /// Reads that of the set in `folder`.
    pub(super) fn read(folder: &Path) -> Result<Self, SetError> {
        let path = folder.join(MANIFEST);
        let bytes = std::fs::read(&path).map_err(|source| SetError::Read { path: path.clone(), source })?;
        let wrong = |what: String| SetError::Manifest { path: path.clone(), what };
        let mut value: Value = serde_json::from_slice(&bytes).map_err(|e| wrong(e.to_string()))?;
        let version = value.get("version").and_then(Value::as_u64);
        if version != Some(VERSION.into()) {
            let there = version.map_or("none".to_owned(), |version| version.to_string());
            return Err(wrong(format!("its version is {there}, not {VERSION}")));
        }
        let file = File::deserialize(&value).map_err(|e| wrong(e.to_string()))?;
        if !file.complete {
            return Err(SetError::Incomplete(folder.to_path_buf()));
        }
        let File { actions, object_names: objects, shard_samples, .. } = file;
        if shard_samples == 0 {
            return Err(wrong("its shards have no samples".to_owned()));
        }
        let entry = |(number, drawn): (usize, Drawn)| {
            Entry::of(drawn, &actions, &objects).map_err(|what| wrong(format!("sample {number}: {what}")))
        };
        let samples: Vec<Entry> =
            file.samples.into_iter().enumerate().map(entry).collect::<Result<_, _>>()?;
        let tags = samples.first().map_or(0, |first| first.objects.len());
        if samples.iter().any(|sample| sample.objects.len() != tags) {
            return Err(wrong("its samples differ in their numbers of tags".to_owned()));
        }
        // Whether it was complete when features were made changes nothing.
        if let Some(object) = value.as_object_mut() {
            object.shift_remove("complete");
        }
        let fingerprint = fnv::more(fnv::EMPTY, value.to_string().as_bytes());
        let people = |scene: NamedScene| (scene.name, scene.people.into_iter().map(|p| p.name).collect());
        Ok(Self {
            domain: file.domain,
            seed: file.seed,
            actions,
            objects,
            scenes: file.scenes.into_iter().map(people).collect(),
            maps: file.maps,
            epoch: BridgeTime(file.lead_in_us),
            samples,
            fingerprint,
            shard_samples,
            path,
        })
    }

    /// Tags of a sample.
    pub(super) fn tags(&self) -> usize {
        self.samples.first().map_or(0, |first| first.objects.len())
    }

    /// Shards.
    pub(super) fn shards(&self) -> usize {
        self.samples.len().div_ceil(self.shard_samples)
    }

    /// The samples of a shard; there is at least one.
    pub(super) fn samples_of(&self, shard: usize) -> &[Entry] {
        let rest = &self.samples[shard * self.shard_samples..];
        &rest[..rest.len().min(self.shard_samples)]
    }

    /// What the radar was configured for: with `profile`, with one that has a name, or with that beside the manifest.
    pub(super) fn radar(&self, profile: Option<&RadarProfile>) -> Result<RadarConfig, SetError> {
        let fingerprint = self.maps.profile_fingerprint;
        let named = NAMES.into_iter().filter_map(RadarProfile::named);
        // What cannot be read there is not the set's.
        let beside =
            || profile::load(&self.path.with_file_name(PROFILE).to_string_lossy(), Board::default()).ok();
        let beside = std::iter::once_with(beside).flatten();
        let mut known = profile.cloned().into_iter().chain(named).chain(beside);
        let profile = known.find(|p| p.fingerprint() == fingerprint);
        let profile = profile.ok_or_else(|| SetError::Profile { path: self.path.clone(), fingerprint })?;
        let gate = RangeGate { first: self.maps.first_range_bin, bins: self.maps.range_bins };
        let processing = Processing {
            range_time_columns: self.maps.range_time_columns,
            ..Processing::with_gate(&profile, gate)
        };
        Ok(RadarConfig { profile, input: RadarInput::Uart, processing })
    }
}

impl Entry {
    fn of(drawn: Drawn, actions: &[String], objects: &[String]) -> Result<Self, String> {
        let find = |list: &[String], name: String| {
            list.iter().position(|other| *other == name).ok_or(format!("`{name}` is not on the list"))
        };
        let tags = drawn.objects.len();
        if drawn.label.is_some() != drawn.target.is_some()
            || drawn.target.is_some_and(|target| target >= tags)
        {
            return Err("its target is none of its tags".to_owned());
        }
        Ok(Self {
            objects: drawn.objects.into_iter().map(|name| find(objects, name)).collect::<Result<_, _>>()?,
            action: drawn.label.map(|label| find(actions, label.action)).transpose()?,
            target: drawn.target,
            setup: Setup {
                scene: drawn.scene,
                person: drawn.person,
                pose: Pose {
                    distance_m: drawn.distance_m,
                    bearing_deg: drawn.bearing_deg,
                    facing_deg: drawn.facing_deg,
                },
                interaction_s: [0.0; 2],
                number: drawn.setup,
            },
        })
    }

    /// The sample in which `frames` were measured.
    pub(super) fn label(&self, frames: Frames, interaction_s: [f32; 2]) -> (Sample, Setup) {
        let Self { objects, action, target, setup } = self;
        let pose = Some(setup.pose);
        let sample =
            Sample { frames, objects: objects.clone(), action: *action, target: *target, pose, window: None };
        (sample, Setup { interaction_s, ..*setup })
    }
}
