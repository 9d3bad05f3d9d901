//! Host side of RF-HOI as a library: what the `rfhoi` command is made of.
//!
//! * [`recording`]: `.pcap` recordings of radar, reader and bridge, read as a stream and written byte for byte the same.
//! * [`samples`], [`datagrams`]: raw ADC files as the radar's byte stream, cut into DCA1000 datagrams.
//! * [`reads`]: tables of tag reads.
//! * [`phase`]: from tag phases to phase differences that mean something, with honest figures.
//! * [`aoa`]: angle of arrival from the spatial covariance: MUSIC, Capon, Bartlett.
//! * [`maps`]: range-time, range-Doppler and angle maps of a frame, from a bridge's packets or from raw samples.
//! * [`align`]: packets in, frames of both radios on one time axis out: what the network is fed with.
//! * [`features`]: aligned frames as the network takes them, live and of data sets.
//! * [`stability`]: where these methods break, and whether they say so.
//! * [`motion`]: recorded human motion, joints over time.
//! * [`hoi`], [`simulate`]: the vocabulary of actions and objects, and labelled data from a simulated room.
//! * `learn`, with the feature `train`: from data sets to models.
//! * `real`, with the feature `train`: labelled recordings of real devices as the network takes them.
//! * [`recognize`]: from packets to tuples, or why there is none.
//! * [`plan`]: the smallest profile, maps and antennas that a scene needs, and what they cost.
//! * [`plot`]: pictures of maps and of series.
//! * [`bridge`]: a bridge on the network: found, configured, watched.
//! * `flash`, with the feature `probe`: boards over their debug probes.
//! * [`npz`], [`atomic`]: results in files that are whole or not there.

pub mod align;
pub mod aoa;
pub mod atomic;
pub mod bridge;
pub mod datagrams;
pub mod detect;
pub mod features;
#[cfg(feature = "probe")]
pub mod flash;
pub mod hoi;
pub mod inspect;
mod jobs;
#[cfg(feature = "train")]
pub mod learn;
pub mod maps;
pub mod motion;
pub mod npz;
pub mod phase;
pub mod plan;
pub mod plot;
pub mod profile;
pub mod reads;
#[cfg(feature = "train")]
pub mod real;
pub mod receive;
pub mod recognize;
pub mod recording;
pub mod replay;
pub mod samples;
pub mod simulate;
pub mod stability;
pub mod uart_log;
