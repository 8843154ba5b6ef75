//! Keyframes: when the robot has moved on, its scan joins the submaps that grow, and the back end
//! is given what links it to earlier ones.

use super::closure::{NewKeyframe, with_floor};
use super::estimate::{Anchored, SlamUpdate, Tracking, locate};
use super::graph::{Link, unplaced_link};
use super::submap::Submap;
use super::witness::Witnesses;
use super::{Active, Keyframe, Latest, Slam};
use fht_perception::frame::SensorFrame;
use fht_perception::matching::ScanMatch;
use fht_perception::pose::{Point2, Pose2};
use fht_perception::pose_graph::PoseConstraint;
use nalgebra::Matrix3;
use std::sync::Arc;

impl Slam {
    /// The link of a new keyframe to the submap that it was matched to, and what the scan alone
    /// knows of it.
    pub(super) fn scan_edge(
        &self,
        active: &Active,
        latest: &Latest,
        matched: Option<&ScanMatch>,
        prior_information: &Matrix3<f64>,
    ) -> (Option<Link>, Option<Matrix3<f64>>) {
        let Some(found) = matched else { return (None, None) };
        // The wheels have an edge of their own.
        let information = found.covariance.try_inverse().unwrap_or_else(Matrix3::zeros) - prior_information;
        let covariance = (information + Matrix3::from_diagonal_element(1e-4)).try_inverse();
        let closure = &self.config.closure;
        let floored = covariance.and_then(|c| with_floor(&c, closure.floor_m, closure.floor_rad));
        let edge = |information| PoseConstraint {
            from: active.older.first(),
            to: self.keyframes.len(),
            measured: latest.submap_from_base,
            information,
            is_doubtful: false,
        };
        (floored.map(edge).map(Link::ordinary), Some(information))
    }

    /// The link of a new keyframe to the one before it, by the wheels.
    pub(super) fn wheels_link(&self, odom_from_base: &Pose2, has_scan: bool) -> Link {
        let newest = self.keyframes.len() - 1;
        let raw = self.keyframes[newest].odom_from_base.inverse() * odom_from_base;
        let measured = self.calibration.correct(&raw);
        let (trust, doubt) = if has_scan {
            (self.config.odometry_trust, 1.0)
        } else if self.is_nowhere() {
            // Most likely the wheels are right; ten times their deviation, if not.
            (1e-2, 10.0)
        } else if self.has_given_up() {
            // Nobody knows what happened on the way.
            (1e-4, f64::INFINITY)
        } else {
            (1.0, 10.0)
        };
        let information = self.calibration.information(&measured, measured.rotation.angle()) * trust;
        let edge = PoseConstraint { from: newest, to: newest + 1, measured, information, is_doubtful: false };
        // Finite, so that there is a way: longer than any window grows.
        let way_m = (measured.translation.vector.norm() * doubt).min(1e3);
        Link { edge, way_m }
    }

    pub(super) fn begin(&mut self, frame: &SensorFrame, points: Vec<Point2>) -> SlamUpdate {
        let origin = Pose2::identity();
        let first = self.keyframes.len();
        let older = Submap::begin(first, &self.config.submap, &frame.scan, &points);
        let anchored = Anchored { keyframe: first, keyframe_from_base: origin };
        self.averaged_odom_from_base = frame.odom_from_base;
        self.keyframes.push(Keyframe { odom_from_base: frame.odom_from_base, anchored });
        self.poses.push(origin);
        let links = if first == 0 { Vec::new() } else { vec![unplaced_link(first)] };
        self.next_job.keyframes.push(NewKeyframe { points: Arc::new(points), links, finished: Vec::new() });
        let odom_from_base = frame.odom_from_base;
        let latest = Latest { submap_from_base: origin, odom_from_base, submap_from_keyframe: origin };
        self.active = Some((Active { older, newer: None }, latest));
        self.view(&anchored, &frame.scan);
        SlamUpdate {
            map_from_base: origin,
            anchored,
            covariance: Matrix3::zeros(),
            score: 1.0,
            tracking: Tracking::Matched,
            is_corrected: false,
        }
    }

    pub(super) fn add_keyframe(
        &mut self,
        frame: &SensorFrame,
        points: Vec<Point2>,
        active: &mut Active,
        latest: &mut Latest,
        links: Vec<Link>,
    ) {
        let index = self.keyframes.len();
        let here = latest.submap_from_base;
        let anchored = Anchored { keyframe: active.older.first(), keyframe_from_base: here };
        self.keyframes.push(Keyframe { odom_from_base: frame.odom_from_base, anchored });
        self.poses.push(locate(&self.poses, &anchored));
        let mut finished: Vec<Arc<Submap>> = self.left.take().into_iter().collect();
        latest.submap_from_keyframe = here;
        if self.is_found_again || self.has_given_up() {
            // A submap of its own: the keyframes of one are consecutive.
            let next = Submap::begin(index, &self.config.submap, &frame.scan, &points);
            let before = std::mem::replace(&mut active.older, next);
            if !self.is_found_again {
                finished.push(Arc::new(before));
            }
            active.newer = None;
            latest.submap_from_base = Pose2::identity();
            latest.submap_from_keyframe = Pose2::identity();
            (self.is_found_again, self.was_lost, self.contradicted_m) = (false, false, 0.0);
            // Nothing that was seen before speaks for or against where the robot is now.
            (self.searches_in_vain, self.witnesses) = (0, Witnesses::default());
        } else {
            active.older.insert(&here, &frame.scan, &points);
            if let Some((newer, older_from_newer)) = &mut active.newer {
                newer.insert(&(older_from_newer.inverse() * here), &frame.scan, &points);
            } else if active.older.members().len() >= self.config.submap.keyframes {
                active.newer = Some((Submap::begin(index, &self.config.submap, &frame.scan, &points), here));
            }
            if active.older.is_full()
                && let Some((newer, older_from_newer)) = active.newer.take()
            {
                latest.submap_from_base = older_from_newer.inverse() * here;
                latest.submap_from_keyframe = latest.submap_from_base;
                let next = Submap::begin(index, &self.config.submap, &frame.scan, &points);
                finished.push(Arc::new(std::mem::replace(&mut active.older, newer)));
                active.newer = Some((next, latest.submap_from_base));
            }
        }
        self.next_job.keyframes.push(NewKeyframe { points: Arc::new(points), links, finished });
    }
}
