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
        const TRIALS: u32 = 25;
        let cases = cases();
        let cases: Vec<&dyn Case> = cases.iter().map(AsRef::as_ref).collect();
        let results = run(&cases, Options { trials: TRIALS, seed: 1 }, &mut |_| true).unwrap();
        for result in results {
            let [plain, guarded] = &result.curves;
            for (p, g) in plain.points.iter().zip(&guarded.points) {
                let name = format!("{} at {} {}", result.name, p.stress, result.stress_unit);
                println!(
                    "{name:<48} alone: right {:>3} silent {:>3}; guarded: right {:>3} announced {:>3} needless {:>3} silent \
                     {:>3} {:?}",
                    p.right, p.silent, g.right, g.announced, g.needless, g.silent, g.reasons
                );
                assert_eq!(g.silent, 0, "{name}");
            }
            assert!(plain.points.iter().any(|p| p.silent > TRIALS / 2), "{} never fails", result.name);
            // A swaying person is still twice a period.
            let often = |right: u32| right * 20 >= TRIALS * 19;
            assert!(guarded.points.iter().any(|p| often(p.right)), "{} is never right", result.name);
        }
    }
}
