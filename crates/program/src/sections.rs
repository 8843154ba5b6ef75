//! Sections of the configuration file that several programs read.

use fht_proto::{Footprint, MapName, RobotName};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Which robot this is, and which map it uses.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RobotConfig {
    /// The robot's name (`--robot`): 1 to 64 of the letters a to z and A to Z, digits, `_` or `-`,
    /// for each robot another one. Default `explorer` for `mapper`, `client` for `client-robot`.
    #[schemars(with = "Option<String>")]
    pub name: Option<RobotName>,
    /// The map's name (`--map`). Default: that of the world or bag for `mapper`, `museum` for
    /// `client-robot`.
    #[schemars(with = "Option<String>")]
    pub map: Option<MapName>,
    /// A descriptor model in place of the built-in one (`--model`): an ONNX file with its
    /// description beside it. A map is used with the model that it was made with. Default none.
    pub model: Option<PathBuf>,
    /// Whether a missing ONNX Runtime library is fetched from PyPI, by `python3 -m pip`
    /// (`--no-fetch`). Default true.
    pub fetch: bool,
    /// The ground that the robot covers. The clearances of `client-robot` follow from it, unless
    /// the file states them. Default: the paper's robot, of 0.105 m radius.
    pub footprint: Footprint,
    /// Whether the robot uses its cameras (`--no-cameras`). Default true.
    pub cameras: bool,
}

impl Default for RobotConfig {
    fn default() -> Self {
        Self { name: None, map: None, model: None, fetch: true, footprint: Footprint::default(), cameras: true }
    }
}
