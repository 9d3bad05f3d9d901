//! Many jobs for a few threads, which tell how far they are and can be stopped.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Duration;

/// From look to look at how far it is.
const POLL: Duration = Duration::from_millis(100);

/// Jobs by number, each of some parts.
#[derive(Debug)]
pub(crate) struct Jobs {
    jobs: usize,
    parts: usize,
    next: AtomicUsize,
    done: AtomicUsize,
    stop: AtomicBool,
}

impl Jobs {
    /// `jobs` jobs of `parts` parts altogether.
    pub(crate) fn new(jobs: usize, parts: usize) -> Self {
        let zero = || AtomicUsize::new(0);
        Self { jobs, parts, next: zero(), done: zero(), stop: AtomicBool::new(false) }
    }

    /// A job that nobody else has, if there is one.
    pub(crate) fn next(&self) -> Option<usize> {
        Some(self.next.fetch_add(1, Ordering::Relaxed)).filter(|&job| job < self.jobs)
    }

    /// So many parts more are done.
    pub(crate) fn done(&self, parts: usize) {
        self.done.fetch_add(parts, Ordering::Relaxed);
    }

    /// Whether to leave off: the user or another thread's error says so.
    pub(crate) fn stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    /// Runs `work`, which takes jobs until none is left or it is stopped, on `workers` threads. `progress` is told the share
    /// that is done, 0 to 1, and says whether to go on.
    ///
    /// # Errors
    /// The first of `work`.
    pub(crate) fn run<E: Send>(
        &self,
        workers: usize,
        progress: &mut dyn FnMut(f64) -> bool,
        work: impl Fn(&Self) -> Result<(), E> + Sync,
    ) -> Result<(), E> {
        let failure = Mutex::new(None);
        let run = || {
            if let Err(error) = work(self) {
                self.stop.store(true, Ordering::Relaxed);
                // The first error is the cause, the others have only stopped.
                if let Ok(mut failure) = failure.lock() {
                    failure.get_or_insert(error);
                }
            }
        };
        std::thread::scope(|scope| {
            let threads: Vec<_> = (0..workers.clamp(1, self.jobs.max(1))).map(|_| scope.spawn(run)).collect();
            while threads.iter().any(|thread| !thread.is_finished()) {
                let share = self.done.load(Ordering::Relaxed) as f64 / self.parts.max(1) as f64;
                if !progress(share) {
                    self.stop.store(true, Ordering::Relaxed);
                }
                std::thread::sleep(POLL);
            }
        });
        failure.into_inner().ok().flatten().map_or(Ok(()), Err)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_job_is_done_once_and_the_first_error_is_told() {
        let jobs = Jobs::new(100, 100);
        let taken = Mutex::new(Vec::new());
        let take = |jobs: &Jobs| -> Result<(), usize> {
            while let Some(job) = jobs.next() {
                taken.lock().unwrap().push(job);
                jobs.done(1);
            }
            Ok(())
        };
        jobs.run(4, &mut |_| true, take).unwrap();
        let mut taken = taken.into_inner().unwrap();
        taken.sort_unstable();
        assert!(taken.into_iter().eq(0..100));
        let failing = |jobs: &Jobs| jobs.next().filter(|job| *job != 1).map_or(Err(7), |_| Ok(()));
        assert_eq!(Jobs::new(2, 2).run(1, &mut |_| true, failing), Ok(()));
        assert_eq!(Jobs::new(2, 2).run(2, &mut |_| true, failing), Err(7));
    }

    #[test]
    fn the_user_stops_it() {
        let endless = |jobs: &Jobs| -> Result<(), ()> {
            while !jobs.stopped() {
                std::thread::yield_now();
            }
            Err(())
        };
        assert_eq!(Jobs::new(1, 1).run(1, &mut |_| false, endless), Err(()));
    }
}
