//! Devices, networks and time around the bridge.
//!
//! * [`network`]: datagrams, lost, doubled and late; [`tcp`]: a stream; [`serial`]: a line with bit errors.
//! * [`radar`]: chirps of point scatterers as DCA1000 datagrams; [`console`]: the SDK demo's command line.
//! * [`reader`]: an LLRP reader with tags in view and a clock of its own.
//! * [`path`]: the radar's path alone, from datagrams to frames at the host.
//! * [`traffic`]: what a bridge sends of a simulated sample, for the host alone.
//! * [`person`]: somebody who acts before both devices, and what is recognised of it.
//! * [`world`]: all of them joined with the bridge's logic and the host.
//! * [`rig`]: all of them around the bridge's own tasks, with an Ethernet switch and UARTs in between.
//! * [`machine`]: QEMU with the bridge's image, the devices on loopback sockets, in the time of the wall.

pub mod console;
pub mod machine;
pub mod network;
pub mod path;
pub mod person;
pub mod radar;
pub mod reader;
pub mod rig;
pub mod serial;
pub mod tcp;
pub mod traffic;
pub mod world;
