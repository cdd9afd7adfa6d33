//! Everything that can go wrong, once. `python` maps each variant to one Python exception,
//! exhaustively, so that a new variant does not compile until it has a class.

/// What went wrong, where, what was got, the limit, and what to do about it.
#[derive(Debug, Clone, thiserror::Error)]
pub enum Error {
    /// The geometry or its colours cannot be rendered as given.
    #[error("{0}")]
    Scene(String),
    /// An argument is unknown or out of range.
    #[error("{0}")]
    Parameter(String),
    /// No usable adapter, a lost device, or a failure that the graphics driver reports.
    #[error("{0}")]
    Device(String),
    /// The device lacks a feature that the request needs.
    #[error("{0}")]
    Unsupported(String),
    /// The request does not fit, even tile by tile.
    #[error("{what}: {needed} bytes are needed, but the limit is {limit} bytes; {advice}")]
    Capacity { what: String, needed: u64, limit: u64, advice: String },
    /// Shader text that does not compile, at a line of the file it came from.
    #[error("{file}:{line}: {message}")]
    Shader { file: String, line: usize, message: String },
}

pub type Result<T> = std::result::Result<T, Error>;
