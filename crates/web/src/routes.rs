//! Addresses to questions.

use crate::change::MapChangeOrder;
use crate::exposition::{EXPOSITION_TYPE, exposition};
use crate::guard::guard;
use crate::page;
use crate::parameters::QueryText;
use crate::port::{PastQuestion, WallsQuestion, WebAnswer};
use crate::reply::{WebRefusal, with_type};
use crate::rights::Rights;
use crate::site::Site;
use crate::visitor::Visitor;
use axum::body::{Bytes, to_bytes};
use axum::extract::{Path, RawQuery, Request, State};
use axum::http::StatusCode;
use axum::http::header::CONTENT_LENGTH;
use axum::middleware::from_fn_with_state;
use axum::response::Response;
use axum::routing::{get, post};
use axum::{Extension, Router};
use fht_door::MemberRole;
use fht_proto::api::keys::{Key, PREFIX};
use fht_proto::api::reply::{ErrorCode, ErrorReply, parse_point};
use fht_proto::api::request::{Moment, bad_request, parse, shown};
use fht_proto::{FixedPoint, MapName, RobotName};
use serde::Serialize;
use std::sync::Arc;
use tokio::time::timeout;

/// Everything that is answered.
pub(crate) fn router(site: Arc<Site>) -> Router {
    Router::new()
        .route("/", get(page::index))
        .route("/page/{file}", get(page::file))
        .route("/fht/maps", get(maps))
        .route("/fht/{map}/{topic}", get(topic))
        .route("/api/me", get(me))
        .route("/api/walls/{map}", get(walls))
        .route("/api/events", get(list_events))
        .route("/api/events/{map}", get(map_events))
        .route("/api/warnings", get(warnings))
        .route("/api/past/{map}", get(past))
        .route("/api/change/{map}", post(change))
        .route("/api/preview/{map}", post(preview))
        .route("/metrics", get(metrics))
        .fallback(nothing_there)
        .method_not_allowed_fallback(another_method)
        .layer(from_fn_with_state(Arc::clone(&site), guard))
        .with_state(site)
}

async fn nothing_there() -> WebRefusal {
    let text = "nothing is here: ask /fht/maps, /fht/MAP/TOPIC or /";
    WebRefusal::new(StatusCode::NOT_FOUND, ErrorCode::BadRequest, text)
}

async fn another_method() -> WebRefusal {
    let text = "a change or a preview is a POST, and everything else is asked with GET";
    WebRefusal::new(StatusCode::METHOD_NOT_ALLOWED, ErrorCode::BadRequest, text)
}

type Asked = Result<WebAnswer, WebRefusal>;
type AnySite = State<Arc<Site>>;

async fn maps(State(site): AnySite, RawQuery(query): RawQuery) -> Asked {
    ask(&site, Key::Maps, query).await
}

async fn topic(State(site): AnySite, Path((map, topic)): Path<(String, String)>, RawQuery(query): RawQuery) -> Asked {
    let name = format!("{PREFIX}/{map}/{topic}");
    match name.parse() {
        Ok(key @ Key::Topic { .. }) => ask(&site, key, query).await,
        _ => {
            let text = format!("{} is no question about a map", shown(&name));
            Err(WebRefusal::new(StatusCode::NOT_FOUND, ErrorCode::BadRequest, &text))
        }
    }
}

async fn ask(site: &Site, key: Key, query: Option<String>) -> Asked {
    let query = QueryText::parse(query.as_deref().unwrap_or_default())?;
    if query.get("piece_bytes").is_some() {
        return Err(bad_request("piece_bytes is for Zenoh: over HTTP there is one reply".to_owned()).into());
    }
    let request = parse(key, query.iter(), None)?;
    Ok(site.in_time(site.port().ask(request)).await?)
}

/// Default and greatest radius within which walls are shown, metres.
const WALLS_RADIUS_M: (f64, f64) = (50.0, FixedPoint::MAX_M);

async fn walls(State(site): AnySite, Path(map): Path<String>, RawQuery(query): RawQuery) -> Asked {
    let map = map_named(&map)?;
    let query = QueryText::parse(query.as_deref().unwrap_or_default())?;
    let near = parse_point(query.get("near").unwrap_or("0,0"))?;
    let radius = query.get("radius").map_or(Some(WALLS_RADIUS_M.0), |radius| radius.parse().ok());
    let radius = radius.filter(|radius| (0.0..=WALLS_RADIUS_M.1).contains(radius));
    let radius_m = radius.ok_or_else(|| bad_request(format!("radius must be 0 to {} m", WALLS_RADIUS_M.1)))?;
    Ok(site.in_time(site.port().walls(WallsQuestion { map, near, radius_m })).await?)
}

async fn past(State(site): AnySite, Path(map): Path<String>, RawQuery(query): RawQuery) -> Asked {
    let map = map_named(&map)?;
    let query = QueryText::parse(query.as_deref().unwrap_or_default())?;
    let wrong = || bad_request("version=NUMBER or release=NAME says which state".to_owned());
    let moment = match (query.get("version"), query.get("release")) {
        (Some(version), None) => Moment::Version(version.parse().map_err(|_| wrong())?),
        (None, Some(release)) => Moment::Release(release.to_owned()),
        _ => return Err(wrong().into()),
    };
    Ok(site.in_time(site.port().past(PastQuestion { map, moment })).await?)
}

async fn warnings(State(site): AnySite) -> Asked {
    Ok(site.in_time(site.port().warnings()).await?)
}

fn map_named(text: &str) -> Result<MapName, ErrorReply> {
    text.parse().map_err(|_| bad_request(format!("{} is no name of a map", shown(text))))
}

/// Who asks, as the page shows it.
#[derive(Serialize)]
struct Myself<'a> {
    #[serde(skip_serializing_if = "Option::is_none")]
    name: Option<&'a RobotName>,
    #[serde(skip_serializing_if = "Option::is_none")]
    role: Option<MemberRole>,
    rights: Rights,
    /// Where the same is asked over Zenoh.
    #[serde(skip_serializing_if = "Option::is_none")]
    zenoh: Option<&'a str>,
}

async fn me(State(site): AnySite, Extension(visitor): Extension<Visitor>) -> Response {
    let rights = site.rights(&visitor);
    let myself = Myself { name: visitor.name(), role: visitor.role(rights), rights, zenoh: site.zenoh() };
    with_type("application/json", serde_json::to_vec(&myself).unwrap_or_default())
}

async fn list_events(State(site): AnySite, Extension(visitor): Extension<Visitor>) -> Result<Response, WebRefusal> {
    events(&site, visitor, None)
}

async fn map_events(
    State(site): AnySite,
    Extension(visitor): Extension<Visitor>,
    Path(map): Path<String>,
) -> Result<Response, WebRefusal> {
    events(&site, visitor, Some(map_named(&map)?))
}

fn events(site: &Arc<Site>, visitor: Visitor, map: Option<MapName>) -> Result<Response, WebRefusal> {
    let place = site.stream()?;
    let counts = Arc::clone(site.counts());
    counts.streams(1);
    let watched = Arc::clone(site);
    let may_look = move || watched.rights(&visitor) != Rights::Nothing;
    let stream = site.hub().watch(map, site.limits().heartbeat, may_look);
    Ok(with_type("text/event-stream", stream.into_body(place, move || counts.streams(-1))))
}

async fn change(
    State(site): AnySite,
    Extension(visitor): Extension<Visitor>,
    Path(map): Path<String>,
    request: Request,
) -> Asked {
    let (by, order) = ordered(&site, &visitor, &map, request).await?;
    Ok(site.in_time(site.port().change(by, order)).await?)
}

async fn preview(
    State(site): AnySite,
    Extension(visitor): Extension<Visitor>,
    Path(map): Path<String>,
    request: Request,
) -> Asked {
    let (by, order) = ordered(&site, &visitor, &map, request).await?;
    Ok(site.in_time(site.port().preview(by, order)).await?)
}

/// Who orders what.
async fn ordered(
    site: &Site,
    visitor: &Visitor,
    map: &str,
    request: Request,
) -> Result<(RobotName, MapChangeOrder), WebRefusal> {
    let order = MapChangeOrder::parse(map_named(map)?, &body_of(site, request).await?)?;
    // The guard has let operators through, and nobody else.
    let nobody = || WebRefusal::new(StatusCode::FORBIDDEN, ErrorCode::NotPermitted, "only operators change maps");
    Ok((visitor.name().cloned().ok_or_else(nobody)?, order))
}

/// The body of a request, if it is short and comes in time.
async fn body_of(site: &Site, request: Request) -> Result<Bytes, WebRefusal> {
    let most = site.limits().body_bytes;
    let too_long = || {
        let text = format!("the body is longer than {most} bytes, or broke off");
        WebRefusal::new(StatusCode::PAYLOAD_TOO_LARGE, ErrorCode::TooLong, &text)
    };
    let length = request.headers().get(CONTENT_LENGTH).and_then(|length| length.to_str().ok()?.parse::<usize>().ok());
    if length.is_some_and(|length| length > most) {
        return Err(too_long());
    }
    match timeout(site.limits().reading, to_bytes(request.into_body(), most)).await {
        Ok(body) => body.map_err(|_| too_long()),
        Err(_) => {
            Err(WebRefusal::new(StatusCode::REQUEST_TIMEOUT, ErrorCode::Timeout, "the body did not come in time"))
        }
    }
}

async fn metrics(State(site): AnySite) -> Result<Response, WebRefusal> {
    let text = exposition(site.counts(), Arc::clone(site.port()));
    let text = text.map_err(|error| ErrorReply::new(ErrorCode::Internal, &error.to_string()))?;
    Ok(with_type(EXPOSITION_TYPE, text))
}
