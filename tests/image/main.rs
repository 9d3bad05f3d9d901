//! The image of the default board: that it fits its memories with room for the stack, and where it could panic.
//!
//! Panics of our crates are held one by one. What is left is the board's start, before anything comes from a wire: tasks that
//! are spawned once, statics that are taken once. `firmware/README.md` says what is known of the libraries'.
//!
//! Needs a toolchain for the MCU (`firmware/boards/build` says what is missing); without one the test says so and passes,
//! unless `RFHOI_REQUIRE` is set.

mod code;
mod link_map;
mod panics;
mod thumb;

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;

use code::Chain;
use expect_test::expect;
use rfhoi_tests::simulated::machine;

const BOARD: &str = "nucleo-h743zi";

#[test]
fn the_image_fits_and_says_where_it_could_panic() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let Some(path) = machine::image(BOARD, "rfhoi-nucleo-h743zi") else { return };
    let bytes = std::fs::read(&path).unwrap();
    let image = object::File::parse(&*bytes).unwrap();
    let functions = code::functions(&image);
    let map = link_map::regions(&std::fs::read_to_string(root.join("memory.x")).unwrap());
    let reserved = map.iter().find(|r| r.name == "STACK").unwrap().length;
    let report =
        memories(&image, &map) + &stack(&functions, reserved) + &panic_sites(&functions, &path, root);
    let _ = write!(std::io::stderr(), "{report}");
}

/// What each memory holds. Each must hold no more than it has, and code must leave bank 2 alone while that is written.
fn memories(image: &object::File<'_>, map: &[link_map::Region]) -> String {
    /// Bytes of one bank of flash.
    const BANK: u64 = 1024 * 1024;
    let used = link_map::use_by_region(image, map).unwrap();
    let mut report = format!("{BOARD}: memory, bytes\n");
    for (region, used) in map.iter().zip(&used) {
        let _ = writeln!(report, "  {:6} {used:7} of {:7}", region.name, region.length);
        match region.name.as_str() {
            "FLASH" => assert!(*used <= BANK, "code reaches into the bank that is written"),
            "CONFIG" | "STACK" => assert_eq!(*used, 0, "something is linked into {}", region.name),
            _ => {}
        }
    }
    report
}

/// Frames of the stack that are told, bytes.
const LARGE: u32 = 500;
/// Bytes that an exception stacks, with the FPU's registers and alignment (ARMv7-M, B1.5.7).
const EXCEPTION: u32 = 26 * 4 + 4;

/// Deepest chains of calls by task and interrupt, and what they take if the deepest of each level meet.
///
/// Calls through registers, other than an executor's of a task, are not followed, and those that panic are left out: the
/// board measures what is used at most, and logs it.
fn stack(functions: &code::Functions, stack: u64) -> String {
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
    for chain in chains.iter().filter(|chain| task(chain).is_some()) {
        let _ = writeln!(report, "  deepest of {}", task(chain).unwrap_or_default());
        for (name, frame) in chain.calls.iter().filter(|(_, frame)| *frame >= LARGE) {
            let _ = writeln!(report, "    {frame:6} {name}");
        }
    }
    let running = main + thread + EXCEPTION + executor + network + EXCEPTION + interrupt;
    let starting = main + EXCEPTION + executor + start + EXCEPTION + interrupt;
    let _ = writeln!(report, "  {main:6} main, {executor} the executor's interrupt, {interrupt} another");
    let _ = writeln!(report, "  {running:6} all levels at once; {starting} at the start, of {stack}");
    assert!(u64::from(running.max(starting)) <= stack, "{report}");
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
        firmware/boards/nucleo-h743zi/src/devices.rs {async_fn#0}: core::cell::panic_already_borrowed
        firmware/boards/nucleo-h743zi/src/devices.rs {async_fn#0}: core::option::expect_failed
        firmware/boards/nucleo-h743zi/src/devices.rs {async_fn#0}: panic_fmt
        firmware/boards/nucleo-h743zi/src/main.rs set_up: panic_fmt
    "#]]
    .assert_eq(&ours);
    report
}
