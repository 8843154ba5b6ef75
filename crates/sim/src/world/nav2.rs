//! Maps of the ROS 2 map server (Nav2): a `map.yaml` and a picture of the floor.

use crate::plan::FloorPlan;
use fht_perception::pose::Point2;
use fht_proto::FixedPoint;
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// Most cells that a map may have.
const MOST_CELLS: u64 = 64_000_000;
/// Cell sizes accepted for the map of a building, metres.
const RESOLUTIONS_M: std::ops::RangeInclusive<f64> = 0.001..=1.0;
/// Largest yaw of the origin that counts as zero, radians.
const YAW_TOLERANCE: f64 = 1e-6;

/// A map cannot be loaded.
#[derive(Debug, thiserror::Error)]
pub enum MapError {
    /// A file cannot be read.
    #[error("cannot read {path}: {source}")]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The YAML is malformed, or a key is missing.
    #[error("{path} is no map description: {reason}")]
    Yaml {
        /// The file.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// A value of the YAML cannot be used.
    #[error("{path}: {reason}")]
    Value {
        /// The file.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// The picture cannot be decoded.
    #[error("cannot decode the map's picture {path}: {source}")]
    Picture {
        /// The file.
        path: PathBuf,
        /// Why.
        source: image::ImageError,
    },
}

/// The keys of a `map.yaml`; others are ignored.
#[derive(Debug, Deserialize)]
struct Description {
    image: PathBuf,
    resolution: f64,
    origin: Vec<f64>,
    occupied_thresh: f64,
    free_thresh: f64,
    #[serde(default)]
    negate: Flag,
    #[serde(default)]
    mode: Mode,
}

/// `0`, `1`, `false` or `true`.
#[derive(Debug, Deserialize)]
#[serde(untagged)]
enum Flag {
    Number(i64),
    Truth(bool),
}

impl Default for Flag {
    fn default() -> Self {
        Self::Truth(false)
    }
}

impl Flag {
    fn is_set(&self) -> bool {
        match self {
            Self::Number(number) => *number != 0,
            Self::Truth(truth) => *truth,
        }
    }
}

/// How grey values are read. Only whether a cell is free matters here, so `scale` is read like
/// `trinary`.
#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Mode {
    #[default]
    Trinary,
    Scale,
    Raw,
}

impl Description {
    /// What the file at `path` says.
    fn read(path: &Path) -> Result<Self, MapError> {
        let text = std::fs::read_to_string(path).map_err(|source| MapError::Read { path: path.to_owned(), source })?;
        serde_saphyr::from_str(&text)
            .map_err(|error| MapError::Yaml { path: path.to_owned(), reason: error.to_string() })
    }

    /// The picture that the file at `path` names.
    fn picture(&self, path: &Path) -> PathBuf {
        path.parent().unwrap_or_else(|| Path::new(".")).join(&self.image)
    }

    fn check(&self) -> Result<(), String> {
        if !RESOLUTIONS_M.contains(&self.resolution) {
            let (least, most) = (RESOLUTIONS_M.start(), RESOLUTIONS_M.end());
            return Err(format!("resolution must be {least} to {most} metres per pixel, not {}", self.resolution));
        }
        let &[x, y, yaw] = self.origin.as_slice() else {
            return Err(format!("origin must be [x, y, yaw], not {} numbers", self.origin.len()));
        };
        if !(x.is_finite() && y.is_finite() && yaw.is_finite()) {
            return Err("origin must be finite".to_owned());
        }
        if yaw.abs() > YAW_TOLERANCE {
            return Err(format!("a turned origin is not supported (yaw {yaw} rad): turn the picture instead"));
        }
        let ordered = 0.0 <= self.free_thresh && self.free_thresh < self.occupied_thresh && self.occupied_thresh <= 1.0;
        if !ordered {
            let (free, occupied) = (self.free_thresh, self.occupied_thresh);
            return Err(format!("0 <= free_thresh ({free}) < occupied_thresh ({occupied}) <= 1 does not hold"));
        }
        if matches!(self.mode, Mode::Raw) {
            return Err("mode raw is not supported: use trinary or scale".to_owned());
        }
        Ok(())
    }

    /// Why a picture of `width` × `height` cells reaches to where nothing of a map may be, if it
    /// does.
    fn remote_corner(&self, width: u32, height: u32) -> Option<String> {
        let &[x, y, _] = self.origin.as_slice() else { return None };
        let (right, top) = (x + f64::from(width) * self.resolution, y + f64::from(height) * self.resolution);
        let farther = |a: f64, b: f64| if a.abs() > b.abs() { a } else { b };
        let (far_x, far_y) = (farther(x, right), farther(y, top));
        let is_remote = far_x.abs() > FixedPoint::MAX_M || far_y.abs() > FixedPoint::MAX_M;
        is_remote.then(|| {
            format!(
                "a corner of the map lies at {far_x}, {far_y}, over 100 km from the origin, where nothing of a map may \
                 be: shift the origin, such as to [0, 0, 0]"
            )
        })
    }
}

/// The picture of the map at `path`, if that describes one.
pub(crate) fn picture_of(path: &Path) -> Option<PathBuf> {
    Description::read(path).ok().map(|description| description.picture(path))
}

/// Loads the plan of a map. A cell is free where the picture says so; occupied and unknown cells
/// are both solid, so that the world is closed wherever free floor meets the unknown. The plan's
/// frame is the map's frame.
pub(crate) fn load(path: &Path) -> Result<FloorPlan, MapError> {
    let description = Description::read(path)?;
    description.check().map_err(|reason| MapError::Value { path: path.to_owned(), reason })?;
    let picture_path = description.picture(path);
    let unreadable = |source| MapError::Read { path: picture_path.clone(), source };
    let undecodable = |source| MapError::Picture { path: picture_path.clone(), source };
    let reader = || {
        image::ImageReader::open(&picture_path).and_then(image::ImageReader::with_guessed_format).map_err(unreadable)
    };
    // Check the size before reading the pixels.
    let (width, height) = reader()?.into_dimensions().map_err(undecodable)?;
    if width == 0 || height == 0 || u64::from(width) * u64::from(height) > MOST_CELLS {
        let reason = format!("a picture of {width} x {height} cells is empty or larger than {MOST_CELLS} cells");
        return Err(MapError::Value { path: picture_path, reason });
    }
    if let Some(reason) = description.remote_corner(width, height) {
        return Err(MapError::Value { path: path.to_owned(), reason });
    }
    let picture = reader()?.decode().map_err(undecodable)?.into_luma8();
    let negate = description.negate.is_set();
    let is_solid = |grey: u8| {
        let occupancy = f64::from(if negate { grey } else { 255 - grey }) / 255.0;
        occupancy >= description.free_thresh
    };
    // The picture's first row is the map's top row.
    let occupied: Vec<bool> =
        picture.rows().rev().flat_map(|row| row.map(|pixel| is_solid(pixel.0[0])).collect::<Vec<_>>()).collect();
    let origin = Point2::new(description.origin[0], description.origin[1]);
    Ok(FloorPlan::new(description.resolution, origin, width as usize, height as usize, occupied))
}
