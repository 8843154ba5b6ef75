//! People in a simulated building, and what is left of them in the map, by the truth.

use super::report::PeopleFigures;
use crate::mapping::Mapper;
use fht_map::NodeRef;
use fht_perception::frame::LaserScan;
use fht_perception::grid::CellState;
use fht_perception::pose::{Point2, Pose2};
use fht_sim::{Contacts, World};

/// Where people were at a frame, world frame, and their radii, metres.
pub(super) type Crowded = Vec<(Point2, f64)>;

/// A return is somebody's when it ends within this of his side, metres: ten times the scanner's
/// noise.
const NOISE_M: f64 = 0.1;
/// … and a wall's when one is this near, metres.
const WALL_M: f64 = 0.1;
/// What the grid says is occupied this far from everything is a ghost, metres.
const GHOST_M: f64 = 0.2;

/// The figures; none where nobody was. `truth` is where the robot was, frame by frame.
pub(super) fn figures(
    people: &[Crowded],
    truth: &[Pose2],
    (world, world_from_map): (&World, &Pose2),
    mapper: &Mapper,
    contacts: Contacts,
) -> Option<PeopleFigures> {
    let count = people.iter().map(Vec::len).max().filter(|count| *count > 0)?;
    let mut figures = PeopleFigures { count, contacts, ..PeopleFigures::default() };
    for node in mapper.map().main_nodes() {
        let (on_people, all) = returns(&node, people, truth, world, mapper).unwrap_or_default();
        figures.returns_in_nodes += on_people;
        figures.returns += all;
    }
    let (grid, plan) = (mapper.grid(), world.plan());
    let bounds = grid.bounds();
    let cells = (0..bounds.width() * bounds.height()).map(|index| bounds.cell(index));
    let occupied = cells.filter(|cell| grid.state(*cell) == CellState::Occupied);
    let ghosts = occupied.filter(|cell| plan.clearance_m(world_from_map * grid.centre(*cell)) > GHOST_M).count();
    figures.ghosts_m2 = ghosts as f64 * grid.resolution_m().powi(2);
    Some(figures)
}

/// Returns of a node's scan that ended on somebody, and all of them.
fn returns(
    node: &NodeRef<'_>,
    people: &[Crowded],
    truth: &[Pose2],
    world: &World,
    mapper: &Mapper,
) -> Option<(usize, usize)> {
    let frame = usize::try_from(mapper.footings().get(&node.id)?.frame?).ok()?;
    let (people, truth) = (people.get(frame)?, truth.get(frame)?);
    let ends = LaserScan::record_points_in_base(&node.signature?.scan);
    let is_somebody = |end: &&Point2| {
        let end = truth * **end;
        let is_near = |(at, radius_m): &(Point2, f64)| (end - at).norm() < radius_m + NOISE_M;
        people.iter().any(is_near) && world.plan().clearance_m(end) > WALL_M
    };
    Some((ends.iter().filter(is_somebody).count(), ends.len()))
}
