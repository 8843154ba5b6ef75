//! Whoever watches a run: a display, a recording, a score against the truth.

use crate::mapping::Mapper;
use fht_perception::frame::SensorFrame;
use std::ops::ControlFlow;

/// A frame that was mapped.
pub struct MappedFrame<'a> {
    /// What the sensors said.
    pub frame: &'a SensorFrame,
    /// Time since the first frame, microseconds.
    pub elapsed_us: u64,
    /// What is known with it.
    pub mapper: &'a Mapper,
    /// Increments that this robot has written, those of its earlier runs included.
    pub written: u64,
    /// Of these, what the server has durably.
    pub acknowledged: u64,
}

/// Watches a run from the loop's thread, and may end it: a display, a recording, a score against
/// the truth.
pub trait MappingObserver {
    /// The run begins; no frame was sensed yet.
    fn on_start(&mut self, mapper: &Mapper) {
        let _ = mapper;
    }

    /// A frame was mapped. [`ControlFlow::Break`] stops the robot and ends the run, with the map
    /// finished as it is.
    fn on_frame(&mut self, mapped: &MappedFrame<'_>) -> ControlFlow<()>;

    /// The map is finished.
    fn on_end(&mut self, mapper: &Mapper) {
        let _ = mapper;
    }
}

/// Nobody watches.
impl MappingObserver for () {
    fn on_frame(&mut self, _: &MappedFrame<'_>) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }
}

/// Both watch.
impl<A: MappingObserver, B: MappingObserver> MappingObserver for (A, B) {
    fn on_start(&mut self, mapper: &Mapper) {
        self.0.on_start(mapper);
        self.1.on_start(mapper);
    }

    fn on_frame(&mut self, mapped: &MappedFrame<'_>) -> ControlFlow<()> {
        let first = self.0.on_frame(mapped);
        let second = self.1.on_frame(mapped);
        if first.is_break() { first } else { second }
    }

    fn on_end(&mut self, mapper: &Mapper) {
        self.0.on_end(mapper);
        self.1.on_end(mapper);
    }
}
