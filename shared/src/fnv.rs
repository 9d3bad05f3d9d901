//! FNV-1a, 32 bits: a short name for bytes that are to be recognised (Fowler, Noll, Vo). It protects from mistakes, not from
//! people.

/// Hash of no bytes.
pub const EMPTY: u32 = 0x811c_9dc5;

/// Hash of what led to `hash`, and then `bytes`.
pub fn more<'a>(hash: u32, bytes: impl IntoIterator<Item = &'a u8>) -> u32 {
    bytes.into_iter().fold(hash, |hash, &b| (hash ^ u32::from(b)).wrapping_mul(0x0100_0193))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn published_values() {
        assert_eq!([more(EMPTY, b"a"), more(EMPTY, b"foobar")], [0xe40c_292c, 0xbf9c_f968]);
        assert_eq!(more(more(EMPTY, b"foo"), b"bar"), more(EMPTY, b"foobar"));
    }
}
