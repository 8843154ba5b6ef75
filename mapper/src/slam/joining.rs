//! Joining a map that others began: the run has a frame of its own until the robot knows where that
//! lies in the map.

use super::closure::NewKeyframe;
use super::{Anchored, Keyframe, Slam, SlamConfig};
use crate::slam::foreign_nodes::Told;
use fht_perception::pose::Pose2;
use fht_worker::Pace;
use std::sync::Arc;

impl Slam {
    /// Before the first frame of a run that is to join a map: until [`Slam::place`], the frame is
    /// where the robot was at the first frame, and not the map's.
    ///
    /// # Errors
    /// When the system gives no thread.
    pub fn unplaced(config: SlamConfig, pace: Pace) -> std::io::Result<Self> {
        let mut slam = Self::new(config, pace)?;
        let origin = Pose2::identity();
        let anchored = Anchored { keyframe: 0, keyframe_from_base: origin };
        slam.keyframes.push(Keyframe { odom_from_base: origin, anchored });
        slam.poses.push(origin);
        let points = Arc::new(Vec::new());
        slam.next_job.keyframes.push(NewKeyframe { points, links: Vec::new(), finished: Vec::new() });
        slam.frames = 1;
        Ok(slam)
    }

    /// The robot has found out where the run's frame lies in the map: everything moves there. Waits
    /// for the back end, once in a run, because the grid is drawn anew.
    pub fn place(&mut self, map_from_run: &Pose2) {
        let Some(odom_from_base) = self.active.as_ref().map(|(_, latest)| latest.odom_from_base) else { return };
        if let Some(outcome) = self.back_end.finish() {
            self.take_result(outcome, &odom_from_base);
        }
        let frames = self.frames;
        self.poses.iter_mut().skip(frames).for_each(|pose| *pose = map_from_run * *pose);
        self.next_job.map_from_run = Some(*map_from_run);
        self.back_end.submit(std::mem::take(&mut self.next_job), self.frame);
        if let Some(outcome) = self.back_end.finish() {
            self.take_result(outcome, &odom_from_base);
        }
    }

    /// Takes in what others have told of the building.
    pub fn take_foreign_nodes(&mut self, news: Vec<Told>) {
        for told in news {
            self.hearsay.draw_news(&told, &mut self.grid);
            // What is no longer there goes when the back end draws the grid anew.
            let _ = self.hearsay.take_node(told.clone(), super::back_end::REDRAW);
            self.next_job.told.push(told);
        }
    }
}
