//! What a receiver has been told of the robots.

use crate::scene::map_progress::deletion;
use crate::scene::robots::{KnownRobot, RobotsNow};
use crate::scene::shapes::{BLUE, GREY, MAP_FRAME, ORANGE, arrow, disc, empty, faint, plane_pose, text};
use fht_proto::api::fleet::LocalizationState;
use foxglove::messages::{
    FrameTransform, FrameTransforms, PosesInFrame, Quaternion, SceneEntity, SceneUpdate, Timestamp, Vector3,
};
use std::collections::BTreeSet;

/// What a receiver has been told of the robots.
#[derive(Debug, Default)]
pub(crate) struct RobotProgress {
    told: Option<u64>,
    drawn: BTreeSet<String>,
}

impl RobotProgress {
    /// What has changed; `None` if nothing has. The first message deletes whatever the receiver has
    /// on this channel.
    pub(crate) fn next(&mut self, now: &RobotsNow, at: Timestamp) -> Option<SceneUpdate> {
        if self.told == Some(now.change) {
            return None;
        }
        let mut update = SceneUpdate::default();
        if self.told.is_none() {
            update.deletions.push(deletion(None, at));
        }
        let since = self.told.replace(now.change).unwrap_or_default();
        for (name, robot) in now.by_name.iter().filter(|(_, robot)| robot.change > since) {
            if let Some(entity) = entity(name, robot, at) {
                self.drawn.insert(name.clone());
                update.entities.push(entity);
            } else if self.drawn.remove(name) {
                update.deletions.push(deletion(Some(id(name)), at));
            }
        }
        let gone: Vec<String> = self.drawn.iter().filter(|name| !now.by_name.contains_key(*name)).cloned().collect();
        for name in gone {
            self.drawn.remove(&name);
            update.deletions.push(deletion(Some(id(&name)), at));
        }
        Some(update)
    }
}

fn id(name: &str) -> String {
    format!("robot {name}")
}

/// A robot that knows where it is has a nose. One that does not is drawn wherever it may be, and
/// one that is lost where it was.
fn entity(name: &str, robot: &KnownRobot, at: Timestamp) -> Option<SceneEntity> {
    let mut entity = empty(id(name), at);
    let (places, colour, words) = match robot.state {
        LocalizationState::Localized => (vec![(robot.place?, 1.0)], BLUE, name.to_owned()),
        LocalizationState::Lost => (vec![(robot.place?, 1.0)], GREY, format!("{name}: lost")),
        LocalizationState::Candidates | LocalizationState::NotLocalized => {
            (robot.candidates.clone(), ORANGE, format!("{name}: {:.0} %?", 100.0 * robot.confidence))
        }
    };
    let ([x, y, _], _) = *places.first()?;
    entity.texts.push(text(words, x, y, colour));
    for (place, share) in places {
        let colour = faint(colour, 0.3 + 0.7 * share);
        entity.cylinders.push(disc(place[0], place[1], 0.3, 0.15, colour));
        entity.arrows.push(arrow(place, 0.6, colour));
    }
    Some(entity)
}

/// Where the robots are that know it.
pub(crate) fn poses(now: &RobotsNow, at: Timestamp) -> PosesInFrame {
    let known = now.by_name.values().filter_map(KnownRobot::pose);
    PosesInFrame {
        timestamp: Some(at),
        frame_id: MAP_FRAME.to_owned(),
        poses: known.map(|pose| plane_pose(pose, 0.0)).collect(),
    }
}

/// Frames of robots that have moved since a change, `map` to `ROBOT/base_link`; `None` without any.
pub(crate) fn transforms(now: &RobotsNow, since: u64, at: Timestamp) -> Option<FrameTransforms> {
    let moved = now.by_name.iter().filter(|(_, robot)| robot.change > since);
    let transforms: Vec<FrameTransform> = moved
        .filter_map(|(name, robot)| {
            let [x, y, yaw] = robot.pose()?;
            let (sin, cos) = (0.5 * yaw).sin_cos();
            Some(FrameTransform {
                timestamp: Some(at),
                parent_frame_id: MAP_FRAME.to_owned(),
                child_frame_id: format!("{name}/base_link"),
                translation: Some(Vector3 { x, y, z: 0.0 }),
                rotation: Some(Quaternion { x: 0.0, y: 0.0, z: sin, w: cos }),
            })
        })
        .collect();
    (!transforms.is_empty()).then_some(FrameTransforms { transforms })
}
