//! A network and six seconds of random frames: what peers are held against, and what is timed.

use std::collections::BTreeMap;
use std::path::Path;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rfhoi_network::model::Model;
use rfhoi_network::reference::Reference;
use rfhoi_network::sample::{Answer, Frame, Frames, MAPS, READ_CHANNELS, Runner, SCALARS, Sample};
use safetensors::tensor::{Dtype, TensorView};

/// Six seconds at 10 Hz.
pub const FRAMES: usize = 60;
/// Candidate tags of the paper's samples.
pub const TAGS: usize = 6;

/// A model and a window for it.
#[derive(Debug, Clone)]
pub struct Case {
    /// f32.
    pub model: Model,
    /// [`FRAMES`] frames.
    pub sample: Sample,
    /// A vector for each tag.
    pub names: Vec<Vec<f32>>,
}

impl Case {
    /// Random frames of [`TAGS`] tags for `model`, whose scores are taken as they are: at temperature 1.
    pub fn new(model: Model) -> Self {
        Self::with_tags(model, TAGS)
    }

    /// The same of so many tags.
    pub fn with_tags(mut model: Model, tags: usize) -> Self {
        model.description.temperature = 1.0;
        let config = &model.description.config;
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut frames = Frames::new(config.points, tags, config.antennas);
        for _ in 0..FRAMES {
            let maps: Vec<u8> = (0..MAPS * config.points * config.points).map(|_| rng.random()).collect();
            let scalars: Vec<f32> = (0..SCALARS).map(|_| rng.random()).collect();
            let count = tags * config.antennas * READ_CHANNELS;
            let reads: Vec<f32> = (0..count).map(|_| rng.random_range(-1.0..1.0)).collect();
            frames.push(Frame { maps: &maps, scalars: &scalars, reads: &reads, covariance: &[] });
        }
        let mut name = || (0..config.name_dimensions).map(|_| rng.random_range(-1.0..1.0)).collect();
        let names = (0..tags).map(|_| name()).collect();
        let sample = Sample { frames, objects: (0..tags).collect(), ..Sample::default() };
        Self { model, sample, names }
    }

    /// Takes all frames but the last as they come.
    pub fn push_all_but_last(&self, runner: &mut dyn Runner) {
        runner.clear();
        for number in 0..FRAMES - 1 {
            runner.push(self.sample.frames.frame(number)).expect("a frame of the network's shape");
        }
    }

    /// Takes the last frame.
    pub fn push_last(&self, runner: &mut dyn Runner) {
        runner.push(self.sample.frames.frame(FRAMES - 1)).expect("a frame of the network's shape");
    }

    /// Answers for all frames.
    pub fn answer(&self, runner: &mut dyn Runner) -> Answer {
        runner.answer(0..FRAMES, &self.names.concat()).expect("frames that were pushed")
    }

    /// Leaves the model, the window and what Burn's f32 says of it in `folder`, for `peers/onnx.py`.
    ///
    /// # Panics
    /// If the files cannot be written.
    pub fn write(&self, folder: &Path) {
        let mut burn = Reference::new(&self.model).expect("an f32 model");
        self.push_all_but_last(&mut burn);
        self.push_last(&mut burn);
        let answer = self.answer(&mut burn);
        let config = &self.model.description.config;
        let bytes = |values: &[f32]| values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
        let frames = &self.sample.frames;
        let maps = vec![FRAMES, MAPS, config.points, config.points];
        let reads = vec![FRAMES, frames.tags, config.antennas, READ_CHANNELS];
        let names = vec![frames.tags, config.name_dimensions];
        let arrays: BTreeMap<&str, (Dtype, Vec<usize>, Vec<u8>)> = BTreeMap::from([
            ("maps", (Dtype::U8, maps, frames.maps.clone())),
            ("scalars", (Dtype::F32, vec![FRAMES, SCALARS], bytes(&frames.scalars))),
            ("reads", (Dtype::F32, reads, bytes(&frames.reads))),
            ("names", (Dtype::F32, names, bytes(&self.names.concat()))),
            ("actions", (Dtype::F32, vec![answer.actions.len()], bytes(&answer.actions))),
            ("targets", (Dtype::F32, vec![answer.targets.len()], bytes(&answer.targets))),
        ]);
        let views: Vec<(&str, TensorView<'_>)> = arrays
            .iter()
            .map(|(name, (dtype, shape, bytes))| {
                (*name, TensorView::new(*dtype, shape.clone(), bytes).expect("bytes of that shape"))
            })
            .collect();
        let file = safetensors::serialize(views, None).expect("arrays");
        std::fs::create_dir_all(folder).expect("a folder");
        std::fs::write(folder.join("case.safetensors"), file).expect("a file");
        std::fs::write(folder.join("model.safetensors"), self.model.to_bytes().expect("a model"))
            .expect("a file");
    }
}
