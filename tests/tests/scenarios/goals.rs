//! Goals anywhere inside and outside of an explored building, checked against its true plan: no
//! path leads through anything, goals outside are refused with the nearest point that can be
//! reached, and the path to that point can be had.

use fht_eval::{Member, TeamTask, explore_as_team};
use fht_map::plan::shortest_path;
use fht_map::{FreeSpace, MapState, NodeRoute, NodeRouteConfig, PathEnds, RouteError, SpaceConfig};
use fht_perception::pose::{Point2, Pose2};
use fht_proto::FixedPoint;
use fht_sim::{Mask, SimConfig, World, load};
use mapper::MapperConfig;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::sync::Arc;

const SEED: u64 = 1;
const GOALS: usize = 500;
/// Goals are drawn from up to so far outside of the building, metres.
const MARGIN_M: f64 = 2.5;

/// The explored building.
struct Building {
    world: Arc<World>,
    world_from_map: Pose2,
    map: MapState,
    space: FreeSpace,
    start: Point2,
    /// What the explorers' robot can reach.
    reachable: Mask,
}

impl Building {
    fn explored() -> Self {
        let world = Arc::new(load("museum", None, 1).unwrap());
        let members = vec![Member::at(world.start())];
        let task = TeamTask { members, seed: 1, cameras: false, mapper: MapperConfig::default(), most_s: 3600.0 };
        let explored = explore_as_team(&world, &task, |_, _| {}).unwrap();
        let space = FreeSpace::of(&explored.map, &SpaceConfig::default());
        let start = Point2::from(world.start().translation.vector);
        let reachable = world.plan().reachable(start, SimConfig::default().radius_m);
        Self { world, world_from_map: explored.world_from_map, map: explored.map, space, start, reachable }
    }

    fn fixed(&self, place: Point2) -> FixedPoint {
        let place = self.world_from_map.inverse() * place;
        FixedPoint::from_metres(place.x, place.y)
    }

    fn route(&self, to: Point2, ends: PathEnds) -> Result<NodeRoute, RouteError> {
        let config = NodeRouteConfig { ends, ..NodeRouteConfig::default() };
        shortest_path::plan(&self.map, &self.space, self.fixed(self.start), self.fixed(to), &config)
    }

    /// Where the robot's centre would be in something.
    fn hits(&self, route: &NodeRoute) -> Vec<Point2> {
        let point = |at: FixedPoint| self.world_from_map * Point2::new(at.x(), at.y());
        let points: Vec<Point2> = route.waypoints.iter().map(|it| point(it.point)).collect();
        let steps = points.windows(2).flat_map(|leg| {
            let (from, along) = (leg[0], leg[1] - leg[0]);
            let count = (along.norm() / 0.01).ceil().max(1.0) as usize;
            (0..=count).map(move |step| from + along * (step as f64 / count as f64))
        });
        steps.filter(|at| self.world.plan().is_occupied(at.x, at.y)).collect()
    }

    fn is_reachable(&self, goal: Point2) -> bool {
        self.world.plan().cell_of(goal).is_some_and(|(column, row)| self.reachable.contains(column, row))
    }

    /// How far the nearest place is that can be reached.
    fn nearest_m(&self, goal: Point2) -> f64 {
        let plan = self.world.plan();
        let cells = (0..plan.width() * plan.height()).filter(|cell| self.reachable.cells()[*cell]);
        let centres = cells.map(|cell| plan.centre_of(cell % plan.width(), cell / plan.width()));
        centres.map(|centre| (centre - goal).norm()).fold(f64::INFINITY, f64::min)
    }

    /// A goal that was refused: the path to the nearest point that can be reached, and how much
    /// farther that is from the goal than it would have to be.
    fn nearest_instead(&self, goal: Point2, refusal: &RouteError) -> f64 {
        let is_said = match refusal {
            RouteError::NoPath { nearest, .. } => nearest.is_some(),
            RouteError::OutOfMap { is_goal, .. } => *is_goal,
        };
        assert!(is_said, "{goal:?}: {refusal}");
        let near = self.route(goal, PathEnds::ToNearest).unwrap();
        let end = near.waypoints.last().unwrap().point;
        assert!((end.distance(self.fixed(goal)) - near.goal_moved_m).abs() < 0.002);
        let through = self.hits(&near);
        assert!(through.is_empty(), "to the nearest of {goal:?} through {:?}", through[0]);
        near.goal_moved_m - self.nearest_m(goal)
    }
}

#[test]
fn no_path_leads_through_a_wall_wherever_its_goal_is() {
    let building = Building::explored();
    let plan = building.world.plan();
    let high = plan.centre_of(plan.width() - 1, plan.height() - 1);
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    let (mut possible, mut unmapped_m, mut wrong, mut farther_m) = (0, Vec::new(), Vec::new(), Vec::new());
    for _ in 0..GOALS {
        let goal = Point2::new(
            rng.random_range(plan.origin().x - MARGIN_M..high.x + MARGIN_M),
            rng.random_range(plan.origin().y - MARGIN_M..high.y + MARGIN_M),
        );
        let is_reachable = building.is_reachable(goal);
        possible += usize::from(is_reachable);
        match building.route(goal, PathEnds::Unknown) {
            Ok(route) => {
                assert_eq!(route.goal_moved_m, 0.0);
                let through = building.hits(&route);
                wrong.extend(through.first().map(|at| (goal, *at, through.len(), route.unmapped_m)));
                unmapped_m.extend(is_reachable.then_some(route.unmapped_m));
            }
            Err(refusal) => {
                farther_m.push(building.nearest_instead(goal, &refusal));
                if is_reachable {
                    println!("refused, and could be reached: {goal:?}: {refusal}");
                }
            }
        }
    }
    let (found, refused) = (unmapped_m.len(), farther_m.len());
    println!("seed {SEED}: {found} of {possible} goals that can be reached have a path, {refused} goals have none");
    unmapped_m.sort_by(f64::total_cmp);
    println!("over unknown ground, metres: {:?}", &unmapped_m[found.saturating_sub(20)..]);
    farther_m.sort_by(f64::total_cmp);
    let [median_m, most_m] = [refused / 2, refused * 95 / 100].map(|index| farther_m[index]);
    println!("nearest points: {median_m:.2} m farther than possible in the median, of 95 % {most_m:.2} m at most");
    wrong.iter().for_each(|wrong| println!("goal, first hit, hits, unmapped: {wrong:?}"));
    assert!(wrong.is_empty(), "{} paths lead through something", wrong.len());
    assert!(median_m < 0.2 && most_m < 0.5, "{farther_m:?}");
    assert!(found * 100 >= possible * 97 && refused > 50, "{found} of {possible}, {refused}");
}
