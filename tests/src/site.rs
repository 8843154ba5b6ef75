//! A site of several routers with replicated storages and several stateless servers, all of them
//! processes, one of each kind being killed again and again while robots write and ask.
//!
//! A run must show that nothing acknowledged is lost, and that questions are answered in time
//! throughout.
//!
//! | module | idea |
//! | --- | --- |
//! | `machines` | routers and servers as processes |
//! | `load` | the robots that write and ask |
//! | `sessions` | the robots' sessions |
//! | `secured` | certificates and access control, as in `deploy/` |
//! | `strangers` | who attacks it |
//! | `agreement` | what all servers answer, and whether they agree |
//! | `config`, `report` | how a run goes, and what it has shown |

mod agreement;
mod config;
mod load;
mod machines;
mod report;
mod secured;
mod sessions;
mod strangers;

pub use config::SiteConfig;
pub use report::{SiteError, SiteReport};
pub use strangers::{NAME as STRANGERS, attack};

use agreement::{agreement, until_all_answer};
use load::{Asked, Reader, Writer, Written};
use machines::Machines;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use secured::{OPERATOR, Secured};
use sessions::Way;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Runs a site. `say` receives what happens, as text.
///
/// # Errors
/// [`SiteError`]: there is no result.
pub fn run(config: &SiteConfig, say: impl Fn(&str)) -> Result<SiteReport, SiteError> {
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build()?;
    let outcome = runtime.block_on(run_within(config, &say));
    runtime.shutdown_timeout(Duration::from_secs(5));
    outcome
}

async fn run_within(config: &SiteConfig, say: &impl Fn(&str)) -> Result<SiteReport, SiteError> {
    let secured = (!config.attacks.is_empty()).then(|| Secured::make(config)).transpose()?.map(Arc::new);
    let mut machines = Machines::start(config, secured.clone())?;
    let way = Way { endpoints: machines.endpoints().to_vec(), secured };
    let watcher = way.session("operator", OPERATOR, 0).await?;
    until_all_answer(&watcher, config).await?;
    say("all servers are there");

    let written = Arc::new(Written::default());
    load::write_floor(&way.session("explorer", "floor", 0).await?, &written, config.patience).await?;
    let is_over = Arc::new(AtomicBool::new(false));
    let mut writers = Vec::new();
    for index in 0..config.writers {
        let link = way.session("explorer", &format!("writer-{index}"), index).await?;
        let writer = Writer::new(index, config.increments_per_s, Arc::clone(&written));
        writers.push(tokio::spawn(writer.run(link, Arc::clone(&is_over), config.patience)));
    }
    let mut readers = Vec::new();
    for index in 0..config.readers {
        let link = way.session("client", &format!("reader-{index}"), index).await?;
        let reader = Reader::new(index, config.questions_per_s, config.limit);
        let is_over = Arc::clone(&is_over);
        readers.push(tokio::task::spawn_blocking(move || reader.run(&link, &is_over)));
    }

    let strangers =
        |site: &Arc<Secured>| strangers::start(&config.executable, &config.attacks, &site.credentials, &way.endpoints);
    let strangers = way.secured.as_ref().map(strangers).transpose()?;
    if strangers.is_some() {
        say("the attacks begin");
    }
    let kills = kill_in_turns(config, &mut machines, say).await?;
    drop(strangers);
    is_over.store(true, Ordering::Relaxed);

    let mut report = SiteReport { kills, ..SiteReport::default() };
    let mut asked = Asked::default();
    for reader in readers {
        asked.add(reader.await?);
    }
    asked.report_to(&mut report);
    let (mut wire_bytes, mut map_bytes) = (0, 0);
    for writer in writers {
        let progress = writer.await??;
        wire_bytes += progress.wire_bytes;
        map_bytes += progress.map_bytes;
    }
    report.repetition = wire_bytes as f64 / (map_bytes as f64).max(1.0);
    written.report_to(&mut report);

    let expected = written.state();
    let acknowledged = written.acknowledged();
    (report.agree, report.lost) = agreement(&watcher, config, &expected, &acknowledged).await?;
    say("now all servers begin anew");
    machines.begin_anew()?;
    let (agree, lost) = agreement(&watcher, config, &expected, &acknowledged).await?;
    (report.agree_anew, report.lost) = (agree, report.lost.max(lost));
    Ok(report)
}

/// Kills a router and a server every so often and starts them again, until the load ends. Returns
/// how many were killed.
async fn kill_in_turns(config: &SiteConfig, machines: &mut Machines, say: &impl Fn(&str)) -> Result<u64, SiteError> {
    let mut rng = ChaCha8Rng::seed_from_u64(config.seed);
    let begin = Instant::now();
    let until = |time: Duration| tokio::time::sleep_until((begin + time).into());
    let mut kills = 0;
    let times = (1..).map(|round: u32| config.kill_every * round).take_while(|back| *back <= config.duration);
    for back in times {
        until(back.saturating_sub(config.back_after)).await;
        let (router, server) = (rng.random_range(0..config.routers), rng.random_range(0..config.servers));
        machines.kill(router, server)?;
        kills += 2;
        say(&format!("{:4.0} s: router {router} and server {server} are killed", begin.elapsed().as_secs_f64()));
        until(back).await;
        machines.start_again(router, server)?;
    }
    until(config.duration).await;
    Ok(kills)
}
