//! Power to 8-bit logarithmic codes.

use rfhoi_shared::wire::LogScale;

/// The scale of all maps: from -130 dB in half decibels to -2.5 dB.
///
/// The quantisation noise of a full-scale 16-bit ADC after the FFTs of the `bridge` profile is at
/// -98 - 10 log10(128 x 64) = -137 dB, and the receiver's own noise some 20 dB above it. A target at -2.5 dB would
/// clip the ADC together with anything else.
pub const SCALE: LogScale = LogScale { floor_db: -130.0, step_db: 0.5 };

/// `10 log10(2)`: dB to the factor of two.
pub const DB_PER_OCTAVE: f32 = 3.010_3;

/// Logarithm to base 2 of a positive, normal number, to within 1.3e-4.
///
/// The exponent, plus a polynomial in the mantissa t in [0, 1): `t + t (1 - t) (a + b t + c t^2)`, exact at both ends,
/// with a, b, c fitted for the least maximum error.
#[inline]
pub fn log2(x: f32) -> f32 {
    const MANTISSA: u32 = 0x007f_ffff;
    const BIAS: i32 = 127;
    let bits = x.to_bits();
    let exponent = (bits >> 23) as i32 - BIAS;
    let t = f32::from_bits(bits & MANTISSA | 0x3f80_0000) - 1.0;
    let q = 0.438_725_5 + t * (-0.239_057_2 + t * 0.082_129_73);
    exponent as f32 + t + t * (1.0 - t) * q
}

/// The code of `power`, relative to a full-scale tone, on [`SCALE`]; rounded, clamped at both ends.
pub fn code(power: f32) -> u8 {
    const PER_OCTAVE: f32 = DB_PER_OCTAVE / SCALE.step_db;
    const OFFSET: f32 = -SCALE.floor_db / SCALE.step_db;
    // Brings ones to the last bit of the mantissa, and so rounds; cheaper than a cast.
    const ONES: f32 = 12_582_912.0;
    let rounded = (log2(power) * PER_OCTAVE + (OFFSET + ONES)).to_bits() as i32 - ONES.to_bits() as i32;
    rounded.clamp(0, u8::MAX.into()) as u8
}

/// A level in dB as a factor of power.
pub fn power_of_db(db: f32) -> f32 {
    libm::exp2f(db / DB_PER_OCTAVE)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn logarithm_is_as_exact_as_stated() {
        let mut worst = 0.0f64;
        for i in 0..200_000 {
            let x = f32::from_bits(0x0080_0000 + i * 10_000);
            worst = worst.max((f64::from(log2(x)) - libm::log2(f64::from(x))).abs());
        }
        assert!(worst < 1.3e-4, "{worst}");
    }

    #[test]
    fn codes_are_within_half_a_step_and_clamp() {
        for tenth_db in -1299..-26 {
            let db = tenth_db as f32 / 10.0;
            let back = SCALE.level_db(code(power_of_db(db)));
            assert!((back - db).abs() <= SCALE.step_db / 2.0 + 1e-3, "{db} -> {back}");
        }
        assert_eq!([code(0.0), code(1e-20), code(f32::MIN_POSITIVE)], [0; 3]);
        assert_eq!([code(1.0), code(1e20)], [255; 2]);
    }
}
