//! Every level and number of threads against plain references: bit for bit where numbers are integers in the end, and to the
//! same bytes among each other everywhere.

use std::sync::LazyLock;

use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::select;
use rfhoi_int8::{Affine, ConvShape, Kernels, Level, NARROW, Out, Packed, PackedConv, Quant, SMALL};

/// Each level that this processor has, on one to three threads.
static KERNELS: LazyLock<Vec<Kernels>> = LazyLock::new(|| {
    let levels = Level::ALL.into_iter().filter_map(Kernels::new);
    levels.flat_map(|kernels| (1..=3).map(move |threads| kernels.clone().with_threads(threads))).collect()
});

/// Runs `kernel` on all of them; what they all give.
fn same_everywhere<T: PartialEq + std::fmt::Debug>(kernel: impl Fn(&Kernels) -> Vec<T>) -> Vec<T> {
    let mut results = KERNELS.iter().map(|kernels| (kernels, kernel(kernels)));
    let (_, first) = results.next().expect("the plain level");
    for (kernels, result) in results {
        assert_eq!(result, first, "{} on {} threads", kernels.level(), kernels.threads());
    }
    first
}

/// The same for floats, by their bits.
fn same_bits(kernel: impl Fn(&Kernels) -> Vec<f32>) -> Vec<f32> {
    let bits = same_everywhere(|kernels| kernel(kernels).into_iter().map(f32::to_bits).collect());
    bits.into_iter().map(f32::from_bits).collect()
}

/// Numbers that look random, from a seed.
fn noise(seed: u64) -> impl FnMut() -> u64 {
    let mut state = seed.wrapping_mul(2).wrapping_add(1);
    move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        state >> 33
    }
}

/// Numbers about 0, to about `spread` either way.
fn floats(count: usize, seed: u64, spread: f32) -> Vec<f32> {
    let mut noise = noise(seed);
    (0..count).map(|_| (noise() % 20_001) as f32 / 10_000.0 * spread - spread).collect()
}

/// Codes up to `top` and weights: extremes alone, where sums of two or four products are the largest that fit 16 bits or the first
/// that do not, or anything.
fn codes(count: usize, seed: u64, extreme: bool, top: u8) -> Vec<u8> {
    let mut noise = noise(seed);
    (0..count)
        .map(|_| {
            if extreme {
                [0, top, top, top][noise() as usize % 4]
            } else {
                (noise() % (u64::from(top) + 1)) as u8
            }
        })
        .collect()
}

/// The largest amounts of weights: of all, of narrow ones, and the first that is not.
const LARGEST: [i8; 3] = [127, NARROW, NARROW + 1];
/// The same of inputs.
const TOPS: [u8; 3] = [255, SMALL, SMALL + 1];

fn weights(count: usize, seed: u64, extreme: bool, largest: i8) -> Vec<i8> {
    let mut noise = noise(seed ^ 77);
    let sign = if noise().is_multiple_of(2) { largest } else { -largest };
    let steps = 2 * u64::from(largest.unsigned_abs()) + 1;
    let mut draw = || {
        let any = (noise() % steps) as i16 - i16::from(largest);
        if extreme { [sign, sign, sign, -sign][noise() as usize % 4] } else { any as i8 }
    };
    (0..count).map(|_| draw()).collect()
}

fn affine_reference(sum: i32, scale: f32, bias: f32, leak: f32) -> f32 {
    let y = sum as f32 * scale + bias;
    if y >= 0.0 { y } else { y * leak }
}

fn quantise_reference(y: f32, quant: Quant) -> u8 {
    let steps = (y * quant.inverse).round_ties_even();
    let code = (steps + f32::from(quant.zero)).clamp(0.0, quant.top.into());
    if steps.is_nan() { quant.zero } else { code as u8 }
}

struct Product {
    rows: usize,
    k: usize,
    n: usize,
    input: Vec<u8>,
    weights: Vec<i8>,
    scale: Vec<f32>,
    bias: Vec<f32>,
    leak: f32,
    top: u8,
}

impl Product {
    /// `[rows][k]` by `[k][n]`, of extremes alone or not, weights up to `largest`, inputs up to `top`.
    fn new([rows, k, n]: [usize; 3], seed: u64, (extreme, largest, top): (bool, i8, u8), leak: f32) -> Self {
        let scale = floats(n, seed + 1, 1e-3);
        let bias = floats(n, seed + 2, 2.0);
        Self {
            rows,
            k,
            n,
            input: codes(rows * k, seed, extreme, top),
            weights: weights(k * n, seed, extreme, largest),
            scale,
            bias,
            leak,
            top,
        }
    }

    fn reference(&self) -> Vec<f32> {
        let mut y = Vec::new();
        for row in 0..self.rows {
            for output in 0..self.n {
                let mut sum = 0;
                for at in 0..self.k {
                    sum += i32::from(self.input[row * self.k + at])
                        * i32::from(self.weights[output * self.k + at]);
                }
                y.push(affine_reference(sum, self.scale[output], self.bias[output], self.leak));
            }
        }
        y
    }

    /// Floats, floats added to those of `before`, and codes, of all levels and numbers of threads, against the reference.
    fn check(&self, quant: Quant) {
        let want = self.reference();
        let packed = Packed::new(self.k, self.n, &self.weights).for_inputs_to(self.top);
        let affine = Affine { scale: &self.scale, bias: &self.bias, leak: self.leak };
        let floats_got = same_bits(|kernels| {
            let mut y = vec![f32::NAN; self.rows * self.n];
            kernels.linear(&self.input, self.rows, &packed, affine, Out::F32(&mut y));
            y
        });
        assert_eq!(floats_got, want);
        let before = floats(want.len(), 3, 1.0);
        let added = same_bits(|kernels| {
            let mut y = before.clone();
            kernels.linear(&self.input, self.rows, &packed, affine, Out::Add(&mut y));
            y
        });
        assert!(added.iter().zip(before.iter().zip(&want)).all(|(got, (before, y))| *got == before + y));
        let codes = same_everywhere(|kernels| {
            let mut y = vec![77; self.rows * self.n];
            kernels.linear(&self.input, self.rows, &packed, affine, Out::U8(&mut y, quant));
            y
        });
        assert!(codes.iter().zip(&want).all(|(&got, &y)| got == quantise_reference(y, quant)));
    }
}

fn quants() -> impl Strategy<Value = Quant> {
    let tops = select(vec![255, SMALL, 10]);
    (0.01f32..200.0, any::<u8>(), tops).prop_map(|(inverse, zero, top)| Quant {
        inverse,
        zero: zero.min(top),
        top,
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn linear(
        rows in 1usize..=70,
        k in prop_oneof![1usize..=70, select(vec![64usize, 128, 129, 255, 257])],
        n in prop_oneof![select(vec![1usize, 15, 16, 17, 31, 32, 64, 65, 127, 128, 129, 150]), 1usize..=70],
        seed in any::<u32>(),
        extreme in any::<bool>(),
        largest in select(&LARGEST[..]),
        top in select(&TOPS[..]),
        leak in select(vec![1.0f32, 0.01, 0.0]),
        quant in quants(),
    ) {
        Product::new([rows, k, n], seed.into(), (extreme, largest, top), leak).check(quant);
    }

    #[test]
    fn conv3x3(
        channels in 1usize..=5,
        outputs in 1usize..=6,
        height in 1usize..=20,
        width in prop_oneof![1usize..=40, select(vec![63usize, 64, 65, 128, 129, 150])],
        stride in 1usize..=2,
        seed in any::<u32>(),
        extreme in any::<bool>(),
        largest in select(&LARGEST[..]),
        leak in select(vec![1.0f32, 0.01]),
        zero in any::<u8>(),
        quant in quants(),
    ) {
        let seed = seed.into();
        let shape = ConvShape { channels, height, width, stride };
        let input = codes(channels * height * width, seed, extreme, 255);
        let kernels_3x3 = weights(outputs * channels * 9, seed, extreme, largest);
        let (scale, bias) = (floats(outputs, seed + 1, 1e-3), floats(outputs, seed + 2, 2.0));
        let mut want = Vec::new();
        let (rows, columns) = (1 + (height - 1) / stride, 1 + (width - 1) / stride);
        for output in 0..outputs {
            for (row, column) in (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column))) {
                let mut sum = 0;
                for channel in 0..channels {
                    for (y, x) in (0..3).flat_map(|y| (0..3).map(move |x| (y, x))) {
                        let (at_y, at_x) = ((row * stride + y).wrapping_sub(1), (column * stride + x).wrapping_sub(1));
                        let inside = at_y < height && at_x < width;
                        let code = if inside { input[(channel * height + at_y) * width + at_x] } else { zero };
                        sum += i32::from(code) * i32::from(kernels_3x3[((output * channels + channel) * 3 + y) * 3 + x]);
                    }
                }
                want.push(quantise_reference(affine_reference(sum, scale[output], bias[output], leak), quant));
            }
        }
        assert_eq!(shape.output(), (rows, columns));
        let packed = PackedConv::new(outputs, channels, &kernels_3x3);
        let affine = Affine { scale: &scale, bias: &bias, leak };
        let got = same_everywhere(|kernels| {
            let mut out = vec![77; outputs * rows * columns];
            kernels.conv3x3(&input, shape, &packed, zero, affine, quant, &mut out);
            out
        });
        prop_assert_eq!(got, want);
    }

    #[test]
    fn max_pool(
        channels in 1usize..=3,
        height in 1usize..=40,
        width in prop_oneof![1usize..=40, 60usize..=140],
        size in prop_oneof![select(vec![2usize, 4, 8]), 1usize..=9],
        seed in any::<u32>(),
    ) {
        let input = codes(channels * height * width, seed.into(), false, 255);
        let (rows, columns) = (height / size, width / size);
        let mut want = Vec::new();
        for channel in 0..channels {
            for (row, column) in (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column))) {
                let at = |y, x| input[(channel * height + row * size + y) * width + column * size + x];
                let square = (0..size).flat_map(|y| (0..size).map(move |x| (y, x)));
                want.push(square.map(|(y, x)| at(y, x)).max().expect("a pixel"));
            }
        }
        let got = same_everywhere(|kernels| {
            let mut out = vec![77; channels * rows * columns];
            kernels.max_pool(&input, channels, height, width, size, &mut out);
            out
        });
        prop_assert_eq!(got, want);
    }

    #[test]
    fn quantise(input in vec(any::<f32>(), 0..100), quant in quants()) {
        let want: Vec<_> = input.iter().map(|&y| quantise_reference(y, quant)).collect();
        let got = same_everywhere(|kernels| {
            let mut out = vec![77; input.len()];
            kernels.quantise(&input, quant, &mut out);
            out
        });
        prop_assert_eq!(got, want);
    }

    #[test]
    fn layer_norm(rows in 0usize..=9, width in 1usize..=150, seed in any::<u32>(), offset in -3.0f32..3.0) {
        let seed = seed.into();
        let input: Vec<_> = floats(rows * width, seed, 2.0).into_iter().map(|x| x + offset).collect();
        let (gamma, beta) = (floats(width, seed + 1, 2.0), floats(width, seed + 2, 2.0));
        let got = same_bits(|kernels| {
            let mut out = vec![f32::NAN; input.len()];
            kernels.layer_norm(&input, width, &gamma, &beta, 1e-5, Out::F32(&mut out));
            out
        });
        for (got, x) in got.chunks(width).zip(input.chunks(width)) {
            let mean = x.iter().map(|&x| f64::from(x)).sum::<f64>() / width as f64;
            let variance = x.iter().map(|&x| (f64::from(x) - mean).powi(2)).sum::<f64>() / width as f64;
            let deviation = (variance + 1e-5).sqrt();
            for (&got, (&x, (&gamma, &beta))) in got.iter().zip(x.iter().zip(gamma.iter().zip(&beta))) {
                let want = (f64::from(x) - mean) / deviation * f64::from(gamma) + f64::from(beta);
                // A row of one number has no deviation but epsilon's, and its mean's last bit is large in units of that.
                let bound = 1e-5 + 2e-6 / deviation;
                prop_assert!((f64::from(got) - want).abs() < bound, "{} for {}", got, want);
            }
        }
        let quant = Quant { inverse: 30.0, zero: 100, top: 255 };
        let codes = same_everywhere(|kernels| {
            let mut out = vec![77; input.len()];
            kernels.layer_norm(&input, width, &gamma, &beta, 1e-5, Out::U8(&mut out, quant));
            out
        });
        prop_assert!(codes.iter().zip(&got).all(|(&code, &y)| code == quantise_reference(y, quant)));
    }

    #[test]
    fn attention(rows in 0usize..=40, heads in 1usize..=3, d in 1usize..=70, seed in any::<u32>(), spread in 0.1f32..4.0) {
        let width = heads * d;
        let qkv = floats(rows * 3 * width, seed.into(), spread);
        let got = same_bits(|kernels| {
            let mut out = vec![f32::NAN; rows * width];
            // What is left of another call must not matter.
            let mut scratch = vec![f32::NAN; 1000];
            kernels.attention(&qkv, rows, heads, &mut scratch, Out::F32(&mut out));
            out
        });
        let at = |row: usize, part: usize, head: usize, i: usize| f64::from(qkv[(row * 3 + part) * width + head * d + i]);
        for (head, row) in (0..heads).flat_map(|head| (0..rows).map(move |row| (head, row))) {
            let score = |key| (0..d).map(|i| at(row, 0, head, i) * at(key, 1, head, i)).sum::<f64>() / (d as f64).sqrt();
            let scores: Vec<_> = (0..rows).map(score).collect();
            let greatest = scores.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let powers: Vec<_> = scores.iter().map(|score| (score - greatest).exp()).collect();
            let total: f64 = powers.iter().sum();
            for i in 0..d {
                let want = (0..rows).map(|key| powers[key] / total * at(key, 2, head, i)).sum::<f64>();
                let got = f64::from(got[row * width + head * d + i]);
                prop_assert!((got - want).abs() < 2e-5 * f64::from(spread) * f64::from(1.0 + spread * spread), "{} for {}", got, want);
            }
        }
    }

    #[test]
    fn rows(rows in 1usize..=40, width in 1usize..=70, seed in any::<u32>()) {
        let (x, y) = (floats(rows * width, seed.into(), 3.0), floats(rows * width, u64::from(seed) + 1, 3.0));
        let added = same_bits(|kernels| {
            let mut x = x.clone();
            kernels.add_rows(&mut x, &y);
            x
        });
        prop_assert!(added.iter().zip(x.iter().zip(&y)).all(|(&got, (x, y))| got == x + y));
        let means = same_bits(|kernels| {
            let mut out = vec![f32::NAN; width];
            kernels.mean_rows(&x, width, &mut out);
            out
        });
        for (column, &got) in means.iter().enumerate() {
            let want = x.iter().skip(column).step_by(width).map(|&x| f64::from(x)).sum::<f64>() / rows as f64;
            prop_assert!((f64::from(got) - want).abs() < 1e-5, "{} for {}", got, want);
        }
    }
}

/// Large enough that threads share it; every row and panel remainder among them.
#[test]
fn products_that_threads_share() {
    for (rows, k, n) in [(450, 128, 300), (1, 1027, 2080), (64, 1024, 1030)] {
        for numbers in [(false, 127, 255), (true, 127, 255), (true, NARROW, 255), (true, NARROW, SMALL)] {
            Product::new([rows, k, n], 5, numbers, 0.01).check(Quant { inverse: 10.0, zero: 128, top: 255 });
        }
    }
}

#[test]
fn parts_that_threads_share_are_each_done_once() {
    for kernels in KERNELS.iter() {
        let mut parts: Vec<Vec<u8>> = (0..9).map(|number| vec![0; 8 * number]).collect();
        kernels.share(&mut parts, |part| {
            let values: Vec<f32> = (0..part.len()).map(|value| value as f32).collect();
            kernels.quantise(&values, Quant { inverse: 1.0, zero: 1, top: u8::MAX }, part);
        });
        for (number, part) in parts.iter().enumerate() {
            assert_eq!(*part, (1..=8 * number as u8).collect::<Vec<_>>(), "{} threads", kernels.threads());
        }
    }
}

#[test]
fn sums_fold_the_zero_point() {
    let numbers = weights(5 * 37, 9, false, 127);
    let packed = Packed::new(37, 5, &numbers);
    let conv = PackedConv::new(5, 4, &weights(5 * 36, 9, false, 127));
    let codes: Vec<_> = codes(37, 3, false, 255);
    for output in 0..5 {
        let row = &numbers[output * 37..][..37];
        let dot = |zero: i32| -> i32 {
            row.iter().zip(&codes).map(|(&w, &u)| i32::from(w) * (i32::from(u) - zero)).sum()
        };
        assert_eq!(dot(90), dot(0) - 90 * packed.sum(output));
        assert_eq!(
            conv.sum(output),
            weights(5 * 36, 9, false, 127)[output * 36..][..36].iter().map(|&w| i32::from(w)).sum()
        );
    }
}

#[test]
fn levels_by_name() {
    for level in Level::ALL {
        assert_eq!(level.name().parse(), Ok(level));
        assert_eq!(Kernels::new(level).map(|kernels| kernels.level()), level.is_available().then_some(level));
    }
    assert!(Level::Plain.is_available());
    assert_eq!(Kernels::best().level(), Level::detect());
    let error = "sse9".parse::<Level>().expect_err("no such level").to_string();
    assert!(error.contains("sse9") && error.contains("avx2"), "{error}");
}

#[test]
#[should_panic(expected = "inputs of 2 rows by 3")]
fn inputs_that_do_not_fit() {
    let affine = Affine { scale: &[1.0], bias: &[0.0], leak: 1.0 };
    Kernels::best().linear(&[1; 5], 2, &Packed::new(3, 1, &[1, 2, 3]), affine, Out::F32(&mut [0.0; 2]));
}

#[test]
#[should_panic(expected = "a stride of 3")]
fn a_stride_that_there_is_not() {
    let affine = Affine { scale: &[1.0], bias: &[0.0], leak: 1.0 };
    let shape = ConvShape { channels: 1, height: 3, width: 3, stride: 3 };
    let quant = Quant { inverse: 1.0, zero: 0, top: 255 };
    Kernels::best().conv3x3(&[0; 9], shape, &PackedConv::new(1, 1, &[1; 9]), 0, affine, quant, &mut [0]);
}
