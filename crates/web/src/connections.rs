//! Connections, bounded in number and in how long they may keep others waiting.

use crate::config::WebLimits;
use crate::counts::WebCounts;
use crate::patient_io::PatientIo;
use crate::visitor::Visitor;
use axum::Router;
use fht_proto::RobotName;
use hyper::Request;
use hyper::body::Incoming;
use hyper::server::conn::http1;
use hyper::service::{Service, service_fn};
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use std::sync::Arc;
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::Semaphore;
use tokio::task::JoinSet;
use tokio::time::timeout;
use tokio_rustls::TlsAcceptor;

/// Longest head of a request, bytes.
const MAX_HEAD_BYTES: usize = 16 << 10;
/// Most fields in it.
const MAX_FIELDS: usize = 64;
/// When the system gives no sockets, it is asked again after so long.
const NO_SOCKETS: Duration = Duration::from_millis(200);

/// What connections share.
#[derive(Clone)]
pub(crate) struct Connections {
    pub(crate) acceptor: Option<TlsAcceptor>,
    pub(crate) operator: Option<RobotName>,
    pub(crate) limits: WebLimits,
    pub(crate) counts: Arc<WebCounts>,
    pub(crate) router: Router,
}

impl Connections {
    /// Takes connections for ever. All end when this is dropped.
    pub(crate) async fn take_all(self, listener: TcpListener) {
        let room = Arc::new(Semaphore::new(self.limits.connections));
        let mut running = JoinSet::new();
        loop {
            let stream = match listener.accept().await {
                Ok((stream, _)) => stream,
                Err(error) => {
                    tracing::warn!("no connection could be taken: {error}");
                    tokio::time::sleep(NO_SOCKETS).await;
                    continue;
                }
            };
            while running.try_join_next().is_some() {}
            let Ok(place) = Arc::clone(&room).try_acquire_owned() else {
                self.counts.connection_refused();
                continue;
            };
            let connections = self.clone();
            running.spawn(async move {
                connections.counts.connections(1);
                connections.take(stream).await;
                connections.counts.connections(-1);
                drop(place);
            });
        }
    }

    async fn take(&self, stream: TcpStream) {
        // Small events are not to wait for others.
        let _ = stream.set_nodelay(true);
        let Some(acceptor) = &self.acceptor else {
            return self.answer(stream, Visitor::Local(self.operator.clone())).await;
        };
        match timeout(self.limits.reading, acceptor.accept(stream)).await {
            Ok(Ok(stream)) => {
                let shown = stream.get_ref().1.peer_certificates().and_then(<[_]>::first);
                let visitor = shown.map_or(Visitor::Stranger, |certificate| Visitor::of_certificate(certificate));
                self.answer(stream, visitor).await;
            }
            Ok(Err(error)) => tracing::debug!("no TLS connection: {error}"),
            Err(_) => tracing::debug!("no TLS connection in time"),
        }
    }

    async fn answer<T: AsyncRead + AsyncWrite + Unpin + Send + 'static>(&self, stream: T, visitor: Visitor) {
        let io = TokioIo::new(PatientIo::new(stream, self.limits.writing));
        let router = TowerToHyperService::new(self.router.clone());
        let service = service_fn(move |mut request: Request<Incoming>| {
            request.extensions_mut().insert(visitor.clone());
            router.call(request)
        });
        let served = http1::Builder::new()
            .timer(TokioTimer::new())
            .header_read_timeout(self.limits.reading)
            .max_buf_size(MAX_HEAD_BYTES)
            .max_headers(MAX_FIELDS)
            .serve_connection(io, service)
            .await;
        if let Err(error) = served {
            tracing::debug!("a connection has ended: {error}");
        }
    }
}
