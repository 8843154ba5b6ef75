//! Who gets in and who may do what, over real sessions with mutual TLS: the routers' and sessions'
//! files of `deploy/`, the certificates of its script, and the access control that `map-server
//! access-control` writes.

use crate::site::{
    MOMENT, PATIENCE, Site, ask, ask_with, author, certificates, config, free_endpoint, guarded, head, in_file,
    increment, museum, put, serve, shipped, try_once, write,
};
use fht_proto::api::keys::Key;
use fht_proto::api::reply::{ErrorCode, ErrorReply, Head, MapsReply, Series};
use fht_proto::{
    FixedPoint, FixedPose, Increment, NodeId, Op, Release, ReleaseId, VersionVector, Zone, ZoneRule, encode,
};
use fht_session::SessionConfig;
use map_server::ingest::Retained;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use tokio::time::timeout;
use zenoh::handlers::FifoChannelHandler;
use zenoh::pubsub::Subscriber;
use zenoh::sample::Sample;
use zenoh::{Session, Wait};

type Heard = Subscriber<FifoChannelHandler<Sample>>;

async fn hears(subscriber: &Heard) -> Option<(String, Vec<u8>)> {
    let sample = timeout(PATIENCE, subscriber.recv_async()).await.ok()?.ok()?;
    Some((sample.key_expr().to_string(), sample.payload().to_bytes().into_owned()))
}

async fn hears_nothing(subscriber: &Heard) -> bool {
    timeout(MOMENT, subscriber.recv_async()).await.is_err()
}

/// How long a message may take, whatever else runs.
async fn hears_no_lies(subscriber: &Heard) -> bool {
    let deadline = tokio::time::Instant::now() + MOMENT;
    while let Ok(sample) = tokio::time::timeout_at(deadline, subscriber.recv_async()).await {
        if *sample.unwrap().payload().to_bytes() == *b"lies" {
            return false;
        }
    }
    true
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn nobody_gets_in_without_a_certificate_of_this_site() {
    let endpoint = free_endpoint();
    for (file, own) in [("router.json5", "router-a"), ("server-alone.json5", "server-maps")] {
        // As shipped, and with access control.
        for text in [shipped(file, own, &[&endpoint], &[]), guarded(file, own, &[&endpoint])] {
            let router = zenoh::open(config(&text)).await.unwrap();
            let ours = shipped("explorer.json5", "explorer-ana", &[], &[&endpoint]);
            try_once(config(&ours)).await.unwrap().close().await.unwrap();

            let without = ours.replace("enable_mtls: true", "enable_mtls: false");
            assert!(try_once(config(&without)).await.is_err(), "{file}: without a certificate");
            let elsewhere = certificates().join("elsewhere/explorer-ana");
            let ana = certificates().join("explorer-ana");
            let foreign = ours.replace(ana.to_str().unwrap(), elsewhere.to_str().unwrap());
            assert!(try_once(config(&foreign)).await.is_err(), "{file}: with another authority's certificate");
            let plain = ours.replace("tls/", "tcp/").replace("[\"tls\"]", "[\"tcp\"]");
            assert!(try_once(config(&plain)).await.is_err(), "{file}: without TLS");
            // The other way round: a robot does not speak to another site's router.
            let authority = certificates().join("elsewhere/ca.pem");
            let astray = ours.replace(certificates().join("ca.pem").to_str().unwrap(), authority.to_str().unwrap());
            assert!(try_once(config(&astray)).await.is_err(), "{file}: to a router of another authority");
            // While the authority is being replaced, a file has both.
            let both = tempfile::NamedTempFile::new().unwrap();
            let read = |file: &Path| std::fs::read_to_string(file).unwrap();
            std::fs::write(&both, read(&authority) + &read(&certificates().join("ca.pem"))).unwrap();
            let between = astray.replace(authority.to_str().unwrap(), both.path().to_str().unwrap());
            try_once(config(&between)).await.unwrap().close().await.unwrap();
            router.close().await.unwrap();
        }
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn sessions_speak_tls_only_and_robots_cannot_pose_as_routers() {
    let endpoint = free_endpoint();
    // A robot's certificate is not valid for listening, whatever its owner tries.
    let impostor = zenoh::open(config(&shipped("router.json5", "explorer-ana", &[&endpoint], &[]))).await.unwrap();
    for (file, own) in [
        ("explorer.json5", "explorer-ana"),
        ("client.json5", "client-tug"),
        ("operator.json5", "operator-desk"),
        ("server.json5", "server-maps"),
    ] {
        let text = shipped(file, own, &[], &[&endpoint]);
        assert!(try_once(config(&text)).await.is_err(), "{file}: to a robot that plays a router");
        let mut plain = config(&text);
        plain.insert_json5("connect/endpoints", &format!("[\"{}\"]", endpoint.replace("tls/", "tcp/"))).unwrap();
        let refused = try_once(plain).await.err().map(|error| error.to_string()).unwrap_or_default();
        assert!(!refused.is_empty(), "{file}: over TCP");
    }
    impostor.close().await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn increments_are_written_under_the_name_of_the_certificate_and_by_no_client() {
    let site = Site::start().await;
    let ana = site.session("explorer.json5", "explorer-ana").await;
    let tug = site.session("client.json5", "client-tug").await;
    let desk = site.session("operator.json5", "operator-desk").await;
    let stranger = site.session("explorer.json5", "explorer-stranger").await;
    let live = tug.declare_subscriber("fht/museum/inc/**").await.unwrap();
    write(&ana, "ana", 1).await;
    assert!(hears(&live).await.is_some(), "a client hears increments as they are put");

    for _ in 0..3 {
        // As itself, and as others: the payload's author agrees with the key, so the server alone
        // would accept it.
        put(&tug, "tug", "tug", 1).await;
        put(&tug, "ana", "ana", 2).await;
        put(&ana, "ben", "ben", 1).await;
        put(&ana, "desk", "desk", 1).await;
        put(&desk, "ana", "ana", 2).await;
        put(&stranger, "stranger", "stranger", 1).await;
        put(&stranger, "ana", "ana", 2).await;
        // Wildcards are wider than what is allowed.
        ana.put("fht/museum/inc/*/1", encode(&increment("ben", 1)).unwrap()).await.unwrap();
        ana.delete(Key::increment(&museum(), author("ana"), 1).to_string()).await.unwrap();
    }
    tokio::time::sleep(MOMENT).await;
    let after = head(&tug).await;
    assert_eq!((after.version, after.refused), (1, 0), "none of these has come as far as the server");

    assert_eq!(write(&desk, "desk", 1).await.version, 2);
    let end = write(&ana, "ana", 2).await;
    assert_eq!((end.version, end.vector.get(author("tug")), end.vector.get(author("ben"))), (3, 0, 0));
    for session in [ana, tug, desk, stranger] {
        session.close().await.unwrap();
    }
    site.end().await;
}

/// Certificates and keys let an explorer write; what it writes, the server judges.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_explorers_certificate_decides_nothing_that_is_for_operators() {
    let site = Site::start().await;
    let ana = site.session("explorer.json5", "explorer-ana").await;
    let ben = site.session("explorer.json5", "explorer-ben").await;
    let desk = site.session("operator.json5", "operator-desk").await;
    for number in 1..=8 {
        write(&ana, "ana", number).await;
    }
    let of = |robot: &str, number: u64, ops: Vec<Op>| Increment { ops, ..increment(robot, number) };
    let send = async |session: &Session, increment: &Increment| {
        let key = Key::increment(&museum(), increment.author, increment.number).to_string();
        session.put(key, encode(increment).unwrap()).await.unwrap();
    };
    let place = |x| Op::SetPlace { name: "dock".parse().unwrap(), pose: Some(FixedPose::from_metres(x, 0.0, 0.0)) };
    let corners = [(0, 0), (1000, 0), (0, 1000)].map(|(x_mm, y_mm)| FixedPoint { x_mm, y_mm }).to_vec();
    let zone =
        |rule| Op::SetZone { name: "stairs".parse().unwrap(), zone: Some(Zone { rule, corners: corners.clone() }) };
    let release = ReleaseId { author: author("desk"), name: "first".parse().unwrap() };
    let made = Release { vector: VersionVector::default(), digest: head(&desk).await.digest };
    let decided = of(
        "desk",
        1,
        vec![place(1.0), zone(ZoneRule::KeepOut), Op::PutRelease { name: release.name.clone(), release: made }],
    );
    send(&desk, &decided).await;
    let before = until(&ana, |head| head.vector.get(author("desk")) == 1).await;

    let refusals = ben.declare_subscriber(Key::refused(&museum(), author("ben")).to_string()).await.unwrap();
    let nodes = (1..=8).map(|number| Op::RemoveNode { id: NodeId { author: author("ana"), number } }).collect();
    let attacks = [
        vec![place(2.0)],
        vec![zone(ZoneRule::SpeedLimit(1000))],
        vec![Op::RemoveRelease { id: release }],
        vec![Op::SetPose { id: NodeId { author: author("ana"), number: 1 }, pose: FixedPose::default() }],
        nodes,
    ];
    for ops in attacks {
        let attack = of("ben", 1, ops);
        let begin = std::time::Instant::now();
        let told: ErrorReply = loop {
            send(&ben, &attack).await;
            if let Ok(Ok(sample)) = timeout(MOMENT, refusals.recv_async()).await {
                break serde_json::from_slice(&sample.payload().to_bytes()).unwrap();
            }
            assert!(begin.elapsed() < PATIENCE, "nobody refuses {attack:?}");
        };
        assert!(told.code == ErrorCode::NotPermitted && told.message.starts_with("ben"), "{told}");
    }
    let after = head(&ana).await;
    assert_eq!((after.version, after.digest), (before.version, before.digest));
    // What is an explorer's it writes, beside everybody else.
    write(&ben, "ben", 1).await;
    write(&ana, "ana", 9).await;
    send(&desk, &of("desk", 2, vec![place(3.0)])).await;
    until(&desk, |head| head.vector.get(author("desk")) == 2).await;
    for session in [ana, ben, desk] {
        session.close().await.unwrap();
    }
    site.end().await;
}

async fn until(session: &Session, done: impl Fn(&Head) -> bool) -> Head {
    let begin = std::time::Instant::now();
    loop {
        let head = head(session).await;
        if done(&head) {
            return head;
        }
        assert!(begin.elapsed() < PATIENCE, "{head:?}");
        tokio::time::sleep(MOMENT / 8).await;
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_client_can_ask_and_listen_but_not_play_the_server() {
    let site = Site::start().await;
    let ana = site.session("explorer.json5", "explorer-ana").await;
    let tug = site.session("client.json5", "client-tug").await;
    write(&ana, "ana", 1).await;
    // Everything that a robot asks, wildcards and mistakes included: each is answered, at once.
    for selector in
        ["fht/maps", "fht/*", "fht/*/head", "fht/museum/head", "fht/museum/nodes?near=0,0", "fht/museum/since"]
    {
        let replies = ask(&tug, selector).await;
        assert!(replies.iter().any(Result::is_ok), "{selector}: {replies:?}");
    }
    for selector in ["fht/museum/route", "fht/museum/path?from=0,0", "fht/louvre/head"] {
        let replies = ask(&tug, selector).await;
        let is_told = |reply: &Result<Vec<u8>, String>| {
            reply.as_ref().is_err_and(|text| serde_json::from_str::<ErrorReply>(text).is_ok())
        };
        assert!(replies.iter().any(is_told), "{selector}: {replies:?}");
    }

    let heads = ana.declare_subscriber("fht/museum/head").await.unwrap();
    let refusals = ana.declare_subscriber(Key::refused(&museum(), author("ana")).to_string()).await.unwrap();
    write(&ana, "ana", 2).await;
    assert!(hears(&heads).await.is_some(), "the server's");
    while heads.try_recv().unwrap().is_some() {}
    let asked = Arc::new(AtomicU64::new(0));
    let counting = Arc::clone(&asked);
    let _false_server = tug
        .declare_queryable("fht/**")
        .complete(true)
        .callback(move |query| {
            counting.fetch_add(1, Ordering::Relaxed);
            let _ = query.reply(query.key_expr().clone(), "lies").wait();
        })
        .await
        .unwrap();
    tug.put("fht/museum/head", "lies").await.unwrap();
    tug.put(Key::refused(&museum(), author("ana")).to_string(), "lies").await.unwrap();
    assert!(hears_no_lies(&heads).await && hears_no_lies(&refusals).await);
    for _ in 0..5 {
        assert_eq!(head(&ana).await.version, 2);
    }
    assert_eq!(asked.load(Ordering::Relaxed), 0, "nobody asks a client");
    for session in [ana, tug] {
        session.close().await.unwrap();
    }
    site.end().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_robot_speaks_of_itself_only() {
    let site = Site::start().await;
    let ana = site.session("explorer.json5", "explorer-ana").await;
    let tug = site.session("client.json5", "client-tug").await;
    let robots = ana.declare_subscriber("fht/museum/robots/**").await.unwrap();
    let tokens = ana.liveliness().declare_subscriber("fht/museum/robots/*").await.unwrap();
    tokio::time::sleep(MOMENT).await;
    for topic in ["pose", "status", "blocked", "goal"] {
        tug.put(format!("fht/museum/robots/ana/{topic}"), "lies").await.unwrap();
        tug.put(format!("fht/museum/robots/*/{topic}"), "lies").await.unwrap();
        tug.put(format!("fht/museum/robots/tug/{topic}"), "truth").await.unwrap();
        let heard = hears(&robots).await;
        assert_eq!(heard, Some((format!("fht/museum/robots/tug/{topic}"), b"truth".to_vec())));
    }
    assert!(hears_nothing(&robots).await);
    // A publisher first asks whether anybody listens; that must be answered, too.
    let poses = tug.declare_publisher("fht/museum/robots/tug/pose").await.unwrap();
    tokio::time::sleep(MOMENT).await;
    poses.put("truth").await.unwrap();
    assert!(hears(&robots).await.is_some());

    let _as_another = tug.liveliness().declare_token("fht/museum/robots/ben").await.unwrap();
    let _as_itself = tug.liveliness().declare_token("fht/museum/robots/tug").await.unwrap();
    assert_eq!(hears(&tokens).await.unwrap().0, "fht/museum/robots/tug");
    assert!(hears_nothing(&tokens).await);
    // Who watches tokens may ask for them in vain (docs/upstream.md).
    let ben = site.session("explorer.json5", "explorer-ben").await;
    let here = ben.liveliness().get("fht/museum/robots/*").await.unwrap();
    let mut present = Vec::new();
    while let Ok(reply) = here.recv_async().await {
        present.push(reply.result().unwrap().key_expr().to_string());
    }
    assert_eq!(present, ["fht/museum/robots/tug"]);
    for session in [ana, ben, tug] {
        session.close().await.unwrap();
    }
    site.end().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn operators_send_robots_and_no_robot_sends_another_or_answers_for_it() {
    let site = Site::start().await;
    let ana = site.session("explorer.json5", "explorer-ana").await;
    let tug = site.session("client.json5", "client-tug").await;
    let desk = site.session("operator.json5", "operator-desk").await;
    let answering = async |keys: &str, word: &'static str| {
        let asked = Arc::new(AtomicU64::new(0));
        let counting = Arc::clone(&asked);
        let answer = move |query: zenoh::query::Query| {
            counting.fetch_add(1, Ordering::Relaxed);
            let under = query.key_expr().as_str().replace('*', "tug");
            let _ = query.reply(under, word).wait();
        };
        (tug.declare_queryable(keys).complete(true).callback(answer).await.unwrap(), asked)
    };
    let (_own, sent) = answering("fht/museum/robots/tug/goal/**", "on my way").await;
    let goals = tug.declare_subscriber("fht/museum/robots/tug/goal/**").await.unwrap();
    tokio::time::sleep(MOMENT).await;

    let goal = "fht/museum/robots/tug/goal?id=1;to=dock";
    for key in [goal, "fht/museum/robots/tug/goal/cancel", "fht/museum/robots/*/goal/status"] {
        assert!(ask(&desk, key).await.contains(&Ok(b"on my way".to_vec())), "{key}");
    }
    desk.put("fht/museum/robots/tug/goal", "so be it").await.unwrap();
    assert!(hears(&goals).await.is_some());

    let (_of_another, lied) = answering("fht/museum/robots/ana/goal/**", "lies").await;
    tokio::time::sleep(MOMENT).await;
    let before = sent.load(Ordering::Relaxed);
    let tries = [
        goal,
        "fht/museum/robots/tug/goal/cancel",
        "fht/*/robots/*/goal",
        "fht/museum/robots/**",
        "fht/**/goal/cancel",
    ];
    for key in tries {
        let replies = ask(&ana, key).await;
        assert!(replies.iter().all(Result::is_err), "{key}: {replies:?}");
    }
    for key in ["tug/goal", "tug/goal/cancel", "*/goal", "**"] {
        ana.put(format!("fht/museum/robots/{key}"), "lies").await.unwrap();
    }
    assert!(hears_nothing(&goals).await);
    assert_eq!(sent.load(Ordering::Relaxed), before, "no robot has reached another");
    assert!(ask(&ana, "fht/museum/robots/tug/goal/status").await.contains(&Ok(b"on my way".to_vec())));
    assert!(ask(&desk, "fht/museum/robots/ana/goal?id=1;to=dock").await.iter().all(Result::is_err));
    assert_eq!(lied.load(Ordering::Relaxed), 0, "nobody asks a robot for another");
    for session in [ana, tug, desk] {
        session.close().await.unwrap();
    }
    site.end().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn operators_give_orders_and_servers_answer_and_refuse() {
    let site = Site::start().await;
    let ana = site.session("explorer.json5", "explorer-ana").await;
    let ben = site.session("explorer.json5", "explorer-ben").await;
    let tug = site.session("client.json5", "client-tug").await;
    let desk = site.session("operator.json5", "operator-desk").await;
    let server = site.session("server.json5", "server-maps").await;
    let puts = server.declare_subscriber("fht/*/admin/**").await.unwrap();
    for number in 1..=12 {
        write(&ana, "ana", number).await;
    }
    let series = encode(&Series { increments: vec![increment("ana", 1)], ..Series::default() }).unwrap();
    for session in [&ana, &tug] {
        let deletion = br#"{"grace_s": 0, "reason": "mine", "by": "desk"}"#.to_vec();
        let replies = ask_with(session, "fht/museum/admin/delete", deletion).await;
        assert!(replies.iter().all(Result::is_err), "{replies:?}");
        for order in [
            "fht/museum/admin/retain",
            "fht/museum/admin/undelete",
            "fht/museum/**",
            "fht/**",
            "fht/*/admin/*",
            "fht/museum/*/retain",
        ] {
            let replies = ask(session, &format!("{order}?keep=1")).await;
            assert!(replies.iter().all(Result::is_err), "{order}: {replies:?}");
        }
        let replies = ask_with(session, "fht/annex/admin/import", series.clone()).await;
        assert!(replies.iter().all(Result::is_err), "{replies:?}");
        session.put("fht/museum/admin/retain", "mine").await.unwrap();
    }
    assert!(hears_nothing(&puts).await);
    let maps: MapsReply = serde_json::from_slice(ask(&desk, "fht/maps").await[0].as_ref().unwrap()).unwrap();
    assert_eq!(maps.maps.iter().map(|head| (&head.map, head.version)).collect::<Vec<_>>(), [(&museum(), 12)]);
    let folded: Retained =
        serde_json::from_slice(ask(&desk, "fht/museum/admin/retain?keep=1").await[0].as_ref().unwrap()).unwrap();
    assert_eq!(folded.folded, 11, "nobody has had it folded before");
    let imported: Head =
        serde_json::from_slice(ask_with(&desk, "fht/annex/admin/import", series).await[0].as_ref().unwrap()).unwrap();
    assert_eq!((imported.map.as_str(), imported.version), ("annex", 1));
    desk.put("fht/museum/admin/retain", "so be it").await.unwrap();
    assert!(hears(&puts).await.is_some());

    let heard_by_ana = ana.declare_subscriber(Key::refused(&museum(), author("ana")).to_string()).await.unwrap();
    let of_another = ana.declare_subscriber(Key::refused(&museum(), author("ben")).to_string()).await.unwrap();
    let of_all = tug.declare_subscriber("fht/**").await.unwrap();
    let heard_by_desk = desk.declare_subscriber("fht/museum/refused/*").await.unwrap();
    tokio::time::sleep(MOMENT).await;
    // Under its own key, but as somebody else: the routers let it through, and the server does not.
    let is_told = |heard: Option<(String, Vec<u8>)>| serde_json::from_slice::<ErrorReply>(&heard.unwrap().1).is_ok();
    put(&ana, "ben", "ana", 13).await;
    assert!(is_told(hears(&heard_by_ana).await) && is_told(hears(&heard_by_desk).await));
    put(&ben, "ana", "ben", 1).await;
    assert!(is_told(hears(&heard_by_desk).await));
    assert!(hears_nothing(&of_another).await && hears_nothing(&of_all).await);
    for session in [ana, ben, tug, desk, server] {
        session.close().await.unwrap();
    }
    site.end().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_map_server_alone_guards_itself() {
    let dir = tempfile::tempdir().unwrap();
    let endpoint = free_endpoint();
    let file = in_file(dir.path(), "server", &guarded("server-alone.json5", "server-maps", &[&endpoint]));
    let (stop, server) = serve(&dir.path().join("data"), file);
    let session = async |name: &str, file: &str, own: &str| {
        let file = in_file(dir.path(), name, &shipped(file, own, &[], &[&endpoint]));
        fht_session::open(&SessionConfig::from_options(Vec::new(), Some(file))).await.unwrap()
    };
    let ana = session("ana", "explorer.json5", "explorer-ana").await;
    let tug = session("tug", "client.json5", "client-tug").await;
    write(&ana, "ana", 1).await;
    put(&tug, "tug", "tug", 1).await;
    put(&tug, "ana", "ana", 2).await;
    tokio::time::sleep(MOMENT).await;
    assert_eq!(head(&tug).await.version, 1);
    ana.close().await.unwrap();
    tug.close().await.unwrap();
    stop.send(()).unwrap();
    server.await.unwrap().unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_robot_finds_the_router_that_is_there() {
    let (dead, alive) = (free_endpoint(), free_endpoint());
    let router = zenoh::open(config(&shipped("router.json5", "router-a", &[&alive], &[]))).await.unwrap();
    let dir = tempfile::tempdir().unwrap();
    let file = in_file(dir.path(), "ana", &shipped("explorer.json5", "explorer-ana", &[], &[&dead, &alive]));
    let link = SessionConfig::from_options(Vec::new(), Some(file));
    timeout(PATIENCE, fht_session::open(&link)).await.expect("no end").unwrap().close().await.unwrap();
    router.close().await.unwrap();
}
