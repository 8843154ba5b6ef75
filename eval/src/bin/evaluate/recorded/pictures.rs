//! Pictures of a run: where robots were set down, wrong fixes, and how far they can be believed.

use crate::output::write_file;
use crate::tables::plot::{Axes, Line, svg};
use fht_eval::recorded::{JudgedDrive, JudgedStatement, RecordedFigures, RecordedLog};
use fht_localization::landmarks::Landmarks;
use fht_perception::pose::{Point2, Pose2};
use fht_picture::{Extent, LegendEntry, PictureConfig, Plot, Rgb, Sheet, Swatch};
use std::path::{Path, PathBuf};

const WALL: Rgb = [90, 90, 90];
const TRUE: Rgb = [0, 158, 115];
const DECLARED: Rgb = [213, 94, 0];
const NONE: Rgb = [86, 180, 233];
/// A point of the map makes its pixel so much darker, of 255.
const POINT_LEVELS: u8 = 60;
const DOT_PX: f64 = 2.5;
const START_PX: f64 = 6.0;

/// A folder for pictures.
pub struct Pictures {
    folder: PathBuf,
}

impl Pictures {
    /// Makes the folder.
    pub fn into(folder: &Path) -> Result<Self, String> {
        std::fs::create_dir_all(folder).map_err(|error| format!("{} cannot be made: {error}", folder.display()))?;
        Ok(Self { folder: folder.to_owned() })
    }

    /// Where robots were set down in a run, and each of its wrong fixes.
    pub fn of_run(
        &self,
        log: &RecordedLog,
        landmarks: &Landmarks,
        (name, map): (&str, &str),
        drives: &[JudgedDrive],
    ) -> Result<(), String> {
        let stem = format!("{name}-{}", map.replace(|c: char| !c.is_ascii_alphanumeric(), ""));
        self.starts(landmarks, &stem, drives)?;
        let fixes = drives.iter().filter_map(|drive| Some((drive, drive.fix.as_ref()?)));
        for (drive, fix) in fixes.filter(|(_, fix)| !fix.is_right()) {
            let points = log.frames[fix.said.frame].scan.points_in_base();
            let title = format!(
                "{name}, scan {}: declared {:.1} m and {:.0}° from the truth after {:.1} m, stated {:.4}",
                fix.said.frame, fix.error_m, fix.error_deg, fix.said.driven_m, fix.said.stated
            );
            self.wrong_fix(landmarks, &points, fix, &title, &format!("{stem}-wrong-{}.png", drive.start))?;
        }
        Ok(())
    }

    fn starts(&self, landmarks: &Landmarks, stem: &str, drives: &[JudgedDrive]) -> Result<(), String> {
        let colour = |drive: &JudgedDrive| match &drive.fix {
            Some(fix) if fix.is_right() => TRUE,
            Some(_) => DECLARED,
            None => NONE,
        };
        let place = |drive: &JudgedDrive| {
            let first = drive.statements.first().map(|statement| statement.truth);
            first.map(|pose| (Point2::from(pose.translation.vector), colour(drive)))
        };
        let places: Vec<(Point2, Rgb)> = drives.iter().filter_map(place).collect();
        let dots = |plot: &mut Plot| places.iter().for_each(|(place, colour)| plot.dot(*place, START_PX, *colour));
        let legend = [("right", TRUE), ("wrong", DECLARED), ("none", NONE)];
        let around = places.iter().map(|(place, _)| *place);
        self.draw(
            landmarks,
            around,
            dots,
            &legend,
            &format!("{stem}: where robots were set down"),
            &format!("{stem}.png"),
        )
    }

    fn wrong_fix(
        &self,
        landmarks: &Landmarks,
        points: &[Point2],
        fix: &JudgedStatement,
        title: &str,
        file: &str,
    ) -> Result<(), String> {
        let at = |pose: &Pose2| -> Vec<Point2> { points.iter().map(|point| pose * point).collect() };
        let (truth, declared) = (at(&fix.truth), at(&fix.said.map_from_base));
        let dots = |plot: &mut Plot| {
            truth.iter().for_each(|point| plot.dot(*point, DOT_PX, TRUE));
            declared.iter().for_each(|point| plot.dot(*point, DOT_PX, DECLARED));
        };
        let legend = [("the scan at the true place", TRUE), ("the scan where it was declared", DECLARED)];
        self.draw(landmarks, truth.iter().chain(&declared).copied(), dots, &legend, title, file)
    }

    /// Draws the map and what `dots` draws, coloured as `legend` says.
    fn draw(
        &self,
        landmarks: &Landmarks,
        around: impl Iterator<Item = Point2>,
        dots: impl FnOnce(&mut Plot),
        legend: &[(&'static str, Rgb)],
        title: &str,
        file: &str,
    ) -> Result<(), String> {
        let path = self.folder.join(file);
        let wrong = |error: fht_picture::PictureError| format!("{}: {error}", path.display());
        let walls: Vec<Point2> = landmarks.walls().cloud.positions().collect();
        let extent = Extent::around(around.chain(walls.iter().copied())).ok_or("there is nothing to draw")?;
        let mut plot = Plot::new(extent, &PictureConfig::default()).map_err(wrong)?;
        walls.iter().for_each(|point| plot.darken(*point, POINT_LEVELS));
        dots(&mut plot);
        let mut entries = vec![LegendEntry { swatch: Swatch::Area, colour: WALL, label: "the map's walls" }];
        entries.extend(legend.iter().map(|&(label, colour)| LegendEntry { swatch: Swatch::Dot, colour, label }));
        Sheet { plot: &plot, title, legend: &entries }.save(&path).map_err(wrong)
    }

    /// The reliability diagram: how often what was said was right.
    pub fn reliability(&self, runs: &[RecordedFigures]) -> Result<(), String> {
        let line = |run: &RecordedFigures| {
            let said = run.reliability.iter().filter(|step| step.moments > 0);
            let points = said.map(|step| (step.stated, step.right as f64 / step.moments as f64)).collect();
            Line { label: format!("{}, {}", run.log, run.map), points }
        };
        let mut lines: Vec<Line> = runs.iter().map(line).collect();
        lines.push(Line { label: "as good as its word".to_owned(), points: vec![(0.5, 0.5), (1.0, 1.0)] });
        let axes = Axes {
            title: "Of statements of at least a probability, how many were right",
            x: "stated",
            y: "right",
            x_range: (0.5, 1.0),
            y_range: (0.5, 1.0),
        };
        write_file(&self.folder.join("reliability.svg"), &svg(&axes, &lines))
    }
}
