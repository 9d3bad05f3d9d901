//! Runs of this program, some at a time, each in a folder of its own.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Mutex;

use anyhow::{Context, ensure};

use crate::commands::stopped;

/// A run of this program, with its folder.
pub(super) struct Job {
    /// Folder for its log.
    pub(super) folder: PathBuf,
    /// All that it is told.
    pub(super) words: Vec<String>,
}

pub(super) struct Runs {
    pub(super) workers: usize,
}

impl Runs {
    /// Runs all jobs, some at a time.
    pub(super) fn all(&self, jobs: &[Job]) -> anyhow::Result<()> {
        let next = Mutex::new(jobs.iter());
        // As it is running, also where its file was replaced in the meantime.
        let running = Some(PathBuf::from("/proc/self/exe")).filter(|path| path.exists());
        let program = match running {
            Some(running) => running,
            None => std::env::current_exe().context("cannot find this program")?,
        };
        let work = || -> anyhow::Result<()> {
            loop {
                let job = next.lock().ok().and_then(|mut jobs| jobs.next());
                let Some(job) = job else { return Ok(()) };
                job.run(&program)?;
            }
        };
        std::thread::scope(|scope| {
            let threads: Vec<_> = (0..self.workers.max(1)).map(|_| scope.spawn(work)).collect();
            threads.into_iter().try_for_each(|thread| match thread.join() {
                Ok(result) => result,
                Err(panic) => std::panic::resume_unwind(panic),
            })
        })
    }
}

impl Job {
    fn run(&self, program: &Path) -> anyhow::Result<()> {
        ensure!(!stopped(), "stopped; the same command goes on from there");
        let line = format!("rfhoi {}", self.words.join(" "));
        eprintln!("{line}");
        std::fs::create_dir_all(&self.folder)
            .with_context(|| format!("cannot make the folder {}", self.folder.display()))?;
        let log = std::fs::File::create(self.folder.join("log.txt")).context("cannot write a log")?;
        let status = Command::new(program)
            .args(&self.words)
            // Several at a time: each has a core.
            .env("RAYON_NUM_THREADS", "1")
            .stdin(Stdio::null())
            .stdout(log.try_clone().context("cannot write a log")?)
            .stderr(log)
            .status()
            .context("cannot run this program again")?;
        ensure!(!stopped(), "stopped; the same command goes on from there");
        ensure!(status.success(), "{line} failed: see {}", self.folder.join("log.txt").display());
        Ok(())
    }
}

pub(super) fn path(path: &Path) -> String {
    path.to_string_lossy().into_owned()
}

pub(super) fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}
