//! What is wrong with a scene: a sentence for each line that must be corrected.

use std::path::PathBuf;

/// One thing that is wrong.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Complaint {
    /// Line of the file, from 1.
    pub line: usize,
    /// What is wrong there and what would be right.
    pub sentence: String,
}

/// Why there is no scene.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// The file cannot be read.
    #[error(
        "cannot read the scene {path}: {source}; give a scene file, or one of the rooms {}",
        super::NAMES.join(", ")
    )]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// It does not describe a scene that can be.
    #[error("{}", listed(.file, .complaints))]
    Invalid {
        /// The file.
        file: PathBuf,
        /// All that is wrong, by line; at least one.
        complaints: Vec<Complaint>,
    },
}

fn listed(file: &std::path::Path, complaints: &[Complaint]) -> String {
    let sentences = complaints.iter().map(|c| format!("{}, line {}: {}", file.display(), c.line, c.sentence));
    sentences.collect::<Vec<_>>().join("\n")
}
