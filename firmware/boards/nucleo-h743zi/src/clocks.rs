//! The clock tree, by the chip's revision.
//!
//! HSE is the 8 MHz that the ST-LINK gives out, not a crystal (UM1974 and UM2407, OSC clock). The core runs at
//! 480 MHz in voltage scale 0 on revision V and later; revision Y has no such scale and stops at 400 MHz in scale 1
//! (RM0433, PWR_D3CR; DS12110, general operating conditions).
//!
//! | clock | revision V | revision Y | limit (same place) |
//! |---|---|---|---|
//! | core | 480 MHz | 400 MHz | 480, 400 MHz |
//! | AXI, AHB | 240 MHz | 200 MHz | 240, 200 MHz |
//! | APB1 to APB4 | 120 MHz | 100 MHz | 120, 100 MHz |
//! | PLL1's oscillator | 960 MHz | 800 MHz | 960, 836 MHz |
//! | ADC | 32 MHz | 32 MHz | 36 MHz |
//! | RNG | 48 MHz, HSI48 | same | 48 MHz |
//!
//! Wait states of the flash follow in embassy-stm32 (RM0433, FLASH_ACR: four at 240 MHz in scale 0, two at 200 MHz in
//! scale 1).

use embassy_stm32::Config;
use embassy_stm32::pac::DBGMCU;
use embassy_stm32::rcc::{
    AHBPrescaler, APBPrescaler, Hse, HseMode, LsConfig, Pll, PllDiv, PllMul, PllPreDiv, PllSource, Sysclk,
    VoltageScale, mux,
};
use embassy_stm32::time::Hertz;

/// What the ST-LINK gives out.
const HSE: Hertz = Hertz(8_000_000);

/// The silicon's revision, as far as it matters here.
#[derive(Debug, Clone, Copy, PartialEq, Eq, defmt::Format)]
pub enum Revision {
    /// Z and Y: 400 MHz at most.
    Y,
    /// X and V: 480 MHz.
    V,
}

impl Revision {
    /// Reads the revision (RM0433, DBGMCU_IDC: 0x1001 is Z, 0x1003 Y, 0x2001 X, 0x2003 V).
    pub fn read() -> Self {
        if DBGMCU.idc().read().rev_id() < 0x2000 { Self::Y } else { Self::V }
    }
}

/// Settings for `embassy_stm32::init`.
pub fn config(revision: Revision) -> Config {
    let (scale, mul) = match revision {
        Revision::V => (VoltageScale::Scale0, PllMul::MUL120),
        Revision::Y => (VoltageScale::Scale1, PllMul::MUL100),
    };
    let pll = Pll {
        source: PllSource::HSE,
        prediv: PllPreDiv::DIV1,
        mul,
        fracn: None,
        divp: Some(PllDiv::DIV2),
        divq: None,
        divr: None,
    };
    let mut config = Config::default();
    let rcc = &mut config.rcc;
    rcc.voltage_scale = scale;
    rcc.hse = Some(Hse { freq: HSE, mode: HseMode::Bypass });
    // The compensation of fast pins needs this oscillator (RM0433, SYSCFG_CCCSR), and RMII has fast pins.
    rcc.csi = true;
    rcc.pll1 = Some(pll);
    // 448 MHz in the oscillator, in the range allowed for a reference of 2 MHz or more (DS12110, PLL); 32 MHz out.
    rcc.pll2 = Some(Pll { mul: PllMul::MUL56, divp: Some(PllDiv::DIV14), ..pll });
    rcc.sys = Sysclk::PLL1_P;
    rcc.ahb_pre = AHBPrescaler::DIV2;
    rcc.apb1_pre = APBPrescaler::DIV2;
    rcc.apb2_pre = APBPrescaler::DIV2;
    rcc.apb3_pre = APBPrescaler::DIV2;
    rcc.apb4_pre = APBPrescaler::DIV2;
    rcc.mux.adcsel = mux::Adcsel::PLL2_P;
    rcc.mux.rngsel = mux::Rngsel::HSI48;
    // No calendar; the watchdog starts its own oscillator.
    rcc.ls = LsConfig::off();
    config
}
