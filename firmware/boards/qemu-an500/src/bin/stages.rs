//! What the radar's path costs on a Cortex-M7: instructions by stage for one frame, and the digest of the reference.
//!
//! QEMU runs one instruction in a nanosecond of virtual time (`-icount shift=0`), and SysTick counts 25 MHz of it, so a
//! tick is 40 instructions. The table goes out over semihosting, a line a profile.
#![no_std]
#![no_main]

#[path = "../stages.rs"]
mod stages;

use board as _;
use cortex_m::Peripherals;
use cortex_m::peripheral::syst::SystClkSource;
use cortex_m_semihosting::{debug, hprintln};
use num_complex::Complex;
use panic_semihosting as _;
use rfhoi_firmware::reference;
use rfhoi_shared::config::{Processing, RadarConfig, RadarInput};
use rfhoi_shared::radar::RadarProfile;
use rfhoi_shared::scene::Scene;
use static_cell::ConstStaticCell;

use stages::{Bench, CUBE_CELLS};

static BENCH: ConstStaticCell<Bench> = ConstStaticCell::new(Bench::new());
static CUBE: ConstStaticCell<[Complex<i16>; CUBE_CELLS]> =
    ConstStaticCell::new([Complex::new(0, 0); CUBE_CELLS]);

/// Frames of the reference's digest.
const DIGEST_FRAMES: u32 = 2;

#[cortex_m_rt::entry]
fn main() -> ! {
    if let Some(mut peripherals) = Peripherals::take() {
        let clock = &mut peripherals.SYST;
        clock.set_clock_source(SystClkSource::Core);
        clock.set_reload(stages::WRAP);
        clock.clear_current();
        clock.enable_counter();
    }
    let (bench, cube) = (BENCH.take(), CUBE.take());
    let scene = Scene::default();
    for (name, profile) in [("bridge", RadarProfile::bridge()), ("fine", RadarProfile::fine())] {
        let Ok(processing) = Processing::for_scene(&profile, &scene) else {
            hprintln!("{}: the profile does not see the scene", name);
            continue;
        };
        let config = RadarConfig { profile, input: RadarInput::Uart, processing };
        match bench.run(&config, cube) {
            Some(table) => hprintln!("instructions {} {}", name, table),
            None => hprintln!("{}: the path refuses the profile", name),
        }
    }
    let profile = RadarProfile::bridge();
    if let Ok(processing) = Processing::for_scene(&profile, &scene) {
        let config = RadarConfig { profile, input: RadarInput::Uart, processing };
        if let Some(digest) = reference::digest(&config, DIGEST_FRAMES, cube) {
            hprintln!("digest bridge {:08x}", digest);
        }
    }
    loop {
        debug::exit(debug::EXIT_SUCCESS);
    }
}
