//! Whether the strongest moving echo is as fast as its Doppler says.
//!
//! A radial speed beyond the profile's span appears folded, and compensating TDM with it puts the echo at a wrong angle.
//! Its range does not fold: from frame to frame a true velocity v walks by v T, a folded one by 2 span T more or less, 0.9 m in the
//! default profile. So the echo is looked for in the frame before, where each of the velocities would have had it.

use rfhoi_shared::config::RadarConfig;

use crate::receive::{HeatMap, RadarFrame};

/// Fastest change of a hand's mean radial velocity from one frame to the next, m/s, either way.
const CHANGE_M_S: f32 = 1.5;
/// How much weaker an echo may have been in the frame before, dB; less than this above what is found elsewhere says nothing.
const FADING_DB: f32 = 20.0;
/// By how much the echo at a folded velocity's place must exceed the one at the plain velocity's place, dB.
const MARGIN_DB: f32 = 6.0;

/// What a frame's range walk says of its velocities.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Velocity {
    /// Nothing moves, or the frame before does not show where it was.
    Unknown,
    /// The strongest moving echo comes from where its Doppler says.
    Confirmed,
    /// It comes from where a velocity beyond the span says: velocities and angles of this frame are wrong.
    Aliased,
}

impl Velocity {
    /// A word for tables, where the velocity is not confirmed.
    pub const fn reason(self) -> Option<&'static str> {
        match self {
            Self::Unknown => Some("velocity_unknown"),
            Self::Confirmed => None,
            Self::Aliased => Some("velocity_aliased"),
        }
    }
}

/// Compares each frame's range-Doppler map with that of the frame before. Nothing is allocated after [`Self::new`].
#[derive(Debug, Clone)]
pub struct VelocityGuard {
    /// Number of the frame before.
    frame: Option<u32>,
    /// Its codes.
    before: Vec<u8>,
    columns: usize,
    /// Doppler bins on either side of zero that never count as moving.
    guard: usize,
    rise_db: f32,
    /// Range bins that one Doppler bin walks from frame to frame.
    bins_per_column: f32,
    /// Half the width of where an echo is looked for, in range bins and in Doppler bins.
    reach: [usize; 2],
}

/// A cell that may be an echo.
#[derive(Debug, Clone, Copy)]
struct Echo {
    row: usize,
    column: usize,
    code: u8,
}

impl VelocityGuard {
    /// For frames of `config`.
    pub fn new(config: &RadarConfig) -> Self {
        let RadarConfig { profile, processing, .. } = config;
        let columns = usize::from(profile.loops);
        let bins_per_m_s = profile.frame_period().0 / profile.range_bin().0;
        // A main lobe is two bins wide either way.
        let reach = |change: f32| change.ceil() as usize + 1;
        Self {
            frame: None,
            before: vec![0; usize::from(processing.gate.bins) * columns],
            columns,
            guard: processing.zero_doppler_guard.into(),
            rise_db: processing.detection.0,
            bins_per_column: profile.velocity_bin().0 * bins_per_m_s,
            reach: [
                reach(CHANGE_M_S / 2.0 * bins_per_m_s),
                reach(CHANGE_M_S / profile.velocity_bin().0).min(columns / 4),
            ],
        }
    }

    /// Takes the next frame.
    pub fn frame(&mut self, frame: &RadarFrame) -> Velocity {
        let follows = self.frame.is_some_and(|before| before.wrapping_add(1) == frame.frame);
        self.frame = None;
        let Some(map) = &frame.range_doppler else { return Velocity::Unknown };
        if map.codes.len() != self.before.len() || map.columns != self.columns {
            return Velocity::Unknown;
        }
        let velocity = if follows { self.compare(map) } else { Velocity::Unknown };
        self.before.copy_from_slice(&map.codes);
        self.frame = Some(frame.frame);
        velocity
    }

    fn compare(&self, map: &HeatMap) -> Velocity {
        let codes = |db: f32| (db / map.scale.step_db.max(f32::MIN_POSITIVE)).min(255.0) as u8;
        let Some(echo) = self.strongest(&map.codes) else { return Velocity::Unknown };
        let floor = self.floor(&map.codes).max(self.floor(&self.before));
        let least = floor.saturating_add(codes(self.rise_db));
        // Unless the places are apart, they tell nothing.
        let apart = self.bins_per_column * self.columns as f32;
        if echo.code < least || apart < (4 * self.reach[0]) as f32 {
            return Velocity::Unknown;
        }
        let least = least.max(echo.code.saturating_sub(codes(FADING_DB)));
        let half = (self.columns / 2) as f32;
        let found = [0.0, -1.0, 1.0].map(|fold| {
            let walk = (echo.column as f32 - half + fold * self.columns as f32) * self.bins_per_column;
            self.before_at(echo.row as f32 - walk, echo.column)
        });
        let [plain, folded] = [found[0], found[1].max(found[2])];
        if folded >= least && folded >= plain.saturating_add(codes(MARGIN_DB)) {
            Velocity::Aliased
        } else if plain >= least {
            Velocity::Confirmed
        } else {
            Velocity::Unknown
        }
    }

    /// Whether a column counts as moving.
    fn moves(&self, column: usize) -> bool {
        column.abs_diff(self.columns / 2) > self.guard
    }

    /// The strongest cell that moves.
    fn strongest(&self, codes: &[u8]) -> Option<Echo> {
        let mut best: Option<Echo> = None;
        for (row, codes) in codes.chunks_exact(self.columns.max(1)).enumerate() {
            let most = codes.iter().copied().max()?;
            if best.is_some_and(|b| b.code >= most) {
                continue;
            }
            let moving = codes.iter().enumerate().filter(|&(column, _)| self.moves(column));
            if let Some((column, &code)) = moving.max_by_key(|&(_, code)| code)
                && best.is_none_or(|b| b.code < code)
            {
                best = Some(Echo { row, column, code });
            }
        }
        best
    }

    /// Strongest code of the frame before about a range bin and a Doppler bin.
    fn before_at(&self, row: f32, column: usize) -> u8 {
        let [rows, columns] = self.reach;
        let row = row.round() as isize;
        let last = (self.before.len() / self.columns.max(1)) as isize - 1;
        let (first, last) = ((row - rows as isize).max(0), (row + rows as isize).min(last));
        let mut most = 0;
        for row in first..=last {
            let codes = &self.before[row as usize * self.columns..][..self.columns];
            for offset in 0..=2 * columns {
                let column = (column + self.columns - columns + offset) % self.columns;
                if self.moves(column) {
                    most = most.max(codes[column]);
                }
            }
        }
        most
    }

    /// Level of the noise: the least mean of a row's quarter.
    fn floor(&self, codes: &[u8]) -> u8 {
        let quarter = (self.columns / 4).max(1);
        let means = codes
            .chunks_exact(quarter)
            .map(|q| q.iter().map(|&c| u32::from(c)).sum::<u32>() / q.len() as u32);
        means.min().unwrap_or(0) as u8
    }
}

#[cfg(test)]
mod tests {
    use rfhoi_firmware::dsp::level;
    use rfhoi_shared::config::BridgeConfig;

    use super::*;

    /// A frame with one echo in noise.
    fn frame(config: &RadarConfig, number: u32, row: usize, column: usize) -> RadarFrame {
        let columns = usize::from(config.profile.loops);
        let rows = usize::from(config.processing.gate.bins);
        let mut codes: Vec<u8> = (0..rows * columns).map(|i| 50 + (i * 7 % 6) as u8).collect();
        codes[row * columns + column] = 140;
        let map = HeatMap {
            gate: config.processing.gate,
            columns,
            scale: level::SCALE,
            codes,
            arrived: vec![true; rows],
        };
        RadarFrame { frame: number, range_doppler: Some(map), ..RadarFrame::default() }
    }

    #[test]
    fn a_walk_confirms_or_refutes_a_velocity() {
        let config = BridgeConfig::default().radar;
        // Twenty columns of 14 cm/s walk 28 cm in a frame, 6.5 bins.
        let before = |row| {
            let mut guard = VelocityGuard::new(&config);
            assert_eq!(guard.frame(&frame(&config, 7, row, 12)), Velocity::Unknown, "there is none before");
            guard.frame(&frame(&config, 8, 40, 12))
        };
        assert_eq!(before(46), Velocity::Confirmed);
        // 44 columns the other way, 14.4 bins.
        assert_eq!(before(26), Velocity::Aliased);
        assert_eq!(before(3), Velocity::Unknown, "it came from where none of them says");
        let mut guard = VelocityGuard::new(&config);
        guard.frame(&frame(&config, 7, 46, 12));
        assert_eq!(guard.frame(&frame(&config, 9, 40, 12)), Velocity::Unknown, "a frame is missing");
        assert_eq!(guard.frame(&frame(&config, 10, 40, 32)), Velocity::Unknown, "nothing moves");
    }
}
