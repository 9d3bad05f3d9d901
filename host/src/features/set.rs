//! Labelled samples of a data set, as the network takes them.
//!
//! In: a folder that [`simulate::set`](crate::simulate::set) has written. Out: [`SetFeatures`]. Every sample goes the way that
//! live packets go: its reads, the reader's lead-in first, and the maps of its frames into a
//! [`FrameStream`](crate::align::FrameStream), its frames into [`FrameFeatures`](super::FrameFeatures).
//!
//! What comes out is kept in the set's folder, under `features-` and the settings, a file for each shard:
//!
//! | array | shape, type | what it is |
//! |---|---|---|
//! | `fingerprint` | 1, u32 | of set, shard, settings and their meaning: a file of others is made anew |
//! | `frame_first` | S+1, u32 | where each sample's frames begin |
//! | `interaction_s` | S x 2, f32 | from the person's first movement to the last; 0, 0 without a label |
//! | `maps` | F x 3 x points x points, u8 | see [`Frames`] |
//! | `scalars` | F x [`SCALARS`](rfhoi_network::sample::SCALARS), f32 | the same |
//! | `reads` | F x tags x antennas x [`READ_CHANNELS`](rfhoi_network::sample::READ_CHANNELS), f32 | the same |
//! | `covariance` | F x N^2, f32 | the same; of no columns where it is not wanted |

mod cache;
mod manifest;
mod shard;

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use ndarray_npy::ReadNpzError;
use rfhoi_network::sample::{Frames, Pose, Sample};
use rfhoi_shared::fnv;
use rfhoi_shared::radar::RadarProfile;

use self::manifest::Manifest;
use self::shard::Shard;
use super::Settings;
use crate::align::AlignError;
use crate::jobs::Jobs;
use crate::npz::NpzError;
use crate::simulate::effects::Domain;
use crate::simulate::set::shard_name;

/// How a set is read.
#[derive(Debug, Clone)]
pub struct Options {
    /// What features are made of.
    pub settings: Settings,
    /// The radar's profile; `None` where it has a name or is beside the set, where it is found.
    pub profile: Option<RadarProfile>,
    /// Threads.
    pub workers: usize,
}

/// Why there are no features.
#[derive(Debug, thiserror::Error)]
pub enum SetError {
    /// A file cannot be read.
    #[error("cannot read {path}: {source}")]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The manifest is none, or none that is known here.
    #[error("{path} is no manifest of a data set that can be read: {what}")]
    Manifest {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        what: String,
    },
    /// Shards are missing.
    #[error("{0} is not complete: repeat the command that makes it, which goes on where it stood")]
    Incomplete(PathBuf),
    /// Nobody knows the profile.
    #[error(
        "{path} was made with a radar profile of its own (fingerprint {fingerprint:08x}): give that with --profile, or put it there as profile.cfg"
    )]
    Profile {
        /// The manifest.
        path: PathBuf,
        /// The fingerprint of the profile it was made with.
        fingerprint: u32,
    },
    /// An array of a shard.
    #[error("cannot read array `{name}` of {path}: {source}; remove the file and make the set again")]
    Array {
        /// The shard.
        path: PathBuf,
        /// Name of the array.
        name: &'static str,
        /// What the decoder said.
        source: ReadNpzError,
    },
    /// Arrays of a shard do not fit together.
    #[error("{path}: {what}; remove the file and make the set again")]
    Shard {
        /// The shard.
        path: PathBuf,
        /// What does not fit.
        what: String,
    },
    /// No stream for these settings.
    #[error(transparent)]
    Align(#[from] AlignError),
    /// The folder of what is kept.
    #[error("cannot make the folder {path}: {source}")]
    Folder {
        /// The folder.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// What is kept.
    #[error(transparent)]
    Write(#[from] NpzError),
    /// The user stopped it.
    #[error("stopped; features that are made stay, the same command goes on from there")]
    Interrupted,
}

/// Where, by whom and when a sample was performed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Setup {
    /// Number of the scene in the set.
    pub scene: usize,
    /// Number of the person in the scene.
    pub person: usize,
    /// Where the person stands and looks.
    pub pose: Pose,
    /// The person's first and last movement, s after the first frame; 0 and 0 without an action.
    pub interaction_s: [f32; 2],
    /// Number of the setup, where the set has some.
    pub number: Option<usize>,
}

/// What a set holds, without its features.
#[derive(Debug, Clone, PartialEq)]
pub struct Listing {
    /// The samples, in the set's order.
    pub samples: Vec<Listed>,
    /// Of everything that the manifest says.
    pub fingerprint: u32,
}

/// A sample of a listing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Listed {
    /// Number of the action, and of the object that it is done to.
    pub label: Option<(usize, usize)>,
    /// Where and by whom; `interaction_s` is not known.
    pub setup: Setup,
}

/// Lists the set in `folder`.
///
/// # Errors
/// If the set is not complete or not to be read.
pub fn list(folder: &Path) -> Result<Listing, SetError> {
    let Manifest { samples, fingerprint, .. } = Manifest::read(folder)?;
    let listed = |entry: &manifest::Entry| Listed {
        label: entry.action.zip(entry.target.map(|target| entry.objects[target])),
        setup: entry.setup,
    };
    Ok(Listing { samples: samples.iter().map(listed).collect(), fingerprint })
}

/// All samples of a set.
#[derive(Debug, Clone, PartialEq)]
pub struct SetFeatures {
    /// The samples, in the set's order.
    pub samples: Vec<Sample>,
    /// The setup of each.
    pub setups: Vec<Setup>,
    /// Names of actions by number.
    pub actions: Vec<String>,
    /// Names of objects by number.
    pub objects: Vec<String>,
    /// Names of scenes by number, and of the people in each.
    pub scenes: Vec<(String, Vec<String>)>,
    /// Whose data the set stands for.
    pub domain: Domain,
    /// The seed that it was made with.
    pub seed: u64,
    /// Fingerprint of the radar's profile.
    pub profile: u32,
    /// From frame to frame, s.
    pub frame_s: f64,
    /// What the features are made of.
    pub settings: Settings,
    /// Of set, settings and their meaning.
    pub fingerprint: u32,
    /// Shards whose features were there already.
    pub shards_kept: usize,
}

/// What is measured in the samples of a shard.
#[derive(Debug, Clone, PartialEq)]
struct Measured {
    frames: Vec<Frames>,
    interactions_s: Vec<[f32; 2]>,
}

/// Reads the set in `folder`. `progress` is told the share that is done, 0 to 1, and says whether to go on.
///
/// # Errors
/// If the set is not complete or not to be read, the settings do not fit it, or what is to be kept cannot be written.
pub fn load(
    folder: &Path,
    options: &Options,
    progress: &mut dyn FnMut(f64) -> bool,
) -> Result<SetFeatures, SetError> {
    let Options { settings, profile, workers } = options;
    let manifest = Manifest::read(folder)?;
    let radar = manifest.radar(profile.as_ref())?;
    let stream = settings.stream(&radar).map_err(AlignError::from)?;
    let kept = folder.join(format!("features-{settings}"));
    std::fs::create_dir_all(&kept).map_err(|source| SetError::Folder { path: kept.clone(), source })?;
    let fingerprint = fnv::more(settings.fingerprint(), &manifest.fingerprint.to_le_bytes());
    let shards: Vec<OnceLock<(Measured, bool)>> = (0..manifest.shards()).map(|_| OnceLock::new()).collect();
    let jobs = Jobs::new(shards.len(), manifest.samples.len());
    jobs.run(*workers, progress, |jobs| {
        while let Some(number) = jobs.next() {
            if jobs.stopped() {
                return Err(SetError::Interrupted);
            }
            let name = shard_name(number as u32);
            let path = kept.join(&name);
            let of_shard = fnv::more(fingerprint, &(number as u32).to_le_bytes());
            let samples = manifest.samples_of(number);
            let shape =
                cache::Shape { samples: samples.len(), tags: manifest.tags(), settings, radar: &radar };
            let measured = match cache::read(&path, of_shard, shape) {
                Some(measured) => {
                    jobs.done(samples.len());
                    (measured, true)
                }
                None => {
                    let shard = Shard::read(&folder.join(&name), &manifest, samples.len())?;
                    let measured = shard.measure(&stream, settings, jobs)?;
                    cache::write(&path, of_shard, &measured, shape)?;
                    (measured, false)
                }
            };
            // Each shard is one thread's.
            let _ = shards[number].set(measured);
        }
        Ok(())
    })?;
    let shards: Vec<(Measured, bool)> = shards.into_iter().filter_map(OnceLock::into_inner).collect();
    let shards_kept = shards.iter().filter(|(_, kept)| *kept).count();
    let measured = shards.into_iter().flat_map(|(m, _)| m.frames.into_iter().zip(m.interactions_s));
    let (samples, setups) =
        manifest.samples.iter().zip(measured).map(|(entry, (frames, s))| entry.label(frames, s)).unzip();
    let Manifest { actions, objects, scenes, domain, seed, .. } = manifest;
    Ok(SetFeatures {
        samples,
        setups,
        actions,
        objects,
        scenes,
        domain,
        seed,
        profile: radar.profile.fingerprint(),
        frame_s: f64::from(radar.profile.frame_period_us) * 1e-6,
        settings: *settings,
        fingerprint,
        shards_kept,
    })
}

#[cfg(test)]
mod tests;
