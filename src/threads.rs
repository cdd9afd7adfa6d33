//! The threads that pipelines work on.

use std::sync::{Arc, Mutex, PoisonError};

use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::error::{Error, Result};

/// The process's own threads. A forked child inherits a pool without threads, so it makes another.
pub fn threads() -> Result<Arc<ThreadPool>> {
    static POOL: Mutex<Option<(u32, Arc<ThreadPool>)>> = Mutex::new(None);
    let mut pool = POOL.lock().unwrap_or_else(PoisonError::into_inner);
    match &*pool {
        Some((process, threads)) if *process == std::process::id() => Ok(threads.clone()),
        inherited => {
            if inherited.is_some() {
                // Dropping it would wait for threads that do not exist here.
                std::mem::forget(pool.take());
            }
            let threads = ThreadPoolBuilder::new()
                .thread_name(|i| format!("abuffer-{i}"))
                .build()
                .map(Arc::new)
                .map_err(|e| Error::Device(format!("cannot start threads: {e}")))?;
            *pool = Some((std::process::id(), threads.clone()));
            Ok(threads)
        }
    }
}
