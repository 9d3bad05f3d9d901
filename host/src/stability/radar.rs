//! Radar processing where it is known to fail: simulated scatterers as words, through the bridge's own code to packets, and
//! through the host's maps.

mod cases;
mod rig;

use super::Case;

/// The cases of this module.
pub fn cases() -> Vec<Box<dyn Case>> {
    vec![
        Box::new(cases::TdmSpeed),
        Box::new(cases::StandingStill),
        Box::new(cases::BackgroundStill),
        Box::new(cases::FullScale),
        Box::new(cases::Tiny),
        Box::new(cases::ChirpsLost),
        Box::new(cases::RowsLost),
    ]
}

#[cfg(test)]
mod tests {
    use super::super::{Options, run};
    use super::*;

    #[test]
    fn what_fails_says_so() {
        for seed in [1, 2, 3] {
            let cases = cases();
            let cases: Vec<&dyn Case> = cases.iter().map(AsRef::as_ref).collect();
            let results = run(&cases, Options { trials: 200, seed }, &mut |_| true).unwrap();
            for result in results {
                let [plain, guarded] = &result.curves;
                for (p, g) in plain.points.iter().zip(&guarded.points) {
                    println!(
                        "{:<24} {:>8} {:<4} alone: right {:>3} silent {:>3}; guarded: right {:>3} announced {:>3} needless \
                         {:>3} silent {:>3} {:?}",
                        result.name,
                        p.stress,
                        result.stress_unit,
                        p.right,
                        p.silent,
                        g.right,
                        g.announced,
                        g.needless,
                        g.silent,
                        g.reasons
                    );
                }
                assert!(guarded.points.iter().all(|p| p.silent == 0), "{}: silent", result.name);
                assert!(plain.points.iter().any(|p| p.silent > 100), "{} never fails", result.name);
                let most = guarded.points.iter().map(|p| p.right).max();
                assert!(most >= Some(190), "{}: right {most:?} times at best", result.name);
            }
        }
    }
}
