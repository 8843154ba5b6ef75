//! The authors' own starts and pairs of places: `cases.json` beside a map, by the map's name.

use fht_perception::pose::{Point2, Pose2, pose};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::Path;

#[derive(Debug, Deserialize)]
struct Origin {
    x: f64,
    y: f64,
    yaw: f64,
}

#[derive(Debug, Deserialize)]
struct Entry {
    /// Pose of the map's frame in the frame of the numbers below.
    map_origin_in_world: Origin,
    relocalization_starts: Vec<[f64; 3]>,
    paths: Vec<[[f64; 2]; 2]>,
}

/// Starts and pairs in the frame of the map's picture, which is the simulated world's.
#[derive(Debug, Default)]
pub struct Cases {
    /// Where robots were dropped.
    pub starts: Vec<Pose2>,
    /// Starts and goals of paths.
    pub pairs: Vec<(Point2, Point2)>,
}

/// The cases of a world. None if it is not a map, or has no such file beside it.
pub fn of(world: &str) -> Result<Cases, String> {
    let path = Path::new(world);
    let beside = path.with_file_name("cases.json");
    let (Some(stem), true) = (path.file_stem(), path.extension().is_some() && beside.is_file()) else {
        return Ok(Cases::default());
    };
    let problem = |reason: String| format!("{}: {reason}", beside.display());
    let text = std::fs::read_to_string(&beside).map_err(|error| problem(error.to_string()))?;
    let mut entries: BTreeMap<String, serde_json::Value> =
        serde_json::from_str(&text).map_err(|error| problem(error.to_string()))?;
    let Some(entry) = entries.remove(stem.to_string_lossy().as_ref()) else { return Ok(Cases::default()) };
    let entry: Entry = serde_json::from_value(entry).map_err(|error| problem(error.to_string()))?;
    let Origin { x, y, yaw } = entry.map_origin_in_world;
    let map_from_theirs = pose(x, y, yaw).inverse();
    let point = |[x, y]: [f64; 2]| map_from_theirs * Point2::new(x, y);
    Ok(Cases {
        starts: entry.relocalization_starts.iter().map(|&[x, y, yaw]| map_from_theirs * pose(x, y, yaw)).collect(),
        pairs: entry.paths.iter().map(|&[from, to]| (point(from), point(to))).collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_authors_frame_becomes_the_maps() {
        let folder = tempfile::tempdir().unwrap();
        let text = r#"{"about": "x", "museum": {"map_origin_in_world": {"x": 7.0, "y": 8.0, "yaw": 1.5707963},
            "relocalization_starts": [[-4, -5, 0]], "paths": [[[7, -5], [-4, 2.5]]]}}"#;
        std::fs::write(folder.path().join("cases.json"), text).unwrap();
        let cases = of(&folder.path().join("museum.yaml").to_string_lossy()).unwrap();
        // x = 7 - y_map, y = 8 + x_map.
        assert!((cases.starts[0].translation.vector - nalgebra::Vector2::new(-13.0, 11.0)).norm() < 1e-3);
        assert!((cases.pairs[0].0 - Point2::new(-13.0, 0.0)).norm() < 1e-3);
        assert!(of(&folder.path().join("other.yaml").to_string_lossy()).unwrap().starts.is_empty());
        assert!(of("museum").unwrap().pairs.is_empty());
    }
}
