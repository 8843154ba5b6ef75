//! Puts increments over a session, and again what the server lacks.

use super::PublishError;
use super::head::{ANSWER_TIMEOUT, ASK_AGAIN, Answer, ask_head};
use super::progress::{Progress, ServerLoss};
use super::spool::Spool;
use super::verify::Verified;
use super::window::{Backlog, Window, WindowConfig};
use fht_client::read_head;
use fht_proto::api::deletion::MapDeletion;
use fht_proto::api::keys::{Key, Topic};
use fht_proto::api::reply::{ErrorReply, Head, Series};
use fht_proto::{AuthorId, CodecError, Increment, MapName, VersionVector, decode, encode};
use std::sync::Arc;
use std::time::Instant;
use tokio::sync::{Notify, mpsc, watch};
use zenoh::bytes::Encoding;
use zenoh::handlers::RingChannel;
use zenoh::qos::{CongestionControl, Priority};
use zenoh::query::ConsolidationMode;

/// How many of them are taken at a time, and written to the disk at once.
const BATCH: usize = 64;
/// About how much is read back at a time, bytes.
const PART_BYTES: usize = 256 << 10;

/// Puts increments, and keeps them until the server has them.
pub(super) struct Publisher {
    session: zenoh::Session,
    map: MapName,
    author: AuthorId,
    window: Window,
    verified: Verified,
    spool: Option<Spool>,
    report: watch::Sender<Progress>,
    /// So many answers in a row had less than was acknowledged.
    short_answers: u32,
    pub(super) leave: Arc<Notify>,
}

impl Publisher {
    /// Begins with `backlog`, which is in `spool` if there is one.
    pub(super) fn new(
        session: zenoh::Session,
        map: MapName,
        author: AuthorId,
        backlog: Backlog,
        spool: Option<Spool>,
        window: WindowConfig,
    ) -> Self {
        let begun = Progress { written: backlog.written(), acknowledged: backlog.acknowledged, ..Progress::default() };
        let verified = Verified::after(author, backlog.acknowledged);
        let window = Window::of_backlog(window, backlog);
        let (report, leave) = (watch::Sender::new(begun), Arc::new(Notify::new()));
        Self { session, map, author, window, verified, spool, report, short_answers: 0, leave }
    }

    /// How far it has come.
    pub(super) fn progress(&self) -> watch::Receiver<Progress> {
        self.report.subscribe()
    }

    /// Whether all is acknowledged.
    pub(super) fn is_done(&self) -> bool {
        self.window.is_empty()
    }

    /// Before anything of the backlog is put: reads back what the server has of it at `head`. It
    /// may have more, if a run that did not know of the backlog went on from there.
    pub(super) async fn verify(&mut self, mut head: Head) -> Result<(), PublishError> {
        let stored = head.vector.get(self.author).min(self.report.borrow().written);
        head.vector.set(self.author, stored);
        while self.verified.upto() < stored {
            if !self.take_head(head.clone()).await? {
                tokio::time::sleep(ASK_AGAIN).await;
            }
        }
        Ok(())
    }

    /// Publishes the backlog and what is `incoming`, until that is closed and all is acknowledged.
    pub(super) async fn run(mut self, mut incoming: mpsc::Receiver<Increment>) -> Result<Progress, PublishError> {
        // Rings: the newest head is the only one that counts, and nobody waits for a slow robot.
        let head_key = Key::topic(&self.map, Topic::Head).to_string();
        let heads = self.session.declare_subscriber(head_key).with(RingChannel::new(1)).await?;
        let refused_key = Key::refused(&self.map, self.author).to_string();
        let refusals = self.session.declare_subscriber(refused_key).with(RingChannel::new(8)).await?;
        let leave = Arc::clone(&self.leave);
        let mut is_open = true;
        let mut batch = Vec::with_capacity(BATCH);
        loop {
            self.put_all().await?;
            if !is_open && self.window.is_empty() {
                return Ok(self.report.borrow().clone());
            }
            let ask_at = self.window.ask_at();
            tokio::select! {
                count = incoming.recv_many(&mut batch, BATCH), if is_open => {
                    is_open = count > 0;
                    self.add(batch.drain(..)).await?;
                }
                () = leave.notified() => {
                    while let Ok(increment) = incoming.try_recv() {
                        batch.push(increment);
                    }
                    self.add(batch.drain(..)).await?;
                    return Ok(self.report.borrow().clone());
                }
                head = heads.recv_async() => match read_head(&head?.payload().to_bytes(), &self.map) {
                    // What it has taken counts, whatever is to become of it.
                    Ok(head) => {
                        let deletion = head.deletion.clone();
                        self.take_head(head).await?;
                        self.check_deletion(deletion.as_ref())?;
                    }
                    Err(reason) => tracing::warn!("a head that cannot be used: {reason}"),
                },
                refusal = refusals.recv_async() => {
                    let refusal = read_refusal(&refusal?.payload().to_bytes())?;
                    self.report.send_modify(|progress| progress.refusal = refusal);
                }
                () = tokio::time::sleep_until(ask_at.unwrap_or_else(Instant::now).into()), if ask_at.is_some() => {
                    self.ask().await?;
                }
            }
        }
    }

    /// Nothing more is taken for a map that will be deleted.
    fn check_deletion(&self, deletion: Option<&MapDeletion>) -> Result<(), PublishError> {
        deletion.map_or(Ok(()), |deletion| Err(PublishError::Refused(deletion.refusal(&self.map))))
    }

    async fn add(&mut self, increments: impl Iterator<Item = Increment>) -> Result<(), PublishError> {
        let encoded = increments.map(|increment| Ok((increment.number, encode(&increment)?)));
        let encoded: Vec<(u64, Vec<u8>)> = encoded.collect::<Result<_, CodecError>>()?;
        if let Some(spool) = self.spool.as_ref().filter(|_| !encoded.is_empty()) {
            spool.add(encoded.clone()).await?;
        }
        for (number, bytes) in encoded {
            self.report.send_modify(|progress| {
                progress.written = number;
                progress.map_bytes += bytes.len() as u64;
            });
            self.window.push(number, bytes);
        }
        Ok(())
    }

    async fn put_all(&mut self) -> Result<(), PublishError> {
        while let Some((number, bytes)) = self.window.next() {
            let key = Key::increment(&self.map, self.author, number).to_string();
            self.report.send_modify(|progress| progress.wire_bytes += bytes.len() as u64);
            self.session
                .put(key, bytes)
                .encoding(Encoding::APPLICATION_OCTET_STREAM)
                .congestion_control(CongestionControl::Block)
                .priority(Priority::Data)
                .await?;
            self.window.put(Instant::now());
        }
        Ok(())
    }

    /// Takes a head in; returns whether it acknowledges more than was known.
    async fn take_head(&mut self, head: Head) -> Result<bool, PublishError> {
        self.window.check(head.vector.get(self.author))?;
        if let Some(have) = self.verified.lacking(&head.vector) {
            self.read_back(&have).await?;
        }
        let is_news = self.window.acknowledge(self.verified.upto(), Instant::now())?;
        self.report.send_modify(|progress| {
            progress.acknowledged = self.window.acknowledged();
            progress.head = Some(head);
            progress.is_unanswered = false;
            if is_news {
                progress.refusal = None;
            }
        });
        if let Some(spool) = self.spool.as_ref().filter(|_| is_news) {
            spool.acknowledge(self.window.acknowledged()).await?;
        }
        Ok(is_news)
    }

    /// Reads back what the server has beyond `have`, as far as it comes. What is lacking is asked
    /// for at the next head.
    async fn read_back(&mut self, have: &VersionVector) -> Result<(), PublishError> {
        let key = Key::topic(&self.map, Topic::Since);
        let selector = format!("{key}?vector={have};max_bytes={PART_BYTES}");
        let question = self.session.get(selector).timeout(ANSWER_TIMEOUT).consolidation(ConsolidationMode::None);
        let answers = question.await?;
        while let Ok(answer) = answers.recv_async().await {
            let Ok(sample) = answer.result() else { continue };
            match decode::<Series>(&sample.payload().to_bytes()) {
                Ok(piece) => self.verified.compare(&piece, &self.window)?,
                Err(error) => tracing::warn!("what the server has cannot be read back: {error}"),
            }
        }
        Ok(())
    }

    /// The server was asked, and has increments up to `has`. One of several servers may lag behind
    /// for a moment; what is still so then was lost, and is said once.
    fn watch_for_loss(&mut self, has: u64) {
        /// Answers in a row.
        const ENOUGH: u32 = 3;
        let acknowledged = self.window.acknowledged();
        self.short_answers = if has < acknowledged { self.short_answers.saturating_add(1) } else { 0 };
        let loss = (self.short_answers >= ENOUGH).then_some(ServerLoss { has, acknowledged });
        if let (Some(loss), ENOUGH) = (loss, self.short_answers) {
            // Robots show it, unlike most of what publishing has to say.
            tracing::warn!(target: "mapper::notice", "the map server has lost increments of this robot: {loss}");
        }
        self.report.send_modify(|progress| progress.loss = loss);
    }

    /// There is no news: the server may be new, or increments or heads were lost. Asks, and sends
    /// again from where the server is.
    async fn ask(&mut self) -> Result<(), PublishError> {
        let answer = ask_head(&self.session, &self.map).await?;
        let is_unanswered = matches!(answer, Answer::None { is_silent: true, .. });
        self.report.send_modify(|progress| progress.is_unanswered = is_unanswered);
        let is_news = match answer {
            Answer::Head(head) => {
                let deletion = head.deletion.clone();
                self.watch_for_loss(head.vector.get(self.author));
                let is_news = self.take_head(*head).await?;
                self.check_deletion(deletion.as_ref())?;
                is_news
            }
            Answer::NoMap => false,
            Answer::None { reason, .. } => {
                tracing::debug!("the head is not known: {reason}");
                self.window.unanswered(Instant::now());
                return Ok(());
            }
        };
        if !is_news {
            self.window.lost();
        }
        Ok(())
    }
}

/// A refusal that may be none later; if it cannot be read, none.
fn read_refusal(payload: &[u8]) -> Result<Option<ErrorReply>, PublishError> {
    match serde_json::from_slice::<ErrorReply>(payload) {
        Ok(reply) if reply.code.is_permanent_refusal() => Err(PublishError::Refused(reply)),
        Ok(reply) => {
            tracing::warn!("the server refused an increment: {reply}");
            Ok(Some(reply))
        }
        Err(error) => {
            tracing::warn!("a refusal that cannot be read: {error}");
            Ok(None)
        }
    }
}
