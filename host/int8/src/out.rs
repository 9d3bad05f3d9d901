//! Where results go, and in which form.

use std::marker::PhantomData;
use std::slice;

use crate::isa::{Isa, LANES};
use crate::lanes::{load, quantise, quantise_numbers};

/// What makes a sum of int8 products an output: `y = sum * scale + bias`, then the greater of `y` and `y * leak`. All have to
/// be finite.
#[derive(Debug, Clone, Copy)]
pub struct Affine<'a> {
    /// For each output.
    pub scale: &'a [f32],
    /// For each output; the inputs' zero point is the caller's to fold in, see [`Packed::sum`](crate::Packed::sum).
    pub bias: &'a [f32],
    /// LeakyReLU's slope, 0 to 1; 1 for a linear output.
    pub leak: f32,
}

/// [`Affine`] of sixteen outputs.
#[inline(always)]
pub(crate) fn affine<I: Isa>(
    isa: I,
    sums: I::Ints,
    scale: I::Floats,
    bias: I::Floats,
    leak: I::Floats,
) -> I::Floats {
    let y = isa.add(isa.multiply(isa.to_floats(sums), scale), bias);
    isa.max(isa.multiply(y, leak), y)
}

/// How a number becomes a u8: `y * inverse`, rounded to the nearest integer (to the even one of two), plus `zero`, clamped to
/// 0 to `top`. NaN becomes `zero`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quant {
    /// One over the step between two codes.
    pub inverse: f32,
    /// The code of 0, not above `top`.
    pub zero: u8,
    /// The greatest code.
    pub top: u8,
}

/// Where results go.
#[derive(Debug)]
pub enum Out<'a> {
    /// As they are.
    F32(&'a mut [f32]),
    /// Added to what is there: the residual of a transformer's block.
    Add(&'a mut [f32]),
    /// Quantised, as the next product takes them.
    U8(&'a mut [u8], Quant),
}

impl Out<'_> {
    /// Numbers that fit.
    pub fn len(&self) -> usize {
        match self {
            Self::F32(values) | Self::Add(values) => values.len(),
            Self::U8(codes, _) => codes.len(),
        }
    }

    /// Whether none fits.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// An [`Out`] that threads share, each writing other places of it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sink<'a> {
    form: Form,
    len: usize,
    out: PhantomData<&'a mut [f32]>,
}

#[derive(Debug, Clone, Copy)]
enum Form {
    F32(*mut f32),
    Add(*mut f32),
    U8(*mut u8, Quant),
}

// SAFETY: it stands for a unique borrow of plain numbers; `store` has its callers write no place from two threads.
unsafe impl Send for Sink<'_> {}
// SAFETY: as above.
unsafe impl Sync for Sink<'_> {}

impl<'a> Sink<'a> {
    pub(crate) fn new(out: Out<'a>) -> Self {
        let len = out.len();
        let form = match out {
            Out::F32(values) => Form::F32(values.as_mut_ptr()),
            Out::Add(values) => Form::Add(values.as_mut_ptr()),
            Out::U8(codes, quant) => Form::U8(codes.as_mut_ptr(), quant),
        };
        Self { form, len, out: PhantomData }
    }

    /// Puts the first `count` lanes at `at` and after.
    ///
    /// # Safety
    /// No other thread may use these places at the same time.
    #[inline(always)]
    pub(crate) unsafe fn store<I: Isa>(self, isa: I, at: usize, y: I::Floats, count: usize) {
        // SAFETY: the caller's.
        unsafe { self.store_rows(isa, (at, 0), Given([y]), count) };
    }

    /// Puts the first `count` lanes of each of `rows` at `at` and after, rows `stride` apart.
    ///
    /// # Safety
    /// No other thread may use these places at the same time.
    #[inline(always)]
    pub(crate) unsafe fn store_rows<I: Isa, R: Rows<I>>(
        self,
        isa: I,
        (mut at, stride): (usize, usize),
        rows: R,
        count: usize,
    ) {
        let len = rows.len();
        assert!(
            len > 0 && count <= LANES && at + (len - 1) * stride + count <= self.len,
            "beyond the output"
        );
        // SAFETY: the last row's places were just checked to lie within the slice borrowed for 'a, so those before them do;
        // the caller has them to itself.
        unsafe {
            match self.form {
                Form::F32(to) => {
                    for row in 0..len {
                        put(slice::from_raw_parts_mut(to.add(at), count), &isa.store(rows.row(isa, row)));
                        at += stride;
                    }
                }
                Form::Add(to) => {
                    for row in 0..len {
                        let to = slice::from_raw_parts_mut(to.add(at), count);
                        put(to, &isa.store(isa.add(load(isa, to, 0.0), rows.row(isa, row))));
                        at += stride;
                    }
                }
                Form::U8(to, quant) => {
                    for row in 0..len {
                        let y = rows.row(isa, row);
                        let codes = if R::NUMBERS {
                            quantise_numbers(isa, y, quant)
                        } else {
                            quantise(isa, y, quant)
                        };
                        put(slice::from_raw_parts_mut(to.add(at), count), &codes);
                        at += stride;
                    }
                }
            }
        }
    }
}

/// Rows of sixteen outputs each.
pub(crate) trait Rows<I: Isa> {
    /// Whether none of them is NaN.
    const NUMBERS: bool;

    fn len(&self) -> usize;
    fn row(&self, isa: I, row: usize) -> I::Floats;
}

/// Rows that are there already, and may be anything.
pub(crate) struct Given<F, const R: usize>(pub(crate) [F; R]);

impl<I: Isa, const R: usize> Rows<I> for Given<I::Floats, R> {
    const NUMBERS: bool = false;

    #[inline(always)]
    fn len(&self) -> usize {
        R
    }

    #[inline(always)]
    fn row(&self, _: I, row: usize) -> I::Floats {
        self.0[row]
    }
}

/// As many as `to` has; all sixteen are a copy of fixed size.
#[inline(always)]
fn put<T: Copy>(to: &mut [T], from: &[T; LANES]) {
    if let Some(to) = to.as_mut_array() {
        *to = *from;
    } else {
        for (to, &from) in to.iter_mut().zip(from) {
            *to = from;
        }
    }
}
