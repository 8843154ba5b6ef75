#![no_main]
//! Valid maps of any shape: free space, rules, paths, differences. The input is a row of
//! increments' bodies, each after its length in two bytes.

use fht_map::crdt::diff;
use fht_map::index::lookup;
use fht_map::{FreeSpace, IndexConfig, MapIndex, MapState, NodeRouteConfig, Rules};
use fht_proto::codec::envelope::{FORMAT_VERSION, Message, seal};
use fht_proto::{FixedPoint, Increment, decode};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let mut rest = bytes;
    let mut increments: Vec<Increment> = Vec::new();
    while let Some((length, after)) = rest.split_first_chunk::<2>() {
        let length = usize::from(u16::from_le_bytes(*length)).min(after.len());
        let (body, after) = after.split_at(length);
        let bytes = seal(FORMAT_VERSION, Increment::KIND, body).expect("it is short");
        increments.extend(decode::<Increment>(&bytes).ok());
        rest = after;
    }
    let (mut map, mut backwards) = (MapState::new(), MapState::new());
    increments.iter().for_each(|increment| map.apply(increment));
    increments.iter().rev().for_each(|increment| backwards.apply(increment));
    let numbers: std::collections::BTreeSet<_> = increments.iter().map(|it| (it.author, it.number)).collect();
    if numbers.len() == increments.len() {
        assert_eq!(map.digest(), backwards.digest(), "any order");
    }
    let before = MapState::new();
    assert_eq!(diff::diff(&before, &map).added.len(), map.nodes().count());
    let rules = Rules::of(&map, Vec::new());
    let space = FreeSpace::of(&map, &rules.space_config());
    let index = MapIndex::new(&map, IndexConfig::default());
    let places: Vec<FixedPoint> = map.nodes().map(|node| node.pose.position).take(3).collect();
    for from in &places {
        for to in &places {
            if let Ok(route) = rules.plan(&map, &space, *from, *to, &NodeRouteConfig::default()) {
                assert!(route.length_m.is_finite() && route.waypoints.first().map(|it| it.point) == Some(*from));
                let _ = rules.speed_limits(&route);
            }
        }
        assert_eq!(lookup::nearest(&map, None, *from, 5.0), lookup::nearest(&map, Some(&index), *from, 5.0));
    }
});
