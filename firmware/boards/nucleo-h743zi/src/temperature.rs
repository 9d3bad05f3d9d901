//! The chip's temperature, from the sensor on ADC3 and its factory calibration.

use embassy_stm32::Peri;
use embassy_stm32::adc::{Adc, SampleTime, Temperature, VrefInt};
use embassy_stm32::peripherals::ADC3;

/// Readings that the factory took at 3.3 V: of the sensor at 30 and 110 degrees Celsius (DS12110, temperature sensor) and of the
/// reference (embedded reference voltage), 16 bit.
const SENSOR_30: *const u16 = 0x1FF1_E820 as *const u16;
const SENSOR_110: *const u16 = 0x1FF1_E840 as *const u16;
const REFERENCE: *const u16 = 0x1FF1_E860 as *const u16;

/// 24 us or, on revision Y, 12 us at 32 MHz; the sensor wants 9 us, the reference 4.3 us (same places).
const SAMPLE: SampleTime = SampleTime::CYCLES387_5;

/// The sensor.
pub struct Thermometer {
    adc: Adc<'static, ADC3>,
    sensor: Temperature,
    reference: VrefInt,
    factory: Option<Factory>,
}

/// The factory's readings.
#[derive(Clone, Copy)]
struct Factory {
    at_30: i32,
    at_110: i32,
    reference: i32,
}

impl Factory {
    fn read() -> Option<Self> {
        // SAFETY: words of the system memory, which is always there to read.
        let [at_30, at_110, reference] =
            unsafe { [SENSOR_30, SENSOR_110, REFERENCE].map(|p| i32::from(p.read_volatile())) };
        const ERASED: i32 = 0xffff;
        (at_30 < at_110 && at_110 < ERASED && reference < ERASED).then_some(Self { at_30, at_110, reference })
    }

    /// Tenths of a degree Celsius for readings of the sensor and of the reference at one supply.
    fn decicelsius(self, sensor: i32, reference: i32) -> Option<i16> {
        // The reference tells the supply, and by it what the sensor would have read at the factory's 3.3 V.
        let at_factory = sensor.checked_mul(self.reference)?.checked_div(reference)?;
        let above_30 = (at_factory - self.at_30).checked_mul(800)?.checked_div(self.at_110 - self.at_30)?;
        i16::try_from(300 + above_30).ok()
    }
}

impl Thermometer {
    /// Takes the ADC; it stays on.
    pub fn new(adc: Peri<'static, ADC3>) -> Self {
        let adc = Adc::new(adc);
        let sensor = adc.enable_temperature();
        let reference = adc.enable_vrefint();
        Self { adc, sensor, reference, factory: Factory::read() }
    }

    /// Tenths of a degree Celsius; `None` where the factory left no calibration. Takes about 50 us.
    pub fn decicelsius(&mut self) -> Option<i16> {
        let sensor = i32::from(self.adc.blocking_read(&mut self.sensor, SAMPLE));
        let reference = i32::from(self.adc.blocking_read(&mut self.reference, SAMPLE));
        self.factory?.decicelsius(sensor, reference)
    }
}
