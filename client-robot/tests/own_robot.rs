//! A robot of one's own behind the port, without the simulator: it finds its place in a small map
//! and drives where it is told, once or as it is sent; when its sensors fall silent it stands, and
//! goes on when they are back.

#![allow(clippy::unwrap_used)] // tests may panic

mod drawn_walls;

use client_robot::goals::GoalQueue;
use client_robot::mission::{
    MapSource, MissionConfig, MissionError, MissionGoal, MissionObserver, MissionOutcome, Services, run,
};
use client_robot::pilot::{Pilot, PilotStep, TaskOutcome};
use client_robot::serving::{GoalDesk, ServeError, locate, serve};
use drawn_walls::{Wall, range_m};
use fht_client::{FreeSpaceCache, PathSource, PlannedPath, rules_of_own};
use fht_map::{MapState, PathEnds};
use fht_perception::frame::{LaserScan, SensorFrame, Twist};
use fht_perception::pose::{Point2, Pose2, pose, to_fixed};
use fht_perception::robot::{Robot, RobotError, Sensors, SilenceConfig};
use fht_proto::api::goal::{GoalOrder, GoalState};
use fht_proto::api::reply::{ErrorReply, PlaceRef};
use fht_proto::{AuthorId, EdgeKey, FixedPoint, Increment, NodeId, NodeKind, Op, Rect, Signature};
use std::collections::BTreeSet;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;
use tokio::time::Instant;

/// An L-shaped room of 7 m × 6 m with a cupboard: nothing in it looks like anything else.
fn room() -> Vec<Wall> {
    let outline = [(-3.0, -2.0), (4.0, -2.0), (4.0, 1.0), (1.0, 1.0), (1.0, 4.0), (-3.0, 4.0), (-3.0, -2.0)];
    let cupboard = [(0.8, -2.0), (0.8, -1.4), (2.0, -1.4), (2.0, -2.0)];
    outline.windows(2).chain(cupboard.windows(2)).map(|pair| [pair[0], pair[1]]).collect()
}

fn scan(walls: &[Wall], at: &Pose2) -> LaserScan {
    LaserScan::all_round(360, |cos, sin| range_m(walls, at, (cos, sin)))
}

/// Main nodes in the room, each with the scan that was taken there.
fn map(walls: &[Wall]) -> MapState {
    let author = AuthorId(1);
    let id = |number: usize| NodeId { author, number: number as u32 };
    let places = [(0.0, 0.0), (2.8, -0.3), (-1.5, 2.5), (-1.8, -0.8)];
    let mut ops = Vec::new();
    for (number, (x, y)) in places.into_iter().enumerate() {
        let at = pose(x, y, 0.7 * number as f64);
        let fixed = to_fixed(&at);
        let rect = Rect::around(fixed.position, (x - 0.8, y - 0.8), (x + 0.8, y + 0.8));
        ops.push(Op::PutNode { id: id(number), kind: NodeKind::Main, pose: fixed });
        ops.push(Op::SetFreeSpace { id: id(number), rect: Some(rect) });
        let signature = Signature { descriptor: None, scan: scan(walls, &at).to_record() };
        ops.push(Op::SetSignature { id: id(number), signature });
        ops.extend((number > 0).then(|| Op::PutEdge { edge: EdgeKey::new(id(0), id(number)) }));
    }
    let mut map = MapState::new();
    map.apply(&Increment { author, number: 1, hlc_us: 1, ops });
    map
}

/// Time between two scans: 10 Hz.
const PERIOD_S: f64 = 0.1;

/// What the robot was told and where it is, for the test to look at.
#[derive(Clone, Default)]
struct Log(Arc<Mutex<(Vec<Twist>, Option<Pose2>)>>);

/// The whole of a robot of one's own.
struct Toy {
    walls: Vec<Wall>,
    at: Pose2,
    odom_from_base: Pose2,
    command: Twist,
    frames: u64,
    /// The sensors fall silent at this frame, for so long.
    silence: Option<(u64, Duration)>,
    silent_until: Option<Instant>,
    log: Log,
}

impl Toy {
    fn new(silence: Option<(u64, Duration)>) -> Self {
        Self {
            walls: room(),
            at: pose(-1.2, 1.5, 2.0),
            odom_from_base: Pose2::identity(),
            command: Twist::default(),
            frames: 0,
            silence,
            silent_until: None,
            log: Log::default(),
        }
    }
}

impl Sensors for Toy {
    async fn sense(&mut self) -> Result<SensorFrame, RobotError> {
        if let Some((_, time)) = self.silence.filter(|(frame, _)| *frame == self.frames) {
            let until = *self.silent_until.get_or_insert_with(|| Instant::now() + time);
            tokio::time::sleep_until(until).await;
            self.silence = None;
        }
        let moved = pose(self.command.linear_mps * PERIOD_S, 0.0, self.command.angular_radps * PERIOD_S);
        self.at *= moved;
        self.odom_from_base *= moved;
        self.frames += 1;
        self.log.0.lock().unwrap().1 = Some(self.at);
        Ok(SensorFrame {
            time_us: self.frames * 100_000,
            odom_from_base: self.odom_from_base,
            scan: scan(&self.walls, &self.at),
            panorama: None,
        })
    }
}

impl Robot for Toy {
    async fn drive(&mut self, command: Twist) -> Result<(), RobotError> {
        self.command = command;
        self.log.0.lock().unwrap().0.push(command);
        Ok(())
    }
}

/// Paths on the map at hand.
struct OwnPaths<'a>(&'a MapState, PathEnds);

impl PathSource for OwnPaths<'_> {
    fn begin(&mut self, to_nearest: bool) {
        self.1 = if to_nearest { PathEnds::ToNearest } else { PathEnds::Unknown };
    }

    fn plan(&mut self, from: Point2, to: Point2, blocked: &BTreeSet<FixedPoint>) -> Result<PlannedPath, ErrorReply> {
        FreeSpaceCache::default().plan_between(self.0, 0, (from, to, self.1), &rules_of_own(blocked))
    }
}

/// Ends a mission at a frame.
struct EndsAt(u64);

impl MissionObserver for EndsAt {
    fn on_frame(&mut self, frame: &SensorFrame, _: &PilotStep, _: &Pilot) -> ControlFlow<()> {
        if frame.time_us >= self.0 * 100_000 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

const GOAL: (f64, f64) = (2.8, -0.3);

fn mission(
    toy: Toy,
    silence: SilenceConfig,
    observer: &mut impl MissionObserver,
) -> (Result<MissionOutcome, MissionError>, Vec<Twist>, Pose2) {
    let (map, log) = (map(&toy.walls), toy.log.clone());
    let mut services = Services { map: &map, paths: &mut OwnPaths(&map, PathEnds::Unknown), describe: &mut |_| None };
    let config = MissionConfig { silence, ..MissionConfig::default() };
    let goal = MissionGoal::Point(Point2::new(GOAL.0, GOAL.1));
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
    let outcome = runtime.block_on(run(toy, config, &goal, &mut services, observer));
    let (commands, at) = std::mem::take(&mut *log.0.lock().unwrap());
    (outcome, commands, at.unwrap())
}

fn is_stop(command: &Twist) -> bool {
    *command == Twist::default()
}

fn assert_arrived(outcome: Result<MissionOutcome, MissionError>, commands: &[Twist], at: &Pose2) {
    assert_eq!(outcome.unwrap().task, TaskOutcome::Arrived);
    let left_m = (at.translation.x - GOAL.0).hypot(at.translation.y - GOAL.1);
    assert!(left_m < 0.3, "{left_m} m from the goal");
    assert!(commands.last().is_some_and(is_stop) && !commands.iter().all(is_stop));
}

#[test]
fn it_finds_its_place_and_drives_to_the_goal() {
    let (outcome, commands, at) = mission(Toy::new(None), SilenceConfig::default(), &mut ());
    assert_arrived(outcome, &commands, &at);
}

#[test]
fn silent_sensors_stop_it_and_it_goes_on_when_they_are_back() {
    let silence = SilenceConfig { stop_after_s: 0.05, end_after_s: 30.0 };
    let (outcome, commands, at) = mission(Toy::new(Some((15, Duration::from_millis(300)))), silence, &mut ());
    // Fifteen frames have led to fifteen commands; then it was told to stop, again and again.
    assert!(commands[15..18].iter().all(is_stop), "{:?}", &commands[10..20]);
    assert_arrived(outcome, &commands, &at);
}

#[test]
fn sensors_that_stay_silent_end_the_mission() {
    let silence = SilenceConfig { stop_after_s: 0.05, end_after_s: 0.3 };
    let (outcome, commands, _) = mission(Toy::new(Some((15, Duration::from_secs(3600)))), silence, &mut ());
    let error = outcome.unwrap_err();
    assert!(matches!(error, MissionError::Robot(RobotError::Silent { .. })), "{error}");
    assert!(error.to_string().contains("silent for 0.3"), "{error}");
    assert!(commands.last().is_some_and(is_stop));
}

#[test]
fn who_watches_may_end_it_and_the_robot_stops() {
    let (outcome, commands, _) = mission(Toy::new(None), SilenceConfig::default(), &mut EndsAt(12));
    assert!(matches!(outcome, Err(MissionError::Interrupted)));
    assert_eq!(commands.len(), 12, "eleven commands, and the stop");
    assert!(commands.last().is_some_and(is_stop));
}

/// Ends a mission after so many looks at a silence.
struct EndsInSilence(u32);

impl MissionObserver for EndsInSilence {
    fn on_frame(&mut self, _: &SensorFrame, _: &PilotStep, _: &Pilot) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }

    fn is_over(&mut self) -> bool {
        self.0 = self.0.saturating_sub(1);
        self.0 == 0
    }
}

/// Counts how often it is asked.
struct Counting(usize);

impl GoalDesk for Counting {
    fn exchange(&mut self, _: &mut GoalQueue, _: &dyn MapSource) {
        self.0 += 1;
    }
}

#[test]
fn while_the_sensors_are_silent_questions_are_answered_and_it_can_be_ended() {
    let toy = Toy::new(Some((15, Duration::from_secs(3600))));
    let (map, log) = (map(&toy.walls), toy.log.clone());
    let mut services = Services { map: &map, paths: &mut OwnPaths(&map, PathEnds::Unknown), describe: &mut |_| None };
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
    let (mut desk, mut observer, config) = (Counting(0), EndsInSilence(8), MissionConfig::default());
    let serving = serve(toy, config, "toy", &mut desk, &mut services, &mut observer);
    let ended = runtime.block_on(async { tokio::time::timeout(Duration::from_secs(30), serving).await });
    assert!(matches!(ended, Ok(Err(ServeError::Mission(MissionError::Interrupted)))), "{ended:?}");
    assert_eq!(desk.0, 15 + 7 + 1, "with each frame, in the silence, and at the end");
    assert!(log.0.lock().unwrap().0.last().is_some_and(is_stop));
}

/// Sends the robot: stage by stage, as its word comes.
struct Dispatcher {
    log: Log,
    stage: usize,
    frames: u64,
    /// Where the robot truly was when it was told to stand, and when that was over.
    stood: Vec<Pose2>,
    is_done: Arc<AtomicBool>,
}

impl Dispatcher {
    fn order(id: &str, (x, y): (f64, f64), to_nearest: bool) -> GoalOrder {
        let to = PlaceRef::Point(FixedPoint::from_metres(x, y));
        GoalOrder { id: id.to_owned(), to, yaw: None, to_nearest }
    }

    fn at(&self) -> Pose2 {
        self.log.0.lock().unwrap().1.unwrap()
    }
}

impl GoalDesk for Dispatcher {
    fn exchange(&mut self, goals: &mut GoalQueue, map: &dyn MapSource) {
        let status = goals.status(None).unwrap();
        let mut send =
            |id, at, to_nearest| goals.offer(Self::order(id, at, to_nearest), |order| locate(order, map)).is_ok();
        self.frames += 1;
        let is_over = match self.stage {
            // Until it knows its place.
            0 => send("a", GOAL, false),
            1 => status.to_go_m.is_some_and(|metres| metres < 3.0),
            2 => goals.cancel(Some("a")).is_ok_and(|status| status.state == GoalState::Cancelled),
            3 => self.frames > 20,
            // What is not on the map is refused; to its nearest point it may be sent.
            4 => {
                let are_taken = send("b", GOAL, false) && send("c", (1.0, 0.0), false);
                are_taken && !send("off", (9.0, 0.0), false) && send("d", (9.0, -0.3), true)
            }
            5 => status.id.as_deref() == Some("d") && status.state.is_final(),
            _ => false,
        };
        if is_over {
            self.stage += 1;
            self.frames = 0;
            self.stood.extend([2, 3].contains(&(self.stage - 1)).then(|| self.at()));
            self.is_done.store(self.stage == 6, Ordering::Relaxed);
        }
        if self.stage == 6 {
            let state = |id: &str| goals.status(Some(id)).unwrap().state;
            assert_eq!(
                ["a", "b", "c", "d"].map(state),
                [GoalState::Cancelled, GoalState::Arrived, GoalState::Cancelled, GoalState::Arrived]
            );
        }
    }
}

/// Ends what goes on when a flag is set.
struct EndsWhen(Arc<AtomicBool>);

impl MissionObserver for EndsWhen {
    fn on_frame(&mut self, frame: &SensorFrame, _: &PilotStep, _: &Pilot) -> ControlFlow<()> {
        assert!(frame.time_us < 600_000_000, "ten minutes are enough");
        if self.0.load(Ordering::Relaxed) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

#[test]
fn it_drives_wherever_it_is_sent_and_stands_when_told_to() {
    let toy = Toy::new(None);
    let (map, log, is_done) = (map(&toy.walls), toy.log.clone(), Arc::new(AtomicBool::new(false)));
    let mut services = Services { map: &map, paths: &mut OwnPaths(&map, PathEnds::Unknown), describe: &mut |_| None };
    let mut desk = Dispatcher { log, stage: 0, frames: 0, stood: Vec::new(), is_done: Arc::clone(&is_done) };
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
    let mut observer = EndsWhen(is_done);
    let serving = serve(toy, MissionConfig::default(), "toy", &mut desk, &mut services, &mut observer);
    let ended = runtime.block_on(serving);
    assert!(matches!(ended, Err(ServeError::Mission(MissionError::Interrupted))), "{ended:?}");
    let [told, then] = desk.stood[..] else { panic!("{} times", desk.stood.len()) };
    // It had one frame's command when it was told.
    assert!((told.translation.vector - then.translation.vector).norm() < 0.1, "{told} {then}");
    let (at, wall_x) = (desk.at().translation, 4.0);
    assert!(at.x > 3.0 && at.x < wall_x, "as near to (9, -0.3) as it can: {at}");
}
