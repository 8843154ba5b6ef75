//! People and other robots in a simulated building, and what is left of them in the map, by the
//! truth.

use super::report::{PeopleFigures, RobotFigures};
use crate::mapping::Mapper;
use fht_perception::frame::LaserScan;
use fht_perception::grid::CellState;
use fht_perception::pose::{Point2, Pose2};
use fht_sim::{Contacts, RobotContacts, World};

/// Where bodies were at a frame, world frame, and their radii, metres.
pub(super) type Crowded = Vec<(Point2, f64)>;

/// A return is a body's when it ends within this of its side, metres: ten times the scanner's
/// noise.
const NOISE_M: f64 = 0.1;
/// … and a wall's when one is this near, metres.
const WALL_M: f64 = 0.1;
/// What the grid says is occupied this far from everything is a ghost, metres.
const GHOST_M: f64 = 0.2;

/// A map, and what was truly there when it was made.
#[derive(Clone, Copy)]
pub(super) struct Seen<'a> {
    /// Where the robot was, frame by frame.
    pub(super) truth: &'a [Pose2],
    pub(super) world: &'a World,
    pub(super) world_from_map: &'a Pose2,
    pub(super) mapper: &'a Mapper,
}

impl Seen<'_> {
    /// The figures of people; none where nobody was.
    pub(super) fn people(&self, people: &[Crowded], contacts: Contacts) -> Option<PeopleFigures> {
        let count = most(people)?;
        let (returns_in_nodes, returns) = self.returns(people);
        Some(PeopleFigures { count, contacts, returns_in_nodes, returns, ghosts_m2: self.ghosts_m2() })
    }

    /// The figures of other robots, but for the returns of scans that were not kept; none where no
    /// robot was.
    pub(super) fn robots(
        &self,
        robots: &[Crowded],
        own_radius_m: f64,
        contacts: RobotContacts,
    ) -> Option<RobotFigures> {
        let count = most(robots)?;
        let apart = self.truth.iter().zip(robots).flat_map(|(truth, robots)| {
            let here = Point2::from(truth.translation.vector);
            robots.iter().map(move |(at, radius_m)| (at - here).norm() - radius_m - own_radius_m)
        });
        let nearest_m = apart.fold(f64::INFINITY, f64::min);
        let (returns_in_nodes, returns) = self.returns(robots);
        Some(RobotFigures { count, contacts, nearest_m, returns_in_nodes, returns, ..RobotFigures::default() })
    }

    /// Returns of nodes' scans that ended on bodies, and all of them.
    fn returns(&self, bodies: &[Crowded]) -> (usize, usize) {
        let of_node = |node: fht_map::NodeRef<'_>| {
            let frame = usize::try_from(self.mapper.footings().get(&node.id)?.frame?).ok()?;
            let (bodies, truth) = (bodies.get(frame)?, self.truth.get(frame)?);
            let ends = LaserScan::record_points_in_base(&node.signature?.scan);
            Some((on_bodies(ends.iter().copied(), bodies, truth, self.world), ends.len()))
        };
        let all = self.mapper.map().main_nodes().filter_map(of_node);
        all.fold((0, 0), |sum, node| (sum.0 + node.0, sum.1 + node.1))
    }

    fn ghosts_m2(&self) -> f64 {
        let (grid, plan) = (self.mapper.grid(), self.world.plan());
        let bounds = grid.bounds();
        let cells = (0..bounds.width() * bounds.height()).map(|index| bounds.cell(index));
        let occupied = cells.filter(|cell| grid.state(*cell) == CellState::Occupied);
        let is_ghost =
            |cell: &fht_perception::grid::Cell| plan.clearance_m(self.world_from_map * grid.centre(*cell)) > GHOST_M;
        occupied.filter(is_ghost).count() as f64 * grid.resolution_m().powi(2)
    }
}

/// The most that were there at once, if any.
fn most(bodies: &[Crowded]) -> Option<usize> {
    bodies.iter().map(Vec::len).max().filter(|count| *count > 0)
}

/// How many of the ends of beams (base frame) are on bodies and not on walls.
pub(super) fn on_bodies(
    ends: impl Iterator<Item = Point2>,
    bodies: &[(Point2, f64)],
    truth: &Pose2,
    world: &World,
) -> usize {
    let is_on_body = |end: &Point2| {
        let end = truth * end;
        let is_near = |(at, radius_m): &(Point2, f64)| (end - at).norm() < radius_m + NOISE_M;
        bodies.iter().any(is_near) && world.plan().clearance_m(end) > WALL_M
    };
    ends.filter(is_on_body).count()
}
