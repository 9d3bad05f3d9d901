//! Lines of words and numbers, as all formats of motion have them.

/// Largest number that is taken: no length or angle of a body comes near, and no sum of such overflows.
const MAX_NUMBER: f64 = 1e6;

/// What is wrong with a line.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fault {
    /// Number of the line, from 1.
    pub line: usize,
    /// What is wrong with it.
    pub reason: String,
}

impl Fault {
    pub(super) fn new(line: usize, reason: impl Into<String>) -> Self {
        Self { line, reason: reason.into() }
    }
}

/// Lines with their number and words; without empty ones and comments (`#`).
pub(super) fn lines(text: &str) -> impl Iterator<Item = (usize, Vec<&str>)> {
    let text = text.trim_start_matches('\u{feff}');
    text.lines()
        .enumerate()
        .map(|(index, line)| (index + 1, line.split_whitespace().collect::<Vec<_>>()))
        .filter(|(_, words)| words.first().is_some_and(|w| !w.starts_with('#')))
}

/// A finite number of sensible size.
pub(super) fn number(line: usize, word: &str) -> Result<f64, Fault> {
    let number = word.parse::<f64>().ok().filter(|n| n.abs() <= MAX_NUMBER);
    number.ok_or_else(|| Fault::new(line, format!("`{}` is no number of at most {MAX_NUMBER}", short(word))))
}

/// Exactly `N` numbers.
pub(super) fn numbers<const N: usize>(line: usize, words: &[&str]) -> Result<[f64; N], Fault> {
    let words: &[&str; N] = words
        .try_into()
        .map_err(|_| Fault::new(line, format!("need {N} numbers, found {} words", words.len())))?;
    let mut numbers = [0.0; N];
    for (number_, word) in numbers.iter_mut().zip(words) {
        *number_ = number(line, word)?;
    }
    Ok(numbers)
}

/// The beginning of a word, for an error.
pub(super) fn short(word: &str) -> String {
    const CHARACTERS: usize = 40;
    word.chars().take(CHARACTERS).collect()
}
