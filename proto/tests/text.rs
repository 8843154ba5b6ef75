//! What is written as text reads back: keys, ids, vectors, digests, places. Other texts are
//! refused.
#![allow(clippy::unwrap_used)] // tests may panic

use fht_proto::api::compact::CompactPath;
use fht_proto::api::keys::{AdminAction, GoalTopic, Key, RobotTopic, Topic};
use fht_proto::api::reply::{ErrorCode, ErrorReply, Head, PlaceRef, parse_point};
use fht_proto::{AuthorId, Digest, FixedPoint, FixedPose, MapName, NodeId, Rect, VersionVector, decode};
use proptest::prelude::*;

fn map() -> impl Strategy<Value = MapName> {
    "[a-zA-Z0-9_-]{1,64}".prop_map(|name| name.parse().unwrap())
}

fn key() -> impl Strategy<Value = Key> {
    let robot = || "[a-zA-Z0-9_-]{1,64}";
    prop_oneof![
        Just(Key::Maps),
        (map(), any::<u32>(), 1_u64..).prop_map(|(map, author, number)| Key::increment(&map, AuthorId(author), number)),
        (map(), prop::sample::select(Topic::ALL.to_vec())).prop_map(|(map, topic)| Key::topic(&map, topic)),
        (map(), any::<u32>()).prop_map(|(map, author)| Key::refused(&map, AuthorId(author))),
        (map(), robot()).prop_map(|(map, robot)| Key::Robot { map, robot }),
        (map(), robot(), prop::sample::select(RobotTopic::ALL.to_vec()))
            .prop_map(|(map, robot, topic)| Key::robot(&map, &robot, topic)),
        (map(), robot(), prop::sample::select(GoalTopic::ALL.to_vec()))
            .prop_map(|(map, robot, topic)| Key::goal(&map, &robot, topic)),
        (map(), prop::sample::select(AdminAction::ALL.to_vec())).prop_map(|(map, action)| Key::Admin { map, action }),
    ]
}

proptest! {
    #[test]
    fn keys_read_back(key in key()) {
        prop_assert_eq!(key.to_string().parse::<Key>().unwrap(), key);
    }

    #[test]
    fn a_key_has_one_spelling(text in "fht/[a-z*$]{0,3}/(inc|head|robots|path|refused|admin)?(/[0-9a-f]{0,9}){0,3}") {
        if let Ok(key) = text.parse::<Key>() {
            prop_assert_eq!(key.to_string(), text);
        }
    }

    #[test]
    fn any_text_is_read_without_panic(text in "\\PC{0,40}") {
        let _ = text.parse::<Key>();
        let _ = text.parse::<NodeId>();
        let _ = text.parse::<VersionVector>();
        let _ = text.parse::<PlaceRef>();
        let _ = text.parse::<Digest>();
        let _ = decode::<CompactPath>(text.as_bytes());
    }

    #[test]
    fn node_ids_read_back(author: u32, number: u32) {
        let id = NodeId { author: AuthorId(author), number };
        prop_assert_eq!(id.to_string().parse::<NodeId>().unwrap(), id);
        prop_assert_eq!(id.to_string().parse::<PlaceRef>().unwrap(), PlaceRef::Node(id));
    }

    #[test]
    fn vectors_read_back(counts in prop::collection::btree_map(any::<u32>(), 1_u64.., 0..20)) {
        let mut vector = VersionVector::default();
        for (&author, &count) in &counts {
            vector.set(AuthorId(author), count);
        }
        prop_assert_eq!(vector.to_string().parse::<VersionVector>().unwrap(), vector);
    }

    #[test]
    fn digests_read_back(bytes: [u8; 32]) {
        let text = serde_json::to_string(&Digest(bytes)).unwrap();
        prop_assert_eq!(serde_json::from_str::<Digest>(&text).unwrap(), Digest(bytes));
    }

    #[test]
    fn points_read_back(x_mm in -100_000_000..=100_000_000_i32, y_mm in -100_000_000..=100_000_000_i32) {
        let point = FixedPoint { x_mm, y_mm };
        prop_assert_eq!(parse_point(&format!("{},{}", point.x(), point.y())).unwrap(), point);
        prop_assert_eq!(FixedPoint::from_metres(point.x(), point.y()), point);
    }

    #[test]
    fn yaw_wraps(yaw in -100.0..100.0_f64) {
        let stored = FixedPose::from_metres(0.0, 0.0, yaw).yaw();
        let difference = (stored - yaw).sin().atan2((stored - yaw).cos());
        prop_assert!(difference.abs() <= 0.51e-4);
    }

    #[test]
    fn a_stored_rectangle_stays_inside(x in -50.0..50.0_f64, y in -50.0..50.0_f64, reach in prop::array::uniform4(0.0..60.0_f64)) {
        let node = FixedPoint::from_metres(x, y);
        let (min, max) = ((node.x() - reach[0], node.y() - reach[1]), (node.x() + reach[2], node.y() + reach[3]));
        let rect = Rect::around(node, min, max);
        let (stored_min, stored_max) = (rect.min(node), rect.max(node));
        let slack = 1e-5;
        prop_assert!(stored_min.0 >= min.0 - slack && stored_min.1 >= min.1 - slack);
        prop_assert!(stored_max.0 <= max.0 + slack && stored_max.1 <= max.1 + slack);
        prop_assert!(stored_min.0 <= min.0 + 0.0011 && stored_max.1 >= max.1 - 0.0011);
    }
}

#[test]
fn wrong_keys_are_refused() {
    for wrong in [
        "",
        "fht",
        "fht/",
        "fht/maps/",
        "fht//head",
        "fht/a b/head",
        "fht/a/heads",
        "fht/*/head",
        "other/a/head",
        "fht/a/inc/1a2b3c4d/01",
        "fht/a/inc/1a2b3c4d/0",
        "fht/a/inc/1a2b3c4d/+1",
        "fht/a/inc/1A2B3C4D/1",
        "fht/a/inc/1a2b3c4/1",
        "fht/a/inc/1a2b3c4d/99999999999999999999",
        "fht/a/inc/1a2b3c4d/",
        "fht/a/kept/1a2b3c4d/0",
        "fht/-/kept/presence",
        "fht/a/robots/r/p",
        "fht/a/admin/x",
        "fht/a/admin",
        "fht/a/refused",
        "fht/a/refused/x",
        "fht/a/refused/1a2b3c4d/1",
    ] {
        assert!(wrong.parse::<Key>().is_err(), "{wrong}");
    }
}

#[test]
fn wrong_vectors_and_places_are_refused() {
    for wrong in ["1a2b3c4d", "1a2b3c4d:", "1a2b3c4d:-1", "x:1", "1a2b3c4d:1,1a2b3c4d:2"] {
        assert!(wrong.parse::<VersionVector>().is_err(), "{wrong}");
    }
    for wrong in ["", "1", "1,", "a,b", "nan,0", "inf,0", "1e9,0", "1,2,3", "1a2b3c4d.", "1a2b3c4d.x", "-dock"] {
        let error = wrong.parse::<PlaceRef>().unwrap_err();
        assert_eq!(error.code, ErrorCode::BadRequest, "{wrong}");
    }
}

#[test]
fn a_head_is_readable() {
    let json = concat!(
        r#"{"map":"museum","version":19,"vector":{"0000000a":2,"1a2b3c4d":17},"#,
        r#""digest":"0707070707070707070707070707070707070707070707070707070707070707","#,
        r#""clock_us":9,"enabled":"2026-11-21.1@1a2b3c4d","#,
        r#""main_nodes":3,"support_nodes":4,"edges":5,"bytes":6,"refused":0}"#
    );
    let head = Head {
        version: 19,
        vector: "0000000a:2,1a2b3c4d:17".parse().unwrap(),
        digest: Digest([7; 32]),
        clock_us: 9,
        enabled: Some("2026-11-21.1@1a2b3c4d".to_owned()),
        main_nodes: 3,
        support_nodes: 4,
        edges: 5,
        bytes: 6,
        ..Head::of_nothing("museum".parse().unwrap())
    };
    assert_eq!(serde_json::to_string(&head).unwrap(), json);
    assert_eq!(serde_json::from_str::<Head>(json).unwrap(), head);
    assert!(serde_json::from_str::<Head>(&json.replace("1a2b3c4d", "1A2B3C4D")).is_err());
    assert_eq!(serde_json::to_string(&AuthorId(10)).unwrap(), r#""0000000a""#);
}

#[test]
fn only_heads_that_make_sense_pass() {
    let map: MapName = "museum".parse().unwrap();
    let mut head = Head { version: u64::MAX, ..Head::of_nothing(map.clone()) };
    assert!(head.clone().checked(&map).is_err(), "the version is not the vector's");
    head.vector.set(AuthorId(1), u64::MAX);
    assert!(head.clone().checked(&map).is_err(), "nobody could go on from there");
    head.vector.set(AuthorId(1), 1 << 48);
    assert!(head.clone().checked(&map).is_err(), "the version is not the vector's");
    head.version = 1 << 48;
    assert!(head.clone().checked(&map).is_ok());
    assert!(head.clone().checked(&"office".parse().unwrap()).is_err(), "of another map");
    (2..=VersionVector::MAX_AUTHORS as u32 + 1).for_each(|author| head.vector.set(AuthorId(author), 1));
    assert!(head.checked(&map).is_err(), "too many authors");
}

#[test]
fn error_replies_are_readable() {
    let reply = ErrorReply::new(ErrorCode::NoPath, "no path");
    assert_eq!(serde_json::to_string(&reply).unwrap(), r#"{"code":"NO_PATH","message":"no path"}"#);
    for (message, plain) in [
        ("a robot's name, others' nodes", "a robot's name, others' nodes"),
        ("'docks' is no 'dock', the robot's or not", "docks is no dock, the robot's or not"),
        ("a \"text\" with a \\ and\nlines", "a text with a  andlines"),
    ] {
        assert_eq!(ErrorReply::new(ErrorCode::BadRequest, message).message, plain);
    }
    let newer = r#"{"code":"OUT_OF_CHEESE","message":"later"}"#;
    assert_eq!(serde_json::from_str::<ErrorReply>(newer).unwrap().code, ErrorCode::Unknown, "a newer server is read");
}
