//! Changes to a Gazebo world: small models removed, shifted or copied.

use super::assembly::Assembly;
use super::floor;
use super::report::ImportReport;
use super::resolve::Paths;
use super::sdf::Placed;
use crate::world::changes::{Change, Changes, Thing, choose};
use nalgebra::{Translation3, Vector2};
use std::collections::BTreeMap;

/// A model with a side longer than this is part of the building, metres.
const LONGEST_MODEL_M: f64 = 2.0;

/// Changes the models that a robot can hit. Returns how many changes there are.
pub(super) fn models(placed: &mut Vec<Placed>, paths: &Paths, changes: &Changes) -> usize {
    let mut assembly = Assembly::new(paths, ImportReport::default());
    let mut extents: BTreeMap<usize, Thing> = BTreeMap::new();
    for visual in placed.iter() {
        let before = assembly.outlines.len();
        assembly.place(visual);
        let known = extents.get(&visual.model).map(|thing| [thing.low, thing.high]);
        let corners = assembly.outlines[before..].iter().flatten().chain(known.iter().flatten());
        if let Some(extent) = Thing::around(corners) {
            extents.insert(visual.model, extent);
        }
    }
    let Some(floor) = floor::find(&assembly.outlines, &mut ImportReport::default()) else { return 0 };
    extents.retain(|_, extent| extent.side_m() < LONGEST_MODEL_M);
    let (models, things): (Vec<usize>, Vec<Thing>) = extents.into_iter().unzip();
    let chosen = choose(&things, &floor.plan, changes);
    let shifted = |visual: &Placed, by: Vector2<f64>| {
        let world_from_visual = Translation3::new(by.x, by.y, 0.0) * visual.world_from_visual;
        Placed { world_from_visual, ..visual.clone() }
    };
    // Copies first: their originals may be removed later.
    let (added, others): (Vec<Change>, Vec<Change>) =
        chosen.iter().copied().partition(|change| matches!(change, Change::Added(..)));
    for change in added.into_iter().chain(others) {
        match change {
            Change::Gone(thing) => placed.retain(|visual| visual.model != models[thing]),
            Change::Shifted(thing, by) => {
                for visual in placed.iter_mut().filter(|visual| visual.model == models[thing]) {
                    *visual = shifted(visual, by);
                }
            }
            Change::Added(centre, Some(like)) => {
                let by = centre - things[like].centre();
                let of_model = placed.iter().filter(|visual| visual.model == models[like]);
                let copies: Vec<Placed> =
                    of_model.map(|visual| Placed { model: usize::MAX, ..shifted(visual, by) }).collect();
                placed.extend(copies);
            }
            Change::Added(_, None) => {}
        }
    }
    chosen.len()
}
