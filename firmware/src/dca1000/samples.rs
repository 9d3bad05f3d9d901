//! The words of a chirp as numbers.
//!
//! A chirp holds all samples of RX1, then all of RX2, and so on (2-lane LVDS, receivers not interleaved), each word a
//! little-endian i16. Complex samples come in pairs of two words each, see [`IqOrder`]; real ones in their order.

use num_complex::Complex32;
use rfhoi_shared::radar::{IqOrder, SampleFormat};

/// Full scale in words: one past the largest.
pub const FULL_SCALE: f32 = 32768.0;

/// The first bits of two words in one of 32 bits.
pub const SIGNS: u32 = 0x8000_8000;

/// Converts one receiver's samples of a chirp and multiplies them by `window`, sample by sample.
///
/// Returns how many words are at the ADC's limits. The shortest of the three lengths bounds what is converted, in
/// fours of samples.
pub fn unpack(raw: &[u8], format: SampleFormat, window: &[f32], out: &mut [Complex32]) -> u32 {
    let changes = match format {
        SampleFormat::Complex(IqOrder::IFirst) => unpack_complex(raw, window, out, |i, q| [i, q]),
        SampleFormat::Complex(IqOrder::QFirst) => unpack_complex(raw, window, out, |q, i| [i, q]),
        SampleFormat::Real => unpack_real(raw, window, out),
    };
    // Only where a word is at half scale or above it is worth looking for one at the limits.
    if changes & SIGNS == 0 { 0 } else { words_at_limits(raw) }
}

/// Returns the [`sign_changes`] of all words.
fn unpack_complex(
    raw: &[u8],
    window: &[f32],
    out: &mut [Complex32],
    i_and_q: impl Fn(u32, u32) -> [u32; 2],
) -> u32 {
    let mut changes = 0;
    let (groups, _) = raw.as_chunks::<4>().0.as_chunks::<4>();
    let (windows, _) = window.as_chunks::<4>();
    let (fours, _) = out.as_chunks_mut::<4>();
    for ((group, &[w0, w1, w2, w3]), [z0, z1, z2, z3]) in groups.iter().zip(windows).zip(fours) {
        let [a, b, c, d] = group.map(u32::from_le_bytes);
        changes |= sign_changes(a) | sign_changes(b) | sign_changes(c) | sign_changes(d);
        let [[i0, i1], [q0, q1]] = i_and_q(a, b).map(words);
        *z0 = Complex32::new(i0 * w0, q0 * w0);
        *z1 = Complex32::new(i1 * w1, q1 * w1);
        let [[i0, i1], [q0, q1]] = i_and_q(c, d).map(words);
        *z2 = Complex32::new(i0 * w2, q0 * w2);
        *z3 = Complex32::new(i1 * w3, q1 * w3);
    }
    changes
}

/// Returns the [`sign_changes`] of all words.
fn unpack_real(raw: &[u8], window: &[f32], out: &mut [Complex32]) -> u32 {
    let mut changes = 0;
    let (groups, _) = raw.as_chunks::<4>().0.as_chunks::<2>();
    let (windows, _) = window.as_chunks::<4>();
    let (fours, _) = out.as_chunks_mut::<4>();
    for ((group, &[w0, w1, w2, w3]), [z0, z1, z2, z3]) in groups.iter().zip(windows).zip(fours) {
        let [a, b] = group.map(u32::from_le_bytes);
        changes |= sign_changes(a) | sign_changes(b);
        let [[x0, x1], [x2, x3]] = [a, b].map(words);
        *z0 = Complex32::new(x0 * w0, 0.0);
        *z1 = Complex32::new(x1 * w1, 0.0);
        *z2 = Complex32::new(x2 * w2, 0.0);
        *z3 = Complex32::new(x3 * w3, 0.0);
    }
    changes
}

/// The two words in `pair`, the first in the lower half.
#[inline]
pub fn words(pair: u32) -> [f32; 2] {
    [pair as i16, (pair >> 16) as i16].map(f32::from)
}

/// Every bit of two words against the next lower one: at [`SIGNS`] set for words of half scale and above.
#[inline]
pub fn sign_changes(pair: u32) -> u32 {
    pair ^ pair << 1
}

/// How many words of `raw` are 32767 or -32768.
pub fn words_at_limits(raw: &[u8]) -> u32 {
    // At the limits all bits but the sign are alike: only the topmost bit changes.
    const OTHERS: u32 = 0x7ffe_7ffe;
    let (pairs, _) = raw.as_chunks::<4>();
    let limits = |&bytes: &[u8; 4]| {
        let changes = sign_changes(u32::from_le_bytes(bytes));
        // Adding carries into the place of the sign if any other bit changes.
        changes & !((changes & OTHERS) + !SIGNS) & SIGNS
    };
    if pairs.iter().fold(0, |any, pair| any | limits(pair)) == 0 {
        return 0;
    }
    pairs.iter().map(|pair| limits(pair).count_ones()).sum()
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
        let words = [1, 2, -3, 4, 5, 6, 7, 8];
        let z = Complex32::new;
        let (i_first, _) = unpacked(&words, SampleFormat::Complex(IqOrder::IFirst), 4);
        assert_eq!(i_first, [z(1.0, -3.0), z(2.0, 4.0), z(5.0, 7.0), z(6.0, 8.0)]);
        let (q_first, _) = unpacked(&words, SampleFormat::Complex(IqOrder::QFirst), 4);
        assert_eq!(q_first, [z(-3.0, 1.0), z(4.0, 2.0), z(7.0, 5.0), z(8.0, 6.0)]);
        let (real, _) = unpacked(&words, SampleFormat::Real, 4);
        assert_eq!(real, [z(1.0, 0.0), z(2.0, 0.0), z(-3.0, 0.0), z(4.0, 0.0)]);
    }

    #[test]
    fn words_at_the_limits_are_counted() {
        let format = SampleFormat::Real;
        assert_eq!(unpacked(&[i16::MAX, i16::MIN, 0, i16::MAX - 1], format, 4).1, 2);
        // Every value in both halves of a pair, beside values that differ from it by little.
        for word in i16::MIN..=i16::MAX {
            let words = [word, word.wrapping_add(1), word.wrapping_sub(2), word];
            let limits = words.iter().filter(|w| [i16::MAX, i16::MIN].contains(w)).count();
            assert_eq!(unpacked(&words, format, 4).1 as usize, limits, "{words:?}");
        }
    }

    #[test]
    fn the_window_multiplies_its_own_sample() {
        let window = [0.5, 2.0, 3.0, 4.0];
        for format in [SampleFormat::Complex(IqOrder::IFirst), SampleFormat::Real] {
            let mut out = [Complex32::default(); 4];
            unpack(&bytes(&[1; 8]), format, &window, &mut out);
            let im = |w: f32| if format == SampleFormat::Real { 0.0 } else { w };
            assert_eq!(out, window.map(|w| Complex32::new(w, im(w))));
        }
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
