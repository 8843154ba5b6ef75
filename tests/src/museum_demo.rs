//! The demo in the built-in museum.

use fht_demo::{Crew, HandoffConfig};
use std::path::Path;

/// Seed 1 of the built-in museum, explored by one robot while nobody walks about. Data and picture
/// go to `folder`.
#[must_use]
pub fn museum_demo(executable: &Path, endpoint: String, folder: &Path) -> HandoffConfig {
    HandoffConfig {
        executable: executable.to_owned(),
        world: "museum".to_owned(),
        textures: None,
        seed: 1,
        people: 0,
        crew: Crew::One,
        ros: false,
        endpoint,
        folder: folder.to_owned(),
        picture: folder.join("museum.png"),
        fetch: true,
        progress: false,
    }
}
