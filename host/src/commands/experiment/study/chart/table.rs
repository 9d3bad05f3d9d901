//! The chart as numbers and words.

use std::path::Path;

use anyhow::Context;
use rfhoi::atomic;
use serde::Serialize;

use super::Way;
use super::cost::Cost;
use super::points::Varied;
use crate::commands::experiment::stages::{OfNetwork, Stages};
use crate::commands::experiment::study::table::Mean;

/// Points of accuracy, percent, that are given for speed without asking.
const WORTH: f64 = 1.0;

/// All of it.
#[derive(Debug, Clone, Serialize)]
pub(super) struct Chart {
    pub(super) simulated: bool,
    /// Of the int8 rows, as this processor has them.
    pub(super) kernels: String,
    pub(super) rows: Vec<Row>,
}

/// A whole configuration.
#[derive(Debug, Clone, Serialize)]
pub(super) struct Row {
    pub(super) name: String,
    pub(super) varied: Option<Varied>,
    pub(super) default: bool,
    pub(super) precision: String,
    pub(super) backend: String,
    pub(super) hoi: Mean,
    pub(super) parameters: usize,
    pub(super) map_points: usize,
    pub(super) angle: String,
    pub(super) antennas: usize,
    pub(super) cost: Cost,
    pub(super) stages: Stages,
    pub(super) network: OfNetwork,
    /// From the last packet to the answer.
    pub(super) host_ms: f64,
}

impl Chart {
    /// Rows in int8, by rising time.
    fn fast(&self) -> Vec<&Row> {
        let mut rows: Vec<&Row> =
            self.rows.iter().filter(|row| row.precision == Way::Int8.precision()).collect();
        rows.sort_by(|a, b| a.host_ms.total_cmp(&b.host_ms));
        rows
    }

    /// Why the default is the default and what it gives up, from the rows.
    pub(super) fn sentence(&self) -> String {
        let fast = self.fast();
        let best = fast.iter().max_by(|a, b| a.hoi.mean.total_cmp(&b.hoi.mean));
        let (Some(default), Some(best), Some(fastest)) =
            (fast.iter().find(|row| row.default), best, fast.first())
        else {
            return "There is nothing to compare.".to_owned();
        };
        let worth = |row: &&&Row| row.hoi.mean >= best.hoi.mean - WORTH;
        let least = fast.iter().find(worth).unwrap_or(best);
        let times = |row: &Row| row.host_ms / default.host_ms;
        let apart = if best.hoi.low > default.hoi.high || default.hoi.low > best.hoi.high {
            "their intervals are apart"
        } else {
            "their intervals overlap"
        };
        let mut text = format!(
            "The default answers {:.2} ms after the last packet, with a HOI accuracy of {} %. ",
            default.host_ms, default.hoi
        );
        text.push_str(&if best.default {
            "No other configuration is more accurate. ".to_owned()
        } else {
            format!(
                "It gives up {:.1} points against the most accurate, `{}`, which takes {:.1} times as long ({apart}). ",
                best.hoi.mean - default.hoi.mean,
                best.name,
                times(best)
            )
        });
        text.push_str(&if least.default {
            format!("It is the fastest of those within {WORTH} point of the most accurate, and that is why it is the default. ")
        } else {
            format!(
                "The fastest within {WORTH} point of the most accurate is `{}`, in {:.2} of the default's time ({} %). ",
                least.name,
                times(least),
                least.hoi
            )
        });
        text.push_str(&format!(
            "The fastest of all, `{}`, takes {:.2} of its time for {} %.",
            fastest.name,
            times(fastest),
            fastest.hoi
        ));
        text
    }

    pub(super) fn write(&self, out: &Path) -> anyhow::Result<()> {
        atomic::write(out.join("chart.json"), &serde_json::to_vec_pretty(self)?)?;
        let mut csv = csv::Writer::from_writer(Vec::new());
        for row in &self.rows {
            csv.serialize(Line::from(row))?;
        }
        atomic::write(out.join("chart.csv"), &csv.into_inner().context("cannot write the table")?)?;
        Ok(atomic::write(out.join("chart.md"), self.page().as_bytes())?)
    }

    /// For people: the sentence and all rows.
    pub(super) fn text(&self) -> String {
        let mut text = format!(
            "{:<28} {:<20} {:>22} {:>9} {:>12} {:>12}\n",
            "(simulated)", "", "HOI, %", "host, ms", "MCU, million", "link, kB/s"
        );
        for row in &self.rows {
            let [name, way, hoi, host, mcu, link] = row.cells();
            text.push_str(&format!("{name:<28} {way:<20} {hoi:>22} {host:>9} {mcu:>12} {link:>12}\n"));
        }
        text.push('\n');
        text.push_str(&self.sentence());
        text
    }

    fn page(&self) -> String {
        let heads = [
            "",
            "runs on",
            "HOI, %",
            "host, ms",
            "bridge, million instructions a frame",
            "to the host, kB/s",
        ];
        let mut page = format!(
            "{}\n\nint8 on {}. Host: from the last packet to the answer, one thread, medians of rounds over all configurations, on a simulated recording of 6 s.\n\n|{}|\n|{}\n",
            self.sentence(),
            self.kernels,
            heads.join("|"),
            "---|".repeat(heads.len())
        );
        for row in &self.rows {
            page.push_str(&format!("|{}|\n", row.cells().join("|")));
        }
        page
    }
}

impl Row {
    fn cells(&self) -> [String; 6] {
        [
            self.name.clone(),
            format!("{}, {}", self.precision, self.backend),
            self.hoi.to_string(),
            format!("{:.2}", self.host_ms),
            format!("{:.2}", self.cost.mcu_instructions / 1e6),
            format!("{:.1}", self.cost.host_link_bytes_s / 1e3),
        ]
    }
}

/// A row of the CSV.
#[derive(Serialize)]
struct Line<'a> {
    name: &'a str,
    precision: &'a str,
    backend: &'a str,
    map_points: usize,
    angle: &'a str,
    antennas: usize,
    parameters: usize,
    hoi_percent: f64,
    hoi_low: f64,
    hoi_high: f64,
    runs: usize,
    samples: u32,
    host_ms: f64,
    receive_ms: f64,
    radar_ms: f64,
    reads_ms: f64,
    features_ms: f64,
    network_frame_ms: f64,
    answer_ms: f64,
    mcu_instructions: f64,
    radar_link_bytes_s: f64,
    host_link_bytes_s: f64,
}

impl<'a> From<&'a Row> for Line<'a> {
    fn from(row: &'a Row) -> Self {
        let Row { hoi, cost, stages, network, .. } = row;
        Self {
            name: &row.name,
            precision: &row.precision,
            backend: &row.backend,
            map_points: row.map_points,
            angle: &row.angle,
            antennas: row.antennas,
            parameters: row.parameters,
            hoi_percent: hoi.mean,
            hoi_low: hoi.low,
            hoi_high: hoi.high,
            runs: hoi.runs,
            samples: hoi.samples,
            host_ms: row.host_ms,
            receive_ms: stages.receive_ms,
            radar_ms: stages.radar_ms,
            reads_ms: stages.reads_ms,
            features_ms: stages.features_ms,
            network_frame_ms: network.frame_ms,
            answer_ms: network.answer_ms,
            mcu_instructions: cost.mcu_instructions,
            radar_link_bytes_s: cost.radar_link_bytes_s,
            host_link_bytes_s: cost.host_link_bytes_s,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(name: &str, host_ms: f64, mean: f64, default: bool) -> Row {
        let hoi = Mean { mean, low: mean - 1.0, high: mean + 1.0, runs: 1, samples: 1_000 };
        let stages = Stages { receive_ms: 0.1, radar_ms: 0.0, reads_ms: 0.0, features_ms: 0.0 };
        Row {
            name: name.into(),
            varied: None,
            default,
            precision: "int8".into(),
            backend: "own kernels".into(),
            hoi,
            parameters: 1,
            map_points: 32,
            angle: "bartlett".into(),
            antennas: 4,
            cost: Cost { mcu_instructions: 1e6, radar_link_bytes_s: 1e6, host_link_bytes_s: 1e3 },
            stages,
            network: OfNetwork { frame_ms: 0.0, answer_ms: host_ms - 0.1, window_frames: 60 },
            host_ms,
        }
    }

    fn sentence(rows: [(&str, f64, f64); 3]) -> String {
        let rows = rows.map(|(name, ms, hoi)| row(name, ms, hoi, name == "default")).into();
        Chart { simulated: true, kernels: "avx2".into(), rows }.sentence()
    }

    #[test]
    fn what_the_default_gives_up_follows_from_the_rows() {
        let wins = sentence([("default", 1.0, 95.0), ("slow", 4.0, 95.5), ("fast", 0.5, 90.0)]);
        assert!(
            wins.contains("gives up 0.5 points against the most accurate, `slow`, which takes 4.0 times")
        );
        assert!(wins.contains("their intervals overlap") && wins.contains("that is why it is the default"));
        assert!(
            wins.ends_with("The fastest of all, `fast`, takes 0.50 of its time for 90.0 [89.0, 91.0] %.")
        );
        let loses = sentence([("default", 1.0, 90.0), ("slow", 4.0, 95.5), ("fast", 0.5, 95.0)]);
        assert!(loses.contains("their intervals are apart"), "{loses}");
        assert!(
            loses.contains("within 1 point of the most accurate is `fast`, in 0.50 of the default's time")
        );
        let best = sentence([("default", 1.0, 96.0), ("slow", 4.0, 95.5), ("fast", 0.5, 90.0)]);
        assert!(best.contains("No other configuration is more accurate."), "{best}");
    }

    #[test]
    fn the_median_round_of_each_configuration_counts() {
        let round =
            |times: [f64; 2]| ["a", "b"].into_iter().zip(times).map(|(name, ms)| row(name, ms, 90.0, false));
        let rows: Vec<Row> = [[3.0, 1.0], [1.0, 9.0], [2.0, 2.0]].into_iter().flat_map(round).collect();
        let medians = super::super::medians(rows, 3);
        let times: Vec<_> = medians.iter().map(|row| (row.name.as_str(), row.host_ms)).collect();
        assert_eq!(times, [("a", 2.0), ("b", 2.0)]);
    }

    #[test]
    fn the_csv_has_a_column_for_every_number() {
        let folder = tempfile::tempdir().unwrap();
        let rows = vec![row("default", 1.0, 95.0, true)];
        let chart = Chart { simulated: true, kernels: "avx2".into(), rows };
        chart.write(folder.path()).unwrap();
        let text = std::fs::read_to_string(folder.path().join("chart.csv")).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), 2);
        assert_eq!(lines[0].split(',').count(), lines[1].split(',').count());
        assert!(lines[0].starts_with("name,precision,backend,map_points"));
    }
}
