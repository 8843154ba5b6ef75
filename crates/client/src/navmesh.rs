//! The free space of the robot's own copy of the map, made beside the loop: in a hospital that
//! takes a tenth of a second.

use crate::own_paths::{entry_node, plan_inside, with_entry};
use crate::planned_path::PlannedPath;
use fht_map::{FreeSpace, MapState, PathEnds, Rules};
use fht_perception::pose::Point2;
use fht_proto::Footprint;
use fht_proto::api::reply::{ErrorCode, ErrorReply};
use fht_worker::{BackgroundWorker, Taking};
use std::ops::Deref;
use std::sync::Arc;
use std::time::Duration;

/// Longest that a run in simulated time waits for the thread.
const PATIENCE: Duration = Duration::from_secs(60);

/// What free space is of.
#[derive(Clone, Debug)]
struct Basis {
    /// Which state of the map.
    changes: u64,
    rules: Arc<Rules>,
}

impl PartialEq for Basis {
    fn eq(&self, other: &Self) -> bool {
        self.changes == other.changes && self.rules.closes_the_same(&other.rules)
    }
}

struct Task {
    map: MapState,
    basis: Basis,
    footprint: Footprint,
}

struct Made {
    basis: Basis,
    space: FreeSpace,
}

impl Task {
    fn run(self) -> Made {
        let config = self.basis.rules.space_config_for(&self.footprint);
        Made { space: FreeSpace::of(&self.map, &config), basis: self.basis }
    }
}

/// A way that was asked for and may be planned better on the free space that is being made.
struct Wish {
    way: (Point2, Point2, PathEnds),
    basis: Basis,
}

/// The free space of the newest map that was planned on: it is made when the map or what is blocked
/// has changed.
#[derive(Default)]
pub struct FreeSpaceCache {
    made: Option<Made>,
    /// None: it is made where it is asked for.
    thread: Option<BackgroundWorker<Task, Made>>,
    /// What the thread was given last.
    making: Option<Basis>,
    wish: Option<Wish>,
    footprint: Footprint,
}

impl FreeSpaceCache {
    /// Free space is made by a thread; `taking` says when it is used. Without a thread from the
    /// system, in the loop.
    #[must_use]
    pub fn beside(taking: Taking) -> Self {
        let thread = BackgroundWorker::newest_first("free space", taking, PATIENCE, Task::run);
        let thread = thread.inspect_err(|error| tracing::warn!(%error, "no thread for the map's free space")).ok();
        Self { thread, ..Self::default() }
    }

    /// The same for a robot of another footprint. Default: the explorers'.
    #[must_use]
    pub fn for_footprint(self, footprint: Footprint) -> Self {
        Self { made: None, footprint, ..self }
    }

    /// The robot that paths are free for.
    #[must_use]
    pub fn footprint(&self) -> &Footprint {
        &self.footprint
    }

    /// Plans on a map at hand; `changes` is a number that changes whenever the map does. While its
    /// free space is being made the path is that of before, unless a place was blocked since: then
    /// there is none yet. Either way [`Self::revised`] brings another.
    ///
    /// # Errors
    /// Why there is no path, in the server's words.
    pub fn plan(
        &mut self,
        map: &MapState,
        changes: u64,
        from: Point2,
        to: Point2,
        rules: &Arc<Rules>,
    ) -> Result<PlannedPath, ErrorReply> {
        self.plan_between(map, changes, (from, to, PathEnds::Unknown), rules)
    }

    /// The same for two places of which something is known, or a goal that may be moved.
    ///
    /// # Errors
    /// Why there is no path, in the server's words.
    pub fn plan_between(
        &mut self,
        map: &MapState,
        changes: u64,
        way: (Point2, Point2, PathEnds),
        rules: &Arc<Rules>,
    ) -> Result<PlannedPath, ErrorReply> {
        let basis = Basis { changes, rules: Arc::clone(rules) };
        let footprint = &self.footprint.clone();
        self.wish = None;
        if self.made.as_ref().is_none_or(|made| made.basis != basis) {
            self.make(map, &basis);
        }
        match &self.made {
            Some(made) if made.basis == basis => plan_on(map, made, footprint, way),
            older => {
                self.wish = Some(Wish { way, basis });
                match older {
                    Some(made) if made.basis.rules.closes_all_of(rules) => plan_on(map, made, footprint, way),
                    _ => Err(ErrorReply::new(ErrorCode::NoPath, "the free space of the map is being made")),
                }
            }
        }
    }

    fn make(&mut self, map: &MapState, basis: &Basis) {
        let task = || Task { map: map.clone(), basis: basis.clone(), footprint: self.footprint.clone() };
        let Some(thread) = &mut self.thread else {
            self.made = Some(task().run());
            return;
        };
        // Of a map that changes all the time the one under way is waited for: it is newer than what
        // there is.
        let is_under_way =
            thread.is_pending() && self.making.as_ref().is_some_and(|it| it.rules.closes_the_same(&basis.rules));
        if !is_under_way {
            thread.replace(task());
            self.making = Some(basis.clone());
        }
    }

    /// Whether a better answer to the last question may still come.
    #[must_use]
    pub fn is_pending(&self) -> bool {
        self.wish.is_some() && self.thread.as_ref().is_some_and(BackgroundWorker::is_pending)
    }

    /// The last question was answered by somebody else.
    pub fn forget_wish(&mut self) {
        self.wish = None;
    }

    /// Once per frame: takes what the thread made, and plans the last way anew on it. `map` is
    /// asked only then.
    pub fn revised<M: Deref<Target = MapState>>(
        &mut self,
        map: impl FnOnce() -> M,
    ) -> Option<Result<PlannedPath, ErrorReply>> {
        let made = self.thread.as_mut().and_then(BackgroundWorker::take)?;
        let made = self.made.insert(made);
        let wish = self.wish.take().filter(|wish| wish.basis.rules.closes_the_same(&made.basis.rules))?;
        Some(plan_on(&map(), made, &self.footprint, wish.way))
    }
}

fn plan_on(
    map: &MapState,
    made: &Made,
    footprint: &Footprint,
    (from, to, ends): (Point2, Point2, PathEnds),
) -> Result<PlannedPath, ErrorReply> {
    let plan = |start| plan_inside(map, &made.space, &made.basis.rules, (start, to, ends));
    with_entry(from, entry_node(map, footprint, from), plan)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::own_paths::rules_of_own;
    use fht_proto::{AuthorId, FixedPoint, FixedPose, Increment, NodeId, NodeKind, Op, Rect};
    use std::collections::BTreeSet;

    /// A hall of 10 m, or of 20 m.
    fn hall(length_m: f64) -> MapState {
        let (id, pose) = (NodeId { author: AuthorId(1), number: 1 }, FixedPose::from_metres(1.0, 1.0, 0.0));
        let rect = Rect::around(pose.position, (0.0, 0.0), (length_m, 4.0));
        let ops = vec![Op::PutNode { id, kind: NodeKind::Support, pose }, Op::SetFreeSpace { id, rect: Some(rect) }];
        let mut map = MapState::new();
        map.apply(&Increment { author: AuthorId(1), number: 1, hlc_us: 1, ops });
        map
    }

    fn at(x: f64) -> Point2 {
        Point2::new(x, 2.0)
    }

    #[test]
    fn the_robot_goes_on_with_the_free_space_of_before_until_the_new_one_is_due() {
        let (short, long, none) = (hall(10.0), hall(20.0), Arc::default());
        let mut cache = FreeSpaceCache::beside(Taking::AfterFrames(2));
        assert!(cache.plan(&short, 1, at(1.0), at(9.0), &none).is_err() && cache.is_pending());
        assert!(cache.revised(|| &short).is_none());
        let first = cache.revised(|| &short).expect("due").expect("a path");
        assert_eq!(first.length_m, 8.0);
        assert!(!cache.is_pending());
        // At once now, and beyond the old hall two frames after the map has changed.
        assert!(cache.plan(&short, 1, at(1.0), at(5.0), &none).is_ok() && !cache.is_pending());
        assert!(cache.plan(&long, 2, at(1.0), at(9.0), &none).is_ok() && cache.is_pending());
        let _ = cache.plan(&long, 2, at(1.0), at(19.0), &none);
        assert!(cache.revised(|| &long).is_none());
        assert!(cache.revised(|| &long).is_some_and(|path| path.is_ok_and(|path| path.length_m == 18.0)));
    }

    #[test]
    fn no_way_leads_through_a_place_that_was_blocked_since() {
        let (map, none) = (hall(10.0), Arc::default());
        let blocked = rules_of_own(&BTreeSet::from([FixedPoint::from_metres(5.0, 2.0)]));
        let mut cache = FreeSpaceCache::beside(Taking::AfterFrames(1));
        let _ = cache.plan(&map, 1, at(1.0), at(9.0), &none);
        assert!(cache.revised(|| &map).is_some_and(|path| path.is_ok()));
        assert!(cache.plan(&map, 1, at(1.0), at(9.0), &blocked).is_err() && cache.is_pending());
        let round = cache.revised(|| &map).expect("due").expect("a path");
        assert!(round.points.len() > 2);
        // What is open again is no reason to stand still.
        assert!(cache.plan(&map, 1, at(1.0), at(9.0), &none).is_ok_and(|path| path.points.len() > 2));
        assert!(cache.revised(|| &map).is_some_and(|path| path.is_ok_and(|path| path.points.len() == 2)));
    }

    #[test]
    fn a_robot_that_does_not_fit_gets_no_path() -> Result<(), fht_proto::Invalid> {
        let (map, none) = (hall(10.0), Arc::default());
        let plan = |radius_m| {
            let footprint = Footprint::disc(radius_m)?;
            Ok(FreeSpaceCache::default().for_footprint(footprint).plan(&map, 1, at(2.5), at(8.0), &none))
        };
        assert!(plan(1.9)?.is_ok_and(|path| path.length_m == 5.5));
        assert!(plan(1.99)?.is_err_and(|refusal| refusal.code == ErrorCode::NoPath));
        Ok(())
    }

    #[test]
    fn a_map_that_changes_all_the_time_does_not_starve_it() {
        let (map, none) = (hall(10.0), Arc::default());
        let mut cache = FreeSpaceCache::beside(Taking::AfterFrames(3));
        let paths = (0..12).filter(|changes| {
            let _ = cache.plan(&map, *changes, at(1.0), at(9.0), &none);
            cache.revised(|| &map).is_some_and(|path| path.is_ok())
        });
        assert_eq!(paths.count(), 4);
    }
}
