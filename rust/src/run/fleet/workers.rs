//! The threads of a fleet.

use crate::error::{Error, Result};

/// Threads of this process. A child that was forked has none of them: it makes its own.
pub struct Workers {
    pool: Option<rayon::ThreadPool>,
    threads: usize,
    process: u32,
}

impl Workers {
    /// So many; as many as cores if 0.
    ///
    /// # Errors
    /// [`Error::Input`] where the system gives none.
    pub fn new(threads: usize) -> Result<Self> {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .map_err(|e| Error::Input(format!("threads: {threads}; {e}")))?;
        Ok(Self { pool: Some(pool), threads, process: std::process::id() })
    }

    /// Those of this process.
    ///
    /// # Errors
    /// As [`Workers::new`].
    pub fn here(&mut self) -> Result<&rayon::ThreadPool> {
        if self.process != std::process::id() {
            *self = Self::new(self.threads)?;
        }
        self.pool.as_ref().ok_or_else(|| Error::Input("threads: there are none".to_owned()))
    }
}

impl Drop for Workers {
    fn drop(&mut self) {
        // Threads of another process cannot be told to end, and asking them might wait for ever.
        if self.process != std::process::id() {
            std::mem::forget(self.pool.take());
        }
    }
}
