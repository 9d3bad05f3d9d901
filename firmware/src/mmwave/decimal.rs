//! Decimal numbers as integers of a chosen resolution: `57.14` us is exactly 57 140 ns.

use core::fmt;
use core::num::NonZeroU64;

/// `text` times 10^`decimals`, rounded half away from zero where it has more digits than that.
///
/// Takes an optional sign, digits, and a point with or without digits on one side of it, as C's `atof` does; no
/// exponent. `None` for anything else and for numbers past an `i64`.
pub(super) fn parse(text: &str, decimals: usize) -> Option<i64> {
    let (negative, digits) = match text.strip_prefix('-') {
        Some(rest) => (true, rest),
        None => (false, text.strip_prefix('+').unwrap_or(text)),
    };
    let (whole, fraction) = digits.split_once('.').unwrap_or((digits, ""));
    let all_digits = |part: &str| part.bytes().all(|b| b.is_ascii_digit());
    if (whole.is_empty() && fraction.is_empty()) || !all_digits(whole) || !all_digits(fraction) {
        return None;
    }
    let kept = fraction.bytes().chain(core::iter::repeat(b'0')).take(decimals);
    let mut value = 0i64;
    for digit in whole.bytes().chain(kept) {
        value = value.checked_mul(10)?.checked_add(i64::from(digit.wrapping_sub(b'0')))?;
    }
    if fraction.as_bytes().get(decimals).is_some_and(|&digit| digit >= b'5') {
        value = value.checked_add(1)?;
    }
    Some(if negative { -value } else { value })
}

/// Shows `value` / 10^`decimals` with no more digits than it needs.
#[derive(Debug, Clone, Copy)]
pub(super) struct Decimal {
    /// The integer.
    pub(super) value: u32,
    /// Its resolution.
    pub(super) decimals: u8,
}

impl fmt::Display for Decimal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let value = u64::from(self.value);
        let Some(scale) = 10u64.checked_pow(self.decimals.into()).and_then(NonZeroU64::new) else {
            return Err(fmt::Error);
        };
        let mut fraction = value % scale;
        write!(f, "{}", value / scale)?;
        if fraction == 0 {
            return Ok(());
        }
        let mut width = self.decimals;
        while fraction.is_multiple_of(10) {
            fraction /= 10;
            width = width.saturating_sub(1);
        }
        let width = usize::from(width);
        write!(f, ".{fraction:0width$}")
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use std::format;

    use proptest::prelude::*;

    use super::*;

    #[test]
    fn stock_numbers_are_exact() {
        // As binary floating point, 57.14 * 1000 is 57140.000000000007 and 82.237 * 1000 is 82236.99999999999.
        assert_eq!(parse("57.14", 3), Some(57_140));
        assert_eq!(parse("82.237", 3), Some(82_237));
        assert_eq!(parse("33.333", 3), Some(33_333));
        assert_eq!(parse("77", 6), Some(77_000_000));
        assert_eq!(parse("60.25", 6), Some(60_250_000));
    }

    #[test]
    fn forms_of_atof() {
        for (text, value) in
            [("-1.5", -1500), ("+2", 2000), (".5", 500), ("5.", 5000), ("007", 7000), ("-0", 0)]
        {
            assert_eq!(parse(text, 3), Some(value), "{text}");
        }
        for text in ["", ".", "-", "1e3", "1,5", "0x10", "1.2.3", "--1", "NaN", "99999999999999999999"] {
            assert_eq!(parse(text, 3), None, "{text}");
        }
    }

    #[test]
    fn digits_past_the_resolution_round() {
        assert_eq!(parse("1.0004", 3), Some(1000));
        assert_eq!(parse("1.0005", 3), Some(1001));
        assert_eq!(parse("-1.0005", 3), Some(-1001));
        assert_eq!(parse("0.9996", 3), Some(1000));
    }

    proptest! {
        #[test]
        fn shown_numbers_read_back(value: u32, decimals in 0u8..=9) {
            let text = format!("{}", Decimal { value, decimals });
            prop_assert_eq!(parse(&text, decimals.into()), Some(i64::from(value)));
        }

        #[test]
        fn any_text_is_safe(text: std::string::String, decimals in 0usize..=9) {
            let _ = parse(&text, decimals);
        }
    }
}
