//! LLRP 1.0.1 with Impinj's extensions: the bridge's side of an RFID reader.
//!
//! Bytes of a TCP stream and the time go in; requests, tag reads on the bridge's clock, the hop table and notices come
//! out. [`client::Client`] joins the parts:
//!
//! * [`frame`]: stream to messages; [`param`]: body to fields and parameters; [`message`]: types of both.
//! * [`decode`] tells a reader's messages apart: [`status`], [`capabilities`], [`event`], [`report`].
//! * [`request`] writes the client's messages with [`encode`].
//! * [`clock`]: the reader's time to the bridge's.
//! * [`reader_side`] writes a reader's messages, for simulated readers; [`fuzz`] feeds all of it arbitrary bytes.
//!
//! Section numbers are those of "Low Level Reader Protocol, Version 1.0.1", EPCglobal, 13 August 2007. All numbers on
//! the wire are big-endian.

pub mod capabilities;
pub mod client;
pub mod clock;
pub mod decode;
pub mod encode;
pub mod event;
pub mod frame;
pub mod fuzz;
pub mod message;
pub mod param;
pub mod reader_side;
pub mod report;
pub mod request;
pub mod status;
