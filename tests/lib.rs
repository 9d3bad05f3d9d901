//! The bridge's logic between simulated devices and the host, in one process and in virtual time.
//!
//! ```text
//! radar --chirps--> recorder --Network--> RadarPath --+
//! demo's UART ------------------bytes---> UartPath  --+--Uplink--> Link (datagrams or serial) --> Receiver
//! reader <--LLRP over two Pipes---------> ReaderPath -+
//! ```
//!
//! Everything in capitals is the code that runs on a board and on the host; the rest is [`simulated`]. Chance comes from
//! seeds, time from a counter, so a test gives the same result on every machine and every run.

pub mod network_case;
pub mod simulated;
