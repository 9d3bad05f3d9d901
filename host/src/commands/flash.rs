//! `rfhoi flash`.

use std::path::PathBuf;

use clap::Args;

/// The chip of the default board, NUCLEO-H743ZI.
const DEFAULT_CHIP: &str = "STM32H743ZITx";

#[derive(Debug, Args)]
pub(super) struct Flash {
    /// Firmware, as `firmware/boards/build` makes it.
    #[arg(required_unless_present = "list")]
    elf: Option<PathBuf>,
    /// Debug probe, if there are several.
    #[arg(long, value_name = "SERIAL|VID:PID[:SERIAL]")]
    probe: Option<String>,
    /// Chip of the board.
    #[arg(long, default_value = DEFAULT_CHIP)]
    chip: String,
    /// End when the board runs, instead of following its log until Ctrl-C.
    #[arg(long)]
    no_log: bool,
    /// List the debug probes and end.
    #[arg(long, conflicts_with = "elf")]
    list: bool,
}

#[cfg(not(feature = "probe"))]
impl Flash {
    pub(super) fn run(&self, _json: bool) -> anyhow::Result<()> {
        anyhow::bail!(
            "this rfhoi was built without support for debug probes: \
             build it with `cargo install --path host --features probe`"
        )
    }
}

#[cfg(feature = "probe")]
mod with_probe {
    use std::path::{Path, PathBuf};

    use anyhow::Context;
    use rfhoi::flash::{Firmware, FlashError, LogLine, Probe, Stage, follow, probes, program};
    use serde::Serialize;

    use super::super::{Progress, report, stopped};
    use super::Flash;

    #[derive(Debug, Serialize)]
    struct Probes {
        probes: Vec<Probe>,
    }

    #[derive(Debug, Serialize)]
    struct Programmed<'a> {
        firmware: &'a Path,
        chip: &'a str,
        probe: &'a Probe,
        verified: bool,
        /// Why no log follows.
        no_log: Option<&'a str>,
    }

    impl Flash {
        pub(in super::super) fn run(&self, json: bool) -> anyhow::Result<()> {
            if self.list {
                let probes = probes();
                anyhow::ensure!(!probes.is_empty(), FlashError::NoProbe);
                return report::print(&Probes { probes }, json);
            }
            let path: &PathBuf = self.elf.as_ref().context("which firmware?")?;
            let firmware = Firmware::read(path)?;
            let progress = Progress::new(format!("programming {}", path.display()))?;
            let mut board = program(&firmware, self.probe.as_deref(), &self.chip, |stage, share| {
                progress.show(part(stage, share));
            })?;
            drop(progress);
            let no_log = firmware.no_log.as_deref().or(self.no_log.then_some("not wanted"));
            let programmed =
                Programmed { firmware: path, chip: &self.chip, probe: &board.probe, verified: true, no_log };
            report::print(&programmed, json)?;
            if no_log.is_some() {
                return Ok(());
            }
            let mut failed = None;
            let print = |line: LogLine| failed = write(&line, json).err().or(failed.take());
            follow(&mut board, &firmware, print, || !stopped())?;
            failed.map_or(Ok(()), Err)
        }
    }

    /// The share of everything: erasing, programming and verifying count the same.
    fn part(stage: Stage, share: f64) -> f64 {
        const STAGES: f64 = 3.0;
        (f64::from(stage as u8) + share) / STAGES
    }

    fn write(line: &LogLine, json: bool) -> anyhow::Result<()> {
        if json {
            return report::print(line, true);
        }
        println!("{} {:5} {}", line.time, line.level.unwrap_or("").to_uppercase(), line.message);
        Ok(())
    }
}
