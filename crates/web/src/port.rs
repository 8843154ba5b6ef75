//! What the maps are asked through.

use crate::change::MapChangeOrder;
use crate::figures::ServerFigures;
use crate::rights::Rights;
use fht_door::MemberRole;
use fht_proto::api::reply::ErrorReply;
use fht_proto::api::request::{Format, Moment, Request};
use fht_proto::{FixedPoint, MapName, RobotName};
use std::future::Future;
use std::pin::Pin;

/// An answer, as it is sent.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WebAnswer {
    /// How it is written.
    pub format: Format,
    /// The payload.
    pub bytes: Vec<u8>,
}

/// An answer that comes.
pub type Answering = Pin<Box<dyn Future<Output = Result<WebAnswer, ErrorReply>> + Send>>;

/// Where walls are asked for.
#[derive(Clone, Debug, PartialEq)]
pub struct WallsQuestion {
    /// The map.
    pub map: MapName,
    /// The middle.
    pub near: FixedPoint,
    /// How far around it nodes lie whose scans are shown, metres.
    pub radius_m: f64,
}

/// Which earlier state is asked for.
#[derive(Clone, Debug, PartialEq)]
pub struct PastQuestion {
    /// The map.
    pub map: MapName,
    /// The state.
    pub moment: Moment,
}

/// Who has the maps. Nothing here may block: what takes time is done elsewhere.
pub trait MapPort: Send + Sync + 'static {
    /// Answers as over Zenoh, with one reply.
    fn ask(&self, request: Request) -> Answering;
    /// The walls that nodes saw, in JSON: `points` are pairs of whole centimetres, bounded in
    /// number.
    fn walls(&self, asked: WallsQuestion) -> Answering;
    /// An earlier state as the page draws it, in JSON, bounded in number: nodes, rules, walls.
    fn past(&self, asked: PastQuestion) -> Answering;
    /// Which paths between places would be others after a change, in JSON. Nothing is written.
    fn preview(&self, by: RobotName, order: MapChangeOrder) -> Answering;
    /// The last warnings of the server's log, in JSON.
    fn warnings(&self) -> Answering;
    /// Writes what an operator changes, under the operator's name. The answer comes when it is
    /// durable.
    fn change(&self, by: RobotName, order: MapChangeOrder) -> Answering;
    /// What a member of the site may do now. Roles may be read anew.
    fn rights(&self, role: MemberRole, name: &RobotName) -> Rights;
    /// What is counted.
    fn figures(&self) -> ServerFigures;
}
