//! What viewers ask: paths and places. The replies are the server's own, as over Zenoh.

use crate::channel::encoded;
use crate::outlook::Outlook;
use crate::scene::{MAP_FRAME, plane_pose};
use fht_client::ask_until_answered;
use fht_proto::api::keys::{Key, Topic};
use fht_proto::api::reply::{PathReply, PlaceRef, Waypoint};
use fht_proto::{Footprint, MapName};
use foxglove::messages::{PosesInFrame, Timestamp};
use serde::Deserialize;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::watch;
use zenoh::Session;

/// How questions and answers are encoded.
pub(crate) const JSON: &str = "json";
/// How long an answer may take.
const PATIENCE: Duration = Duration::from_secs(10);
/// Longest name of a release in a question.
const MAX_RELEASE: usize = 80;

/// A service.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ServiceKind {
    Path,
    Places,
}

impl ServiceKind {
    pub(crate) const ALL: [Self; 2] = [Self::Path, Self::Places];

    /// Its number, from 1.
    pub(crate) fn id(self) -> u32 {
        self as u32 + 1
    }

    fn of(id: u32) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.id() == id)
    }

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Path => "/path",
            Self::Places => "/places",
        }
    }

    pub(crate) fn type_name(self) -> &'static str {
        match self {
            Self::Path => "fht.Path",
            Self::Places => "fht.Places",
        }
    }

    /// JSON Schema of question and answer.
    pub(crate) fn schemas(self) -> [&'static str; 2] {
        match self {
            Self::Path => {
                [include_str!("../../schema/path-request.json"), include_str!("../../../docs/schema/path.json")]
            }
            Self::Places => {
                [include_str!("../../schema/places-request.json"), include_str!("../../../docs/schema/rules.json")]
            }
        }
    }
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct PathRequest {
    from: String,
    to: String,
    #[serde(default)]
    to_nearest: bool,
    #[serde(default)]
    footprint: Option<String>,
    #[serde(default)]
    release: Option<String>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct PlacesRequest {}

/// A question as the server reads it. What would be another parameter is refused.
fn selector(map: &MapName, kind: ServiceKind, payload: &[u8]) -> Result<String, String> {
    let unreadable = |error: serde_json::Error| format!("the request is not understood: {error}");
    if kind == ServiceKind::Places {
        let PlacesRequest {} = serde_json::from_slice(payload).map_err(unreadable)?;
        return Ok(Key::topic(map, Topic::Rules).to_string());
    }
    let request: PathRequest = serde_json::from_slice(payload).map_err(unreadable)?;
    for end in [&request.from, &request.to] {
        end.parse::<PlaceRef>().map_err(|refusal| refusal.message)?;
    }
    let mut selector = format!("{}?from={};to={}", Key::topic(map, Topic::Path), request.from, request.to);
    if request.to_nearest {
        selector += ";to_nearest=true";
    }
    if let Some(text) = request.footprint {
        let footprint: Footprint = text.parse().map_err(|error| format!("footprint: {error}"))?;
        selector += &format!(";footprint={}", footprint.planned_as());
    }
    if let Some(release) = request.release {
        let is_name = |c: char| c.is_ascii_alphanumeric() || "-_.@".contains(c);
        if release.is_empty() || release.len() > MAX_RELEASE || !release.chars().all(is_name) {
            return Err("release: give a release's name, or head".to_owned());
        }
        selector += &format!(";release={release}");
    }
    Ok(selector)
}

/// Answers viewers.
#[derive(Clone)]
pub(crate) struct Services {
    session: Session,
    map: MapName,
    outlook: watch::Sender<Arc<Outlook>>,
}

impl Services {
    /// Asks about `map`; shows the path that was asked for last.
    pub(crate) fn new(session: Session, map: MapName, outlook: watch::Sender<Arc<Outlook>>) -> Self {
        Self { session, map, outlook }
    }

    /// The answer in JSON.
    ///
    /// # Errors
    /// A sentence that says why there is none.
    pub(crate) async fn answer(&self, service: u32, encoding: &str, payload: &[u8]) -> Result<Vec<u8>, String> {
        let kind = ServiceKind::of(service).ok_or("there is no such service")?;
        if encoding != JSON {
            return Err("ask in JSON".to_owned());
        }
        let selector = selector(&self.map, kind, payload)?;
        let answer = ask_until_answered(&self.session, &selector, PATIENCE).await.map_err(|error| error.to_string())?;
        if kind == ServiceKind::Path {
            let path: PathReply = serde_json::from_slice(&answer).map_err(|error| error.to_string())?;
            self.show(&path.waypoints);
        }
        Ok(answer)
    }

    fn show(&self, waypoints: &[Waypoint]) {
        let ahead = waypoints.iter().skip(1).chain(waypoints.last());
        let pose =
            |(at, next): (&Waypoint, &Waypoint)| plane_pose([at.x, at.y, (next.y - at.y).atan2(next.x - at.x)], 0.08);
        let path = PosesInFrame {
            timestamp: Some(Timestamp::now()),
            frame_id: MAP_FRAME.to_owned(),
            poses: waypoints.iter().zip(ahead).map(pose).collect(),
        };
        let path = Arc::new(encoded(&path));
        self.outlook.send_modify(|now| *now = Arc::new(Outlook { path: Some(path), ..Outlook::clone(now) }));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn asked(kind: ServiceKind, text: &str) -> Result<String, String> {
        let map: MapName = "museum".parse().unwrap_or_else(|error| panic!("{error}"));
        selector(&map, kind, text.as_bytes())
    }

    #[test]
    fn questions_are_the_servers_own() {
        let path = |text| asked(ServiceKind::Path, text);
        assert_eq!(path(r#"{"from":"0,0","to":"dock"}"#).as_deref(), Ok("fht/museum/path?from=0,0;to=dock"));
        let all = r#"{"from":"0,-1.5","to":"Küche","to_nearest":true,"footprint":"0.3","release":"a.1@1a2b3c4d"}"#;
        let selector = "fht/museum/path?from=0,-1.5;to=Küche;to_nearest=true;footprint=0.3;release=a.1@1a2b3c4d";
        assert_eq!(path(all).as_deref(), Ok(selector));
        assert_eq!(asked(ServiceKind::Places, "{}").as_deref(), Ok("fht/museum/rules"));
    }

    #[test]
    fn what_would_be_another_question_is_refused() {
        for text in [
            "",
            "{}",
            "[]",
            r#"{"from":"0,0"}"#,
            r#"{"from":"0,0","to":"dock;release=x"}"#,
            r#"{"from":"0,0","to":"dock?x"}"#,
            r#"{"from":"0,0","to":"dock","release":"a;to=1,1"}"#,
            r#"{"from":"0,0","to":"dock","release":""}"#,
            r#"{"from":"0,0","to":"dock","footprint":"1;to=1,1"}"#,
            r#"{"from":"0,0","to":"dock","more":1}"#,
            r#"{"from":"nan,0","to":"dock"}"#,
        ] {
            assert!(asked(ServiceKind::Path, text).is_err(), "{text}");
        }
        assert!(asked(ServiceKind::Places, r#"{"x":1}"#).is_err());
    }

    #[test]
    fn schemas_are_json() {
        for schema in ServiceKind::ALL.into_iter().flat_map(ServiceKind::schemas) {
            assert!(serde_json::from_str::<serde_json::Value>(schema).is_ok_and(|schema| schema["type"] == "object"));
        }
    }
}
