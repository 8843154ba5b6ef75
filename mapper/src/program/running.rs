//! What exploring and replaying have in common on the command line.

use super::keeping::Kept;
use super::map_figures::MapFigures;
use super::picture::PictureTask;
use super::settings::MapperFile;
use crate::explore::Ending;
use crate::publish::why_not_acknowledged;
use crate::run::MappingTask;
use clap::Args;
use fht_descriptor::Fetching;
use fht_picture::default_file;
use fht_program::ProgramFailure;
use fht_program::flags::{ConnectArgs, NamedFile, OutputFileError, ReportArgs};
use fht_program::flags::{check_files, new_file, number, output_file, png_file, seconds};
use fht_proto::{MapName, RobotName};
use fht_session::check_owner;
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// `--wait inf`: a year.
const FOR_EVER: Duration = Duration::from_secs(365 * 24 * 3600);

/// The robot's name if neither a flag nor the file says one.
const DEFAULT_ROBOT: &str = "explorer";

#[derive(Debug, Args)]
pub(super) struct RunArgs {
    /// Name of the map; by default that of the world or bag.
    #[arg(long, value_name = "NAME")]
    map: Option<MapName>,
    /// Name of the robot: 1 to 64 of the letters a to z and A to Z, digits, _ or - [default:
    /// explorer].
    #[arg(long, value_name = "NAME")]
    robot: Option<RobotName>,
    #[command(flatten)]
    pub(super) link: ConnectArgs,
    /// Map without a server.
    #[arg(long)]
    pub(super) offline: bool,
    /// Another descriptor model: an ONNX file with its description beside it.
    #[arg(long, value_name = "FILE")]
    model: Option<PathBuf>,
    /// Do not fetch a missing ONNX Runtime library from PyPI: start no process for it.
    #[arg(long)]
    no_fetch: bool,
    /// Simulated or recorded seconds per second; by default as fast as possible.
    #[arg(long, value_name = "FACTOR", value_parser = rate)]
    pub(super) rate: Option<f64>,
    /// How long to wait at the end for the server to acknowledge everything, seconds [default: 60].
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    linger: Option<f64>,
    /// Write the run, with its map, as a bag for ROS 2 and Foxglove: a file (FILE.mcap) or a
    /// rosbag2 folder.
    #[arg(long, value_name = "FILE", value_parser = new_file)]
    pub(super) record: Option<PathBuf>,
    /// Draw the map as it is at the end, as a PNG file; without a name it goes to
    /// explore-WORLD-SEED.png or replay-LOG.png here.
    #[arg(long, value_name = "FILE", value_parser = png_file)]
    picture: Option<Option<PathBuf>>,
    #[command(flatten)]
    pub(super) report: ReportArgs,
    /// No progress bar.
    #[arg(long, short)]
    pub(super) quiet: bool,
}

impl RunArgs {
    /// These flags over what the file says. A map without a name has that of the world or bag at
    /// `source`.
    pub(super) fn over(&self, file: &MapperFile, source: &Path) -> Result<MappingTask, String> {
        let MapperFile { connect, robot, mapper: section, .. } = file;
        let map = match self.map.as_ref().or(robot.map.as_ref()) {
            Some(map) => map.clone(),
            None => {
                let name = source.file_stem().unwrap_or_default().to_string_lossy();
                name.parse().map_err(|error| format!("{error}; give the map a name with --map"))?
            }
        };
        // A picture without a name goes here; one with a name was looked at with the arguments.
        if self.picture == Some(None) {
            let refused = output_file(&default_file("map", &source.to_string_lossy(), None).to_string_lossy());
            if let Some(error) = refused.err().filter(OutputFileError::is_input) {
                return Err(format!("there can be no picture here: {error}"));
            }
        }
        let name = self.robot.as_ref().or(robot.name.as_ref()).map_or(DEFAULT_ROBOT, RobotName::as_str);
        let link = (!self.offline).then(|| self.link.over(connect));
        if let Some(link) = &link {
            check_owner(link, "explorer", name).map_err(|error| error.to_string())?;
        }
        Ok(MappingTask {
            link,
            spool: section.spool.clone().filter(|_| !self.offline),
            window: section.window.clone(),
            model: self.model.as_ref().or(robot.model.as_ref()).cloned(),
            fetching: if self.no_fetch || !robot.fetch { Fetching::Never } else { Fetching::Allowed },
            cameras: robot.cameras,
            max_s: section.max_sim_s,
            wait: self.link.wait.map(|wait_s| Duration::try_from_secs_f64(wait_s).unwrap_or(FOR_EVER).min(FOR_EVER)),
            linger_s: self.linger.unwrap_or(section.linger_s),
            mapper: section.config.clone(),
            ..MappingTask::new(map, name)
        })
    }
}

impl RunArgs {
    /// The picture that was asked for, of what was done (`kind`) in a world or with a log.
    pub(super) fn picture(&self, kind: &str, source: &Path, seed: Option<u64>) -> Option<PictureTask> {
        let named = self.picture.as_ref()?;
        let name = source.file_stem().unwrap_or_default().to_string_lossy();
        let title = seed.map_or_else(|| format!("{kind}: {name}"), |seed| format!("{kind}: {name}, seed {seed}"));
        let file = named.clone().unwrap_or_else(|| default_file(kind, &source.to_string_lossy(), seed));
        Some(PictureTask { file, title })
    }

    /// Prints and writes the figures: as JSON, or as `in_words` does, and then the file that they
    /// were written to is named, too.
    pub(super) fn give<T: Serialize>(&self, report: &T, in_words: Option<fn(&T)>) -> Result<(), String> {
        self.report.give(report, |report| in_words.into_iter().for_each(|print| print(report)))?;
        let named = self.report.report.as_ref().filter(|_| in_words.is_some() && !self.report.json);
        named.into_iter().for_each(|file| fht_program::print_line!("report      {}", file.display()));
        Ok(())
    }

    /// Refuses a run that would destroy one of the files that it reads, which are `inputs` and
    /// those of these flags, or one that it writes.
    pub(super) fn check_files<'a>(
        &'a self,
        inputs: impl IntoIterator<Item = NamedFile<'a>>,
        picture: Option<&'a PictureTask>,
    ) -> Result<(), ProgramFailure> {
        let own: [NamedFile<'a>; 2] =
            [("the model", self.model.as_deref()), ("the Zenoh configuration", self.link.zenoh_config.as_deref())];
        let outputs: [NamedFile<'a>; 3] = [
            ("--record", self.record.as_deref()),
            ("--picture", picture.map(|picture| picture.file.as_path())),
            ("--report", self.report.report.as_deref()),
        ];
        check_files(inputs.into_iter().chain(own), outputs).map_err(ProgramFailure::of_input)
    }
}

/// How many increments there are, for a progress bar.
pub(super) fn increments(written: u64, acknowledged: u64, is_offline: bool) -> String {
    if is_offline {
        format!("{written} increments written")
    } else {
        format!("{acknowledged} of {written} increments stored")
    }
}

/// A runtime for the loop's thread, the publisher and the session.
pub(super) fn runtime() -> Result<tokio::runtime::Runtime, String> {
    fht_program::runtime(2).map_err(|error| format!("the async runtime cannot be started: {error}"))
}

/// How a run ended, for the words that tell it.
pub(super) struct RunEnd<'a> {
    pub(super) map: &'a MapFigures,
    pub(super) is_offline: bool,
    pub(super) linger_s: f64,
    pub(super) is_asked_to_end: bool,
    pub(super) spool: Option<&'a Path>,
}

impl RunEnd<'_> {
    /// Says all of how the run ended, and of what was `kept` beside its figures, before it fails
    /// for figures that could not be `given`.
    pub(super) fn conclude(&self, kept: &Kept, given: Result<(), String>) -> Result<bool, ProgramFailure> {
        let is_good = self.tell() & kept.tell();
        given.map(|()| is_good).map_err(ProgramFailure::of_run)
    }

    /// Says what the server has not taken, and why the map is not complete; true if neither is so.
    fn tell(&self) -> bool {
        let is_taken = self.is_offline || self.map.delivered;
        if self.map.ending == Ending::Interrupted {
            let stored = match (self.is_offline, self.map.delivered) {
                (true, _) => "it was not sent anywhere (--offline)".to_owned(),
                (_, true) => format!("the server has all of its {} increments", self.map.written),
                _ => self.not_taken(),
            };
            fht_program::tell_line!("mapper: interrupted: the map is not complete; {stored}");
        } else if !is_taken && self.is_asked_to_end {
            fht_program::tell_line!(
                "mapper: interrupted while waiting for the server to acknowledge the map; {}",
                self.not_taken()
            );
        } else if !is_taken {
            fht_program::tell_line!(
                "mapper: the server did not acknowledge the whole map within {} s; {}; {}",
                self.linger_s,
                why_not_acknowledged(self.map.refusal.as_deref(), self.map.is_unanswered, self.map.loss),
                self.not_taken()
            );
        } else if self.map.ending != Ending::Complete {
            fht_program::tell_line!("mapper: the map is not complete: {}", self.map.ending);
        }
        is_taken && self.map.ending == Ending::Complete
    }

    fn not_taken(&self) -> String {
        let count = self.map.written.saturating_sub(self.map.acknowledged);
        let fate = self.spool.map_or_else(
            || "lost (--spool DIR keeps them)".to_owned(),
            |dir| {
                let dir = dir.display();
                format!(
                    "kept in {dir} for the next run of this robot on this map, which sends them first (--spool {dir})"
                )
            },
        );
        format!("{count} of {} increments not acknowledged, {fate}", self.map.written)
    }
}

/// What turns while a robot explores: how much there is to explore is not known.
pub(super) fn exploring_spinner() -> ProgressBar {
    let style = ProgressStyle::with_template("{spinner} exploring: {msg}");
    ProgressBar::new_spinner().with_style(style.unwrap_or_else(|_| ProgressStyle::default_spinner()))
}

/// A rate of simulated or recorded time.
fn rate(text: &str) -> Result<f64, String> {
    number(text, 1e-3..=1e6)
}
