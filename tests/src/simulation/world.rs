//! The simulated world at one time.

use crate::simulation::author::Author;
use crate::simulation::config::SimulationConfig;
use crate::simulation::disk::Disk;
use crate::simulation::follower::Follower;
use crate::simulation::ledger::Ledger;
use crate::simulation::message::{EVERYBODY, SERVER};
use crate::simulation::network::Network;
use crate::simulation::outcome::Violation;
use crate::simulation::server::{Ground, Server};
use crate::simulation::storages::{COUNT, Reach, Site};
use fht_proto::api::reply::Head;
use fht_proto::encode;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// The world at one time.
pub(super) struct World {
    rng: ChaCha8Rng,
    /// What `Instant`s count from; nothing depends on it.
    origin: Instant,
    pub(super) now_us: u64,
    pub(super) network: Network,
    /// They have the first places in the network.
    pub(super) servers: Vec<Server>,
    /// The storages that they stand on, if not a disk.
    pub(super) site: Option<Site>,
    pub(super) authors: Vec<Author>,
    pub(super) followers: Vec<Follower>,
    ledger: Ledger,
}

impl World {
    pub(super) fn new(seed: u64, config: &SimulationConfig) -> Self {
        /// Share of explorers that are killed, in the first third of the time, when most of them
        /// write.
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
                // The last one is the operator: it makes releases, and is not killed.
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

    /// The server that questions from a place go to: a running one that can be reached, if there is
    /// any.
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

    /// Which servers and storages reach each other; storages have the last places.
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
    pub(super) fn step(&mut self) -> Result<(), Violation> {
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

    /// Whether everything is written, acknowledged and copied.
    pub(super) fn is_settled(&self) -> bool {
        let Some(head) = self.servers[0].head() else { return false };
        let is_equal = |follower: &Follower| {
            *follower.copy().vector() == head.vector
                && follower.copy().state().digest() == head.digest
                && self.servers[0].runs().is_none_or(|should| should == follower.runs())
        };
        let are_one = self.servers.iter().all(|server| server.head().is_some_and(|other| other.digest == head.digest));
        are_one && self.authors.iter().all(Author::is_done) && self.followers.iter().all(is_equal)
    }

    /// Checks what must hold in the end.
    pub(super) fn check(&self, seconds: u64) -> Result<(), Violation> {
        let first = &self.servers[0];
        let head = first.head().ok_or_else(|| Violation::Failed("the server has no map".to_owned()))?;
        self.check_servers(&head, seconds)?;
        if let Some(author) = self.authors.iter().find(|author| !author.is_done()) {
            let (who, has) = (format!("author {}", author.id()), author.progress());
            return Err(Violation::Apart { seconds, who, has, server: described(&head) });
        }
        self.check_followers(&head, seconds)?;
        let is_overruled = self.servers.iter().any(|server| server.overruled() > 0);
        if is_overruled && self.authors.iter().all(|author| author.keeps() || author.returns() == 0) {
            return Err(Violation::Failed("storages kept another increment than a server".to_owned()));
        }
        self.check_ledger(&head)?;
        self.servers.iter().try_for_each(Server::check_releases)?;
        self.authors.iter().try_for_each(|author| check_author(author, first))
    }

    /// All servers have what the first has.
    fn check_servers(&self, head: &Head, seconds: u64) -> Result<(), Violation> {
        for other in &self.servers[1..] {
            let has = other.head().map(|head| (head.vector.clone(), head.digest));
            if has.as_ref().is_none_or(|(vector, digest)| (vector, digest) != (&head.vector, &head.digest)) {
                let who = format!("server {}", other.place());
                return Err(Violation::Apart { seconds, who, has: format!("{has:?}"), server: described(head) });
            }
        }
        Ok(())
    }

    /// All clients have the server's map, and run what they should.
    fn check_followers(&self, head: &Head, seconds: u64) -> Result<(), Violation> {
        for follower in &self.followers {
            let copy = follower.copy();
            if *copy.vector() != head.vector || copy.state().digest() != head.digest {
                let (who, has) =
                    (format!("client {}", follower.place()), format!("{} ({})", copy.vector(), copy.state().digest()));
                return Err(Violation::Apart { seconds, who, has, server: described(head) });
            }
            let (should, runs) = (self.servers[0].runs(), follower.runs());
            if should.is_some_and(|should| should != runs) {
                let who = format!("what client {} runs", follower.place());
                let (has, server) = (format!("{runs:?}"), format!("{should:?}"));
                return Err(Violation::Apart { seconds, who, has, server });
            }
        }
        Ok(())
    }

    /// What heads covered is where it must be, and is all that there is.
    fn check_ledger(&self, head: &Head) -> Result<(), Violation> {
        let mut whole = fht_map::MapState::new();
        for increment in self.ledger.increments() {
            let increment = increment?;
            if !self.servers.iter().all(|server| server.holds(&increment)) {
                return Err(Violation::Lost(format!("{}/{}", increment.author, increment.number)));
            }
            whole.apply(&increment);
        }
        if whole.digest() == head.digest { Ok(()) } else { Err(Violation::Sum) }
    }
}

fn described(head: &Head) -> String {
    format!("{} ({})", head.vector, head.digest)
}

/// Everything that the runs of an author took for acknowledged is stored. Runs that learned that
/// their numbers are taken are left out; that never happens to an explorer that uses no number
/// twice.
fn check_author(author: &Author, server: &Server) -> Result<(), Violation> {
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
