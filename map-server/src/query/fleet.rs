//! The robots of all maps: what each reported last, whether it is alive, and whether it keeps up.

use crate::config::FleetConfig;
use fht_proto::api::fleet::{FleetReply, RobotRole, RobotStatus, RobotView};
use fht_proto::api::reply::Head;
use fht_proto::{AuthorId, MapName, VersionVector};
use std::collections::BTreeMap;
use std::ops::Bound;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Vectors of one reply have so many entries, about; then it is cut off.
const MAX_ENTRIES: usize = 16_384;

/// What is known about one robot. Times are the server's, microseconds.
#[derive(Clone, Debug)]
struct Seen {
    status: Option<(RobotStatus, u64)>,
    is_alive: bool,
    /// Since when it has lacked something, as last observed.
    lacks_since_us: Option<u64>,
}

impl Seen {
    /// Roughly how much memory it takes, bytes.
    fn memory_bytes(&self) -> usize {
        let vector = self.status.as_ref().map_or(0, |(status, _)| status.vector.iter().count());
        FIXED_BYTES + vector * size_of::<(AuthorId, u64)>()
    }

    /// When it was heard last.
    fn heard_us(&self) -> u64 {
        self.status.as_ref().map_or(0, |(_, at_us)| *at_us)
    }
}

/// What is known about a robot takes about so much memory without its vector, bytes: two names, and
/// what else is in a status.
const FIXED_BYTES: usize = 512;

#[derive(Debug, Default)]
struct Known {
    robots: BTreeMap<(MapName, String), Seen>,
    bytes: usize,
}

impl Known {
    fn forget(&mut self, key: &(MapName, String)) {
        if let Some(seen) = self.robots.remove(key) {
            self.bytes -= seen.memory_bytes();
        }
    }

    /// The robot of those that `may` go that was not heard for the longest time, but not `but`; one
    /// that has gone rather than one that is there.
    fn silent(&self, but: &(MapName, String), may: impl Fn(&MapName, &Seen) -> bool) -> Option<(MapName, String)> {
        let others = self.robots.iter().filter(|(key, seen)| *key != but && may(&key.0, seen));
        others.min_by_key(|(_, seen)| (seen.is_alive, seen.heard_us())).map(|(key, _)| key.clone())
    }
}

/// All robots.
#[derive(Debug, Default)]
pub struct Fleet {
    config: FleetConfig,
    known: Mutex<Known>,
}

/// How many increments of `should` are missing in `has`.
fn lacking(should: &VersionVector, has: &VersionVector) -> u64 {
    should.iter().fold(0, |sum, (author, count)| sum.saturating_add(count.saturating_sub(has.get(author))))
}

impl Fleet {
    /// No robots yet.
    #[must_use]
    pub fn new(config: FleetConfig) -> Self {
        Self { config, known: Mutex::default() }
    }

    // Whole operations under the lock: a panic in one is a bug, and leaves the others usable.
    fn lock(&self) -> MutexGuard<'_, Known> {
        self.known.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn change(&self, map: &MapName, robot: &str, change: impl FnOnce(&mut Seen)) {
        let mut known = self.lock();
        let key = (map.clone(), robot.to_owned());
        if !known.robots.contains_key(&key) {
            let of_map = known.robots.keys().filter(|(of, _)| of == map).count();
            // Of the robots that have gone, the one not heard for the longest time makes room.
            let is_full = known.robots.len() >= self.config.max_robots;
            if is_full || of_map >= self.config.max_robots_of_map {
                let may_go =
                    |of: &MapName, seen: &Seen| !seen.is_alive && (of_map < self.config.max_robots_of_map || of == map);
                let Some(gone) = known.silent(&key, may_go) else { return };
                known.forget(&gone);
            }
        }
        let seen =
            known.robots.entry(key.clone()).or_insert(Seen { status: None, is_alive: false, lacks_since_us: None });
        let new = seen.status.is_none() && !seen.is_alive;
        let before = if new { 0 } else { seen.memory_bytes() };
        change(seen);
        let after = seen.memory_bytes();
        known.bytes = known.bytes + after - before;
        while known.bytes > self.config.max_bytes {
            let Some(silent) = known.silent(&key, |_, _| true) else { return };
            known.forget(&silent);
        }
    }

    /// A robot's liveliness token has appeared or gone.
    pub fn set_alive(&self, map: &MapName, robot: &str, is_alive: bool) {
        self.change(map, robot, |seen| seen.is_alive = is_alive);
    }

    /// Whether a robot's token is there.
    #[must_use]
    pub fn is_alive(&self, map: &MapName, robot: &str) -> bool {
        let known = self.lock();
        known.robots.get(&(map.clone(), robot.to_owned())).is_some_and(|seen| seen.is_alive)
    }

    /// The name of the robot that writes to a map as an author, if it was heard of.
    #[must_use]
    pub fn name_of(&self, map: &MapName, author: AuthorId) -> Option<String> {
        self.names(map).into_iter().find(|(of, _)| *of == author).map(|(_, name)| name)
    }

    /// The robots of a map that were heard of, and the authors that they are.
    #[must_use]
    pub fn names(&self, map: &MapName) -> Vec<(AuthorId, String)> {
        let known = self.lock();
        let names = known.robots.keys().filter(|(of, _)| of == map).map(|(_, name)| name);
        names.map(|name| (AuthorId::of_robot(name), name.clone())).collect()
    }

    /// A robot has reported its status at `now_us`, when `head` was the newest. Of its vector the
    /// authors are kept whom the map knows.
    pub fn take_status(&self, map: &MapName, robot: &str, status: RobotStatus, head: &Head, now_us: u64) {
        let lacks = lacks_anything(&status, head);
        let mut vector = VersionVector::default();
        let of_map = status.vector.iter().filter(|(author, _)| head.vector.get(*author) > 0);
        of_map.for_each(|(author, count)| vector.set(author, count));
        let status = RobotStatus { vector, ..status };
        self.change(map, robot, |seen| {
            seen.lacks_since_us = lacks.then(|| seen.lacks_since_us.unwrap_or(now_us));
            seen.status = Some((status, now_us));
        });
    }

    /// A map has grown, or has another release, at `now_us`: from then on those are behind who lack
    /// it.
    pub fn map_changed(&self, head: &Head, now_us: u64) {
        let mut known = self.lock();
        let first = Bound::Included((head.map.clone(), String::new()));
        let of_map = known.robots.range_mut((first, Bound::Unbounded)).take_while(|((map, _), _)| *map == head.map);
        for (_, seen) in of_map {
            if let Some((status, _)) = seen.status.as_ref().filter(|_| seen.lacks_since_us.is_none()) {
                seen.lacks_since_us = lacks_anything(status, head).then_some(now_us);
            }
        }
    }

    /// The robots on the map of `head` whose names follow `after`, at `now_us`: `limit` of them, or
    /// fewer if they tell much. Robots of which only a token is known are left out.
    #[must_use]
    pub fn page(&self, head: &Head, limit: usize, after: &str, now_us: u64) -> FleetReply {
        let mut known = self.lock();
        let first = (Bound::Excluded((head.map.clone(), after.to_owned())), Bound::Unbounded);
        let of_map = known.robots.range_mut(first).take_while(|((map, _), _)| *map == head.map);
        let (mut robots, mut entries, mut truncated) = (Vec::new(), 0, false);
        for (_, seen) in of_map {
            let Some((status, at_us)) = &seen.status else { continue };
            entries += status.vector.iter().count();
            if robots.len() == limit || (entries > MAX_ENTRIES && !robots.is_empty()) {
                truncated = true;
                break;
            }
            let lacks = lacks_anything(status, head);
            // The head may have grown since the robot reported.
            seen.lacks_since_us = lacks.then(|| seen.lacks_since_us.unwrap_or(now_us));
            let since_s = |at_us: u64| (now_us.saturating_sub(at_us) as f64 * 1e-5).round() / 10.0;
            let behind_s = seen.lacks_since_us.map_or(0.0, since_s);
            let behind = lacking(&head.vector, &status.vector);
            // Who has ended is expected to catch up with nothing.
            let late = seen.is_alive && behind_s > self.config.late_after_s;
            let (status, seen_s) = (status.clone(), since_s(*at_us));
            robots.push(RobotView { status, alive: seen.is_alive, seen_s, behind, behind_s, late });
        }
        let next = robots.last().filter(|_| truncated).map(|robot| robot.status.robot.clone());
        let (version, enabled) = (head.version, head.enabled.clone());
        let enabled_unused = head.enabled_unused;
        FleetReply { map: head.map.clone(), version, enabled, enabled_unused, robots, truncated, next }
    }
}

fn lacks_anything(status: &RobotStatus, head: &Head) -> bool {
    // Explorers work on the newest state, whichever release is enabled. One that is not used can be
    // run by nobody.
    let is_to_change = status.role == RobotRole::Client && !head.enabled_unused;
    let is_elsewhere = is_to_change && status.release != head.enabled;
    lacking(&head.vector, &status.vector) > 0 || is_elsewhere
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_proto::api::fleet::{LocalizationState, RobotRole};

    const SECOND: u64 = 1_000_000;

    fn head(version: u64, enabled: Option<&str>) -> Head {
        let mut vector = VersionVector::default();
        vector.set(AuthorId(1), version);
        Head {
            version,
            vector,
            enabled: enabled.map(str::to_owned),
            ..Head::of_nothing("m".parse().unwrap_or_else(|error| panic!("{error}")))
        }
    }

    fn status(at: &Head) -> RobotStatus {
        RobotStatus {
            robot: "r1".to_owned(),
            role: RobotRole::Client,
            map: at.map.clone(),
            version: at.version,
            vector: at.vector.clone(),
            release: at.enabled.clone(),
            state: LocalizationState::Localized,
            map_from_base: None,
            stamp_us: None,
        }
    }

    #[test]
    fn a_robot_that_stays_behind_is_late() {
        let fleet = Fleet::new(FleetConfig::default());
        let (old, new) = (head(3, None), head(5, None));
        fleet.set_alive(&old.map, "r1", true);
        assert!(fleet.page(&old, 9, "", 0).robots.is_empty());
        let say =
            |of: &Head, newest: &Head, at_s: u64| fleet.take_status(&old.map, "r1", status(of), newest, at_s * SECOND);
        let view = |newest: &Head, at_s: u64| fleet.page(newest, 9, "", at_s * SECOND).robots.remove(0);
        say(&old, &old, 1);
        assert!(view(&old, 2).alive && !view(&old, 100).late, "it has everything");
        assert_eq!(view(&new, 100).behind, 2);
        say(&old, &new, 105);
        assert!(!view(&new, 109).late);
        assert!(view(&new, 111).late && view(&new, 111).behind_s == 11.0);
        say(&new, &new, 112);
        assert_eq!((view(&new, 113).behind, view(&new, 113).late), (0, false));
        let released = head(5, Some("a@00000001"));
        assert!(!view(&released, 120).late);
        assert!(view(&released, 131).late, "it runs another release than the one enabled");
        assert!(!view(&Head { enabled_unused: true, ..released.clone() }, 132).late, "nobody can run it");
        assert!(!view(&released, 133).late && view(&released, 145).late);
        fleet.set_alive(&old.map, "r1", false);
        assert!(!view(&released, 146).late && view(&released, 146).behind_s > 10.0, "it has ended");
    }

    #[test]
    fn a_silent_robot_is_behind_since_the_map_has_grown_whoever_asks() {
        let fleet = Fleet::new(FleetConfig::default());
        let (old, new) = (head(3, None), head(4, None));
        fleet.set_alive(&old.map, "r1", true);
        fleet.take_status(&old.map, "r1", status(&old), &old, SECOND);
        fleet.map_changed(&new, 10 * SECOND);
        fleet.map_changed(&head(5, None), 20 * SECOND);
        let view = fleet.page(&head(5, None), 9, "", 24 * SECOND).robots.remove(0);
        assert_eq!((view.behind, view.behind_s, view.late), (2, 14.0, true));
    }

    #[test]
    fn invented_names_push_nobody_out_who_is_there() {
        let fleet = Fleet::new(FleetConfig { max_robots: 3, ..FleetConfig::default() });
        let head = head(1, None);
        fleet.set_alive(&head.map, "here", true);
        fleet.take_status(&head.map, "here", status(&head), &head, 0);
        for name in 0..10 {
            fleet.take_status(&head.map, &format!("x{name}"), status(&head), &head, 1 + name);
        }
        let reply = fleet.page(&head, 9, "", 20);
        assert_eq!(reply.robots.len(), 3);
        assert!(reply.robots.iter().any(|robot| robot.alive));
    }

    #[test]
    fn a_fleet_that_tells_much_takes_little_memory_and_is_told_in_pages() {
        let fleet = Fleet::new(FleetConfig { max_bytes: 1 << 20, ..FleetConfig::default() });
        let mut head = head(1, None);
        // Authors that the map does not know are not kept.
        let mut invented = status(&head);
        (2..9000).for_each(|author| invented.vector.set(AuthorId(author), 7));
        fleet.take_status(&head.map, "liar", RobotStatus { robot: "liar".to_owned(), ..invented }, &head, 0);
        assert!(fleet.lock().bytes < 1000, "{}", fleet.lock().bytes);
        (2..4000).for_each(|author| head.vector.set(AuthorId(author), 7));
        for number in 0..400 {
            let robot = format!("r{number:03}");
            let status = RobotStatus { robot: robot.clone(), ..status(&head) };
            fleet.take_status(&head.map, &robot, status, &head, 1 + number);
        }
        assert!(fleet.lock().bytes <= 1 << 20);
        let (mut names, mut after) = (Vec::new(), String::new());
        loop {
            let page = fleet.page(&head, 200, &after, 500);
            assert!(page.truncated == page.next.is_some() && page.robots.len() <= 5);
            names.extend(page.robots.into_iter().map(|robot| robot.status.robot));
            match page.next {
                Some(next) => after = next,
                None => break,
            }
        }
        assert!(names.len() > 10 && names.last().is_some_and(|name| name == "r399"), "the last are kept: {names:?}");
    }

    #[test]
    fn one_map_leaves_room_for_the_robots_of_others() {
        let fleet = Fleet::new(FleetConfig { max_robots_of_map: 5, ..FleetConfig::default() });
        let (head, other) =
            (head(1, None), Head { map: "n".parse().unwrap_or_else(|error| panic!("{error}")), ..head(1, None) });
        fleet.take_status(&other.map, "here", status(&other), &other, 0);
        for name in 0..100 {
            let robot = format!("x{name}");
            fleet.take_status(
                &head.map,
                &robot,
                RobotStatus { robot: robot.clone(), ..status(&head) },
                &head,
                1 + name,
            );
        }
        assert_eq!((fleet.page(&head, 99, "", 200).robots.len(), fleet.page(&other, 99, "", 200).robots.len()), (5, 1));
    }
}
