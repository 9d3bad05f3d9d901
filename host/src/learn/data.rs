//! A data set as the network takes it, with the names' vectors.

use std::ops::Range;
use std::path::Path;

use rfhoi_network::names::Names;
use rfhoi_network::sample::{SCALARS, Sample};
use rfhoi_network::train::Material;

use crate::features::set::{self, SetError, SetFeatures};
use crate::features::{Settings, moving_cells};
use crate::hoi::{Action, Object};
use crate::recognize::segment;

/// A data set and what its objects' names mean.
#[derive(Debug, Clone)]
pub struct Data {
    /// The samples and where they are from.
    pub set: SetFeatures,
    /// The radar's maps, as the set's manifest describes them.
    pub maps: serde_json::Value,
    /// Vectors of the set's objects by their numbers, and after them those of all things that are carried.
    pub names: Vec<Vec<f32>>,
    /// Numbers of things that are carried, and of the actions for which one carried thing may stand for another.
    interchangeable: (Vec<usize>, Vec<usize>),
    /// What each action is backwards.
    reversed: Vec<usize>,
}

/// Share of what is done that a window must hold to be learnt from as a whole.
const MOSTLY: f64 = 0.6;

/// Why there is no data.
#[derive(Debug, thiserror::Error)]
pub enum DataError {
    /// The set.
    #[error(transparent)]
    Set(#[from] SetError),
    /// A name without a vector.
    #[error(
        "the object `{0}` of the set is not among the names; add it to the list in models/names and make their file anew"
    )]
    Name(String),
    /// Actions of another vocabulary.
    #[error("the set's actions are not those of this program")]
    Actions,
    /// The manifest.
    #[error("{0} cannot be read")]
    Manifest(String),
}

/// Reads the set in `folder`.
///
/// # Errors
/// If it cannot be read, or has names without vectors.
pub fn load(
    folder: &Path,
    settings: Settings,
    names: &Names,
    workers: usize,
    progress: &mut dyn FnMut(f64) -> bool,
) -> Result<Data, DataError> {
    let options = set::Options { settings, profile: None, workers };
    let mut set = set::load(folder, &options, progress)?;
    let (frame_s, setups) = (set.frame_s, &set.setups);
    for (sample, setup) in set.samples.iter_mut().zip(setups) {
        sample.window = window(sample, frame_s, setup.interaction_s);
    }
    if !set.actions.iter().map(String::as_str).eq(Action::ALL.iter().map(|action| action.name())) {
        return Err(DataError::Actions);
    }
    let manifest = folder.join(crate::simulate::set::MANIFEST);
    let unread = || DataError::Manifest(manifest.display().to_string());
    let text = std::fs::read(&manifest).map_err(|_| unread())?;
    let described: serde_json::Value = serde_json::from_slice(&text).map_err(|_| unread())?;
    let mut vectors = Vec::new();
    for object in &set.objects {
        let place = names.lookup(object).place().ok_or_else(|| DataError::Name(object.clone()))?;
        vectors.push(names.vector(place).to_vec());
    }
    let is_carried = |name: &String| Object::named(name).is_some_and(Object::is_carried);
    let mut carried: Vec<usize> = set
        .objects
        .iter()
        .enumerate()
        .filter(|(_, name)| is_carried(name))
        .map(|(number, _)| number)
        .collect();
    for place in (0..names.len()).filter(|&place| names.handling(place).carried()) {
        carried.push(vectors.len());
        vectors.push(names.vector(place).to_vec());
    }
    let agnostic = Action::ALL.iter().filter(|action| action.is_object_agnostic());
    Ok(Data {
        maps: described["maps"].clone(),
        names: vectors,
        interchangeable: (carried, agnostic.map(|action| action.index()).collect()),
        reversed: Action::ALL.iter().map(|action| action.reversed().index()).collect(),
        set,
    })
}

/// The frames that a recognizer would cut out for what is done in a sample from `begin_s` to `end_s`, or, where that is 0, for
/// nothing: those of the segment that holds most of it; `None` where that is less than [`MOSTLY`].
fn window(sample: &Sample, frame_s: f64, [begin_s, end_s]: [f32; 2]) -> Option<Range<usize>> {
    let scalars = sample.frames.scalars.chunks_exact(SCALARS);
    let done = match sample.action {
        Some(_) => [begin_s, end_s].map(|s| (f64::from(s) / frame_s).round() as usize),
        None => [0, sample.frames.len()],
    };
    let shared = |frames: &Range<usize>| frames.end.min(done[1]).saturating_sub(frames.start.max(done[0]));
    let segments = segment::segments(scalars.map(moving_cells), frame_s).into_iter();
    let best = segments.map(|segment| segment.frames).max_by_key(shared)?;
    let least = if sample.action.is_some() { MOSTLY * (done[1] - done[0]) as f64 } else { 0.0 };
    (shared(&best) as f64 >= least).then_some(best)
}

impl Data {
    /// Leaves of each sample that has a window nothing else.
    pub fn cut(&mut self) {
        for sample in &mut self.set.samples {
            if let Some(window) = sample.window.take() {
                let frames = sample.frames.part(window);
                sample.window = Some(0..frames.len());
                sample.frames = frames;
            }
        }
    }

    /// Samples at these places.
    pub fn samples(&self, places: &[usize]) -> Vec<&Sample> {
        places.iter().map(|&place| &self.set.samples[place]).collect()
    }

    /// What to learn from.
    pub fn material<'a>(&'a self, samples: &'a [&'a Sample], validation: &'a [&'a Sample]) -> Material<'a> {
        let (objects, actions) = &self.interchangeable;
        Material {
            samples,
            beside: &[],
            validation,
            names: &self.names,
            interchangeable: (objects, actions),
            reversed: &self.reversed,
        }
    }

    /// Vectors of a sample's tags, one after the other.
    pub fn vectors(&self, sample: &Sample) -> Vec<f32> {
        sample.objects.iter().flat_map(|&object| self.names[object].iter().copied()).collect()
    }
}

#[cfg(test)]
mod tests {
    use rfhoi_network::sample::{Frames, scalar};

    use super::*;

    /// A sample in which something moves in these frames of 50.
    fn sample(moves: Range<usize>, action: Option<usize>) -> Sample {
        let mut scalars = vec![0.0; 50 * SCALARS];
        for frame in moves {
            // About 30 cells.
            scalars[frame * SCALARS + scalar::CELLS] = 0.5;
        }
        Sample { frames: Frames { scalars, ..Frames::default() }, action, ..Sample::default() }
    }

    #[test]
    fn a_window_holds_most_of_what_is_done() {
        let seen = Some(4..36);
        assert_eq!(window(&sample(10..30, Some(0)), 0.1, [0.9, 3.1]), seen);
        assert_eq!(window(&sample(10..30, None), 0.1, [0.0, 0.0]), seen);
        assert_eq!(window(&sample(10..30, Some(0)), 0.1, [3.0, 5.0]), None, "it is of something else");
        assert_eq!(window(&sample(0..0, None), 0.1, [0.0, 0.0]), None, "nothing moves");
    }
}
