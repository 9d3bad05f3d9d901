use super::super::{Options, run};
use super::*;

#[test]
fn guards_let_nothing_wrong_be_silent_and_without_them_methods_fail() {
    let cases = cases();
    let cases: Vec<&dyn Case> = cases.iter().map(|case| case.as_ref()).collect();
    let results = run(&cases, Options { trials: 60, seed: 1 }, &mut |_| true).unwrap();
    for result in &results {
        let [plain, guarded] = &result.curves;
        assert!(plain.points.iter().any(|p| p.silent > 0), "{} does not fail", result.name);
        for point in &guarded.points {
            assert_eq!(point.silent, 0, "{} at {}", result.name, point.stress);
        }
        // Somewhere it works, and says so.
        assert!(guarded.points.iter().any(|p| p.right >= 57), "{} is never trusted", result.name);
    }
}

#[test]
fn errors_are_those_of_the_bound() {
    let cases = cases();
    let snr = cases.iter().find(|case| case.name() == "music-snr").unwrap().as_ref();
    let results = run(&[snr], Options { trials: 300, seed: 4 }, &mut |_| true).unwrap();
    let [plain, _] = &results[0].curves;
    for point in plain.points.iter().filter(|p| p.stress >= 5.0) {
        let ratio = point.rms_error.unwrap() / point.bound.unwrap();
        // 300 draws leave 4 % of chance, directions another few.
        assert!((0.85..1.2).contains(&ratio), "{ratio} at {} dB", point.stress);
    }
}
