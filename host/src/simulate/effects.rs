//! What is simulated beyond direct paths: each effect is a switch, and a domain is a set of them.

use serde::{Deserialize, Serialize};

/// Whose data it stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Domain {
    /// The paper's recipe for synthetic data (section 3.4): few effects, for training.
    Train,
    /// A stand-in for real rooms: all effects, other people and other motion than `train`.
    Site,
}

macro_rules! effects {
    ($($(#[doc = $doc:literal])+ $name:ident: $train:literal),+ $(,)?) => {
        /// Switches.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
        #[serde(deny_unknown_fields)]
        pub struct Effects {
            $($(#[doc = $doc])+ pub $name: bool),+
        }

        impl Effects {
            /// Names and what each does.
            pub const ALL: &[(&str, &str)] = &[$((stringify!($name), concat!($($doc),+))),+];

            /// Those of a domain.
            pub const fn of(domain: Domain) -> Self {
                match domain {
                    Domain::Train => Self { $($name: $train),+ },
                    Domain::Site => Self { $($name: true),+ },
                }
            }

            /// None at all.
            pub const NONE: Self = Self { $($name: false),+ };

            /// The switch of this name.
            pub fn switch(&mut self, name: &str) -> Option<&mut bool> {
                match name {
                    $(stringify!($name) => Some(&mut self.$name),)+
                    _ => None,
                }
            }
        }
    };
}

effects! {
    /// Radar: surfaces behind others are not seen.
    occlusion: true,
    /// Radar: antennas see less off their boresight.
    pattern: false,
    /// Radar: paths by way of one wall, the floor or the ceiling.
    images: false,
    /// Radar: echoes of walls and furniture.
    clutter: false,
    /// Radar: noise of the receiver.
    thermal_noise: true,
    /// Radar: jitter of the chirps' frequency.
    phase_noise: false,
    /// Radar: rounding of the ADC, as noise; recordings are words whatever this says.
    quantisation: false,
    /// RFID: the tag rides on its object; else the hand stands for the object that it moves.
    tag_positions: false,
    /// RFID: 50 channels in random order, each with phase offsets of its own; else one channel without.
    hopping: false,
    /// RFID: slotted inventory with collisions, and reads that depend on power; else even reads and random loss.
    inventory: false,
    /// RFID: paths by way of walls.
    tag_multipath: false,
    /// RFID: body and hands in the way weaken tags.
    blockage: false,
    /// RFID: phases may be half a turn off.
    pi_ambiguity: false,
    /// RFID: noise of phase and signal strength.
    phase_error: true,
}
