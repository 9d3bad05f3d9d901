//! Complex numbers sixteen abreast, and the small FFTs across such groups.

use core::f32::consts::FRAC_1_SQRT_2;

use pulp::Simd;

/// Numbers abreast: range bins, or samples. Two registers of AVX2, one of AVX-512.
pub(super) const LANES: usize = 16;

/// Sixteen complex numbers, their parts apart.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(align(64))]
pub(super) struct Cells {
    pub(super) re: [f32; LANES],
    pub(super) im: [f32; LANES],
}

impl Cells {
    pub(super) const ZERO: Self = Self { re: [0.0; LANES], im: [0.0; LANES] };

    /// Its registers, `LANES / S::F32_LANES` of them.
    #[inline(always)]
    pub(super) fn get<S: Simd>(&self, register: usize) -> Complexes<S> {
        Complexes { re: S::as_simd_f32s(&self.re).0[register], im: S::as_simd_f32s(&self.im).0[register] }
    }

    #[inline(always)]
    pub(super) fn put<S: Simd>(&mut self, register: usize, z: Complexes<S>) {
        S::as_mut_simd_f32s(&mut self.re).0[register] = z.re;
        S::as_mut_simd_f32s(&mut self.im).0[register] = z.im;
    }
}

/// As many complex numbers as a register holds.
pub(super) struct Complexes<S: Simd> {
    re: S::f32s,
    im: S::f32s,
}

impl<S: Simd> Clone for Complexes<S> {
    #[inline(always)]
    fn clone(&self) -> Self {
        *self
    }
}

impl<S: Simd> Copy for Complexes<S> {}

/// cos and sin of pi / 8.
const COS_8: f32 = 0.923_879_5;
const SIN_8: f32 = 0.382_683_43;

/// Arithmetic of a kind of register.
///
/// No closures here, nor functions that take any: what is not inlined into the caller does without its registers.
#[derive(Debug, Clone, Copy)]
pub(super) struct Arithmetic<S>(pub(super) S);

impl<S: Simd> Arithmetic<S> {
    #[inline(always)]
    pub(super) fn zero(self) -> Complexes<S> {
        Complexes { re: self.0.splat_f32s(0.0), im: self.0.splat_f32s(0.0) }
    }

    #[inline(always)]
    fn add(self, a: Complexes<S>, b: Complexes<S>) -> Complexes<S> {
        Complexes { re: self.0.add_f32s(a.re, b.re), im: self.0.add_f32s(a.im, b.im) }
    }

    #[inline(always)]
    fn subtract(self, a: Complexes<S>, b: Complexes<S>) -> Complexes<S> {
        Complexes { re: self.0.sub_f32s(a.re, b.re), im: self.0.sub_f32s(a.im, b.im) }
    }

    #[inline(always)]
    pub(super) fn multiply(self, a: Complexes<S>, b: Complexes<S>) -> Complexes<S> {
        let s = self.0;
        let re = s.mul_add_e_f32s(a.re, b.re, s.neg_f32s(s.mul_f32s(a.im, b.im)));
        Complexes { re, im: s.mul_add_e_f32s(a.re, b.im, s.mul_f32s(a.im, b.re)) }
    }

    /// All by one number.
    #[inline(always)]
    pub(super) fn turn(self, a: Complexes<S>, [re, im]: [f32; 2]) -> Complexes<S> {
        self.multiply(a, Complexes { re: self.0.splat_f32s(re), im: self.0.splat_f32s(im) })
    }

    #[inline(always)]
    pub(super) fn scale(self, a: Complexes<S>, factor: f32) -> Complexes<S> {
        let factor = self.0.splat_f32s(factor);
        Complexes { re: self.0.mul_f32s(a.re, factor), im: self.0.mul_f32s(a.im, factor) }
    }

    /// `a - b`, `b` times one number.
    #[inline(always)]
    pub(super) fn subtract_turned(self, a: Complexes<S>, b: Complexes<S>, factor: [f32; 2]) -> Complexes<S> {
        self.subtract(a, self.turn(b, factor))
    }

    /// Adds the powers of all of `z` less `removed` to `sums`.
    #[inline(always)]
    pub(super) fn add_power(self, z: &Cells, removed: &Cells, sums: &mut [f32; LANES]) {
        let s = self.0;
        let (sums, _) = S::as_mut_simd_f32s(sums);
        for (register, sum) in sums.iter_mut().enumerate() {
            let z = self.subtract(z.get(register), removed.get(register));
            *sum = s.mul_add_e_f32s(z.re, z.re, s.mul_add_e_f32s(z.im, z.im, *sum));
        }
    }

    /// By `-j`.
    #[inline(always)]
    fn quarter(self, a: Complexes<S>) -> Complexes<S> {
        Complexes { re: a.im, im: self.0.neg_f32s(a.re) }
    }

    /// By `exp(-j pi / 4)`.
    #[inline(always)]
    fn eighth(self, a: Complexes<S>) -> Complexes<S> {
        let s = self.0;
        let half = s.splat_f32s(FRAC_1_SQRT_2);
        let re = s.mul_f32s(s.add_f32s(a.re, a.im), half);
        Complexes { re, im: s.mul_f32s(s.sub_f32s(a.im, a.re), half) }
    }

    #[inline(always)]
    fn fft4(self, x: [Complexes<S>; 4]) -> [Complexes<S>; 4] {
        let (a, b) = (self.add(x[0], x[2]), self.subtract(x[0], x[2]));
        let (c, d) = (self.add(x[1], x[3]), self.quarter(self.subtract(x[1], x[3])));
        [self.add(a, c), self.add(b, d), self.subtract(a, c), self.subtract(b, d)]
    }

    #[inline(always)]
    fn fft8(self, x: [Complexes<S>; 8]) -> [Complexes<S>; 8] {
        let even = self.fft4([x[0], x[2], x[4], x[6]]);
        let [a, b, c, d] = self.fft4([x[1], x[3], x[5], x[7]]);
        let odd = [a, self.eighth(b), self.quarter(c), self.quarter(self.eighth(d))];
        [
            self.add(even[0], odd[0]),
            self.add(even[1], odd[1]),
            self.add(even[2], odd[2]),
            self.add(even[3], odd[3]),
            self.subtract(even[0], odd[0]),
            self.subtract(even[1], odd[1]),
            self.subtract(even[2], odd[2]),
            self.subtract(even[3], odd[3]),
        ]
    }

    #[inline(always)]
    fn fft16(self, x: [Complexes<S>; 16]) -> [Complexes<S>; 16] {
        let a = self.fft4([x[0], x[4], x[8], x[12]]);
        let b = self.fft4([x[1], x[5], x[9], x[13]]);
        let c = self.fft4([x[2], x[6], x[10], x[14]]);
        let d = self.fft4([x[3], x[7], x[11], x[15]]);
        let (one, three, nine) = ([COS_8, -SIN_8], [SIN_8, -COS_8], [-COS_8, SIN_8]);
        let p = self.fft4([a[0], b[0], c[0], d[0]]);
        let q = self.fft4([a[1], self.turn(b[1], one), self.eighth(c[1]), self.turn(d[1], three)]);
        let d2 = self.quarter(self.eighth(d[2]));
        let r = self.fft4([a[2], self.eighth(b[2]), self.quarter(c[2]), d2]);
        let c3 = self.quarter(self.eighth(c[3]));
        let s = self.fft4([a[3], self.turn(b[3], three), c3, self.turn(d[3], nine)]);
        [p[0], q[0], r[0], s[0], p[1], q[1], r[1], s[1], p[2], q[2], r[2], s[2], p[3], q[3], r[3], s[3]]
    }

    /// The FFT across `x`, of length 1, 2, 4, 8 or 16, in natural order.
    #[inline(always)]
    pub(super) fn fft<const N: usize>(self, mut x: [Complexes<S>; N]) -> [Complexes<S>; N] {
        if let Some(x) = x.as_mut_slice().as_mut_array::<16>() {
            *x = self.fft16(*x);
        } else if let Some(x) = x.as_mut_slice().as_mut_array::<8>() {
            *x = self.fft8(*x);
        } else if let Some(x) = x.as_mut_slice().as_mut_array::<4>() {
            *x = self.fft4(*x);
        } else if let [a, b] = x.as_mut_slice() {
            [*a, *b] = [self.add(*a, *b), self.subtract(*a, *b)];
        }
        x
    }
}

/// Side of the blocks that are transposed in registers.
const BLOCK: usize = 4;
type Block = [[f32; BLOCK]; BLOCK];

/// Transposes 16 x 16.
#[derive(Debug, Clone, Copy)]
pub(super) struct Transposer {
    /// Compilers left to themselves take 16 loads and 16 stores for a block.
    #[cfg(target_arch = "x86_64")]
    sse: Option<pulp::core_arch::x86::Sse>,
}

impl Transposer {
    pub(super) fn new() -> Self {
        Self {
            #[cfg(target_arch = "x86_64")]
            sse: pulp::core_arch::x86::Sse::try_new(),
        }
    }

    /// Lane `j` of `source[i]` becomes lane `i` of `out[j]`.
    #[inline(always)]
    pub(super) fn transpose(self, source: &[Cells; LANES], out: &mut [Cells; LANES]) {
        #[cfg(target_arch = "x86_64")]
        if let Some(sse) = self.sse {
            return by_blocks(source, out, |block| in_registers(sse, block));
        }
        by_blocks(source, out, |rows| core::array::from_fn(|c| core::array::from_fn(|r| rows[r][c])));
    }
}

#[inline(always)]
fn by_blocks(source: &[Cells; LANES], out: &mut [Cells; LANES], transposed: impl Fn(Block) -> Block) {
    for (i, [a, b, c, d]) in source.as_chunks::<BLOCK>().0.iter().enumerate() {
        for (j, out) in out.as_chunks_mut::<BLOCK>().0.iter_mut().enumerate() {
            let of = |row: &[f32; LANES]| row.as_chunks().0[j];
            let re = transposed([of(&a.re), of(&b.re), of(&c.re), of(&d.re)]);
            let im = transposed([of(&a.im), of(&b.im), of(&c.im), of(&d.im)]);
            for (out, (re, im)) in out.iter_mut().zip(re.into_iter().zip(im)) {
                out.re.as_chunks_mut().0[i] = re;
                out.im.as_chunks_mut().0[i] = im;
            }
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[inline(always)]
fn in_registers(sse: pulp::core_arch::x86::Sse, [a, b, c, d]: Block) -> Block {
    let (low, high) = {
        let (a, b) = (pulp::cast(a), pulp::cast(b));
        (sse._mm_unpacklo_ps(a, b), sse._mm_unpackhi_ps(a, b))
    };
    let (low_after, high_after) = {
        let (c, d) = (pulp::cast(c), pulp::cast(d));
        (sse._mm_unpacklo_ps(c, d), sse._mm_unpackhi_ps(c, d))
    };
    [
        pulp::cast(sse._mm_movelh_ps(low, low_after)),
        pulp::cast(sse._mm_movehl_ps(low_after, low)),
        pulp::cast(sse._mm_movelh_ps(high, high_after)),
        pulp::cast(sse._mm_movehl_ps(high_after, high)),
    ]
}
