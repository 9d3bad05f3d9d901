//! Instructions that a frame takes on the bridge, stage by stage, as formulas in the profile's numbers.
//!
//! The stages are those of `firmware/boards/qemu-an500/instructions.tsv`. Each is a sum of few terms whose factors follow
//! from the loops of the code; the factors were fitted, by least squares of the relative errors, to that table and to
//! `measured.tsv`: the same image (`src/bin/stages.rs`) given eleven profiles in place of its two. Like the tables they
//! hold for the reference's scene, in which three scatterers move or rest; a livelier one adds to `covariance`.

use rfhoi_shared::radar::{RadarProfile, RangeGate};

/// Instructions of one frame by stage.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize)]
pub struct Instructions {
    /// Datagrams to rows of samples.
    pub reassembly: f64,
    /// Words to numbers, times the window.
    pub unpack_window: f64,
    /// FFTs over samples.
    pub range_fft: f64,
    /// Gated bins into the cube.
    pub store: f64,
    /// FFTs over loops.
    pub doppler_fft: f64,
    /// Clutter off, power, codes of both maps.
    pub clutter_maps: f64,
    /// Moving cells.
    pub covariance: f64,
    /// Maps into packets.
    pub packets: f64,
    /// All that is no stage: the network, mostly.
    pub network: f64,
}

impl Instructions {
    /// Those of a frame of `profile` with `gate`, received as DCA1000 datagrams.
    pub fn of(profile: &RadarProfile, gate: RangeGate) -> Self {
        let virtuals = profile.virtual_count() as f64;
        let slots = profile.tx_slots() as f64;
        let samples = f64::from(profile.samples);
        let loops = f64::from(profile.loops);
        let bins = f64::from(gate.bins);
        let rows = loops * virtuals;
        let datagrams = profile.datagrams_per_frame();
        // Loops and columns of the range-time map.
        let codes = loops + loops.min(8.0);
        Self {
            // A row that a datagram's end cuts is copied.
            reassembly: 82.7 * rows + 1.329 * datagrams * f64::from(profile.row_bytes()),
            unpack_window: 15.78 * rows * samples,
            range_fft: rows * fft(samples),
            store: rows * (21.83 * bins + 159.5),
            doppler_fft: bins * virtuals * fft(loops),
            // Spectra of all antennas; power over time of the first receiver of each transmitter; codes.
            clutter_maps: bins * (virtuals * (15.46 * loops + 331.4) + (29.83 * slots + 29.67) * loops),
            covariance: 13.7 * bins * loops + 990.0 * virtuals * virtuals,
            packets: 32.39 * bins * codes + 16_363.0,
            network: 1_921.0 * datagrams,
        }
    }

    /// Each stage by name.
    pub fn stages(&self) -> [(&'static str, f64); 9] {
        [
            ("reassembly", self.reassembly),
            ("unpack_window", self.unpack_window),
            ("range_fft", self.range_fft),
            ("store", self.store),
            ("doppler_fft", self.doppler_fft),
            ("clutter_maps", self.clutter_maps),
            ("covariance", self.covariance),
            ("packets", self.packets),
            ("network", self.network),
        ]
    }

    /// All of them.
    pub fn total(&self) -> f64 {
        self.stages().iter().map(|(_, count)| count).sum()
    }
}

/// microfft's complex FFT of `n` points: butterflies, less what its first passes save.
fn fft(n: f64) -> f64 {
    n * (10.6 * libm::log2(n) - 17.4)
}

#[cfg(test)]
mod tests {
    use rfhoi_shared::units::Metres;

    use super::*;

    /// Of each stage that takes a twentieth of a frame or more, and of their sum, at most.
    const STAGE_ERROR: f64 = 0.02;
    const SUM_ERROR: f64 = 0.01;
    /// The same where frames are unlike those that ship: few loops, few antennas, long rows.
    const OTHER_STAGE_ERROR: f64 = 0.08;
    const OTHER_SUM_ERROR: f64 = 0.035;

    /// Largest error of a stage that counts, and error of the sum of those measured.
    fn errors(model: &Instructions, measured: &[(&str, f64)]) -> (f64, f64) {
        let model = model.stages();
        let sum: f64 = measured.iter().map(|(_, count)| count).sum();
        let pairs = measured.iter().map(|&(name, count)| {
            let (_, modelled) = model.iter().find(|(stage, _)| *stage == name).unwrap();
            (*modelled, count)
        });
        let worst = pairs.clone().filter(|(_, count)| *count > sum / 20.0);
        let worst = worst.map(|(modelled, count)| (modelled / count - 1.0).abs()).fold(0.0, f64::max);
        (worst, pairs.map(|(modelled, _)| modelled).sum::<f64>() / sum - 1.0)
    }

    #[test]
    fn the_model_is_what_the_image_takes() {
        let table = include_str!("../../../firmware/boards/qemu-an500/instructions.tsv");
        for (column, profile) in [(1, RadarProfile::bridge()), (2, RadarProfile::fine())] {
            let model = Instructions::of(&profile, profile.gate_to(Metres(3.05)));
            let rows = table.lines().skip(1).map(|line| {
                let cells: Vec<&str> = line.split('\t').collect();
                (cells[0], cells[column].parse::<f64>().unwrap())
            });
            let all = rows.clone().find(|(name, _)| *name == "all").unwrap().1;
            let stages: Vec<_> =
                rows.filter(|(name, _)| model.stages().iter().any(|(stage, _)| stage == name)).collect();
            assert_eq!(stages.len(), model.stages().len());
            let (stage, _) = errors(&model, &stages);
            let sum = model.total() / all - 1.0;
            println!("{} loops: stage {:.1} %, sum {:+.2} %", profile.loops, 100.0 * stage, 100.0 * sum);
            assert!(stage < STAGE_ERROR && sum.abs() < SUM_ERROR, "{stage} {sum}");
        }
    }

    #[test]
    fn it_holds_for_other_profiles_too() {
        let mut lines = include_str!("measured.tsv").lines();
        let names: Vec<&str> = lines.next().unwrap().split('\t').collect();
        for line in lines {
            let cells: Vec<f64> = line.split('\t').map(|cell| cell.parse().unwrap()).collect();
            let [samples, loops, transmitters, receivers, bins] = cells[..5].try_into().unwrap();
            let profile = RadarProfile {
                samples: samples as u16,
                loops: loops as u16,
                tx_order: [1, 2, 4].into_iter().take(transmitters as usize).collect(),
                rx_mask: (1 << receivers as u8) - 1,
                ..RadarProfile::paper()
            };
            let model = Instructions::of(&profile, RangeGate { first: 0, bins: bins as u16 });
            let measured: Vec<_> = names[5..].iter().copied().zip(cells[5..].iter().copied()).collect();
            let (stage, sum) = errors(&model, &measured);
            println!("{:?}: stage {:.1} %, sum {:+.2} %", &cells[..5], 100.0 * stage, 100.0 * sum);
            assert!(stage < OTHER_STAGE_ERROR && sum.abs() < OTHER_SUM_ERROR, "{line}");
        }
    }
}
