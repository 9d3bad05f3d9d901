//! Data sets: a folder with `manifest.json`, the radar's profile, and shards of samples that `numpy.load` reads.
//!
//! Every sample follows from the seed and its number alone, so shards are made in any order, by all cores, and a set that was
//! stopped goes on where it stood. The same options give the same bytes.
//!
//! Arrays of a shard of S samples, F frames of all of them one after the other, R reads likewise, T tags a sample:
//!
//! | name | shape, type | what it is |
//! |---|---|---|
//! | `frame_first` | S+1, u32 | where each sample's frames begin |
//! | `read_first` | S+1, u32 | where each sample's reads begin |
//! | `range_doppler` | F x range bins x Doppler bins, u8 | codes; level in dB = `floor_db` + code x `step_db` |
//! | `range_time` | F x range bins x columns, u8 | the same by groups of loops |
//! | `covariance` | F x N^2, f32 | of N virtual antennas: diagonal and upper triangle by rows, see [`Covariance`] |
//! | `moving_cells` | F, u32 | cells that entered the covariance |
//! | `tag_position_m` | F x T x 3, f32 | where the tags are, the truth |
//! | `read_time_us` | R, i32 | from the sample's first frame on; before it, the reader's lead-in |
//! | `read_tag`, `read_antenna`, `read_channel` | R, u8 | tag from 0; port and channel from 1 |
//! | `read_phase` | R, u16 | 4096 codes to the turn |
//! | `read_rssi`, `read_doppler` | R, i16 | hundredths of a dBm; sixteenths of a hertz |
//! | `channel_khz` | S x channels, u32 | frequency of channel 1, 2, ... |
//! | `duration_s` | S, f32 | length |
//! | `interaction_s` | S x 2, f32 | from the person's first movement to the last; 0, 0 without a label |
//! | `action`, `target` | S, i8 | number of the action ([`Action`]) and of the target's tag; -1 is none |
//! | `objects` | S x T, u8 | number of each tag's [`Object`], by label |
//!
//! [`Covariance`]: rfhoi_shared::wire::Covariance

use std::path::{Path, PathBuf};

use ndarray::{Array1, Array2, Array3};
use rfhoi_firmware::dsp::level;
use rfhoi_shared::config::Processing;
use rfhoi_shared::fnv;
use rfhoi_shared::units::BridgeTime;
use serde::Serialize;
use serde_json::{Value, json};

use super::draw::{Draw, Wanted, draw, most_setups};
use super::effects::Effects;
use super::sample::{Maker, Sample, SampleError, epoch};
use super::scene::{SAMPLE_TAGS, Scene};
use crate::atomic::{self, WriteError};
use crate::hoi::{Action, Object};
use crate::jobs::Jobs;
use crate::npz::{Npz, NpzError};
use crate::profile;

/// Name of the file that describes a set.
pub const MANIFEST: &str = "manifest.json";
/// Name of the radar's profile beside it, as a CLI profile, if it can be said so.
pub const PROFILE: &str = "profile.cfg";
/// Of the layout of manifest and shards.
pub const VERSION: u32 = 1;
/// Key of the manifest for what makes it harder ([`Circumstance`](super::circumstance::Circumstance)), where something does.
const CIRCUMSTANCE: &str = "circumstance";
/// Samples of a shard.
pub const SHARD_SAMPLES: u32 = 32;

/// What is written.
#[derive(Debug, Clone, Copy)]
pub struct Options<'a> {
    /// Which samples.
    pub wanted: Wanted<'a>,
    /// What is simulated.
    pub effects: Effects,
    /// Where.
    pub scenes: &'a [Scene],
    /// Threads.
    pub workers: usize,
}

/// Why a set was not written.
#[derive(Debug, thiserror::Error)]
pub enum SetError {
    /// A sample.
    #[error(transparent)]
    Sample(#[from] SampleError),
    /// The manifest.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// A shard.
    #[error(transparent)]
    Shard(#[from] NpzError),
    /// The folder.
    #[error("cannot make the folder {path}: {source}")]
    Folder {
        /// The folder.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// Maps of two scenes have different shapes.
    #[error(
        "the maps of {0} and {1} differ: give both scenes the same profile and depth_m, or make a set of each"
    )]
    Shapes(String, String),
    /// The folder holds a set made with other options.
    #[error(
        "{folder} holds another data set: its {key} is {there}, not {wanted}; choose another folder or remove it"
    )]
    Other {
        /// The folder.
        folder: PathBuf,
        /// First key that differs.
        key: String,
        /// What it is there.
        there: String,
        /// What is asked for.
        wanted: String,
    },
    /// The folder's manifest is none.
    #[error("{0} is no manifest of a data set: choose another folder or remove it")]
    NoManifest(PathBuf),
    /// More setups than there are.
    #[error("the scenes have {there} setups, of a person, a place and a way to look: ask for no more")]
    Setups {
        /// How many there are.
        there: usize,
    },
    /// Samples of one shard have different shapes.
    #[error("the samples of a shard do not fit together: {0}")]
    Array(ndarray::ShapeError),
    /// The user stopped it.
    #[error("stopped; the shards that are complete stay, the same command goes on from there")]
    Interrupted,
}

/// What was written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Summary {
    /// Samples of the set.
    pub samples: u32,
    /// Shards of the set.
    pub shards: u32,
    /// Shards that were there already.
    pub shards_kept: u32,
}

/// Name of a shard's file.
pub fn shard_name(shard: u32) -> String {
    format!("shard-{shard:05}.npz")
}

/// Writes a set to `folder`. `progress` is told the share that is done, 0 to 1, and says whether to go on.
///
/// # Errors
/// If anything cannot be made or written, or the folder holds another set.
pub fn write(
    folder: &Path,
    options: &Options<'_>,
    progress: &mut dyn FnMut(f64) -> bool,
) -> Result<Summary, SetError> {
    let Options { wanted, scenes, .. } = options;
    same_shapes(scenes)?;
    if let Some(wanted) = wanted.setups {
        let there = most_setups(scenes);
        if there < wanted as usize {
            return Err(SetError::Setups { there });
        }
    }
    for (scene, category) in scenes.iter().flat_map(|s| wanted.categories.iter().map(move |c| (s, c))) {
        if !scene.tags.iter().any(|t| t.object == category.object) {
            let object = category.object;
            return Err(SampleError::NoTag { scene: scene.name.clone(), object }.into());
        }
    }
    let draws = draw(wanted, scenes);
    let mut manifest = manifest(options, &draws);
    std::fs::create_dir_all(folder)
        .map_err(|source| SetError::Folder { path: folder.to_path_buf(), source })?;
    let path = folder.join(MANIFEST);
    if path.is_file() {
        compare(folder, &path, &manifest)?;
    }
    if let Some(text) = scenes.first().and_then(|scene| profile::text(&scene.radar.profile)) {
        atomic::write(folder.join(PROFILE), text.as_bytes())?;
    }
    // Until all shards are there it is not complete, also where one was taken away.
    atomic::write(&path, &text(&manifest))?;
    let shards: Vec<(u32, &[Draw])> = (0..).zip(draws.chunks(SHARD_SAMPLES as usize)).collect();
    let missing: Vec<_> = shards.iter().filter(|(n, _)| !folder.join(shard_name(*n)).is_file()).collect();
    make(folder, options, &missing, progress)?;
    manifest["complete"] = true.into();
    atomic::write(&path, &text(&manifest))?;
    Ok(Summary {
        samples: wanted.samples,
        shards: shards.len() as u32,
        shards_kept: (shards.len() - missing.len()) as u32,
    })
}

fn text(manifest: &Value) -> Vec<u8> {
    format!("{manifest:#}\n").into_bytes()
}

/// Makes the missing shards with all workers.
fn make(
    folder: &Path,
    options: &Options<'_>,
    missing: &[&(u32, &[Draw])],
    progress: &mut dyn FnMut(f64) -> bool,
) -> Result<(), SetError> {
    let Options { wanted, effects, scenes, workers } = *options;
    let total = missing.iter().map(|(_, draws)| draws.len()).sum();
    Jobs::new(missing.len(), total).run(workers, progress, |jobs| {
        let mut maker = Maker::new(wanted.domain, wanted.seed, effects, scenes)?;
        while let Some((number, draws)) = jobs.next().map(|job| missing[job]) {
            let mut samples = Vec::with_capacity(draws.len());
            for draw in *draws {
                if jobs.stopped() {
                    return Err(SetError::Interrupted);
                }
                samples.push(maker.make(draw)?);
                jobs.done(1);
            }
            write_shard(&folder.join(shard_name(*number)), draws, &samples, epoch(&effects))?;
        }
        Ok(())
    })
}

fn same_shapes(scenes: &[Scene]) -> Result<(), SetError> {
    let shape = |s: &Scene| (s.radar.profile.clone(), s.gate());
    match scenes.windows(2).find(|pair| shape(&pair[0]) != shape(&pair[1])) {
        Some([a, b]) => Err(SetError::Shapes(a.name.clone(), b.name.clone())),
        _ => Ok(()),
    }
}

/// Everything about a set that its shards do not hold.
fn manifest(options: &Options<'_>, draws: &[Draw]) -> Value {
    let Options { wanted, effects, scenes, .. } = options;
    let described = scenes.iter().map(|scene| {
        json!({
            "name": scene.name,
            "fingerprint": format!("{:08x}", fingerprint(scene)),
            "people": scene.people.iter().map(|p| json!({
                "name": p.name, "height_m": p.height_m, "build": p.build,
            })).collect::<Vec<_>>(),
            "radar_position_m": scene.radar.position.to_array(),
            "antenna_positions_m":
                scene.reader.antennas.iter().map(|a| a.position.to_array()).collect::<Vec<_>>(),
        })
    });
    let maps = scenes.first().map(|scene| {
        let profile = &scene.radar.profile;
        let gate = scene.gate();
        let processing = Processing::with_gate(profile, gate);
        json!({
            "profile_fingerprint": profile.fingerprint(),
            "frame_period_us": profile.frame_period_us,
            "first_range_bin": gate.first,
            "range_bins": gate.bins,
            "range_bin_m": profile.range_bin().0,
            "doppler_bins": profile.loops,
            "velocity_bin_m_s": profile.velocity_bin().0,
            "range_time_columns": processing.range_time_columns,
            "virtual_antennas": profile.virtual_count(),
            "floor_db": level::SCALE.floor_db,
            "step_db": level::SCALE.step_db,
        })
    });
    let names = |list: Vec<&'static str>| list;
    let mut manifest = json!({
        "format": "rf-hoi data set",
        "version": VERSION,
        "simulated": true,
        "program": concat!("rfhoi ", env!("CARGO_PKG_VERSION")),
        "domain": wanted.domain,
        "seed": wanted.seed,
        "samples_total": wanted.samples,
        "nothing": wanted.nothing,
        "expanded": wanted.expand,
        "effects": effects,
        "actions": names(Action::ALL.iter().map(|a| a.name()).collect()),
        "object_names": names(Object::ALL.iter().map(|o| o.name()).collect()),
        "categories": wanted.categories,
        "scenes": described.collect::<Vec<_>>(),
        "maps": maps,
        "lead_in_us": epoch(effects).0,
        "shard_samples": SHARD_SAMPLES,
        "shards": (0..wanted.samples.div_ceil(SHARD_SAMPLES)).map(shard_name).collect::<Vec<_>>(),
        "complete": false,
        "samples": draws,
    });
    if let Some(setups) = wanted.setups {
        manifest["setups"] = setups.into();
    }
    if let Some(circumstance) = wanted.circumstance {
        manifest[CIRCUMSTANCE] = json!(circumstance);
    }
    manifest
}

/// Whether the set that is there is the one that is wanted.
fn compare(folder: &Path, path: &Path, wanted: &Value) -> Result<(), SetError> {
    let no_manifest = || SetError::NoManifest(path.to_path_buf());
    let there: Value =
        std::fs::read(path).ok().and_then(|b| serde_json::from_slice(&b).ok()).ok_or_else(no_manifest)?;
    // Numbers are compared as they are written.
    let wanted: Value = serde_json::from_slice(&text(wanted)).map_err(|_| no_manifest())?;
    let keys = wanted.as_object().ok_or_else(no_manifest)?.keys().map(String::as_str);
    // The samples that are drawn do not tell it.
    let keys = keys.chain([CIRCUMSTANCE]).filter(|k| *k != "complete");
    match keys.into_iter().find(|k| there.get(k) != wanted.get(k)) {
        None => Ok(()),
        Some(key) => {
            let (key, there, wanted) = first_difference(key.to_owned(), there.get(key), wanted.get(key));
            Err(SetError::Other { folder: folder.to_path_buf(), key, there, wanted })
        }
    }
}

/// The path of the first value below `key` that differs, and both values.
fn first_difference(key: String, there: Option<&Value>, wanted: Option<&Value>) -> (String, String, String) {
    let inner = match (there, wanted) {
        (Some(Value::Object(a)), Some(Value::Object(b))) => {
            let keys = a.keys().chain(b.keys());
            keys.map(|k| (format!("{key}.{k}"), a.get(k), b.get(k))).find(|(_, a, b)| a != b)
        }
        (Some(Value::Array(a)), Some(Value::Array(b))) => {
            let longest = 0..a.len().max(b.len());
            longest.map(|i| (format!("{key}[{i}]"), a.get(i), b.get(i))).find(|(_, a, b)| a != b)
        }
        _ => None,
    };
    match inner {
        Some((key, there, wanted)) => first_difference(key, there, wanted),
        None => {
            let text = |v: Option<&Value>| v.map_or("missing".to_owned(), Value::to_string);
            (key, text(there), text(wanted))
        }
    }
}

/// Of all that a scene holds: its fields as they are printed.
fn fingerprint(scene: &Scene) -> u32 {
    fnv::more(fnv::EMPTY, format!("{scene:?}").as_bytes())
}

/// Writes one shard.
fn write_shard(path: &Path, draws: &[Draw], samples: &[Sample], epoch: BridgeTime) -> Result<(), SetError> {
    fn firsts(counts: impl Iterator<Item = usize>) -> Array1<u32> {
        let sums = counts.scan(0, |sum, n| {
            *sum += n as u32;
            Some(*sum)
        });
        std::iter::once(0).chain(sums).collect()
    }
    let frames = || samples.iter().flat_map(|s| &s.frames);
    let reads = || samples.iter().flat_map(|s| s.reads.iter().map(move |r| (s, r)));
    let count = frames().count();
    // Frames are of one shape: the scenes' maps are.
    let stack = |width: usize, map: fn(&super::radar::FrameMaps) -> &[u8]| {
        let bytes: Vec<u8> = frames().flat_map(|f| map(f).iter().copied()).collect();
        let bins = bytes.len() / (count * width).max(1);
        Array3::from_shape_vec((count, bins, width), bytes).map_err(SetError::Array)
    };
    let loops = samples.first().map_or(1, |s| s.loops);
    let columns = samples.first().map_or(1, |s| s.columns);
    let covariance: Vec<f32> = frames().flat_map(|f| f.covariance.iter().copied()).collect();
    let tags: Vec<f32> = samples.iter().flat_map(|s| &s.tags_m).flat_map(|p| p.to_array()).collect();
    let epcs: Vec<_> = samples.iter().map(|s| &s.epcs).collect();
    let tag = samples.iter().zip(&epcs).flat_map(|(s, epcs)| {
        s.reads
            .iter()
            .map(move |r| epcs.iter().position(|e| *e == r.epc).unwrap_or(usize::from(u8::MAX)) as u8)
    });
    let time = |t: BridgeTime| i64::try_from(t.0).unwrap_or(i64::MAX).saturating_sub_unsigned(epoch.0) as i32;
    let channels = samples.first().map_or(0, |s| s.channels.len());
    let khz: Vec<u32> = samples.iter().flat_map(|s| s.channels.iter().map(|c| c.0)).collect();
    let number = |n: Option<usize>| n.map_or(-1, |n| n as i8);
    let objects: Vec<u8> = draws.iter().flat_map(|d| d.objects.iter().map(|o| o.index() as u8)).collect();
    let interactions =
        samples.iter().flat_map(|s| [s.interaction_s.start as f32, s.interaction_s.end as f32]);
    Npz::create(path)?
        .array("frame_first", &firsts(samples.iter().map(|s| s.frames.len())))?
        .array("read_first", &firsts(samples.iter().map(|s| s.reads.len())))?
        .array("range_doppler", &stack(loops, |f| &f.range_doppler)?)?
        .array("range_time", &stack(columns, |f| &f.range_time)?)?
        .array("covariance", &two(count, covariance)?)?
        .array("moving_cells", &frames().map(|f| f.moving_cells).collect::<Array1<u32>>())?
        .array(
            "tag_position_m",
            &Array3::from_shape_vec((count, SAMPLE_TAGS, 3), tags).map_err(SetError::Array)?,
        )?
        .array("read_time_us", &reads().map(|(_, r)| time(r.time)).collect::<Array1<i32>>())?
        .array("read_tag", &tag.collect::<Array1<u8>>())?
        .array("read_antenna", &reads().map(|(_, r)| r.antenna.0 as u8).collect::<Array1<u8>>())?
        .array("read_channel", &reads().map(|(_, r)| r.channel.0 as u8).collect::<Array1<u8>>())?
        .array("read_phase", &reads().map(|(_, r)| r.phase.map_or(0, |p| p.0)).collect::<Array1<u16>>())?
        .array("read_rssi", &reads().map(|(_, r)| r.rssi.0).collect::<Array1<i16>>())?
        .array("read_doppler", &reads().map(|(_, r)| r.doppler.map_or(0, |d| d.0)).collect::<Array1<i16>>())?
        .array(
            "channel_khz",
            &Array2::from_shape_vec((samples.len(), channels), khz).map_err(SetError::Array)?,
        )?
        .array("duration_s", &samples.iter().map(|s| s.duration_s as f32).collect::<Array1<f32>>())?
        .array("interaction_s", &two(samples.len(), interactions.collect())?)?
        .array(
            "action",
            &draws.iter().map(|d| number(d.label.map(|l| l.action.index()))).collect::<Array1<i8>>(),
        )?
        .array("target", &draws.iter().map(|d| number(d.target)).collect::<Array1<i8>>())?
        .array(
            "objects",
            &Array2::from_shape_vec((draws.len(), SAMPLE_TAGS), objects).map_err(SetError::Array)?,
        )?
        .finish()?;
    Ok(())
}

/// Rows of equal length.
fn two(rows: usize, values: Vec<f32>) -> Result<Array2<f32>, SetError> {
    let width = values.len() / rows.max(1);
    Array2::from_shape_vec((rows, width), values).map_err(SetError::Array)
}

#[cfg(test)]
mod tests;
