//! The kernels as their callers see them: shapes are checked here, once.

use std::cell::RefCell;
use std::sync::{Arc, Mutex, PoisonError};

use crate::attention::{self, Attention};
use crate::conv::{Conv, ConvShape};
use crate::isa::Processor;
use crate::level::Level;
use crate::linear::Linear;
use crate::norm::{Copy, LayerNorm, MeanRows};
use crate::out::{Affine, Out, Quant, Sink};
use crate::pack::{Packed, PackedConv};
use crate::pool::MaxPool;
use crate::threads::Threads;

/// Multiplications from which on threads share a product: 50 to 70 us of one alone. Waking a thread that sleeps takes 10 to
/// 30 us.
const SHARED: usize = 1 << 24;
/// The same where tiles do four times as many in that time.
const SHARED_TILES: usize = 1 << 26;

/// Weights from which on threads share a product whatever its rows are: one core's second cache does not hold more, and a
/// second core brings its own.
const SHARED_WEIGHTS: usize = 2 << 20;

/// Pieces for each thread, so that one that is late or slow leaves some to the others; and all pieces at most.
const PIECES: usize = 4;
const MOST_PIECES: usize = 1024;

thread_local! {
    /// A convolution's input with its border; grows to the largest and stays.
    static BORDERED: RefCell<Vec<u8>> = const { RefCell::new(Vec::new()) };
}

/// Kernels for a level, on some threads.
///
/// All matrices are row by row. Slices that do not fit the shapes are errors of the program, and panic.
#[derive(Debug, Clone)]
pub struct Kernels {
    processor: Processor,
    threads: Option<Arc<Threads>>,
}

impl Kernels {
    /// Kernels of that level on one thread, or `None` if this processor does not have it.
    pub fn new(level: Level) -> Option<Self> {
        Processor::detect(level).map(|processor| Self { processor, threads: None })
    }

    /// Kernels of the best level that this processor has, on one thread.
    pub fn best() -> Self {
        Self { processor: Processor::best(), threads: None }
    }

    /// The same on that many threads (0 is taken as 1), which large products share. Copies of the result share the threads
    /// too; the last to go ends them.
    pub fn with_threads(self, threads: usize) -> Self {
        let threads = (threads > 1).then(|| Arc::new(Threads::new(threads)));
        Self { threads, ..self }
    }

    /// Which instructions they use.
    pub fn level(&self) -> Level {
        self.processor.level()
    }

    /// Threads, the one that calls among them.
    pub fn threads(&self) -> usize {
        self.threads.as_ref().map_or(1, |threads| threads.count())
    }

    /// Runs `part` on each of `parts`, on this thread and the others: for work that is made of many kernels. These run on the
    /// thread that calls them meanwhile.
    ///
    /// # Panics
    /// If `part` does, or there are more than 65535.
    pub fn share<T: Send>(&self, parts: &mut [T], part: impl Fn(&mut T) + Sync) {
        match &self.threads {
            Some(threads) if parts.len() > 1 => {
                let parts: Vec<Mutex<&mut T>> = parts.iter_mut().map(Mutex::new).collect();
                threads.run(parts.len(), &|number| {
                    part(&mut parts[number].lock().unwrap_or_else(PoisonError::into_inner));
                });
            }
            _ => parts.iter_mut().for_each(part),
        }
    }

    /// `rows` of inputs, `[rows][k]`, by `weights`: `[rows][n]`.
    ///
    /// # Panics
    /// If `input`, `affine` or `out` is not of that size.
    pub fn linear(&self, input: &[u8], rows: usize, weights: &Packed, affine: Affine<'_>, out: Out<'_>) {
        let (k, n) = (weights.k(), weights.n());
        assert_eq!(input.len(), rows * k, "inputs of {rows} rows by {k}");
        assert_eq!(out.len(), rows * n, "outputs of {rows} rows by {n}");
        assert_affine(&affine, n);
        let panels = weights.panels();
        let work = Linear { input, rows, weights, affine, sink: Sink::new(out), panels: 0..panels };
        match &self.threads {
            Some(threads) if self.shares(rows, k, n) => {
                let pieces = (threads.count() * PIECES).min(MOST_PIECES).min(panels);
                threads.run(pieces, &|piece| {
                    let panels = piece * panels / pieces..(piece + 1) * panels / pieces;
                    self.processor.run(Linear { panels, ..work.clone() });
                });
            }
            _ => self.processor.run(work),
        }
    }

    fn shares(&self, rows: usize, k: usize, n: usize) -> bool {
        let alone = if self.level() == Level::Amx { SHARED_TILES } else { SHARED };
        rows * k * n >= alone || k * n >= SHARED_WEIGHTS
    }

    /// The codes of `input`.
    ///
    /// # Panics
    /// If `out` is not as long as `input`.
    pub fn quantise(&self, input: &[f32], quant: Quant, out: &mut [u8]) {
        assert_eq!(out.len(), input.len(), "codes of {} numbers", input.len());
        self.processor.run(Copy { input, sink: Sink::new(Out::U8(out, quant)) });
    }

    /// `x += y`.
    ///
    /// # Panics
    /// If they are not of one length.
    pub fn add_rows(&self, x: &mut [f32], y: &[f32]) {
        assert_eq!(x.len(), y.len(), "sums of {} numbers", x.len());
        self.processor.run(Copy { input: y, sink: Sink::new(Out::Add(x)) });
    }

    /// `(x - mean) / sqrt(variance + epsilon) * gamma + beta`, mean and variance being those of the row, for each row of
    /// `input`, `[rows][width]`.
    ///
    /// # Panics
    /// If `width` is 0, `input` is not whole rows, or `gamma`, `beta` or `out` does not fit.
    pub fn layer_norm(
        &self,
        input: &[f32],
        width: usize,
        gamma: &[f32],
        beta: &[f32],
        epsilon: f32,
        out: Out<'_>,
    ) {
        assert!(width > 0 && input.len().is_multiple_of(width), "{} inputs in rows of {width}", input.len());
        assert_eq!((gamma.len(), beta.len()), (width, width), "gamma and beta of rows of {width}");
        assert_eq!(out.len(), input.len(), "outputs of {} numbers", input.len());
        self.processor.run(LayerNorm { input, gamma, beta, epsilon, sink: Sink::new(out) });
    }

    /// `softmax(q k^T / sqrt(d)) v` of each head, of `width / heads = d` numbers, over all rows. `qkv` is
    /// `[rows][3 * width]`: queries, keys, values, and heads one after the other within each; the result is
    /// `[rows][width]`. `scratch` grows as needed.
    ///
    /// # Panics
    /// If `qkv` is not `rows` rows of three times as many numbers as `out` has, or these are not `heads` equal parts.
    pub fn attention(&self, qkv: &[f32], rows: usize, heads: usize, scratch: &mut Vec<f32>, out: Out<'_>) {
        if rows == 0 {
            assert!(qkv.is_empty() && out.is_empty(), "attention of no rows");
            return;
        }
        let width = out.len() / rows;
        assert!(heads > 0 && width.is_multiple_of(heads), "{width} numbers in {heads} heads");
        assert_eq!(
            (out.len(), qkv.len()),
            (rows * width, 3 * rows * width),
            "attention of {rows} rows by {width}"
        );
        if width == 0 {
            return;
        }
        let needed = attention::scratch(rows, width, heads);
        if scratch.len() < needed {
            scratch.resize(needed, 0.0);
        }
        let scratch = &mut scratch[..needed];
        self.processor.run(Attention { qkv, rows, width, heads, scratch, sink: Sink::new(out) });
    }

    /// A convolution of 3x3 with a border of one pixel of the code `zero`: `[channels][height][width]` becomes
    /// `[outputs][height][width]`, see [`ConvShape::output`].
    ///
    /// # Panics
    /// If the stride is neither 1 nor 2, or `input`, `weights`, `affine` or `out` does not fit.
    #[expect(clippy::too_many_arguments)]
    pub fn conv3x3(
        &self,
        input: &[u8],
        shape: ConvShape,
        weights: &PackedConv,
        zero: u8,
        affine: Affine<'_>,
        quant: Quant,
        out: &mut [u8],
    ) {
        let ConvShape { channels, height, width, stride } = shape;
        assert!(stride == 1 || stride == 2, "a stride of {stride}");
        assert_eq!(input.len(), channels * height * width, "{channels} channels of {height} x {width}");
        assert_eq!(weights.channels(), channels, "kernels of {channels} channels");
        assert_affine(&affine, weights.outputs());
        let (rows, columns) = shape.output();
        assert_eq!(
            out.len(),
            weights.outputs() * rows * columns,
            "{} outputs of {rows} x {columns}",
            weights.outputs()
        );
        BORDERED.with_borrow_mut(|bordered| {
            self.processor.run(Conv { input, shape, weights, zero, affine, quant, out, bordered });
        });
    }

    /// The greatest code of each square of `size` by `size`: `[channels][height][width]` becomes
    /// `[channels][height / size][width / size]`; rows and columns beyond whole squares are left out.
    ///
    /// # Panics
    /// If `size` is 0, or `input` or `out` does not fit.
    pub fn max_pool(
        &self,
        input: &[u8],
        channels: usize,
        height: usize,
        width: usize,
        size: usize,
        out: &mut [u8],
    ) {
        assert!(size > 0, "squares of no pixel");
        assert_eq!(input.len(), channels * height * width, "{channels} channels of {height} x {width}");
        let (rows, columns) = (height / size, width / size);
        assert_eq!(out.len(), channels * rows * columns, "{channels} outputs of {rows} x {columns}");
        if !out.is_empty() {
            self.processor.run(MaxPool { input, height, width, size, out });
        }
    }

    /// The mean of all rows of `input`, `[rows][width]`: `[width]`; of no rows, NaN.
    ///
    /// # Panics
    /// If `width` is 0, `input` is not whole rows, or `out` is not `width` long.
    pub fn mean_rows(&self, input: &[f32], width: usize, out: &mut [f32]) {
        assert!(width > 0 && input.len().is_multiple_of(width), "{} inputs in rows of {width}", input.len());
        assert_eq!(out.len(), width, "means of {width} columns");
        self.processor.run(MeanRows { input, width, sink: Sink::new(Out::F32(out)) });
    }
}

fn assert_affine(affine: &Affine<'_>, n: usize) {
    assert_eq!((affine.scale.len(), affine.bias.len()), (n, n), "scale and bias of {n} outputs");
    assert!((0.0..=1.0).contains(&affine.leak), "a slope of {}", affine.leak);
}
