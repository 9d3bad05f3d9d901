//! Time and multiplications a second of each kernel, by level and threads: medians of turns in the order of the table, again
//! and again, so that what else the machine does meets all of them. The last column is the time over the plain level's.
//!
//! `cargo bench -p rfhoi-int8 --profile dev [-- [--rounds N] [--level NAME] [WORD OF A NAME]...]`

use std::hint::black_box;
use std::time::Instant;

use rfhoi_int8::{Affine, ConvShape, Kernels, Level, NARROW, Out, Packed, PackedConv, Quant, SMALL};

/// Rows of inputs: one frame's token, six tags', 15 of one tag, 30 and 60 frames, 30 tags of 15.
const ROWS: [usize; 6] = [1, 6, 15, 30, 60, 450];
/// Width of a network and rows, of a transformer layer's products.
const LAYERS: [(usize, usize); 5] = [(64, 120), (128, 30), (128, 60), (1024, 30), (1024, 60)];
/// The same, of attention and norms.
const SEQUENCES: [(usize, usize); 5] = [(64, 20), (128, 30), (128, 60), (1024, 30), (1024, 60)];
/// What a timing takes at least, in seconds: shorter ones are repeated.
const TURN: f64 = 50e-6;
const QUANT: Quant = Quant { inverse: 10.0, zero: 64, top: SMALL };

/// A kernel, or some in a row.
struct Case {
    name: String,
    /// Multiplications.
    products: usize,
    run: Box<dyn FnMut(&Kernels)>,
}

fn main() {
    let mut words = std::env::args().skip(1).filter(|word| word != "--bench");
    let (mut rounds, mut only, mut names) = (30, None, Vec::new());
    while let Some(word) = words.next() {
        match word.as_str() {
            "--rounds" => rounds = words.next().and_then(|n| n.parse().ok()).expect("a number of rounds"),
            "--level" => only = words.next().map(|name| name.parse::<Level>().expect("a level")),
            _ => names.push(word),
        }
    }
    let levels = Level::ALL.into_iter().filter(|&level| only.is_none_or(|only| only == level));
    let kernels: Vec<_> = levels
        .filter_map(Kernels::new)
        .flat_map(|kernels| [1, 2].map(|threads| kernels.clone().with_threads(threads)))
        .collect();
    println!("{:34} {:12} threads  median us    best us    GMAC/s  of plain", "", "level");
    for mut case in cases() {
        if !names.is_empty() && !names.iter().any(|name| case.name.contains(name)) {
            continue;
        }
        let mut times = vec![Vec::new(); kernels.len()];
        for _ in 0..rounds {
            for (kernels, times) in kernels.iter().zip(&mut times) {
                times.push(time(&mut || (case.run)(kernels)));
            }
        }
        times.iter_mut().for_each(|times| times.sort_by(f64::total_cmp));
        for (kernels, sorted) in kernels.iter().zip(&times) {
            let (median, best) = (sorted[rounds / 2], sorted[0]);
            println!(
                "{:34} {:12} {:7} {:10.2} {:10.2} {:9.2} {:9.3}",
                case.name,
                kernels.level(),
                kernels.threads(),
                median * 1e6,
                best * 1e6,
                case.products as f64 / median / 1e9,
                median / times[0][rounds / 2],
            );
        }
    }
}

/// Seconds of one call.
fn time(run: &mut dyn FnMut()) -> f64 {
    let mut calls = 0;
    let start = Instant::now();
    loop {
        run();
        calls += 1;
        let elapsed = start.elapsed().as_secs_f64();
        if elapsed > TURN {
            return elapsed / f64::from(calls);
        }
    }
}

fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for (k, n) in [(128, 384), (128, 512), (512, 128), (1024, 1024), (1024, 3072), (4096, 1024)] {
        cases.extend(ROWS.map(|rows| layer(&format!("linear {rows} x {k} x {n}"), rows, &[(k, n)])));
    }
    cases.extend(LAYERS.map(|(width, rows)| {
        let shapes = [(width, 3 * width), (width, width), (width, 4 * width), (4 * width, width)];
        layer(&format!("layer of {width}, {rows} rows"), rows, &shapes)
    }));
    cases.push(small_maps());
    cases.push(large_maps());
    for (width, rows) in SEQUENCES {
        cases.push(attention(width, rows));
        cases.push(norm(width, rows));
    }
    cases
}

fn codes(count: usize) -> Vec<u8> {
    (0..count).map(|at| (at * 97 % (usize::from(SMALL) + 1)) as u8).collect()
}

/// Narrow, and inputs small, as those of the networks.
fn weights(count: usize) -> Vec<i8> {
    let steps = 2 * NARROW as usize + 1;
    (0..count).map(|at| (at * 89 % steps) as i8 - NARROW).collect()
}

fn floats(count: usize) -> Vec<f32> {
    (0..count).map(|at| (at * 97 % 251) as f32 / 125.0 - 1.0).collect()
}

/// Products of `(k, n)` one after the other, of the same rows.
fn layer(name: &str, rows: usize, shapes: &[(usize, usize)]) -> Case {
    let mut products: Vec<_> = shapes
        .iter()
        .map(|&(k, n)| {
            (
                codes(rows * k),
                Packed::new(k, n, &weights(k * n)).for_inputs_to(SMALL),
                vec![1e-3; n],
                floats(n),
                vec![0; rows * n],
            )
        })
        .collect();
    let run = move |kernels: &Kernels| {
        for (input, weights, scale, bias, out) in &mut products {
            let affine = Affine { scale, bias, leak: 0.01 };
            kernels.linear(black_box(input), rows, weights, affine, Out::U8(out, QUANT));
        }
    };
    let products = shapes.iter().map(|(k, n)| rows * k * n).sum();
    Case { name: name.into(), products, run: Box::new(run) }
}

/// The shipped network's encoder: 32 x 32, one channel to four and to eight, stride 2 each.
fn small_maps() -> Case {
    let shapes = [(1, 32, 4), (4, 16, 8)].map(|(channels, width, outputs)| {
        (
            ConvShape { channels, height: width, width, stride: 2 },
            PackedConv::new(outputs, channels, &weights(outputs * channels * 9)),
        )
    });
    let products = 16 * 16 * 4 * 9 + 8 * 8 * 8 * 36;
    let input = codes(32 * 32);
    let (mut middle, mut out) = (vec![0; 4 * 16 * 16], vec![0; 8 * 8 * 8]);
    let run = move |kernels: &Kernels| {
        let affine = |n| Affine { scale: &[1e-3; 8][..n], bias: &[0.5; 8][..n], leak: 0.01 };
        let [(first, first_weights), (second, second_weights)] = &shapes;
        kernels.conv3x3(black_box(&input), *first, first_weights, 3, affine(4), QUANT, &mut middle);
        kernels.conv3x3(&middle, *second, second_weights, 3, affine(8), QUANT, &mut out);
        black_box(&out);
    };
    Case { name: "maps of 32: 1 to 4 to 8".into(), products, run: Box::new(run) }
}

/// The paper's encoder: 256 x 256, one channel, twice, and the greatest of each 8 x 8.
fn large_maps() -> Case {
    let shape = ConvShape { channels: 1, height: 256, width: 256, stride: 1 };
    let weights = PackedConv::new(1, 1, &weights(9));
    let input = codes(256 * 256);
    let (mut first, mut second, mut out) = (vec![0; 256 * 256], vec![0; 256 * 256], vec![0; 32 * 32]);
    let run = move |kernels: &Kernels| {
        let affine = Affine { scale: &[1e-3], bias: &[0.5], leak: 0.01 };
        kernels.conv3x3(black_box(&input), shape, &weights, 3, affine, QUANT, &mut first);
        kernels.conv3x3(&first, shape, &weights, 3, affine, QUANT, &mut second);
        kernels.max_pool(&second, 1, 256, 256, 8, &mut out);
        black_box(&out);
    };
    Case { name: "maps of 256: 1 to 1 to 1, pool 8".into(), products: 2 * 256 * 256 * 9, run: Box::new(run) }
}

fn attention(width: usize, rows: usize) -> Case {
    let (qkv, mut scratch, mut out) = (floats(rows * 3 * width), Vec::new(), vec![0; rows * width]);
    let run = move |kernels: &Kernels| {
        kernels.attention(black_box(&qkv), rows, 2, &mut scratch, Out::U8(&mut out, QUANT));
    };
    Case {
        name: format!("attention of {width}, {rows} rows"),
        products: 2 * rows * rows * width,
        run: Box::new(run),
    }
}

fn norm(width: usize, rows: usize) -> Case {
    let (input, gamma, beta, mut out) =
        (floats(rows * width), floats(width), floats(width), vec![0; rows * width]);
    let run = move |kernels: &Kernels| {
        kernels.layer_norm(black_box(&input), width, &gamma, &beta, 1e-5, Out::U8(&mut out, QUANT));
    };
    Case {
        name: format!("layer norm of {width}, {rows} rows"),
        products: 3 * rows * width,
        run: Box::new(run),
    }
}
