//! TI mmWave SDK: what a radar with the SDK's out-of-box demo, or mmWave Studio, says and wants to be told.
//!
//! ```text
//! profile.cfg --cfg::CliProfile::parse--> RadarProfile + what the demo streams
//! LogFile.txt --studio::StudioProfile::parse--> RadarProfile
//! RadarProfile --cfg::write--> CLI lines --cli::Session--> UART 115200 --> radar
//!                                            ^-- `Done`, `Ignored`, `Error` back
//! UART 921600 --tlv::StreamParser--> Frame --tlv::Tlv--> points, profiles, heat maps, statistics
//! ```
//!
//! Sources: mmWave SDK 3.6 user's guide ("Configuration (.cfg) File Format") and the doxygen of its out-of-box demo;
//! `rlProfileCfg_t` and its kin of mmWaveLink for the codes in Studio's log. Recordings of an AWR1642 and an IWR6843AOP
//! hold the parsers to what those devices really send.

pub mod cfg;
pub mod cli;
mod decimal;
mod front_end;
pub mod studio;
mod text;
pub mod tlv;

pub use text::{Problem, TextError, Unsupported};

/// First bytes of a frame on the data UART (`mmw_output.h`, `MmwDemo_output_message_header`).
pub const MAGIC: [u8; 8] = [2, 1, 4, 3, 6, 5, 8, 7];
