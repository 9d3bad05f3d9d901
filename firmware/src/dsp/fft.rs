//! The complex FFT of any length that a profile may have.

use microfft::complex::{
    cfft_2, cfft_4, cfft_8, cfft_16, cfft_32, cfft_64, cfft_128, cfft_256, cfft_512, cfft_1024,
};
use num_complex::Complex32;

/// Transforms `x` in place, in natural order, unscaled: `X[k] = sum x[n] exp(-j 2 pi k n / N)`.
///
/// Returns whether the length is one that is served, a power of two from 1 to 1024; `x` is left as it is otherwise.
pub fn forward(x: &mut [Complex32]) -> bool {
    macro_rules! of_length {
        ($($length:literal => $fft:ident),*) => {
            match x.len() {
                1 => true,
                $($length => <&mut [Complex32; $length]>::try_from(x).map($fft).is_ok(),)*
                _ => false,
            }
        };
    }
    of_length!(
        2 => cfft_2, 4 => cfft_4, 8 => cfft_8, 16 => cfft_16, 32 => cfft_32, 64 => cfft_64,
        128 => cfft_128, 256 => cfft_256, 512 => cfft_512, 1024 => cfft_1024
    )
}
