//! The landmarks of a map that changes while a robot uses it, and may become another map of the
//! same name.

use crate::landmarks::Landmarks;
use crate::preparation::Preparation;
use fht_map::MapState;
use fht_worker::Taking;

/// Landmarks that follow a map.
pub struct LiveLandmarks {
    landmarks: Landmarks,
    preparation: Preparation,
    taking: Taking,
    generation: u64,
    seen_changes: Option<u64>,
}

impl LiveLandmarks {
    /// Of a map that is at this generation; `taking` says when the walls of a change are used.
    #[must_use]
    pub fn start(taking: Taking, generation: u64) -> Self {
        Self {
            landmarks: Landmarks::default(),
            preparation: Preparation::start(taking),
            taking,
            generation,
            seen_changes: None,
        }
    }

    /// Once per frame, before [`LiveLandmarks::follow`]: the map that is followed then is of this
    /// generation, or a newer one. Begins anew if it is another map than before, and says whether
    /// it is.
    pub fn restart_at(&mut self, generation: u64) -> bool {
        let is_other = generation != self.generation;
        if is_other {
            // What is being put together is of the old one.
            *self = Self::start(self.taking, generation);
        }
        is_other
    }

    /// Once per frame: `view` shows the map, and is called only if the number of its changes is
    /// another one than before.
    pub fn follow(&mut self, changes: u64, view: impl FnOnce(&mut dyn FnMut(&MapState))) {
        if self.seen_changes.replace(changes) != Some(changes) {
            view(&mut |map| self.preparation.follow(&mut self.landmarks, map));
        }
        self.preparation.take(&mut self.landmarks);
    }

    /// The landmarks.
    #[must_use]
    pub fn landmarks(&self) -> &Landmarks {
        &self.landmarks
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_map_is_looked_at_when_it_has_changed_and_another_one_anew() {
        let mut looks = 0;
        let mut live = LiveLandmarks::start(Taking::AfterFrames(2), 0);
        for (generation, changes, expected) in [(0, 1, 1), (0, 1, 1), (0, 2, 2), (1, 2, 3), (1, 2, 3)] {
            let was = live.generation;
            assert_eq!(live.restart_at(generation), was != generation);
            live.follow(changes, |follow| {
                looks += 1;
                follow(&MapState::new());
            });
            assert_eq!(looks, expected, "generation {generation}, {changes} changes");
        }
    }
}
