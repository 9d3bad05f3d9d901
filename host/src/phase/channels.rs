//! The reader's channels.

use rfhoi_shared::units::{ChannelIndex, Kilohertz};
use rfhoi_shared::wire::HopTable;

/// Frequency of each channel index.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ChannelPlan {
    channels: Vec<Kilohertz>,
}

impl ChannelPlan {
    /// The FCC's 50 channels in rising order, `902.75 + 0.5 (i - 1)` MHz for index i. Only a default: readers number
    /// their channels by a hop table in an order of their own, which may change when they boot.
    pub fn fcc() -> Self {
        Self { channels: (0..50).map(|n| Kilohertz(902_750 + 500 * n)).collect() }
    }

    /// Frequency of a channel; `None` for index 0, which stands for unknown, and past the table.
    pub fn frequency(&self, channel: ChannelIndex) -> Option<Kilohertz> {
        let place = usize::from(channel.0).checked_sub(1)?;
        self.channels.get(place).copied()
    }
}

impl From<&HopTable> for ChannelPlan {
    fn from(table: &HopTable) -> Self {
        Self { channels: table.channels.to_vec() }
    }
}

impl Default for ChannelPlan {
    fn default() -> Self {
        Self::fcc()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn channels_count_from_one() {
        let plan = ChannelPlan::fcc();
        assert_eq!(plan.frequency(ChannelIndex(0)), None);
        assert_eq!(plan.frequency(ChannelIndex(1)), Some(Kilohertz(902_750)));
        assert_eq!(plan.frequency(ChannelIndex(50)), Some(Kilohertz(927_250)));
        assert_eq!(plan.frequency(ChannelIndex(51)), None);
        let table =
            HopTable { table: 1, channels: [Kilohertz(915_250), Kilohertz(902_750)].into_iter().collect() };
        assert_eq!(ChannelPlan::from(&table).frequency(ChannelIndex(2)), Some(Kilohertz(902_750)));
    }
}
