//! The robots of all maps: what each reported last, whether it is alive, and whether it keeps up.

use crate::config::FleetConfig;
use fht_proto::api::fleet::{FleetReply, RobotRole, RobotStatus, RobotView};
use fht_proto::api::reply::Head;
use fht_proto::{AuthorId, MapName, VersionVector};
use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// What is known about one robot. Times are the server's, microseconds.
#[derive(Clone, Debug)]
struct Seen {
    status: Option<(RobotStatus, u64)>,
    is_alive: bool,
    /// Since when it has lacked something, as last observed.
    lacks_since_us: Option<u64>,
}

/// All robots.
#[derive(Debug, Default)]
pub struct Fleet {
    config: FleetConfig,
    robots: Mutex<BTreeMap<(MapName, String), Seen>>,
}

/// How many increments of `should` are missing in `has`.
fn lacking(should: &VersionVector, has: &VersionVector) -> u64 {
    should.iter().fold(0, |sum, (author, count)| sum.saturating_add(count.saturating_sub(has.get(author))))
}

impl Fleet {
    /// No robots yet.
    #[must_use]
    pub fn new(config: FleetConfig) -> Self {
        Self { config, robots: Mutex::default() }
    }

    // Whole operations under the lock: a panic in one is a bug, and leaves the others usable.
    fn lock(&self) -> MutexGuard<'_, BTreeMap<(MapName, String), Seen>> {
        self.robots.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn change(&self, map: &MapName, robot: &str, change: impl FnOnce(&mut Seen)) {
        let mut robots = self.lock();
        let key = (map.clone(), robot.to_owned());
        if robots.len() >= self.config.max_robots && !robots.contains_key(&key) {
            // Of the robots that have gone, the one not heard for the longest time makes room.
            let heard = |seen: &Seen| seen.status.as_ref().map_or(0, |(_, at_us)| *at_us);
            let gone = robots.iter().filter(|(_, seen)| !seen.is_alive).min_by_key(|(_, seen)| heard(seen));
            let Some(gone) = gone.map(|(key, _)| key.clone()) else { return };
            robots.remove(&gone);
        }
        change(robots.entry(key).or_insert(Seen { status: None, is_alive: false, lacks_since_us: None }));
    }

    /// A robot's liveliness token has appeared or gone.
    pub fn set_alive(&self, map: &MapName, robot: &str, is_alive: bool) {
        self.change(map, robot, |seen| seen.is_alive = is_alive);
    }

    /// Whether a robot's token is there.
    #[must_use]
    pub fn is_alive(&self, map: &MapName, robot: &str) -> bool {
        let robots = self.lock();
        robots.get(&(map.clone(), robot.to_owned())).is_some_and(|seen| seen.is_alive)
    }

    /// The name of the robot that writes to a map as an author, if it was heard of.
    #[must_use]
    pub fn name_of(&self, map: &MapName, author: AuthorId) -> Option<String> {
        let robots = self.lock();
        let mut names = robots.keys().filter(|(of, _)| of == map).map(|(_, name)| name);
        names.find(|name| AuthorId::of_robot(name) == author).cloned()
    }

    /// A robot has reported its status at `now_us`, when `head` was the newest.
    pub fn take_status(&self, map: &MapName, robot: &str, status: RobotStatus, head: &Head, now_us: u64) {
        let lacks = lacks_anything(&status, head);
        self.change(map, robot, |seen| {
            seen.lacks_since_us = lacks.then(|| seen.lacks_since_us.unwrap_or(now_us));
            seen.status = Some((status, now_us));
        });
    }

    /// The robots on the map of `head`, at `now_us`. Robots of which only a token is known are left
    /// out.
    #[must_use]
    pub fn reply(&self, head: &Head, now_us: u64) -> FleetReply {
        let mut robots = self.lock();
        let of_map = robots.iter_mut().filter(|((map, _), _)| *map == head.map);
        let views = of_map.filter_map(|(_, seen)| {
            let (status, at_us) = seen.status.clone()?;
            let lacks = lacks_anything(&status, head);
            // The head may have grown since the robot reported.
            seen.lacks_since_us = lacks.then(|| seen.lacks_since_us.unwrap_or(now_us));
            let since_s = |at_us: u64| (now_us.saturating_sub(at_us) as f64 * 1e-5).round() / 10.0;
            let behind_s = seen.lacks_since_us.map_or(0.0, since_s);
            let behind = lacking(&head.vector, &status.vector);
            let late = behind_s > self.config.late_after_s;
            Some(RobotView { status, alive: seen.is_alive, seen_s: since_s(at_us), behind, behind_s, late })
        });
        let robots = views.collect();
        FleetReply { map: head.map.clone(), version: head.version, enabled: head.enabled.clone(), robots }
    }
}

fn lacks_anything(status: &RobotStatus, head: &Head) -> bool {
    // Explorers work on the newest state, whichever release is enabled.
    let is_elsewhere = status.role == RobotRole::Client && status.release != head.enabled;
    lacking(&head.vector, &status.vector) > 0 || is_elsewhere
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_proto::Digest;
    use fht_proto::api::fleet::{LocalizationState, RobotRole};

    const SECOND: u64 = 1_000_000;

    fn head(version: u64, enabled: Option<&str>) -> Head {
        let mut vector = VersionVector::default();
        vector.set(AuthorId(1), version);
        Head {
            map: "m".parse().unwrap_or_else(|error| panic!("{error}")),
            version,
            vector,
            digest: Digest([0; 32]),
            clock_us: 0,
            enabled: enabled.map(str::to_owned),
            deletion: None,
            main_nodes: 0,
            support_nodes: 0,
            edges: 0,
            bytes: 0,
            refused: 0,
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
        assert!(fleet.reply(&old, 0).robots.is_empty());
        let say =
            |of: &Head, newest: &Head, at_s: u64| fleet.take_status(&old.map, "r1", status(of), newest, at_s * SECOND);
        let view = |newest: &Head, at_s: u64| fleet.reply(newest, at_s * SECOND).robots.remove(0);
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
        let reply = fleet.reply(&head, 20);
        assert_eq!(reply.robots.len(), 3);
        assert!(reply.robots.iter().any(|robot| robot.alive));
    }
}
