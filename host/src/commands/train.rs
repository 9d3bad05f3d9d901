//! `rfhoi train`, `finetune`, `evaluate`, `quantize`.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use clap::{Args, ValueEnum};
use indicatif::{ProgressBar, ProgressStyle};
use rfhoi::atomic;
use rfhoi::features::{AngleMap, Settings};
use rfhoi::hoi::Action;
use rfhoi::learn::{self, Data};
use rfhoi::recognize;
use rfhoi_network::config::{Beams, Fusion, NetworkConfig, Temporal};
use rfhoi_network::execute::quantize;
use rfhoi_network::metrics::Metrics;
use rfhoi_network::model::{Description, Model, Precision};
use rfhoi_network::names::Names;
use rfhoi_network::train::{Epoch, Folder, Recipe, Watch, train};
use serde::Serialize;
use serde_json::json;

use super::{Progress, report, stopped};

/// Model of a run's folder.
pub(super) const MODEL: &str = "model.safetensors";
/// Epochs of a run's folder.
const HISTORY: &str = "history.csv";

/// Shape of a network, by name or file, and changes to it.
#[derive(Debug, Args)]
pub(super) struct NetworkArgs {
    /// Shape of the network: small, paper, or a file (.toml or .json).
    #[arg(long, value_name = "NAME|FILE", default_value = "small")]
    network: String,
    /// What the heads see.
    #[arg(long, value_enum)]
    fusion: Option<FusionName>,
    /// Points of a map each way.
    #[arg(long)]
    points: Option<usize>,
    /// How the angle map is made.
    #[arg(long, value_enum, default_value = "bartlett")]
    angles: AngleName,
    /// Reader antennas, the first ones.
    #[arg(long)]
    antennas: Option<usize>,
    /// Radar branch: convolutions over time in place of the transformer, as XRF55 has them.
    #[arg(long)]
    temporal_cnn: bool,
    /// Radar branch: learnt beams on the covariance in place of the angle map, as CubeLearn learns transforms.
    #[arg(long, value_name = "BEAMS")]
    beams: Option<usize>,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(super) enum FusionName {
    Concat,
    None,
    Rfid,
    Radar,
    Film,
    Attention,
}

impl From<FusionName> for Fusion {
    fn from(name: FusionName) -> Self {
        match name {
            FusionName::Concat => Self::Concat,
            FusionName::None => Self::None,
            FusionName::Rfid => Self::Rfid,
            FusionName::Radar => Self::Radar,
            FusionName::Film => Self::Film,
            FusionName::Attention => Self::Attention,
        }
    }
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(super) enum AngleName {
    None,
    Bartlett,
    Capon,
    Music,
}

impl From<AngleName> for AngleMap {
    fn from(name: AngleName) -> Self {
        match name {
            AngleName::None => Self::None,
            AngleName::Bartlett => Self::Bartlett,
            AngleName::Capon => Self::Capon,
            AngleName::Music => Self::Music,
        }
    }
}

impl NetworkArgs {
    /// The network that is asked for, and what its features are made of.
    pub(super) fn build(
        &self,
        names: &Names,
        virtual_antennas: usize,
    ) -> anyhow::Result<(NetworkConfig, Settings)> {
        let dimensions = names.dimensions();
        let mut config = match self.network.as_str() {
            "small" => NetworkConfig::small(dimensions),
            "paper" => NetworkConfig::paper(dimensions),
            file => {
                let text = std::fs::read_to_string(file)
                    .with_context(|| format!("{file} is neither small nor paper, nor a file to be read"))?;
                match Path::new(file).extension().and_then(|e| e.to_str()) {
                    Some("json") => serde_json::from_str(&text).context(file.to_owned())?,
                    _ => toml::from_str(&text).context(file.to_owned())?,
                }
            }
        };
        if let Some(fusion) = self.fusion {
            config.fusion = fusion.into();
        }
        if let Some(points) = self.points {
            config.points = points;
        }
        if let Some(antennas) = self.antennas {
            config.antennas = antennas;
        }
        if self.temporal_cnn {
            config.radar.temporal = Temporal::Convolution;
        }
        if let Some(beams) = self.beams {
            config.beams = Some(Beams { antennas: virtual_antennas, beams });
        }
        let angles: AngleMap = self.angles.into();
        config.maps[2] = angles != AngleMap::None;
        config.check()?;
        let settings = Settings {
            points: config.points,
            angles,
            antennas: config.antennas,
            covariance: config.beams.is_some(),
        };
        Ok((config, settings))
    }
}

/// How long and how fast.
#[derive(Debug, Args)]
pub(super) struct RecipeArgs {
    /// Seed of weights, order, augmentation and dropout.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Epochs at most.
    #[arg(long)]
    epochs: Option<u32>,
    /// Samples of a batch.
    #[arg(long)]
    batch: Option<usize>,
    /// Highest learning rate.
    #[arg(long)]
    learning_rate: Option<f64>,
    /// Weight of the target's loss beside the action's.
    #[arg(long)]
    target_weight: Option<f64>,
    /// Epochs without a better validation after which to stop; 0 is never.
    #[arg(long)]
    patience: Option<u32>,
}

impl RecipeArgs {
    pub(super) fn apply(&self, mut recipe: Recipe) -> anyhow::Result<Recipe> {
        recipe.seed = self.seed;
        recipe.epochs = self.epochs.unwrap_or(recipe.epochs);
        recipe.batch = self.batch.unwrap_or(recipe.batch);
        recipe.learning_rate = self.learning_rate.unwrap_or(recipe.learning_rate);
        recipe.target_weight = self.target_weight.unwrap_or(recipe.target_weight);
        recipe.patience = self.patience.unwrap_or(recipe.patience);
        ensure!(recipe.epochs > 0 && recipe.batch > 0, "--epochs and --batch must be at least 1");
        ensure!(recipe.learning_rate > 0.0, "--learning-rate must be positive");
        Ok(recipe)
    }
}

/// `rfhoi train`.
#[derive(Debug, Args)]
pub(super) struct Train {
    /// Folder of a data set.
    #[arg(long, value_name = "DIR")]
    set: PathBuf,
    /// Folder for model.safetensors, history.csv and what the run needs to go on after it was stopped.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Share of the set's samples to learn from; what is left over is not touched.
    #[arg(long, default_value_t = 1.0, value_name = "SHARE")]
    share: f64,
    #[command(flatten)]
    network: NetworkArgs,
    #[command(flatten)]
    recipe: RecipeArgs,
}

/// `rfhoi finetune`.
#[derive(Debug, Args)]
pub(super) struct Finetune {
    /// Model to begin with (f32).
    model: PathBuf,
    /// Folder of a data set.
    #[arg(long, value_name = "DIR")]
    set: PathBuf,
    /// Folder for model.safetensors, history.csv and what the run needs to go on after it was stopped.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Share of the set's samples to learn from, drawn by --split-seed; the model is measured on the others.
    #[arg(long, default_value_t = 0.3, value_name = "SHARE")]
    share: f64,
    /// Seed of that draw.
    #[arg(long, default_value_t = 1)]
    split_seed: u64,
    /// Folder of another set, such as that of pre-training, of which each epoch learns some samples beside, so that what was learnt
    /// before is not forgotten.
    #[arg(long, value_name = "DIR")]
    beside: Option<PathBuf>,
    /// How many of these, for each sample to learn from.
    #[arg(long, default_value_t = 1.0, value_name = "SAMPLES", requires = "beside")]
    beside_share: f64,
    #[command(flatten)]
    recipe: RecipeArgs,
}

/// `rfhoi evaluate`.
#[derive(Debug, Args)]
pub(super) struct Evaluate {
    /// Model, f32 or int8.
    model: PathBuf,
    /// Folder of a data set.
    #[arg(long, value_name = "DIR")]
    set: PathBuf,
    /// Only samples that `finetune` with this share has not learnt from; 0 takes all.
    #[arg(long, default_value_t = 0.0, value_name = "SHARE")]
    share: f64,
    /// Seed of that draw.
    #[arg(long, default_value_t = 1)]
    split_seed: u64,
    /// Take of each sample only what `rfhoi recognize` would cut out of it, and only samples of which it finds most.
    #[arg(long)]
    windows: bool,
}

/// `rfhoi quantize`.
#[derive(Debug, Args)]
pub(super) struct Quantize {
    /// Model (f32).
    model: PathBuf,
    /// Folder of the data set from which activations learn their scales.
    #[arg(long, value_name = "DIR")]
    set: PathBuf,
    /// Samples of it, of those that `finetune` with --share learnt from.
    #[arg(long, default_value_t = learn::CALIBRATION_SAMPLES, value_name = "SAMPLES")]
    calibration: usize,
    /// Share of the set's samples that was learnt from.
    #[arg(long, default_value_t = 0.3, value_name = "SHARE")]
    share: f64,
    /// Seed of that draw.
    #[arg(long, default_value_t = 1)]
    split_seed: u64,
    /// File for the int8 model.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

/// The names that ship.
pub(super) fn names() -> anyhow::Result<Names> {
    recognize::model::names().context("the names that this program was built with")
}

/// Reads a model.
pub(super) fn model(path: &Path) -> anyhow::Result<Model> {
    let bytes = std::fs::read(path).with_context(|| format!("cannot read the model {}", path.display()))?;
    Model::from_bytes(&bytes).with_context(|| path.display().to_string())
}

/// Reads a set, with progress.
pub(super) fn data(folder: &Path, settings: Settings, names: &Names) -> anyhow::Result<Data> {
    let progress = Progress::new(format!("features of {}", folder.display()))?;
    let workers = std::thread::available_parallelism().map_or(1, usize::from);
    Ok(learn::load(folder, settings, names, workers, &mut |share| progress.show(share))?)
}

/// Settings of the features that a model takes.
pub(super) fn settings(model: &Model) -> anyhow::Result<Settings> {
    Ok(recognize::model::settings(&model.description)?)
}

/// Shows a run in the terminal and keeps its epochs as a file.
pub(super) struct Live {
    bar: ProgressBar,
    history: Option<PathBuf>,
    rows: String,
}

impl Live {
    pub(super) fn new(name: &str, history: Option<PathBuf>, so_far: &[Epoch]) -> anyhow::Result<Self> {
        super::listen_for_ctrl_c()?;
        let bar = ProgressBar::new(1).with_message(name.to_owned());
        let style = ProgressStyle::with_template("{msg} epoch {prefix} {wide_bar} {pos}/{len} {eta} left");
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        let mut live = Self {
            bar,
            history,
            rows: "epoch,loss,training_hoi,validation_hoi,validation_action,validation_object,validation_loss,samples_per_s\n".into(),
        };
        so_far.iter().for_each(|epoch| live.row(epoch));
        Ok(live)
    }

    fn row(&mut self, epoch: &Epoch) {
        let validation = match epoch.validation {
            Some(values) => values.map(|value| format!("{value:.4}")).join(","),
            None => ",,,".to_owned(),
        };
        let Epoch { epoch, loss, training_hoi, samples_per_s, .. } = epoch;
        self.rows.push_str(&format!("{epoch},{loss:.4},{training_hoi:.4},{validation},{samples_per_s:.1}\n"));
    }
}

impl Watch for Live {
    fn batch(&mut self, epoch: u32, batch: usize, of: usize, loss: f64) -> bool {
        self.bar.set_length(of as u64);
        self.bar.set_prefix(format!("{epoch}, loss {loss:.3}"));
        self.bar.set_position(batch as u64 + 1);
        !stopped()
    }

    fn epoch(&mut self, epoch: &Epoch) {
        self.row(epoch);
        if let Some(path) = &self.history {
            // The run's own state is what counts; a table that cannot be written is said, not the end of it.
            if let Err(error) = atomic::write(path, self.rows.as_bytes()) {
                tracing::warn!("{error}");
            }
        }
        let validation = epoch.validation.map_or(String::new(), |[hoi, action, object, loss]| {
            format!(
                ", validation: HOI {:.1} %, action {:.1} %, object {:.1} %, loss {loss:.3}",
                100.0 * hoi,
                100.0 * action,
                100.0 * object
            )
        });
        let line = format!(
            "epoch {}: loss {:.3}, HOI {:.1} %{validation}, {:.0} samples/s",
            epoch.epoch,
            epoch.loss,
            100.0 * epoch.training_hoi,
            epoch.samples_per_s
        );
        if self.bar.is_hidden() {
            let _ = writeln!(std::io::stderr(), "{line}");
        } else {
            self.bar.println(line);
        }
    }
}

impl Drop for Live {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

#[derive(Debug, Serialize)]
struct Made {
    simulated: bool,
    model: PathBuf,
    parameters: usize,
    epochs: usize,
    best_epoch: u32,
    history: PathBuf,
    seconds: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    test: Option<Figures>,
}

/// Figures of a model for people and scripts.
#[derive(Debug, Serialize)]
pub(super) struct Figures {
    samples: u32,
    hoi: String,
    action: String,
    object: String,
    told: String,
    right_of_told: String,
    nothing: String,
    false_alarms: String,
    calibration_error: f64,
}

impl From<&Metrics> for Figures {
    fn from(metrics: &Metrics) -> Self {
        Self {
            samples: metrics.hoi.of + metrics.nothing.of,
            hoi: metrics.hoi.to_string(),
            action: metrics.action.to_string(),
            object: metrics.object.to_string(),
            told: metrics.told.to_string(),
            right_of_told: metrics.right_of_told.to_string(),
            nothing: metrics.nothing.to_string(),
            false_alarms: metrics.false_alarms.to_string(),
            calibration_error: (1e4 * metrics.calibration_error()).round() / 1e4,
        }
    }
}

fn save(model: &Model, path: &Path) -> anyhow::Result<()> {
    Ok(atomic::write(path, &model.to_bytes()?)?)
}

/// The command as it was given, for the model's provenance.
fn command() -> String {
    let mut words = std::env::args().skip(1);
    let first = words.next().unwrap_or_default();
    words.fold(format!("rfhoi {first}"), |line, word| format!("{line} {word}"))
}

impl Train {
    pub(super) fn run(&self, json: bool) -> anyhow::Result<()> {
        let began = std::time::Instant::now();
        let names = names()?;
        let (config, settings) =
            self.network.build(&names, rfhoi_shared::radar::RadarProfile::bridge().virtual_count())?;
        let recipe = self.recipe.apply(Recipe::pre_training(self.recipe.seed))?;
        let data = data(&self.set, settings, &names)?;
        let mut kept = learn::random_split(data.set.samples.len(), self.share, recipe.seed).learn;
        let validation = kept.split_off(kept.len() - (kept.len() as f64 * learn::VALIDATION_SHARE) as usize);
        let (samples, validation) = (data.samples(&kept), data.samples(&validation));
        let mut description =
            Description::new(config, data.maps.clone(), settings.angles.to_string(), names.fingerprint());
        description.actions = Action::ALL.iter().map(|action| action.name().to_owned()).collect();
        description.provenance = json!({
            "simulated": true,
            "steps": [{
                "command": command(),
                "domain": data.set.domain,
                "set_seed": data.set.seed,
                "samples": samples.len(),
                "recipe": recipe,
            }],
        });
        std::fs::create_dir_all(&self.out)
            .with_context(|| format!("cannot make the folder {}", self.out.display()))?;
        let history = self.out.join(HISTORY);
        let mut live = Live::new("training", Some(history.clone()), &[])?;
        let folder = Folder(self.out.join("run"));
        let material = data.material(&samples, &validation);
        let trained = train(&description, None, &recipe, material, Some(&folder), &mut live)?;
        drop(live);
        let path = self.out.join(MODEL);
        save(&trained.model, &path)?;
        let made = Made {
            simulated: true,
            model: path,
            parameters: trained.model.parameters(),
            epochs: trained.history.len(),
            best_epoch: trained.best_epoch,
            history,
            seconds: began.elapsed().as_secs_f64().round(),
            test: None,
        };
        report::print(&made, json)
    }
}

impl Finetune {
    pub(super) fn run(&self, json: bool) -> anyhow::Result<()> {
        let began = std::time::Instant::now();
        let names = names()?;
        let from = model(&self.model)?;
        let settings = settings(&from)?;
        let mut recipe = self.recipe.apply(Recipe::fine_tuning(self.recipe.seed))?;
        ensure!((0.0..=1e3).contains(&self.beside_share), "--beside-share must be 0 to 1000");
        let beside = self.beside.as_ref().map(|folder| data(folder, settings, &names)).transpose()?;
        recipe.beside = if beside.is_some() { self.beside_share } else { 0.0 };
        let data = data(&self.set, settings, &names)?;
        let same = beside.as_ref().is_none_or(|other| other.set.objects == data.set.objects);
        ensure!(same, "--beside has other objects than --set: make both with the same version of rfhoi");
        let others: Vec<_> = beside.iter().flat_map(|other| &other.set.samples).collect();
        let split = learn::random_split(data.set.samples.len(), self.share, self.split_seed);
        std::fs::create_dir_all(&self.out)
            .with_context(|| format!("cannot make the folder {}", self.out.display()))?;
        let history = self.out.join(HISTORY);
        let mut live = Live::new("fine-tuning", Some(history.clone()), &[])?;
        let folder = Folder(self.out.join("run"));
        let lesson = learn::Lesson { data: &data, split: &split, beside: &others };
        let tuned = learn::tune(&from, lesson, &recipe, &command(), Some(&folder), &mut live)?;
        drop(live);
        let path = self.out.join(MODEL);
        save(&tuned.model, &path)?;
        let progress = Progress::new("measuring")?;
        let metrics = learn::metrics(&tuned.model, &data, &data.samples(&split.test), &mut |share| {
            progress.show(share)
        })?;
        drop(progress);
        let made = Made {
            simulated: true,
            model: path,
            parameters: tuned.model.parameters(),
            epochs: tuned.history.len(),
            best_epoch: tuned.best_epoch,
            history,
            seconds: began.elapsed().as_secs_f64().round(),
            test: Some(Figures::from(&metrics)),
        };
        report::print(&made, json)
    }
}

impl Evaluate {
    pub(super) fn run(&self, json: bool) -> anyhow::Result<()> {
        let names = names()?;
        let model = model(&self.model)?;
        let mut data = data(&self.set, settings(&model)?, &names)?;
        let mut test = learn::random_split(data.set.samples.len(), self.share, self.split_seed).test;
        if self.windows {
            let all = test.len();
            test.retain(|&place| data.set.samples[place].window.is_some());
            data.cut();
            tracing::warn!("{} of {all} samples have a window that holds most of what is done", test.len());
        }
        let samples = data.samples(&test);
        let progress = Progress::new("measuring")?;
        let metrics = learn::metrics(&model, &data, &samples, &mut |share| progress.show(share))?;
        drop(progress);
        if json {
            println!(
                "{}",
                json!({ "simulated": true, "figures": Figures::from(&metrics), "metrics": metrics })
            );
            return Ok(());
        }
        report::print(&Figures::from(&metrics), false)?;
        print!("{}", confusion(&metrics, &model.description.actions));
        Ok(())
    }
}

/// Rows: what was done; columns: what was said.
fn confusion(metrics: &Metrics, actions: &[String]) -> String {
    let names: Vec<&str> = actions.iter().map(String::as_str).chain(["nothing"]).collect();
    let width = names.iter().map(|name| name.len()).max().unwrap_or(0);
    let header = names.iter().map(|name| format!(" {name:>width$}")).collect::<String>();
    let mut table = format!("{:width$}{header}\n", "done \\ said");
    for (name, row) in names.iter().zip(&metrics.confusion) {
        let cells = row.iter().map(|count| format!(" {count:>width$}")).collect::<String>();
        table.push_str(&format!("{name:width$}{cells}\n"));
    }
    table
}

impl Quantize {
    pub(super) fn run(&self, json: bool) -> anyhow::Result<()> {
        let names = names()?;
        let from = model(&self.model)?;
        let data = data(&self.set, settings(&from)?, &names)?;
        let split = learn::random_split(data.set.samples.len(), self.share, self.split_seed);
        let places = &split.learn[..self.calibration.min(split.learn.len())];
        let model = quantize(&from, &data.samples(places), &data.names)?;
        ensure!(model.description.precision == Precision::Int8, "the model is not int8");
        save(&model, &self.out)?;
        let bytes = |path: &Path| std::fs::metadata(path).map_or(0, |data| data.len());
        report::print(
            &json!({
                "model": self.out,
                "calibration_samples": places.len(),
                "f32_bytes": bytes(&self.model),
                "int8_bytes": bytes(&self.out),
            }),
            json,
        )
    }
}
