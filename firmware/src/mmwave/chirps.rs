//! The chirps of a frame's loop: which transmitters in which order, and from which profile.

use heapless::Vec;
use rfhoi_shared::radar::MAX_TX_SLOTS;

use super::text::{Problem, Unsupported};

/// Ramp and sampling of one profile, in the units of `RadarProfile`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ramp {
    /// Line of its definition.
    pub(super) line: u32,
    pub(super) start_khz: u32,
    pub(super) slope_khz_per_us: u32,
    pub(super) idle_ns: u32,
    pub(super) adc_start_ns: u32,
    pub(super) ramp_end_ns: u32,
    pub(super) samples: u16,
    pub(super) sample_rate_ksps: u32,
}

/// Profiles of a radar (mmWaveLink `rlProfileCfg_t.profileId`: 0 to 3).
pub(super) const MAX_RAMPS: usize = 4;

/// What one chirp is.
#[derive(Debug, Clone, Copy)]
pub(super) struct Chirp {
    /// Number of its profile.
    pub(super) profile: u8,
    /// Transmitters that are on.
    pub(super) tx_mask: u8,
}

/// The chirps from a frame's first to its last index; others are of no effect.
#[derive(Debug, Clone)]
pub(super) struct FrameChirps {
    first: u16,
    slots: Vec<Option<Chirp>, MAX_TX_SLOTS>,
}

impl FrameChirps {
    pub(super) fn new(first: u16, last: u16) -> Result<Self, Problem> {
        let count = last.checked_sub(first).ok_or(Problem::ChirpOrder)?.saturating_add(1);
        let mut slots = Vec::new();
        slots.resize(usize::from(count), None).map_err(|_| Problem::TooManySlots(count))?;
        Ok(Self { first, slots })
    }

    /// Defines the chirps `start` to `end`; a later definition replaces an earlier one.
    pub(super) fn define(&mut self, start: u16, end: u16, chirp: Chirp) {
        for (index, slot) in (self.first..=u16::MAX).zip(&mut self.slots) {
            if (start..=end).contains(&index) {
                *slot = Some(chirp);
            }
        }
    }

    /// Number of the one profile that all chirps use, and their transmitters in the order of time.
    pub(super) fn resolve(&self) -> Result<(u8, Vec<u8, MAX_TX_SLOTS>), Problem> {
        let mut profile = None;
        let mut tx_order = Vec::new();
        for (index, slot) in (self.first..=u16::MAX).zip(&self.slots) {
            let chirp = slot.ok_or(Problem::ChirpUndefined(index))?;
            if *profile.get_or_insert(chirp.profile) != chirp.profile {
                return Err(Problem::Unsupported(Unsupported::SeveralProfiles));
            }
            // As many as there are slots.
            let _ = tx_order.push(chirp.tx_mask);
        }
        Ok((profile.unwrap_or_default(), tx_order))
    }
}
