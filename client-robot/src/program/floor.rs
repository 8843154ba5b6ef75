//! The floor of a map as others draw it, and when it is worth giving again.

use fht_localization::landmarks::Landmarks;
use fht_map::MapState;
use fht_ros_frames::FloorGrid;

/// Least time between two states of the map, microseconds.
const MAP_PERIOD_US: u64 = 5_000_000;

/// When the map is given.
#[derive(Default)]
pub(super) struct MapTurns {
    /// The newest state that was given.
    given: Option<u64>,
    next_us: u64,
}

impl MapTurns {
    /// Whether the map, whose state has this number (see
    /// [`LiveReplica::changes`](fht_client::LiveReplica::changes)), is to be given now: it has
    /// changed, and the last time was long enough ago or this is the `end`.
    pub(super) fn is_due(&mut self, time_us: u64, changes: u64, is_end: bool) -> bool {
        let is_due = self.given != Some(changes) && (is_end || time_us >= self.next_us);
        if is_due {
            self.given = Some(changes);
            self.next_us = time_us.saturating_add(MAP_PERIOD_US);
        }
        is_due
    }
}

/// What the map's main nodes saw and its rectangles say, as the robot weighs its poses by.
pub(super) fn known_floor(map: &MapState) -> FloorGrid {
    let mut landmarks = Landmarks::default();
    landmarks.refresh(map);
    FloorGrid::from(&landmarks.walls().known)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_map_is_given_when_it_changes_but_not_too_often() {
        let frame_us = 200_000;
        let times = |changes_at: &dyn Fn(u64) -> u64| {
            let mut turns = MapTurns::default();
            (0..=60)
                .filter(|frame| turns.is_due(frame * frame_us, changes_at(*frame), *frame == 60))
                .collect::<Vec<_>>()
        };
        assert_eq!(times(&|_| 7), [0], "a map that stays as it is is given once");
        assert_eq!(times(&|frame| frame), [0, 25, 50, 60], "every five seconds, and at the end");
        assert_eq!(times(&|frame| u64::from(frame >= 3) + u64::from(frame >= 40)), [0, 25, 50]);
    }
}
