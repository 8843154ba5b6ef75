//! A recorded drive of a robot that does not know where it is. It wanders on a live grid of its
//! own. A drive is made once for each start, so that all systems get the same trajectory, scans and
//! pictures.

use client_robot::pilot::{Pilot, PilotConfig, Task};
use fht_client::{PathSource, PlannedPath};
use fht_descriptor::DescriptorNet;
use fht_localization::landmarks::Landmarks;
use fht_perception::frame::{Panorama, SensorFrame};
use fht_perception::pose::{Point2, Pose2};
use fht_proto::api::reply::{ErrorCode, ErrorReply};
use fht_proto::{Descriptor, FixedPoint};
use fht_sim::{Photographer, SimConfig, Simulator, World};
use image::RgbImage;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Frames between two pictures: 1 Hz.
const PICTURE_EVERY: usize = 5;
/// A drive ends when its average speed falls below this, metres per second: the robot is stuck.
const LEAST_SPEED_MPS: f64 = 0.1;

/// One frame of a drive.
pub struct DriveMoment {
    /// What the sensors measured. Where there is a picture, the panorama is a blank of one pixel;
    /// [`Sight`] has the picture.
    pub frame: SensorFrame,
    /// Where the robot was. For scoring only.
    pub world_from_base: Pose2,
    /// Distance truly driven until then, metres.
    pub driven_m: f64,
}

/// A drive.
pub struct RecordedDrive {
    /// Frame by frame.
    pub moments: Vec<DriveMoment>,
    photographer: Photographer,
}

/// Without a map there are no paths.
struct NoPaths;

impl PathSource for NoPaths {
    fn plan(&mut self, _: Point2, _: Point2, _: &BTreeSet<FixedPoint>) -> Result<PlannedPath, ErrorReply> {
        Err(ErrorReply::new(ErrorCode::UnknownMap, "a robot without a map"))
    }
}

fn blank() -> Panorama {
    Panorama { views: std::array::from_fn(|_| RgbImage::new(1, 1)) }
}

impl RecordedDrive {
    /// Drops a robot at `start` (`world_from_base`) and lets it wander for `longest_m` metres.
    /// `seed` determines noise, wheels, light and wandering.
    #[must_use]
    pub fn record(world: &Arc<World>, start: Pose2, seed: u64, longest_m: f64) -> Self {
        let config = SimConfig { light_seed: seed, camera_every: 0, ..SimConfig::default() };
        let photographer = Photographer::new(Arc::clone(world), &config, seed);
        let most_frames = (longest_m / LEAST_SPEED_MPS * 1e6 / config.lidar_period_us as f64) as usize;
        let mut simulator = Simulator::new(Arc::clone(world), config, start, seed);
        let nowhere = Landmarks::default();
        let wander =
            PilotConfig { seed, max_search_m: f64::INFINITY, max_time_s: f64::INFINITY, ..PilotConfig::default() };
        let mut pilot = Pilot::new(wander, Task::Relocalize);
        let mut moments = Vec::new();
        let mut frame = simulator.sense_first();
        loop {
            let command = pilot.step(&nowhere, &frame, || None, &mut NoPaths).command;
            if moments.len().is_multiple_of(PICTURE_EVERY) {
                frame.panorama = Some(blank());
            }
            let (world_from_base, driven_m) = (simulator.truth(), simulator.driven_m());
            moments.push(DriveMoment { frame, world_from_base, driven_m });
            if driven_m >= longest_m || moments.len() >= most_frames {
                return Self { moments, photographer };
            }
            frame = simulator.step(command);
        }
    }
}

/// The pictures of a drive. Each is taken and described on the first request, and then kept.
pub struct Sight<'a> {
    drive: &'a RecordedDrive,
    net: &'a mut DescriptorNet,
    known: BTreeMap<usize, (Option<Descriptor>, Duration)>,
}

impl<'a> Sight<'a> {
    /// Before the first request.
    #[must_use]
    pub fn new(drive: &'a RecordedDrive, net: &'a mut DescriptorNet) -> Self {
        Self { drive, net, known: BTreeMap::new() }
    }

    /// The drive.
    #[must_use]
    pub fn drive(&self) -> &'a RecordedDrive {
        self.drive
    }

    /// The descriptor of the picture at a moment, and how long the network took for it.
    pub fn describe(&mut self, moment: usize) -> (Option<Descriptor>, Duration) {
        if let Some(known) = self.known.get(&moment) {
            return known.clone();
        }
        let Some(DriveMoment { world_from_base, .. }) = self.drive.moments.get(moment) else {
            return (None, Duration::ZERO);
        };
        let panorama = self.drive.photographer.panorama(world_from_base, &[], moment as u64);
        let begin = Instant::now();
        let descriptor = self.net.descriptor(&panorama).ok();
        let described = (descriptor, begin.elapsed());
        self.known.insert(moment, described.clone());
        described
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_drive_is_the_same_again_and_gets_somewhere() {
        let world = Arc::new(fht_sim::load("museum", None, 1).unwrap());
        let record = || RecordedDrive::record(&world, world.start(), 5, 4.0);
        let (drive, again) = (record(), record());
        let last = drive.moments.last().unwrap();
        assert!(last.driven_m >= 4.0, "{}", last.driven_m);
        assert_eq!(last.world_from_base, again.moments.last().unwrap().world_from_base);
        assert_eq!(drive.moments.len(), again.moments.len());
        assert!(drive.moments[5].frame.panorama.is_some() && drive.moments[6].frame.panorama.is_none());
    }
}
