//! Colours: a scale for maps and a palette for series.

use super::canvas::Rgb;

/// Eleven stops of viridis (S. van der Walt and N. Smith, 2015; CC0): perceptually even, and rising in lightness, so
/// that it reads in grey and for colour-blind eyes.
const VIRIDIS: [Rgb; 11] = [
    [0x44, 0x01, 0x54],
    [0x48, 0x25, 0x76],
    [0x41, 0x44, 0x87],
    [0x35, 0x60, 0x8d],
    [0x2a, 0x78, 0x8e],
    [0x21, 0x90, 0x8c],
    [0x22, 0xa8, 0x84],
    [0x43, 0xbf, 0x71],
    [0x7a, 0xd1, 0x51],
    [0xbb, 0xdf, 0x27],
    [0xfd, 0xe7, 0x25],
];

/// Colours that stay apart for colour-blind eyes (M. Okabe and K. Ito, 2008), less the yellow, which is weak on white.
const SERIES: [Rgb; 7] = [
    [0x00, 0x72, 0xb2],
    [0xd5, 0x5e, 0x00],
    [0x00, 0x9e, 0x73],
    [0xcc, 0x79, 0xa7],
    [0x56, 0xb4, 0xe9],
    [0xe6, 0x9f, 0x00],
    [0x00, 0x00, 0x00],
];

/// Stops of levels: lightness falls from one to the next.
const LEVELS: [Rgb; 3] = [[0xe4, 0xdc, 0xec], [0xc0, 0x58, 0x9c], [0x4a, 0x00, 0x5a]];

/// Colour of a value from 0 to 1; others take the nearest end.
pub(super) fn of_value(value: f64) -> Rgb {
    let last = VIRIDIS.len() - 1;
    let place = value.clamp(0.0, 1.0) * last as f64;
    let stop = (place as usize).min(last - 1);
    let part = place - stop as f64;
    let (low, high) = (VIRIDIS[stop], VIRIDIS[stop + 1]);
    std::array::from_fn(|c| (f64::from(low[c]) * (1.0 - part) + f64::from(high[c]) * part).round() as u8)
}

/// Colour of a level from 0, pale, to 1, strong; for lines on white.
pub(super) fn of_level(level: f64) -> Rgb {
    let [weak, middle, strong] = LEVELS;
    let level = level.clamp(0.0, 1.0) * 2.0;
    let (from, to, part) = if level < 1.0 { (weak, middle, level) } else { (middle, strong, level - 1.0) };
    std::array::from_fn(|c| (f64::from(from[c]) * (1.0 - part) + f64::from(to[c]) * part).round() as u8)
}

/// A grey, 0 black to 255 white.
pub(super) fn of_grey(level: u8) -> Rgb {
    [level; 3]
}

/// Number of colours of series.
pub(super) const SERIES_COUNT: usize = SERIES.len();

/// Colour of series number `number`, counted from 0.
pub(super) fn of_series(number: usize) -> Rgb {
    SERIES[number % SERIES.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// CIE lightness L* of an sRGB colour, 0 to 100.
    fn lightness(colour: Rgb) -> f64 {
        let linear = colour.map(|c| {
            let c = f64::from(c) / 255.0;
            if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
        });
        let y = 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2];
        if y > 0.008_856 { 116.0 * y.cbrt() - 16.0 } else { 903.3 * y }
    }

    #[test]
    fn lightness_rises_evenly() {
        let steps: Vec<_> = (0..=20).map(|n| lightness(of_value(f64::from(n) / 20.0))).collect();
        assert!(steps[0] < 16.0 && steps[20] > 90.0, "{steps:?}");
        for pair in steps.windows(2) {
            let rise = pair[1] - pair[0];
            assert!((2.5..5.5).contains(&rise), "{steps:?}");
        }
    }

    #[test]
    fn ends_hold_beyond_the_scale() {
        assert_eq!(of_value(-1.0), VIRIDIS[0]);
        assert_eq!(of_value(2.0), VIRIDIS[10]);
        assert_eq!(of_value(0.5), VIRIDIS[5]);
    }
}
