//! What clock stamps are of: those that lag, jump, or come from another clock are told apart. No
//! I/O and no clock: times are given.
//!
//! The time by which stamps are judged is that of `/clock` if the robot's time is simulated, else
//! this machine's.

use fht_ros_messages::msg::Time;

/// Stamps that differ by more than this from the time are of another clock, seconds: messages do
/// not take that long.
const OTHER_CLOCK_S: f64 = 10.0;
/// Stamps may be so much ahead: clocks are told ten times a second, and are set by chrony, seconds.
const AHEAD_S: f64 = 1.0;
/// Messages that come so much later than they did lag, seconds.
const LAG_S: f64 = 1.0;
/// Stamps that go on by so much more than the time does have jumped, seconds.
const JUMP_S: f64 = 1.0;
/// A clock that goes back by more than this begins anew, seconds: messages that overtake each other
/// are nearer.
const RESET_S: f64 = 1.0;
/// So long after a pause of the clock messages may come later than they did, seconds: those of the
/// pause come all at once.
const CATCH_UP_S: f64 = 10.0;
/// Clocks of simulations and bags without a date begin at zero: times before 2001 are theirs,
/// nanoseconds since the epoch.
const FIRST_REAL_NS: u64 = 1_000_000_000_000_000_000;

/// What is odd about a stamp.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum StampDoubt {
    /// Its messages come later than they did.
    Lags { by_s: f64 },
    /// It has gone on by more than the time.
    JumpedAhead { by_s: f64 },
    /// It is of another clock: so much ahead of the time, or behind it (negative).
    OtherClock { ahead_s: f64 },
    /// It is of a simulated clock, and the time is not.
    Simulated,
}

/// The time by which stamps are judged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Reference {
    /// That of a topic: `use_sim_time`.
    Clock(u64),
    /// This machine's, nanoseconds since the epoch.
    Machine(u64),
}

/// The stamps of one topic.
#[derive(Clone, Debug, Default)]
pub(crate) struct StampWatch {
    /// The last stamp and the time then, nanoseconds.
    last: Option<(u64, u64)>,
    /// The least that a stamp was ever behind the time: what the clocks differ by, nanoseconds.
    least_behind_ns: Option<i128>,
}

impl StampWatch {
    /// What is odd about the next stamp, nanoseconds.
    pub(crate) fn judge(&mut self, stamp_ns: u64, reference: Reference) -> Option<StampDoubt> {
        let (Reference::Clock(now_ns) | Reference::Machine(now_ns)) = reference;
        let behind_ns = i128::from(now_ns) - i128::from(stamp_ns);
        let last = self.last.replace((stamp_ns, now_ns));
        let seconds = |ns: i128| ns as f64 * 1e-9;
        if matches!(reference, Reference::Machine(_)) && stamp_ns < FIRST_REAL_NS {
            return Some(StampDoubt::Simulated);
        }
        let least_ns = self.least_behind_ns.map_or(behind_ns, |least| least.min(behind_ns));
        let before_ns = self.least_behind_ns.replace(least_ns);
        let behind_s = seconds(behind_ns);
        if seconds(least_ns) > OTHER_CLOCK_S || behind_s < -OTHER_CLOCK_S {
            return Some(StampDoubt::OtherClock { ahead_s: -behind_s });
        }
        if let Some((last_stamp_ns, last_now_ns)) = last {
            let stamps_s = seconds(i128::from(stamp_ns) - i128::from(last_stamp_ns));
            let time_s = seconds(i128::from(now_ns) - i128::from(last_now_ns));
            if stamps_s > 0.0 && stamps_s - time_s.max(0.0) > JUMP_S && before_ns.is_some_and(|least| behind_ns < least)
            {
                return Some(StampDoubt::JumpedAhead { by_s: stamps_s - time_s.max(0.0) });
            }
        }
        if behind_s < -AHEAD_S {
            return Some(StampDoubt::OtherClock { ahead_s: -behind_s });
        }
        let later_s = seconds(behind_ns - least_ns.max(0));
        (later_s > LAG_S).then_some(StampDoubt::Lags { by_s: later_s })
    }
}

impl StampDoubt {
    /// Whether messages with it are of no use where the time is a topic's: they are of another
    /// time.
    pub(crate) fn is_grave(self, reference: Reference) -> bool {
        let is_far = matches!(self, Self::OtherClock { ahead_s } if ahead_s.abs() > OTHER_CLOCK_S);
        is_far && matches!(reference, Reference::Clock(_))
    }

    /// What it is, and what to do.
    pub(crate) fn sentence(self, topic: &str, clock: &str, reference: Reference) -> String {
        let has_clock = matches!(reference, Reference::Clock(_));
        match self {
            Self::Lags { by_s } => format!(
                "the stamps of {topic} lag: its messages come {by_s:.1} s later than they did; see the network and how \
                 busy its driver is (ros2 topic delay {topic})"
            ),
            Self::JumpedAhead { by_s } => format!(
                "the stamps of {topic} have jumped {by_s:.1} s ahead: its clock was set; let chrony slew it, and start \
                 again if the map is warped there"
            ),
            Self::OtherClock { ahead_s } if has_clock => format!(
                "the stamps of {topic} are of another clock: {} {clock}; set use_sim_time for its node",
                apart(ahead_s)
            ),
            Self::OtherClock { ahead_s } => format!(
                "the stamps of {topic} are of another clock: {} this machine's; set both by the same source (chrony), \
                 or say --use-sim-time where {clock} tells the time",
                apart(ahead_s)
            ),
            Self::Simulated => format!(
                "the stamps of {topic} are of a simulated clock: where {clock} tells it, say --use-sim-time \
                 (use_sim_time in [ros])"
            ),
        }
    }
}

fn apart(ahead_s: f64) -> String {
    let side = if ahead_s > 0.0 { "ahead of" } else { "behind" };
    format!("{:.1} s {side}", ahead_s.abs())
}

/// The time that a topic tells.
#[derive(Clone, Debug, Default)]
pub(crate) struct ToldTime {
    /// The newest, nanoseconds, and when it came, seconds.
    newest: Option<(u64, f64)>,
    /// By how much it was set back last, seconds.
    set_back_s: Option<f64>,
    /// By how much it was set back when it began anew, seconds.
    reset_s: Option<f64>,
    /// When it went on after it had stood still, seconds.
    resumed_s: Option<f64>,
}

impl ToldTime {
    /// Takes what it tells at `arrived_s`, where `silent_s` without a word are too long.
    pub(crate) fn take(&mut self, told: Time, arrived_s: f64, silent_s: f64) {
        let Some(told_ns) = told.nanoseconds() else { return };
        if let Some((before_ns, before_s)) = self.newest {
            if told_ns < before_ns {
                let back_s = (before_ns - told_ns) as f64 * 1e-9;
                self.set_back_s = Some(back_s);
                self.reset_s = self.reset_s.or(Some(back_s).filter(|back_s| *back_s > RESET_S));
            }
            if arrived_s - before_s >= silent_s {
                self.resumed_s = Some(arrived_s);
            }
        }
        self.newest = Some((told_ns, arrived_s));
    }

    /// The time now, nanoseconds, as far as it was told.
    pub(crate) fn now_ns(&self) -> Option<u64> {
        self.newest.map(|(ns, _)| ns)
    }

    /// What is wrong with it at `now_s`, where `silent_s` without a word are too long: a sentence.
    pub(crate) fn trouble(&self, clock: &str, now_s: f64, silent_s: f64) -> Option<String> {
        match self.newest {
            None => Some(format!(
                "nothing has come on {clock}, which use_sim_time waits for: start the simulation (or ros2 bag play \
                 --clock), or leave out --use-sim-time"
            )),
            Some((_, arrived_s)) if now_s - arrived_s >= silent_s => {
                let for_s = now_s - arrived_s;
                Some(format!(
                    "{clock} has stood still for {for_s:.1} s: is the simulation paused, or the bag at its end?"
                ))
            }
            Some(_) => None,
        }
    }

    /// That it was set back, told once: a sentence.
    pub(crate) fn take_set_back(&mut self, clock: &str) -> Option<String> {
        self.set_back_s.take().map(|by_s| gone_back(clock, by_s))
    }

    /// That it has begun anew, after which nothing fits to what was before: a sentence.
    pub(crate) fn reset(&self, clock: &str) -> Option<String> {
        self.reset_s.map(|by_s| gone_back(clock, by_s))
    }

    /// Whether it stood still, and what was sent meanwhile may still come at `now_s`.
    pub(crate) fn is_catching_up(&self, now_s: f64) -> bool {
        self.resumed_s.is_some_and(|resumed_s| now_s - resumed_s < CATCH_UP_S)
    }
}

fn gone_back(clock: &str, by_s: f64) -> String {
    format!(
        "{clock} has gone back by {by_s:.1} s: the simulation was reset, the bag plays in a loop, or two of them run; \
         start again"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 2026, nanoseconds.
    const TODAY: u64 = 1_800_000_000_000_000_000;

    fn ns(seconds: f64) -> u64 {
        (seconds * 1e9) as u64
    }

    /// What is said of stamps (seconds) at times (seconds) after `begin`, one after the other.
    fn judged(begin: u64, pairs: &[(f64, f64)], by_clock: bool) -> Vec<Option<StampDoubt>> {
        let mut watch = StampWatch::default();
        let reference = |now_ns| if by_clock { Reference::Clock(now_ns) } else { Reference::Machine(now_ns) };
        pairs.iter().map(|(stamp, now)| watch.judge(begin + ns(*stamp), reference(begin + ns(*now)))).collect()
    }

    #[test]
    fn stamps_that_keep_up_are_well() {
        for by_clock in [false, true] {
            let found = judged(TODAY, &[(20.0, 20.1), (20.2, 20.35), (20.4, 20.4), (20.5, 20.9)], by_clock);
            assert!(found.iter().all(Option::is_none), "{found:?}");
        }
        // A simulation's clock, by itself.
        assert!(judged(0, &[(1.0, 1.0), (1.2, 1.1), (1.4, 1.5)], true).iter().all(Option::is_none));
    }

    #[test]
    fn lag_jumps_and_other_clocks_are_told_apart() {
        let lagging = judged(TODAY, &[(20.0, 20.1), (20.2, 20.3), (20.4, 22.5)], false);
        assert!(matches!(lagging[..], [None, None, Some(StampDoubt::Lags { by_s })] if (by_s - 2.0).abs() < 1e-6));
        let jumping = judged(TODAY, &[(20.0, 22.0), (20.2, 22.2), (25.4, 22.4)], false);
        assert!(
            matches!(jumping[2], Some(StampDoubt::JumpedAhead { by_s }) if (by_s - 5.0).abs() < 1e-6),
            "{jumping:?}"
        );
        for by_clock in [false, true] {
            let behind = judged(TODAY, &[(20.0, 80.0), (20.2, 80.2)], by_clock);
            assert!(matches!(behind[1], Some(StampDoubt::OtherClock { ahead_s }) if ahead_s < -59.0), "{behind:?}");
            let ahead = judged(TODAY, &[(80.0, 20.0), (80.2, 20.2)], by_clock);
            assert!(matches!(ahead[1], Some(StampDoubt::OtherClock { ahead_s }) if ahead_s > 59.0), "{ahead:?}");
        }
        assert_eq!(StampWatch::default().judge(ns(5.0), Reference::Machine(TODAY)), Some(StampDoubt::Simulated));
        let mixed = StampWatch::default().judge(TODAY, Reference::Clock(ns(5.0)));
        assert!(matches!(mixed, Some(StampDoubt::OtherClock { .. })), "{mixed:?}");
        assert!(
            mixed.is_some_and(|doubt| doubt.is_grave(Reference::Clock(1)) && !doubt.is_grave(Reference::Machine(1)))
        );
    }

    #[test]
    fn no_stamp_is_too_odd() {
        let mut watch = StampWatch::default();
        for (stamp, now) in [(0, u64::MAX), (u64::MAX, 0), (u64::MAX, u64::MAX), (0, 0)] {
            watch.judge(stamp, Reference::Clock(now));
            watch.judge(stamp, Reference::Machine(now));
        }
    }

    #[test]
    fn a_clock_that_is_silent_or_set_back_is_told() {
        let at = |sec: i32| Time { sec, nanosec: 0 };
        let mut told = ToldTime::default();
        assert!(told.trouble("/clock", 5.0, 0.4).is_some_and(|said| said.contains("nothing has come on /clock")));
        told.take(at(7), 5.0, 0.4);
        assert_eq!((told.now_ns(), told.trouble("/clock", 5.1, 0.4)), (Some(7_000_000_000), None));
        assert!(told.trouble("/clock", 6.0, 0.4).is_some_and(|said| said.contains("/clock has stood still for 1.0 s")));
        assert_eq!(told.take_set_back("/clock"), None);
        assert_eq!(told.reset("/clock"), None);
        told.take(at(2), 6.0, 0.4);
        assert!(told.take_set_back("/clock").is_some_and(|said| said.contains("gone back by 5.0 s")));
        assert_eq!(told.take_set_back("/clock"), None);
        assert!(told.reset("/clock").is_some_and(|said| said.contains("gone back by 5.0 s")));
        told.take(Time { sec: -1, nanosec: 0 }, 7.0, 0.4);
        assert_eq!(told.now_ns(), Some(2_000_000_000));
    }

    #[test]
    fn a_clock_that_others_overtake_does_not_begin_anew() {
        let mut told = ToldTime::default();
        told.take(Time { sec: 7, nanosec: 400_000_000 }, 5.0, 0.4);
        told.take(Time { sec: 7, nanosec: 200_000_000 }, 5.1, 0.4);
        assert!(told.take_set_back("/clock").is_some() && told.reset("/clock").is_none());
        assert!(!told.is_catching_up(5.2));
        told.take(Time { sec: 7, nanosec: 600_000_000 }, 9.0, 0.4);
        assert!(told.is_catching_up(9.1) && !told.is_catching_up(99.0));
    }
}
