//! What the bridge and the host agree on: units, the radar profile and scene, and the wire contract.
//!
//! * [`units`]: newtypes for codes and physical quantities, with the conversions on the type.
//! * [`radar`]: [`radar::RadarProfile`] and everything that follows from it (bins, spans, bytes, rates).
//! * [`array`](mod@array): positions of the virtual antennas of each radar board.
//! * [`scene`]: what a scene asks of the radar and the reader.
//! * [`tag`]: EPCs and tag reads.
//! * [`config`]: what the host may set on a bridge, validated as a whole.
//! * [`wire`]: every message, its fields, units and size, and the framing for UDP and for serial lines.
//!
//! The crate is `no_std` and does not allocate. With the feature `defmt` its types can be logged on the device.
#![no_std]

pub mod array;
pub mod config;
pub mod fnv;
pub mod radar;
pub mod scene;
pub mod tag;
pub mod units;
pub mod wire;
