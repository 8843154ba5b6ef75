//! A socket that is bound, and connections taken from it: bounded in number, and in how long they
//! may keep others waiting.

use crate::caller::Caller;
use crate::error::DoorError;
use crate::hosts::Hosts;
use crate::patient_io::PatientIo;
use crate::tls::{DoorCertificates, secure};
use std::future::Future;
use std::net::{SocketAddr, TcpListener};
use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime};
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::TcpStream;
use tokio::sync::Semaphore;
use tokio::task::JoinSet;
use tokio::time::timeout;
use tokio_rustls::TlsAcceptor;

/// When the system gives no sockets, it is asked again after so long.
const NO_SOCKETS: Duration = Duration::from_millis(200);
/// That connections are turned away is logged at most so often.
const FULL_EVERY: Duration = Duration::from_secs(60);

/// How much is taken.
#[derive(Clone, Debug, PartialEq)]
pub struct DoorLimits {
    /// Connections at a time. Further ones are closed at once.
    pub connections: usize,
    /// How long a handshake of TLS may take.
    pub handshake: Duration,
    /// How long a connection may take nothing of what it is sent.
    pub writing: Duration,
}

/// Bytes in both directions.
pub trait Duplex: AsyncRead + AsyncWrite + Send + Unpin {}

impl<T: AsyncRead + AsyncWrite + Send + Unpin> Duplex for T {}

/// A connection that was let in.
pub type DoorStream = PatientIo<Box<dyn Duplex>>;

/// Hears how many connections there are.
pub trait DoorCounts: Send + Sync {
    /// One was let in.
    fn opened(&self) {}
    /// One has ended.
    fn closed(&self) {}
    /// One was turned away, since there are too many.
    fn refused(&self) {}
}

/// Nobody counts.
impl DoorCounts for () {}

/// Where connections are taken. It is bound before anything else is done, so that an address that
/// is taken is told at once, and outlives whoever answers.
pub struct Door {
    listener: TcpListener,
    address: SocketAddr,
    acceptor: Option<TlsAcceptor>,
    hosts: Arc<Hosts>,
    limits: DoorLimits,
}

impl std::fmt::Debug for Door {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Door").field("address", &self.address).finish_non_exhaustive()
    }
}

impl Door {
    /// Listens at `address` (port 0: any that is free). Who connects waits until somebody answers.
    /// It goes by `names`, too. Without certificates it is open to this machine alone.
    ///
    /// # Errors
    /// [`DoorError`]: strangers would be let in, a file is of no use, or the address is taken.
    pub fn bind(
        address: SocketAddr,
        certificates: Option<&DoorCertificates>,
        names: &[String],
        limits: DoorLimits,
    ) -> Result<Self, DoorError> {
        if certificates.is_none() && !address.ip().is_loopback() {
            return Err(DoorError::Exposed { address });
        }
        let (acceptor, certified) = match certificates.map(secure).transpose()? {
            Some(side) => (Some(side.acceptor), side.names),
            None => (None, Vec::new()),
        };
        let failed = |source| DoorError::Listen { address, source };
        let listener = TcpListener::bind(address).map_err(failed)?;
        listener.set_nonblocking(true).map_err(failed)?;
        let address = listener.local_addr().map_err(failed)?;
        let names = certified.into_iter().chain(names.iter().cloned());
        let hosts = Arc::new(Hosts::new(address.ip(), names, acceptor.is_some()));
        Ok(Self { listener, address, acceptor, hosts, limits })
    }

    /// Where it listens.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Whether it has certificates.
    #[must_use]
    pub fn is_secure(&self) -> bool {
        self.acceptor.is_some()
    }

    /// The names by which it is reached.
    #[must_use]
    pub fn hosts(&self) -> &Arc<Hosts> {
        &self.hosts
    }

    /// Takes connections for ever, and has `answer` answer each. All end when this is dropped.
    /// Within a Tokio runtime.
    ///
    /// # Errors
    /// [`DoorError::Listen`] when the system gives no more sockets to begin with.
    pub async fn take_all<F, A>(&self, counts: Arc<dyn DoorCounts>, answer: F) -> Result<(), DoorError>
    where
        F: Fn(DoorStream, Caller) -> A + Clone + Send + 'static,
        A: Future<Output = ()> + Send + 'static,
    {
        let failed = |source| DoorError::Listen { address: self.address, source };
        let listener = self.listener.try_clone().map_err(failed)?;
        let listener = tokio::net::TcpListener::from_std(listener).map_err(failed)?;
        let room = Arc::new(Semaphore::new(self.limits.connections));
        let mut running = JoinSet::new();
        let mut told_full: Option<Instant> = None;
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
                counts.refused();
                if told_full.is_none_or(|told| told.elapsed() >= FULL_EVERY) {
                    let most = self.limits.connections;
                    tracing::warn!("{most} connections are open, which is the most: more are turned away");
                    told_full = Some(Instant::now());
                }
                continue;
            };
            let (acceptor, limits) = (self.acceptor.clone(), self.limits.clone());
            let (answer, counts) = (answer.clone(), Arc::clone(&counts));
            running.spawn(async move {
                counts.opened();
                if let Some((stream, caller, holds)) = let_in(stream, acceptor, &limits).await
                    && timeout(holds, answer(stream, caller)).await.is_err()
                {
                    tracing::info!("a connection is ended: its certificate is out of date");
                }
                counts.closed();
                drop(place);
            });
        }
    }
}

/// Longest that a connection lasts, whatever a certificate says: a timer has an end.
const LONGEST: Duration = Duration::from_secs(365 * 24 * 3600);

/// Who comes in, if it is in time, and how long it may stay: until its certificate is out of date.
async fn let_in(
    stream: TcpStream,
    acceptor: Option<TlsAcceptor>,
    limits: &DoorLimits,
) -> Option<(DoorStream, Caller, Duration)> {
    // Small messages are not to wait for others.
    let _ = stream.set_nodelay(true);
    let patient = |stream: Box<dyn Duplex>| PatientIo::new(stream, limits.writing);
    let Some(acceptor) = acceptor else { return Some((patient(Box::new(stream)), Caller::Local, LONGEST)) };
    match timeout(limits.handshake, acceptor.accept(stream)).await {
        Ok(Ok(stream)) => {
            let shown = stream.get_ref().1.peer_certificates().and_then(<[_]>::first);
            let (caller, holds) = match shown {
                Some(certificate) => Caller::of_certificate(certificate, SystemTime::now()),
                None => (Caller::Stranger, LONGEST),
            };
            Some((patient(Box::new(stream)), caller, holds.min(LONGEST)))
        }
        Ok(Err(error)) => {
            tracing::debug!("no TLS connection: {error}");
            None
        }
        Err(_) => {
            tracing::debug!("no TLS connection in time");
            None
        }
    }
}
