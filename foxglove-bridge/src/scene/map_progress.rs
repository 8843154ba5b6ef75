//! What a receiver has been told of a map, and what has changed since. Who is slow is told less
//! often, and never anything that is no longer so: nothing waits in a queue but ids.

use crate::scene::entities::{EntityKey, MapScene};
use fht_map::crdt::diff::diff;
use fht_proto::{EdgeKey, Label, NodeId, Zone};
use foxglove::messages::{SceneEntityDeletion, SceneUpdate, Timestamp, scene_entity_deletion};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// So many entities at most are in one message: some 100 KB.
const MAX_ENTITIES: usize = 400;

/// What a receiver has been told of a map.
#[derive(Debug, Default)]
pub struct MapProgress {
    told: Option<Arc<MapScene>>,
    telling: Option<Telling>,
}

/// What is being told.
#[derive(Debug)]
struct Telling {
    of: Arc<MapScene>,
    keys: std::vec::IntoIter<EntityKey>,
    /// Whether the receiver may have others, of an earlier connection.
    is_anew: bool,
}

impl MapProgress {
    /// What comes next; `None` when the receiver has been told all of `now`. The first message
    /// deletes whatever the receiver has on this channel.
    pub fn next(&mut self, now: &Arc<MapScene>, at: Timestamp) -> Option<SceneUpdate> {
        if self.telling.is_none() {
            if self.told.as_ref().is_some_and(|told| Arc::ptr_eq(told, now)) {
                return None;
            }
            let keys = changed(self.told.as_deref().unwrap_or(&MapScene::default()), now);
            let telling = Telling { of: Arc::clone(now), keys: keys.into_iter(), is_anew: self.told.is_none() };
            self.telling = Some(telling);
        }
        let telling = self.telling.as_mut()?;
        let mut update = SceneUpdate::default();
        if std::mem::take(&mut telling.is_anew) {
            update.deletions.push(deletion(None, at));
        }
        for key in telling.keys.by_ref().take(MAX_ENTITIES) {
            match telling.of.entity(&key, at) {
                Some(entity) => update.entities.push(entity),
                None => update.deletions.push(deletion(Some(key.to_string()), at)),
            }
        }
        if telling.keys.len() == 0 {
            self.told = self.telling.take().map(|telling| telling.of);
        }
        (!update.deletions.is_empty() || !update.entities.is_empty()).then_some(update)
    }
}

/// Deletes an entity, or all of them.
pub(crate) fn deletion(id: Option<String>, at: Timestamp) -> SceneEntityDeletion {
    let kind = if id.is_some() { scene_entity_deletion::Type::MatchingId } else { scene_entity_deletion::Type::All };
    SceneEntityDeletion { timestamp: Some(at), r#type: kind.into(), id: id.unwrap_or_default() }
}

/// What looks different, or is gone.
fn changed(before: &MapScene, now: &MapScene) -> Vec<EntityKey> {
    let differs = diff(&before.state, &now.state);
    let moved = || differs.moved.iter().map(|(id, _)| *id);
    let nodes: BTreeSet<NodeId> =
        differs.added.iter().chain(&differs.removed).chain(&differs.changed).copied().chain(moved()).collect();
    let of_moved = moved()
        .flat_map(|id| now.state.neighbours(id).map(move |other| EdgeKey::new(id, other.id)).collect::<Vec<_>>());
    let lists = [&differs.added_edges, &differs.removed_edges, &differs.closed_edges, &differs.opened_edges];
    let edges: BTreeSet<EdgeKey> = lists.into_iter().flatten().copied().chain(of_moved).collect();
    let mut keys: Vec<EntityKey> = nodes.into_iter().map(EntityKey::Node).collect();
    keys.extend(edges.into_iter().map(EntityKey::Edge));
    keys.extend(other_annotations(before, now));
    let robots: BTreeSet<&String> = [before, now].iter().flat_map(|it| &it.rules.blocked).map(|by| &by.robot).collect();
    let is_other = |robot: &&String| {
        let edges_of_moved =
            || now.blocked_by(robot).flat_map(|by| &by.edges).any(|edge| touches(edge, &differs.moved));
        !before.blocked_by(robot).eq(now.blocked_by(robot)) || edges_of_moved()
    };
    keys.extend(robots.into_iter().filter(is_other).cloned().map(EntityKey::Blocked));
    keys
}

fn touches(edge: &EdgeKey, moved: &[(NodeId, f64)]) -> bool {
    // In the order of ids.
    [edge.low(), edge.high()].iter().any(|end| moved.binary_search_by_key(end, |(id, _)| *id).is_ok())
}

/// Places and zones that are not what they were.
fn other_annotations(before: &MapScene, now: &MapScene) -> BTreeSet<EntityKey> {
    let (before, now) = (before.state.annotations(), now.state.annotations());
    let places = before.places().chain(now.places()).map(|(name, _)| name);
    let places = places.filter(|name| before.place(name) != now.place(name));
    let zones_before: BTreeMap<&Label, &Zone> = before.zones().collect();
    let zones_now: BTreeMap<&Label, &Zone> = now.zones().collect();
    let zones = zones_before.keys().chain(zones_now.keys()).copied();
    let zones = zones.filter(|name| zones_before.get(name) != zones_now.get(name));
    places.cloned().map(EntityKey::Place).chain(zones.cloned().map(EntityKey::Zone)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_map::Rules;
    use fht_map::plan::blocked::BlockedBy;
    use fht_proto::{AuthorId, FixedPoint, FixedPose, Increment, NodeKind, Op, ZoneRule};

    const AUTHOR: AuthorId = AuthorId(10);

    fn node(number: u32) -> NodeId {
        NodeId { author: AUTHOR, number }
    }

    fn put(number: u32, x: f64) -> Op {
        Op::PutNode { id: node(number), kind: NodeKind::Support, pose: FixedPose::from_metres(x, 0.0, 0.0) }
    }

    /// A map that grows, and what a receiver draws of it.
    #[derive(Default)]
    struct Site {
        now: MapScene,
        increments: u64,
        progress: MapProgress,
        drawn: BTreeMap<String, String>,
    }

    impl Site {
        fn write(&mut self, ops: Vec<Op>) {
            self.increments += 1;
            let (number, hlc_us) = (self.increments, self.increments);
            self.now.state.apply(&Increment { author: AUTHOR, number, hlc_us, ops });
            self.now.rules = Arc::new(Rules::of(&self.now.state, self.now.rules.blocked.clone()));
        }

        /// Tells everything; how many messages, and how many things were in them.
        fn tell(&mut self) -> (usize, usize) {
            let (now, mut messages, mut things) = (Arc::new(self.now.clone()), 0, 0);
            while let Some(update) = self.progress.next(&now, Timestamp::new(7, 0)) {
                assert!(update.entities.len() + update.deletions.len() <= MAX_ENTITIES + 1);
                for deletion in &update.deletions {
                    match deletion.r#type() {
                        scene_entity_deletion::Type::All => self.drawn.clear(),
                        scene_entity_deletion::Type::MatchingId => _ = self.drawn.remove(&deletion.id),
                    }
                }
                messages += 1;
                things += update.entities.len() + update.deletions.len();
                self.drawn.extend(update.entities.into_iter().map(|it| (it.id.clone(), format!("{it:?}"))));
            }
            (messages, things)
        }

        /// What who comes now draws.
        fn afresh(&self) -> BTreeMap<String, String> {
            let mut other = Self { now: self.now.clone(), ..Self::default() };
            other.tell();
            other.drawn
        }
    }

    #[test]
    fn a_receiver_is_told_what_has_changed_and_draws_what_a_new_one_draws() {
        let mut site = Site::default();
        site.write((0..1000).map(|number| put(number, f64::from(number))).collect());
        site.write(
            (1..1000).map(|number| Op::PutEdge { edge: EdgeKey::new(node(number - 1), node(number)) }).collect(),
        );
        assert_eq!(site.tell(), (5, 2000), "all of it in pieces, and that everything before is gone");
        assert_eq!(site.tell(), (0, 0));

        site.write(vec![put(1000, 7.0), Op::PutEdge { edge: EdgeKey::new(node(3), node(1000)) }]);
        assert_eq!(site.tell(), (1, 2), "the new ones");
        site.write(vec![Op::SetPose { id: node(500), pose: FixedPose::from_metres(500.5, 0.0, 0.0) }]);
        assert_eq!(site.tell(), (1, 3), "a node that moves takes its edges with it");
        site.write(vec![Op::RemoveNode { id: node(0) }]);
        assert_eq!(site.tell(), (1, 2), "a node that goes takes its edge with it");
        let label = |text: &str| -> Label { text.parse().unwrap_or_else(|error| panic!("{error}")) };
        let corners = [(0.0, 0.0), (2.0, 0.0), (2.0, 2.0)].map(|(x, y)| FixedPoint::from_metres(x, y)).to_vec();
        let zone = Zone { rule: ZoneRule::KeepOut, corners };
        site.write(vec![
            Op::SetPlace { name: label("dock"), pose: Some(FixedPose::default()) },
            Op::SetZone { name: label("lab"), zone: Some(zone) },
            Op::SetClosed { edge: EdgeKey::new(node(5), node(6)), closed: true },
        ]);
        assert_eq!(site.tell(), (1, 3));
        site.now.rules = Arc::new(Rules::of(
            &site.now.state,
            vec![BlockedBy {
                robot: "amr-7".to_owned(),
                edges: [EdgeKey::new(node(7), node(8))].into(),
                ..BlockedBy::default()
            }],
        ));
        assert_eq!(site.tell(), (1, 1));
        assert_eq!(site.drawn, site.afresh());
        assert!(site.drawn.contains_key("blocked by amr-7") && !site.drawn.contains_key(&format!("node {}", node(0))));

        site.write(vec![
            Op::SetPlace { name: label("dock"), pose: None },
            Op::SetZone { name: label("lab"), zone: None },
        ]);
        site.now.rules = Arc::new(Rules::of(&site.now.state, Vec::new()));
        assert_eq!(site.tell(), (1, 3));
        assert_eq!(site.drawn, site.afresh());
    }

    #[test]
    fn who_is_slow_is_told_the_newest_in_the_end() {
        let mut site = Site::default();
        site.write((0..1000).map(|number| put(number, 0.0)).collect());
        let before = Arc::new(site.now.clone());
        let first = site.progress.next(&before, Timestamp::new(7, 0));
        assert_eq!(first.map(|update| update.entities.len()), Some(MAX_ENTITIES));
        for step in 1..=50 {
            site.write((0..1000).map(|number| put(number, f64::from(step))).collect());
        }
        let (messages, things) = site.tell();
        assert_eq!((messages, things), (2 + 3, 600 + 1000), "what was begun, and the newest state");
    }
}
