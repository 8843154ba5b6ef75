//! 2D LiDAR SLAM: scans matched to submaps, submaps and keyframes held together by a pose graph.
//!
//! The front end is here: each scan is matched to a submap of the last few metres, starting from
//! what the wheels say. Drift inside it is millimetres, and nothing that the back end does disturbs
//! it. The back end moves submaps; the robot's pose in the map is the pose of its submap times its
//! pose therein.
//!
//! | module | idea |
//! | --- | --- |
//! | `tracking` | whether the robot is where it thinks it is, and how a lost one is found again |
//! | `wheels_word` | whether the wheels and the scans agree |
//! | `witness` | what was seen a moment ago |
//! | `heading_walk` | how far the wheels' heading walks off |
//! | `held_heading` | what of a scan's heading is believed beside wheels that are proven |
//! | `keyframe` | the scans that join submaps and the graph |
//! | `submap` | walls and free space that some keyframes saw |
//! | `graph` | the keyframes and what was measured between them |
//! | `closure` | loop closures |
//! | `foreign_nodes` | what other robots have told of the building |
//! | `back_end` | the back end: closures, optimisation and the grid's redrawing, in a thread |
//!
//! After Hess et al., "Real-time loop closure in 2D LIDAR SLAM" (ICRA 2016), with point-to-line
//! matching in the place of their probability grids.

mod back_end;
mod calibration;
mod closure;
mod config;
mod estimate;
mod foreign_nodes;
mod graph;
mod heading_walk;
mod held_heading;
mod joining;
mod keyframe;
mod submap;
mod tracking;
mod wheels_word;
mod witness;

pub use closure::ClosureCounts;
pub use config::SlamConfig;
pub use estimate::{Anchored, GridScan, SlamEstimate, SlamUpdate, Tracking};
pub(crate) use foreign_nodes::{Told, ToldNode};

use crate::haste::Haste;
use crate::slam::calibration::OdometryCalibration;
use back_end::{BackEnd, BackEndJob, BackEndResult};
use closure::{LostSearch, SubmapSighting};
use estimate::locate;
use fht_perception::frame::{LaserScan, SensorFrame};
use fht_perception::grid::OccupancyGrid;
use fht_perception::matching::Prior;
use fht_perception::pose::{Point2, Pose2};
use fht_worker::{BackgroundWorker, Pace};
use foreign_nodes::Hearsay;
use heading_walk::HeadingWalk;
use nalgebra::Matrix3;
use std::sync::Arc;
use submap::Submap;
use witness::Witnesses;

/// Frames between a job of the back end and its result.
const BACK_END_DELAY_FRAMES: u64 = 40;
/// While the robot is lost nothing is mapped, so a job and its result are at most this far apart in
/// robot time, microseconds: a job that is under way and the search after it make twice as much.
const LOST_DELAY_US: u64 = 2_000_000;

/// A keyframe as the front end remembers it.
#[derive(Clone, Copy, Debug)]
struct Keyframe {
    odom_from_base: Pose2,
    /// Where it is in the submap that it was matched to (whose frame is an earlier keyframe).
    anchored: Anchored,
}

/// The submaps that grow: the robot is matched to the first; the second takes its place when that
/// is full.
#[derive(Debug)]
struct Active {
    older: Submap,
    /// The next submap and the pose of its frame in that of the older one.
    newer: Option<(Submap, Pose2)>,
}

impl Active {
    /// Averages a scan, taken at a pose in the older submap, into both.
    fn average(&mut self, submap_from_base: &Pose2, points: &[Point2]) {
        self.older.average(submap_from_base, points);
        if let Some((newer, older_from_newer)) = &mut self.newer {
            newer.average(&(older_from_newer.inverse() * submap_from_base), points);
        }
    }
}

/// The newest estimate.
#[derive(Clone, Debug)]
struct Latest {
    /// Pose in the older submap.
    submap_from_base: Pose2,
    odom_from_base: Pose2,
    /// Pose of the newest keyframe in the older submap.
    submap_from_keyframe: Pose2,
}

/// SLAM in progress. The map frame is where the robot was at the first frame.
pub struct Slam {
    config: SlamConfig,
    calibration: OdometryCalibration,
    heading_walk: HeadingWalk,
    active: Option<(Active, Latest)>,
    keyframes: Vec<Keyframe>,
    /// Poses of the keyframes in the map frame.
    poses: Vec<Pose2>,
    grid: OccupancyGrid,
    /// The newest view, and where it was.
    last_view: Option<Anchored>,
    tracking: Tracking,
    /// Whether the newest scan contradicts the map: until one fits, nothing is mapped.
    is_contradicted: bool,
    witnesses: Witnesses,
    /// How often a lost robot was looked for and fitted nowhere.
    searches_in_vain: usize,
    /// Driven while scans contradicted the map, metres.
    contradicted_m: f64,
    /// Whether the robot was lost, and no scan has been matched since.
    was_lost: bool,
    /// Whether the active submap is one in which a lost robot was found: the wheels tell nothing of
    /// the way there.
    is_found_again: bool,
    /// The submap that was being made when the robot got lost.
    left: Option<Arc<Submap>>,
    /// The newest keyframe whose panorama was looked at.
    last_sighting: Option<usize>,
    /// Where the wheels were when a scan was last put into the submaps.
    averaged_odom_from_base: Pose2,
    frame: u64,
    /// When the result of the back end's job is taken at the latest, robot time in microseconds:
    /// only while the robot is lost.
    awaited_us: Option<u64>,
    /// What the back end has not been given yet.
    next_job: BackEndJob,
    /// What others have told, as the grid shows it.
    hearsay: Hearsay,
    /// How many keyframes stand for the map's frame: one in a run that is to join a map, and none
    /// where the first keyframe is the frame.
    frames: usize,
    back_end: BackgroundWorker<BackEndJob, BackEndResult>,
    counts: ClosureCounts,
}

impl Slam {
    /// Before the first frame.
    ///
    /// # Errors
    /// When the system gives no thread.
    pub fn new(config: SlamConfig, pace: Pace) -> std::io::Result<Self> {
        let mut back_end = BackEnd::new(config.grid.clone(), config.submap.clone(), config.closure.clone());
        Ok(Self {
            calibration: OdometryCalibration::new(config.odometry.clone()),
            heading_walk: HeadingWalk::default(),
            active: None,
            keyframes: Vec::new(),
            poses: Vec::new(),
            grid: OccupancyGrid::new(config.grid.clone()),
            last_view: None,
            tracking: Tracking::Matched,
            is_contradicted: false,
            witnesses: Witnesses::default(),
            searches_in_vain: 0,
            contradicted_m: 0.0,
            was_lost: false,
            is_found_again: false,
            left: None,
            last_sighting: None,
            averaged_odom_from_base: Pose2::identity(),
            frame: 0,
            awaited_us: None,
            next_job: BackEndJob::default(),
            hearsay: Hearsay::default(),
            frames: 0,
            back_end: BackgroundWorker::one_by_one("slam", pace, move |job| back_end.work(job))?,
            counts: ClosureCounts::default(),
            config,
        })
    }

    /// The occupancy grid, in the map frame.
    #[must_use]
    pub fn grid(&self) -> &OccupancyGrid {
        &self.grid
    }

    /// Poses of the keyframes in the map frame, as known by now.
    #[must_use]
    pub fn poses(&self) -> &[Pose2] {
        &self.poses
    }

    /// What loop closure has done, as far as is known by now.
    #[must_use]
    pub fn counts(&self) -> ClosureCounts {
        self.counts
    }

    /// Where something is in the map, as known by now.
    #[must_use]
    pub fn locate(&self, anchored: &Anchored) -> Pose2 {
        locate(&self.poses, anchored)
    }

    /// What is known by now.
    #[must_use]
    pub fn estimate(&self) -> SlamEstimate<'_> {
        SlamEstimate { grid: &self.grid, poses: &self.poses }
    }

    /// Tells what a panorama looked like that was taken at `anchored`: `components` are a unit
    /// vector, and `match_threshold` is the cosine that means "near".
    pub fn observe_appearance(&mut self, anchored: &Anchored, components: Arc<Vec<f32>>, match_threshold: f32) {
        // One of each keyframe: a robot that stands still sees nothing new.
        if self.last_sighting.is_none_or(|last| anchored.keyframe > last) {
            self.last_sighting = Some(anchored.keyframe);
            self.next_job.sightings.push(SubmapSighting { keyframe: anchored.keyframe, components, match_threshold });
        }
    }

    /// Takes in one frame.
    pub fn update(&mut self, frame: &SensorFrame) -> SlamUpdate {
        let outcome = self.take_from_back_end(frame.time_us);
        let is_corrected = outcome.is_some_and(|outcome| self.take_result(outcome, &frame.odom_from_base));
        let update = self.track(frame);
        self.submit_to_back_end(frame.time_us);
        self.frame += 1;
        SlamUpdate { is_corrected, ..update }
    }

    /// Gives the back end what is new, if that is worth a job and the back end has none.
    fn submit_to_back_end(&mut self, now_us: u64) {
        let job = &self.next_job;
        let is_worth_it = !job.keyframes.is_empty() || !job.told.is_empty() || job.lost.is_some();
        if is_worth_it && self.back_end.is_idle() {
            self.back_end.submit(std::mem::take(&mut self.next_job), self.frame + BACK_END_DELAY_FRAMES);
        }
        if self.tracking != Tracking::Lost {
            self.awaited_us = None;
        } else if self.back_end.is_pending() && self.awaited_us.is_none() {
            self.awaited_us = Some(now_us.saturating_add(LOST_DELAY_US));
        }
    }

    /// The result of the back end's job, if it is due at this time of the robot.
    fn take_from_back_end(&mut self, now_us: u64) -> Option<BackEndResult> {
        let is_awaited = self.awaited_us.is_some_and(|until_us| now_us >= until_us);
        let outcome = self.back_end.take_due(if is_awaited { u64::MAX } else { self.frame });
        if outcome.is_some() {
            self.awaited_us = None;
        }
        outcome
    }

    /// After the last frame: the graph is closed and optimised as well as it can be.
    pub fn finish(&mut self) {
        self.finish_while(&Haste::none());
    }

    /// The same with what there is time for: what is under way is taken over in any case.
    pub fn finish_while(&mut self, haste: &Haste) {
        let Some(last_odom) = self.active.as_ref().map(|(_, latest)| latest.odom_from_base) else { return };
        if let Some(outcome) = self.back_end.finish() {
            self.take_result(outcome, &last_odom);
        }
        let last = BackEndJob { last: Some(haste.clone()), ..std::mem::take(&mut self.next_job) };
        self.back_end.submit(last, self.frame);
        if let Some(outcome) = self.back_end.finish() {
            self.take_result(outcome, &last_odom);
        }
    }

    /// Takes over what the back end found; true when keyframes have moved.
    fn take_result(&mut self, outcome: BackEndResult, odom_from_base: &Pose2) -> bool {
        self.counts = outcome.counts;
        let is_corrected = outcome.poses.is_some();
        if let Some(poses) = outcome.poses {
            let known = poses.len();
            self.poses[..known].copy_from_slice(&poses);
            for index in known..self.poses.len() {
                self.poses[index] = locate(&self.poses, &self.keyframes[index].anchored);
            }
        }
        if let Some(grid) = outcome.grid {
            self.grid = grid;
            for (_, node) in &self.next_job.told {
                node.iter().for_each(|node| node.draw(&mut self.grid));
            }
            for view in &self.next_job.views {
                self.grid.integrate(&locate(&self.poses, &view.anchored), &view.scan);
            }
        }
        if self.tracking == Tracking::Lost {
            match outcome.search {
                Some(LostSearch::Found(found)) => self.resume(&found, odom_from_base),
                Some(LostSearch::Nowhere) => self.searches_in_vain += 1,
                Some(LostSearch::Unclear) | None => {}
            }
        }
        is_corrected
    }

    fn usable_points(&self, scan: &LaserScan) -> Vec<Point2> {
        let reach = self.config.grid.max_range_m;
        let sensor = Point2::from(scan.base_from_sensor.translation.vector);
        scan.points_in_base().into_iter().filter(|point| (point - sensor).norm() <= reach).collect()
    }

    fn track(&mut self, frame: &SensorFrame) -> SlamUpdate {
        let points = self.usable_points(&frame.scan);
        let Some((mut active, mut latest)) = self.active.take() else {
            return self.begin(frame, points);
        };
        let raw_motion = latest.odom_from_base.inverse() * frame.odom_from_base;
        let motion = self.calibration.correct(&raw_motion);
        let predicted = latest.submap_from_base * motion;
        let prior_information = self.calibration.information(&motion, predicted.rotation.angle());
        let prior = Prior { reference_from_moving: predicted, information: prior_information };
        let matched = self.match_to(&active.older, &points, &prior);
        let matched = matched.filter(|found| self.is_heard(found, &prior, &latest, &frame.scan));
        // Whoever doubts where it is must be convinced.
        let is_in_doubt = self.is_contradicted || self.was_lost;
        let matched = matched.filter(|found| !is_in_doubt || self.is_convincing(&active.older, &points, found));
        let matched = self.hold_heading(&active.older, &points, matched, &prior, &motion);
        let fitting = matched.as_ref().filter(|found| found.score >= self.config.good_score);
        let by_scan = fitting.map(|found| latest.submap_from_base.inverse() * found.reference_from_moving);
        self.heading_walk.learn(&motion, by_scan.as_ref());
        latest.submap_from_base = matched.as_ref().map_or(predicted, |found| found.reference_from_moving);
        latest.odom_from_base = frame.odom_from_base;
        let driven_m = motion.translation.vector.norm();
        self.judge_tracking(
            matched.as_ref().map(|found| found.score),
            driven_m,
            &active.older,
            &points,
            &latest,
            &frame.scan,
        );

        let motion_since = latest.submap_from_keyframe.inverse() * latest.submap_from_base;
        let is_due = is_beyond(&motion_since, self.config.keyframe_distance_m, self.config.keyframe_turn_rad);
        let is_doubtful = self.is_found_again || self.tracking == Tracking::Lost || self.is_contradicted;
        let is_known = matched.is_some() || self.has_given_up() || !is_doubtful;
        if is_due && is_known {
            let (edge, learnt) = self.scan_edge(&active, &latest, matched.as_ref(), &prior_information);
            let is_driven = !self.is_found_again;
            if let Some(information) = learnt.filter(|_| is_driven) {
                let between = latest.submap_from_keyframe.inverse() * latest.submap_from_base;
                let raw = self.keyframes[self.keyframes.len() - 1].odom_from_base.inverse() * frame.odom_from_base;
                let yaw = latest.submap_from_base.rotation.angle();
                self.calibration.learn(&raw, &between, &information, yaw);
            }
            let wheels = is_driven.then(|| self.wheels_link(&frame.odom_from_base, learnt.is_some()));
            let links = edge.into_iter().chain(wheels).collect();
            self.add_keyframe(frame, points, &mut active, &mut latest, links);
            self.averaged_odom_from_base = frame.odom_from_base;
        } else if self.keyframes.len() == self.frames + 1 && raw_motion == Pose2::identity() {
            // Standing at the start: the same place again. The map's frame is as true as what is
            // known of this pose.
            latest.submap_from_base = Pose2::identity();
            active.older.average(&latest.submap_from_base, &points);
        } else if matched.as_ref().is_some_and(|found| self.is_worth_averaging(frame, &motion, found.score)) {
            self.averaged_odom_from_base = frame.odom_from_base;
            active.average(&latest.submap_from_base, &points);
        }
        let newest = self.keyframes.len() - 1;
        let keyframe_from_base = latest.submap_from_keyframe.inverse() * latest.submap_from_base;
        let anchored = Anchored { keyframe: newest, keyframe_from_base };
        self.active = Some((active, latest));
        self.view(&anchored, &frame.scan);
        SlamUpdate {
            map_from_base: self.locate(&anchored),
            anchored,
            covariance: matched.as_ref().map_or_else(
                || prior_information.try_inverse().unwrap_or_else(Matrix3::identity),
                |found| found.covariance,
            ),
            score: matched.map_or(0.0, |found| found.score),
            tracking: self.tracking,
            is_corrected: false,
        }
    }

    /// Whether a scan between keyframes shows something new, was not taken in a turn and fits well:
    /// what fits badly may be in the wrong place, and would fit there ever after.
    fn is_worth_averaging(&self, frame: &SensorFrame, motion: &Pose2, score: f64) -> bool {
        let since = frame.odom_from_base.translation.vector - self.averaged_odom_from_base.translation.vector;
        !self.is_found_again
            && score >= self.config.good_score
            && since.norm() >= self.config.average_distance_m
            && motion.rotation.angle().abs() <= self.config.average_turn_rad
    }

    /// Draws a scan into the grid, if the robot has moved since the last one.
    fn view(&mut self, anchored: &Anchored, scan: &LaserScan) {
        let map_from_base = self.locate(anchored);
        let moved = self.last_view.map(|last| self.locate(&last).inverse() * map_from_base);
        let is_due = |moved| is_beyond(&moved, self.config.view_distance_m, self.config.view_turn_rad);
        if self.tracking != Tracking::Lost && !self.is_contradicted && moved.is_none_or(is_due) {
            self.grid.integrate(&map_from_base, scan);
            self.next_job.views.push(GridScan { anchored: *anchored, scan: Arc::new(scan.clone()) });
            self.last_view = Some(*anchored);
        }
    }
}

/// Whether a motion is at least as long, or turns at least as far.
fn is_beyond(motion: &Pose2, distance_m: f64, turn_rad: f64) -> bool {
    motion.translation.vector.norm() >= distance_m || motion.rotation.angle().abs() >= turn_rad
}
