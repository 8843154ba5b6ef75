//! The way between a place that no rectangle covers and the mesh.
//!
//! Of such ground the map knows only what the main nodes' scanners saw: walls, and how far the view
//! was free. Most such places lie beside a wall, a hand's breadth from the mesh, and the straight
//! way is clear. From others, such as behind a bed, a way is searched on a grid around the place.
//! It keeps away from what was seen, and prefers ground that a beam has passed to ground that no
//! scanner saw, where anything may stand.

use crate::navmesh::entry_config::EntryConfig;
use crate::navmesh::free_space::FreeSpace;
use crate::navmesh::free_space::closed_ground::ClosedZone;
use crate::navmesh::free_space::visibility::Visibility;
use crate::navmesh::mesh::Spot;
use crate::navmesh::outside::{MeshEntry, PathEnd};
use crate::navmesh::plane::{Corner, between, corner_of, distance};
use fht_proto::FixedPoint;
use pathfinding::directed::dijkstra::dijkstra_reach;
use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};

/// So many main nodes, the nearest, are asked what they saw.
const MOST_VIEWS: usize = 256;
/// Side of a cell of the grid, millimetres.
const CELL_MM: f64 = 50.0;

/// A cell, counted from the one around the place.
type Cell = (i32, i32);

/// Where the mesh can be entered, by cell.
type Joints = HashMap<Cell, Vec<Spot>>;

impl FreeSpace {
    /// Ways from a place into the mesh: to every part of it within `reach_mm`. None is needed for a
    /// place that lies in it. If no way keeps away from what was seen: none to a goal; from a start
    /// the straight one to the nearest point, which crosses no wall unless it is short
    /// ([`EntryConfig::start_mm`]); none if [`EntryConfig::is_strict`].
    pub(crate) fn approaches(&self, point: FixedPoint, reach_mm: f64, end: PathEnd) -> Vec<MeshEntry> {
        let (place, config) = (corner_of(point), &self.approach);
        if let Some(triangle) = self.mesh.triangle_at(place) {
            return vec![MeshEntry { joint: self.mesh.spot(triangle, place), way: Vec::new(), cost_mm: 0.0 }];
        }
        if end == PathEnd::Goal && self.is_in_wall(place) {
            return Vec::new();
        }
        // Up to the corners of the square in which ways are looked for.
        let lines = if end == PathEnd::Known { Vec::new() } else { self.wall_lines(place, 1.5 * reach_mm) };
        let zones: Vec<&ClosedZone> = self.screens_around(place, 2.0 * reach_mm).collect();
        let mut nearest: BTreeMap<u32, MeshEntry> = BTreeMap::new();
        let mut parts = BTreeSet::new();
        let mut borders = Vec::new();
        for (triangle, ends, nearest_place) in self.mesh.borders_around(place, reach_mm) {
            let joint = self.mesh.spot(triangle, nearest_place);
            let cost_mm = distance(joint.place, place);
            if cost_mm > reach_mm {
                continue;
            }
            borders.push((triangle, ends));
            parts.insert(joint.part);
            if config.is_strict || zones.iter().any(|zone| zone.is_met([place, joint.place])) {
                continue;
            }
            if nearest.get(&joint.part).is_none_or(|kept| kept.cost_mm > cost_mm) {
                nearest.insert(joint.part, MeshEntry { joint, way: vec![place], cost_mm });
            }
        }
        let is_straight = |way: &MeshEntry| {
            let ends = way.ends(place);
            way.cost_mm <= config.straight_mm
                && self.walls.is_clear(ends, config.straight_room_mm)
                && !self.crosses(&lines, ends, end)
        };
        let is_joined = |part: &u32| nearest.get(part).is_some_and(is_straight);
        let mut others: BTreeSet<u32> = parts.into_iter().filter(|part| !is_joined(part)).collect();
        if !others.is_empty() {
            let mut ground = Ground::new(self, (place, end), reach_mm, zones);
            ground.wall_up(&lines);
            let joints = ground.joints(&borders);
            for room_mm in config.room_mm.into_iter().take(if config.is_strict { 1 } else { 2 }) {
                for way in ground.ways(&joints, others.clone(), room_mm) {
                    others.remove(&way.joint.part);
                    nearest.insert(way.joint.part, way);
                }
            }
        }
        // What is left leads past what was seen, or through it: as bad as any other way at its
        // worst.
        for part in others {
            if nearest.get(&part).is_some_and(|way| end == PathEnd::Goal || self.crosses(&lines, way.ends(place), end))
            {
                nearest.remove(&part);
            }
            nearest.entry(part).and_modify(|way| way.cost_mm *= 1.0 + config.near_factor + config.unseen_factor);
        }
        let may_be = |way: &MeshEntry| match end {
            PathEnd::Start => self.may_begin(place, way),
            PathEnd::Goal => self.may_end(way),
            PathEnd::Known => true,
        };
        nearest.into_values().filter(may_be).collect()
    }
}

/// The ground around a place.
struct Ground<'a> {
    space: &'a FreeSpace,
    place: Corner,
    end: PathEnd,
    /// Cells on either side of the place.
    reach: i32,
    /// Distance from walls, millimetres.
    room_mm: f64,
    /// Who may have seen it, the nearest first.
    views: Vec<&'a Visibility>,
    /// What nodes say is free.
    rectangles: Vec<[Corner; 2]>,
    /// What no way may lead over.
    zones: Vec<&'a ClosedZone>,
    /// What ways keep away from as from walls.
    kept_clear: Vec<&'a ClosedZone>,
    /// Where walls stand between what was seen of them.
    walled: HashSet<Cell>,
    seen: HashMap<Cell, bool>,
    unseen_rows: HashMap<i32, Vec<u32>>,
    /// What a millimetre in a cell counts for; none where a wall is too near.
    factors: HashMap<Cell, Option<f64>>,
}

impl<'a> Ground<'a> {
    fn new(space: &'a FreeSpace, (place, end): (Corner, PathEnd), reach_mm: f64, zones: Vec<&'a ClosedZone>) -> Self {
        let away_mm = |view: &&Visibility| distance(view.from, place);
        let mut views: Vec<&Visibility> =
            space.views.iter().filter(|view| away_mm(view) < space.approach.view_mm).collect();
        views.sort_by(|a, b| away_mm(a).total_cmp(&away_mm(b)));
        views.truncate(MOST_VIEWS);
        let around_mm = reach_mm + if space.approach.is_strict { space.approach.body_mm } else { 0.0 };
        let is_near = |[low, high]: &[Corner; 2]| {
            (0..2).all(|axis| low[axis] <= place[axis] + around_mm && high[axis] >= place[axis] - around_mm)
        };
        let rectangles = space.rectangles.iter().copied().filter(is_near).collect();
        let reach = (reach_mm / CELL_MM).ceil() as i32;
        let kept_clear = space.kept_clear(&zones, place, end);
        Self {
            space,
            place,
            end,
            reach,
            room_mm: 0.0,
            views,
            rectangles,
            zones,
            kept_clear,
            walled: HashSet::new(),
            seen: HashMap::new(),
            unseen_rows: HashMap::new(),
            factors: HashMap::new(),
        }
    }

    /// Closes the cells along walls whose seen points leave room between them, and those beside
    /// them; not those under the robot where it stands.
    fn wall_up(&mut self, lines: &[[Corner; 2]]) {
        let body_mm = if self.end == PathEnd::Start { self.space.approach.body_mm } else { 0.0 };
        for line in lines.iter().filter(|line| distance(line[0], line[1]) > 2.0 * CELL_MM) {
            let steps = (distance(line[0], line[1]) / (0.5 * CELL_MM)).ceil();
            for step in 0..=steps as usize {
                let (column, row) = self.cell_of(between(*line, step as f64 / steps));
                let around = (-1..=1).flat_map(|dx| (-1..=1).map(move |dy| (column + dx, row + dy)));
                let closed = around.filter(|cell| distance(self.middle(*cell), self.place) > body_mm);
                let closed: Vec<Cell> = closed.collect();
                self.walled.extend(closed);
            }
        }
    }

    fn cell_of(&self, at: Corner) -> Cell {
        let cell = |axis: usize| ((at[axis] - self.place[axis]) / CELL_MM).round() as i32;
        (cell(0), cell(1))
    }

    fn middle(&self, cell: Cell) -> Corner {
        [self.place[0] + f64::from(cell.0) * CELL_MM, self.place[1] + f64::from(cell.1) * CELL_MM]
    }

    fn factor(&mut self, cell: Cell) -> Option<f64> {
        if let Some(factor) = self.factors.get(&cell) {
            return *factor;
        }
        let EntryConfig { good_room_mm, near_factor, unseen_factor, .. } = self.space.approach;
        let middle = self.middle(cell);
        let from_zones = self.kept_clear.iter().map(|zone| zone.clearance_mm(middle, good_room_mm));
        let room_mm = from_zones.fold(self.space.walls.clearance_mm(middle, good_room_mm), f64::min);
        let factor = self.may_be_at(cell, room_mm).then(|| {
            let lack = ((good_room_mm - room_mm) / (good_room_mm - self.room_mm).max(1.0)).clamp(0.0, 1.0);
            // Where the robot must have been seen to fit, all of the ground is.
            let unseen_share = if self.space.approach.is_strict { 0.0 } else { self.unseen_share(cell) };
            1.0 + near_factor * lack + unseen_factor * unseen_share
        });
        self.factors.insert(cell, factor);
        factor
    }

    /// Whether the robot may be in a cell that is `room_mm` from the nearest wall.
    fn may_be_at(&mut self, cell: Cell, room_mm: f64) -> bool {
        let config = &self.space.approach;
        let (is_strict, least_mm) = (config.is_strict, config.room_mm[1]);
        match (is_strict, cell == (0, 0)) {
            // The robot stands at the place itself, whatever the map says.
            (false, is_place) => is_place || room_mm >= self.room_mm && !self.walled.contains(&cell),
            (true, true) if self.end == PathEnd::Start => room_mm >= least_mm,
            (true, _) => room_mm >= self.room_mm && self.is_body_seen(cell),
        }
    }

    /// Whether all of the ground under a robot was seen. Of each row of cells it is counted once
    /// what was not, so that a robot of two metres takes no longer than a small one.
    fn is_body_seen(&mut self, (column, row): Cell) -> bool {
        let radius = self.space.approach.body_mm / CELL_MM;
        let reach = radius as i32;
        let first = -self.reach - reach;
        (-reach..=reach).all(|dy| {
            let half = (radius * radius - f64::from(dy * dy)).max(0.0).sqrt() as i32;
            let unseen = self.unseen_in_row(row + dy, first);
            let before = |column: i32| unseen.get((column - first) as usize).copied();
            before(column - half).is_some() && before(column - half) == before(column + half + 1)
        })
    }

    /// For each column of a row, from `first` to the other end, how many cells before it nobody
    /// saw.
    fn unseen_in_row(&mut self, row: i32, first: i32) -> &[u32] {
        if !self.unseen_rows.contains_key(&row) {
            let mut unseen = vec![0];
            for column in first..=-first {
                let last = unseen.last().copied().unwrap_or_default();
                unseen.push(last + u32::from(!self.is_seen((column, row))));
            }
            self.unseen_rows.insert(row, unseen);
        }
        self.unseen_rows.get(&row).map_or(&[], Vec::as_slice)
    }

    /// How much of the ground under a robot nobody saw.
    fn unseen_share(&mut self, (column, row): Cell) -> f64 {
        let radius = self.space.approach.body_mm / CELL_MM;
        let reach = radius as i32;
        let body = (-reach..=reach).flat_map(|dx| (-reach..=reach).map(move |dy| (dx, dy)));
        let body = body.filter(|(dx, dy)| f64::from(dx * dx + dy * dy) <= radius * radius);
        let (mut all, mut unseen) = (0, 0);
        for (dx, dy) in body {
            all += 1;
            unseen += i32::from(!self.is_seen((column + dx, row + dy)));
        }
        f64::from(unseen) / f64::from(all)
    }

    fn is_seen(&mut self, cell: Cell) -> bool {
        if let Some(is_seen) = self.seen.get(&cell) {
            return *is_seen;
        }
        let middle = self.middle(cell);
        let is_in = |[low, high]: &[Corner; 2]| (0..2).all(|axis| (low[axis]..=high[axis]).contains(&middle[axis]));
        let is_seen = self.rectangles.iter().any(is_in) || self.views.iter().any(|view| view.is_passed(middle));
        self.seen.insert(cell, is_seen);
        is_seen
    }

    /// The cheapest way to each of some parts of the mesh that keeps `room_mm` from walls.
    fn ways(&mut self, joints: &Joints, mut parts: BTreeSet<u32>, room_mm: f64) -> Vec<MeshEntry> {
        self.room_mm = room_mm;
        self.factors.clear();
        let mut before: HashMap<Cell, Cell> = HashMap::new();
        let mut found = Vec::new();
        for item in dijkstra_reach(&(0, 0), |cell| self.steps(*cell)) {
            if parts.is_empty() {
                break;
            }
            before.extend(item.parent.map(|parent| (item.node, parent)));
            let here = joints.get(&item.node).into_iter().flatten();
            found.extend(here.filter(|joint| parts.remove(&joint.part)).map(|joint| (*joint, item.node)));
        }
        let cells_to = |last: Cell| {
            let mut cells: Vec<Cell> = std::iter::successors(Some(last), |cell| before.get(cell).copied()).collect();
            cells.reverse();
            cells
        };
        found.into_iter().map(|(joint, last)| self.pulled(&cells_to(last), joint)).collect()
    }

    /// The cells around one that can be gone to, and what that costs, micrometres.
    fn steps(&mut self, (column, row): Cell) -> Vec<(Cell, u64)> {
        let around = (-1..=1).flat_map(|dx| (-1..=1).map(move |dy| (dx, dy))).filter(|step| *step != (0, 0));
        let step = |(dx, dy): Cell| {
            let next = (column + dx, row + dy);
            let is_near = next.0.abs() <= self.reach && next.1.abs() <= self.reach;
            let cost_mm = is_near.then(|| self.step_mm((column, row), next)).flatten()?;
            Some((next, (cost_mm * 1000.0).round() as u64))
        };
        around.filter_map(step).collect()
    }

    /// What the way from a cell to one beside it costs.
    fn step_mm(&mut self, from: Cell, to: Cell) -> Option<f64> {
        if !self.is_open([self.middle(from), self.middle(to)]) {
            return None;
        }
        let length_mm = CELL_MM * f64::from(from.0 - to.0).hypot(f64::from(from.1 - to.1));
        Some(0.5 * (self.factor(from)? + self.factor(to)?) * length_mm)
    }

    /// Where the mesh can be entered, by cell; of each part the place nearest to the middle of the
    /// cell.
    fn joints(&self, borders: &[(u32, [Corner; 2])]) -> Joints {
        let mut joints = Joints::new();
        for (triangle, ends) in borders {
            let Some(ends) = self.inside(*ends) else { continue };
            let steps = (distance(ends[0], ends[1]) / (0.5 * CELL_MM)).ceil().max(1.0);
            for step in 0..=steps as usize {
                let spot = self.space.mesh.spot(*triangle, between(ends, step as f64 / steps));
                let cell = self.cell_of(spot.place);
                let middle = self.middle(cell);
                let spots = joints.entry(cell).or_default();
                match spots.iter_mut().find(|kept| kept.part == spot.part) {
                    Some(kept) if distance(spot.place, middle) < distance(kept.place, middle) => *kept = spot,
                    Some(_) => {}
                    None => spots.push(spot),
                }
            }
        }
        joints
    }

    /// The part of a line that lies on the grid, with a cell around it.
    fn inside(&self, ends: [Corner; 2]) -> Option<[Corner; 2]> {
        let half_mm = f64::from(self.reach + 1) * CELL_MM;
        let (mut first, mut last) = (0.0_f64, 1.0_f64);
        for ((from, to), place) in ends[0].into_iter().zip(ends[1]).zip(self.place) {
            let (from, along) = (from - place, to - from);
            let shares = [(-half_mm - from) / along, (half_mm - from) / along];
            if along == 0.0 {
                last = if from.abs() <= half_mm { last } else { -1.0 };
            } else {
                first = first.max(shares[0].min(shares[1]));
                last = last.min(shares[0].max(shares[1]));
            }
        }
        (first <= last).then(|| [between(ends, first), between(ends, last)])
    }

    /// The way over the cells and into the mesh, with corners left out where the straight way costs
    /// no more.
    fn pulled(&mut self, cells: &[Cell], joint: Spot) -> MeshEntry {
        let mut points: Vec<Corner> = cells.iter().map(|cell| self.middle(*cell)).collect();
        // What it costs up to each point; these cells and steps were gone before.
        let mut costs = vec![0.0];
        let mut up_to_mm = 0.0;
        for pair in cells.windows(2) {
            up_to_mm += self.step_mm(pair[0], pair[1]).unwrap_or_default();
            costs.push(up_to_mm);
        }
        if let Some((cell, middle)) = cells.last().zip(points.last()) {
            costs.push(up_to_mm + distance(*middle, joint.place) * self.factor(*cell).unwrap_or(1.0));
        }
        points.push(joint.place);
        let mut way = Vec::new();
        let (mut at, mut cost_mm) = (0, 0.0);
        while at + 1 < points.len() {
            way.push(points[at]);
            let mut next = (at + 1, costs[at + 1] - costs[at]);
            for end in (at + 2..points.len()).rev() {
                let ends = [points[at], points[end]];
                let straight = self.straight_mm(ends).filter(|_| self.space.walls.is_clear(ends, self.room_mm));
                if let Some(straight) = straight.filter(|straight| *straight <= (costs[end] - costs[at]) * 1.02) {
                    next = (end, straight);
                    break;
                }
            }
            at = next.0;
            cost_mm += next.1;
        }
        MeshEntry { joint, way, cost_mm }
    }

    fn is_open(&self, ends: [Corner; 2]) -> bool {
        !self.zones.iter().any(|zone| zone.is_met(ends))
    }

    /// What a straight way costs; none where a wall is too near.
    fn straight_mm(&mut self, ends: [Corner; 2]) -> Option<f64> {
        if !self.is_open(ends) {
            return None;
        }
        let length_mm = distance(ends[0], ends[1]);
        let steps = (length_mm / (0.5 * CELL_MM)).ceil().max(1.0);
        let mut sum = 0.0;
        for step in 0..steps as usize {
            let cell = self.cell_of(between(ends, (step as f64 + 0.5) / steps));
            sum += self.factor(cell)?;
        }
        Some(length_mm * sum / steps)
    }
}
