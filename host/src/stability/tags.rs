//! Phase differences of tags where they are known to fail.

use super::Case;

/// The cases of this module.
pub fn cases() -> Vec<Box<dyn Case>> {
    Vec::new()
}
