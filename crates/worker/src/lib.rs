//! Work in threads beside a robot's loop.
//!
//! A robot's loop runs at the pace of its sensors and must not wait for a search or a server. A
//! [`BackgroundWorker`] does one job at a time in a thread of its own, and the loop takes the
//! result at a frame that is fixed when the job is given. So a simulated run repeats exactly,
//! however fast the threads are.
//!
//! | jobs | hand over | take | the loop waits |
//! | --- | --- | --- | --- |
//! | [`one_by_one`](BackgroundWorker::one_by_one) | `submit` | `take_due` | as [`Pace`] says |
//! | [`newest_first`](BackgroundWorker::newest_first) | `replace` | `take` | as [`Taking`] says |
//!
//! ```
//! use fht_worker::{BackgroundWorker, Pace};
//!
//! let mut squares = BackgroundWorker::one_by_one("squares", Pace::Repeatable, |x: u64| x * x)?;
//! squares.submit(12, 3);
//! assert_eq!(squares.take_due(2), None);
//! assert_eq!(squares.take_due(3), Some(144));
//! # Ok::<(), std::io::Error>(())
//! ```

mod config;
mod worker;

pub use config::{Pace, Taking};
pub use worker::BackgroundWorker;
