//! Labelled recordings of real devices and of real people's motion, as the network takes them: what has only ever learnt from
//! simulated rooms is held against the world.
//!
//! ```text
//! folder or .tar.xz --[files]--> name, bytes --+--[reads]--> tag reads --FrameStream, FrameFeatures--> [Real]
//!                                              +--[radar]--> spectrograms, heatmaps ----------------> [Real], [Clip](radar::Clip)
//! ```
//!
//! Each of these kinds has one radio and no tuples, so the network is one of its branches with an action's head: the same code as ships,
//! with widths, antennas and classes by configuration. People who are measured on are never learnt from. [`motion`] is another: recorded
//! people, simulated radios, the network that ships.

pub mod files;
mod micro_doppler;
pub mod motion;
pub mod radar;
pub mod reads;

use rfhoi_network::sample::Sample;

/// Recordings of several people.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Real {
    /// The recordings; actions are numbers of [`Self::classes`].
    pub samples: Vec<Sample>,
    /// Who is in each, by number.
    pub people: Vec<u32>,
    /// Names of the people whose numbers are places here; empty where they only have numbers.
    pub who: Vec<String>,
    /// Names of the classes.
    pub classes: Vec<String>,
    /// Vectors of the tags' names, by the samples' numbers of objects.
    pub names: Vec<Vec<f32>>,
}

impl Real {
    /// Places of the recordings of others than `people`, and of theirs.
    pub fn without(&self, people: &[u32]) -> (Vec<usize>, Vec<usize>) {
        (0..self.samples.len()).partition(|&place| !people.contains(&self.people[place]))
    }

    /// Recordings at these places.
    pub fn at(&self, places: &[usize]) -> Vec<&Sample> {
        places.iter().map(|&place| &self.samples[place]).collect()
    }
}

/// Why there are no recordings.
#[derive(Debug, thiserror::Error)]
pub enum RealError {
    /// A folder or archive.
    #[error(transparent)]
    Files(#[from] files::FilesError),
    /// A table of reads.
    #[error(transparent)]
    Reads(#[from] crate::reads::ReadsError),
    /// A recording that is not as it should be.
    #[error("{name}: {what}")]
    Recording {
        /// Its file.
        name: String,
        /// What is wrong.
        what: String,
    },
    /// A table without a label.
    #[error("{0} is not labelled with a person and an activity: only samples of the RDA form are")]
    Unlabelled(String),
    /// More tags than a frame holds.
    #[error("there are {0} tags, {most} at most", most = rfhoi_network::sample::MAX_TAGS)]
    Tags(usize),
    /// The stream.
    #[error(transparent)]
    Align(#[from] crate::align::AlignError),
    /// The user stopped it.
    #[error("stopped")]
    Interrupted,
}
