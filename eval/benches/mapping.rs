//! What a frame costs: scan matching, the grid, node logic, the pose graph, and all of it together.
//! `sense`, one LiDAR frame of the simulator, is the machine's yardstick.

use divan::{Bencher, black_box};
use fht_map::MapState;
use fht_navigation::planning::{PlanConfig, Traversable, UnknownCells};
use fht_perception::drivable_line::DrivableLineConfig;
use fht_perception::frame::SensorFrame;
use fht_perception::free_rectangle;
use fht_perception::grid::{GridConfig, OccupancyGrid};
use fht_perception::matching::{MatchConfig, ReferenceCloud, SearchWindow, alignments, refine};
use fht_perception::pose::{Pose2, pose, to_fixed};
use fht_perception::pose_graph::{GraphConfig, PoseConstraint, optimise};
use fht_proto::{AuthorId, FixedPoint, NodeId};
use fht_sim::{SimConfig, Simulator};
use mapper::construct::{
    BuilderConfig, RefinementConfig, Roadmap, SupportConfig, edges_of, need_of_support, shortcuts,
};
use mapper::{Mapper, MapperConfig, MapperStep};
use nalgebra::Matrix3;
use std::sync::{Arc, OnceLock};

fn main() {
    divan::main();
}

/// A museum explored without cameras, 360 beams at 10 Hz.
struct Explored {
    map: MapState,
    grid: OccupancyGrid,
    frames: Vec<SensorFrame>,
    poses: Vec<Pose2>,
}

fn explored() -> &'static Explored {
    static EXPLORED: OnceLock<Explored> = OnceLock::new();
    EXPLORED.get_or_init(|| {
        let mut simulator = simulator();
        let mut mapper = Mapper::new(MapperConfig::default(), AuthorId(1), None).expect("threads");
        let (mut frames, mut poses) = (Vec::new(), Vec::new());
        let mut frame = simulator.sense_first();
        while let Ok(MapperStep::Drive(twist)) = mapper.step(&frame) {
            poses.extend(mapper.latest().map(|latest| latest.map_from_base));
            frames.push(std::mem::replace(&mut frame, simulator.step(twist)));
        }
        Explored { map: mapper.map().clone(), grid: mapper.grid().clone(), frames, poses }
    })
}

fn simulator() -> Simulator {
    let world = Arc::new(fht_sim::load("museum", None, 1).expect("the built-in museum is drawn"));
    let start = world.start();
    Simulator::new(world, SimConfig { camera_every: 0, ..SimConfig::default() }, start, 1)
}

/// One LiDAR frame of the simulator.
#[divan::bench]
fn sense(bencher: Bencher<'_, '_>) {
    let mut simulator = simulator();
    bencher.bench_local(|| simulator.sense_first());
}

mod matching {
    use super::*;

    fn pair() -> (ReferenceCloud, Vec<fht_perception::pose::Point2>, Pose2) {
        let run = explored();
        let (first, second) = (200, 204);
        let cloud = ReferenceCloud::from_scan(&run.frames[first].scan.points_in_base());
        let moved = run.poses[first].inverse() * run.poses[second];
        (cloud, run.frames[second].scan.points_in_base(), moved)
    }

    /// From a guess that is off by 0.1 m and 3°.
    #[divan::bench]
    fn refinement(bencher: Bencher<'_, '_>) {
        let (cloud, points, moved) = pair();
        let guess = moved * pose(0.1, 0.0, 0.05);
        bencher.bench(|| refine(&cloud, &points, &guess, &MatchConfig::default()));
    }

    /// Anywhere within 1 m and at any heading.
    #[divan::bench]
    fn search(bencher: Bencher<'_, '_>) {
        let (cloud, points, moved) = pair();
        let window = SearchWindow { centre: moved, half_x_m: 1.0, half_y_m: 1.0, half_yaw_rad: std::f64::consts::PI };
        bencher.bench(|| alignments(&cloud, &points, &window, &MatchConfig::default()));
    }
}

mod grid {
    use super::*;

    /// One scan into an existing grid.
    #[divan::bench]
    fn integrate(bencher: Bencher<'_, '_>) {
        let run = explored();
        let mut grid = run.grid.clone();
        bencher.bench_local(|| grid.integrate(&run.poses[300], &run.frames[300].scan));
    }

    /// A grid redrawn from a hundred scans, as after a loop closure.
    #[divan::bench]
    fn redraw_100(bencher: Bencher<'_, '_>) {
        let run = explored();
        bencher.bench(|| {
            let mut grid = OccupancyGrid::new(GridConfig::default());
            for (pose, frame) in run.poses.iter().zip(&run.frames).step_by(5).take(100) {
                grid.integrate(pose, &frame.scan);
            }
            grid
        });
    }
}

mod nodes {
    use super::*;

    fn here() -> (&'static MapState, &'static OccupancyGrid, FixedPoint) {
        let run = explored();
        (&run.map, &run.grid, to_fixed(&run.poses[run.poses.len() / 2]).position)
    }

    /// Whether the robot's place needs a support node; asked at every frame.
    #[divan::bench]
    fn need(bencher: Bencher<'_, '_>) {
        let (map, grid, here) = here();
        bencher.bench(|| need_of_support(map, grid, here, &SupportConfig::default(), &DrivableLineConfig::default()));
    }

    /// The edges of a new node.
    #[divan::bench]
    fn edges_of_a_node(bencher: Bencher<'_, '_>) {
        let (map, grid, here) = here();
        let id = NodeId { author: AuthorId(9), number: 0 };
        bencher.bench(|| edges_of(map, grid, id, here, &DrivableLineConfig::default()));
    }

    /// The rectangle of a new node.
    #[divan::bench]
    fn rectangle(bencher: Bencher<'_, '_>) {
        let (_, grid, here) = here();
        bencher.bench(|| free_rectangle::grow(grid, here, &BuilderConfig::default().free_space));
    }

    /// All edges checked, as after a loop closure.
    #[divan::bench]
    fn blocked_edges(bencher: Bencher<'_, '_>) {
        let (map, grid, _) = here();
        bencher.bench(|| mapper::construct::blocked_edges(map, grid, |_| true, &DrivableLineConfig::default()));
    }

    /// Shortcuts of all nodes, as at the end.
    #[divan::bench]
    fn refinement(bencher: Bencher<'_, '_>) {
        let (map, grid, _) = here();
        let plan = PlanConfig { robot_radius_m: 0.165, unknown: UnknownCells::Obstacle, ..PlanConfig::shortest() };
        let space = Traversable::new(grid, &plan);
        let (roadmap, config) = (Roadmap::of(map), RefinementConfig::default());
        bencher.bench(|| map.nodes().map(|node| shortcuts(&roadmap, &space, node.id, &config).len()).sum::<usize>());
    }
}

/// A chain of keyframes around a square, with a closure at every tenth.
#[divan::bench(args = [100, 1000, 5000])]
fn optimise_keyframes(bencher: Bencher<'_, '_>, count: usize) {
    let step =
        |index: usize| pose(0.3, 0.0, if index.is_multiple_of(50) { std::f64::consts::FRAC_PI_2 } else { 0.001 });
    let poses: Vec<Pose2> = (1..count).fold(vec![Pose2::identity()], |mut poses, index| {
        poses.push(poses[index - 1] * step(index));
        poses
    });
    let edge = |from: usize, to: usize, error: Pose2| PoseConstraint {
        from,
        to,
        measured: poses[from].inverse() * poses[to] * error,
        information: Matrix3::from_diagonal_element(1e4),
        is_doubtful: to > from + 1,
    };
    let mut all: Vec<PoseConstraint> = (1..count).map(|to| edge(to - 1, to, pose(0.001, 0.0, 0.0005))).collect();
    all.extend((200..count).step_by(10).map(|to| edge(to - 200, to, Pose2::identity())));
    let config = GraphConfig { is_graduated: false, ..GraphConfig::default() };
    bencher.bench(|| {
        let mut moved = poses.clone();
        optimise(&mut moved, &all, &config).expect("a connected graph");
        black_box(moved)
    });
}

/// A whole frame in the loop, averaged over a whole exploration (recorded frames; nothing is
/// driven).
#[divan::bench(sample_count = 3, sample_size = 1)]
fn all_frames_of_an_exploration(bencher: Bencher<'_, '_>) {
    let run = explored();
    bencher.counter(divan::counter::ItemsCount::new(run.frames.len())).bench_local(|| {
        let mut mapper = Mapper::new(MapperConfig::default(), AuthorId(1), None).expect("threads");
        for frame in &run.frames {
            let _ = mapper.observe(frame);
            mapper.take_increments();
        }
        mapper.map().digest()
    });
}
