//! Why a session cannot listen where it should. Zenoh's errors are texts.

/// Why nobody can listen at an address.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ListenTrouble {
    /// Somebody listens there already.
    #[error("the address is in use, perhaps by another map-server or router")]
    InUse,
    /// The address is another machine's, or nobody's.
    #[error("no interface of this machine has this address")]
    NotHere,
    /// The name cannot be resolved.
    #[error("no computer has this name")]
    NoName,
    /// The folder of a socket is missing.
    #[error("there is no such folder")]
    NoFolder,
    /// The system refuses: a port below 1024, or somebody else's folder.
    #[error("this account may not listen there")]
    NotPermitted,
}

impl ListenTrouble {
    /// What Zenoh means, if it says that it cannot listen.
    pub(crate) fn of(said: &str) -> Option<Self> {
        let kinds: [(&[&str], Self); 5] = [
            (&["Address already in use", "Unable to acquire lock"], Self::InUse),
            (&["Cannot assign requested address"], Self::NotHere),
            (&["failed to lookup"], Self::NoName),
            (&["No such file or directory"], Self::NoFolder),
            (&["Permission denied"], Self::NotPermitted),
        ];
        kinds.iter().find(|(texts, _)| texts.iter().any(|text| said.contains(text))).map(|(_, trouble)| *trouble)
    }

    /// Whether the address is wrong: the same would fail again.
    #[must_use]
    pub fn is_input(self) -> bool {
        matches!(self, Self::NotHere | Self::NoName)
    }
}

/// The endpoints that an error names, or all of them if it names none.
pub(crate) fn named(listen: Vec<String>, said: &str) -> Vec<String> {
    let is_named = |endpoint: &&String| endpoint.split_once('/').is_some_and(|(_, address)| said.contains(address));
    let found: Vec<String> = listen.iter().filter(is_named).cloned().collect();
    if found.is_empty() { listen } else { found }
}

/// Whether Zenoh says that it listens, but reaches nobody.
pub(crate) fn is_of_connecting(said: &str) -> bool {
    ["Unable to connect", "link bound to"].iter().any(|text| said.contains(text))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_zenoh_says_of_an_address_is_told_apart() {
        let tcp = "Can not create a new TCP listener bound to tcp/192.0.2.1:7447: [192.0.2.1:7447: ";
        for (said, trouble) in [
            (format!("{tcp}Cannot assign requested address (os error 99)]"), Some(ListenTrouble::NotHere)),
            (format!("{tcp}Address already in use (os error 98)]"), Some(ListenTrouble::InUse)),
            (format!("{tcp}Permission denied (os error 13)]"), Some(ListenTrouble::NotPermitted)),
            ("failed to lookup address information: Name or service not known".to_owned(), Some(ListenTrouble::NoName)),
            ("listener on /no/x - Unable to open lock file: ENOENT: No such file or directory".to_owned(), {
                Some(ListenTrouble::NoFolder)
            }),
            ("something else".to_owned(), None),
        ] {
            assert_eq!(ListenTrouble::of(&said), trouble, "{said}");
            assert!(!is_of_connecting(&said), "{said}");
        }
        assert!(is_of_connecting("Unable to connect to any of [Single(tcp/127.0.0.1:1)]. Timeout!"));
        let given = ["tcp/192.0.2.1:7447", "tcp/127.0.0.1:7447"].map(str::to_owned).to_vec();
        assert_eq!(named(given.clone(), tcp), ["tcp/192.0.2.1:7447"]);
        assert_eq!(named(given.clone(), "nothing"), given);
    }
}
