//! A fleet on a bad network, in one thread and simulated time: explorers, an operator, servers and clients, each made of the parts that the
//! programs are made of, over links that lose, delay, repeat, reorder and part. Explorers are killed and come
//! back. There is one server with a disk, or there are several on
//! replicated storages; a machine may fail at every durable write.
//!
//! What a run must show: in the end all copies are one, nothing that was acknowledged is lost or became another, and no release has changed. A seed
//! decides everything.

mod author;
mod disk;
mod follower;
mod ledger;
mod network;
mod refused;
mod server;
mod storages;
mod writer;

use author::Author;
use disk::Disk;
use fht_proto::query::{Head, Snapshot};
use fht_proto::{MapName, VersionVector, decode, encode};
use follower::Follower;
use ledger::Ledger;
use network::Network;
pub use network::NetworkConfig;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use server::{Ground, Server};
use std::sync::Arc;
use std::time::{Duration, Instant};
use storages::{COUNT, Reach, Site};

/// How bad things are.
#[derive(Clone, Debug)]
pub struct SimulationConfig {
    /// The network while there is trouble.
    pub network: NetworkConfig,
    /// Servers that stand on storages; 0: one with a disk. Default 0.
    pub servers: usize,
    /// Explorers, at most. Default 3.
    pub explorers: usize,
    /// Clients, at most. Default 3.
    pub clients: usize,
    /// Increments that an explorer writes, at most. Default 60.
    pub increments: u64,
    /// How long there is trouble, seconds. Default 60.
    pub trouble_s: u64,
    /// How long everything may take from then on, seconds. Default 300.
    pub calm_s: u64,
    /// Share of durable writes at which the machine fails. Default 0.05.
    pub crash_share: f64,
    /// Share of killed explorers that come back, within seconds. Default 0.8.
    pub returning: f64,
    /// Share of explorers that keep nothing on a disk, and so may give a number again that they had put in vain. Default 0.5 with one server.
    /// Where several servers stand on storages, a server may, once in some thousand fleets, let in what an earlier run had put just when
    /// another lets in the new one: dumb storages cannot decide between the two, and what a head covered is replaced. Default 0 there.
    pub forgetful: Option<f64>,
}

impl Default for SimulationConfig {
    fn default() -> Self {
        Self {
            network: NetworkConfig::default(),
            servers: 0,
            explorers: 3,
            clients: 3,
            increments: 60,
            trouble_s: 60,
            calm_s: 300,
            crash_share: 0.05,
            returning: 0.8,
            forgetful: None,
        }
    }
}

/// What happened in a run that went well.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    /// Increments in the end.
    pub increments: u64,
    /// Failures of machines that write, and servers killed.
    pub crashes: u64,
    /// How often the network fell into two groups.
    pub partitions: u64,
    /// How often explorers came back.
    pub returns: u64,
    /// Runs that ended because they were told that their numbers were another run's.
    pub told: u64,
    /// Messages lost.
    pub lost: u64,
    /// Messages in all.
    pub sent: u64,
    /// Releases made.
    pub releases: usize,
    /// Foldings of the log.
    pub folded: u64,
    /// When all was calm, seconds.
    pub seconds: u64,
}

/// What must not happen.
#[derive(Debug, thiserror::Error)]
pub enum Violation {
    /// Some copies are still not the server's.
    #[error("after {seconds} s {who} has {has}, and the server {server}")]
    Apart {
        /// How long it took.
        seconds: u64,
        /// Whose copy.
        who: String,
        /// What it has.
        has: String,
        /// What the server has.
        server: String,
    },
    /// An acknowledged increment is not there, or another one is.
    #[error("increment {0} was acknowledged and is not there")]
    Lost(String),
    /// An increment that a head covered has become another one.
    #[error("increment {0}, which a head covered, has become another one")]
    Replaced(String),
    /// Numbers acknowledge what was not made by that run.
    #[error("increment {0} of one run was taken for acknowledged, and the server has another run's")]
    Mistaken(String),
    /// A release is not what it was.
    #[error("release {0} has changed")]
    Release(String),
    /// The map is not what its increments add up to.
    #[error("the map is not what its increments add up to")]
    Sum,
    /// A part failed that must not.
    #[error("{0}")]
    Failed(String),
}

/// The nearest server that runs.
pub(crate) const SERVER: usize = usize::MAX - 1;
/// Everybody else.
pub(crate) const EVERYBODY: usize = usize::MAX;

/// What is sent.
#[derive(Clone, Debug)]
pub(crate) enum Message {
    /// An increment in its envelope, from its author to everybody.
    Put { key: String, bytes: Arc<Vec<u8>> },
    /// A head, from the server to everybody.
    Head(Arc<Head>),
    /// To a writer: another increment of its number is there.
    Refused,
    /// A question for the head.
    AskHead { id: u64 },
    /// The answer; the server may have no such map.
    HeadAnswer { id: u64, head: Option<Arc<Head>> },
    /// A question for increments.
    AskSince { id: u64, have: VersionVector },
    /// A question for a release.
    AskAt { id: u64, vector: VersionVector, have: VersionVector },
    /// A piece of the answer.
    Piece { id: u64, series: Arc<Snapshot> },
    /// There is no more.
    End { id: u64 },
}

pub(crate) fn map() -> MapName {
    // A constant that is a name.
    "sim".parse().unwrap_or_else(|error| panic!("{error}"))
}

/// The world at one time.
struct World {
    rng: ChaCha8Rng,
    /// What `Instant`s count from; nothing depends on it.
    origin: Instant,
    now_us: u64,
    network: Network,
    /// Those are the first places in the network.
    servers: Vec<Server>,
    /// What they stand on, if not on a disk.
    site: Option<Site>,
    authors: Vec<Author>,
    followers: Vec<Follower>,
    ledger: Ledger,
}

impl World {
    fn new(seed: u64, config: &SimulationConfig) -> Self {
        /// Share of explorers that are killed, in the third of the time in which most of them write.
        const DYING: f64 = 0.5;
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let explorers = rng.random_range(1..=config.explorers);
        let clients = rng.random_range(1..=config.clients);
        let servers = config.servers.max(1);
        let origin = Instant::now();
        let calm_us = config.trouble_s * 1_000_000;
        let forgetful = config.forgetful.unwrap_or(if config.servers == 0 { 0.5 } else { 0.0 });
        let writers: Vec<Author> = (0..=explorers)
            .map(|index| {
                let last = rng.random_range(1..=config.increments);
                // The last one is the operator: it makes releases, and it does not die.
                let is_operator = index == explorers;
                let dies_us = (!is_operator && rng.random_bool(DYING)).then(|| rng.random_range(0..calm_us / 3));
                let keeps = !rng.random_bool(forgetful);
                Author::new(servers + index, last, is_operator, (dies_us, calm_us), config.returning, keeps, origin)
            })
            .collect();
        let followers = (0..clients).map(|index| Follower::new(servers + 1 + explorers + index)).collect();
        let seed = rng.random();
        let site = (config.servers > 0).then(|| Site::new(&config.network, config.crash_share, servers, seed));
        let ground = || match &site {
            Some(site) => Ground::Site(site.clone()),
            None => Ground::Disk(Arc::new(Disk::new(config.crash_share, seed))),
        };
        let hearers = servers + 1 + explorers + clients;
        let places = hearers + if site.is_some() { COUNT } else { 0 };
        Self {
            network: Network::new(config.network.clone(), hearers, places),
            servers: (0..servers).map(|place| Server::new(place, ground())).collect(),
            site,
            authors: writers,
            followers,
            rng,
            origin,
            now_us: 0,
            ledger: Ledger::default(),
        }
    }

    /// The server that somebody's questions go to: one that runs and can be reached, if there is any.
    fn nearest(&self, from: usize) -> &Server {
        let count = self.servers.len();
        let by_distance = || (0..count).map(|step| &self.servers[(from + step) % count]);
        let is_near = |server: &&Server| server.is_running() && self.network.reaches(from, server.place(), self.now_us);
        let near = by_distance().find(is_near).or_else(|| by_distance().find(|server| server.is_running()));
        near.unwrap_or(&self.servers[from % count])
    }

    fn now(&self) -> Instant {
        self.origin + Duration::from_micros(self.now_us)
    }

    /// Between which servers and storages there is a way; storages have the last places.
    fn reach(&self) -> Reach {
        let first = self.servers.len() + self.authors.len() + self.followers.len();
        let to_storages =
            |from: usize| std::array::from_fn(|storage| self.network.reaches(from, first + storage, self.now_us));
        Reach {
            servers: (0..self.servers.len()).map(to_storages).collect(),
            storages: std::array::from_fn(|storage| to_storages(first + storage)),
        }
    }

    /// Delivers what arrives now and lets everybody act.
    fn step(&mut self) -> Result<(), Violation> {
        let now = self.now();
        for (from, to, message) in self.network.arriving(self.now_us) {
            if let Some(server) = self.servers.get_mut(to) {
                server.receive(from, message);
            } else if let Some(author) = self.authors.iter_mut().find(|author| author.place() == to) {
                author.receive(message, now)?;
            } else if let Some(follower) = self.followers.iter_mut().find(|follower| follower.place() == to) {
                follower.receive(message, now);
            }
        }
        if let Some(site) = &self.site {
            site.step(self.now_us, self.reach());
        }
        let mut sent = Vec::new();
        for server in &mut self.servers {
            sent.extend(server.act(self.now_us, &mut self.rng)?);
            server.note_covered(&mut self.ledger)?;
        }
        let heads: Vec<_> = self.authors.iter().map(|author| self.nearest(author.place()).head()).collect();
        for (author, head) in self.authors.iter_mut().zip(heads) {
            sent.extend(author.act(now, self.now_us, &mut self.rng, head.as_deref()));
        }
        for follower in &mut self.followers {
            sent.extend(follower.act(now, &mut self.rng));
        }
        self.network.weather(self.now_us, &mut self.rng);
        for (from, to, message) in sent {
            match to {
                EVERYBODY => self.network.publish(from, &message, self.now_us, &mut self.rng),
                SERVER => {
                    let nearest = self.nearest(from).place();
                    self.network.send(from, nearest, message, self.now_us, &mut self.rng);
                }
                to => self.network.send(from, to, message, self.now_us, &mut self.rng),
            }
        }
        Ok(())
    }

    /// Whether all is written, acknowledged and copied.
    fn is_settled(&self) -> bool {
        let Some(head) = self.servers[0].head() else { return false };
        let is_equal = |follower: &Follower| {
            *follower.copy().vector() == head.vector
                && follower.copy().state().digest() == head.digest
                && self.servers[0].runs().is_none_or(|should| should == follower.runs())
        };
        let are_one = self.servers.iter().all(|server| server.head().is_some_and(|other| other.digest == head.digest));
        are_one && self.authors.iter().all(Author::is_done) && self.followers.iter().all(is_equal)
    }

    fn check(&self, seconds: u64) -> Result<(), Violation> {
        let first = &self.servers[0];
        let head = first.head().ok_or_else(|| Violation::Failed("the server has no map".to_owned()))?;
        let server = format!("{} ({})", head.vector, head.digest);
        for other in &self.servers[1..] {
            let has = other.head().map(|head| (head.vector.clone(), head.digest));
            if has.as_ref().is_none_or(|(vector, digest)| (vector, digest) != (&head.vector, &head.digest)) {
                let who = format!("server {}", other.place());
                return Err(Violation::Apart { seconds, who, has: format!("{has:?}"), server });
            }
        }
        if let Some(author) = self.authors.iter().find(|author| !author.is_done()) {
            let (who, has) = (format!("author {}", author.id()), author.progress());
            return Err(Violation::Apart { seconds, who, has, server });
        }
        for follower in &self.followers {
            let copy = follower.copy();
            if *copy.vector() != head.vector || copy.state().digest() != head.digest {
                let has = format!("{} ({})", copy.vector(), copy.state().digest());
                return Err(Violation::Apart { seconds, who: format!("client {}", follower.place()), has, server });
            }
            let (should, runs) = (first.runs(), follower.runs());
            if should.is_some_and(|should| should != runs) {
                let (has, server) = (format!("{runs:?}"), format!("{should:?}"));
                return Err(Violation::Apart {
                    seconds,
                    who: format!("what client {} runs", follower.place()),
                    has,
                    server,
                });
            }
        }
        let is_overruled = self.servers.iter().any(|server| server.overruled() > 0);
        if is_overruled && self.authors.iter().all(|author| author.keeps() || author.returns() == 0) {
            return Err(Violation::Failed("storages kept another increment than a server".to_owned()));
        }
        // What heads covered is all that there is.
        let mut whole = fht_map::MapState::new();
        for increment in self.ledger.increments() {
            let increment = increment?;
            if !self.servers.iter().all(|server| server.holds(&increment)) {
                return Err(Violation::Lost(format!("{}/{}", increment.author, increment.number)));
            }
            whole.apply(&increment);
        }
        if whole.digest() != head.digest {
            return Err(Violation::Sum);
        }
        self.servers.iter().try_for_each(Server::check_releases)
    }
}

/// What the runs of an author took for acknowledged is there; but what a run did that was told that its numbers are taken, which happens to
/// no explorer that gives no number twice.
fn nothing_is_mistaken(author: &Author, server: &Server) -> Result<(), Violation> {
    if author.keeps() && author.runs().any(|run| run.is_told) {
        return Err(Violation::Failed(format!("author {}, who gives no number twice, was refused", author.id())));
    }
    for run in author.runs().filter(|run| !run.is_told) {
        for increment in run.written.iter().filter(|increment| increment.number <= run.acknowledged) {
            let name = || format!("{}/{}", increment.author, increment.number);
            let ours = encode(increment).map_err(|error| Violation::Failed(error.to_string()))?;
            match server.stored(increment.author, increment.number) {
                None => return Err(Violation::Lost(name())),
                Some(stored) if stored == ours => {}
                Some(_) => return Err(Violation::Mistaken(name())),
            }
        }
    }
    Ok(())
}

/// Runs one seed.
///
/// # Errors
/// What went wrong.
pub fn run(seed: u64, config: &SimulationConfig) -> Result<Outcome, Violation> {
    /// A step, microseconds.
    const STEP_US: u64 = 10_000;
    let mut world = World::new(seed, config);
    let trouble_us = config.trouble_s * 1_000_000;
    let end_us = trouble_us + config.calm_s * 1_000_000;
    while world.now_us < end_us {
        if world.now_us == trouble_us {
            world.network.calm();
            world.servers.iter_mut().for_each(Server::calm);
            world.followers.iter_mut().for_each(Follower::calm);
        }
        world.step()?;
        world.now_us += STEP_US;
        if world.now_us > trouble_us && world.is_settled() {
            break;
        }
    }
    let seconds = world.now_us / 1_000_000;
    world.check(seconds)?;
    let network = world.network.counts();
    world.authors.iter().try_for_each(|author| nothing_is_mistaken(author, &world.servers[0]))?;
    let told = world.authors.iter().map(|author| author.runs().filter(|run| run.is_told).count() as u64).sum();
    let sum = |of: fn(&Server) -> u64| world.servers.iter().map(of).sum::<u64>();
    Ok(Outcome {
        increments: world.servers[0].head().map_or(0, |head| head.version),
        crashes: sum(Server::crashes) + world.site.as_ref().map_or(0, Site::crashes),
        partitions: network.partitions,
        returns: world.authors.iter().map(Author::returns).sum(),
        told,
        lost: network.lost,
        sent: network.sent,
        releases: world.servers[0].releases(),
        folded: sum(Server::folded),
        seconds,
    })
}

/// A piece of an answer as it travels.
pub(crate) fn unpack(bytes: &[u8]) -> Result<Snapshot, Violation> {
    decode(bytes).map_err(|error| Violation::Failed(error.to_string()))
}
