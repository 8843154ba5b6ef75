//! The goals of an action server: which are known, how each of them is, and who waits for its
//! result. No I/O.

use fht_ros_messages::msg::{
    CancelGoalRequest, CancelGoalResponse, GoalInfo, GoalStatusArray, GoalStatusMsg, GoalUuid, Time,
};
use std::collections::BTreeMap;

/// Goals that have ended and whose results are still told.
const ENDED: usize = 64;

/// All goals that are known. `W` is who waits for a result.
pub(crate) struct GoalBook<W> {
    goals: BTreeMap<GoalUuid, Entry<W>>,
    accepted: u64,
}

struct Entry<W> {
    /// The how manieth accepted goal it is.
    number: u64,
    status: GoalStatusMsg,
    /// The answer to who asks for the result, once there is one.
    result: Option<Vec<u8>>,
    waiting: Vec<W>,
}

/// What who asks for a result is told.
pub(crate) enum ResultAnswer<W> {
    /// Nothing yet: who asks is kept until the goal has ended.
    Later,
    /// The result.
    Now(W, Vec<u8>),
    /// There is no such goal.
    Unknown(W),
}

impl<W> Default for GoalBook<W> {
    fn default() -> Self {
        Self { goals: BTreeMap::new(), accepted: 0 }
    }
}

fn has_ended(status: i8) -> bool {
    status >= GoalStatusMsg::SUCCEEDED
}

impl<W> GoalBook<W> {
    /// Takes a goal; `false` if it is known already.
    pub(crate) fn accept(&mut self, goal_id: GoalUuid, stamp: Time) -> bool {
        if self.goals.contains_key(&goal_id) {
            return false;
        }
        self.accepted += 1;
        let status = GoalStatusMsg { goal_info: GoalInfo { goal_id, stamp }, status: GoalStatusMsg::EXECUTING };
        self.goals.insert(goal_id, Entry { number: self.accepted, status, result: None, waiting: Vec::new() });
        let mut ended: Vec<(u64, GoalUuid)> = self
            .goals
            .iter()
            .filter(|(_, entry)| has_ended(entry.status.status))
            .map(|(id, entry)| (entry.number, *id))
            .collect();
        ended.sort_unstable();
        for (_, id) in ended.iter().take(ended.len().saturating_sub(ENDED)) {
            self.goals.remove(id);
        }
        true
    }

    /// Whether a goal is known.
    pub(crate) fn knows(&self, goal_id: GoalUuid) -> bool {
        self.goals.contains_key(&goal_id)
    }

    /// How a goal is.
    pub(crate) fn status(&self, goal_id: GoalUuid) -> i8 {
        self.goals.get(&goal_id).map_or(GoalStatusMsg::UNKNOWN, |entry| entry.status.status)
    }

    /// Asks goals to end early, as `action_msgs/srv/CancelGoal` has it.
    pub(crate) fn cancel(&mut self, request: &CancelGoalRequest) -> CancelGoalResponse {
        let GoalInfo { goal_id, stamp } = request.goal_info;
        let is_all = goal_id == GoalUuid::default();
        if let Some(entry) = self.goals.get(&goal_id)
            && has_ended(entry.status.status)
        {
            return CancelGoalResponse { return_code: CancelGoalResponse::TERMINATED, goals_canceling: Vec::new() };
        }
        if !is_all && !self.goals.contains_key(&goal_id) {
            return CancelGoalResponse { return_code: CancelGoalResponse::UNKNOWN_GOAL, goals_canceling: Vec::new() };
        }
        let before = (stamp.sec, stamp.nanosec);
        let mut goals_canceling = Vec::new();
        for (id, entry) in &mut self.goals {
            let accepted = entry.status.goal_info.stamp;
            let is_meant =
                *id == goal_id || (is_all && (before == (0, 0) || (accepted.sec, accepted.nanosec) <= before));
            if is_meant && !has_ended(entry.status.status) {
                entry.status.status = GoalStatusMsg::CANCELING;
                goals_canceling.push(entry.status.goal_info);
            }
        }
        CancelGoalResponse { return_code: 0, goals_canceling }
    }

    /// Ends a goal; returns who waits for its result.
    pub(crate) fn finish(&mut self, goal_id: GoalUuid, status: i8, result: Vec<u8>) -> Vec<W> {
        let Some(entry) = self.goals.get_mut(&goal_id) else { return Vec::new() };
        entry.status.status = status;
        entry.result = Some(result);
        std::mem::take(&mut entry.waiting)
    }

    /// Somebody asks for a goal's result.
    pub(crate) fn ask(&mut self, goal_id: GoalUuid, who: W) -> ResultAnswer<W> {
        match self.goals.get_mut(&goal_id) {
            None => ResultAnswer::Unknown(who),
            Some(Entry { result: Some(result), .. }) => ResultAnswer::Now(who, result.clone()),
            Some(entry) => {
                entry.waiting.push(who);
                ResultAnswer::Later
            }
        }
    }

    /// How all goals are, in the order in which they were accepted.
    pub(crate) fn statuses(&self) -> GoalStatusArray {
        let mut entries: Vec<&Entry<W>> = self.goals.values().collect();
        entries.sort_by_key(|entry| entry.number);
        GoalStatusArray { status_list: entries.iter().map(|entry| entry.status).collect() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn id(number: u8) -> GoalUuid {
        GoalUuid { uuid: [number; 16] }
    }

    fn at(sec: i32) -> Time {
        Time { sec, nanosec: 0 }
    }

    fn request(number: u8, sec: i32) -> CancelGoalRequest {
        CancelGoalRequest { goal_info: GoalInfo { goal_id: id(number), stamp: at(sec) } }
    }

    #[test]
    fn results_are_told_at_the_end_and_after_it() {
        let mut book = GoalBook::default();
        assert!(book.accept(id(1), at(1)) && !book.accept(id(1), at(2)));
        assert!(matches!(book.ask(id(1), "first"), ResultAnswer::Later));
        assert!(matches!(book.ask(id(2), "lost"), ResultAnswer::Unknown("lost")));
        assert_eq!(book.finish(id(1), GoalStatusMsg::SUCCEEDED, vec![7]), ["first"]);
        assert!(matches!(book.ask(id(1), "late"), ResultAnswer::Now("late", result) if result == [7]));
        assert_eq!(book.statuses().status_list[0].status, GoalStatusMsg::SUCCEEDED);
    }

    #[test]
    fn one_goal_or_the_earlier_ones_or_all_are_cancelled() {
        let mut book = GoalBook::<()>::default();
        for number in 1..=4 {
            book.accept(id(number), at(i32::from(number)));
        }
        book.finish(id(4), GoalStatusMsg::ABORTED, Vec::new());
        assert_eq!(book.cancel(&request(9, 0)).return_code, CancelGoalResponse::UNKNOWN_GOAL);
        assert_eq!(book.cancel(&request(4, 0)).return_code, CancelGoalResponse::TERMINATED);
        assert_eq!(book.cancel(&request(2, 0)).goals_canceling.len(), 1);
        let states =
            |book: &GoalBook<()>| book.statuses().status_list.iter().map(|goal| goal.status).collect::<Vec<_>>();
        assert_eq!(states(&book), [2, 3, 2, 6]);
        assert_eq!(book.cancel(&request(0, 1)).goals_canceling.len(), 1);
        assert_eq!(states(&book), [3, 3, 2, 6]);
        assert_eq!(book.cancel(&request(0, 0)).goals_canceling.len(), 3);
        assert_eq!(states(&book), [3, 3, 3, 6]);
    }

    #[test]
    fn old_goals_that_have_ended_are_forgotten() {
        let mut book = GoalBook::<()>::default();
        for number in 1..=200 {
            book.accept(id(number), at(0));
            book.finish(id(number), GoalStatusMsg::SUCCEEDED, Vec::new());
        }
        assert_eq!(book.statuses().status_list.len(), ENDED + 1);
        assert!(book.knows(id(200)) && !book.knows(id(1)));
    }
}
