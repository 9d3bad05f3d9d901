//! LLRP.
