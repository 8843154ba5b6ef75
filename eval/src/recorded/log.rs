//! A log: what was sensed, and where, by SLAM over all of it.

use fht_bag::{BagError, FrameConfig, Frames};
use fht_perception::frame::{FrameError, SensorFrame};
use fht_perception::pose::Pose2;
use fht_worker::Pace;
use mapper::slam::{Anchored, Slam, SlamConfig, Tracking};
use std::path::Path;

/// Why there are no figures of a log.
#[derive(Debug, thiserror::Error)]
pub enum RecordedError {
    /// It cannot be read.
    #[error(transparent)]
    Bag(#[from] BagError),
    /// It has no scan with odometry.
    #[error("the log has no scan with odometry")]
    Empty,
    /// A scan that nothing can be made of.
    #[error(transparent)]
    Frame(#[from] FrameError),
    /// The system gave no thread.
    #[error("a thread cannot be started: {0}")]
    Thread(#[from] std::io::Error),
}

/// A log in memory.
pub struct RecordedLog {
    /// What was sensed, pictures left out.
    pub frames: Vec<SensorFrame>,
    /// Where each frame was taken: the truth, as good as SLAM over the whole log knows it. The
    /// frame is where the robot was at first.
    pub log_from_base: Vec<Pose2>,
    /// Distance driven until each frame, metres.
    pub driven_m: Vec<f64>,
    /// Frames at which that SLAM was lost.
    pub lost: usize,
}

impl RecordedLog {
    /// Reads a log and runs SLAM over it. `watch` is told how many bytes of how many are read.
    ///
    /// # Errors
    /// [`RecordedError`].
    pub fn read(path: &Path, config: FrameConfig, mut watch: impl FnMut(u64, u64)) -> Result<Self, RecordedError> {
        let mut bag = Frames::open(path, config)?;
        let mut slam = Slam::new(SlamConfig::default(), Pace::Repeatable)?;
        let (mut frames, mut anchors, mut lost) = (Vec::new(), Vec::<Anchored>::new(), 0);
        while let Some(frame) = bag.next() {
            let frame = SensorFrame { panorama: None, ..frame? };
            if frame.check().is_err() {
                continue; // a robot refuses it, too
            }
            let update = slam.update(&frame);
            lost += usize::from(update.tracking == Tracking::Lost);
            anchors.push(update.anchored);
            frames.push(frame);
            if frames.len().is_multiple_of(100) {
                let (read, of) = bag.progress();
                watch(read, of);
            }
        }
        slam.finish();
        if frames.is_empty() {
            return Err(RecordedError::Empty);
        }
        let log_from_base: Vec<Pose2> = anchors.iter().map(|anchored| slam.locate(anchored)).collect();
        let steps = log_from_base.windows(2);
        let steps = steps.map(|pair| (pair[1].translation.vector - pair[0].translation.vector).norm());
        let mut driven_m = vec![0.0];
        driven_m.extend(steps.scan(0.0, |sum, step| {
            *sum += step;
            Some(*sum)
        }));
        Ok(Self { frames, log_from_base, driven_m, lost })
    }

    /// The first frame after `share` of the way was driven.
    #[must_use]
    pub fn frame_after(&self, share: f64) -> usize {
        let until = share * self.driven_m.last().copied().unwrap_or(0.0);
        self.driven_m.partition_point(|driven| *driven < until)
    }
}
