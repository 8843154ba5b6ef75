//! A thin TCP link that breaks: with a bit rate and a delay each way, cut on command or after so
//! many bytes.
//!
//! What is read from one side travels in small pieces, one after the other, and is written to the
//! other side when its last bit would arrive. Only what is on the way, and a little more, is read
//! ahead, so the sender experiences the link's pace.

use std::net::SocketAddr;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::tcp::{OwnedReadHalf, OwnedWriteHalf};
use tokio::net::{TcpListener, TcpSocket, TcpStream};
use tokio::sync::{mpsc, watch};

/// The properties of the link.
#[derive(Clone, Copy, Debug)]
pub struct LinkShape {
    /// Bit rate each way.
    pub bits_per_s: f64,
    /// Delay each way.
    pub delay: Duration,
}

/// A piece as it travels, bytes: an Ethernet frame's worth.
const PIECE: usize = 1400;
/// Socket buffers, bytes: what queues before the link, as in a small router.
const SOCKET_BUFFER: u32 = 32 << 10;

#[derive(Debug)]
struct Shared {
    target: SocketAddr,
    shape: LinkShape,
    /// Bytes that have arrived from the target.
    down: AtomicU64,
    connections: AtomicU64,
    /// While set, nothing is read from the target.
    is_stalled: AtomicBool,
    /// Changes when all connections are to end.
    cuts: watch::Sender<u64>,
    plan: Mutex<Plan>,
}

/// When the link breaks, and when it has broken.
#[derive(Debug, Default)]
struct Plan {
    /// Byte counts at which it is cut, lowest last.
    at_bytes: Vec<u64>,
    lasting: Duration,
    /// No connections are accepted before this time.
    closed_until: Option<Instant>,
    /// When the link broke, and when a connection was accepted again.
    breaks: Vec<(Instant, Option<Instant>)>,
}

/// The link, until it is dropped.
#[derive(Debug)]
pub struct ThinLink {
    shared: Arc<Shared>,
    endpoint: String,
    _runtime: tokio::runtime::Runtime,
}

impl ThinLink {
    /// A link to `target` (`tcp/host:port`).
    ///
    /// # Errors
    /// When the system gives no port, or no thread.
    pub fn to(target: &str, shape: LinkShape) -> std::io::Result<Self> {
        let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build()?;
        let address = target.strip_prefix("tcp/").unwrap_or(target);
        let target = address.parse().map_err(|_| std::io::Error::other(format!("{address} is no address")))?;
        let listener = runtime.block_on(TcpListener::bind(("127.0.0.1", 0)))?;
        let endpoint = format!("tcp/{}", listener.local_addr()?);
        let shared = Arc::new(Shared {
            target,
            shape,
            down: AtomicU64::new(0),
            connections: AtomicU64::new(0),
            is_stalled: AtomicBool::new(false),
            cuts: watch::Sender::new(0),
            plan: Mutex::default(),
        });
        runtime.spawn(accept(listener, Arc::clone(&shared)));
        Ok(Self { shared, endpoint, _runtime: runtime })
    }

    /// The endpoint at which the link begins (`tcp/host:port`).
    #[must_use]
    pub fn endpoint(&self) -> &str {
        &self.endpoint
    }

    /// Breaks the link whenever one of these byte counts has come down, counted from the start, for
    /// `lasting` each time.
    pub fn cut_at(&self, mut bytes: Vec<u64>, lasting: Duration) {
        bytes.sort_unstable_by(|a, b| b.cmp(a));
        let mut plan = self.shared.plan();
        (plan.at_bytes, plan.lasting) = (bytes, lasting);
    }

    /// Stops or resumes everything from the target; connections stay open.
    pub fn stall(&self, is_stalled: bool) {
        self.shared.is_stalled.store(is_stalled, Ordering::Release);
    }

    /// Bytes that have arrived from the target.
    #[must_use]
    pub fn bytes_down(&self) -> u64 {
        self.shared.down.load(Ordering::Acquire)
    }

    /// Connections accepted so far.
    #[must_use]
    pub fn connections(&self) -> u64 {
        self.shared.connections.load(Ordering::Acquire)
    }

    /// When the link broke, and when it was used again.
    #[must_use]
    pub fn breaks(&self) -> Vec<(Instant, Option<Instant>)> {
        self.shared.plan().breaks.clone()
    }
}

impl Shared {
    fn plan(&self) -> std::sync::MutexGuard<'_, Plan> {
        self.plan.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether connections are accepted now.
    fn is_open(&self) -> bool {
        let mut plan = self.plan();
        let now = Instant::now();
        if plan.closed_until.is_some_and(|until| now < until) {
            return false;
        }
        if let Some((_, again @ None)) = plan.breaks.last_mut() {
            *again = Some(now);
        }
        true
    }

    fn came_down(&self, bytes: usize) {
        let total = self.down.fetch_add(bytes as u64, Ordering::AcqRel) + bytes as u64;
        let mut plan = self.plan();
        if plan.at_bytes.last().is_some_and(|at| total >= *at) {
            plan.at_bytes.pop();
            let now = Instant::now();
            plan.closed_until = Some(now + plan.lasting);
            plan.breaks.push((now, None));
            self.cuts.send_modify(|cuts| *cuts += 1);
        }
    }
}

async fn accept(listener: TcpListener, shared: Arc<Shared>) {
    while let Ok((client, _)) = listener.accept().await {
        if shared.is_open() {
            tokio::spawn(carry(client, Arc::clone(&shared)));
        }
    }
}

async fn carry(client: TcpStream, shared: Arc<Shared>) {
    let Ok(server) = connect(shared.target).await else { return };
    let _ = (client.set_nodelay(true), server.set_nodelay(true));
    shared.connections.fetch_add(1, Ordering::AcqRel);
    let mut cuts = shared.cuts.subscribe();
    let ((from_client, to_client), (from_server, to_server)) = (client.into_split(), server.into_split());
    // Whichever ends first ends both ways; dropping the halves closes the sockets.
    tokio::select! {
        _ = cuts.changed() => {}
        () = one_way(from_client, to_server, &shared, false) => {}
        () = one_way(from_server, to_client, &shared, true) => {}
    }
}

async fn connect(target: SocketAddr) -> std::io::Result<TcpStream> {
    let socket = TcpSocket::new_v4()?;
    socket.set_recv_buffer_size(SOCKET_BUFFER)?;
    socket.connect(target).await
}

async fn one_way(mut from: OwnedReadHalf, mut to: OwnedWriteHalf, shared: &Shared, is_down: bool) {
    let LinkShape { bits_per_s, delay } = shared.shape;
    // As many pieces as fit into the link, and one more.
    let on_the_way = (bits_per_s * delay.as_secs_f64() / 8.0) as usize / PIECE + 1;
    let (send, mut receive) = mpsc::channel::<(tokio::time::Instant, Vec<u8>)>(on_the_way);
    let reading = async move {
        let mut free_at = tokio::time::Instant::now();
        loop {
            while is_down && shared.is_stalled.load(Ordering::Acquire) {
                tokio::time::sleep(Duration::from_millis(10)).await;
            }
            let mut piece = vec![0; PIECE];
            let Ok(length @ 1..) = from.read(&mut piece).await else { return };
            piece.truncate(length);
            let on_air = Duration::from_secs_f64(length as f64 * 8.0 / bits_per_s);
            free_at = free_at.max(tokio::time::Instant::now()) + on_air;
            if send.send((free_at + delay, piece)).await.is_err() {
                return;
            }
        }
    };
    let writing = async move {
        while let Some((at, piece)) = receive.recv().await {
            tokio::time::sleep_until(at).await;
            if to.write_all(&piece).await.is_err() {
                return;
            }
            if is_down {
                shared.came_down(piece.len());
            }
        }
    };
    tokio::join!(reading, writing);
}
