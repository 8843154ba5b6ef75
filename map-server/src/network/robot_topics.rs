//! What robots report about themselves: who is there, what they run, what they found blocked.

use crate::clock::passed_us;
use crate::query::AnswerSources;
use crate::throttle::Throttle;
use fht_map::plan::blocked::{Reporter, missing_node};
use fht_proto::api::fleet::{BlockedReport, RobotStatus};
use fht_proto::api::keys::{ALL_ROBOT_TOPICS, ALL_ROBOTS, Key, RobotTopic, Topic};
use fht_proto::api::reply::{BlockedView, RulesReply};
use fht_proto::model::validate::Validate;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};
use zenoh::Session;
use zenoh::pubsub::Subscriber;
use zenoh::query::{ConsolidationMode, QueryTarget};
use zenoh::sample::{Locality, Sample, SampleKind};

/// Longest message of a robot, bytes. The longest are those with a few thousand authors in their
/// vector.
const MAX_BYTES: usize = 256 << 10;

/// Longest name of a release with its author, bytes.
const MAX_RELEASE_BYTES: usize = 128;

/// How long the other servers have to answer.
pub(super) const LEARN_WITHIN: Duration = Duration::from_secs(1);

/// Receives reports until it is dropped.
#[derive(Debug)]
pub(crate) struct RobotTopicSubscriptions {
    _topics: Subscriber<()>,
    _tokens: Subscriber<()>,
}

/// Puts what robots report into `sources`.
///
/// # Errors
/// When Zenoh refuses the subscriptions.
pub(crate) async fn subscribe_robot_topics(
    session: &Session,
    sources: &AnswerSources,
) -> Result<RobotTopicSubscriptions, zenoh::Error> {
    let for_topics = sources.clone();
    let complaints = Mutex::new(Throttle::new(Duration::from_secs(1)));
    let take_topic = move |sample: Sample| {
        if let Err(reason) = take_sample(&sample, &for_topics) {
            let suppressed = complaints.lock().unwrap_or_else(PoisonError::into_inner).pass(Instant::now());
            if let Some(suppressed) = suppressed {
                tracing::warn!(key = %sample.key_expr(), suppressed, "what a robot says is not taken: {reason}");
            }
        }
    };
    let for_tokens = sources.clone();
    let take_token = move |sample: Sample| {
        if let Ok(Key::Robot { map, robot }) = sample.key_expr().as_str().parse() {
            let is_here = sample.kind() == SampleKind::Put;
            tracing::info!(%map, %robot, "the robot {}", if is_here { "is here" } else { "has gone" });
            for_tokens.fleet.set_alive(&map, &robot, is_here);
            if !is_here {
                for_tokens.active_rules.robot_has_gone(&map, &robot, passed_us());
            }
        }
    };
    Ok(RobotTopicSubscriptions {
        _topics: session.declare_subscriber(ALL_ROBOT_TOPICS).callback(take_topic).await?,
        _tokens: session.liveliness().declare_subscriber(ALL_ROBOTS).history(true).callback(take_token).await?,
    })
}

/// Learns from the other servers of a site what robots found blocked before this server was
/// listening.
pub(crate) async fn learn_blockages(session: Session, sources: AnswerSources) {
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
                let Some(view) = sources.catalog.view(&head.map) else { continue };
                let reporter = (robot.as_str(), Reporter::Trusted);
                if let Err(reason) = sources.active_rules.take_report(&view, reporter, &report, passed_us()) {
                    tracing::debug!(%robot, "what another server has heard is not taken: {reason}");
                }
            }
        }
    }
}

fn take_sample(sample: &Sample, sources: &AnswerSources) -> Result<(), String> {
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
            if status.release.as_ref().is_some_and(|release| release.len() > MAX_RELEASE_BYTES) {
                return Err("the name of its release is too long".to_owned());
            }
            status.validate().map_err(|error| error.to_string())?;
            sources.fleet.take_status(&map, &robot, status, &view.head, passed_us());
            Ok(())
        }
        RobotTopic::Blocked => {
            let report: BlockedReport = serde_json::from_slice(&payload).map_err(|error| error.to_string())?;
            let edges = report.edge_keys().map_err(|error| error.to_string())?;
            if let Some(missing) = missing_node(&edges, [&view.state, view.running.state()]) {
                return Err(format!("map {map} has no node {missing}: it cannot be blocked"));
            }
            let reporter = (robot.as_str(), sources.reporter(&map, &robot));
            sources
                .active_rules
                .take_report(&view, reporter, &report, passed_us())
                .map_err(|error| format!("what {robot} found blocked on map {map}: {error}"))?;
            let (edges, places, for_s) = (report.edges.len(), report.places.len(), report.for_s);
            tracing::info!(%map, %robot, edges, places, for_s, "the robot found something blocked");
            Ok(())
        }
        // For other robots and people.
        RobotTopic::Pose | RobotTopic::Goal | RobotTopic::Seen => Ok(()),
    }
}
