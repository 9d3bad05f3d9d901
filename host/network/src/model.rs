//! A trained network as a file: safetensors, with what it is and what it needs as JSON in the header.
//!
//! Tensors bear their place in the network as name. A matrix of a dense layer is `[in][out]` in an f32 file as Burn keeps it; in
//! an int8 file it is `[out][in]`, as the kernels take it.

use std::collections::{BTreeMap, HashMap};

use burn::module::{Module, ModuleMapper, ModuleVisitor, Param};
use burn::tensor::{Device, Tensor, TensorData};
use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use serde::{Deserialize, Serialize};

use crate::config::{ConfigError, NetworkConfig};
use crate::network::Network;

/// Key of the description in the header.
const KEY: &str = "rf-hoi";
/// Of the layout.
const VERSION: u32 = 1;

/// Whether values are f32 or int8.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Precision {
    /// 32-bit floating point.
    F32,
    /// 8-bit weights and activations.
    Int8,
}

impl Precision {
    /// As people say it.
    pub fn name(self) -> &'static str {
        match self {
            Self::F32 => "f32",
            Self::Int8 => "int8",
        }
    }
}

/// What a model is and what it takes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Description {
    /// Of the layout.
    pub version: u32,
    /// Of the weights.
    pub precision: Precision,
    /// Shape of the network.
    pub config: NetworkConfig,
    /// The radar's maps that it was trained on, as a data set's manifest describes them: bins, spans, period, fingerprint.
    pub maps: serde_json::Value,
    /// How the angle map was made: `none`, `bartlett`, `capon`, `music`.
    pub angle: String,
    /// Actions by number; the class after the last is none of them.
    pub actions: Vec<String>,
    /// Fingerprint of the file of names whose vectors it was trained with.
    pub names: u32,
    /// A tuple less probable than this is not told.
    pub least_probability: f32,
    /// Probabilities are those of scores over this temperature.
    pub temperature: f32,
    /// Where it comes from: data, seeds, command, accuracy.
    pub provenance: serde_json::Value,
}

impl Description {
    /// Of a new f32 network.
    pub fn new(config: NetworkConfig, maps: serde_json::Value, angle: String, names: u32) -> Self {
        Self {
            version: VERSION,
            precision: Precision::F32,
            config,
            maps,
            angle,
            actions: Vec::new(),
            names,
            least_probability: 0.0,
            temperature: 1.0,
            provenance: serde_json::Value::Null,
        }
    }
}

/// One array.
#[derive(Debug, Clone, PartialEq)]
pub struct Array {
    /// Lengths.
    pub shape: Vec<usize>,
    /// Values, the last dimension fastest.
    pub values: Values,
}

/// Values of an array.
#[derive(Debug, Clone, PartialEq)]
pub enum Values {
    /// 32-bit floating point.
    F32(Vec<f32>),
    /// 8-bit integers.
    I8(Vec<i8>),
}

/// A model: description and arrays by name.
#[derive(Debug, Clone, PartialEq)]
pub struct Model {
    /// What it is.
    pub description: Description,
    /// Its arrays.
    pub arrays: BTreeMap<String, Array>,
}

/// Why a file is no model.
#[derive(Debug, thiserror::Error)]
pub enum ModelError {
    /// Not safetensors, or cut short.
    #[error("it is damaged, or no model: {0}")]
    Format(#[from] safetensors::SafeTensorError),
    /// safetensors of somebody else.
    #[error("it does not say what network it holds: it is no model of this program")]
    Description,
    /// Its description is not understood.
    #[error("its description is not understood: {0}")]
    Json(#[from] serde_json::Error),
    /// Made by another version.
    #[error("it is of version {0}, this program reads version {VERSION}")]
    Version(u32),
    /// Its network cannot be.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// Other weights than the network has.
    #[error("its weights do not fit its network: {0}")]
    Weights(String),
    /// f32 asked of an int8 file, or the other way round.
    #[error("it holds {} weights, {} are needed", .0.name(), .1.name())]
    Precision(Precision, Precision),
}

impl Model {
    /// Reads the bytes of a file.
    ///
    /// # Errors
    /// If they are no model.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, ModelError> {
        let (_, header) = SafeTensors::read_metadata(bytes)?;
        let text = header.metadata().as_ref().and_then(|m| m.get(KEY)).ok_or(ModelError::Description)?;
        let described: serde_json::Value = serde_json::from_str(text)?;
        let version = described["version"].as_u64().unwrap_or(0) as u32;
        if version != VERSION {
            return Err(ModelError::Version(version));
        }
        let description: Description = serde_json::from_value(described)?;
        description.config.check()?;
        let tensors = SafeTensors::deserialize(bytes)?;
        let mut arrays = BTreeMap::new();
        for (name, view) in tensors.iter() {
            let values = match view.dtype() {
                Dtype::F32 => {
                    let four = view.data().chunks_exact(4);
                    Values::F32(four.map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect())
                }
                Dtype::I8 => Values::I8(view.data().iter().map(|&b| b as i8).collect()),
                other => return Err(ModelError::Weights(format!("{name} is of type {other:?}"))),
            };
            if let Values::F32(values) = &values
                && values.iter().any(|value| !value.is_finite())
            {
                return Err(ModelError::Weights(format!("{name} holds values that are no numbers")));
            }
            arrays.insert(name.to_owned(), Array { shape: view.shape().to_vec(), values });
        }
        Ok(Self { description, arrays })
    }

    /// The bytes of its file; the same model gives the same bytes.
    ///
    /// # Errors
    /// If an array's shape is not that of its values.
    pub fn to_bytes(&self) -> Result<Vec<u8>, ModelError> {
        let raw: BTreeMap<&String, (Dtype, &[usize], Vec<u8>)> = self
            .arrays
            .iter()
            .map(|(name, array)| {
                let (dtype, bytes) = match &array.values {
                    Values::F32(values) => {
                        (Dtype::F32, values.iter().flat_map(|v| v.to_le_bytes()).collect())
                    }
                    Values::I8(values) => (Dtype::I8, values.iter().map(|&v| v as u8).collect()),
                };
                (name, (dtype, array.shape.as_slice(), bytes))
            })
            .collect();
        let mut views = Vec::with_capacity(raw.len());
        for (name, (dtype, shape, bytes)) in &raw {
            views.push((name.as_str(), TensorView::new(*dtype, shape.to_vec(), bytes)?));
        }
        let described = serde_json::to_string(&self.description)?;
        let header = HashMap::from([(KEY.to_owned(), described)]);
        Ok(safetensors::serialize(views, Some(header))?)
    }

    /// The f32 network.
    ///
    /// # Errors
    /// If the model is an int8 one, or its arrays do not fit.
    pub fn network(&self, device: &Device) -> Result<Network, ModelError> {
        if self.description.precision != Precision::F32 {
            return Err(ModelError::Precision(self.description.precision, Precision::F32));
        }
        let network = Network::new(&self.description.config, device)?;
        let mut load = Load { path: Vec::new(), arrays: &self.arrays, taken: 0, wrong: Vec::new() };
        let network = network.map(&mut load);
        if let Some(wrong) = load.wrong.into_iter().next() {
            return Err(ModelError::Weights(wrong));
        }
        if load.taken != self.arrays.len() {
            return Err(ModelError::Weights(format!("{} arrays too many", self.arrays.len() - load.taken)));
        }
        Ok(network)
    }

    /// A model of the network's weights.
    pub fn of(network: &Network, description: Description) -> Self {
        let mut save = Save { path: Vec::new(), arrays: BTreeMap::new() };
        network.visit(&mut save);
        Self { description, arrays: save.arrays }
    }

    /// A model with random weights, drawn from `seed`: for tests and measurements of speed.
    ///
    /// # Errors
    /// If there is no network of that shape.
    pub fn untrained(config: NetworkConfig, seed: u64) -> Result<Self, ConfigError> {
        #[allow(deprecated, reason = "the backend that is always there")]
        let device = Device::ndarray();
        device.seed(seed);
        let network = Network::new(&config, &device)?;
        Ok(Self::of(&network, Description::new(config, serde_json::Value::Null, "none".into(), 0)))
    }

    /// Weights and biases, all of them.
    pub fn parameters(&self) -> usize {
        self.arrays.values().map(|array| array.shape.iter().product::<usize>()).sum()
    }

    /// f32 values of an array.
    ///
    /// # Errors
    /// If it is not there or of another kind.
    pub fn f32s(&self, name: &str) -> Result<&[f32], ModelError> {
        match self.arrays.get(name).map(|array| &array.values) {
            Some(Values::F32(values)) => Ok(values),
            _ => Err(ModelError::Weights(format!("there is no f32 array {name}"))),
        }
    }

    /// int8 values of an array.
    ///
    /// # Errors
    /// If it is not there or of another kind.
    pub fn i8s(&self, name: &str) -> Result<&[i8], ModelError> {
        match self.arrays.get(name).map(|array| &array.values) {
            Some(Values::I8(values)) => Ok(values),
            _ => Err(ModelError::Weights(format!("there is no int8 array {name}"))),
        }
    }
}

struct Save {
    path: Vec<String>,
    arrays: BTreeMap<String, Array>,
}

impl ModuleVisitor for Save {
    fn enter_module(&mut self, name: &str, _container_type: &str) {
        self.path.push(name.to_owned());
    }

    fn exit_module(&mut self, _name: &str, _container_type: &str) {
        self.path.pop();
    }

    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        let data = param.val().into_data();
        let values = data.iter::<f32>().collect();
        let shape = param.val().dims().to_vec();
        self.arrays.insert(self.path.join("."), Array { shape, values: Values::F32(values) });
    }
}

struct Load<'a> {
    path: Vec<String>,
    arrays: &'a BTreeMap<String, Array>,
    taken: usize,
    wrong: Vec<String>,
}

impl ModuleMapper for Load<'_> {
    fn enter_module(&mut self, name: &str, _container_type: &str) {
        self.path.push(name.to_owned());
    }

    fn exit_module(&mut self, _name: &str, _container_type: &str) {
        self.path.pop();
    }

    fn map_float<const D: usize>(&mut self, param: Param<Tensor<D>>) -> Param<Tensor<D>> {
        let path = self.path.join(".");
        let shape = param.lazy_shape().to_vec();
        match self.arrays.get(&path) {
            Some(Array { shape: there, values: Values::F32(values) }) if *there == shape => {
                self.taken += 1;
                let device = param.lazy_device();
                let tensor = Tensor::from_data(TensorData::new(values.clone(), shape), &device);
                let id = param.id;
                // Keeps whether the parameter is learnt.
                param.transform_for_load(tensor, id)
            }
            Some(other) => {
                self.wrong.push(format!("{path} is {:?}, the network has {shape:?}", other.shape));
                param
            }
            None => {
                self.wrong.push(format!("{path} is missing"));
                param
            }
        }
    }
}
