//! How people write a name: its words, its head, plurals, and what may be a misspelling of it.

/// Words that say no more than that a thing follows.
const ARTICLES: [&str; 9] = ["a", "an", "the", "my", "our", "your", "his", "her", "their"];
/// Words that end what a name is about: a "mug with a blue handle" is a mug.
const PREPOSITIONS: [&str; 8] = ["of", "with", "without", "for", "from", "in", "on", "by"];
/// Letters of the shortest name that is taken for misspelled; from how many on a letter may stand for another; and from how
/// many on there may be two errors.
const SHORTEST_MISSPELLED: usize = 5;
const SUBSTITUTION_FROM: usize = 8;
const TWO_ERRORS_FROM: usize = 10;

/// Small letters and digits of a name, without all that stands between: "lunch-box" and "Lunch Box" are "lunchbox".
pub(super) fn key(name: &str) -> String {
    name.chars().filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase).collect()
}

/// Keys of its words, without articles.
pub(super) fn words(name: &str) -> Vec<String> {
    let separates = |c: char| !(c.is_alphanumeric() || c == '\'' || c == '’');
    let all = name.split(separates).map(key).filter(|word| !word.is_empty());
    all.filter(|word| !ARTICLES.contains(&word.as_str())).collect()
}

/// The same without the numbers that tell two things of a name apart: "chair 2", "cup3".
pub(super) fn without_numbers(words: &[String]) -> Vec<String> {
    let letters = words.iter().map(|word| word.trim_end_matches(|c: char| c.is_numeric()));
    letters.filter(|word| !word.is_empty()).map(str::to_owned).collect()
}

/// A word, and what it may be the plural or the singular of.
pub(super) fn forms(word: &str) -> impl Iterator<Item = String> {
    const ENDINGS: [(&str, &str); 7] =
        [("s", ""), ("es", ""), ("ies", "y"), ("ves", "f"), ("ves", "fe"), ("mice", "mouse"), ("", "s")];
    let changed =
        |(plural, singular): (&str, &str)| word.strip_suffix(plural).map(|stem| stem.to_owned() + singular);
    let all: Vec<_> = [word.to_owned()].into_iter().chain(ENDINGS.into_iter().filter_map(changed)).collect();
    all.into_iter().filter(|form| form.len() > 1)
}

/// The words that a name is about: those before its preposition. The head of an English name is at their end.
pub(super) fn head(words: &[String]) -> &[String] {
    words.split(|word| PREPOSITIONS.contains(&word.as_str())).next().unwrap_or_default()
}

/// Errors that make a known key of this one, if it can be a misspelling of it. Another word is a letter away from many a name,
/// as "pouch" is from "couch": so the first letter must be right, and no letter of a short word may stand for another.
pub(super) fn errors(key: &str, known: &str) -> Option<usize> {
    let length = key.chars().count();
    if length < SHORTEST_MISSPELLED || key.chars().next() != known.chars().next() {
        return None;
    }
    if length < SUBSTITUTION_FROM && strsim::hamming(key, known) == Ok(1) {
        return None;
    }
    let errors = strsim::osa_distance(key, known);
    (errors <= if length < TWO_ERRORS_FROM { 1 } else { 2 }).then_some(errors)
}
