//! What operators of the second map wrote: places and zones move with it; names that the first map
//! has get another one. Where it lies tells where the first one does, if nobody has said that.

use fht_map::MapState;
use fht_perception::pose::{Point2, Pose2, from_fixed, to_fixed};
use fht_proto::{FixedPose, Label, Op, PlanImage, Zone};
use std::collections::{BTreeMap, BTreeSet};

/// A place is the same as another of its name within this, metres.
const SAME_M: f64 = 0.3;
/// … and as one that an earlier merge has renamed, if it faces the same way within this, radians.
const SAME_RAD: f64 = 0.1;
/// Longest name.
const MOST: usize = 64;

/// What is taken over of annotations.
#[derive(Debug, Default)]
pub(crate) struct Carried {
    pub(crate) ops: Vec<Op>,
    /// Places and zones, and where the map lies.
    pub(crate) count: usize,
    /// Old and new names of those whose name the first map had.
    pub(crate) renamed: Vec<[String; 2]>,
}

/// The places and zones of `b` as `a` lacks them; `suffix` is added to names that are taken.
pub(crate) fn carry(a: &MapState, b: &MapState, a_from_b: &Pose2, suffix: &str) -> Carried {
    let mut carried = Carried::default();
    let mut taken: BTreeSet<Label> = a.annotations().places().map(|(name, _)| name.clone()).collect();
    for (name, pose) in b.annotations().places() {
        let moved = to_fixed(&(a_from_b * from_fixed(pose)));
        let is_same = |known: FixedPose| known.position.distance(moved.position) <= SAME_M;
        let faces = |known: &FixedPose| from_fixed(*known).rotation.angle_to(&from_fixed(moved).rotation).abs();
        let is_copy = |known: FixedPose| is_same(known) && faces(&known) <= SAME_RAD;
        if a.annotations().place(name).is_some_and(is_same)
            || names(name, suffix).any(|name| a.annotations().place(&name).is_some_and(is_copy))
        {
            continue;
        }
        if let Some(name) = carried.name(name, &mut taken, suffix) {
            carried.ops.push(Op::SetPlace { name, pose: Some(moved) });
        }
    }
    let known: BTreeMap<&Label, &Zone> = a.annotations().zones().collect();
    let mut taken: BTreeSet<Label> = known.keys().map(|name| (*name).clone()).collect();
    // Servers take no others, though a map may have some.
    let drawn = b.annotations().zones().filter(|(_, zone)| zone.check_border().is_ok());
    for (name, zone) in drawn {
        let corners = zone.corners.iter().map(|corner| {
            let at = a_from_b * Point2::new(corner.x(), corner.y());
            to_fixed(&Pose2::translation(at.x, at.y)).position
        });
        let moved = Zone { rule: zone.rule, corners: corners.collect() };
        let is_there = |name: &Label| known.get(name).is_some_and(|known| is_same_zone(known, &moved));
        if is_there(name) || names(name, suffix).any(|name| is_there(&name)) {
            continue;
        }
        if let Some(name) = carried.name(name, &mut taken, suffix) {
            carried.ops.push(Op::SetZone { name, zone: Some(moved) });
        }
    }
    carried.siting(a, b, a_from_b);
    carried
}

fn is_same_zone(one: &Zone, other: &Zone) -> bool {
    let near = || one.corners.iter().zip(&other.corners).all(|(a, b)| a.distance(*b) <= SAME_M);
    one.rule == other.rule && one.corners.len() == other.corners.len() && near()
}

/// What is called `wanted` may be called where that name is taken.
fn names(wanted: &Label, suffix: &str) -> impl Iterator<Item = Label> {
    (1..1000).filter_map(move |number| {
        let end = match number {
            1 => format!("-{suffix}"),
            _ => format!("-{suffix}-{number}"),
        };
        let stem: String = wanted.as_str().chars().take(MOST.saturating_sub(end.len())).collect();
        format!("{stem}{end}").parse().ok()
    })
}

impl Carried {
    /// Where the first map lies, if only the second one says so.
    fn siting(&mut self, a: &MapState, b: &MapState, a_from_b: &Pose2) {
        let (known, new) = (a.annotations(), b.annotations());
        if let (None, Some(plan)) = (known.floor_plan(), new.floor_plan()) {
            let map_from_image = to_fixed(&(a_from_b * from_fixed(plan.map_from_image)));
            self.ops.push(Op::SetFloorPlan { plan: Some(PlanImage { map_from_image, ..plan.clone() }) });
            self.count += 1;
        }
        if let (None, Some(datum)) = (known.datum(), new.datum()) {
            let datum = datum.of_other(to_fixed(&a_from_b.inverse()));
            self.ops.push(Op::SetDatum { datum: Some(datum) });
            self.count += 1;
        }
    }

    /// A name that is not taken.
    fn name(&mut self, wanted: &Label, taken: &mut BTreeSet<Label>, suffix: &str) -> Option<Label> {
        let mut tried = std::iter::once(wanted.clone()).chain(names(wanted, suffix));
        let free = tried.find(|name| !taken.contains(name))?;
        if free != *wanted {
            self.renamed.push([wanted.to_string(), free.to_string()]);
        }
        self.count += 1;
        taken.insert(free.clone());
        Some(free)
    }
}
