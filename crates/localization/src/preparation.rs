//! Putting a changed map's walls together beside the robot's loop.

use crate::landmarks::{Landmarks, WallsTask};
use fht_map::MapState;
use fht_perception::reference_map::ReferenceMap;
use fht_worker::{BackgroundWorker, Taking};
use std::time::Duration;

/// Longest that a run in simulated time waits for the thread.
const PATIENCE: Duration = Duration::from_secs(60);

/// Keeps landmarks up to date with a map that changes.
pub struct Preparation {
    /// None if the system gave no thread: then it is done in the loop.
    thread: Option<BackgroundWorker<WallsTask, ReferenceMap>>,
}

impl Preparation {
    /// Starts the thread; `taking` says when what it made is used.
    #[must_use]
    pub fn start(taking: Taking) -> Self {
        let thread = BackgroundWorker::newest_first("reference map", taking, PATIENCE, WallsTask::run);
        Self { thread: thread.inspect_err(|error| tracing::warn!(%error, "no thread for the map's walls")).ok() }
    }

    /// The map has changed. Until what all nodes saw is put together anew, the walls of before are
    /// used; the first time it is waited for, since there are none.
    pub fn follow(&mut self, landmarks: &mut Landmarks, map: &MapState) {
        match &mut self.thread {
            Some(thread) if landmarks.has_walls() => {
                landmarks.follow(map);
                thread.replace(landmarks.walls_task());
            }
            _ => landmarks.refresh(map),
        }
    }

    /// Once per frame: takes what the thread made.
    pub fn take(&mut self, landmarks: &mut Landmarks) {
        if let Some(walls) = self.thread.as_mut().and_then(BackgroundWorker::take) {
            landmarks.take_walls(walls);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_proto::{AuthorId, FixedPose, Increment, NodeId, NodeKind, Op, ScanRecord, Signature};

    fn map(nodes: u32) -> MapState {
        let author = AuthorId(1);
        let scan = |metres: u16| ScanRecord {
            base_from_sensor: FixedPose::default(),
            angle_min: 0.0,
            angle_increment: 0.1,
            ranges_mm: vec![1000 * metres; 60],
        };
        let mut map = MapState::new();
        for number in 0..nodes {
            let id = NodeId { author, number };
            let signature = Signature { descriptor: None, scan: scan(1 + number as u16) };
            let ops = vec![
                Op::PutNode { id, kind: NodeKind::Main, pose: FixedPose::default() },
                Op::SetSignature { id, signature },
            ];
            map.apply(&Increment { author, number: u64::from(number) + 1, hlc_us: u64::from(number) + 1, ops });
        }
        map
    }

    #[test]
    fn walls_of_before_are_used_until_the_new_ones_are_due() {
        let mut landmarks = Landmarks::default();
        let mut preparation = Preparation::start(Taking::AfterFrames(2));
        preparation.follow(&mut landmarks, &map(1));
        preparation.take(&mut landmarks);
        let before = landmarks.walls().cloud.len();
        preparation.follow(&mut landmarks, &map(2));
        assert_eq!(landmarks.len(), 2);
        preparation.take(&mut landmarks);
        assert_eq!(landmarks.walls().cloud.len(), before);
        preparation.take(&mut landmarks);
        assert_eq!(landmarks.walls().cloud.len(), 2 * before);
    }
}
