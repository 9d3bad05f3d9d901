//! Time of one estimate, by grid and method: medians, in the order of the table again and again, so that what else the
//! machine does meets all of them.
//!
//! `cargo bench -p rfhoi --bench aoa --profile dev`

use std::hint::black_box;
use std::time::Instant;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rfhoi::aoa::{Estimator, Method, Settings};
use rfhoi::stability::angle::Scene;
use rfhoi_shared::radar::RadarProfile;

const ROUNDS: usize = 2000;

fn main() {
    let profile = RadarProfile::bridge();
    let scene = Scene::of(vec![((0.3, 0.2), 20.0), ((-0.5, -0.1), 15.0)], 100);
    let covariance = scene.covariance(&profile, &mut ChaCha8Rng::seed_from_u64(1));
    let mut runs = Vec::new();
    for points in [64, 128, 256] {
        for method in [Method::Music, Method::Capon, Method::Bartlett] {
            for forward_backward in [true, false] {
                let settings = Settings { points, method, forward_backward, ..Settings::default() };
                let Ok(estimator) = Estimator::new(&profile, settings) else { continue };
                runs.push((settings, estimator, Vec::with_capacity(ROUNDS)));
            }
        }
    }
    for _ in 0..ROUNDS {
        for (_, estimator, times) in &mut runs {
            let start = Instant::now();
            black_box(estimator.estimate(black_box(&covariance), 100));
            times.push(start.elapsed().as_secs_f64() * 1e6);
        }
    }
    println!("points  method    averaged  median us  fastest us");
    for (settings, _, times) in &mut runs {
        times.sort_by(f64::total_cmp);
        let Settings { points, method, forward_backward, .. } = settings;
        let name = method.to_string();
        println!("{points:6}  {name:8}  {forward_backward:8}  {:9.1}  {:10.1}", times[ROUNDS / 2], times[0]);
    }
}
