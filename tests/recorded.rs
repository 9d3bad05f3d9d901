//! Where recordings of real devices are, for tests of several crates. None is part of the project: a test that finds
//! none says so and passes.

use std::io::Write;
use std::path::{Path, PathBuf};

/// The recording or folder of this name in the folder that `RFHOI_CAPTURES` names, by default `../shared/captures` beside
/// the checkout; `None`, with a line that says so, where it is not there.
pub(crate) fn recorded(name: &str) -> Option<PathBuf> {
    let beside = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/captures");
    let path = std::env::var_os("RFHOI_CAPTURES").map_or_else(beside, PathBuf::from).join(name);
    if path.exists() {
        return Some(path);
    }
    // Not by `eprintln!`, which the test harness hides where the test passes.
    let _ = writeln!(std::io::stderr(), "SKIPPED: {} is not there (set RFHOI_CAPTURES)", path.display());
    None
}
