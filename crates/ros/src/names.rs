//! Names of topics, services and types: how ROS 2 resolves, checks and mangles them.

/// Why a name cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NameError {
    /// There is nothing in it, or nothing between two slashes.
    #[error("the name '{0}' has an empty part; write it like /scan or front/scan")]
    Empty(String),
    /// A part begins with a digit.
    #[error("a part of the name '{0}' begins with a digit, which ROS does not allow")]
    Digit(String),
    /// A character that ROS does not allow.
    #[error("the name '{name}' has the character '{character}'; ROS allows letters, digits, _ and /")]
    Character {
        /// The name.
        name: String,
        /// What it may not have.
        character: char,
    },
}

/// The full name of a topic or service, with a leading slash: `scan` in the namespace `r1` is
/// `/r1/scan`, `/scan` is itself, and `~/cost` is the node's own.
///
/// # Errors
/// [`NameError`] when it cannot be a name.
pub fn resolve(name: &str, namespace: &str, node: &str) -> Result<String, NameError> {
    let namespace = namespace.trim_matches('/');
    let within = |rest: &str| if namespace.is_empty() { rest.to_owned() } else { format!("{namespace}/{rest}") };
    let relative = match (name.strip_prefix('/'), name.strip_prefix("~/")) {
        (Some(absolute), _) => absolute.to_owned(),
        (_, Some(private)) => within(&format!("{node}/{private}")),
        _ => within(name),
    };
    for part in relative.split('/') {
        if part.is_empty() {
            return Err(NameError::Empty(name.to_owned()));
        }
        if part.starts_with(|first: char| first.is_ascii_digit()) {
            return Err(NameError::Digit(name.to_owned()));
        }
        if let Some(character) = part.chars().find(|letter| !letter.is_ascii_alphanumeric() && *letter != '_') {
            return Err(NameError::Character { name: name.to_owned(), character });
        }
    }
    Ok(format!("/{relative}"))
}

/// A namespace as nodes have it: without slashes around it, and nothing for the one of all.
///
/// # Errors
/// [`NameError`] when it cannot be a name.
pub fn namespace(text: &str) -> Result<String, NameError> {
    let inner = text.strip_prefix('/').unwrap_or(text);
    let inner = inner.strip_suffix('/').unwrap_or(inner);
    if !inner.is_empty() {
        resolve(&format!("/{inner}"), "", "")?;
    }
    Ok(inner.to_owned())
}

/// The name that DDS gives a type: `sensor_msgs/msg/LaserScan` is
/// `sensor_msgs::msg::dds_::LaserScan_`.
#[must_use]
pub fn dds_type(ros_type: &str) -> String {
    match ros_type.rsplit_once('/') {
        Some((package, name)) => format!("{}::dds_::{name}_", package.replace('/', "::")),
        None => ros_type.to_owned(),
    }
}

/// The reverse of [`dds_type`]; what is no such name stays as it is.
#[must_use]
pub fn ros_type(dds_type: &str) -> String {
    let name = dds_type.replace("::dds_::", "/").replace("::", "/");
    name.strip_suffix('_').map_or(name.clone(), str::to_owned)
}

/// A name as one part of a token's key: slashes are `%`, nothing is `%`.
pub(crate) fn mangle(name: &str) -> String {
    if name.is_empty() || name == "/" { "%".to_owned() } else { name.replace('/', "%") }
}

pub(crate) fn demangle(part: &str) -> String {
    part.replace('%', "/")
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn names_are_resolved_as_ros_does() {
        for (name, namespace, full) in [
            ("scan", "", "/scan"),
            ("scan", "/", "/scan"),
            ("scan", "r1", "/r1/scan"),
            ("scan", "/r1/", "/r1/scan"),
            ("/scan", "r1", "/scan"),
            ("~/cost", "/r1", "/r1/mapper/cost"),
            ("navigate_to_pose/_action/feedback", "", "/navigate_to_pose/_action/feedback"),
        ] {
            assert_eq!(resolve(name, namespace, "mapper").as_deref(), Ok(full));
        }
        for bad in ["", "/", "scan/", "a//b", "2d", "r1/2d", "scan*", "a b", "~", "sc@n"] {
            assert!(resolve(bad, "", "n").is_err(), "{bad}");
        }
    }

    #[test]
    fn a_namespace_is_a_name_or_nothing() {
        for (text, of) in [("", ""), ("/", ""), ("r1", "r1"), ("/r1/", "r1"), ("/site/r1", "site/r1")] {
            assert_eq!(namespace(text).as_deref(), Ok(of));
        }
        for bad in ["a//b", "r1//", "2d", "~/a", "a b"] {
            assert!(namespace(bad).is_err_and(|error| error.to_string().contains(bad.trim_end_matches('/'))), "{bad}");
        }
    }

    #[test]
    fn types_have_two_names() {
        for (ros, dds) in [
            ("std_msgs/msg/String", "std_msgs::msg::dds_::String_"),
            ("nav2_msgs/action/NavigateToPose_SendGoal", "nav2_msgs::action::dds_::NavigateToPose_SendGoal_"),
        ] {
            assert_eq!((dds_type(ros).as_str(), ros_type(dds).as_str()), (dds, ros));
        }
    }

    proptest! {
        #[test]
        fn any_name_is_resolved_or_refused(name in ".{0,20}", namespace in ".{0,10}") {
            if let Ok(full) = resolve(&name, &namespace, "node") {
                prop_assert!(full.starts_with('/') && resolve(&full, "other", "node").as_deref() == Ok(full.as_str()));
            }
        }
    }
}
