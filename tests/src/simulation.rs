//! A fleet on a bad network, in one thread and simulated time: explorers, an operator, servers and
//! clients, each made of the parts that the programs are made of, over links that lose, delay,
//! repeat, reorder and partition. Explorers are killed and come back. There is one server with a
//! disk, or there are several on replicated storages; a machine may fail at every durable write.
//!
//! A run must show that in the end all copies are one, that nothing acknowledged is lost or has
//! become another increment, and that no release has changed. A seed decides everything.
//!
//! ```text
//! author ── writer ─┐             ┌─ disk, or storages
//! (explorers,       ├── network ──┤  server
//!  operator)        │             └─ refused
//! follower ─────────┘                  ↓
//! (clients)                          ledger: what heads have covered
//! ```
//!
//! | module | idea |
//! | --- | --- |
//! | `world` | everybody at one time, and what must hold in the end |
//! | `network`, `message` | the links, and what they carry |
//! | `author`, `writer` | those who write, and one run of theirs |
//! | `follower` | a client with its copy |
//! | `server`, `refused` | a server, and what it refuses |
//! | `disk`, `storages` | what servers stand on |
//! | `ledger` | what servers have acknowledged |
//! | `config`, `outcome` | how bad a run is, what happened, what must not |

mod author;
mod config;
mod disk;
mod follower;
mod ledger;
mod message;
mod network;
mod outcome;
mod refused;
mod server;
mod storages;
mod world;
mod writer;

pub use config::SimulationConfig;
pub use network::NetworkConfig;
pub use outcome::{SimulationOutcome, Violation};

use author::Author;
use follower::Follower;
use server::Server;
use storages::Site;
use world::World;

/// Runs one seed.
///
/// # Errors
/// [`Violation`]: what went wrong.
pub fn run(seed: u64, config: &SimulationConfig) -> Result<SimulationOutcome, Violation> {
    /// Length of a step, microseconds.
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
    let told = world.authors.iter().map(|author| author.runs().filter(|run| run.is_told).count() as u64).sum();
    let sum = |of: fn(&Server) -> u64| world.servers.iter().map(of).sum::<u64>();
    Ok(SimulationOutcome {
        increments: world.servers[0].head().map_or(0, |head| head.version),
        crashes: sum(Server::crashes) + world.site.as_ref().map_or(0, Site::crashes),
        partitions: network.partitions,
        returns: world.authors.iter().map(Author::returns).sum(),
        told,
        lost: network.lost,
        sent: network.sent,
        releases: world.servers[0].releases(),
        compactions: sum(Server::compactions),
        seconds,
    })
}
