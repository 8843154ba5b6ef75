//! What `client-robot` reads from the configuration file.

use super::arguments::{LinkArgs, RobotArgs};
use crate::mission::MissionConfig;
use crate::pilot::PilotConfig;
use fht_client::{ReplicaConfig, ServerPathsConfig};
use fht_perception::robot::SilenceConfig;
use fht_program::flags::ConfigArgs;
use fht_program::{ConfigError, RobotConfig};
use fht_proto::{Footprint, MapName, RobotName};
use fht_ros_robot::RosRobotConfig;
use fht_session::SessionConfig;
use fht_sim::SimConfig;
use fht_worker::Taking;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The configuration of `client-robot`. What is not in the file has the value that stands here;
/// flags go before both. The file may hold sections of other programs (`[mapper]`, `[server]`):
/// each program reads its own.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(super) struct ClientFile {
    /// How the robot reaches the map server or a router.
    pub(super) connect: SessionConfig,
    /// Which robot this is, and which map it uses.
    pub(super) robot: RobotConfig,
    /// The simulated robot.
    pub(super) sim: SimConfig,
    /// The topics and frames of a robot that speaks ROS 2 (`--ros`).
    pub(super) ros: RosRobotConfig,
    /// How the robot finds its place and drives.
    pub(super) client: ClientSection,
}

impl Default for ClientFile {
    fn default() -> Self {
        // Another day than the mapping.
        let sim = SimConfig { light_seed: 1, ..SimConfig::default() };
        Self {
            connect: SessionConfig::default(),
            robot: RobotConfig::default(),
            sim,
            ros: RosRobotConfig::default(),
            client: ClientSection::default(),
        }
    }
}

/// The robot's name if neither a flag nor the file says one.
const DEFAULT_ROBOT: &str = "client";
/// The map's.
const DEFAULT_MAP: &str = "museum";

impl ClientFile {
    /// The defaults of a robot of `footprint`: its clearances follow from that.
    fn of_footprint(footprint: &Footprint) -> Self {
        let mut file = Self::default();
        file.client.pilot = PilotConfig::of(footprint);
        file.client.paths.footprint = footprint.clone();
        file.robot.footprint = footprint.clone();
        file
    }

    /// The configuration file. The robot's clearances follow from the `footprint` of the flag, if
    /// there is one, or else of the file, unless the file states them.
    pub(super) fn read(config: &ConfigArgs, footprint: Option<&Footprint>) -> Result<Self, ConfigError> {
        let mut body = config.over(Self::default())?.robot.footprint;
        if let Some(Footprint { shape, .. }) = footprint {
            body.shape = shape.clone();
        }
        let mut file = config.over(Self::of_footprint(&body))?;
        file.robot.footprint = body;
        Ok(file)
    }

    /// With flags over what the file says.
    pub(super) fn with_link(mut self, link: &LinkArgs) -> Self {
        self.connect = link.server.over(&self.connect);
        self.robot.map = link.map.clone().or(self.robot.map);
        self
    }

    /// With flags over what the file says.
    pub(super) fn with_robot(mut self, args: &RobotArgs) -> Self {
        self.robot.name = args.robot.clone().or(self.robot.name);
        // As explorers call the map of a world.
        self.robot.map = self.robot.map.or_else(|| args.setup.map_name().ok());
        self.robot.model = args.model.clone().or(self.robot.model);
        self.robot.fetch &= !args.no_fetch;
        self.robot.cameras &= !args.no_cameras;
        self.sim.light_seed = args.light_seed.unwrap_or(self.sim.light_seed);
        if !self.robot.cameras {
            self.sim.camera_every = 0;
        }
        self.client.pilot.max_time_s = args.max_sim.unwrap_or(self.client.pilot.max_time_s);
        self.client.pilot.seed = args.setup.seed;
        self
    }

    /// The map's name.
    pub(super) fn map(&self) -> MapName {
        self.robot.map.clone().unwrap_or_else(|| DEFAULT_MAP.parse().expect("a map's name"))
    }

    /// The robot's name.
    pub(super) fn name(&self) -> &str {
        self.robot.name.as_ref().map_or(DEFAULT_ROBOT, RobotName::as_str)
    }
}

/// How the robot finds its place and drives.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct ClientSection {
    /// How the server is asked for paths.
    pub(super) paths: ServerPathsConfig,
    /// How the robot's copy of the map keeps up.
    pub(super) replica: ReplicaConfig,
    /// Whether a goal of `go` or `path` that cannot be reached means the nearest point that can
    /// (`--to-nearest`); senders of goals say it with each. Default false.
    pub(super) to_nearest: bool,
    /// How long the sensors may be silent.
    pub(super) silence: SilenceConfig,
    /// When the walls of a map that has changed are used. Default two frames after the change.
    pub(super) walls: Taking,
    /// The pilot.
    #[serde(flatten)]
    pub(super) pilot: PilotConfig,
}

impl Default for ClientSection {
    fn default() -> Self {
        let MissionConfig { pilot, silence, to_nearest, walls, .. } = MissionConfig::default();
        let (paths, replica) = (ServerPathsConfig::default(), ReplicaConfig::default());
        Self { paths, replica, to_nearest, silence, walls, pilot }
    }
}

#[cfg(test)]
mod tests {
    use super::super::arguments::{Cli, Command};
    use super::*;
    use clap::Parser;
    use std::path::Path;

    fn parse(text: &str) -> Result<ClientFile, String> {
        fht_program::parse(text, Path::new("robot.toml")).map_err(|error| error.to_string())
    }

    #[test]
    fn the_printed_defaults_load_to_the_same() {
        let text = fht_program::print(&ClientFile::default()).unwrap();
        let read = parse(&text).unwrap();
        assert_eq!(serde_json::to_value(read).unwrap(), serde_json::to_value(ClientFile::default()).unwrap());
        assert!(text.contains("\nmax_time_s = 1500.0\n") && text.contains("\n[client.steering.safety]\n"), "{text}");
    }

    #[test]
    fn what_is_wrong_is_named() {
        for (text, expected) in [
            ("[client]\nmax_time = 5", "robot.toml:2: client.max_time is not known; did you mean client.max_time_s?"),
            (
                "[client]\nmax_time_s = 'long'",
                "robot.toml:2: client.max_time_s is the text \"long\"; it must be a number",
            ),
            ("[client.paths]\ntimeout_s = -1", "robot.toml:2: client.paths.timeout_s is -1; it must be from 0 to"),
            ("[client]\nseed = 5", "robot.toml:2: client.seed is not known"),
        ] {
            let error = parse(text).unwrap_err();
            assert!(error.starts_with(expected), "{text}\n{error}");
        }
    }

    #[test]
    fn flags_go_before_the_file_and_the_file_before_the_defaults() {
        let text = "connect.endpoints = ['tcp/file:1']
            robot = { name = 'amr-7', map = 'hall', cameras = true }
            client.max_time_s = 100
            client.goal_slack_m = 0.2";
        let resolve = |text: &str, flags: &[&str]| {
            let cli = Cli::try_parse_from(["client-robot", "relocalize"].iter().chain(flags)).unwrap();
            let Some(Command::Relocalize { link, robot }) = cli.command else { panic!("another command") };
            parse(text).unwrap().with_link(&link).with_robot(&robot)
        };
        let usual = resolve("", &[]);
        assert_eq!((usual.name(), usual.map().as_str()), ("client", "museum"));
        assert_eq!((usual.client.pilot.max_time_s, usual.client.pilot.seed, usual.sim.light_seed), (1500.0, 1, 1));
        let of_file = resolve(text, &[]);
        assert_eq!((of_file.name(), of_file.map().as_str()), ("amr-7", "hall"));
        assert_eq!((of_file.client.pilot.max_time_s, of_file.client.pilot.goal_slack_m), (100.0, 0.2));
        assert_eq!(of_file.connect.connect, ["tcp/file:1"]);
        let flags = ["--robot", "b", "--map", "m", "--connect", "tcp/flag:1", "--max-time-s", "7", "--no-camera"];
        let of_flags = resolve(text, &flags);
        assert_eq!((of_flags.name(), of_flags.map().as_str(), of_flags.client.pilot.max_time_s), ("b", "m", 7.0));
        assert_eq!(
            (of_flags.connect.connect.as_slice(), of_flags.sim.camera_every),
            (&["tcp/flag:1".to_owned()][..], 0)
        );
    }

    #[test]
    fn clearances_follow_from_the_footprint_unless_the_file_says_otherwise() {
        let text = "robot.footprint.shape = { radius = 0.3 }\nclient.steering.safety.margin_m = 0.07";
        let folder = tempfile::tempdir().unwrap();
        let config = ConfigArgs { config: Some(folder.path().join("robot.toml")), print_config: false };
        std::fs::write(folder.path().join("robot.toml"), text).unwrap();
        let file = ClientFile::read(&config, None).unwrap();
        let follows = PilotConfig::of(&file.robot.footprint);
        assert_eq!(file.client.paths.footprint, Footprint::disc(0.3).unwrap());
        assert_eq!(file.client.pilot.route.half_width_m, follows.route.half_width_m);
        assert_eq!(file.client.pilot.steering.safety.robot_radius_m, follows.steering.safety.robot_radius_m);
        assert_eq!(file.client.pilot.steering.safety.margin_m, 0.07);
        assert_eq!(
            serde_json::to_value(ClientFile::of_footprint(&Footprint::default())).unwrap(),
            serde_json::to_value(ClientFile::default()).unwrap()
        );
        // The flag goes before the file's footprint, not before a clearance that the file states.
        let cart: Footprint = "0.4,0.3_-0.4,0.3_-0.4,-0.3_0.4,-0.3".parse().unwrap();
        let file = ClientFile::read(&config, Some(&cart)).unwrap();
        assert_eq!((&file.robot.footprint, &file.client.paths.footprint), (&cart, &cart));
        assert_eq!(file.client.pilot.route.half_width_m, PilotConfig::of(&cart).route.half_width_m);
        assert_eq!(file.client.pilot.steering.safety.margin_m, 0.07);
    }

    #[test]
    fn the_example_loads() {
        let example = concat!(env!("CARGO_MANIFEST_DIR"), "/../deploy/robot.toml");
        let file: ClientFile = fht_program::load(Path::new(example)).unwrap();
        assert_eq!(file.robot.name.as_ref().map(RobotName::as_str), Some("amr-7"));
    }
}
