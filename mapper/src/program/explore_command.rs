//! `mapper explore` on the command line.

use super::arguments::ExploreArgs;
use super::explore::{ExploreProgress, ExploreTask, explore};
use super::report::ExploreReport;
use super::running::{RunEnd, exploring_spinner, increments, runtime};
use super::settings::MapperFile;
use fht_program::{ProgramFailure, Stop, print_line};
use fht_sim::scoring::TrajectoryError;
use fht_sim::{SimConfig, check_world};
use fht_worker::Pace;
use indicatif::ProgressBar;
use std::path::{Path, PathBuf};

impl ExploreArgs {
    /// Refuses a run that would destroy one of its own files; `config` is that of its
    /// configuration.
    pub(super) fn check_files(&self, config: Option<&Path>) -> Result<(), ProgramFailure> {
        let world = self.setup.files();
        let world = world.iter().map(|file| ("the world", Some(file.as_path())));
        let picture = self.run.picture("explore", Path::new(&self.setup.world), Some(self.setup.seed));
        self.run.check_files(world.chain([("the configuration", config)]), picture.as_ref())
    }

    /// The folder for what is not acknowledged, if there is one: this flag's, or what the file
    /// says.
    pub(super) fn spool_over(&self, file: Option<PathBuf>) -> Result<Option<PathBuf>, String> {
        let spool = self.spool.clone().or(file);
        match spool.as_ref().filter(|spool| spool.exists() && !spool.is_dir()) {
            Some(file) => {
                Err(format!("the spool {} is no folder; it must be one, or not be there yet", file.display()))
            }
            None => Ok(spool),
        }
    }

    /// These flags over what the file says.
    fn task(&self, file: MapperFile, stop: Stop) -> Result<ExploreTask, String> {
        // What is no world gives no map its name.
        check_world(&self.setup.world).map_err(|error| error.to_string())?;
        let mut mapping = self.run.over(&file, Path::new(&self.setup.world))?;
        mapping.cameras &= !self.no_cameras;
        mapping.spool = self.spool_over(mapping.spool)?;
        mapping.max_s = self.max_sim.unwrap_or(mapping.max_s);
        mapping.mapper.join.looks_again |= self.again;
        if self.real_time {
            mapping.mapper.pace = Pace::RealTime;
        }
        let usual_rate = (mapping.mapper.pace == Pace::RealTime).then_some(1.0);
        Ok(ExploreTask {
            setup: self.setup.clone(),
            sim: SimConfig {
                light_seed: self.light_seed.unwrap_or(file.sim.light_seed),
                drift_factor: self.drift.unwrap_or(file.sim.drift_factor),
                ..file.sim
            },
            rate: self.run.rate.or(file.mapper.rate).or(usual_rate),
            record: self.run.record.clone(),
            picture: self.run.picture("explore", Path::new(&self.setup.world), Some(self.setup.seed)),
            stop,
            mapping,
        })
    }
}

/// Runs `mapper explore`; `false` if the map is not complete, or the server did not take all of it.
pub(super) fn explore_world(args: &ExploreArgs, file: MapperFile, stop: Stop) -> Result<bool, ProgramFailure> {
    args.graph.check_none_given().map_err(ProgramFailure::of_input)?;
    let task = args.task(file, stop.clone()).map_err(ProgramFailure::of_input)?;
    let (linger_s, spool) = (task.mapping.linger_s, task.mapping.spool.clone());
    let runtime = runtime().map_err(ProgramFailure::of_run)?;
    tracing::info!(map = %task.mapping.map, robot = %task.mapping.robot, world = %args.setup.world, "explores");
    let bar = if args.run.quiet || args.progress_json { ProgressBar::hidden() } else { exploring_spinner() };
    let progress_json = args.progress_json;
    let (watched, is_offline) = (bar.clone(), args.run.offline);
    let watch = move |snapshot: ExploreProgress| {
        if progress_json {
            print_line!(
                "{}",
                serde_json::json!({
                    "sim_s": snapshot.sim_s,
                    "free_area_m2": snapshot.free_area_m2,
                    "nodes": snapshot.nodes,
                    "written": snapshot.written,
                    "acknowledged": snapshot.acknowledged,
                    "placed": snapshot.placed,
                })
            );
        }
        let place = if snapshot.placed { "" } else { "looking for its place in the map, " };
        watched.set_message(format!(
            "{place}{:.0} m² free, {} nodes on the map, {}, {:.0} s of robot time",
            snapshot.free_area_m2,
            snapshot.nodes,
            increments(snapshot.written, snapshot.acknowledged, is_offline),
            snapshot.sim_s
        ));
        watched.tick();
    };
    let outcome = runtime.block_on(explore(task, watch));
    bar.finish_and_clear();
    let report = outcome.map_err(|error| ProgramFailure::of(error.is_input(), error))?;
    let in_words = (!args.progress_json).then_some(print_report as fn(&ExploreReport));
    let given = args.run.give(&report, in_words);
    let end = RunEnd {
        map: &report.map,
        is_offline: args.run.offline,
        linger_s,
        is_asked_to_end: stop.is_set(),
        spool: spool.as_deref(),
    };
    end.conclude(&report.kept, given)
}

fn print_report(report: &ExploreReport) {
    match report.explored_fraction {
        Some(fraction) => print_line!("explored    {:.1} % of {:.0} m²", fraction * 100.0, report.free_area_m2),
        None => print_line!("explored    unknown: the robot never found its place in the map"),
    }
    print_line!("ended       {}", report.map.ending);
    if let Some([seconds, metres]) = report.joined.filter(|[seconds, _]| *seconds > 0.0) {
        print_line!("joined      the map after {seconds:.0} s and {metres:.1} m");
    }
    report.map.print_size("");
    let error = report.trajectory_error.map_or("errors unknown".to_owned(), |error| {
        let TrajectoryError { mean_m, max_m, mean_deg } = error;
        format!("mean error {mean_m:.3} m and {mean_deg:.2}°, greatest {max_m:.3} m")
    });
    print_line!("trajectory  {:.1} m driven, {error}, {} collisions", report.driven_m, report.collisions);
    let closures = report.map.closures.iter().sum::<usize>();
    match (report.main_nodes_within_5cm, report.main_node_error_max_m) {
        (Some(within), Some(error_max_m)) => print_line!(
            "nodes       {:.0} % of the {} main nodes that it made within 0.05 m of the truth, greatest error \
             {error_max_m:.3} m; {closures} loop closures",
            within * 100.0,
            report.own_main_nodes
        ),
        _ => print_line!("nodes       none of the main nodes is this robot's; {closures} loop closures"),
    }
    print_line!(
        "time        {:.0} s of robot time in {:.1} s; slowest frame {:.0} ms",
        report.sim_s,
        report.wall_s,
        report.map.frame_max_ms
    );
    print_line!("digest      {}", report.map.digest);
    report.kept.print();
}

#[cfg(test)]
mod tests {
    use super::super::arguments::{Cli, Command};
    use super::*;
    use clap::Parser;

    fn task(flags: &[&str]) -> ExploreTask {
        let text = "connect.endpoints = ['tcp/file:1']
            robot = { name = 'amr-7', map = 'hall' }
            sim.light_seed = 4
            [mapper]
            spool = 'spool'
            max_sim_s = 100
            pace = 'real_time'
            slam.grid.max_range_m = 5";
        let file = fht_program::parse(text, Path::new("robot.toml")).unwrap();
        task_over(flags, file).unwrap()
    }

    fn task_over(flags: &[&str], file: MapperFile) -> Result<ExploreTask, String> {
        let cli = Cli::try_parse_from(["mapper", "explore"].iter().chain(flags)).unwrap();
        let Some(Command::Explore(args)) = cli.command else { panic!("another command") };
        args.task(file, Stop::default())
    }

    #[test]
    fn what_is_no_world_is_refused_before_a_map_is_named_after_it() {
        for more in [&[][..], &["--map", "hall"]] {
            let flags = [&["--offline", "--world", "my office"][..], more].concat();
            let said = task_over(&flags, MapperFile::default()).err().unwrap_or_default();
            assert!(said.starts_with("unknown world 'my office'"), "{said}");
        }
    }

    #[test]
    fn flags_go_before_the_file_and_the_file_before_the_defaults() {
        let of_file = task(&[]);
        assert_eq!((of_file.mapping.robot.as_str(), of_file.mapping.map.as_str()), ("amr-7", "hall"));
        assert_eq!(of_file.mapping.link.map(|link| link.connect), Some(vec!["tcp/file:1".to_owned()]));
        assert_eq!((of_file.mapping.max_s, of_file.mapping.linger_s, of_file.rate), (100.0, 60.0, Some(1.0)));
        assert_eq!((of_file.sim.light_seed, of_file.sim.drift_factor), (4, 1.0));
        assert_eq!((of_file.mapping.mapper.slam.grid.max_range_m, of_file.mapping.mapper.pace), (5.0, Pace::RealTime));
        assert_eq!(of_file.mapping.spool.as_deref(), Some(Path::new("spool")));

        let flags = ["--robot", "b", "--map", "m", "--connect", "tcp/flag:1", "--max-sim", "7", "--linger", "8"];
        let of_flags = task(&[&flags[..], &["--light-seed", "9", "--rate", "3", "--spool", "s", "--again"]].concat());
        assert_eq!((of_flags.mapping.robot.as_str(), of_flags.mapping.map.as_str()), ("b", "m"));
        assert_eq!(of_flags.mapping.link.map(|link| link.connect), Some(vec!["tcp/flag:1".to_owned()]));
        assert_eq!((of_flags.mapping.max_s, of_flags.mapping.linger_s, of_flags.rate), (7.0, 8.0, Some(3.0)));
        assert_eq!((of_flags.sim.light_seed, of_flags.mapping.mapper.join.looks_again), (9, true));
        assert_eq!(of_flags.mapping.spool.as_deref(), Some(Path::new("s")));
        // Nothing is delivered, so nothing is kept for it.
        assert!(task(&["--offline"]).mapping.spool.is_none());
    }
}
