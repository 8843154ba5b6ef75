//! Another map that comes to the name of the one that a copy is of.

use super::*;
use fht_proto::{AuthorId, FixedPose, NodeId, NodeKind, Op};
use std::time::Duration;

fn increments(author: u32, count: u64, begun_us: u64) -> Vec<Increment> {
    let author = AuthorId(author);
    let increment = |number: u64| {
        let id = NodeId { author, number: number as u32 };
        let ops = vec![Op::PutNode { id, kind: NodeKind::Support, pose: FixedPose::default() }];
        Increment { author, number, hlc_us: begun_us + number, ops }
    };
    (1..=count).map(increment).collect()
}

fn head(server: &Replica) -> Head {
    Head {
        version: 1,
        vector: server.vector().clone(),
        digest: server.state().digest(),
        ..Head::of_nothing("museum".parse().unwrap_or_else(|error| panic!("{error}")))
    }
}

/// A copy, its keeping up, and what the server has.
struct Site {
    sync: Sync,
    copy: Replica,
    server: Replica,
    now: Instant,
}

impl Site {
    /// The copy has what the server has: ten increments of author 1.
    fn up_to_date() -> Self {
        let sync = Sync::new(SyncConfig::default());
        let mut site = Self { sync, copy: Replica::default(), server: Replica::default(), now: Instant::now() };
        site.put(&increments(1, 10, 1_000));
        site.seconds(3);
        assert_eq!(site.copy.vector(), site.server.vector());
        site
    }

    /// Writers put, the server takes.
    fn put(&mut self, increments: &[Increment]) {
        for increment in increments {
            self.server.accept(increment.clone());
            self.sync.live(&mut self.copy, increment.clone());
        }
    }

    /// Time passes, and the server answers everything.
    fn seconds(&mut self, seconds: u64) {
        for _ in 0..10 * seconds {
            self.now += Duration::from_millis(100);
            while let Some(question) = self.sync.poll(&self.copy, self.now) {
                match question {
                    SyncQuestion::Head => self.sync.head_answered(&self.copy, Some(head(&self.server)), self.now),
                    SyncQuestion::Since(vector) | SyncQuestion::At { have: vector, .. } => {
                        let all = [1, 2].map(|author| increments(author, 10, 1_000 * u64::from(author)));
                        let is_lacking = |increment: &Increment| {
                            let has = |vector: &VersionVector| vector.get(increment.author) >= increment.number;
                            has(self.server.vector()) && !has(&vector)
                        };
                        let increments = all.into_iter().flatten().filter(is_lacking).collect();
                        self.sync.piece(&mut self.copy, Series { increments, ..Series::default() });
                        self.sync.part_ended(&mut self.copy, self.now);
                    }
                }
            }
        }
    }

    fn is_as_the_server(&self) -> bool {
        self.copy.state().digest() == self.server.state().digest()
    }
}

#[test]
fn a_map_that_comes_after_the_old_one_has_gone_is_another_one() {
    let mut site = Site::up_to_date();
    site.sync.map_gone();
    site.server = Replica::default();
    // It is imported while the copy hears of it.
    let new = increments(2, 10, 2_000);
    site.put(&new[..3]);
    site.sync.head_answered(&site.copy, Some(head(&site.server)), site.now);
    site.put(&new[3..]);
    assert_eq!(site.copy.vector().get(AuthorId(2)), 0, "nothing of it is taken into the old copy");
    site.seconds(5);
    assert!(site.is_as_the_server());
    assert_eq!(site.sync.generation(), 1);
}

#[test]
fn a_map_that_takes_the_place_of_the_old_one_at_once_is_another_one() {
    let mut site = Site::up_to_date();
    site.server = Replica::default();
    site.put(&increments(2, 10, 2_000));
    assert_eq!(site.copy.vector().get(AuthorId(2)), 10, "nobody knows yet");
    site.seconds(15);
    assert!(site.is_as_the_server());
    assert_eq!(site.sync.generation(), 1);
}

#[test]
fn the_same_map_that_is_there_again_goes_on() {
    let mut site = Site::up_to_date();
    site.sync.map_gone();
    site.seconds(3);
    assert!(site.is_as_the_server());
    site.put(&increments(2, 4, 2_000));
    assert_eq!((site.copy.vector().get(AuthorId(2)), site.sync.generation()), (4, 0));
    // Another writer was heard by the server alone while it was away.
    site.sync.map_gone();
    increments(2, 10, 2_000).into_iter().for_each(|increment| _ = site.server.accept(increment));
    site.seconds(5);
    assert!(site.is_as_the_server());
    assert_eq!(site.sync.generation(), 0);
}
