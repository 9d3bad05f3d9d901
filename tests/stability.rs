//! Where methods break, as a table that a diff shows, and the promise that nothing wrong is silent.
//!
//! `RFHOI_KEEP=1 cargo test -p rfhoi-tests --test stability` writes the table anew. All data are simulated.

use std::path::Path;

use rfhoi::stability::{self, Options};

/// Draws at each stress. More are made by `rfhoi stability --trials`.
const TRIALS: u32 = 60;

#[test]
fn nothing_wrong_is_silent_and_the_table_is_as_it_was() {
    let cases = stability::cases();
    let cases: Vec<_> = cases.iter().map(|case| &**case).collect();
    let results = stability::run(&cases, Options { trials: TRIALS, seed: 1 }, &mut |_| true).unwrap();

    let mut broken = 0;
    for result in &results {
        let [without, with] = &result.curves;
        for point in &with.points {
            assert_eq!(point.silent, 0, "{} at {}: silently wrong: {point:?}", result.name, point.stress);
            let all = point.right + point.announced + point.needless;
            assert_eq!(all, point.trials);
        }
        assert!(with.points.iter().any(|p| p.right * 10 >= p.trials * 9), "{} is never right", result.name);
        // A stress that breaks nothing tells nothing.
        let breaks = without.points.iter().any(|p| p.silent * 2 > p.trials);
        let announces = with.points.iter().any(|p| (p.announced + p.needless) * 2 > p.trials);
        assert!(breaks || announces || result.name.starts_with("capon"), "{} does not break", result.name);
        broken += u32::from(breaks);
    }
    assert!(broken * 3 > 2 * results.len() as u32, "{broken} of {} cases break", results.len());

    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("stability.txt");
    let table = stability::table(&results);
    if std::env::var_os("RFHOI_KEEP").is_some() {
        std::fs::write(&path, &table).unwrap();
    }
    let kept = std::fs::read_to_string(&path).unwrap_or_default();
    // Wider or narrower registers round differently: a draw at the edge may fall to either side.
    let differing: Vec<_> = table.lines().zip(kept.lines()).filter(|(now, then)| !alike(now, then)).collect();
    assert!(
        differing.is_empty() && table.lines().count() == kept.lines().count(),
        "tests/stability.txt has changed (RFHOI_KEEP=1 writes it anew): {differing:#?}"
    );
}

/// Whether two lines differ in numbers by no more than a draw or two of the trials, or the last digit.
fn alike(now: &str, then: &str) -> bool {
    let (now, then): (Vec<_>, Vec<_>) = (now.split_whitespace().collect(), then.split_whitespace().collect());
    let number = |text: &str| if text == "-" { Some(0.0) } else { text.parse::<f64>().ok() };
    now.len() == then.len()
        && now.iter().zip(&then).all(|(a, b)| {
            a == b
                || number(a)
                    .zip(number(b))
                    .is_some_and(|(a, b)| (a - b).abs() <= f64::max(4.0, 0.1 * a.abs()))
        })
}
