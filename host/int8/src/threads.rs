//! Threads that wait for a share of a kernel's work.
//!
//! Work is cut into pieces, which the calling thread and the others take one by one. Whoever comes late takes fewer, or none:
//! the caller never waits for a thread that has taken nothing.

use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::ptr;
use std::sync::atomic::{AtomicBool, AtomicPtr, AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, TryLockError};
use std::thread::{self, JoinHandle};

/// Turns of waiting before a thread goes to sleep: some tens of microseconds, longer than it is from one layer to the next.
const SPINS: u32 = 1000;

/// Turns of waiting before a thread lets others have its core: one of them may hold what it waits for.
const PATIENCE: u32 = 100;

/// What all threads run, piece by piece.
struct Job<'a> {
    piece: &'a (dyn Fn(usize) + Sync),
    /// Pieces that came to an end, if only by a panic.
    done: AtomicUsize,
    panicked: AtomicBool,
}

/// Number of a job, its pieces, and the next piece that nobody has taken: one word, so that they belong together.
#[derive(Clone, Copy)]
struct Ticket(u64);

impl Ticket {
    fn first(number: u32, pieces: u16) -> Self {
        Self(u64::from(number) << 32 | u64::from(pieces) << 16)
    }

    fn number(self) -> u32 {
        (self.0 >> 32) as u32
    }

    fn piece(self) -> Option<u16> {
        let (pieces, next) = ((self.0 >> 16) as u16, self.0 as u16);
        (next < pieces).then_some(next)
    }
}

/// Seen by all threads.
struct Shared {
    ticket: AtomicU64,
    job: AtomicPtr<Job<'static>>,
    closing: AtomicBool,
}

impl Shared {
    fn ticket(&self) -> Ticket {
        Ticket(self.ticket.load(Ordering::Acquire))
    }

    /// Takes pieces until none is left.
    fn work(&self) {
        loop {
            let ticket = self.ticket();
            let Some(piece) = ticket.piece() else { return };
            let job = self.job.load(Ordering::Acquire);
            let next = ticket.0 + 1;
            if self.ticket.compare_exchange(ticket.0, next, Ordering::AcqRel, Ordering::Relaxed).is_err() {
                continue;
            }
            // SAFETY: the ticket had not changed, so when `job` was read its job had a piece that nobody had taken, and
            // `run` puts no other in its place, nor lets it go, before all pieces of it are done. Ours is not.
            let job = unsafe { &*job };
            if catch_unwind(AssertUnwindSafe(|| (job.piece)(piece.into()))).is_err() {
                job.panicked.store(true, Ordering::Relaxed);
            }
            job.done.fetch_add(1, Ordering::Release);
        }
    }

    /// What a thread does beside the one that calls.
    fn serve(&self) {
        let mut spins = 0;
        while !self.closing.load(Ordering::Acquire) {
            if self.ticket().piece().is_some() {
                self.work();
                spins = 0;
            } else if spins < SPINS {
                spins += 1;
                std::hint::spin_loop();
            } else {
                thread::park();
                spins = 0;
            }
        }
    }
}

/// Threads, the one that calls among them.
pub(crate) struct Threads {
    shared: Arc<Shared>,
    others: Vec<JoinHandle<()>>,
    /// Held while a job runs.
    running: Mutex<()>,
}

impl Threads {
    /// As many as that, or as many as can be had.
    pub(crate) fn new(threads: usize) -> Self {
        let shared = Arc::new(Shared {
            ticket: AtomicU64::new(0),
            job: AtomicPtr::new(ptr::null_mut()),
            closing: AtomicBool::new(false),
        });
        let start = |_| {
            let shared = Arc::clone(&shared);
            thread::Builder::new().name("int8".into()).spawn(move || shared.serve()).ok()
        };
        let others = (1..threads).map_while(start).collect();
        Self { shared, others, running: Mutex::new(()) }
    }

    pub(crate) fn count(&self) -> usize {
        self.others.len() + 1
    }

    /// Runs `piece` once for each number below `pieces`, on this thread and, where they are in time, others. If they are
    /// at work for another caller, on this one alone.
    ///
    /// # Panics
    /// If one of the pieces does.
    pub(crate) fn run(&self, pieces: u16, piece: &(dyn Fn(usize) + Sync)) {
        let _running = match self.running.try_lock() {
            Ok(running) => running,
            // A piece panicked before; all were done then, too.
            Err(TryLockError::Poisoned(running)) => running.into_inner(),
            Err(TryLockError::WouldBlock) => return (0..pieces.into()).for_each(piece),
        };
        let job = Job { piece, done: AtomicUsize::new(0), panicked: AtomicBool::new(false) };
        let number = self.shared.ticket().number().wrapping_add(1);
        self.shared.job.store((&raw const job).cast_mut().cast(), Ordering::Release);
        self.shared.ticket.store(Ticket::first(number, pieces).0, Ordering::Release);
        self.others.iter().for_each(|other| other.thread().unpark());
        self.shared.work();
        let mut turns = 0;
        while job.done.load(Ordering::Acquire) < pieces.into() {
            turns += 1;
            if turns % PATIENCE == 0 { thread::yield_now() } else { std::hint::spin_loop() }
        }
        assert!(!job.panicked.load(Ordering::Relaxed), "a piece of a kernel's work panicked");
    }
}

impl Drop for Threads {
    fn drop(&mut self) {
        self.shared.closing.store(true, Ordering::Release);
        for other in self.others.drain(..) {
            other.thread().unpark();
            // It catches panics of its work and has no others.
            let _ = other.join();
        }
    }
}

impl fmt::Debug for Threads {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Threads").field("count", &self.count()).finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_piece_once_whoever_takes_it() {
        let threads = Threads::new(3);
        for round in 0..2000u16 {
            let pieces = round % 17;
            let counts: Vec<_> = (0..pieces).map(|_| AtomicUsize::new(0)).collect();
            threads.run(pieces, &|piece| {
                counts[piece].fetch_add(1, Ordering::Relaxed);
            });
            assert!(counts.iter().all(|count| count.load(Ordering::Relaxed) == 1));
        }
    }

    #[test]
    fn callers_at_the_same_time_and_within_a_piece() {
        let threads = Threads::new(2);
        let count = AtomicUsize::new(0);
        thread::scope(|scope| {
            for _ in 0..4 {
                scope.spawn(|| {
                    for _ in 0..200 {
                        threads.run(4, &|_| {
                            threads.run(3, &|_| {
                                count.fetch_add(1, Ordering::Relaxed);
                            });
                        });
                    }
                });
            }
        });
        assert_eq!(count.into_inner(), 4 * 200 * 4 * 3);
    }

    #[test]
    fn a_panic_reaches_the_caller_after_all_other_pieces() {
        let threads = Threads::new(2);
        let done = AtomicUsize::new(0);
        let run = || {
            threads.run(8, &|piece| {
                assert_ne!(piece, 3);
                done.fetch_add(1, Ordering::Relaxed);
            });
        };
        assert!(catch_unwind(AssertUnwindSafe(run)).is_err());
        assert_eq!(done.load(Ordering::Relaxed), 7);
        // And the threads go on.
        threads.run(2, &|_| {
            done.fetch_add(1, Ordering::Relaxed);
        });
        assert_eq!(done.into_inner(), 9);
    }
}
