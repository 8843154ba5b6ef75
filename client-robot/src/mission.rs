//! A robot with a task: it senses, finds its place on the map, and drives where it is told,
//! whatever robot stands behind the port. With a simulated robot and [`Taking::AfterFrames`] the
//! same map, world and seeds give the same run.

use crate::pilot::{DriveGoal, Failure, Pilot, PilotConfig, PilotStep, Task, TaskOutcome};
use fht_client::{FreeSpaceCache, LiveReplica, PathSource};
use fht_localization::LiveLandmarks;
use fht_map::plan::node_route::check_goal;
use fht_map::{MapState, NodeRef, NodeRouteConfig, PlanError, Rules};
use fht_perception::frame::{Panorama, SensorFrame};
use fht_perception::pose::{Point2, Pose2, fixed_point, from_fixed};
use fht_perception::robot::{Robot, RobotError, SilenceConfig, Supervised};
use fht_proto::api::reply::{ErrorCode, ErrorReply, known_names};
use fht_proto::{Descriptor, Footprint, Label, NodeId};
use fht_worker::Taking;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::ops::ControlFlow;
use std::pin::pin;
use std::sync::Arc;
use std::time::Duration;
use tokio::time::timeout;

/// A map that may change while it is used.
pub trait MapSource {
    /// A number that changes whenever the map does.
    fn changes(&self) -> u64;
    /// A number that changes when it is another map, of the same name.
    fn generation(&self) -> u64 {
        0
    }
    /// Looks at the map.
    fn view(&self, look: &mut dyn FnMut(&MapState));
    /// Where the place of this name is: its pose in the map frame. Names hold at once, whatever
    /// release is run.
    fn place(&self, name: &Label) -> Option<Pose2>;
    /// The names of all places.
    fn places(&self) -> Vec<Label>;
}

impl MapSource for LiveReplica {
    fn changes(&self) -> u64 {
        Self::changes(self)
    }
    fn generation(&self) -> u64 {
        Self::generation(self)
    }
    fn view(&self, look: &mut dyn FnMut(&MapState)) {
        look(&self.running());
    }
    fn place(&self, name: &Label) -> Option<Pose2> {
        MapSource::place(self.read().state(), name)
    }
    fn places(&self) -> Vec<Label> {
        MapSource::places(self.read().state())
    }
}

impl MapSource for MapState {
    fn changes(&self) -> u64 {
        1
    }
    fn view(&self, look: &mut dyn FnMut(&MapState)) {
        look(self);
    }
    fn place(&self, name: &Label) -> Option<Pose2> {
        self.annotations().place(name).map(from_fixed)
    }
    fn places(&self) -> Vec<Label> {
        self.annotations().places().map(|(name, _)| name.clone()).collect()
    }
}

/// Where to go once the place is known.
#[derive(Clone, Debug, PartialEq)]
pub enum MissionGoal {
    /// Nowhere: knowing the place is all.
    None,
    /// A point of the map frame, metres.
    Point(Point2),
    /// A pose of the map frame: the robot turns to its heading, too.
    Pose(Pose2),
    /// A node of the map.
    Node(NodeId),
    /// A place that an operator has named, and its heading.
    Named(Label),
    /// A node far from the robot that it can reach, drawn by this seed.
    FarNode(u64),
}

/// What a robot needs besides its sensors. All of it can go to another thread, so that a mission
/// can be spawned.
pub struct Services<'a> {
    /// The map.
    pub map: &'a (dyn MapSource + Sync),
    /// Paths.
    pub paths: &'a mut (dyn PathSource + Send),
    /// The descriptor of a panorama.
    pub describe: &'a mut (dyn FnMut(&Panorama) -> Option<Descriptor> + Send),
}

/// How a mission is carried out.
#[derive(Clone, Debug)]
pub struct MissionConfig {
    /// What the robot makes of its frames.
    pub pilot: PilotConfig,
    /// How long the sensors may be silent.
    pub silence: SilenceConfig,
    /// The ground that the robot covers: a goal that is drawn is one that it fits at. Default the
    /// paper's robot, of 0.105 m radius.
    pub footprint: Footprint,
    /// Whether a goal that cannot be reached means the nearest point that can. Default false.
    pub to_nearest: bool,
    /// When the walls of a map that has changed are used. Default two frames after the change, for
    /// simulated time; a live robot takes them [when they are there](Taking::WhenThere).
    pub walls: Taking,
}

impl Default for MissionConfig {
    fn default() -> Self {
        Self {
            pilot: PilotConfig::default(),
            silence: SilenceConfig::default(),
            footprint: Footprint::default(),
            to_nearest: false,
            walls: Taking::AfterFrames(2),
        }
    }
}

/// Why a mission ended without an outcome.
#[derive(Debug, thiserror::Error)]
pub enum MissionError {
    /// The robot cannot be sensed with or driven.
    #[error(transparent)]
    Robot(#[from] RobotError),
    /// The observer has ended it.
    #[error("the mission was interrupted")]
    Interrupted,
}

/// Watches a mission, and may end it: a display, a recording, a score against the truth.
pub trait MissionObserver {
    /// A frame and what it led to, before the command is given. [`ControlFlow::Break`] stops the
    /// robot and ends the mission.
    fn on_frame(&mut self, frame: &SensorFrame, step: &PilotStep, pilot: &Pilot) -> ControlFlow<()>;

    /// The robot knows its place and now drives to `goal`.
    fn on_goal(&mut self, goal: DriveGoal) {
        let _ = goal;
    }

    /// Asked now and then while no frame comes: whether the mission ends.
    fn is_over(&mut self) -> bool {
        false
    }

    /// Asked before each frame is worked on: where somebody says that the robot is, map frame, if
    /// that was said since. It may be wrong.
    fn pointed_at(&mut self) -> Option<Pose2> {
        None
    }
}

/// Nobody watches.
impl MissionObserver for () {
    fn on_frame(&mut self, _: &SensorFrame, _: &PilotStep, _: &Pilot) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }
}

/// Both watch.
impl<A: MissionObserver, B: MissionObserver> MissionObserver for (A, B) {
    fn on_frame(&mut self, frame: &SensorFrame, step: &PilotStep, pilot: &Pilot) -> ControlFlow<()> {
        let first = self.0.on_frame(frame, step, pilot);
        let second = self.1.on_frame(frame, step, pilot);
        if first.is_break() { first } else { second }
    }

    fn on_goal(&mut self, goal: DriveGoal) {
        self.0.on_goal(goal);
        self.1.on_goal(goal);
    }

    fn is_over(&mut self) -> bool {
        self.0.is_over() || self.1.is_over()
    }

    fn pointed_at(&mut self) -> Option<Pose2> {
        let first = self.0.pointed_at();
        let second = self.1.pointed_at();
        first.or(second)
    }
}

/// Somebody or nobody watches.
impl<O: MissionObserver> MissionObserver for Option<O> {
    fn on_frame(&mut self, frame: &SensorFrame, step: &PilotStep, pilot: &Pilot) -> ControlFlow<()> {
        self.as_mut().map_or(ControlFlow::Continue(()), |observer| observer.on_frame(frame, step, pilot))
    }

    fn on_goal(&mut self, goal: DriveGoal) {
        if let Some(observer) = self {
            observer.on_goal(goal);
        }
    }

    fn is_over(&mut self) -> bool {
        self.as_mut().is_some_and(MissionObserver::is_over)
    }

    fn pointed_at(&mut self) -> Option<Pose2> {
        self.as_mut().and_then(MissionObserver::pointed_at)
    }
}

impl<O: MissionObserver> MissionObserver for &mut O {
    fn on_frame(&mut self, frame: &SensorFrame, step: &PilotStep, pilot: &Pilot) -> ControlFlow<()> {
        (**self).on_frame(frame, step, pilot)
    }

    fn on_goal(&mut self, goal: DriveGoal) {
        (**self).on_goal(goal);
    }

    fn is_over(&mut self) -> bool {
        (**self).is_over()
    }

    fn pointed_at(&mut self) -> Option<Pose2> {
        (**self).pointed_at()
    }
}

/// How a mission ended, and what it took.
#[derive(Clone, Debug, PartialEq)]
pub struct MissionOutcome {
    /// How the task ended.
    pub task: TaskOutcome,
    /// How often a path was asked for.
    pub plans: usize,
    /// How often a fix was replaced by another place.
    pub refixes: usize,
}

/// Carries out a mission. The robot is told to stop at the end, however that comes; while its
/// sensors are silent it stands, and goes on when they are back. Needs a Tokio runtime with its
/// clock enabled; each frame is worked on inside of this future, so give it a thread of its own
/// where others must not wait for it.
///
/// # Errors
/// [`MissionError`]. A task that fails is an outcome.
pub async fn run<R: Robot>(
    robot: R,
    config: MissionConfig,
    goal: &MissionGoal,
    services: &mut Services<'_>,
    observer: &mut impl MissionObserver,
) -> Result<MissionOutcome, MissionError> {
    let mut robot = Supervised::new(robot, config.silence);
    let mut pilot = Pilot::new(config.pilot, Task::Relocalize);
    let mut director = OneGoal { goal, footprint: &config.footprint, to_nearest: config.to_nearest };
    let task = direct(&mut robot, &mut pilot, config.walls, &mut director, services, observer).await;
    robot.stop().await;
    Ok(MissionOutcome { task: task?, plans: pilot.plans(), refixes: pilot.localizer().refixes() })
}

/// Says what the robot is to do, frame by frame.
pub(crate) trait Director {
    /// Now and then while no frame comes: whoever waits for an answer gets one.
    fn meanwhile(&mut self, map: &dyn MapSource) {
        let _ = map;
    }

    /// The map is another one from here on: what it was to do there, or how all of it ends.
    fn map_replaced(&mut self) -> Option<TaskOutcome>;

    /// Before a frame is worked on: another task, if there is one.
    fn before(&mut self, map: &dyn MapSource) -> Option<Task>;

    /// After it: another task, if there is one, or how all of it ended.
    fn after(&mut self, step: &PilotStep, pilot: &Pilot, map: &dyn MapSource)
    -> ControlFlow<TaskOutcome, Option<Task>>;
}

/// Finding the place, and then one goal.
struct OneGoal<'a> {
    goal: &'a MissionGoal,
    footprint: &'a Footprint,
    to_nearest: bool,
}

impl Director for OneGoal<'_> {
    fn map_replaced(&mut self) -> Option<TaskOutcome> {
        // Whoever only looks for the robot's place finds it on the map that is there.
        (*self.goal != MissionGoal::None).then_some(TaskOutcome::Failed(Failure::MapReplaced))
    }

    fn before(&mut self, _: &dyn MapSource) -> Option<Task> {
        None
    }

    fn after(&mut self, step: &PilotStep, _: &Pilot, map: &dyn MapSource) -> ControlFlow<TaskOutcome, Option<Task>> {
        match &step.outcome {
            Some(TaskOutcome::Localized) if *self.goal != MissionGoal::None => match self.choose(map, step) {
                Ok(place) => {
                    ControlFlow::Continue(Some(Task::GoTo(DriveGoal { to_nearest: self.to_nearest, ..place })))
                }
                Err(unknown) => ControlFlow::Break(TaskOutcome::Failed(Failure::NoPath(unknown))),
            },
            Some(outcome) => ControlFlow::Break(outcome.clone()),
            None => ControlFlow::Continue(None),
        }
    }
}

/// The next frame. While none comes, the mission can be ended, and questions are answered.
async fn next_frame<R: Robot>(
    robot: &mut Supervised<R>,
    director: &mut impl Director,
    map: &(dyn MapSource + Sync),
    observer: &mut impl MissionObserver,
) -> Result<SensorFrame, MissionError> {
    /// Between two looks.
    const MEANWHILE: Duration = Duration::from_millis(100);
    let mut sensing = pin!(robot.sense());
    loop {
        match timeout(MEANWHILE, &mut sensing).await {
            Ok(frame) => return Ok(frame?),
            Err(_) if observer.is_over() => return Err(MissionError::Interrupted),
            Err(_) => director.meanwhile(map),
        }
    }
}

/// The robot's loop: sense, think, drive.
pub(crate) async fn direct<R: Robot>(
    robot: &mut Supervised<R>,
    pilot: &mut Pilot,
    walls: Taking,
    director: &mut impl Director,
    services: &mut Services<'_>,
    observer: &mut impl MissionObserver,
) -> Result<TaskOutcome, MissionError> {
    let mut live = LiveLandmarks::start(walls, services.map.generation());
    loop {
        let frame = next_frame(robot, director, services.map, observer).await?;
        if live.restart_at(services.map.generation()) {
            pilot.replace_map();
            if let Some(outcome) = director.map_replaced() {
                return Ok(outcome);
            }
        }
        live.follow(services.map.changes(), |follow| services.map.view(follow));
        if let Some(task) = director.before(services.map) {
            give(pilot, task, observer);
        }
        if let Some(map_from_base) = observer.pointed_at() {
            pilot.point_at(map_from_base);
        }
        let describe = || frame.panorama.as_ref().and_then(|panorama| (services.describe)(panorama));
        let step = pilot.step(live.landmarks(), &frame, describe, services.paths);
        let flow = observer.on_frame(&frame, &step, pilot);
        match director.after(&step, pilot, services.map) {
            ControlFlow::Break(outcome) => return Ok(outcome),
            // A task that ends leaves the robot standing.
            ControlFlow::Continue(task) => task.into_iter().for_each(|task| give(pilot, task, observer)),
        }
        if flow.is_break() {
            return Err(MissionError::Interrupted);
        }
        robot.drive(step.command).await?;
    }
}

fn give(pilot: &mut Pilot, task: Task, observer: &mut impl MissionObserver) {
    if let Task::GoTo(goal) = task {
        observer.on_goal(goal);
    }
    pilot.set_task(task);
}

impl OneGoal<'_> {
    /// Where to go, now that the robot knows where it is; or why there is no such place.
    fn choose(&self, map: &dyn MapSource, step: &PilotStep) -> Result<DriveGoal, ErrorReply> {
        match self.goal {
            MissionGoal::FarNode(seed) => {
                let here = step.localization.map_from_base().map(|pose| Point2::from(pose.translation.vector));
                let found = here.and_then(|here| far_node(map, here, self.footprint, *seed)).map(DriveGoal::from);
                found.ok_or_else(|| unknown(ErrorCode::UnknownNode, "node to drive to"))
            }
            goal => place_of(goal, map),
        }
    }
}

fn unknown(code: ErrorCode, what: &str) -> ErrorReply {
    ErrorReply::new(code, &format!("the map has no {what}"))
}

/// Where a goal is that does not depend on where the robot is; or why there is no such place.
pub(crate) fn place_of(goal: &MissionGoal, map: &dyn MapSource) -> Result<DriveGoal, ErrorReply> {
    match goal {
        MissionGoal::Point(point) => Ok((*point).into()),
        MissionGoal::Pose(pose) => Ok((*pose).into()),
        MissionGoal::Named(name) => {
            let what = || format!("place called {name} ({})", known_names(map.places()));
            map.place(name).map(DriveGoal::from).ok_or_else(|| unknown(ErrorCode::UnknownPlace, &what()))
        }
        MissionGoal::Node(id) => {
            let mut found = None;
            map.view(&mut |map| found = map.node(*id).map(position));
            let found = found.map(DriveGoal::from);
            found.ok_or_else(|| unknown(ErrorCode::UnknownNode, &format!("node {id}")))
        }
        MissionGoal::None | MissionGoal::FarNode(_) => Err(unknown(ErrorCode::UnknownPlace, "place for no goal")),
    }
}

/// Refuses a goal that no path could end at, unless the robot may drive to the nearest point.
pub(crate) fn check_on_map(goal: &DriveGoal, map: &dyn MapSource) -> Result<(), ErrorReply> {
    let mut checked = Ok(());
    if !goal.to_nearest {
        map.view(&mut |map| checked = check_goal(map, fixed_point(goal.position), &NodeRouteConfig::default()));
    }
    Ok(checked.map_err(PlanError::Route)?)
}

/// A node drawn from the farthest third of those that a robot of this footprint can reach from
/// `here`. If it can reach none of those that are tried, the first that was drawn: the robot then
/// says why.
fn far_node(map: &dyn MapSource, here: Point2, footprint: &Footprint, seed: u64) -> Option<Point2> {
    /// So many are tried.
    const TRIES: usize = 200;
    let mut drawn = None;
    map.view(&mut |map| {
        let mut places: Vec<Point2> = map.nodes().map(position).collect();
        places.sort_by(|a, b| (b - here).norm().total_cmp(&(a - here).norm()));
        let far = places.len().div_ceil(3);
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let first = rng.random_range(0..far.max(1));
        // Those after it, then those before it, then nearer ones.
        let order = (first..far).chain(0..first).chain(far..places.len());
        let mut space = FreeSpaceCache::default().for_footprint(footprint.clone());
        let rules = Arc::new(Rules::of(map, Vec::new()));
        let mut is_reached = |to: Point2| space.plan(map, 0, here, to, &rules).is_ok();
        let reached = order.take(TRIES).map(|index| places[index]).find(|&place| is_reached(place));
        drawn = reached.or(places.get(first).copied());
    });
    drawn
}

fn position(node: NodeRef<'_>) -> Point2 {
    Point2::new(node.pose.position.x(), node.pose.position.y())
}

#[cfg(test)]
mod tests {
    use super::far_node;
    use fht_map::MapState;
    use fht_perception::pose::Point2;
    use fht_proto::{AuthorId, EdgeKey, FixedPose, Footprint, Increment, NodeId, NodeKind, Op, Rect};

    /// Rooms on the left and on the right of a hall; a gap of 0.4 m leads to the one on the right.
    fn rooms() -> MapState {
        let author = AuthorId(1);
        let id = |number: u32| NodeId { author, number };
        let node = |number: u32, (x, y): (f64, f64), low: (f64, f64), high: (f64, f64)| {
            let pose = FixedPose::from_metres(x, y, 0.0);
            let rect = Rect::around(pose.position, low, high);
            [
                Op::PutNode { id: id(number), kind: NodeKind::Support, pose },
                Op::SetFreeSpace { id: id(number), rect: Some(rect) },
            ]
        };
        let mut ops = Vec::new();
        ops.extend(node(0, (0.0, 0.0), (-2.0, -2.0), (2.0, 2.0)));
        ops.extend(node(1, (-4.0, 0.0), (-6.0, -2.0), (-1.5, 2.0)));
        ops.extend(node(2, (4.0, 0.0), (1.5, -0.2), (6.5, 0.2)));
        for (number, y) in (3..9).zip([-1.5, -1.0, -0.5, 0.5, 1.0, 1.5]) {
            ops.extend(node(number, (8.0, y), (6.0, -2.0), (10.0, 2.0)));
            ops.push(Op::PutEdge { edge: EdgeKey::new(id(2), id(number)) });
        }
        ops.extend([(0, 1), (0, 2)].map(|(a, b)| Op::PutEdge { edge: EdgeKey::new(id(a), id(b)) }));
        let mut map = MapState::new();
        map.apply(&Increment { author, number: 1, hlc_us: 1, ops });
        map
    }

    #[test]
    fn a_goal_that_is_drawn_is_one_that_the_robot_fits_at() {
        let (map, here) = (rooms(), Point2::origin());
        let large = Footprint::disc(0.3).expect("a footprint");
        for seed in 0..20 {
            let drawn = |footprint: &Footprint| far_node(&map, here, footprint, seed).map(|place| place.x);
            assert_eq!(drawn(&Footprint::default()), Some(8.0), "seed {seed}: the far room");
            assert_eq!(drawn(&large), Some(-4.0), "seed {seed}: it does not fit through the gap");
        }
    }
}
