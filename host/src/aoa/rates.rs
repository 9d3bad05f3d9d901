//! How often the number of sources is right: measured, as a table.

use std::fmt::Write;

use expect_test::expect;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::stability::angle::Scene;

/// Draws of each cell of the table.
const DRAWS: u32 = 400;

/// Share of draws, in percent, in which two sources 40 degrees apart are counted as two, and as more.
fn rates(order: Order, forward_backward: bool, snr_db: f64, snapshots: u32) -> [u32; 2] {
    let profile = RadarProfile::bridge();
    let settings = Settings {
        order,
        forward_backward,
        points: 16,
        largest_order: MAX_PEAKS,
        snapshots_per_cell: 1.0,
        guards: None,
        loading: 0.0,
        ..Settings::default()
    };
    let mut estimator = Estimator::new(&profile, settings).unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let directions = [(-20f64, 5f64), (20.0, -3.0)].map(|(a, e)| (a.to_radians(), e.to_radians()));
    let mut counts = [0; 2];
    for _ in 0..DRAWS {
        let scene = Scene::of(directions.map(|d| (d, snr_db)).to_vec(), snapshots);
        let found = estimator.estimate(&scene.covariance(&profile, &mut rng), snapshots).order;
        counts[0] += u32::from(found == 2);
        counts[1] += u32::from(found > 2);
    }
    counts.map(|count| (100 * count + DRAWS / 2) / DRAWS)
}

#[test]
fn order_selection_rates() {
    let mut table = String::from("snapshots, dB | MDL FB | MDL | AIC FB | AIC (percent right / too many)\n");
    for snapshots in [16, 64] {
        for snr_db in [-15.0, -10.0, -5.0, 0.0, 10.0, 20.0] {
            write!(table, "{snapshots:9} {snr_db:3} ").unwrap();
            for order in [Order::Mdl, Order::Aic] {
                for forward_backward in [true, false] {
                    let [right, more] = rates(order, forward_backward, snr_db, snapshots);
                    write!(table, "| {right:3} / {more:3} ").unwrap();
                }
            }
            table.push('\n');
        }
    }
    expect![[r#"
        snapshots, dB | MDL FB | MDL | AIC FB | AIC (percent right / too many)
               16 -15 |   0 /   0 |   0 /   0 |   1 /   1 |   0 /   0 
               16 -10 |   1 /   0 |   0 /   0 |  14 /   3 |   3 /   2 
               16  -5 |  76 /   1 |  30 /   0 |  83 /  12 |  63 /  13 
               16   0 |  99 /   1 | 100 /   0 |  87 /  13 |  84 /  16 
               16  10 |  99 /   1 | 100 /   0 |  87 /  13 |  85 /  16 
               16  20 |  99 /   1 | 100 /   0 |  86 /  14 |  84 /  16 
               64 -15 |   0 /   0 |   0 /   0 |   7 /   1 |   1 /   0 
               64 -10 |  25 /   0 |   0 /   0 |  82 /   9 |  64 /   3 
               64  -5 | 100 /   0 | 100 /   0 |  89 /  11 |  95 /   5 
               64   0 | 100 /   0 | 100 /   0 |  89 /  11 |  95 /   5 
               64  10 | 100 /   0 | 100 /   0 |  89 /  11 |  95 /   6 
               64  20 | 100 /   0 | 100 /   0 |  89 /  11 |  95 /   6 
    "#]]
    .assert_eq(&table);
}
