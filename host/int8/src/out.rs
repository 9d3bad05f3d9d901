//! Where results go, and in which form.

use std::marker::PhantomData;

use crate::isa::LANES;
use crate::lanes::{Lanes, quantise};

/// What makes a sum of int8 products an output: `y = sum * scale + bias`, then `y` where it is not negative, else
/// `y * leak`.
#[derive(Debug, Clone, Copy)]
pub struct Affine<'a> {
    /// For each output.
    pub scale: &'a [f32],
    /// For each output; the inputs' zero point is the caller's to fold in, see [`Packed::sum`](crate::Packed::sum).
    pub bias: &'a [f32],
    /// LeakyReLU's slope; 1 for a linear output.
    pub leak: f32,
}

impl Affine<'_> {
    /// `y` of the sums, `scale` and `bias` being those of the lanes.
    #[inline(always)]
    pub(crate) fn apply(sums: [i32; LANES], scale: &Lanes, bias: &Lanes, leak: f32) -> Lanes {
        let mut y = Lanes::ZERO;
        for lane in 0..LANES {
            let value = sums[lane] as f32 * scale.0[lane] + bias.0[lane];
            y.0[lane] = if value >= 0.0 { value } else { value * leak };
        }
        y
    }
}

/// How a number becomes a u8: `y * inverse`, rounded to the nearest integer (to the even one of two), plus `zero`, clamped to
/// 0 to 255. NaN becomes `zero`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quant {
    /// One over the step between two codes.
    pub inverse: f32,
    /// The code of 0.
    pub zero: u8,
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
    pub(crate) unsafe fn store(self, at: usize, y: &Lanes, count: usize) {
        assert!(count <= LANES && count <= self.len && at <= self.len - count, "store beyond the output");
        // SAFETY: just checked to lie within the slice borrowed for 'a; the caller has these places to itself.
        unsafe {
            match self.form {
                Form::F32(to) => put(&mut *std::ptr::slice_from_raw_parts_mut(to.add(at), count), &y.0),
                Form::Add(to) => add(&mut *std::ptr::slice_from_raw_parts_mut(to.add(at), count), &y.0),
                Form::U8(to, quant) => {
                    put(
                        &mut *std::ptr::slice_from_raw_parts_mut(to.add(at), count),
                        &quantise(y, quant).map(|code| code as u8),
                    );
                }
            }
        }
    }
}

/// Copies what `to` has room for; a full register's worth is a copy of fixed size.
#[inline(always)]
pub(crate) fn put<T: Copy>(to: &mut [T], from: &[T; LANES]) {
    if let Some(to) = to.as_mut_array() {
        *to = *from;
    } else {
        for (to, &from) in to.iter_mut().zip(from) {
            *to = from;
        }
    }
}

#[inline(always)]
fn add(to: &mut [f32], from: &[f32; LANES]) {
    if let Ok(to) = <&mut [f32; LANES]>::try_from(&mut *to) {
        for (to, from) in to.iter_mut().zip(from) {
            *to += from;
        }
    } else {
        for (to, from) in to.iter_mut().zip(from) {
            *to += from;
        }
    }
}
