//! Where methods break, and whether they say so.
//!
//! A [`Case`] stresses one method along one axis, with and without its guard, many times over random draws. Each
//! [`Trial`] ends in one of three ways ([`Verdict`]): right, announced as invalid with a reason, or silently wrong. A guard is
//! good if nothing is silently wrong and little is announced without need. All data here are simulated.
//!
//! ```text
//! Case --trial(stress, guard, rng)--> Trial --tolerance--> Verdict --sweep--> Curve --report--> table, CSV, JSON, pictures
//! ```
//!
//! | module | methods |
//! |---|---|
//! | [`angle`] | angle of arrival: MUSIC, Capon, Bartlett |
//! | [`radar`] | TDM compensation, clutter removal, fixed-point storage, clipping |
//! | [`tags`] | phase differences of tags |
//! | [`whole`] | both radios together: clocks, and extremes of a scene |

pub mod angle;
mod hopping;
pub mod radar;
mod report;
mod sweep;
pub mod tags;
pub mod whole;

pub use report::{ReportError, table, write};
pub use sweep::{CaseResult, Curve, Interrupted, Options, Point, run};

use rand_chacha::ChaCha8Rng;

/// The axis along which a case is stressed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stress {
    /// What grows, as an axis' label.
    pub label: &'static str,
    /// Its unit, empty for a count.
    pub unit: &'static str,
    /// Where it is tried, rising.
    pub values: &'static [f64],
}

/// What is measured of an answer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measure {
    /// What the error is of, as an axis' label.
    pub label: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// An answer whose error is larger is wrong.
    pub tolerance: f64,
}

/// What one draw led to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Trial {
    /// Error of the answer, not negative; infinite where there is none.
    pub error: f64,
    /// Why the method calls its answer invalid, in a few words, if it does.
    pub announced: Option<&'static str>,
}

/// How a trial ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// Within the tolerance, and given as an answer.
    Right,
    /// Called invalid, and indeed out of tolerance.
    Announced,
    /// Called invalid although within the tolerance: a guard that is too careful.
    Needless,
    /// Out of tolerance, and given as an answer.
    Silent,
}

impl Trial {
    /// How it ended, given the tolerance of its case.
    pub fn verdict(&self, measure: &Measure) -> Verdict {
        // Not a number is no right answer.
        let within = self.error <= measure.tolerance;
        match (within, self.announced.is_some()) {
            (true, false) => Verdict::Right,
            (true, true) => Verdict::Needless,
            (false, true) => Verdict::Announced,
            (false, false) => Verdict::Silent,
        }
    }
}

/// One way to break a method.
pub trait Case: Sync {
    /// Its name on the command line: lower case, hyphens.
    fn name(&self) -> &'static str;

    /// What is stressed and what the guard is, in one sentence.
    fn about(&self) -> &'static str;

    /// The axis of the stress.
    fn stress(&self) -> Stress;

    /// What is measured.
    fn measure(&self) -> Measure;

    /// One draw at `stress`, with the guard or without. The same state of `rng` gives the same draw for both.
    fn trial(&self, stress: f64, guard: bool, rng: &mut ChaCha8Rng) -> Trial;

    /// How many ordinary trials one at `stress` costs: where it is dear, fewer are made.
    fn cost(&self, _stress: f64) -> u32 {
        1
    }

    /// Least error that any unbiased method can have at `stress` (Cramer-Rao), where known; root mean square, in the unit of
    /// the measure.
    fn bound(&self, _stress: f64) -> Option<f64> {
        None
    }
}

/// All cases, in the order of the report.
pub fn cases() -> Vec<Box<dyn Case>> {
    let groups = [angle::cases(), radar::cases(), tags::cases(), whole::cases()];
    groups.into_iter().flatten().collect()
}
