//! mmWave SDK.
