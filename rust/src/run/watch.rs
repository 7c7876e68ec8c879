//! Long work on other threads while the calling one answers to its user.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

/// How often the caller is asked whether to stop.
const INTERVAL: Duration = Duration::from_millis(50);

/// Does `work` on another thread and calls `watch` on this one about every 50 ms; where it returns true, `stop` is set, for
/// the work to look at.
pub fn watched<R: Send>(stop: &AtomicBool, work: impl FnOnce() -> R + Send, watch: &mut impl FnMut() -> bool) -> R {
    std::thread::scope(|scope| {
        let (finished, report) = channel();
        let worker = scope.spawn(move || {
            let result = work();
            // The receiver outlives this thread; a failed send can only mean that nobody waits any more.
            let _ = finished.send(());
            result
        });
        while report.recv_timeout(INTERVAL) == Err(RecvTimeoutError::Timeout) {
            if watch() {
                stop.store(true, Ordering::Relaxed);
            }
        }
        worker.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    })
}

/// The same for `work` that can look at `stop` only now and then: where `watch` returns true, it is left behind to end by
/// itself, and there is no result.
pub fn left_behind<R: Send + 'static>(
    work: impl FnOnce(&AtomicBool) -> R + Send + 'static,
    watch: &mut impl FnMut() -> bool,
) -> Option<R> {
    let stop = Arc::new(AtomicBool::new(false));
    let (finished, report) = channel();
    let seen = stop.clone();
    // A failed send means that the caller has left.
    let worker = std::thread::spawn(move || drop(finished.send(work(&seen))));
    loop {
        match report.recv_timeout(INTERVAL) {
            Ok(result) => return Some(result),
            Err(RecvTimeoutError::Disconnected) => match worker.join() {
                Ok(()) => return None,
                Err(panic) => std::panic::resume_unwind(panic),
            },
            Err(RecvTimeoutError::Timeout) if watch() => {
                stop.store(true, Ordering::Relaxed);
                return None;
            }
            Err(RecvTimeoutError::Timeout) => {}
        }
    }
}

/// `work` on `pool` while `watch` is called on this thread about every 50 ms; where it returns true, `stop` is set, for the
/// work to look at.
pub fn watched_in(
    pool: &rayon::ThreadPool,
    stop: &AtomicBool,
    work: impl FnOnce() + Send,
    watch: &mut impl FnMut() -> bool,
) {
    let (finished, report) = channel();
    pool.in_place_scope(|scope| {
        scope.spawn(move |_| {
            work();
            // The receiver outlives this; after a panic the sender is dropped and the scope passes the panic on.
            let _ = finished.send(());
        });
        while report.recv_timeout(INTERVAL) == Err(RecvTimeoutError::Timeout) {
            if watch() {
                stop.store(true, Ordering::Relaxed);
            }
        }
    });
}
