//! What the page asks and orders, passed on: questions go to the server's own rooms, and changes
//! are put as an operator's command puts them.

use crate::network::{ConnectedSessions, CostClass, CountedQueries, QueryService};
use crate::query::{Answer, AnswerSources, internal, json, unknown_map};
use crate::web::edit::{PlannedEdit, plan};
use crate::web::last_warnings::LastWarnings;
use crate::web::past::past;
use crate::web::preview::preview;
use crate::web::walls::{WallsReply, walls};
use fht_client::AskError;
use fht_client::author::{Authorship, NotWritten, write, write_numbered};
use fht_map::WriterRole;
use fht_proto::api::reply::{ErrorCode, ErrorReply, Head};
use fht_proto::api::request::{Request, bad_request};
use fht_proto::{AuthorId, MapName, Op, RobotName};
use fht_web::{
    Answering, MapChange, MapChangeOrder, MapGauges, MapPort, MemberRole, PastQuestion, QueryFigures, Rights,
    ServerFigures, WallsQuestion, WebAnswer,
};
use serde::Serialize;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::Mutex;
use zenoh::Session;

/// How long the server may take to say what it has.
const ANSWER_TIMEOUT: Duration = Duration::from_secs(10);
/// More robots of a map than this are not counted.
const MAX_ROBOTS: usize = 1000;

/// The maps of this server.
#[derive(Clone)]
pub(super) struct ServerPort {
    service: QueryService,
    session: Session,
    connected: Arc<ConnectedSessions>,
    /// One change at a time: two of one operator would take the same number.
    writing: Arc<Mutex<()>>,
}

/// What has become of a change that takes others back.
#[derive(Serialize)]
struct Undone {
    map: MapName,
    version: u64,
    /// Numbers of the increments that were taken back: the first and the last.
    undone: [u64; 2],
    /// What that did, a sentence each.
    words: Vec<String>,
}

impl ServerPort {
    pub(super) fn new(service: QueryService, session: Session, connected: ConnectedSessions) -> Self {
        Self { service, session, connected: Arc::new(connected), writing: Arc::default() }
    }

    fn head(&self, map: &MapName) -> Result<Arc<Head>, ErrorReply> {
        let catalog = &self.service.sources().catalog;
        catalog.view(map).map(|view| view.head).ok_or_else(|| unknown_map(map, catalog))
    }

    async fn change_map(&self, by: RobotName, order: MapChangeOrder) -> Result<Answer, ErrorReply> {
        let _turn = self.writing.lock().await;
        let (map, author) = (order.map.clone(), AuthorId::of_robot(by.as_str()));
        let class = if matches!(order.change, MapChange::Undo { .. }) { CostClass::Snapshot } else { CostClass::Short };
        let name = by.clone();
        let planned = self.service.work(class, move |sources| {
            let AnswerSources { catalog, log, operators, .. } = sources;
            operators.learn(name.as_str());
            let view = catalog.view(&order.map).ok_or_else(|| unknown_map(&order.map, catalog))?;
            plan(&view, log.as_ref(), author, &order)
        });
        let PlannedEdit { ops, number, undone } = planned.await?;
        let head = match ops.is_empty() {
            true => self.head(&map)?.as_ref().clone(),
            false => self.put(&map, &by, number, ops).await?,
        };
        match undone {
            None => json(&head),
            Some((undone, words)) => json(&Undone { map, version: head.version, undone, words }),
        }
    }

    /// Puts one increment, of this number if there is one, and waits until it is stored.
    async fn put(&self, map: &MapName, by: &RobotName, number: Option<u64>, ops: Vec<Op>) -> Result<Head, ErrorReply> {
        let authorship = Authorship { name: by.as_str(), may_begin: false, timeout: ANSWER_TIMEOUT };
        let written = match number {
            Some(number) => write_numbered(&self.session, map, authorship, number, ops).await,
            None => write(&self.session, map, authorship, ops).await,
        };
        let head = written.map_err(not_written)?;
        tracing::info!(%map, %by, version = head.version, "an operator has changed the map over HTTP");
        Ok(head)
    }
}

fn not_written(error: NotWritten) -> ErrorReply {
    match error {
        NotWritten::Refused(reply) | NotWritten::Ask(AskError::Refused(reply)) => reply,
        NotWritten::Name(_) | NotWritten::Invalid(_) => bad_request(error.to_string()),
        NotWritten::NotStored { .. } | NotWritten::Unanswered => {
            ErrorReply::new(ErrorCode::Timeout, &error.to_string())
        }
        NotWritten::Contended { .. } => ErrorReply::new(ErrorCode::Conflict, &error.to_string()),
        NotWritten::Ask(AskError::Silent) => ErrorReply::busy("the server is busy; ask again after 1 s", 1),
        error => internal(error),
    }
}

fn as_web(Answer { format, bytes }: Answer) -> WebAnswer {
    WebAnswer { format, bytes }
}

impl MapPort for ServerPort {
    fn ask(&self, request: Request) -> Answering {
        let service = self.service.clone();
        Box::pin(async move {
            let mut answers = service.ask(request).await?;
            // Only who asks for pieces gets several.
            answers.pop().map(as_web).ok_or_else(|| internal("a question without an answer"))
        })
    }

    fn walls(&self, asked: WallsQuestion) -> Answering {
        let service = self.service.clone();
        Box::pin(async move {
            let seen = service.work(CostClass::Short, move |sources| {
                let catalog = &sources.catalog;
                let view = catalog.view(&asked.map).ok_or_else(|| unknown_map(&asked.map, catalog))?;
                let walls = walls(&view.state, asked.near, asked.radius_m);
                json(&WallsReply { map: asked.map, version: view.head.version, walls })
            });
            seen.await.map(as_web)
        })
    }

    fn past(&self, asked: PastQuestion) -> Answering {
        let service = self.service.clone();
        Box::pin(async move {
            let seen = service.work(CostClass::Snapshot, move |sources| {
                let catalog = &sources.catalog;
                let view = catalog.view(&asked.map).ok_or_else(|| unknown_map(&asked.map, catalog))?;
                json(&past(&view, sources.log.as_ref(), &asked.moment)?)
            });
            seen.await.map(as_web)
        })
    }

    fn preview(&self, by: RobotName, order: MapChangeOrder) -> Answering {
        let (service, author) = (self.service.clone(), AuthorId::of_robot(by.as_str()));
        Box::pin(async move {
            let seen = service.work(CostClass::Long, move |sources| {
                let AnswerSources { catalog, log, .. } = sources;
                let view = catalog.view(&order.map).ok_or_else(|| unknown_map(&order.map, catalog))?;
                let PlannedEdit { ops, .. } = plan(&view, log.as_ref(), author, &order)?;
                json(&preview(&view, sources, (author, ops), crate::clock::passed_us())?)
            });
            seen.await.map(as_web)
        })
    }

    fn warnings(&self) -> Answering {
        let last = json(&LastWarnings::now()).map(as_web);
        Box::pin(std::future::ready(last))
    }

    fn change(&self, by: RobotName, order: MapChangeOrder) -> Answering {
        let port = self.clone();
        Box::pin(async move { port.change_map(by, order).await.map(as_web) })
    }

    fn rights(&self, role: MemberRole, name: &RobotName) -> Rights {
        let listed = self.service.sources().writers.as_ref();
        let listed = listed.map(|writers| writers.now().role(AuthorId::of_robot(name.as_str())));
        let is = |of: WriterRole| listed.is_none_or(|listed| listed == Some(of));
        match role {
            MemberRole::Operator if is(WriterRole::Operator) => Rights::Change,
            MemberRole::Explorer if is(WriterRole::Explorer) => Rights::Look,
            MemberRole::Client if is(WriterRole::Client) => Rights::Look,
            // The list for writers does not name them.
            MemberRole::Router | MemberRole::Server => Rights::Look,
            MemberRole::Operator | MemberRole::Explorer | MemberRole::Client => Rights::Nothing,
        }
    }

    fn figures(&self) -> ServerFigures {
        let sources = self.service.sources();
        let maps = sources.catalog.heads().into_iter().map(|head| figures_of(sources, &head));
        let queries = self.service.counts().all().into_iter().map(|counted| {
            let CountedQueries { topic, answered, refused, busy, seconds, by_time } = counted;
            QueryFigures { topic, answered, refused, busy, seconds, buckets: by_time }
        });
        let LastWarnings { warnings, errors, .. } = LastWarnings::now();
        ServerFigures {
            maps: maps.collect(),
            queries: queries.collect(),
            sessions: self.connected.counts(),
            is_read_only: sources.log.fault().is_some(),
            disk_free_bytes: sources.log.free_bytes(),
            warnings,
            errors,
        }
    }
}

fn figures_of(sources: &AnswerSources, head: &Head) -> MapGauges {
    let fleet = sources.fleet.page(head, MAX_ROBOTS, "", crate::clock::passed_us());
    let here = || fleet.robots.iter().filter(|robot| robot.alive);
    MapGauges {
        map: head.map.clone(),
        version: head.version,
        main_nodes: head.main_nodes,
        support_nodes: head.support_nodes,
        edges: head.edges,
        bytes: head.bytes,
        refused: head.refused,
        robots: here().count(),
        late_robots: here().filter(|robot| robot.late).count(),
    }
}
