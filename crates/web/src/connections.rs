//! HTTP on connections that were let in.

use crate::config::WebLimits;
use crate::visitor::Visitor;
use axum::Router;
use fht_door::{Caller, DoorStream};
use fht_proto::RobotName;
use hyper::Request;
use hyper::body::Incoming;
use hyper::server::conn::http1;
use hyper::service::{Service, service_fn};
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;

/// Longest head of a request, bytes.
const MAX_HEAD_BYTES: usize = 16 << 10;
/// Most fields in it.
const MAX_FIELDS: usize = 64;

/// What connections share.
#[derive(Clone)]
pub(crate) struct Connections {
    pub(crate) operator: Option<RobotName>,
    pub(crate) limits: WebLimits,
    pub(crate) router: Router,
}

impl Connections {
    /// Answers what comes on a connection, until it ends.
    pub(crate) async fn answer(self, stream: DoorStream, caller: Caller) {
        let visitor = Visitor::of(caller, self.operator.as_ref());
        let router = TowerToHyperService::new(self.router);
        let service = service_fn(move |mut request: Request<Incoming>| {
            request.extensions_mut().insert(visitor.clone());
            router.call(request)
        });
        let served = http1::Builder::new()
            .timer(TokioTimer::new())
            .header_read_timeout(self.limits.reading)
            .max_buf_size(MAX_HEAD_BYTES)
            .max_headers(MAX_FIELDS)
            .serve_connection(TokioIo::new(stream), service)
            .await;
        if let Err(error) = served {
            tracing::debug!("a connection has ended: {error}");
        }
    }
}
