//! The figures as Markdown, ours beside those that the paper prints.

use super::paper::{self, Printed};
use super::results::{PLOTS, TableEntry, WorldResults};
use crate::output::{none, number};
use crate::systems::{Column, System};
use crate::trials::TrialArgs;
use crate::trials::figures::AsPaper;
use clap::ValueEnum;
use std::fmt::Write;

/// How a row reads a system's figures, and the paper's.
type Ours = fn(&TableEntry) -> String;
type Theirs = fn(&Printed) -> Option<String>;

/// A row of a table.
#[derive(Clone, Copy)]
struct Row {
    title: &'static str,
    ours: Ours,
    theirs: Theirs,
    /// Whether it says something about a changed building. Paths and storage are those of the map
    /// as it was.
    is_told_when_changed: bool,
}

const fn row(title: &'static str, ours: Ours, theirs: Theirs) -> Row {
    Row { title, ours, theirs, is_told_when_changed: false }
}

impl Row {
    const fn also_when_changed(self) -> Self {
        Self { is_told_when_changed: true, ..self }
    }
}

const ROWS: [Row; 20] = [
    row("storage, KB (1000 B)", storage, |p| Some(format!("{:.2}", p.storage_kb))),
    row(
        "success, % (95 % confidence)",
        |e| {
            let [low, high] = e.relocalize.success_ci95.map(percent);
            format!("{:.1} ({low:.0} to {high:.0})", percent(e.relocalize.success))
        },
        |p| p.success.map(|success| format!("{success:.1}")),
    )
    .also_when_changed(),
    row(
        "success from the authors' own starts",
        |e| {
            let of = |share: f64| {
                let trials = e.relocalize.authors_trials;
                format!("{:.0} of {trials}", share * trials as f64)
            };
            e.relocalize.authors_success.map_or_else(none, of)
        },
        |_| None,
    )
    .also_when_changed(),
    row("success within 15 m, %", |e| format!("{:.1}", percent(e.relocalize.success_within_15_m)), |_| None)
        .also_when_changed(),
    row("starts with a false fix", |e| format!("{} of {}", e.relocalize.false_fixes, e.relocalize.trials), |_| None)
        .also_when_changed(),
    row(
        "l_reloca, m: first right and declared",
        |e| plus_minus([e.relocalize.l_reloca_mean_m, e.relocalize.l_reloca_std_m], 2),
        |p| Some(plus_minus(p.l_reloca, 2)),
    )
    .also_when_changed(),
    row(
        "right at some time, declared or not, %; after m",
        |e| format!("{:.1}; {}", percent(e.relocalize.guessed_success), number(e.relocalize.l_guessed_mean_m, 2)),
        |_| None,
    )
    .also_when_changed(),
    row(
        "ε_t, %",
        |e| plus_minus([e.relocalize.epsilon_t_percent, e.relocalize.epsilon_t_std_percent], 3),
        |p| Some(plus_minus(p.epsilon_t, 3)),
    ),
    row(
        "ε_θ, degrees",
        |e| plus_minus([e.relocalize.epsilon_theta_deg, e.relocalize.epsilon_theta_std_deg], 3),
        |p| Some(plus_minus(p.epsilon_theta, 3)),
    ),
    row(
        "error, median: m, degrees",
        |e| format!("{}, {}", number(e.relocalize.error_median_m, 3), number(e.relocalize.error_median_deg, 2)),
        |_| None,
    )
    .also_when_changed(),
    row(
        "as the paper judges (its own starts, declared or not): success, %",
        |e| as_paper(e, |it| number(percent(it.success), 1)),
        |p| p.success.map(|success| format!("{success:.1}")),
    ),
    row(
        "as the paper judges: l_reloca, m",
        |e| as_paper(e, |it| plus_minus(it.l_reloca_m, 2)),
        |p| Some(plus_minus(p.l_reloca, 2)),
    ),
    row(
        "as the paper judges: ε_t, %",
        |e| as_paper(e, |it| plus_minus(it.epsilon_t_percent, 3)),
        |p| Some(plus_minus(p.epsilon_t, 3)),
    ),
    row(
        "as the paper judges: ε_θ, degrees",
        |e| as_paper(e, |it| plus_minus(it.epsilon_theta_deg, 3)),
        |p| Some(plus_minus(p.epsilon_theta, 3)),
    ),
    row(
        "time a frame, ms: mean, greatest",
        |e| format!("{}, {}", number(e.relocalize.frame_ms_mean, 1), number(e.relocalize.frame_ms_max, 0)),
        |_| None,
    ),
    row(
        "C_path: mean (greatest)",
        |e| match (e.c_path_mean, e.c_path_max) {
            (Some(mean), Some(max)) => format!("{mean:.3} ({max:.2})"),
            _ => none(),
        },
        |p| Some(format!("{:.2} ({:.2})", p.c_path[0], p.c_path[1])),
    ),
    row("C_path: 95 % are below", |e| e.c_path_p95.map_or_else(none, |value| format!("{value:.3}")), |_| None),
    row(
        "C_path of the authors' own pairs: mean (greatest)",
        |e| e.authors_c_path.map_or_else(none, |[mean, max]| format!("{mean:.3} ({max:.2})")),
        |_| None,
    ),
    row(
        "paths that touch something; refused",
        |e| format!("{}; {} of {}", e.paths_blocked, e.paths_refused, e.paths),
        |_| None,
    ),
    row("time a path, ms", |e| number(e.plan_ms_mean, 2), |_| None),
];

fn percent(share: f64) -> f64 {
    100.0 * share
}

fn as_paper(entry: &TableEntry, cell: impl Fn(&AsPaper) -> String) -> String {
    entry.relocalize.as_paper.as_ref().map_or_else(none, cell)
}

fn plus_minus([mean, deviation]: [f64; 2], decimals: usize) -> String {
    match (mean.is_finite(), deviation.is_finite()) {
        (false, _) => none(),
        (true, false) => number(mean, decimals),
        (true, true) => format!("{mean:.decimals$} ± {deviation:.decimals$}"),
    }
}

fn storage(entry: &TableEntry) -> String {
    let kb = |bytes: usize| bytes as f64 / 1000.0;
    let deflated = entry.storage_deflated_bytes.map(|bytes| format!(" ({:.2} deflated)", kb(bytes)));
    format!("{:.2}{}", kb(entry.storage_bytes), deflated.unwrap_or_default())
}

/// The whole page.
pub fn markdown(all: &[WorldResults], trials: &TrialArgs, pairs: usize, plots: &[&str]) -> String {
    let mut page = Page::default();
    page.line("# Results\n");
    page.line(&format!(
        "Written by `evaluate tables`: {} starts in each world, drives of at most {} m, {pairs} pairs of\n\
         places. *Italics* are the figures that the paper prints.\n",
        trials.starts, trials.drive_m
    ));
    page.line(RULES);
    for results in all {
        let scene = paper::scene(&results.world).map_or_else(String::new, |scene| format!(" (the paper's {scene})"));
        page.line(&format!("## {}{scene}\n", results.world));
        page.line("### Comparison with other maps (the paper's table II)\n");
        let systems = [System::Ours, System::OursLidar, System::MrTopomap, System::Amcl, System::AmclNav2];
        page.table(results, &systems, Column::AsMapped, paper::comparison);
        if results.entry(System::MainOnly, Column::AsMapped).is_some() {
            page.line("### Hierarchical architecture (the paper's table III)\n");
            page.table(results, &[System::MainOnly, System::Ours], Column::AsMapped, paper::ablation);
        }
        if results.entry(System::Ours, Column::FurnitureMoved).is_some() {
            page.line(&format!("### Furniture moved: {} things gone, shifted or new\n", results.changes));
            page.table(results, System::value_variants(), Column::FurnitureMoved, |_, _| None);
        }
        page.storage(results);
        for name in plots.iter().filter(|name| name.contains(&format!("-{}", results.world))) {
            page.line(&format!("![{name}]({PLOTS}/{name})\n"));
        }
    }
    page.0
}

const RULES: &str = "\
* Maps come from one exploration with drifting wheels and our SLAM, never from the truth; all
  systems get theirs from the same one. The robot that relocalizes has another light, another camera
  gain, other wheels and another trajectory; that trajectory is recorded before any system sees it
  and is the same for all.
* A robot succeeds when it *declares* a pose that is right, within 1 m and 5° (paper), before the
  drive ends. The paper judges poses whether declared or not: that is the row *right at some time*.
  A false fix is a declared pose that is wrong.
* AMCL declares when its heaviest cluster has 90 % of the weight and standard deviations below 1 m
  and 30° (Nav2: 0.5 m and 15°); MR-TopoMap when five nodes were recognised and the standard
  errors are below 1 m and 10°. These limits were chosen in their favour.
* The rows *as the paper judges* compare like with like: the starts that its authors used, as far as
  they can be recovered, and the first right pose, declared or not. From starts drawn anywhere, with
  poses that must be declared, the baselines are lower than printed. MR-TopoMap takes the place of a
  node that it recognises for its own, metres away: its poses are right now and then long before
  they agree well enough to be declared, and some that agree are wrong. AMCL's 5,000 particles
  (Nav2: 2,000) are few for a building without a first guess; where none starts near the truth, the
  paper's parameters have no recovery, and Nav2's draws new particles too slowly for drives of this
  length.
* The paper divides paths by the grid's own, whose C_path is 1.00 by that; here the grid's paths
  keep the explorer's distance from its cells, and are a little longer than the shortest.
* ε_t is the error as a share of the distance from the start to the map's origin; starts within 1 m
  of it are left out.
* C_path is the length over that of the shortest way on the true plan for the same robot, a disc of
  0.105 m. The grid's paths are A* on the explorer's grid, pulled straight. A path touches something
  where the simulator's bumper would.
* Times are those of a machine that was also compiling and running other trials.
* The grid's storage is a byte for each cell of the cropped grid (paper); MR-TopoMap's is counted in
  our coding.
";

#[derive(Default)]
struct Page(String);

impl Page {
    fn line(&mut self, line: &str) {
        // Writing to a string cannot fail.
        writeln!(self.0, "{line}").unwrap_or_default();
    }

    fn table(
        &mut self,
        results: &WorldResults,
        systems: &[System],
        column: Column,
        printed: fn(&str, System) -> Option<Printed>,
    ) {
        let entries: Vec<&TableEntry> = systems.iter().filter_map(|&system| results.entry(system, column)).collect();
        let titles: Vec<&str> = entries.iter().map(|entry| entry.relocalize.system.title()).collect();
        self.line(&format!("| | {} |", titles.join(" | ")));
        self.line(&format!("| --- |{}", " --- |".repeat(entries.len())));
        let is_told = |row: &Row| column != Column::FurnitureMoved || row.is_told_when_changed;
        for Row { title, ours, theirs, .. } in ROWS.into_iter().filter(is_told) {
            let cell = |entry: &&TableEntry| {
                let theirs = printed(&results.world, entry.relocalize.system).as_ref().and_then(theirs);
                format!("{}{}", ours(entry), theirs.map_or_else(String::new, |theirs| format!(" *{theirs}*")))
            };
            self.line(&format!("| {title} | {} |", entries.iter().map(cell).collect::<Vec<_>>().join(" | ")));
        }
        self.line("");
    }

    fn storage(&mut self, results: &WorldResults) {
        let storage = &results.storage;
        let [main, support, edges] = storage.counts;
        self.line(&format!(
            "### Storage of the FHT-Map: {} B for {main} main nodes, {support} support nodes and {edges} edges\n",
            storage.total
        ));
        self.line("| what | bytes | share |\n| --- | --- | --- |");
        for (part, bytes) in &storage.parts {
            self.line(&format!("| {part} | {bytes} | {:.1} % |", 100.0 * *bytes as f64 / storage.total.max(1) as f64));
        }
        self.line(&format!(
            "\nThe explorer's grid is {} B as the paper counts it, and {} B deflated; MR-TopoMap {} B.\n",
            storage.grid_raw, storage.grid_deflated, storage.topo_map
        ));
    }
}
