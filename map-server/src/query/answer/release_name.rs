//! Releases by the names that people use.

use fht_map::MapState;
use fht_proto::ReleaseId;
use fht_proto::api::reply::known_names;

/// The id of the release that `text` names: `name@author`, or the name alone if only one author has
/// used it.
///
/// # Errors
/// A sentence, if there is no such release, or more than one.
pub(crate) fn find_release(state: &MapState, text: &str) -> Result<ReleaseId, String> {
    let releases = || state.annotations().releases().map(|release| release.id);
    let unknown = || {
        let known = known_names(releases());
        format!("there is no release {text} ({known})")
    };
    if let Ok(id) = text.parse::<ReleaseId>() {
        return if releases().any(|known| *known == id) { Ok(id) } else { Err(unknown()) };
    }
    let named: Vec<&ReleaseId> = releases().filter(|id| id.name.as_str() == text).collect();
    match named.as_slice() {
        [id] => Ok((*id).clone()),
        [] => Err(unknown()),
        several => {
            let several: Vec<String> = several.iter().map(ToString::to_string).collect();
            Err(format!("more than one release is called {text}: {}", several.join(", ")))
        }
    }
}
