//! The descriptor of a panorama, computed beside the robot's loop. A result is taken when the next
//! panorama comes.

use fht_descriptor::{Appearance, DescriptorNet};
use fht_perception::frame::Panorama;
use fht_worker::{BackgroundWorker, Pace};

/// This many panoramas in a row that cannot be described are a defect of cameras or network, not of
/// a picture.
const MAX_FAILURES: usize = 20;

/// The cameras are of no use: a map without descriptors would be finished, and nobody could find a
/// place on it.
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
    thread: BackgroundWorker<Panorama, Result<Appearance, String>>,
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
    pub fn start(mut net: DescriptorNet, pace: Pace) -> std::io::Result<Self> {
        Self::start_with(pace, move |panorama| net.appearance(panorama).map_err(|error| error.to_string()))
    }

    fn start_with(
        pace: Pace,
        mut describe: impl FnMut(&Panorama) -> Result<Appearance, String> + Send + 'static,
    ) -> std::io::Result<Self> {
        let thread = BackgroundWorker::one_by_one("camera", pace, move |panorama| describe(&panorama))?;
        Ok(Self { thread, context: None, failures: 0, reason: String::new() })
    }

    /// Hands a panorama over at frame `frame`, with what belongs to it; returns the previous one's
    /// result. While that one is not ready in real time, the new one is left out.
    pub fn exchange(&mut self, panorama: Panorama, context: C, frame: u64) -> Option<(C, Appearance)> {
        let finished = self.thread.take_due(frame);
        let finished = self.judge(finished);
        if self.thread.is_idle() {
            self.thread.submit(panorama, frame);
            self.context = Some(context);
        }
        finished
    }

    /// The result of the panorama under way, waiting for it.
    pub fn finish(&mut self) -> Option<(C, Appearance)> {
        let finished = self.thread.finish();
        self.judge(finished)
    }

    fn judge(&mut self, finished: Option<Result<Appearance, String>>) -> Option<(C, Appearance)> {
        let failed = match finished {
            Some(Ok(appearance)) => {
                self.failures = 0;
                return self.context.take().map(|context| (context, appearance));
            }
            Some(Err(error)) => error,
            None if self.thread.has_ended() => "the camera thread has ended".to_owned(),
            None => return None,
        };
        tracing::warn!("a panorama was not described: {failed}");
        self.context = None;
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
        let mut camera = CameraWorker::start_with(Pace::Repeatable, describe).expect("a thread");
        let mut failed_at: Option<(u64, CameraError)> = None;
        for exchange in 1..=60 {
            let _ = camera.exchange(panorama(), (), exchange);
            if let Err(error) = camera.check() {
                failed_at.get_or_insert((exchange, error));
            }
        }
        // Each result comes with the panorama after it: 15 succeeds, 16 to 35 fail.
        let error = CameraError { failures: 20, reason: "dark".to_owned() };
        assert_eq!(failed_at, Some((36, error)));
    }
}
