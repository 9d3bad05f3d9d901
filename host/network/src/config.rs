//! The shape of a network, as a file says it.

use serde::{Deserialize, Serialize};

use crate::sample::{MAPS, MAX_ANTENNAS, READ_CHANNELS, TURN_CHANNELS};

/// Slope of LeakyReLU below 0: PyTorch's default, which the paper's network has.
pub const LEAK: f64 = 0.01;
/// Of layer normalisation: PyTorch's default.
pub const EPSILON: f64 = 1e-5;

/// Actions of the vocabulary, and one for none of them.
pub const ACTIONS: usize = 8;

/// Of files that do not say it.
fn actions() -> usize {
    ACTIONS
}

/// Shape of a network. All that decides how many weights there are and how they are connected.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NetworkConfig {
    /// Points of a map each way, N_map.
    pub points: usize,
    /// Which maps are looked at: range-time, range-Doppler, angle.
    pub maps: [bool; MAPS],
    /// Reader antennas; reads of fewer count as not read.
    pub antennas: usize,
    /// Dimensions of a name's vector, N_embed.
    pub name_dimensions: usize,
    /// How a map becomes features.
    pub encoder: Encoder,
    /// Learnt beams in place of the angle map, if wanted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub beams: Option<Beams>,
    /// The radar's branch, N_dim^M wide.
    pub radar: Branch,
    /// The tags' branch, N_dim^R wide; each tag goes through it by itself.
    pub tags: Branch,
    /// What the two heads see.
    pub fusion: Fusion,
    /// Classes of the action's head; samples without an action are of the last one.
    #[serde(default = "actions")]
    pub actions: usize,
    /// Share of values left out while training.
    pub dropout: f64,
}

/// From a map to features.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Encoder {
    /// Two 3 x 3 convolutions and a max-pool for each map (section 3.3.2 of the paper).
    Convolutions {
        /// Channels after each.
        channels: [usize; 2],
        /// Stride of each.
        strides: [usize; 2],
        /// Size of the pool.
        pool: usize,
    },
    /// The map is cut into squares, and all squares go through one dense layer: a convolution whose stride is its size.
    Patches {
        /// Points of a square each way.
        size: usize,
        /// Values that a square becomes.
        channels: usize,
    },
}

/// In place of the angle map the power of learnt beams on the complex covariance: what CubeLearn does to the Fourier
/// transforms, done to the array's.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Beams {
    /// Virtual antennas.
    pub antennas: usize,
    /// Beams.
    pub beams: usize,
}

/// One branch's features over time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Branch {
    /// Width of a token.
    pub width: usize,
    /// Layers.
    pub layers: usize,
    /// Heads of attention.
    pub heads: usize,
    /// Width inside a layer's feed-forward part.
    pub feed_forward: usize,
    /// Frames of a token.
    pub stack: usize,
    /// How tokens see each other.
    pub temporal: Temporal,
}

/// How tokens see each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Temporal {
    /// Transformer encoder layers on sinusoidal positions (section 3.3.3).
    Transformer,
    /// Residual convolutions over time, as XRF55's network has them.
    Convolution,
}

/// What the heads see.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Fusion {
    /// Both branches side by side (section 3.3.4).
    Concat,
    /// The action from the radar alone, the target from the tags alone.
    None,
    /// Tags alone.
    Rfid,
    /// Radar alone.
    Radar,
    /// The radar scales and shifts the tags' features (FiLM).
    Film,
    /// Tags look at the radar's tokens, the radar at the tags.
    Attention,
}

impl Fusion {
    /// Whether the radar is looked at.
    pub fn has_radar(self) -> bool {
        self != Self::Rfid
    }

    /// Whether the tags are looked at.
    pub fn has_tags(self) -> bool {
        self != Self::Radar
    }
}

/// Why there is no such network.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ConfigError {
    /// Heads that do not divide the width.
    #[error("{branch}: a width of {width} does not split into {heads} heads")]
    Heads {
        /// Which branch.
        branch: &'static str,
        /// Its width.
        width: usize,
        /// Its heads.
        heads: usize,
    },
    /// A size that must be in a range.
    #[error("{what} is {given}, it must be {least} to {most}")]
    Range {
        /// What.
        what: &'static str,
        /// As given.
        given: usize,
        /// At least.
        least: usize,
        /// At most.
        most: usize,
    },
    /// Maps that do not divide.
    #[error("maps of {points} points do not divide by {step}, which is what a feature looks at")]
    Divide {
        /// Points.
        points: usize,
        /// Points of a feature.
        step: usize,
    },
}

impl NetworkConfig {
    /// The paper's network: maps of 256 points, one channel, 1024 and 128 wide, three layers, two heads (section 4.4). Its
    /// pool and feed-forward widths are not given there; PyTorch's default of 2048, and a pool that leaves 32 x 32.
    pub fn paper(name_dimensions: usize) -> Self {
        Self {
            points: 256,
            maps: [true; MAPS],
            antennas: MAX_ANTENNAS,
            name_dimensions,
            encoder: Encoder::Convolutions { channels: [1, 1], strides: [1, 1], pool: 8 },
            beams: None,
            radar: Branch {
                width: 1024,
                layers: 3,
                heads: 2,
                feed_forward: 2048,
                stack: 1,
                temporal: Temporal::Transformer,
            },
            tags: Branch {
                width: 128,
                layers: 3,
                heads: 2,
                feed_forward: 2048,
                stack: 1,
                temporal: Temporal::Transformer,
            },
            fusion: Fusion::Concat,
            actions: ACTIONS,
            dropout: 0.1,
        }
    }

    /// The network that ships.
    pub fn small(name_dimensions: usize) -> Self {
        let branch = |width, layers, stack| Branch {
            width,
            layers,
            heads: 2,
            feed_forward: 2 * width,
            stack,
            temporal: Temporal::Transformer,
        };
        Self {
            points: 32,
            maps: [true; MAPS],
            antennas: MAX_ANTENNAS,
            name_dimensions,
            encoder: Encoder::Patches { size: 4, channels: 8 },
            beams: None,
            // Tokens of 0.2 and 0.3 s: as accurate as of 0.1 and 0.2 s, in two thirds of the time (models/rfhoi.md).
            radar: branch(64, 2, 2),
            tags: branch(64, 2, 3),
            fusion: Fusion::Concat,
            actions: ACTIONS,
            dropout: 0.1,
        }
    }

    /// Checks that such a network can be.
    ///
    /// # Errors
    /// What does not fit.
    pub fn check(&self) -> Result<(), ConfigError> {
        let range = |what, given, least, most| match (least..=most).contains(&given) {
            true => Ok(()),
            false => Err(ConfigError::Range { what, given, least, most }),
        };
        range("points", self.points, 8, 256)?;
        range("antennas", self.antennas, 1, MAX_ANTENNAS)?;
        range("name_dimensions", self.name_dimensions, 1, 1024)?;
        range("actions", self.actions, 2, 1024)?;
        for (name, branch) in [("radar", self.radar), ("tags", self.tags)] {
            range("width", branch.width, 4, 4096)?;
            range("layers", branch.layers, 1, 12)?;
            range("feed_forward", branch.feed_forward, 4, 16_384)?;
            range("stack", branch.stack, 1, 16)?;
            if branch.heads == 0 || branch.width % (2 * branch.heads) != 0 {
                return Err(ConfigError::Heads { branch: name, width: branch.width, heads: branch.heads });
            }
        }
        match self.encoder {
            Encoder::Convolutions { channels, strides, pool } => {
                range("channels", channels[0], 1, 256)?;
                range("channels", channels[1], 1, 256)?;
                range("stride", strides[0], 1, 8)?;
                range("stride", strides[1], 1, 8)?;
                range("pool", pool, 1, 64)?;
            }
            Encoder::Patches { size, channels } => {
                range("size of a patch", size, 1, 64)?;
                range("channels", channels, 1, 256)?;
            }
        }
        let step = self.encoder.step();
        if !self.points.is_multiple_of(step) {
            return Err(ConfigError::Divide { points: self.points, step });
        }
        if let Some(Beams { antennas, beams }) = self.beams {
            range("virtual antennas", antennas, 2, 64)?;
            range("beams", beams, 1, 4096)?;
        }
        Ok(())
    }

    /// Places of the maps that are encoded: those that are looked at, the angle map only without beams.
    pub fn encoded(&self) -> impl Iterator<Item = usize> + use<> {
        let (maps, beams) = (self.maps, self.beams.is_some());
        (0..MAPS).filter(move |&map| maps[map] && !(beams && map == MAPS - 1))
    }

    /// Features of one map.
    pub fn map_features(&self) -> usize {
        let side = self.points / self.encoder.step();
        self.encoder.channels() * side * side
    }

    /// Values of a tag's net turn over all antennas.
    pub fn turn_features(&self) -> usize {
        self.antennas * TURN_CHANNELS
    }

    /// Values of one token of a tag before its encoder.
    pub fn read_features(&self) -> usize {
        self.tags.stack * self.antennas * READ_CHANNELS
    }
}

impl Encoder {
    /// Points each way from one feature of a channel to the next.
    fn step(self) -> usize {
        match self {
            Self::Convolutions { strides, pool, .. } => strides[0] * strides[1] * pool,
            Self::Patches { size, .. } => size,
        }
    }

    /// Features of one place.
    fn channels(self) -> usize {
        match self {
            Self::Convolutions { channels, .. } => channels[1],
            Self::Patches { channels, .. } => channels,
        }
    }
}
