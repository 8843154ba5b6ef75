//! `evaluate relocalize`: robots dropped anywhere find out where they are, on the same drives for
//! every system.

use crate::files::Files;
use crate::maps::{self, MapArgs, Variant, cases, short_name};
use crate::output::{OutputArgs, say};
use crate::systems::{Column, System};
use crate::trials::figures::{RelocalizeFigures, relocalize_figures};
use crate::trials::{Start, TrialArgs, TrialKey, Trials};

use clap::Args;
use fht_descriptor::DescriptorNet;
use fht_eval::Ledger;
use fht_eval::Survey;
use fht_eval::systems::Localizing;
use fht_eval::systems::amcl::field::FieldConfig;
use fht_eval::systems::amcl::{Amcl, AmclConfig, AmclMap};
use fht_eval::systems::ours::Ours;
use fht_eval::systems::topo_map::{TopoMap, TopoMapConfig, TopoRobot};
use fht_eval::{RecordedDrive, Sight};
use fht_eval::{TrialOutcome, run_trial};
use fht_localization::landmarks::Landmarks;
use fht_perception::pose::{Point2, Pose2};
use fht_sim::{Changes, SimConfig, World};
use std::collections::BTreeMap;
use std::sync::Arc;

#[derive(Debug, Args)]
pub struct RelocalizeArgs {
    #[command(flatten)]
    pub maps: MapArgs,
    #[command(flatten)]
    pub trials: TrialArgs,
    #[command(flatten)]
    pub output: OutputArgs,
}

/// A robot of another day: other light, other camera gain, other wheels than the explorer's.
const OTHER_DAY: u64 = 1000;
/// The same for the authors' starts.
const AUTHORS_DAY: u64 = 900_000;
/// Room around a start, metres.
const CLEARANCE_M: f64 = 0.25;
/// Share of the movable things that have moved.
const CHANGES: Changes = Changes { share: 0.1, seed: 7 };

impl RelocalizeArgs {
    /// What it reads and writes.
    pub fn files(&self) -> Files {
        Files::of(&self.output).in_worlds(&self.maps.worlds)
    }
}

pub fn run(args: &RelocalizeArgs) -> Result<(), String> {
    let mut all: Vec<RelocalizeFigures> = Vec::new();
    for trials in measure(&args.maps, &args.trials, &args.output)? {
        let figures = relocalize_figures(&trials);
        say(&figures.line())?;
        all.push(figures);
    }
    args.output.write(&all)
}

/// Runs all trials that are not known yet.
pub fn measure(maps: &MapArgs, args: &TrialArgs, output: &OutputArgs) -> Result<Vec<Trials>, String> {
    let mut net = DescriptorNet::load(None).map_err(|error| error.to_string())?;
    let mut ledger = maps.ledger("trials.jsonl")?;
    let mut all = Vec::new();
    for world in &maps.worlds {
        let bench = Bench::new(maps, world, &args.systems)?;
        for &column in &args.columns {
            all.extend(bench.measure(column, args, output, &mut net, &mut ledger)?);
        }
    }
    Ok(all)
}

/// A world some time after it was mapped.
pub fn changed(world: &str) -> Result<World, String> {
    fht_sim::load_with(world, None, 1, Some(&CHANGES)).map_err(|error| error.to_string())
}

/// A world with the maps of all systems.
struct Bench {
    spec: String,
    surveys: BTreeMap<Variant, Survey>,
    landmarks: BTreeMap<Variant, Landmarks>,
    amcl: AmclMap,
    topo_map: TopoMap,
}

impl Bench {
    fn new(maps: &MapArgs, world: &str, systems: &[System]) -> Result<Self, String> {
        let mut surveys = BTreeMap::from([(Variant::Ours, maps.survey(world, Variant::Ours)?)]);
        if systems.contains(&System::MainOnly) {
            surveys.insert(Variant::MainOnly, maps.survey(world, Variant::MainOnly)?);
        }
        let landmarks = surveys.iter().map(|(&variant, survey)| {
            let mut landmarks = Landmarks::default();
            landmarks.refresh(&survey.map);
            (variant, landmarks)
        });
        let landmarks = landmarks.collect();
        let explored = &surveys[&Variant::Ours];
        let grid = explored.grid.open().map_err(|error| format!("the grid of {world}: {error}"))?;
        let topo_map = TopoMap::build(&explored.passes, &TopoMapConfig::default());
        let amcl = AmclMap::new(&grid, &FieldConfig::default());
        Ok(Self { spec: world.to_owned(), surveys, landmarks, amcl, topo_map })
    }

    fn measure(
        &self,
        column: Column,
        args: &TrialArgs,
        output: &OutputArgs,
        net: &mut DescriptorNet,
        ledger: &mut Ledger<TrialKey, TrialOutcome>,
    ) -> Result<Vec<Trials>, String> {
        let world = self.world(column)?;
        let starts = self.starts(&world, args.starts)?;
        let count = starts.len();
        let template = "{bar:40} {pos}/{len} starts {msg}, {elapsed} gone, {eta} to go";
        let bar = output.progress_bar(starts.len() as u64, template);
        bar.set_message(format!("in {}, {}", maps::short_name(&self.spec), column.title()));
        let mut outcomes: BTreeMap<System, Vec<(Start, TrialOutcome)>> = BTreeMap::new();
        for (start, pose) in starts {
            let key = |system: System| TrialKey {
                world: self.spec.clone(),
                map: self.surveys[&system.variant()].identity.clone(),
                system,
                parameters: system.parameters(),
                column,
                start,
                drive_dm: (args.drive_m * 10.0) as u64,
            };
            let is_known = args.only_kept || args.systems.iter().all(|&system| ledger.has(&key(system)));
            let day = match start {
                Start::Drawn(number) => OTHER_DAY + number,
                Start::Authors(number) => AUTHORS_DAY + number,
            };
            // Wandering and ray casts take seconds, so they are skipped for known results.
            let drive = (!is_known).then(|| RecordedDrive::record(&world, pose, day, args.drive_m));
            let mut sight = drive.as_ref().map(|drive| Sight::new(drive, net));
            for &system in &args.systems {
                if args.only_kept && !ledger.has(&key(system)) {
                    continue;
                }
                let outcome = ledger.get_or(key(system), || {
                    let sight = sight.as_mut().ok_or_else(|| std::io::Error::other("the drive is missing"))?;
                    let world_from_map = self.surveys[&system.variant()].world_from_map;
                    Ok::<_, std::io::Error>(run_trial(self.robot(system, day).as_mut(), sight, &world_from_map))
                });
                let outcome = outcome.map_err(|error| format!("the results cannot be kept: {error}"))?;
                outcomes.entry(system).or_default().push((start, outcome));
            }
            bar.inc(1);
        }
        bar.finish_and_clear();
        outcomes.retain(|_, outcomes| outcomes.len() == count);
        let trials = |(system, outcomes)| Trials { world: short_name(&self.spec), system, column, outcomes };
        Ok(outcomes.into_iter().map(trials).collect())
    }

    fn world(&self, column: Column) -> Result<Arc<World>, String> {
        match column {
            Column::AsMapped => Ok(Arc::clone(&self.surveys[&Variant::Ours].world)),
            Column::FurnitureMoved => changed(&self.spec).map(Arc::new),
        }
    }

    fn starts(&self, world: &World, count: u64) -> Result<Vec<(Start, Pose2)>, String> {
        let drawn = (1..=count).map(|number| (Start::Drawn(number), world.random_free_pose(number, CLEARANCE_M)));
        let authors = cases::of(&self.spec)?.starts;
        let authors = (1..).zip(authors).map(|(number, pose)| (Start::Authors(number), pose));
        // A robot cannot start where something new stands.
        let radius_m = SimConfig::default().radius_m;
        let fits = |pose: &Pose2| world.plan().clearance_m(Point2::from(pose.translation.vector)) > radius_m;
        Ok(drawn.chain(authors.filter(|(_, pose)| fits(pose))).collect())
    }

    fn robot(&self, system: System, seed: u64) -> Box<dyn Localizing + '_> {
        let landmarks = || &self.landmarks[&system.variant()];
        match system {
            System::Ours | System::MainOnly => Box::new(Ours::new(landmarks(), true)),
            System::OursLidar => Box::new(Ours::new(landmarks(), false)),
            System::MrTopomap => Box::new(TopoRobot::new(TopoMapConfig::default(), &self.topo_map)),
            System::Amcl => Box::new(Amcl::new(AmclConfig::paper(), &self.amcl, seed)),
            System::AmclNav2 => Box::new(Amcl::new(AmclConfig::nav2(), &self.amcl, seed)),
        }
    }
}
