//! The descriptor of a panorama, computed beside the robot's loop. A result is taken when the next panorama comes, so
//! that a simulated run repeats exactly.

use fht_robot::descriptor::{Appearance, DescriptorNet};
use fht_robot::frame::Panorama;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

/// This many panoramas in a row that cannot be described are a defect of cameras or network, not of a picture.
const MAX_FAILURES: usize = 20;

/// The cameras are of no use: a map without descriptors would be finished, and nobody could find a place on it.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "{failures} panoramas in a row could not be described, the last because: {reason}; --no-cameras maps without appearance"
)]
pub struct CameraError {
    /// How many.
    pub failures: usize,
    /// Why the last one failed.
    pub reason: String,
}

/// A thread that describes panoramas, one at a time.
pub struct CameraWorker<C> {
    panoramas: SyncSender<Panorama>,
    appearances: Receiver<Result<Appearance, String>>,
    /// What belongs to the panorama under way.
    context: Option<C>,
    /// Failures in a row, and why the last.
    failures: usize,
    reason: String,
}

impl<C> CameraWorker<C> {
    /// Starts the thread.
    ///
    /// # Errors
    /// When the system gives no thread.
    pub fn start(mut net: DescriptorNet) -> std::io::Result<Self> {
        Self::start_with(move |panorama| net.appearance(panorama).map_err(|error| error.to_string()))
    }

    fn start_with(
        mut describe: impl FnMut(&Panorama) -> Result<Appearance, String> + Send + 'static,
    ) -> std::io::Result<Self> {
        let (panoramas, incoming) = sync_channel::<Panorama>(1);
        let (outgoing, appearances) = sync_channel(1);
        std::thread::Builder::new().name("camera".to_owned()).spawn(move || {
            for panorama in incoming {
                if outgoing.send(describe(&panorama)).is_err() {
                    return;
                }
            }
        })?;
        Ok(Self { panoramas, appearances, context: None, failures: 0, reason: String::new() })
    }

    /// Hands a panorama over, with what belongs to it; returns the previous one's result, waiting for it if need be.
    pub fn exchange(&mut self, panorama: Panorama, context: C) -> Option<(C, Appearance)> {
        let finished = self.finish();
        // A thread that has ended shows when its answer is waited for.
        let _ = self.panoramas.send(panorama);
        self.context = Some(context);
        finished
    }

    /// The result of the panorama under way, waiting for it.
    pub fn finish(&mut self) -> Option<(C, Appearance)> {
        let context = self.context.take()?;
        let failed = match self.appearances.recv() {
            Ok(Ok(appearance)) => {
                self.failures = 0;
                return Some((context, appearance));
            }
            Ok(Err(error)) => error,
            Err(_) => "the camera thread has ended".to_owned(),
        };
        tracing::warn!("a panorama was not described: {failed}");
        self.failures += 1;
        self.reason = failed;
        None
    }

    /// Whether the cameras still are of use.
    ///
    /// # Errors
    /// [`CameraError`] after twenty failures in a row.
    pub fn check(&self) -> Result<(), CameraError> {
        if self.failures < MAX_FAILURES {
            return Ok(());
        }
        Err(CameraError { failures: self.failures, reason: self.reason.clone() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn panorama() -> Panorama {
        Panorama { views: std::array::from_fn(|_| Default::default()) }
    }

    #[test]
    fn cameras_that_always_fail_are_an_error_and_one_success_forgives() {
        let mut count = 0;
        let describe = move |_: &Panorama| {
            count += 1;
            if count == 15 {
                Ok(Appearance { components: vec![1.0], information: 0.5 })
            } else {
                Err("dark".to_owned())
            }
        };
        let mut camera = CameraWorker::start_with(describe).expect("a thread");
        let mut failed_at = None;
        for exchange in 1..=60 {
            let _ = camera.exchange(panorama(), ());
            if let Err(error) = camera.check() {
                failed_at.get_or_insert((exchange, error));
            }
        }
        // Each result comes with the panorama after it: 15 succeeds, 16 to 35 fail.
        let error = CameraError { failures: 20, reason: "dark".to_owned() };
        assert_eq!(failed_at, Some((36, error)));
    }
}
