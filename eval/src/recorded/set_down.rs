//! A robot that is set down somewhere in a log, follows it, and says where it is.

use crate::recorded::log::RecordedLog;
use fht_localization::PlaceEvidence;
use fht_localization::landmarks::Landmarks;
use fht_localization::localizer::{Localizer, LocalizerConfig};
use fht_navigation::people::{BystanderConfig, Bystanders};
use fht_perception::pose::Pose2;

/// What a robot says after a look around.
#[derive(Clone, Copy, Debug)]
pub struct Statement {
    /// At which frame of the log.
    pub frame: usize,
    /// Driven since the start, metres.
    pub driven_m: f64,
    /// How probable it is, as the robot says.
    pub stated: f64,
    /// Where it says that it is, or most likely is: map frame.
    pub map_from_base: Pose2,
    /// What speaks for it.
    pub evidence: PlaceEvidence,
}

/// What a robot said from its start on.
#[derive(Clone, Debug)]
pub struct LogDrive {
    /// The frame at which it was set down.
    pub start: usize,
    /// The last frame that it saw.
    pub end: usize,
    /// All that it said, the declared place included.
    pub statements: Vec<Statement>,
    /// The first place that it declared. The drive ends with it.
    pub fix: Option<Statement>,
}

/// `count` frames, evenly spaced from `first` on; fewer if there are fewer.
#[must_use]
pub fn starts(log: &RecordedLog, first: usize, count: usize) -> Vec<usize> {
    let frames = log.frames.len().saturating_sub(first);
    let count = count.min(frames);
    (0..count).map(|index| first + index * frames / count).collect()
}

/// Sets a robot down at frame `start`, which follows the log for `longest_m` metres, or until it
/// declares a place.
#[must_use]
pub fn set_down(
    log: &RecordedLog,
    landmarks: &Landmarks,
    start: usize,
    longest_m: f64,
    config: &LocalizerConfig,
) -> LogDrive {
    let mut localizer = Localizer::new(config.clone());
    let mut bystanders = Bystanders::new(BystanderConfig::default());
    let mut drive = LogDrive { start, end: start, statements: Vec::new(), fix: None };
    let mut said = None;
    for (frame, sensed) in log.frames.iter().enumerate().skip(start) {
        let driven_m = log.driven_m[frame] - log.driven_m[start];
        if driven_m > longest_m {
            break;
        }
        drive.end = frame;
        let lasting = bystanders.hide(sensed);
        localizer.expect_people(bystanders.walkers());
        let localization = localizer.update(landmarks, &lasting, || None);
        let stated = localization.confidence;
        let declared = localization.map_from_base();
        let likeliest = declared.or_else(|| localizer.candidates().first().map(|place| place.map_from_base));
        let Some(map_from_base) = likeliest.filter(|_| stated > 0.0) else { continue };
        let evidence = localizer.relocalizer().evidence().copied().unwrap_or_default();
        let statement = Statement { frame, driven_m, stated, map_from_base, evidence };
        // Between two looks it says the same.
        if said != Some((stated, evidence)) {
            drive.statements.push(statement);
            said = Some((stated, evidence));
        }
        if declared.is_some() {
            drive.fix = Some(statement);
            break;
        }
    }
    drive
}
