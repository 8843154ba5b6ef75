//! What `mapper` reads from the configuration file.

use crate::mapping::MapperConfig;
use crate::publish::WindowConfig;
use fht_bag::FrameConfig;
use fht_program::RobotConfig;
use fht_ros_robot::RosRobotConfig;
use fht_session::SessionConfig;
use fht_sim::SimConfig;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// The configuration of `mapper`. What is not in the file has the value that stands here; flags go
/// before both. The file may hold sections of other programs (`[client]`, `[server]`): each program
/// reads its own.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(super) struct MapperFile {
    /// How the robot reaches the map server or a router.
    pub(super) connect: SessionConfig,
    /// Which robot this is, and which map it uses.
    pub(super) robot: RobotConfig,
    /// The simulated robot of `mapper explore`.
    pub(super) sim: SimConfig,
    /// The topics and frames of the robot of `mapper explore --ros`.
    pub(super) ros: RosRobotConfig,
    /// How `mapper replay` reads recorded runs.
    pub(super) bag: FrameConfig,
    /// How maps are built and published.
    pub(super) mapper: MapperSection,
}

/// How maps are built and published.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct MapperSection {
    /// Folder that keeps what the server has not acknowledged (`--spool`): if a run is killed, or
    /// its server stays away, the next run of this robot delivers that first. Use it on real
    /// robots. Default none: it is lost with the run.
    pub(super) spool: Option<PathBuf>,
    /// How long to wait at the end for the server to acknowledge everything (`--linger`), seconds.
    /// Default 60.
    #[schemars(range(min = 0.0, max = 1e7))]
    pub(super) linger_s: f64,
    /// An exploration gives up after this much simulated time (`--max-sim`), seconds. Default
    /// 14400.
    #[schemars(range(min = 0.0, max = 1e7))]
    pub(super) max_sim_s: f64,
    /// Simulated or recorded seconds per second (`--rate`). Default: as fast as possible, or 1 if
    /// `pace` is `real_time`.
    #[schemars(range(min = 1e-3, max = 1e6))]
    pub(super) rate: Option<f64>,
    /// How much may be under way to the server, and how long.
    pub(super) window: WindowConfig,
    /// The algorithms.
    #[serde(flatten)]
    pub(super) config: MapperConfig,
}

impl Default for MapperSection {
    fn default() -> Self {
        let (window, config) = (WindowConfig::default(), MapperConfig::default());
        Self { spool: None, linger_s: 60.0, max_sim_s: 14_400.0, rate: None, window, config }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::path::Path;

    fn parse(text: &str) -> Result<MapperFile, String> {
        fht_program::parse(text, Path::new("robot.toml")).map_err(|error| error.to_string())
    }

    #[test]
    fn the_printed_defaults_load_to_the_same() {
        let text = fht_program::print(&MapperFile::default()).unwrap();
        let read = parse(&text).unwrap();
        assert_eq!(serde_json::to_value(read).unwrap(), serde_json::to_value(MapperFile::default()).unwrap());
        for line in ["[mapper.slam.grid]", "# linger_s", "linger_s = 60.0", "pace = \"repeatable\""] {
            assert!(text.contains(line.trim_start_matches("# ")), "{line} is not in\n{text}");
        }
        // Every key says what it means.
        let lines: Vec<_> = text.lines().collect();
        let silent = lines.windows(2).filter(|pair| pair[1].contains(" = ") && !pair[1].starts_with('#'));
        let silent: Vec<_> = silent.filter(|pair| !pair[0].starts_with('#')).map(|pair| pair[1]).collect();
        assert!(silent.is_empty(), "without a comment: {silent:?}");
    }

    /// Multiplies all numbers that are not whole.
    fn scale(value: &mut serde_json::Value, factor: f64) {
        match value {
            serde_json::Value::Object(keys) => keys.values_mut().for_each(|value| scale(value, factor)),
            serde_json::Value::Array(items) => items.iter_mut().for_each(|value| scale(value, factor)),
            value if value.is_f64() => *value = (value.as_f64().unwrap_or_default() * factor).into(),
            _ => {}
        }
    }

    proptest! {
        #[test]
        fn what_is_printed_loads_to_the_same(factor in 0.6_f64..1.6) {
            let mut value = serde_json::to_value(MapperFile::default()).unwrap();
            scale(&mut value, factor);
            let file: MapperFile = serde_json::from_value(value).unwrap();
            let read = parse(&fht_program::print(&file).unwrap()).map_err(TestCaseError::fail)?;
            prop_assert_eq!(serde_json::to_value(read).unwrap(), serde_json::to_value(file).unwrap());
        }
    }

    #[test]
    fn a_section_keeps_the_defaults_of_its_place() {
        let file = parse("[mapper.slam.matching]\ncandidates = 9").unwrap();
        let usual = MapperConfig::default().slam.matching;
        let matching = file.mapper.config.slam.matching;
        assert_eq!((matching.candidates, matching.first_reach_m), (9, usual.first_reach_m));
    }

    #[test]
    fn what_is_wrong_is_named() {
        for (text, expected) in [
            (
                "[mapper.slam.grid]\nresolution = 0.1",
                "robot.toml:2: mapper.slam.grid.resolution is not known; did you mean mapper.slam.grid.resolution_m?",
            ),
            (
                "[mapper.slam.grid]\nresolution_m = 0.0",
                "robot.toml:2: mapper.slam.grid.resolution_m is 0; it must be from",
            ),
            ("[mapper.window]\nmax_count = 0", "robot.toml:2: mapper.window.max_count is 0; it must be from 1 to"),
            ("[mapper]\npace = 'fast'", "robot.toml:2: mapper.pace is \"fast\"; it must be one of"),
            ("[robot]\nmap = 'a/b'", "robot.toml:2: robot.map is refused: "),
            ("[mapper]\nspool = 3", "robot.toml:2: mapper.spool is 3; it must be a text in quotes"),
        ] {
            let error = parse(text).unwrap_err();
            assert!(error.starts_with(expected), "{text}\n{error}");
        }
        assert!(parse("[server]\nwhatever = 1\n[client]\nx = 2").is_ok());
    }

    #[test]
    fn the_example_loads() {
        let example = concat!(env!("CARGO_MANIFEST_DIR"), "/../deploy/robot.toml");
        let file: MapperFile = fht_program::load(Path::new(example)).unwrap();
        assert_eq!(file.robot.name.as_ref().map(fht_proto::RobotName::as_str), Some("amr-7"));
        assert!(file.mapper.spool.is_some());
    }
}
