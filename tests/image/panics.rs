//! Where an image may panic: each branch into a function that panics, with the source that it comes from.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use crate::code::Functions;

/// A place in the source from which a panic is reached.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Site {
    /// Crate, as its folder in the repository, or its name.
    pub package: String,
    /// File within the package, and line.
    pub place: String,
    /// Function that the source line is in.
    pub function: String,
    /// What is called: without the module `core::panicking`.
    pub panic: String,
}

impl Site {
    /// Whether it is the compiler's guard against polling a future that has ended, which no executor does.
    pub(crate) fn is_resumption(&self) -> bool {
        self.panic.ends_with("_fn_resumed")
    }
}

/// Whether a function does nothing but panic: those of `core` by their names, and defmt's.
pub(crate) fn panics(name: &str) -> bool {
    let last = name.rsplit("::").next().unwrap_or(name);
    let core = name.starts_with("core::") || name.starts_with("alloc::");
    let failure = last.ends_with("_failed") || last.ends_with("_fail") || last.starts_with("panic_");
    name.starts_with("core::panicking::")
        || core && failure
        || name.starts_with("core::slice") && name.contains("_fail")
        || name.starts_with("core::str") && name.contains("slice_error_fail")
        || name.starts_with("defmt::export::panic")
        || matches!(last, "_defmt_panic" | "rust_begin_unwind" | "default_panic" | "panic")
}

/// The sites of an image whose functions are `functions`; `path` is its file, `root` the repository.
///
/// # Errors
/// If the file has no line tables.
pub(crate) fn sites(functions: &Functions, path: &Path, root: &Path) -> Result<BTreeSet<Site>, String> {
    let lines = addr2line::Loader::new(path).map_err(|e| e.to_string())?;
    let panicking: BTreeMap<u32, &str> =
        functions.iter().filter(|(_, f)| panics(&f.name)).map(|(at, f)| (*at, f.name.as_str())).collect();
    let mut sites = BTreeSet::new();
    for function in functions.values().filter(|f| !panics(&f.name)) {
        for (at, to) in &function.leaves {
            let Some(panic) = panicking.get(to) else { continue };
            let panic = panic.rsplit("panicking::").next().unwrap_or(panic).to_owned();
            let mut frames = lines.find_frames(u64::from(*at)).map_err(|e| e.to_string())?;
            // From the innermost frame outwards: the first that is not the standard library's called what panics.
            let mut site = None;
            while let Ok(Some(frame)) = frames.next() {
                let Some((file, line)) = frame.location.and_then(|l| Some((l.file?, l.line?))) else {
                    continue;
                };
                let name = frame.function.and_then(|f| f.demangle().map(|n| n.into_owned()).ok());
                if let Some((package, file)) = package(file, root) {
                    let function = name.unwrap_or_else(|| function.name.clone());
                    site = Some(Site {
                        package,
                        place: format!("{file}:{line}"),
                        function,
                        panic: panic.clone(),
                    });
                    break;
                }
            }
            sites.insert(site.unwrap_or_else(|| Site {
                package: "core".into(),
                place: String::new(),
                function: function.name.clone(),
                panic,
            }));
        }
    }
    Ok(sites)
}

/// The package of a source file, and the file within it; `None` for the standard library.
fn package(file: &str, root: &Path) -> Option<(String, String)> {
    if file.contains("/library/core/") || file.contains("/library/alloc/") {
        return None;
    }
    if let Some((_, rest)) = file.split_once("/registry/src/") {
        // Index, then name and version.
        let (package, file) = rest.split_once('/')?.1.split_once('/')?;
        let name = package.rsplit_once('-').map_or(package, |(name, _)| name);
        return Some((name.to_owned(), file.to_owned()));
    }
    let path = Path::new(file);
    let within = path.strip_prefix(root).unwrap_or(path).to_string_lossy().into_owned();
    // Relative to the board's folder where rustc was given such a path.
    let (package, file) = within.split_once("/src/").unwrap_or(("firmware/boards", within.as_str()));
    Some((package.to_owned(), format!("src/{file}")))
}

#[test]
fn knows_functions_that_panic() {
    for name in [
        "core::panicking::panic_fmt",
        "core::option::unwrap_failed",
        "core::option::expect_failed",
        "core::slice::index::slice_index_fail",
        "core::slice::copy_from_slice_impl::len_mismatch_fail",
        "core::cell::panic_already_borrowed",
        "core::str::slice_error_fail",
    ] {
        assert!(panics(name), "{name}");
    }
    for name in ["core::fmt::write", "smoltcp::iface::poll", "rfhoi_nucleo_h743zi::restart::by_panic"] {
        assert!(!panics(name), "{name}");
    }
}

#[test]
fn tells_packages_by_paths() {
    let of = |file| package(file, Path::new("/r")).map(|(package, file)| format!("{package} {file}"));
    assert_eq!(
        of("/h/.cargo/registry/src/index-1/smoltcp-0.13.1/src/lib.rs").as_deref(),
        Some("smoltcp src/lib.rs")
    );
    assert_eq!(of("/r/firmware/app/src/host.rs").as_deref(), Some("firmware/app src/host.rs"));
    assert_eq!(of("/usr/lib/rustlib/src/rust/library/core/src/option.rs"), None);
}
