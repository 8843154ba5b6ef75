//! The goals that a robot is sent: one under way, and one that is next. A state machine: goals,
//! cancellations and what the robot's frames led to come in, tasks for the pilot and news for the
//! senders go out. No network and no clock.
//!
//! ```
//! use client_robot::goals::GoalQueue;
//! use client_robot::pilot::{DriveGoal, Task};
//! use fht_perception::pose::Point2;
//! use fht_proto::api::goal::{GoalOrder, GoalState};
//!
//! let mut goals = GoalQueue::new("amr-7");
//! goals.set_localized(true);
//! let order = GoalOrder { id: "7".to_owned(), to: "dock".parse()?, yaw: None, to_nearest: false };
//! let dock = DriveGoal::from(Point2::new(4.5, 0.0));
//! assert_eq!(goals.offer(order, |_| Ok(dock))?.state, GoalState::Driving);
//! assert_eq!(goals.next_task(), Some(Task::GoTo(dock)));
//! goals.cancel(Some("7"))?;
//! assert_eq!(goals.next_task(), Some(Task::Stay));
//! # Ok::<(), fht_proto::api::reply::ErrorReply>(())
//! ```

use crate::pilot::{DriveGoal, Failure, PilotStep, Task, TaskOutcome};
use fht_proto::FixedPose;
use fht_proto::api::goal::{GoalOrder, GoalState, GoalStatus};
use fht_proto::api::reply::{ErrorCode, ErrorReply};
use std::collections::VecDeque;

/// Goals that have ended are remembered, so that their senders can ask: this many.
const REMEMBERED: usize = 32;
/// Of these, so many that were refused: many such take no other goal's place.
const REMEMBERED_REFUSED: usize = 8;

/// A goal that has not ended.
#[derive(Clone, Debug)]
struct Held {
    order: GoalOrder,
    goal: DriveGoal,
    /// Whether the pilot was told.
    is_begun: bool,
    /// The path there; none before there was one.
    path: Option<GoalPath>,
}

/// The path to a goal, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GoalPath {
    /// What is left of it.
    pub left_m: f64,
    /// How far from the goal it ends.
    pub goal_moved_m: f64,
}

/// A goal that has ended, or was refused.
#[derive(Clone, Debug)]
struct Ended {
    order: GoalOrder,
    status: GoalStatus,
    /// Whether it was never taken: sent again, it is a new one.
    is_refused: bool,
}

/// The goals of one robot.
#[derive(Clone, Debug)]
pub struct GoalQueue {
    robot: String,
    is_localized: bool,
    current: Option<Held>,
    waiting: Option<Held>,
    /// Newest last.
    ended: VecDeque<Ended>,
    /// The pilot carries out a task that has ended.
    is_to_stay: bool,
    news: Vec<GoalStatus>,
}

impl GoalQueue {
    /// Of a robot of this name that was sent nowhere and does not know where it is.
    #[must_use]
    pub fn new(robot: &str) -> Self {
        Self {
            robot: robot.to_owned(),
            is_localized: false,
            current: None,
            waiting: None,
            ended: VecDeque::new(),
            is_to_stay: false,
            news: Vec::new(),
        }
    }

    /// Whether the robot knows where it is.
    pub fn set_localized(&mut self, is_localized: bool) {
        self.is_localized = is_localized;
    }

    /// Whether the robot is under way to a goal.
    #[must_use]
    pub fn is_driving(&self) -> bool {
        self.current.is_some()
    }

    /// Takes a goal, which becomes the one under way, or else the next one in place of any that
    /// was; `locate` says where it is. The same goal again is the same goal.
    ///
    /// # Errors
    /// `NOT_LOCALIZED`; `BAD_REQUEST` for an id that another goal has; what `locate` says.
    pub fn offer(
        &mut self,
        order: GoalOrder,
        locate: impl FnOnce(&GoalOrder) -> Result<DriveGoal, ErrorReply>,
    ) -> Result<GoalStatus, ErrorReply> {
        let id = order.id.clone();
        if let Some(known) = self.order(&id) {
            let other = || {
                ErrorReply::new(ErrorCode::BadRequest, &format!("goal {id} is another one: give it an id of its own"))
            };
            return if *known == order { self.status(Some(&id)) } else { Err(other()) };
        }
        if !self.is_localized && self.current.is_none() {
            return Err(ErrorReply::new(ErrorCode::NotLocalized, "the robot does not know where it is yet; ask again"));
        }
        let goal = locate(&order)?;
        self.ended.retain(|ended| ended.order.id != id);
        let held = Held { order, goal, is_begun: false, path: None };
        if self.current.is_none() {
            self.current = Some(held);
        } else {
            if let Some(replaced) = self.waiting.replace(held) {
                self.end(replaced, GoalState::Cancelled, Some((None, format!("goal {id} was sent in its place"))));
            }
            self.tell(&id);
        }
        self.status(Some(&id))
    }

    /// Keeps that a goal was refused ([`offer`](Self::offer)), and tells it, for a sender who gets
    /// no reply. Sent again, the goal is a new one; what is known of another goal of the id stays.
    pub fn refuse(&mut self, order: GoalOrder, refusal: ErrorReply) {
        if self.order(&order.id) == Some(&order) {
            return; // it was taken before
        }
        let status = GoalStatus {
            state: GoalState::Failed,
            id: Some(order.id.clone()),
            code: Some(refusal.code),
            reason: Some(refusal.message),
            ..GoalStatus::idle(&self.robot)
        };
        self.news.push(status.clone());
        if self.order(&order.id).is_none() {
            self.ended.retain(|ended| ended.order.id != order.id);
            self.remember(Ended { order, status, is_refused: true });
        }
    }

    /// Drops a goal: the robot stands, or goes on to the next one. Without an id it drops all. One
    /// that has ended stays what it is.
    ///
    /// # Errors
    /// `UNKNOWN_GOAL`.
    pub fn cancel(&mut self, id: Option<&str>) -> Result<GoalStatus, ErrorReply> {
        let is_meant = |held: &mut Held| id.is_none_or(|id| held.order.id == id);
        let reason = || Some((None, "it was cancelled".to_owned()));
        let waiting = self.waiting.take_if(is_meant);
        let current = self.current.take_if(is_meant);
        if id.is_none() && waiting.is_none() && current.is_none() {
            return Err(ErrorReply::new(ErrorCode::UnknownGoal, "the robot has no goal"));
        }
        self.is_to_stay |= current.as_ref().is_some_and(|held| held.is_begun);
        let next = waiting.as_ref().filter(|_| current.is_some()).map(|held| held.order.id.clone());
        for held in [waiting, current].into_iter().flatten() {
            self.end(held, GoalState::Cancelled, reason());
        }
        let mut status = self.status(id)?;
        // The reply is of the goal that was under way, and tells of the other one.
        if let (Some(next), Some(reason)) = (next, &mut status.reason) {
            *reason = format!("{reason}, and so was goal {next}, which was next");
        }
        Ok(status)
    }

    /// What has become of a goal; without an id of the one under way, or else of the last one.
    ///
    /// # Errors
    /// `UNKNOWN_GOAL`.
    pub fn status(&self, id: Option<&str>) -> Result<GoalStatus, ErrorReply> {
        let is_meant = |order: &GoalOrder| id.is_none_or(|id| order.id == id);
        if let Some(held) = self.current.as_ref().filter(|held| is_meant(&held.order)) {
            return Ok(self.status_of(held, GoalState::Driving));
        }
        if let Some(held) = self.waiting.as_ref().filter(|held| is_meant(&held.order)) {
            return Ok(self.status_of(held, GoalState::Waiting));
        }
        if let Some(ended) = self.ended.iter().rev().find(|ended| is_meant(&ended.order)) {
            let waiting = self.waiting.as_ref().map(|held| held.order.id.clone());
            return Ok(GoalStatus { waiting, ..ended.status.clone() });
        }
        match id {
            None => Ok(GoalStatus::idle(&self.robot)),
            Some(id) => Err(ErrorReply::new(ErrorCode::UnknownGoal, &format!("the robot knows of no goal {id}"))),
        }
    }

    /// Whether it is clear what becomes of a goal for now: it waits, it has ended, or there is a
    /// path to it.
    #[must_use]
    pub fn is_decided(&self, id: &str) -> bool {
        self.current.as_ref().is_none_or(|held| held.order.id != id || held.path.is_some())
    }

    /// What the pilot is to do from here on, if that is something else than before.
    pub fn next_task(&mut self) -> Option<Task> {
        if self.current.is_none() {
            self.current = self.waiting.take();
        }
        match &mut self.current {
            Some(held) if !held.is_begun => {
                held.is_begun = true;
                self.is_to_stay = false;
                Some(Task::GoTo(held.goal))
            }
            Some(_) => None,
            None => std::mem::take(&mut self.is_to_stay).then_some(Task::Stay),
        }
    }

    /// Takes in what a frame led to, and the path that the robot is on, if it is on one.
    pub fn observe(&mut self, step: &PilotStep, path: Option<GoalPath>) {
        self.is_localized = step.localization.map_from_odom.is_some();
        if let (Some(held), Some(path)) = (&mut self.current, path)
            && held.path.replace(path).is_none()
        {
            let id = held.order.id.clone();
            self.tell(&id);
        }
        let Some(outcome) = &step.outcome else { return };
        self.is_to_stay = true;
        let Some(held) = self.current.take_if(|held| held.is_begun) else { return };
        match outcome {
            // The place is known, and the goal may begin.
            TaskOutcome::Localized => self.current = Some(Held { is_begun: false, ..held }),
            TaskOutcome::Arrived => self.end(held, GoalState::Arrived, None),
            TaskOutcome::Failed(failure) => {
                let why = (Some(code_of(failure)), failure.to_string());
                // Without a path its sender is told that it is refused.
                let is_refused = held.path.is_none();
                self.end_as(held, GoalState::Failed, Some(why), is_refused);
            }
        }
    }

    /// Another map has come to the name: no goal is where it was, and the robot stands.
    pub fn map_replaced(&mut self) {
        self.is_localized = false;
        self.is_to_stay |= self.current.as_ref().is_some_and(|held| held.is_begun);
        let why = Failure::MapReplaced;
        for held in [self.waiting.take(), self.current.take()].into_iter().flatten() {
            self.end(held, GoalState::Failed, Some((Some(code_of(&why)), why.to_string())));
        }
    }

    /// The robot ends: what has not ended is cancelled.
    pub fn close(&mut self, reason: &str) {
        for held in [self.waiting.take(), self.current.take()].into_iter().flatten() {
            self.end(held, GoalState::Cancelled, Some((None, reason.to_owned())));
        }
    }

    /// What has become of which goal since the last time, oldest first.
    pub fn take_news(&mut self) -> Vec<GoalStatus> {
        std::mem::take(&mut self.news)
    }

    /// The order of a goal that was taken.
    fn order(&self, id: &str) -> Option<&GoalOrder> {
        let held = self.current.iter().chain(&self.waiting).map(|held| &held.order);
        let ended = self.ended.iter().filter(|ended| !ended.is_refused).map(|ended| &ended.order);
        held.chain(ended).find(|order| order.id == id)
    }

    fn tell(&mut self, id: &str) {
        let status = self.status(Some(id)).ok();
        self.news.extend(status);
    }

    fn end(&mut self, held: Held, state: GoalState, why: Option<(Option<ErrorCode>, String)>) {
        self.end_as(held, state, why, false);
    }

    fn end_as(&mut self, held: Held, state: GoalState, why: Option<(Option<ErrorCode>, String)>, is_refused: bool) {
        let (code, reason) = why.map_or((None, None), |(code, reason)| (code, Some(reason)));
        let status = GoalStatus { code, reason, ..self.status_of(&held, state) };
        self.news.push(status.clone());
        self.remember(Ended { order: held.order, status, is_refused });
    }

    fn remember(&mut self, ended: Ended) {
        let mut refused = self.ended.iter().enumerate().filter(|(_, ended)| ended.is_refused).map(|(at, _)| at);
        let oldest = refused.next();
        let are_many = 1 + refused.count() >= REMEMBERED_REFUSED;
        if let Some(oldest) = oldest.filter(|_| ended.is_refused && are_many) {
            self.ended.remove(oldest);
        }
        self.ended.push_back(ended);
        if self.ended.len() > REMEMBERED {
            self.ended.pop_front();
        }
    }

    fn status_of(&self, held: &Held, state: GoalState) -> GoalStatus {
        let waiting = self.waiting.as_ref().map(|next| next.order.id.clone());
        // To the millimetre and to 1e-4 rad, like everything on the wire.
        let (x, y, yaw) = (held.goal.position.x, held.goal.position.y, held.goal.yaw);
        let at = FixedPose::from_metres(x, y, yaw.unwrap_or_default());
        let to_millimetres = |metres: f64| (metres * 1e3).round() / 1e3;
        let moved_m = held.path.map(|path| to_millimetres(path.goal_moved_m));
        GoalStatus {
            state,
            id: Some(held.order.id.clone()),
            goal: Some([at.position.x(), at.position.y()]),
            goal_yaw: yaw.map(|_| at.yaw()),
            goal_moved_m: moved_m.filter(|moved_m| *moved_m > 0.0),
            to_go_m: held.path.filter(|_| state == GoalState::Driving).map(|path| to_millimetres(path.left_m)),
            waiting: waiting.filter(|next| *next != held.order.id),
            ..GoalStatus::idle(&self.robot)
        }
    }
}

/// Why a goal failed, for programs.
fn code_of(failure: &Failure) -> ErrorCode {
    match failure {
        Failure::NotLocalized { .. } => ErrorCode::NotLocalized,
        Failure::NoPath(refusal) => refusal.code,
        Failure::Timeout { .. } => ErrorCode::Timeout,
        Failure::MapReplaced => ErrorCode::Conflict,
        Failure::GoalBlocked { .. }
        | Failure::NoProgress { .. }
        | Failure::WaysBlocked { .. }
        | Failure::NotTurned { .. } => ErrorCode::Blocked,
    }
}

#[cfg(test)]
mod tests;
