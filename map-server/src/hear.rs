//! What robots say of themselves: who is there, what they run, what they found blocked.

use crate::answer::Sources;
use crate::now_us;
use crate::throttle::Throttle;
use fht_proto::fleet::{BlockedReport, RobotStatus};
use fht_proto::keys::{ALL_ROBOT_TOPICS, ALL_ROBOTS, Key, RobotTopic, Topic};
use fht_proto::query::{BlockedView, RulesReply};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};
use zenoh::Session;
use zenoh::pubsub::Subscriber;
use zenoh::query::{ConsolidationMode, QueryTarget};
use zenoh::sample::{Locality, Sample, SampleKind};

/// Longest message of a robot, bytes. Those with a few thousand authors in their vector are the longest.
const MAX_BYTES: usize = 256 << 10;

/// Within this time the other servers have answered.
const LEARN_WITHIN: Duration = Duration::from_secs(1);

/// Hears until it is dropped.
#[derive(Debug)]
pub struct Hearing {
    _said: Subscriber<()>,
    _tokens: Subscriber<()>,
}

/// Takes what robots say into `sources`.
///
/// # Errors
/// When Zenoh refuses the subscriptions.
pub async fn hear(session: &Session, sources: &Sources) -> Result<Hearing, zenoh::Error> {
    let of_said = sources.clone();
    let complaints = Mutex::new(Throttle::new(Duration::from_secs(1)));
    let said = move |sample: Sample| {
        if let Err(reason) = take(&sample, &of_said) {
            let suppressed = complaints.lock().unwrap_or_else(PoisonError::into_inner).pass(Instant::now());
            if let Some(suppressed) = suppressed {
                tracing::warn!(key = %sample.key_expr(), suppressed, "what a robot says is not taken: {reason}");
            }
        }
    };
    let of_tokens = sources.clone();
    let token = move |sample: Sample| {
        if let Ok(Key::Robot { map, robot }) = sample.key_expr().as_str().parse() {
            of_tokens.fleet.set_alive(&map, &robot, sample.kind() == SampleKind::Put);
        }
    };
    Ok(Hearing {
        _said: session.declare_subscriber(ALL_ROBOT_TOPICS).callback(said).await?,
        _tokens: session.liveliness().declare_subscriber(ALL_ROBOTS).history(true).callback(token).await?,
    })
}

/// Learns from the other servers of a site what robots found blocked before this one heard them.
pub async fn learn(session: Session, sources: Sources) {
    for head in sources.catalog.heads() {
        let asked = session
            .get(Key::topic(&head.map, Topic::Rules).to_string())
            .target(QueryTarget::All)
            .consolidation(ConsolidationMode::None)
            .allowed_destination(Locality::Remote)
            .timeout(LEARN_WITHIN)
            .await;
        let Ok(answers) = asked.inspect_err(|error| tracing::debug!("the other servers cannot be asked: {error}"))
        else {
            return;
        };
        while let Ok(answer) = answers.recv_async().await {
            let Ok(sample) = answer.result() else { continue };
            let Ok(rules) = serde_json::from_slice::<RulesReply>(&sample.payload().to_bytes()) else { continue };
            for (robot, report) in rules.blocked.into_iter().filter_map(BlockedView::into_report) {
                if let Err(reason) = sources.live.take(&head.map, &robot, &report, now_us()) {
                    tracing::debug!(robot, "what another server has heard is not taken: {reason}");
                }
            }
        }
    }
}

fn take(sample: &Sample, sources: &Sources) -> Result<(), String> {
    let Ok(Key::RobotTopic { map, robot, topic }) = sample.key_expr().as_str().parse() else { return Ok(()) };
    let Some(view) = sources.catalog.view(&map).filter(|_| sample.kind() == SampleKind::Put) else { return Ok(()) };
    let length = sample.payload().len();
    if length > MAX_BYTES {
        return Err(format!("{length} bytes are too many"));
    }
    let payload = sample.payload().to_bytes();
    match topic {
        RobotTopic::Status => {
            let status: RobotStatus = serde_json::from_slice(&payload).map_err(|error| error.to_string())?;
            if (&status.map, &status.robot) != (&map, &robot) {
                return Err(format!("a status of {} on map {}", status.robot, status.map));
            }
            sources.fleet.take(&map, &robot, status, &view.head, now_us());
            Ok(())
        }
        RobotTopic::Blocked => {
            let report: BlockedReport = serde_json::from_slice(&payload).map_err(|error| error.to_string())?;
            sources.live.take(&map, &robot, &report, now_us()).map_err(|error| error.to_string())
        }
        // For other robots and people.
        RobotTopic::Pose | RobotTopic::Goal | RobotTopic::Seen => Ok(()),
    }
}
