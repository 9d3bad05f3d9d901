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

/// Number of a job, and its first and last piece that nobody has taken: one word, so that they belong together.
///
/// The thread that calls takes the first, others the last: so each mostly gets the weights that it had the last time.
#[derive(Clone, Copy)]
struct Ticket(u64);

impl Ticket {
    fn all(number: u32, pieces: u16) -> Self {
        Self(u64::from(number) << 32 | u64::from(pieces) << 16)
    }

    fn number(self) -> u32 {
        (self.0 >> 32) as u32
    }

    /// Pieces from `first` to before `end`.
    fn left(self) -> (u16, u16) {
        (self.0 as u16, (self.0 >> 16) as u16)
    }

    fn is_empty(self) -> bool {
        let (first, end) = self.left();
        first >= end
    }

    /// One of the pieces, and the ticket without it.
    fn take(self, end: End) -> Option<(u16, Self)> {
        let (first, last) = self.left();
        match end {
            _ if self.is_empty() => None,
            End::First => Some((first, Self(self.0 + 1))),
            End::Last => Some((last - 1, Self(self.0 - (1 << 16)))),
        }
    }
}

#[derive(Clone, Copy)]
enum End {
    First,
    Last,
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
    fn work(&self, end: End) {
        loop {
            let ticket = self.ticket();
            let Some((piece, left)) = ticket.take(end) else { return };
            let job = self.job.load(Ordering::Acquire);
            if self.ticket.compare_exchange(ticket.0, left.0, Ordering::AcqRel, Ordering::Relaxed).is_err() {
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
            if !self.ticket().is_empty() {
                self.work(End::Last);
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
    /// If one of the pieces does, or there are more than 65535.
    pub(crate) fn run(&self, pieces: usize, piece: &(dyn Fn(usize) + Sync)) {
        let _running = match self.running.try_lock() {
            Ok(running) => running,
            // A piece panicked before; all were done then, too.
            Err(TryLockError::Poisoned(running)) => running.into_inner(),
            Err(TryLockError::WouldBlock) => return (0..pieces).for_each(piece),
        };
        let job = Job { piece, done: AtomicUsize::new(0), panicked: AtomicBool::new(false) };
        let all = u16::try_from(pieces).expect("not too many pieces");
        let number = self.shared.ticket().number().wrapping_add(1);
        self.shared.job.store((&raw const job).cast_mut().cast(), Ordering::Release);
        self.shared.ticket.store(Ticket::all(number, all).0, Ordering::Release);
        self.others.iter().for_each(|other| other.thread().unpark());
        self.shared.work(End::First);
        let mut turns = 0;
        while job.done.load(Ordering::Acquire) < pieces {
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
        for round in 0..2000 {
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
