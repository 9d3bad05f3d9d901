//! `rfhoi experiment report`: all tables of a folder as one page, with their pictures.

use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use clap::Args;
use rfhoi::atomic;
use serde_json::Value;

use super::picture::picture;
use super::scenes;
use super::studies::{STUDIES, Study};
use super::table::{Row, Table};

/// What stands above all tables.
const HEAD: &str = "# Results of the experiments

**All data here are simulated** but for those of real recordings, at the end, if there are any. So is the site on which accuracy is measured:
three rooms and five people who move by a law of their own. The paper's figures are of its real recordings, so no two figures of a row can be
compared one to one; what can be compared is which of two settings is better, and by about how much. Accuracy is in percent with its 95 %
interval: Student's over runs that differ by the seed of split, weights and order, or Wilson's over the samples where there is one run. The
paper's sections are named beside.
";

/// `rfhoi experiment report`.
#[derive(Debug, Args)]
pub(in super::super) struct Report {
    /// Folder with the tables of the studies. README.md and pictures are written there; what is in NAME.md, if there is such a
    /// file, stands below the table of the study NAME; what is in real.md is the section on real recordings.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

impl Report {
    pub(in super::super) fn run(&self, json: bool) -> anyhow::Result<()> {
        let mut page = HEAD.to_owned();
        page.push_str(&made_by(&self.out)?);
        let table = |study: &Study| self.out.join(format!("{}.json", study.name));
        let (there, missing): (Vec<&Study>, Vec<&Study>) =
            STUDIES.iter().partition(|study| table(study).is_file());
        if !missing.is_empty() {
            let names: Vec<&str> = missing.iter().map(|study| study.name).collect();
            page.push_str(&format!("\nNot run in full yet: {}.\n", names.join(", ")));
        }
        let mut told = Vec::new();
        for study in there {
            let table = Table::read(&table(study))?;
            let file = format!("{}.svg", table.name);
            picture(&table).save(self.out.join(&file))?;
            page.push_str(&section(&table, &file));
            page.push_str(&remarks(&self.out, &table.name)?);
            told.push(table.name);
        }
        ensure!(
            !told.is_empty(),
            "{} has no tables: run `rfhoi experiment all --sets SETS --out {0}` before",
            self.out.display()
        );
        let latency = self.out.join("latency.txt");
        if latency.is_file() {
            let text = std::fs::read_to_string(&latency)
                .with_context(|| format!("cannot read {}", latency.display()))?;
            page.push_str(&format!(
                "\n## Latency by stage (section 5.7.2)\n\n`rfhoi experiment latency` on the machine at hand:\n\n```\n{text}```\n"
            ));
            page.push_str(&remarks(&self.out, "latency")?);
        }
        if self.out.join("chart.md").is_file() {
            page.push_str("\n## Speed against accuracy\n\n`rfhoi chart`; each configuration is trained and tested as above.\n");
            page.push_str("\n![Speed against accuracy](chart.svg)\n");
            page.push_str(&remarks(&self.out, "chart")?);
        }
        if self.out.join("real.md").is_file() {
            page.push_str(
                "\n## Real recordings\n\nNot simulated: other people's recordings, of one radio each.\n",
            );
            page.push_str(&remarks(&self.out, "real")?);
        }
        let path = self.out.join("README.md");
        atomic::write(&path, page.as_bytes())?;
        if json {
            println!("{}", serde_json::json!({ "report": path, "studies": told }));
        } else {
            println!("{}: {}", path.display(), told.join(", "));
        }
        Ok(())
    }
}

/// The commands that made the tables.
fn made_by(out: &Path) -> anyhow::Result<String> {
    let path = out.join(super::SCALE);
    let text = std::fs::read(&path).with_context(|| {
        format!("cannot read {}, which the studies leave beside their tables", path.display())
    })?;
    let scale: Value =
        serde_json::from_slice(&text).with_context(|| format!("{} is damaged", path.display()))?;
    let [seeds, pre, fine, scratch, samples] =
        ["seeds", "pre_epochs", "fine_epochs", "scratch_epochs", "pre_samples"].map(|key| &scale[key]);
    let size = |seeds: &Value| match scale["quick"] == true {
        true => " --quick".to_owned(),
        false => format!(" --seeds {seeds} --epochs {pre} {fine} {scratch} --pre-training {samples}"),
    };
    let quick = if scale["quick"] == true { " --quick" } else { "" };
    let [studies, chart] = [size(seeds), size(chart_runs(out).as_ref().unwrap_or(seeds))];
    Ok(format!(
        "
```
cargo build --release -p rfhoi --features train
rfhoi experiment sets --out SETS{quick}
rfhoi experiment all --sets SETS --out RESULTS{studies}
rfhoi chart --sets SETS --out RESULTS{chart}
rfhoi experiment report --out RESULTS
```
"
    ))
}

/// Runs of each configuration of the chart, where it was drawn: it may have had fewer seeds than the studies.
fn chart_runs(out: &Path) -> Option<Value> {
    let chart: Value = serde_json::from_slice(&std::fs::read(out.join("chart.json")).ok()?).ok()?;
    chart.pointer("/rows/0/hoi/runs").cloned()
}

fn remarks(out: &Path, name: &str) -> anyhow::Result<String> {
    let path = out.join(format!("{name}.md"));
    if !path.is_file() {
        return Ok(String::new());
    }
    let text = std::fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))?;
    Ok(format!("\n{}\n", text.trim_end()))
}

/// A study: its table and its picture.
fn section(table: &Table, picture: &str) -> String {
    let Table { name, title, section, axis, rows, .. } = table;
    let samples = rows.first().map_or(0, |row| row.hoi.samples);
    let runs = rows.first().map_or(0, |row| row.hoi.runs);
    let mut text = format!(
        "\n## {title}\n\n`rfhoi experiment {name}`, section {section} of the paper; runs of each: {runs}, tested on about {samples} samples.\n\n"
    );
    let heads = ["", axis, "HOI", "action", "object", "paper, HOI", "learnt from", "parameters"];
    text.push_str(&format!("|{}|\n|{}\n", heads.join("|"), "---|".repeat(heads.len())));
    for row in rows {
        let Row { series, at, hoi, action, object, paper, learnt, parameters, .. } = row;
        let paper = paper.map_or("-".to_owned(), |paper| format!("{paper:.1}"));
        text.push_str(&format!("|{series}|{at}|{hoi}|{action}|{object}|{paper}|{learnt}|{parameters}|\n"));
    }
    let both: Vec<_> = rows.iter().filter_map(|row| Some((row, row.int8.as_ref()?))).collect();
    if !both.is_empty() {
        text.push_str("\n||HOI, f32|HOI, int8|f32, bytes|int8, bytes|f32 on ndarray, ms|int8, ms|\n|---|---|---|---|---|---|---|\n");
        for (row, int8) in both {
            text.push_str(&format!(
                "|{}|{}|{}|{}|{}|{:.3}|{:.3}|\n",
                row.series,
                row.hoi,
                int8.hoi,
                int8.f32_bytes,
                int8.int8_bytes,
                int8.f32_answer_ms,
                int8.int8_answer_ms
            ));
        }
        text.push_str("\nTimes: from the last frame of 6 s to the answer, one thread.\n");
    }
    if !table.costs.is_empty() {
        text.push_str(&scenes::page(&table.costs));
    }
    text.push_str(&format!("\n![{title}]({picture})\n"));
    text
}
