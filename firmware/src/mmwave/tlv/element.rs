//! The numbers in a payload: little-endian, repeated.

use core::marker::PhantomData;

use rfhoi_shared::wire;

pub(super) fn u32_at(bytes: &[u8], offset: usize) -> Option<u32> {
    bytes.get(offset..)?.first_chunk().copied().map(u32::from_le_bytes)
}

fn take<const N: usize>(bytes: &mut &[u8]) -> Option<[u8; N]> {
    let (first, rest) = bytes.split_first_chunk()?;
    *bytes = rest;
    Some(*first)
}

pub(super) fn take_u32(bytes: &mut &[u8]) -> Option<u32> {
    take(bytes).map(u32::from_le_bytes)
}

pub(super) fn take_i16(bytes: &mut &[u8]) -> Option<i16> {
    take(bytes).map(i16::from_le_bytes)
}

fn take_f32(bytes: &mut &[u8]) -> Option<f32> {
    take(bytes).map(f32::from_le_bytes)
}

/// What a payload repeats.
pub trait Element: Copy + sealed::Sealed {
    /// Bytes of one.
    const BYTES: usize;
    /// One, as it is on the wire.
    type Wire: AsRef<[u8]>;

    /// Reads one from the first [`Self::BYTES`] bytes; `None` from fewer.
    fn read(bytes: &[u8]) -> Option<Self>;

    /// Writes one.
    fn wire(self) -> Self::Wire;
}

mod sealed {
    pub trait Sealed {}
    impl Sealed for u16 {}
    impl Sealed for super::DetectedPoint {}
    impl Sealed for super::SideInfo {}
    impl Sealed for super::ComplexI16 {}
}

/// A point that the radar detected (`DPIF_PointCloudCartesian`).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct DetectedPoint {
    /// To the right, m.
    pub x_m: f32,
    /// Forward, m.
    pub y_m: f32,
    /// Up, m.
    pub z_m: f32,
    /// Radial velocity, m/s; positive recedes.
    pub velocity_m_s: f32,
}

impl DetectedPoint {
    /// The point as the uplink carries it.
    pub fn to_wire(self, side: Option<SideInfo>) -> wire::Point {
        wire::Point {
            position_m: [self.x_m, self.y_m, self.z_m],
            velocity_m_s: self.velocity_m_s,
            snr_decidb: side.map(|s| s.snr_decidb),
        }
    }
}

/// How far a detected point stands out (`DPIF_PointCloudSideInfo`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct SideInfo {
    /// Signal-to-noise ratio in 0.1 dB.
    pub snr_decidb: i16,
    /// Noise level beside the point in 0.1 dB.
    pub noise_decidb: i16,
}

/// A complex number of 16-bit parts (`cmplx16ImRe_t`: the imaginary part goes first).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ComplexI16 {
    /// Real part.
    pub re: i16,
    /// Imaginary part.
    pub im: i16,
}

impl Element for u16 {
    const BYTES: usize = 2;
    type Wire = [u8; 2];

    fn read(bytes: &[u8]) -> Option<Self> {
        bytes.first_chunk().copied().map(Self::from_le_bytes)
    }

    fn wire(self) -> [u8; 2] {
        self.to_le_bytes()
    }
}

/// Two 16-bit numbers, the first one lower.
fn pair(first: i16, second: i16) -> [u8; 4] {
    let ([a, b], [c, d]) = (first.to_le_bytes(), second.to_le_bytes());
    [a, b, c, d]
}

impl Element for SideInfo {
    const BYTES: usize = 4;
    type Wire = [u8; 4];

    fn read(mut bytes: &[u8]) -> Option<Self> {
        Some(Self { snr_decidb: take_i16(&mut bytes)?, noise_decidb: take_i16(&mut bytes)? })
    }

    fn wire(self) -> [u8; 4] {
        pair(self.snr_decidb, self.noise_decidb)
    }
}

impl Element for ComplexI16 {
    const BYTES: usize = 4;
    type Wire = [u8; 4];

    fn read(mut bytes: &[u8]) -> Option<Self> {
        Some(Self { im: take_i16(&mut bytes)?, re: take_i16(&mut bytes)? })
    }

    fn wire(self) -> [u8; 4] {
        pair(self.im, self.re)
    }
}

impl Element for DetectedPoint {
    const BYTES: usize = 16;
    type Wire = [u8; 16];

    fn read(mut bytes: &[u8]) -> Option<Self> {
        Some(Self {
            x_m: take_f32(&mut bytes)?,
            y_m: take_f32(&mut bytes)?,
            z_m: take_f32(&mut bytes)?,
            velocity_m_s: take_f32(&mut bytes)?,
        })
    }

    fn wire(self) -> [u8; 16] {
        let mut out = [0; 16];
        let fields = [self.x_m, self.y_m, self.z_m, self.velocity_m_s];
        for (bytes, field) in out.as_chunks_mut::<4>().0.iter_mut().zip(fields) {
            *bytes = field.to_le_bytes();
        }
        out
    }
}

/// A payload of whole elements, read in place.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Elements<'a, T> {
    bytes: &'a [u8],
    of: PhantomData<T>,
}

impl<T> Default for Elements<'_, T> {
    fn default() -> Self {
        Self { bytes: &[], of: PhantomData }
    }
}

impl<'a, T: Element> Elements<'a, T> {
    /// The elements of `payload`, unless it ends within one.
    pub fn new(payload: &'a [u8]) -> Option<Self> {
        payload.len().is_multiple_of(T::BYTES).then_some(Self { bytes: payload, of: PhantomData })
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.bytes.len() / T::BYTES
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.bytes.is_empty()
    }

    /// Number `index`.
    pub fn get(&self, index: usize) -> Option<T> {
        T::read(self.bytes.get(index.checked_mul(T::BYTES)?..)?)
    }

    /// All of them in order.
    pub fn iter(&self) -> impl Iterator<Item = T> + use<'a, T> {
        self.bytes.chunks_exact(T::BYTES).filter_map(T::read)
    }

    /// Elements `start` to `start + count`, if they are there.
    pub(super) fn slice(&self, start: usize, count: usize) -> Option<Self> {
        let (start, bytes) = (start.checked_mul(T::BYTES)?, count.checked_mul(T::BYTES)?);
        let bytes = self.bytes.get(start..start.checked_add(bytes)?)?;
        Some(Self { bytes, of: PhantomData })
    }
}
