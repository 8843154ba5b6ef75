//! What a key expression asks for, and what is said of keys that nobody answers.

use fht_proto::MapName;
use fht_proto::api::keys::{AdminAction, GoalTopic, Key, PREFIX, RobotTopic, Topic};
use fht_proto::api::request::shown;
use zenoh::key_expr::keyexpr;

/// What a key expression asks for.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Addressed {
    /// One topic.
    One(Key),
    /// A wildcard over heads and the list of maps.
    Several(Vec<Key>),
    /// What storages keep: one increment.
    Kept,
    /// The same by wildcards, as the servers of a site ask all of their storages. A refusal would
    /// be taken for one of a storage.
    Storages,
    /// What robots answer, of several of them: a refusal would be taken for one of a robot. None is
    /// sent by such a key.
    Robots,
    /// What is put and not asked for: the sentence says what to ask.
    NotAsked(String),
    /// What a robot would answer that takes goals, and none of this name does.
    NoRobot(String),
    /// Nothing that exists.
    Unknown,
}

pub(super) fn addressed(expression: &str, maps: impl Iterator<Item = MapName>) -> Addressed {
    if !expression.contains('*') {
        return match expression.parse::<Key>() {
            Ok(key @ (Key::Maps | Key::Topic { .. } | Key::Admin { .. })) => Addressed::One(key),
            _ => put_only(expression),
        };
    }
    let Ok(asked) = keyexpr::new(expression) else { return Addressed::Unknown };
    let covers = |key: &str| keyexpr::new(key).is_ok_and(|key| asked.intersects(key));
    let heads = maps.map(|map| Key::topic(&map, Topic::Head));
    let several: Vec<Key> = std::iter::once(Key::Maps).chain(heads).filter(|key| covers(&key.to_string())).collect();
    if !several.is_empty() { Addressed::Several(several) } else { put_only(expression) }
}

/// What a key that is put says when it is asked for, by its chunk behind the map.
fn put_only(expression: &str) -> Addressed {
    let mut chunks = expression.split('/').skip(1);
    let (map, kind) = (chunks.next().unwrap_or_default(), chunks.next().unwrap_or_default());
    let map = if map.parse::<MapName>().is_ok() { map } else { "MAP" };
    let key = shown(expression);
    let fleet = Topic::Fleet.as_str();
    match kind {
        "kept" if matches!(expression.parse(), Ok(Key::Kept { .. })) => Addressed::Kept,
        "kept" => Addressed::Storages,
        "robots" if is_of_goals(expression) && expression.contains('*') => match has_goal_topic(expression) {
            true => Addressed::Robots,
            false => Addressed::NotAsked(format!(
                "{key} names no robot to be sent: ask {PREFIX}/{map}/robots/ROBOT/goal, each robot by its name; {} may \
                 have wildcards",
                GoalTopic::ALL.map(|topic| format!("goal/{}", topic.as_str())).join(" and ")
            )),
        },
        "robots" if is_of_goals(expression) => Addressed::NoRobot(format!(
            "{key} is answered by the robot itself, and none of this name takes goals on this map: does client-robot \
             serve run? {PREFIX}/{map}/{fleet} answers which robots there are"
        )),
        "robots" => Addressed::NotAsked(format!(
            "{key} is put by robots: subscribe to it; {PREFIX}/{map}/{fleet} answers which robots there are"
        )),
        "inc" => Addressed::NotAsked(format!(
            "{key} is put by writers: subscribe to it; {PREFIX}/{map}/{} answers with increments",
            Topic::Since.as_str()
        )),
        "refused" => Addressed::NotAsked(format!(
            "{key} is where the server puts why it refused an increment: subscribe to it; {PREFIX}/{map}/{} answers what \
             it has",
            Topic::Head.as_str()
        )),
        "admin" => {
            let actions: Vec<&str> = AdminAction::ALL.iter().map(|action| action.as_str()).collect();
            Addressed::NotAsked(format!(
                "{key} is no order: ask {PREFIX}/{map}/admin/ACTION with ACTION one of {}",
                actions.join(", ")
            ))
        }
        _ => Addressed::Unknown,
    }
}

/// Whether a robot that takes goals would answer.
pub(super) fn is_of_goals(expression: &str) -> bool {
    let chunks: Vec<&str> = expression.split('/').skip(3).collect();
    matches!(chunks.as_slice(), [_, "goal"] | [_, "goal", _])
}

/// Whether the last chunks name something that robots are asked about their goals.
fn has_goal_topic(expression: &str) -> bool {
    let is_end = |topic: GoalTopic| expression.rsplit('/').take(2).eq([topic.as_str(), RobotTopic::Goal.as_str()]);
    GoalTopic::ALL.into_iter().any(is_end)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn asked(expression: &str) -> Addressed {
        addressed(expression, ["a", "b"].into_iter().map(|name| name.parse().unwrap()))
    }

    #[test]
    fn keys_are_told_apart() {
        let a: MapName = "a".parse().unwrap();
        let b: MapName = "b".parse().unwrap();
        assert_eq!(asked("fht/maps"), Addressed::One(Key::Maps));
        assert_eq!(asked("fht/a/path"), Addressed::One(Key::topic(&a, Topic::Path)));
        assert_eq!(asked("fht/x/path"), Addressed::One(Key::topic(&"x".parse().unwrap(), Topic::Path)));
        let heads = vec![Key::topic(&a, Topic::Head), Key::topic(&b, Topic::Head)];
        assert_eq!(asked("fht/*/head"), Addressed::Several(heads));
        assert_eq!(asked("fht/*"), Addressed::Several(vec![Key::Maps]));
        for (others, instead) in [
            ("fht/a/inc/**", "fht/a/since"),
            ("fht/*/inc/**", "fht/MAP/since"),
            ("fht/a/inc/00000001/1", "fht/a/since"),
            ("fht/a/robots", "fht/a/fleet"),
            ("fht/a/robots/r", "fht/a/fleet"),
            ("fht/a/robots/**", "fht/a/fleet"),
            ("fht/a/robots/r/pose", "fht/a/fleet"),
            ("fht/*/robots/*/status", "fht/MAP/fleet"),
            ("fht/a/refused/00000001", "fht/a/head"),
            ("fht/a/admin/dance", "retain, import"),
            ("fht/a/robots/*/goal", "fht/a/robots/ROBOT/goal"),
            ("fht/*/robots/*/goal", "goal/cancel and goal/status may have wildcards"),
            ("fht/a/robots/r/goal/*", "fht/a/robots/ROBOT/goal"),
        ] {
            let said = asked(others);
            assert!(matches!(&said, Addressed::NotAsked(text) if text.contains(instead)), "{others}: {said:?}");
        }
        for goals in ["fht/a/robots/r/goal", "fht/a/robots/r/goal/status"] {
            assert!(matches!(asked(goals), Addressed::NoRobot(text) if text.contains("client-robot serve")), "{goals}");
        }
        assert_eq!(asked("fht/a/kept/00000001/1"), Addressed::Kept);
        for storages in ["fht/*/kept/**", "fht/a/kept/00000001/*", "fht/*/kept/*/1", "fht/-/kept/presence"] {
            assert_eq!(asked(storages), Addressed::Storages, "{storages}");
        }
        for several in ["fht/a/robots/*/goal/status", "fht/*/robots/*/goal/cancel"] {
            assert_eq!(asked(several), Addressed::Robots, "{several}");
        }
        for unknown in ["fht", "fht/a", "fht/a/paths", "fht/a/path/b", "fht/a b/path", "fht/*/path"] {
            assert_eq!(asked(unknown), Addressed::Unknown, "{unknown}");
        }
    }
}
