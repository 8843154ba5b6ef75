//! Shortcuts beside the loop: around new nodes, and over what was found.

use super::Mapper;
use crate::construct::{Chain, RefinementJob, Roadmap, Shortcut, grid_around, is_still_free, plan_config};
use fht_navigation::planning::PlanConfig;
use fht_proto::NodeId;

/// Frames between a refinement job and its result.
const REFINE_DELAY_FRAMES: u64 = 10;
/// New nodes that wait for refinement; the oldest is dropped beyond (the last pass looks at all
/// nodes again).
const REFINE_QUEUE: usize = 64;

impl Mapper {
    pub(super) fn look_for_shortcuts(&mut self, node: NodeId) {
        if self.to_refine.len() >= REFINE_QUEUE {
            self.to_refine.pop_front();
        }
        self.to_refine.push_back(node);
    }

    pub(super) fn refine(&mut self, time_us: u64) {
        let due = self.refine.take_due(self.frame);
        self.add_shortcuts(due.unwrap_or_default(), time_us);
        if self.refine.is_idle()
            && let Some(node) = self.to_refine.pop_front()
        {
            let (roadmap, plan) = (Roadmap::of(self.map()), self.plan_config());
            let grid = grid_around(node, &roadmap, self.grid(), &plan, &self.config.refine);
            let job = RefinementJob { roadmap, grid, plan, node };
            self.refine.submit(job, self.frame + REFINE_DELAY_FRAMES);
        }
    }

    /// Free space as edges need it.
    pub(super) fn plan_config(&self) -> PlanConfig {
        plan_config(self.builder.config().edges.half_width_m, self.grid())
    }

    pub(super) fn add_shortcuts(&mut self, found: Vec<Shortcut>, time_us: u64) {
        for shortcut in found {
            let width_m = self.builder.config().edges.half_width_m;
            if is_still_free(&shortcut, self.journal.state(), self.slam.grid(), width_m) {
                let chain = Chain { from: shortcut.from, between: &shortcut.between, to: shortcut.to };
                let ops = self.builder.make_chain(&chain, &mut self.journal, &self.slam.estimate());
                self.write(ops, time_us);
            }
        }
    }
}
