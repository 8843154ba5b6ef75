//! A Nav2 that drives straight ahead: the transforms say where the robot is.

use crate::messages::{
    Navigate, NavigateFeedback, NavigateResult, Quaternion, TfMessage, Transform, Twist, TwistStamped, Vector3,
};
use hiroz::action::Executing;
use hiroz::action::server::GoalHandle;
use hiroz::node::ZNode;
use hiroz::{Builder, Result};
use std::f64::consts::PI;
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// Between two commands.
const STEP: Duration = Duration::from_millis(50);
const NEAR_M: f64 = 0.2;
const NEAR_RAD: f64 = 0.1;

/// x, y, yaw.
type Pose = [f64; 3];

/// Where the robot is: the map's view of the odometry's origin, and the odometry.
#[derive(Default)]
struct Place {
    map_from_odom: Option<Pose>,
    odom_from_base: Option<Pose>,
}

impl Place {
    fn hear(&mut self, message: &TfMessage) {
        for link in &message.transforms {
            match (link.header.frame_id.as_str(), link.child_frame_id.as_str()) {
                ("map", "odom") => self.map_from_odom = Some(flat(&link.transform)),
                ("odom", "base_link") => self.odom_from_base = Some(flat(&link.transform)),
                _ => {}
            }
        }
    }

    fn map_from_base(&self) -> Option<Pose> {
        let ([x, y, yaw], [ahead, left, turn]) = (self.map_from_odom?, self.odom_from_base?);
        let (sin, cos) = yaw.sin_cos();
        Some([x + cos * ahead - sin * left, y + sin * ahead + cos * left, yaw + turn])
    }
}

fn flat(at: &Transform) -> Pose {
    [at.translation.x, at.translation.y, yaw_of(&at.rotation)]
}

fn yaw_of(rotation: &Quaternion) -> f64 {
    2.0 * rotation.z.atan2(rotation.w)
}

/// Speed, turning rate, and how far it is; no speeds once it is there.
fn steer([x, y, yaw]: Pose, goal: Pose) -> (Option<[f64; 2]>, f64) {
    let (dx, dy) = (goal[0] - x, goal[1] - y);
    let far = dx.hypot(dy);
    let wanted = if far < NEAR_M { goal[2] } else { dy.atan2(dx) };
    let turn = (wanted - yaw + PI).rem_euclid(2.0 * PI) - PI;
    if far < NEAR_M && turn.abs() < NEAR_RAD {
        return (None, far);
    }
    let speed = if far >= NEAR_M && turn.abs() < 0.3 { far.min(0.3) } else { 0.0 };
    (Some([speed, turn.clamp(-0.8, 0.8)]), far)
}

pub async fn serve(node: &ZNode) -> Result<()> {
    let place = Arc::new(Mutex::new(Place::default()));
    let hearing = Arc::clone(&place);
    let _transforms = node
        .create_sub::<TfMessage>("tf")
        .build_with_callback(move |message: TfMessage| hearing.lock().expect("nobody panics").hear(&message))?;
    let commands = node.create_pub::<TwistStamped>("cmd_vel").build()?;
    let server = node.create_action_server::<Navigate>("navigate_to_pose").build()?;
    let (offer, mut goals) = tokio::sync::mpsc::channel(16);
    tokio::spawn(async move {
        while let Ok(request) = server.recv_goal().await {
            if offer.send(request.accept().execute()).await.is_err() {
                return;
            }
        }
    });
    println!("ready");
    std::thread::spawn(|| {
        let _ = std::io::copy(&mut std::io::stdin(), &mut std::io::sink());
        std::process::exit(0);
    });
    let mut active: Option<GoalHandle<Navigate, Executing>> = None;
    let mut step = tokio::time::interval(STEP);
    loop {
        step.tick().await;
        while let Ok(goal) = goals.try_recv() {
            let at = &goal.goal().pose.pose.position;
            println!("goal {:.3} {:.3}", at.x, at.y);
            if let Some(before) = active.replace(goal) {
                before.abort(NavigateResult::default())?;
            }
        }
        let Some(goal) = active.take() else { continue };
        let drive = |[ahead, turn]: [f64; 2]| {
            let linear = Vector3 { x: ahead, ..Vector3::default() };
            let angular = Vector3 { z: turn, ..Vector3::default() };
            commands.publish(&TwistStamped { twist: Twist { linear, angular }, ..TwistStamped::default() })
        };
        if goal.try_process_cancel() {
            drive([0.0, 0.0])?;
            goal.canceled(NavigateResult::default())?;
            continue;
        }
        let Some(here) = place.lock().expect("nobody panics").map_from_base() else {
            active = Some(goal);
            continue;
        };
        let wanted = &goal.goal().pose.pose;
        let (speeds, far) = steer(here, [wanted.position.x, wanted.position.y, yaw_of(&wanted.orientation)]);
        drive(speeds.unwrap_or_default())?;
        if speeds.is_none() {
            goal.succeed(NavigateResult::default())?;
        } else {
            goal.publish_feedback(NavigateFeedback { distance_remaining: far as f32, ..NavigateFeedback::default() })?;
            active = Some(goal);
        }
    }
}
