//! Clients on thin links that break or stall. For figures: `cargo run --release --bin joining`.

use crate::programs::executable;
use fht_client::{LiveReplica, ReplicaConfig};
use fht_proto::{AuthorId, FixedPose, Increment, MapName, NodeId, NodeKind, Op, VersionVector};
use fht_tests::maps::office;
use fht_tests::slow_join::{MapSite, SlowJoinConfig, run};
use fht_tests::thin_link::{LinkShape, ThinLink};
use fht_tests::upload::put_increment;
use std::path::Path;
use std::time::{Duration, Instant};
use zenoh::Wait;
use zenoh::qos::CongestionControl;

fn config(folder: &Path) -> SlowJoinConfig {
    SlowJoinConfig {
        executable: executable().into(),
        data: folder.join("data"),
        shape: LinkShape { bits_per_s: 8e6, delay: Duration::from_millis(50) },
        cuts: 3,
        cut_for: Duration::from_millis(500),
        every: Duration::from_millis(100),
        after: Duration::from_secs(1),
    }
}

#[test]
fn a_client_joins_over_a_link_that_is_cut_and_fetches_hardly_anything_twice() {
    let map: MapName = "office".parse().unwrap();
    // As long as an explored office, and ten times that.
    for times in [1, 10] {
        let folder = tempfile::tempdir().unwrap();
        let report = run(&config(folder.path()), &map, &office(times)).unwrap();
        assert_eq!(report.cut.cuts, 3, "{report:?}");
        assert!(report.refetched() < 0.05, "{report:?}");
        assert!(!report.cut.live_s.is_empty() && !report.whole.live_s.is_empty(), "{report:?}");
    }
}

#[test]
fn a_client_that_takes_nothing_keeps_nobody_waiting() {
    /// Longer than Zenoh waits for a link before it closes it, and shorter than it takes to declare
    /// a silent one dead.
    const STALL: Duration = Duration::from_secs(7);
    /// Shorter than that.
    const SOON: Duration = Duration::from_secs(4);
    let folder = tempfile::tempdir().unwrap();
    let map: MapName = "office".parse().unwrap();
    let site = MapSite::with(&config(folder.path()), &map, &office(1)).unwrap();
    let link = ThinLink::to(&site.endpoint, LinkShape { bits_per_s: 100e6, delay: Duration::ZERO }).unwrap();
    let sessions = [link.endpoint(), &site.endpoint].map(|endpoint| site.session_by(endpoint).unwrap());
    let [stalled, other] =
        ["stalled", "other"].map(|name| (name, &sessions[usize::from(name == "other")])).map(|(name, session)| {
            let replica = LiveReplica::start(session, &map, name, ReplicaConfig::default()).unwrap();
            assert!(replica.wait_for(&site.vector, Duration::from_secs(30)), "{name}");
            replica
        });
    let bulk = sessions[0].declare_subscriber("bulk").callback(|_| ()).wait().unwrap();
    std::thread::sleep(Duration::from_millis(500));

    // More than all buffers on the way hold, with every put waiting for room.
    link.stall(true);
    let begin = Instant::now();
    for _ in 0..200 {
        site.session.put("bulk", vec![0_u8; 100_000]).congestion_control(CongestionControl::Block).wait().unwrap();
    }
    let author = AuthorId::of_robot("writer");
    let mut vector = VersionVector::default();
    for number in 1..=20 {
        let pose = FixedPose::from_metres(0.0, 0.1 * number as f64, 0.0);
        let op = Op::PutNode { id: NodeId { author, number: 0 }, kind: NodeKind::Support, pose };
        put_increment(&site.session, &map, &Increment { author, number, hlc_us: 1_000_000 + number, ops: vec![op] })
            .unwrap();
        vector.set(author, number);
    }
    assert!(other.wait_for(&vector, SOON), "{} after {:?}", other.read().vector(), begin.elapsed());
    assert!(!stalled.read().vector().covers(&vector), "it was no stall");
    std::thread::sleep(STALL.saturating_sub(begin.elapsed()));
    assert_eq!(link.connections(), 1);
    link.stall(false);
    assert!(stalled.wait_for(&vector, Duration::from_secs(30)), "{}", stalled.read().vector());
    assert_eq!(link.connections(), 1, "its transport was closed");
    drop((stalled, other, bulk));
}
