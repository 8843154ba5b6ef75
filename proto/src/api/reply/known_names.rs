//! The names that there are, for whoever gave one that is none of them.

use std::fmt::Display;

/// How many names are listed.
const LISTED: usize = 10;

/// `there is: dock, hall`, or `there is none`. Of more than ten names the first ten stand there,
/// and how many more there are.
#[must_use]
pub fn known_names<T: Display>(names: impl IntoIterator<Item = T>) -> String {
    let mut names = names.into_iter();
    let listed: Vec<String> = names.by_ref().take(LISTED).map(|name| name.to_string()).collect();
    match (listed.is_empty(), names.count()) {
        (true, _) => "there is none".to_owned(),
        (false, 0) => format!("there is: {}", listed.join(", ")),
        (false, more) => format!("there is: {}, and {more} more", listed.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_listed_and_many_are_counted() {
        assert_eq!(known_names::<&str>([]), "there is none");
        assert_eq!(known_names(["dock", "hall"]), "there is: dock, hall");
        assert_eq!(known_names(0..12), "there is: 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, and 2 more");
    }
}
