//! Ground outside of the mesh: where walls stand in it, how much of it nobody saw, and where the
//! mesh is nearest.

use crate::navmesh::entry_config::EntryConfig;
use crate::navmesh::free_space::FreeSpace;
use crate::navmesh::free_space::closed_ground::ClosedZone;
use crate::navmesh::free_space::visibility::Visibility;
use crate::navmesh::mesh::Spot;
use crate::navmesh::plane::{Corner, between, corner_of, distance, fixed_point, meet};
use fht_proto::FixedPoint;
use std::collections::BTreeSet;

/// Which end of a path joins the mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PathEnd {
    /// The robot stands there, whatever the map says.
    Start,
    /// It is to go there.
    Goal,
    /// Either, and the place is known to be reachable.
    Known,
}

/// A way into the mesh.
#[derive(Clone, Debug)]
pub(crate) struct MeshEntry {
    /// Where it ends.
    pub(crate) joint: Spot,
    /// From the place to before the joint.
    pub(crate) way: Vec<Corner>,
    /// Its length, millimetres; ground near walls and ground that nobody saw count more.
    pub(crate) cost_mm: f64,
}

impl MeshEntry {
    /// The straight way from a place to the joint.
    pub(super) fn ends(&self, place: Corner) -> [Corner; 2] {
        [place, self.joint.place]
    }

    /// All of it, the joint included.
    pub(crate) fn whole(&self) -> Vec<Corner> {
        self.way.iter().copied().chain([self.joint.place]).collect()
    }
}

/// Ways are looked at in steps of this, millimetres.
const STEP_MM: f64 = 25.0;
/// Where the mesh is nearest is looked for within this first, then within twice of it, and so on,
/// millimetres.
const FIRST_MM: f64 = 2_000.0;
/// No map is larger, millimetres.
const FARTHEST_MM: f64 = 4e8;

/// Places are joined to the mesh from this far, millimetres: as paths are
/// ([`NodeRouteConfig::max_detour_m`](crate::NodeRouteConfig::max_detour_m)).
const REACH_MM: f64 = 2_000.0;

/// What a map knows of a place where robots are to go.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ground {
    /// Robots can go there; also on a map that knows of no free space at all.
    Free,
    /// No wall that was seen stands between it and free space, and nobody saw the ground there.
    Unseen {
        /// The nearest free space.
        nearest: FixedPoint,
    },
    /// In or behind a wall, or too far from free space.
    Unreachable {
        /// The nearest free space.
        nearest: FixedPoint,
    },
}

impl FreeSpace {
    /// The walls that main nodes saw within `reach_mm` of a place, as lines.
    pub(crate) fn wall_lines(&self, place: Corner, reach_mm: f64) -> Vec<[Corner; 2]> {
        self.walls.lines_around(&self.views, place, reach_mm)
    }

    /// Whether a goal is so near to a wall that no robot can be there.
    pub(crate) fn is_in_wall(&self, goal: Corner) -> bool {
        let room_mm = self.approach.goal_room_mm;
        self.walls.clearance_mm(goal, room_mm) < room_mm
    }

    /// Of zones, those that ways keep away from as from walls: where a robot's whole body must fit,
    /// all, but those that it stands nearer to at the start.
    pub(crate) fn kept_clear<'a>(&self, zones: &[&'a ClosedZone], place: Corner, end: PathEnd) -> Vec<&'a ClosedZone> {
        let EntryConfig { is_strict, room_mm: [room_mm, _], .. } = self.approach;
        let is_kept = |zone: &ClosedZone| end != PathEnd::Start || zone.clearance_mm(place, room_mm) >= room_mm;
        zones.iter().copied().filter(|zone| is_strict && is_kept(zone)).collect()
    }

    /// Whether a path may end with a way: nobody knows what stands on ground that is hidden.
    pub(crate) fn may_end(&self, way: &MeshEntry) -> bool {
        self.views.is_empty() || self.unmapped_mm(&way.whole()) <= self.approach.unseen_goal_mm
    }

    /// Whether a path may begin with a way from `place`: a robot just outside of the mesh may leave
    /// in any case.
    pub(crate) fn may_begin(&self, place: Corner, way: &MeshEntry) -> bool {
        distance(place, way.joint.place) <= self.approach.start_mm || !self.hides_start(&way.whole())
    }

    /// Whether so much of a way from a start is hidden that the start is likely in a thing, or
    /// behind a wall.
    pub(crate) fn hides_start(&self, way: &[Corner]) -> bool {
        !self.views.is_empty() && self.unmapped_mm(way) > self.approach.unseen_start_mm
    }

    /// Whether the straight way from an end of a path to a place on the mesh leads through one of
    /// the walls around it. A start just outside of the mesh is left in any case.
    pub(crate) fn crosses(&self, lines: &[[Corner; 2]], [place, to]: [Corner; 2], end: PathEnd) -> bool {
        let is_spared = end == PathEnd::Start && distance(place, to) <= self.approach.start_mm;
        !is_spared && self.leads_through(lines, [place, to], end)
    }

    /// Whether the straight way from an end of a path to another place leads through one of the
    /// walls around it. What was seen under a robot where it stands is not there.
    pub(crate) fn leads_through(&self, lines: &[[Corner; 2]], [place, to]: [Corner; 2], end: PathEnd) -> bool {
        let checked = match end {
            PathEnd::Known => return false,
            PathEnd::Goal => [place, to],
            PathEnd::Start => [between([place, to], (self.approach.body_mm / distance(place, to)).min(1.0)), to],
        };
        lines.iter().any(|line| meet(*line, checked))
    }

    /// Whether a place lies in the mesh, or so little outside that a robot there gets some way into
    /// it whatever was seen there.
    pub(crate) fn is_beside_mesh(&self, place: Corner) -> bool {
        let reach_mm = self.approach.start_mm;
        let mut borders = self.mesh.borders_around(place, reach_mm);
        self.mesh.triangle_at(place).is_some() || borders.any(|(_, _, nearest)| distance(nearest, place) <= reach_mm)
    }

    /// How much of a way leads over ground that no rectangle covers and no main node saw,
    /// millimetres.
    pub(crate) fn unmapped_mm(&self, way: &[Corner]) -> f64 {
        let Some(first) = way.first() else { return 0.0 };
        let length_mm: f64 = way.windows(2).map(|pair| distance(pair[0], pair[1])).sum();
        let views = self.views_within(*first, self.approach.view_mm + length_mm);
        let unmapped_mm = |pair: &[Corner]| {
            let (line, length_mm) = ([pair[0], pair[1]], distance(pair[0], pair[1]));
            let steps = (length_mm / STEP_MM).ceil().max(1.0);
            let is_unknown = |step: &usize| !self.is_known(between(line, (*step as f64 + 0.5) / steps), &views);
            (0..steps as usize).filter(is_unknown).count() as f64 * length_mm / steps
        };
        way.windows(2).map(unmapped_mm).sum()
    }

    fn views_within(&self, place: Corner, reach_mm: f64) -> Vec<&Visibility> {
        self.views.iter().filter(|view| distance(view.from, place) < reach_mm).collect()
    }

    /// Whether a rectangle or the mesh covers a place, or one of `views` saw it.
    fn is_known(&self, at: Corner, views: &[&Visibility]) -> bool {
        let is_in = |[low, high]: &[Corner; 2]| (0..2).all(|axis| (low[axis]..=high[axis]).contains(&at[axis]));
        self.mesh.triangle_at(at).is_some()
            || self.rectangles.iter().any(is_in)
            || views.iter().any(|view| view.is_passed(at))
    }

    /// What the map knows of a place where robots are to go, whatever is closed.
    #[must_use]
    pub fn ground_at(&self, place: FixedPoint) -> Ground {
        let at = corner_of(place);
        if self.mesh.triangles.is_empty() || self.contains(place) {
            return Ground::Free;
        }
        let reach_mm = REACH_MM.max(self.approach.start_mm);
        let is_reached = !self.approaches(place, reach_mm, PathEnd::Goal).is_empty();
        let all = self.mesh.triangles.iter().map(|triangle| triangle.part).collect();
        let nearest = self.nearest_of(&all, at).map_or(place, |spot| fixed_point(spot.place));
        match is_reached {
            true if self.is_known(at, &self.views_within(at, self.approach.view_mm)) => Ground::Free,
            true => Ground::Unseen { nearest },
            false => Ground::Unreachable { nearest },
        }
    }

    /// The place of some parts of the mesh that is nearest to another place.
    pub(crate) fn nearest_of(&self, parts: &BTreeSet<u32>, place: Corner) -> Option<Spot> {
        let within = |reach_mm: f64| {
            let borders = self.mesh.borders_around(place, reach_mm);
            let spots = borders.map(|(triangle, _, nearest)| self.mesh.spot(triangle, nearest));
            let spots = spots.filter(|spot| parts.contains(&spot.part));
            let spots = spots.map(|spot| (distance(spot.place, place), spot));
            spots.filter(|(away_mm, _)| *away_mm <= reach_mm).min_by(|a, b| a.0.total_cmp(&b.0))
        };
        let reaches = std::iter::successors(Some(FIRST_MM), |reach_mm| Some(2.0 * reach_mm));
        let found = reaches.take_while(|reach_mm| *reach_mm <= FARTHEST_MM).find_map(within);
        found.filter(|_| !parts.is_empty()).map(|(_, spot)| spot)
    }
}
