//! The image of the default board: that it fits its memories with room for the stack, and where it could panic.
//!
//! Needs a toolchain for the MCU (`firmware/boards/build` says what is missing); without one the test says so and passes.

mod code;
mod link_map;
mod panics;
mod thumb;

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

use code::Chain;
use expect_test::expect;

const BOARD: &str = "nucleo-h743zi";

/// Builds the image; `None`, with the reason on standard error, where that is not possible.
fn build(root: &Path) -> Option<PathBuf> {
    let boards = root.join("firmware/boards");
    let output = Command::new(boards.join("build")).args([BOARD, "build"]).output().unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    if let Some(missing) = errors.lines().find(|l| l.starts_with("missing:")) {
        let _ = writeln!(std::io::stderr(), "SKIPPED: image of {BOARD}, {missing}");
        return None;
    }
    assert!(output.status.success(), "{errors}");
    let target = std::env::var_os("RFHOI_BOARD_TARGET").map_or(root.join("target/boards"), PathBuf::from);
    Some(target.join("thumbv7em-none-eabihf/release").join(format!("rfhoi-{BOARD}")))
}

#[test]
fn the_image_fits_and_says_where_it_could_panic() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let Some(path) = build(root) else { return };
    let bytes = std::fs::read(&path).unwrap();
    let image = object::File::parse(&*bytes).unwrap();
    let functions = code::functions(&image);
    let report = memories(&image, root) + &stack(&functions) + &panic_sites(&functions, &path, root);
    let _ = write!(std::io::stderr(), "{report}");
}

/// What each memory holds. Each must hold no more than it has, and code must leave bank 2 alone while that is written.
fn memories(image: &object::File<'_>, root: &Path) -> String {
    /// Bytes of one bank of flash.
    const BANK: u64 = 1024 * 1024;
    let map = link_map::regions(&std::fs::read_to_string(root.join("memory.x")).unwrap());
    let used = link_map::use_by_region(image, &map).unwrap();
    let mut report = format!("{BOARD}: memory, bytes\n");
    for (region, used) in map.iter().zip(&used) {
        let _ = writeln!(report, "  {:6} {used:7} of {:7}", region.name, region.length);
        match region.name.as_str() {
            "FLASH" => assert!(*used <= BANK, "code reaches into the bank that is written"),
            "CONFIG" | "STACK" => assert_eq!(*used, 0, "something is linked into {}", region.name),
            _ => {}
        }
    }
    let stack = map.iter().find(|r| r.name == "STACK").unwrap().length;
    assert!(stack >= MIN_STACK, "{stack} bytes of stack");
    report
}

/// Least stack that an image may have, bytes.
const MIN_STACK: u64 = 40 * 1024;
/// Bytes that an exception stacks, with the FPU's registers and alignment (ARMv7-M, B1.5.7).
const EXCEPTION: u32 = 26 * 4 + 4;

/// Deepest chains of calls by task and interrupt, and what they take if the deepest of each level meet.
///
/// Calls through registers, other than an executor's of a task, are not followed, and those that panic are left out: the
/// board measures what is used at most, and logs it.
fn stack(functions: &code::Functions) -> String {
    let chains: Vec<_> = functions.keys().map(|at| code::deepest(functions, *at, &panics::panics)).collect();
    let name = |chain: &Chain| chain.calls.first().map_or(String::new(), |(name, _)| name.clone());
    // The names of interrupts are in capitals; the executor of network and devices is one of them.
    let is_interrupt =
        |name: &str| name.chars().all(|c| c.is_ascii_uppercase() || c.is_ascii_digit() || c == '_');
    // `MODULE::__FUNCTION_task::__FUNCTION_task_inner_function::{closure#0}`.
    let task = |chain: &Chain| {
        let name = name(chain);
        let future = name.strip_prefix("<embassy_executor::raw::TaskStorage<")?.strip_suffix(">>::poll")?;
        let (module, function) = future.split_once("::__")?;
        Some(format!("{module}::{}", function.split_once("_task::")?.0))
    };
    let mut report = String::from("stack by direct calls, bytes\n");
    let (mut thread, mut network, mut start, mut executor, mut interrupt, mut main) = (0, 0, 0, 0, 0, 0);
    for chain in &chains {
        let Chain { bytes, .. } = *chain;
        match (task(chain), name(chain).as_str()) {
            (Some(task), _) => {
                let level = match task.as_str() {
                    t if t.starts_with("rfhoi_bridge::dsp") => &mut thread,
                    t if t.ends_with("devices::run") => &mut start,
                    _ => &mut network,
                };
                *level = (*level).max(bytes);
                let _ = writeln!(report, "  {bytes:6} {task}");
            }
            (None, "CEC") => executor = bytes,
            (None, n) if is_interrupt(n) => interrupt = interrupt.max(bytes),
            (None, n) if n.ends_with("::__cortex_m_rt_main") => {
                main = chain.calls.first().map_or(0, |(_, f)| *f)
            }
            _ => {}
        }
    }
    let running = main + thread + EXCEPTION + executor + network + EXCEPTION + interrupt;
    let starting = main + EXCEPTION + executor + start + EXCEPTION + interrupt;
    let _ = writeln!(report, "  {running:6} all levels at once; {starting} at the start");
    report
}

/// The places from which a panic can be reached: ours by name, others by count.
fn panic_sites(functions: &code::Functions, path: &Path, root: &Path) -> String {
    let sites = panics::sites(functions, path, root).unwrap();
    let mut by_package: BTreeMap<&str, Vec<_>> = BTreeMap::new();
    for site in sites.iter().filter(|s| !s.is_resumption()) {
        by_package.entry(&site.package).or_default().push(site);
    }
    let (mut report, mut ours) = (String::from("places that may panic\n"), String::new());
    for (package, sites) in &by_package {
        let _ = writeln!(report, "  {:4} {package}", sites.len());
        if package.starts_with("firmware") || *package == "shared" {
            for site in sites {
                let _ = writeln!(report, "         {} {} -> {}", site.place, site.function, site.panic);
                // No lines, which move with every change.
                let file = site.place.split(':').next().unwrap_or_default();
                let function = site.function.split('<').next().unwrap_or_default();
                let _ = writeln!(ours, "{package}/{file} {function}: {}", site.panic);
            }
        }
    }
    expect![[r#"
        firmware/src/bridge/radar.rs push: panic_const::panic_const_rem_by_zero
        firmware/src/dca1000/reassembly.rs skip: panic_const::panic_const_div_by_zero
        firmware/src/dsp/doppler.rs begin: panic_fmt
        firmware/src/dsp/doppler.rs range_bin: panic_const::panic_const_div_by_zero
        firmware/src/dsp/doppler.rs range_bin: panic_const::panic_const_rem_by_zero
        firmware/src/dsp/doppler.rs range_bin: panic_const::panic_const_div_by_zero
        firmware/src/dsp/moving.rs add_cell: panic_fmt
        firmware/src/dsp/range.rs chirp: panic_const::panic_const_div_by_zero
        firmware/src/mmwave/decimal.rs fmt: panic_const::panic_const_rem_by_zero
        firmware/src/mmwave/decimal.rs fmt: panic_fmt
        firmware/src/mmwave/tlv/stream.rs fill: core::slice::index::slice_index_fail
        firmware/src/mmwave/tlv/stream.rs fill: core::slice::copy_from_slice_impl::len_mismatch_fail
        firmware/app/src/host.rs {async_fn#0}: core::cell::panic_already_borrowed
        firmware/app/src/host.rs {async_fn#0}: core::option::expect_failed
        firmware/app/src/host.rs {async_fn#0}: panic_fmt
        firmware/app/src/reader.rs {async_fn#0}: panic_fmt
        firmware/boards/nucleo-h743zi/src/devices.rs {async_fn#0}: core::cell::panic_already_borrowed
        firmware/boards/nucleo-h743zi/src/devices.rs {async_fn#0}: core::option::expect_failed
        firmware/boards/nucleo-h743zi/src/devices.rs {async_fn#0}: panic_fmt
        firmware/boards/nucleo-h743zi/src/main.rs __cortex_m_rt_main: panic_fmt
        shared/src/radar.rs gate_to: panic_fmt
    "#]]
    .assert_eq(&ours);
    report
}
