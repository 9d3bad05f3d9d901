//! The words of a chirp as numbers.
//!
//! A chirp holds all samples of RX1, then all of RX2, and so on (2-lane LVDS, receivers not interleaved), each word a
//! little-endian i16. Complex samples come in pairs of two words each, see [`IqOrder`]; real ones in their order.

use num_complex::Complex32;
use rfhoi_shared::radar::{IqOrder, SampleFormat};

/// Largest magnitude of a word that is not at the ADC's limit.
const LIMIT: i32 = i16::MAX as i32;

/// Converts one receiver's samples of a chirp and multiplies them by `window`, sample by sample.
///
/// Returns how many words are at the ADC's limits. The shortest of the three lengths bounds what is converted.
pub fn unpack(raw: &[u8], format: SampleFormat, window: &[f32], out: &mut [Complex32]) -> u32 {
    // The bits of all magnitudes together: only if these could hold a word at the limit is it worth counting.
    let bits = match format {
        SampleFormat::Complex(order) => unpack_complex(raw, order, window, out),
        SampleFormat::Real => unpack_real(raw, window, out),
    };
    if bits == LIMIT { count_limits(raw) } else { 0 }
}

fn unpack_complex(raw: &[u8], order: IqOrder, window: &[f32], out: &mut [Complex32]) -> i32 {
    let mut bits = 0;
    let (groups, _) = raw.as_chunks::<8>();
    let (windows, _) = window.as_chunks::<2>();
    let (pairs, _) = out.as_chunks_mut::<2>();
    for ((group, &[w0, w1]), [z0, z1]) in groups.iter().zip(windows).zip(pairs) {
        let &[a0, a1, b0, b1, c0, c1, d0, d1] = group;
        let [first0, first1] = [word([a0, a1]), word([b0, b1])];
        let [second0, second1] = [word([c0, c1]), word([d0, d1])];
        bits |= magnitude(first0) | magnitude(first1) | magnitude(second0) | magnitude(second1);
        let ([i0, i1], [q0, q1]) = match order {
            IqOrder::IFirst => ([first0, first1], [second0, second1]),
            IqOrder::QFirst => ([second0, second1], [first0, first1]),
        };
        *z0 = Complex32::new(i0 as f32 * w0, q0 as f32 * w0);
        *z1 = Complex32::new(i1 as f32 * w1, q1 as f32 * w1);
    }
    bits
}

fn unpack_real(raw: &[u8], window: &[f32], out: &mut [Complex32]) -> i32 {
    let mut bits = 0;
    let (words, _) = raw.as_chunks::<2>();
    for ((&bytes, &w), z) in words.iter().zip(window).zip(out) {
        let value = word(bytes);
        bits |= magnitude(value);
        *z = Complex32::new(value as f32 * w, 0.0);
    }
    bits
}

fn word(bytes: [u8; 2]) -> i32 {
    i32::from(i16::from_le_bytes(bytes))
}

/// `value`, or `-value - 1` for a negative one: 0 to 32767 for any i16.
fn magnitude(value: i32) -> i32 {
    value ^ (value >> 31)
}

#[cold]
fn count_limits(raw: &[u8]) -> u32 {
    let (words, _) = raw.as_chunks::<2>();
    words.iter().filter(|&&bytes| magnitude(word(bytes)) == LIMIT).count() as u32
}

/// Writes complex samples as words of a chirp: the inverse of [`unpack`] for a simulated radar. Values are rounded, and
/// clipped as an ADC clips.
pub fn pack(samples: &[Complex32], format: SampleFormat, raw: &mut [u8]) {
    let code = |x: f32| (libm::roundf(x) as i16).to_le_bytes();
    match format {
        SampleFormat::Complex(order) => {
            let (pairs, _) = samples.as_chunks::<2>();
            let (groups, _) = raw.as_chunks_mut::<8>();
            for ([z0, z1], group) in pairs.iter().zip(groups) {
                let (i, q) = ([code(z0.re), code(z1.re)], [code(z0.im), code(z1.im)]);
                let [[[a0, a1], [b0, b1]], [[c0, c1], [d0, d1]]] = match order {
                    IqOrder::IFirst => [i, q],
                    IqOrder::QFirst => [q, i],
                };
                *group = [a0, a1, b0, b1, c0, c1, d0, d1];
            }
        }
        SampleFormat::Real => {
            let (words, _) = raw.as_chunks_mut::<2>();
            for (z, word) in samples.iter().zip(words) {
                *word = code(z.re);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::vec;
    use std::vec::Vec;

    use proptest::prelude::*;

    use super::*;

    fn bytes(words: &[i16]) -> Vec<u8> {
        words.iter().flat_map(|w| w.to_le_bytes()).collect()
    }

    fn unpacked(words: &[i16], format: SampleFormat, samples: usize) -> (Vec<Complex32>, u32) {
        let mut out = vec![Complex32::default(); samples];
        let clipped = unpack(&bytes(words), format, &vec![1.0; samples], &mut out);
        (out, clipped)
    }

    #[test]
    fn word_orders() {
        let words = [1, 2, -3, 4];
        let z = Complex32::new;
        let (i_first, _) = unpacked(&words, SampleFormat::Complex(IqOrder::IFirst), 2);
        assert_eq!(i_first, [z(1.0, -3.0), z(2.0, 4.0)]);
        let (q_first, _) = unpacked(&words, SampleFormat::Complex(IqOrder::QFirst), 2);
        assert_eq!(q_first, [z(-3.0, 1.0), z(4.0, 2.0)]);
        let (real, _) = unpacked(&words, SampleFormat::Real, 4);
        assert_eq!(real, [z(1.0, 0.0), z(2.0, 0.0), z(-3.0, 0.0), z(4.0, 0.0)]);
    }

    #[test]
    fn words_at_the_limits_are_counted() {
        let format = SampleFormat::Real;
        assert_eq!(unpacked(&[i16::MAX, i16::MIN, 0, i16::MAX - 1], format, 4).1, 2);
        // All bits of magnitudes set together, but no word at the limit.
        assert_eq!(unpacked(&[0x5555, 0x2aaa], format, 2).1, 0);
    }

    #[test]
    fn the_window_multiplies_its_own_sample() {
        let mut out = [Complex32::default(); 2];
        unpack(&bytes(&[1, 1, 1, 1]), SampleFormat::Complex(IqOrder::IFirst), &[0.5, 2.0], &mut out);
        assert_eq!(out, [Complex32::new(0.5, 0.5), Complex32::new(2.0, 2.0)]);
    }

    proptest! {
        #[test]
        fn packing_is_the_inverse(words in prop::collection::vec(any::<i16>(), 64), kind in 0..3) {
            let format = [
                SampleFormat::Complex(IqOrder::IFirst),
                SampleFormat::Complex(IqOrder::QFirst),
                SampleFormat::Real,
            ][kind as usize];
            let (samples, _) = unpacked(&words, format, 128 / format.bytes() as usize);
            let mut raw = vec![0; 128];
            pack(&samples, format, &mut raw);
            prop_assert_eq!(raw, bytes(&words));
        }

        #[test]
        fn any_lengths_are_fine(raw in prop::collection::vec(any::<u8>(), 0..70), window in 0usize..20, out in 0usize..20) {
            let mut samples = vec![Complex32::default(); out];
            unpack(&raw, SampleFormat::Complex(IqOrder::QFirst), &vec![1.0; window], &mut samples);
            unpack(&raw, SampleFormat::Real, &vec![1.0; window], &mut samples);
        }
    }
}
