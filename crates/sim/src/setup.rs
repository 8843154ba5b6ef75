//! Where a simulated robot is, and by which seeds.

use crate::people::PeopleConfig;
use crate::starts::{StartError, check_start, check_way};
use crate::world::{World, WorldError, files_of, load, name_of};
use fht_perception::pose::Pose2;
use fht_proto::{MapName, ParseIdError, SharedWorldName};
use std::path::{Path, PathBuf};

/// The building that a simulated robot is in, its place there, and the seeds that it runs by. With
/// the feature `cli` these are flags.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "cli", derive(clap::Args))]
pub struct SimSetup {
    /// The building: museum, office, or the path of a Nav2 map.yaml or a Gazebo .world.
    #[cfg_attr(feature = "cli", arg(long, value_name = "NAME|FILE", default_value = "museum"))]
    pub world: String,
    /// Folder of pictures to paint the walls of a Nav2 map with; no other world takes it.
    #[cfg_attr(feature = "cli", arg(long, value_name = "FOLDER"))]
    pub textures: Option<PathBuf>,
    /// Seed of the building's drawing.
    #[cfg_attr(feature = "cli", arg(long, value_name = "NUMBER", default_value_t = 1))]
    pub world_seed: u64,
    /// Where the robot begins, in the world frame: x,y or x,y,yaw, metres and degrees (or radians:
    /// 1.57rad). It must fit there. Default: the world's own start for an explorer; anywhere free,
    /// by the seed, for a robot that uses a map.
    #[cfg_attr(feature = "cli", arg(long, value_name = "X,Y,YAW", value_parser = fht_perception::pose::parse, allow_hyphen_values = true))]
    pub start: Option<Pose2>,
    /// Where the frame of a map that is joined or used truly lies, in the world frame: x,y,yaw,
    /// metres and degrees (or radians: 1.57rad). For scoring only. Default: the world's own start,
    /// where explorers begin.
    #[cfg_attr(feature = "cli", arg(long, value_name = "X,Y,YAW", value_parser = fht_perception::pose::parse, allow_hyphen_values = true))]
    pub map_origin: Option<Pose2>,
    /// Seed of the sensors' noise, of the wheels' errors, and of what the robot draws by lot.
    #[cfg_attr(feature = "cli", arg(long, value_name = "NUMBER", default_value_t = 1))]
    pub seed: u64,
    /// So many people walk about in the building, stand and gather, as the seed has it: at most one
    /// for each 2 m² of its free floor.
    #[cfg_attr(feature = "cli", arg(long, value_name = "N", default_value_t = 0, value_parser = people))]
    pub people: u16,
    /// Share the world with all robots of this machine that are given this name: they see each
    /// other and meet the same people, and time goes on for all of them together. Without it the
    /// robot has a world of its own. 1 to 64 of the letters a to z and A to Z, digits, _ or -.
    #[cfg_attr(feature = "cli", arg(long, value_name = "NAME"))]
    pub shared_world: Option<SharedWorldName>,
}

impl SimSetup {
    /// The names of the flags that are of no use to a robot that is not simulated: all but that of
    /// the seed, by which it draws its goal, too.
    #[cfg(feature = "cli")]
    pub const FLAGS: [&'static str; 7] =
        ["world", "textures", "world_seed", "start", "map_origin", "people", "shared_world"];

    /// A robot in `world`, with the defaults of the flags for everything else.
    #[must_use]
    pub fn of(world: &str) -> Self {
        Self {
            world: world.to_owned(),
            textures: None,
            world_seed: 1,
            start: None,
            map_origin: None,
            seed: 1,
            people: 0,
            shared_world: None,
        }
    }

    /// The name of the building's map unless somebody gives it another: the building's own, or its
    /// file's without the ending.
    ///
    /// # Errors
    /// When that is no name of a map.
    ///
    /// ```
    /// assert_eq!(fht_sim::SimSetup::of("floors/second.yaml").map_name()?.as_str(), "second");
    /// # Ok::<(), fht_proto::ParseIdError>(())
    /// ```
    pub fn map_name(&self) -> Result<MapName, ParseIdError> {
        name_of(Path::new(&self.world)).parse()
    }

    /// The people in the building.
    #[must_use]
    pub fn crowd(&self) -> PeopleConfig {
        PeopleConfig::of(self.people.into(), self.seed)
    }

    /// The files and folders that the building is read from, as far as they are known before.
    #[must_use]
    pub fn files(&self) -> Vec<PathBuf> {
        files_of(&self.world).into_iter().chain(self.textures.clone()).collect()
    }

    /// Loads the building.
    ///
    /// # Errors
    /// [`WorldError`], also where the people have no room in it.
    pub fn load(&self) -> Result<World, WorldError> {
        let world = load(&self.world, self.textures.as_deref(), self.world_seed)?;
        world.check_people(self.people.into())?;
        Ok(world)
    }

    /// The start that was asked for, if there is one: a place of `world` where a robot of
    /// `radius_m` (metres) can stand. Where none was asked for it is the nearest such place to the
    /// world's own start, or none if that is one itself.
    ///
    /// # Errors
    /// [`StartError`] where the robot cannot stand, or if it can stand nowhere, or not drive from
    /// there.
    pub fn start_in(&self, world: &World, radius_m: f64) -> Result<Option<Pose2>, StartError> {
        let start = match self.start {
            Some(start) => check_start(world, &start, radius_m).map(|()| Some(start))?,
            None => match check_start(world, &world.start(), radius_m) {
                Ok(()) => None,
                Err(error) => Some(error.nearest.ok_or(error)?),
            },
        };
        check_way(world, &start.unwrap_or_else(|| world.start()), radius_m)?;
        Ok(start)
    }
}

/// How many people there are.
#[cfg(feature = "cli")]
fn people(text: &str) -> Result<u16, String> {
    use std::num::IntErrorKind;
    text.parse().map_err(|error: std::num::ParseIntError| match error.kind() {
        IntErrorKind::PosOverflow => {
            format!("{text} people are too many for any world: it may be {} at most", u16::MAX)
        }
        _ => format!("'{text}' is not how many people there are: a whole number from 0 on"),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_people_than_have_room_are_refused() {
        let with = |people| SimSetup { people, ..SimSetup::of("museum") }.load();
        assert!(with(150).is_ok());
        let said = with(5000).err().map(|error| error.to_string()).unwrap_or_default();
        assert!(said.starts_with("5000 people are too many for world 'museum'"), "{said}");
        assert!(said.ends_with("(one on each 2 m²)"), "{said}");
    }

    #[cfg(feature = "cli")]
    #[test]
    fn a_number_of_people_is_refused_in_words() {
        assert_eq!(people("20"), Ok(20));
        assert!(people("100000").is_err_and(|said| said.contains("too many for any world")));
        for text in ["-1", "1.5", "many", ""] {
            assert!(people(text).is_err_and(|said| said.contains("a whole number")), "{text}");
        }
    }
}
