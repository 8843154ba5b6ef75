//! Where to find the files that a world names: models, meshes, pictures.

use std::path::{Path, PathBuf};

/// Environment variables that hold folders of models, as Gazebo reads them.
const VARIABLES: [&str; 3] = ["GAZEBO_MODEL_PATH", "GZ_SIM_RESOURCE_PATH", "IGN_GAZEBO_RESOURCE_PATH"];
/// Folders next to a mesh's own in which pictures are searched for by their base name.
const PICTURE_FOLDERS: [&str; 4] = [".", "../materials/textures", "../textures", "../../materials/textures"];

/// The folders that are searched.
#[derive(Clone, Debug)]
pub(crate) struct Paths {
    models: Vec<PathBuf>,
    pictures: Vec<PathBuf>,
}

impl Paths {
    /// The folders of a world file: the `models` folder next to its own, its own folder, those of
    /// the environment. Pictures are also searched for in the `photos` folder next to the world's.
    pub(crate) fn of_world(world: &Path) -> Self {
        let own = match world.parent() {
            Some(folder) if !folder.as_os_str().is_empty() => folder.to_owned(),
            _ => PathBuf::from("."),
        };
        let mut models = vec![own.join("../models"), own.join("models"), own.clone()];
        for variable in VARIABLES {
            if let Some(folders) = std::env::var_os(variable) {
                models.extend(std::env::split_paths(&folders).filter(|folder| !folder.as_os_str().is_empty()));
            }
        }
        Self { models, pictures: vec![own.join("../photos"), own.join("photos")] }
    }

    /// The folders of models, for people.
    pub(crate) fn folders(&self) -> String {
        let folders: Vec<String> = self.models.iter().map(|folder| folder.display().to_string()).collect();
        format!("{}; {} adds more", folders.join(", "), VARIABLES.join(" or "))
    }

    /// The file that a URI names: `model://` is searched for in the models' folders, `file://` is a
    /// path, and so is anything else, relative to `base`. Of an `http` address, the last part is
    /// searched for as a model.
    pub(crate) fn find(&self, uri: &str, base: &Path) -> Option<PathBuf> {
        let uri = uri.trim();
        if uri.is_empty() {
            return None;
        }
        if let Some(name) = uri.strip_prefix("model://").or_else(|| uri.strip_prefix("package://")) {
            return self.in_models(name);
        }
        if let Some(path) = uri.strip_prefix("file://") {
            return existing(base.join(plain(path))).or_else(|| self.in_models(path));
        }
        if let Some((_, address)) = uri.split_once("://") {
            return self.in_models(address.trim_end_matches('/').rsplit('/').next()?);
        }
        existing(base.join(plain(uri))).or_else(|| self.in_models(uri))
    }

    /// The SDF file of the model that a URI names: the file itself, or the one that the model's
    /// folder names.
    pub(crate) fn find_model(&self, uri: &str, base: &Path) -> Option<PathBuf> {
        let found = self.find(uri, base)?;
        if found.is_dir() { described(&found).or_else(|| existing(found.join("model.sdf"))) } else { Some(found) }
    }

    /// The picture that a mesh or material in the folder `base` names: at the path it gives, else
    /// by its base name.
    pub(crate) fn find_picture(&self, reference: &str, base: &Path) -> Option<PathBuf> {
        let as_said = self.find(reference, base).filter(|path| path.is_file());
        if as_said.is_some() {
            return as_said;
        }
        let reference = plain(reference).replace('\\', "/");
        let name = Path::new(&reference).file_name()?;
        let beside = PICTURE_FOLDERS.iter().map(|folder| base.join(folder));
        beside.chain(self.pictures.iter().cloned()).map(|folder| folder.join(name)).find(|path| path.is_file())
    }

    fn in_models(&self, name: &str) -> Option<PathBuf> {
        // An absolute path would replace the folder.
        let name = plain(name);
        let name = name.trim_start_matches('/');
        if name.is_empty() {
            return None;
        }
        self.models.iter().find_map(|folder| existing(folder.join(name)))
    }
}

fn existing(path: PathBuf) -> Option<PathBuf> {
    path.exists().then_some(path)
}

/// The SDF file that a model's folder names for the newest version of the format.
fn described(folder: &Path) -> Option<PathBuf> {
    let text = std::fs::read_to_string(folder.join("model.config")).ok()?;
    let document = roxmltree::Document::parse(&text).ok()?;
    let version = |node: &roxmltree::Node<'_, '_>| -> f64 {
        node.attribute("version").and_then(|version| version.parse().ok()).unwrap_or(0.0)
    };
    let newest = document
        .descendants()
        .filter(|node| node.has_tag_name("sdf"))
        .max_by(|a, b| version(a).total_cmp(&version(b)))?;
    existing(folder.join(newest.text()?.trim())).filter(|path| path.is_file())
}

/// A path without the escapes of a URI (`%20`).
fn plain(uri: &str) -> String {
    let bytes = uri.as_bytes();
    let mut path = Vec::with_capacity(bytes.len());
    let mut at = 0;
    while at < bytes.len() {
        let escaped = (bytes[at] == b'%').then(|| uri.get(at + 1..at + 3)).flatten();
        match escaped.and_then(|digits| u8::from_str_radix(digits, 16).ok()) {
            Some(byte) => {
                path.push(byte);
                at += 3;
            }
            None => {
                path.push(bytes[at]);
                at += 1;
            }
        }
    }
    String::from_utf8_lossy(&path).into_owned()
}

#[cfg(test)]
mod tests {
    use super::{Paths, plain};
    use std::fs;

    #[test]
    fn escapes_are_undone() {
        assert_eq!(plain("my%20wood.png"), "my wood.png");
        assert_eq!(plain("100%.png"), "100%.png");
        assert_eq!(plain("a%e"), "a%e");
        assert_eq!(plain("%ä"), "%ä");
    }

    #[test]
    fn names_are_found_in_their_folders() {
        let folder = tempfile::tempdir().unwrap();
        let at = |path: &str| folder.path().join(path);
        for path in ["worlds", "models/table/meshes", "models/table/materials/textures", "photos"] {
            fs::create_dir_all(at(path)).unwrap();
        }
        for path in ["models/table/new.sdf", "models/table/materials/textures/oak.png", "photos/face.jpg"] {
            fs::write(at(path), "").unwrap();
        }
        let config = r#"<model><sdf version="1.4">old.sdf</sdf><sdf version="1.6">new.sdf</sdf></model>"#;
        fs::write(at("models/table/model.config"), config).unwrap();
        let paths = Paths::of_world(&at("worlds/house.world"));
        let (base, meshes) = (at("worlds"), at("models/table/meshes"));
        assert!(paths.find_model("model://table", &base).unwrap().ends_with("table/new.sdf"));
        assert!(paths.find_model("https://fuel.example/1.0/someone/models/table/", &base).is_some());
        assert!(paths.find_model("model://chair", &base).is_none());
        assert!(paths.find("../models/table/new.sdf", &base).is_some());
        assert!(paths.find_picture("C:\\art\\oak.png", &meshes).unwrap().ends_with("textures/oak.png"));
        assert!(paths.find_picture("../../elsewhere/face.jpg", &meshes).unwrap().ends_with("photos/face.jpg"));
        assert!(paths.find_picture("none.png", &meshes).is_none());
    }
}
