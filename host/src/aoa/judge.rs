//! What peaks are worth: whether their directions explain the covariance, and how exact they can be.

use super::doubt::Doubt;
use super::estimate::{Direction, Estimate};
use super::grid::Decibels;
use super::peaks::{Peak, Peaks};
use super::settings::{MAX_PEAKS, Method};
use super::{Estimator, Plan, fit};

/// Share of the weakest source's power that may be left unexplained.
const LEFT: f64 = 0.15;

impl Estimator {
    /// What the peaks are worth.
    pub(super) fn judge(&self, plan: Plan, peaks: &Peaks, decibels: Decibels, snapshots: f64) -> Estimate {
        let level_db = |peak: &Peak| decibels.of(peak.height.abs());
        // A low peak is a direction out of the signal subspace.
        let least_db = self.settings.guards.filter(|_| plan.method == Method::Music).map(|g| g.peak_db);
        let high = |peak: &&Peak| least_db.is_none_or(|least| level_db(peak) >= least);
        let given = &peaks[..peaks.iter().take(plan.order).take_while(high).count()];
        let mut directions = [(0.0, 0.0); MAX_PEAKS];
        for (direction, peak) in directions.iter_mut().zip(given) {
            *direction = (peak.u, peak.w);
        }
        let fit = fit::fit(&self.geometry, &self.full, &directions[..given.len()], snapshots);
        // Of the power that is not noise, what more is left than noise leaves.
        let antennas = self.geometry.count as f64;
        let signal = antennas * (1.0 - plan.noise);
        let left = fit.map_or(f64::INFINITY, |f| (f.noise - plan.noise) * (antennas - given.len() as f64));
        let mismatch = (left / signal.max(1e-6)).clamp(0.0, 1.0);
        let mut estimate = Estimate {
            order: plan.order as u8,
            gap_db: plan.gap_db as f32,
            mismatch: mismatch as f32,
            found: given.len() as u8,
            ..Estimate::nothing(plan.method, Doubt::NothingMoves)
        };
        for (k, (direction, peak)) in estimate.peaks.iter_mut().zip(given).enumerate() {
            let deviation_deg = fit.map_or(f64::INFINITY, |f| f.deviation_deg[k]);
            *direction = Direction::new(peak.u, peak.w, level_db(peak), deviation_deg);
        }
        // A source as weak as what is left may be made of the same.
        let weakest =
            fit.map_or(0.0, |f| f.powers[..given.len()].iter().copied().fold(f64::INFINITY, f64::min));
        let weakest = (antennas * weakest / signal.max(1e-6)).clamp(0.0, 1.0);
        estimate.doubt = self.settings.guards.and_then(|guards| {
            let by_noise = plan.noise * (antennas / (snapshots * signal.max(1e-6))).sqrt();
            let worst = estimate.peaks().iter().map(|p| p.deviation_deg).fold(0.0, f32::max);
            let margin =
                given.last().zip(peaks.get(given.len())).map(|(last, next)| level_db(last) - level_db(next));
            // Eigenvectors without a direction are the antennas' errors, or sources too close.
            let whole = if given.len() < plan.order { 0.5 * guards.mismatch } else { guards.mismatch };
            let limit = whole.min(LEFT * weakest);
            let drift = fit.map_or(0.0, |f| f.drift_deg[..given.len()].iter().copied().fold(0.0, f64::max));
            plan.doubt.or_else(|| {
                let doubts = [
                    (peaks.len().min(plan.order) < plan.order || given.is_empty(), Doubt::FewerPeaks),
                    (given.iter().any(|p| p.at_edge), Doubt::AtEdge),
                    (mismatch > limit + 3.0 * by_noise, Doubt::Mismatch),
                    (drift > guards.drift_deg, Doubt::Mismatch),
                    (f64::from(worst) > guards.deviation_deg, Doubt::Imprecise),
                    (margin.is_some_and(|m| m < guards.margin_db), Doubt::Ambiguous),
                ];
                doubts.into_iter().find(|d| d.0).map(|d| d.1)
            })
        });
        estimate
    }
}
