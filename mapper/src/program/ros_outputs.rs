//! What an exploration with a ROS robot tells the robot's own graph: `map → odom`, the grid, the
//! way driven.

use super::way::WayDriven;
use crate::mapping::Mapper;
use crate::run::{MappedFrame, MappingObserver};
use fht_proto::api::fleet::LocalizationState;
use fht_ros_frames::FloorGrid;
use fht_ros_robot::{PlaceNow, RosOutputs};
use std::ops::ControlFlow;

/// Time between two grids, and two ways, microseconds: as slam_toolbox has it.
const FLOOR_EVERY_US: u64 = 5_000_000;
/// Time between two tellings of what has changed of the grid, microseconds.
const CHANGES_EVERY_US: u64 = 1_000_000;

/// Gives the transform with each frame, what has changed of the grid every second, grid and way
/// every five seconds and at the end.
pub(super) struct MapOutputs {
    outputs: RosOutputs,
    way: WayDriven,
    next_us: u64,
    next_changes_us: u64,
    last_us: u64,
}

impl MapOutputs {
    pub(super) fn new(outputs: RosOutputs) -> Self {
        Self { outputs, way: WayDriven::default(), next_us: 0, next_changes_us: 0, last_us: 0 }
    }

    fn give_floor(&self, mapper: &Mapper) {
        let grid = mapper.grid().clone();
        self.outputs.floor(self.last_us, move || FloorGrid::from(&grid));
        self.outputs.way(self.last_us, self.way.poses(mapper).collect());
    }
}

impl MappingObserver for MapOutputs {
    fn on_frame(&mut self, mapped: &MappedFrame<'_>) -> ControlFlow<()> {
        let (frame, mapper) = (mapped.frame, mapped.mapper);
        self.last_us = frame.time_us;
        self.way.follow(mapper);
        let latest = mapper.latest().filter(|_| mapper.is_placed());
        let state = if latest.is_some() { LocalizationState::Localized } else { LocalizationState::NotLocalized };
        self.outputs.place(PlaceNow {
            time_us: frame.time_us,
            state,
            confidence: if latest.is_some() { 1.0 } else { 0.0 },
            odom_from_base: frame.odom_from_base,
            map_from_base: latest.map(|latest| latest.map_from_base),
            candidates: Vec::new(),
            lost_because: None,
        });
        if frame.time_us >= self.next_us {
            self.next_us = frame.time_us + FLOOR_EVERY_US;
            self.next_changes_us = frame.time_us + CHANGES_EVERY_US;
            self.give_floor(mapper);
        } else if frame.time_us >= self.next_changes_us {
            self.next_changes_us = frame.time_us + CHANGES_EVERY_US;
            let grid = mapper.grid().clone();
            self.outputs.floor_changes(frame.time_us, move || FloorGrid::from(&grid));
        }
        ControlFlow::Continue(())
    }

    fn on_end(&mut self, mapper: &Mapper) {
        if self.last_us > 0 {
            self.give_floor(mapper);
        }
    }
}
