//! Long calls that answer to Ctrl-C, and objects that several threads may call.

use super::errors::input;
use pyo3::prelude::*;
use std::ops::{Deref, DerefMut};
use std::sync::{Mutex, MutexGuard, PoisonError, TryLockError};
use std::thread::ThreadId;
use std::time::{Duration, Instant};

/// How often the interpreter is asked for signals.
const INTERVAL: Duration = Duration::from_millis(20);
/// Pause between two questions whether it is one's turn.
const PAUSE: Duration = Duration::from_millis(1);

/// The interpreter's signals, looked at now and then; made when a call begins.
pub struct Signals {
    next: Instant,
    raised: Option<PyErr>,
}

impl Signals {
    /// None so far.
    pub fn new() -> Self {
        Self { next: Instant::now() + INTERVAL, raised: None }
    }

    /// Whether the call is to stop. Cheap: the interpreter is asked only about every 20 ms.
    pub fn stop(&mut self) -> bool {
        if self.raised.is_none() {
            let now = Instant::now();
            if now < self.next {
                return false;
            }
            self.raised = Python::attach(|py| py.check_signals()).err();
            self.next = Instant::now() + INTERVAL;
        }
        self.raised.is_some()
    }

    /// What was raised, if the call was stopped.
    pub fn result(self) -> PyResult<()> {
        self.raised.map_or(Ok(()), Err)
    }
}

/// A thing that one thread uses at a time; the others wait for their turn.
pub struct Shared<T> {
    value: Mutex<T>,
    owner: Mutex<Option<ThreadId>>,
    what: &'static str,
}

impl<T> Shared<T> {
    /// `value`, called `what` in errors.
    pub fn new(what: &'static str, value: T) -> Self {
        Self { value: Mutex::new(value), owner: Mutex::new(None), what }
    }

    fn owner(&self) -> MutexGuard<'_, Option<ThreadId>> {
        self.owner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The value, when no other thread uses it any more; the interpreter is released while waiting.
    ///
    /// # Errors
    /// `InputError` where this very thread uses it already: a controller that steps its own plant; and Ctrl-C.
    pub fn turn(&self, py: Python<'_>) -> PyResult<Turn<'_, T>> {
        let me = std::thread::current().id();
        loop {
            match self.value.try_lock() {
                Ok(guard) => {
                    *self.owner() = Some(me);
                    return Ok(Turn { guard, shared: self });
                }
                // A panic leaves no half-written result behind that anyone would read: calls begin anew.
                Err(TryLockError::Poisoned(_)) => self.value.clear_poison(),
                Err(TryLockError::WouldBlock) if *self.owner() == Some(me) => {
                    let what = self.what;
                    return Err(input(py, format!("this {what} is in use by the call that this call comes from")));
                }
                Err(TryLockError::WouldBlock) => {
                    py.detach(|| std::thread::sleep(PAUSE));
                    py.check_signals()?;
                }
            }
        }
    }
}

/// A thread's turn.
pub struct Turn<'a, T> {
    guard: MutexGuard<'a, T>,
    shared: &'a Shared<T>,
}

impl<T> Drop for Turn<'_, T> {
    fn drop(&mut self) {
        *self.shared.owner() = None;
    }
}

impl<T> Deref for Turn<'_, T> {
    type Target = T;
    fn deref(&self) -> &T {
        &self.guard
    }
}

impl<T> DerefMut for Turn<'_, T> {
    fn deref_mut(&mut self) -> &mut T {
        &mut self.guard
    }
}
