//! `rfhoi chart`: speed against accuracy, on the simulated site.
//!
//! ```text
//! [points] configurations --runs of `study`--> models --[cost] on a recording by each radar--> rows
//!   --[table]--> chart.json, chart.csv, chart.md      rows --[picture]--> chart.svg, chart.png
//! ```
//!
//! Each configuration differs from the default in one respect, but for `smallest`, which differs in several. It is trained as the
//! studies train, int8 and f32 are measured on the same samples, and all are timed by turns in one process.

mod cost;
mod picture;
mod points;
mod table;

use anyhow::{Context, ensure};
use rfhoi::recognize;
use rfhoi_int8::Kernels;
use rfhoi_network::execute::Executor;
use rfhoi_network::reference::Reference;
use rfhoi_network::sample::Runner;

use self::cost::Radars;
use self::points::{Point, points};
use self::table::{Chart, Row};
use super::StudyArgs;
use super::plan::Plan;
use super::run::{INT8, Reached};
use super::table::Mean;
use crate::commands::experiment::stages::{ANSWERS, measure, time};
use crate::commands::train::{MODEL, model, names};
use crate::commands::{Progress, listen_for_ctrl_c};

/// Rounds in which all configurations are timed, one after the other: a machine's clock drifts by more than some differ.
const ROUNDS: usize = 9;

/// The same, and answers that are timed, in the quick form.
const QUICK_ROUNDS: usize = 1;
const QUICK_ANSWERS: usize = 2;

/// What runs a network.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Way {
    /// int8 on our kernels.
    Int8,
    /// f32 on Burn's `flex`.
    Flex,
    /// f32 on Burn's `ndarray`.
    Ndarray,
}

impl Way {
    const ALL: [Self; 3] = [Self::Int8, Self::Flex, Self::Ndarray];

    fn precision(self) -> &'static str {
        if self == Self::Int8 { "int8" } else { "f32" }
    }

    fn backend(self) -> &'static str {
        match self {
            Self::Int8 => "own kernels",
            Self::Flex => "Burn flex",
            Self::Ndarray => "Burn ndarray",
        }
    }
}

/// Of all rounds' rows each configuration's that is the median in time.
fn medians(rows: Vec<Row>, rounds: usize) -> Vec<Row> {
    let mut of_each: Vec<Vec<Row>> = Vec::new();
    let each = rows.len() / rounds;
    of_each.resize_with(each, Vec::new);
    for (number, row) in rows.into_iter().enumerate() {
        of_each[number % each].push(row);
    }
    let median = |mut rows: Vec<Row>| {
        rows.sort_by(|a, b| a.host_ms.total_cmp(&b.host_ms));
        rows.swap_remove(rows.len() / 2)
    };
    of_each.into_iter().map(median).collect()
}

impl StudyArgs {
    /// Trains what is not trained yet, times all of it, and writes the chart.
    pub(in super::super::super) fn chart(&self, json: bool) -> anyhow::Result<()> {
        listen_for_ctrl_c()?;
        let mut plan = Plan::new(&self.sets, self.scale())?;
        let points = points(&mut plan)?;
        self.train(&plan)?;
        let folder = self.out.join("chart");
        let radars = Radars::record(&folder, &points)?;
        let progress = Progress::new("timing")?;
        let rounds = if self.quick { QUICK_ROUNDS } else { ROUNDS };
        let turns = rounds * points.len();
        let mut rows = Vec::new();
        for (turn, point) in std::iter::repeat_n(&points, rounds).flatten().enumerate() {
            ensure!(progress.show(turn as f64 / turns as f64), "stopped");
            rows.extend(self.rows(point, &radars)?);
        }
        drop(progress);
        let rows = medians(rows, rounds);
        let chart = Chart { simulated: true, kernels: Kernels::best().level().to_string(), rows };
        chart.write(&self.out)?;
        let figure = picture::picture(&chart);
        for kind in ["svg", "png"] {
            figure.save(self.out.join("chart").with_extension(kind))?;
        }
        self.write_scale()?;
        if json {
            println!("{}", serde_json::to_string(&chart)?);
        } else {
            println!("{}", chart.text());
        }
        Ok(())
    }

    /// A configuration in each way that it can be run.
    fn rows(&self, point: &Point, radars: &Radars) -> anyhow::Result<Vec<Row>> {
        let folders: Vec<_> = point.runs.iter().map(|(run, _)| self.runs().join(run)).collect();
        let reached =
            folders.iter().map(|folder| Reached::read(folder)).collect::<anyhow::Result<Vec<_>>>()?;
        let first = folders.first().with_context(|| format!("{} has no runs", point.name))?;
        let trained = model(&first.join(MODEL))?;
        let (packets, radar) = radars.of(&point.radar, &trained.description)?;
        let settings = recognize::model::settings(&trained.description)?;
        let (stages, _, window) = measure(packets, &radar, settings, |_| true)?;
        let names = names()?;
        let vectors: Vec<f32> = (0..window.tags).flat_map(|_| names.mean().iter().copied()).collect();
        let answers = if self.quick { QUICK_ANSWERS } else { ANSWERS };
        let mut rows = Vec::new();
        for way in Way::ALL {
            let mut shares = Vec::new();
            for (reached, (_, key)) in reached.iter().zip(&point.runs) {
                let found = match way {
                    Way::Int8 => reached.int8_test(key),
                    Way::Flex | Way::Ndarray => reached.test(key),
                };
                shares.extend(found.map(|metrics| metrics.hoi));
            }
            if shares.len() < reached.len() {
                // Burn alone runs such a network.
                continue;
            }
            let mut runner: Box<dyn Runner> = match way {
                Way::Int8 => Box::new(Executor::new(&model(&first.join(INT8))?, Kernels::best())?),
                Way::Flex => Box::new(Reference::on_flex(&trained)?),
                Way::Ndarray => Box::new(Reference::new(&trained)?),
            };
            let network = time(runner.as_mut(), &window, &vectors, answers)?;
            rows.push(Row {
                name: point.name.clone(),
                varied: point.varied,
                default: point.varied.is_none() && way == Way::Int8,
                precision: way.precision().into(),
                backend: way.backend().into(),
                hoi: Mean::of(&shares),
                parameters: reached[0].parameters,
                map_points: trained.description.config.points,
                angle: trained.description.angle.clone(),
                antennas: trained.description.config.antennas,
                cost: cost::Cost::of(&radar, packets, trained.description.config.antennas),
                stages,
                network,
                host_ms: stages.sum_ms() + network.frame_ms + network.answer_ms,
            });
        }
        Ok(rows)
    }
}
