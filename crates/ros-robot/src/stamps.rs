//! By what time the stamps of a robot's sensors are judged, and what is odd about them. No I/O and
//! no clock: times of arrival are given.

use crate::clock::{Reference, StampDoubt, StampWatch, ToldTime};
use crate::config::RosRobotConfig;
use fht_ros_messages::msg::{ClockMsg, Time};

/// Most doubts that wait to be told.
const DOUBTS: usize = 16;

/// Whose stamps are judged.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Stamped {
    Scan,
    Odometry,
}

/// The stamps of one topic.
struct Topic {
    name: String,
    watch: StampWatch,
}

impl Topic {
    fn of(name: &str) -> Self {
        Self { name: name.to_owned(), watch: StampWatch::default() }
    }
}

/// Judges stamps by this machine's clock, or by the one that is told.
pub(crate) struct Stamps {
    scan: Topic,
    odometry: Topic,
    /// The topic that tells the time, or would.
    clock: String,
    /// Only with `use_sim_time`.
    told: Option<ToldTime>,
    /// The clock may say nothing for so long, seconds.
    silent_s: f64,
    /// Sentences that were not told yet.
    doubts: Vec<String>,
}

impl Stamps {
    /// Of these topics, by their full names; `clock_topic` is the one that tells the time.
    pub(crate) fn new(config: &RosRobotConfig, scan_topic: &str, odometry_topic: &str, clock_topic: &str) -> Self {
        let told = config.use_sim_time.then(ToldTime::default);
        let clock = if told.is_some() { clock_topic } else { &config.clock };
        Self {
            scan: Topic::of(scan_topic),
            odometry: Topic::of(odometry_topic),
            clock: clock.to_owned(),
            told,
            silent_s: config.silent_after_s,
            doubts: Vec::new(),
        }
    }

    /// The time is told.
    pub(crate) fn take_clock(&mut self, message: &ClockMsg, arrived_s: f64) {
        let Some(told) = &mut self.told else { return };
        told.take(message.clock, arrived_s, self.silent_s);
        let set_back = told.take_set_back(&self.clock);
        self.doubts.extend(set_back);
    }

    /// The time, where it is `wall_ns` on this machine; none where it is to be told and was not
    /// yet.
    pub(crate) fn now(&self, wall_ns: u64) -> Option<Reference> {
        match &self.told {
            Some(told) => told.now_ns().map(Reference::Clock),
            None => Some(Reference::Machine(wall_ns)),
        }
    }

    /// Why messages with this stamp that came at `arrived_s` are of no use, if they are not; what
    /// is only odd is a doubt.
    pub(crate) fn judge(&mut self, stamp_ns: u64, of: Stamped, now: Reference, arrived_s: f64) -> Option<String> {
        let is_catching_up = self.told.as_ref().is_some_and(|told| told.is_catching_up(arrived_s));
        let Topic { name, watch } = match of {
            Stamped::Scan => &mut self.scan,
            Stamped::Odometry => &mut self.odometry,
        };
        let doubt = watch.judge(stamp_ns, now)?;
        if is_catching_up && matches!(doubt, StampDoubt::Lags { .. }) {
            return None;
        }
        let sentence = doubt.sentence(name, &self.clock, now);
        self.doubt(sentence.clone());
        doubt.is_grave(now).then_some(sentence)
    }

    pub(crate) fn doubt(&mut self, sentence: String) {
        if self.doubts.len() < DOUBTS {
            self.doubts.push(sentence);
        }
    }

    /// What is odd and was not told yet: sentences.
    pub(crate) fn take_doubts(&mut self) -> Vec<String> {
        std::mem::take(&mut self.doubts)
    }

    /// What is wrong with the time that is told, at `now_s`: a sentence.
    pub(crate) fn trouble(&self, now_s: f64) -> Option<String> {
        self.told.as_ref()?.trouble(&self.clock, now_s, self.silent_s)
    }

    /// That the time that is told has begun anew: a sentence.
    pub(crate) fn reset(&self) -> Option<String> {
        self.told.as_ref()?.reset(&self.clock)
    }
}

/// A stamp in nanoseconds; where it was left at zero, the time of arrival.
pub(crate) fn stamp_ns(stamp: Time, now: Option<Reference>) -> Option<u64> {
    let stamp_ns = stamp.nanoseconds()?;
    match now {
        Some(Reference::Clock(now_ns) | Reference::Machine(now_ns)) if stamp_ns == 0 => Some(now_ns),
        _ => Some(stamp_ns),
    }
}
