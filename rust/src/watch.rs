//! Long work on other threads while the calling one answers to its user.

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
