//! Support nodes for free space that no rectangle covers.

use super::coverage::{CoverageGoal, Gaps, Patch};
use super::edges::edges_of;
use super::{Builder, point};
use crate::haste::Haste;
use crate::publish::Journal;
use crate::slam::SlamEstimate;
use fht_map::MapState;
use fht_perception::grid::OccupancyGrid;
use fht_proto::{EdgeKey, FixedPoint, Increment, NodeId, Op};
use std::collections::HashSet;

impl Builder {
    /// Support nodes for free space that no rectangle covers, with their edges, as many as there is
    /// time for: as long as `haste` says.
    pub fn cover(&mut self, journal: &mut Journal, estimate: &SlamEstimate<'_>, haste: &Haste) -> Vec<Op> {
        // The map as it will be: a new node may have an edge to one that was new before it.
        let mut map = journal.state().clone();
        let mut all = Vec::new();
        for goal in [CoverageGoal::Centre, CoverageGoal::Ground] {
            if !haste.has_time() {
                break;
            }
            let mut gaps = Gaps::of(&map, estimate.grid, &self.config.free_space, &self.config.coverage, goal);
            // Places from which no edge leads to any node that there is yet.
            let mut hopeless: HashSet<FixedPoint> = HashSet::new();
            while let Some(patch) = gaps.take_best()
                && haste.has_time()
            {
                let id = journal.next_node();
                let joined = self.joined(&patch, goal, id, &map, estimate.grid, &mut hopeless);
                let Some((Patch { place, rect }, mut edges)) = joined else {
                    continue; // nobody could get there
                };
                let id = journal.fresh_node();
                edges.truncate(self.config.coverage.most_edges);
                hopeless.retain(|other| other.distance(place) > self.config.edges.longest_m);
                gaps.cover(&patch);
                let put = self.put_support(id, point(place), estimate);
                let ops = [put, Op::SetFreeSpace { id, rect: Some(rect) }].into_iter();
                let ops: Vec<Op> = ops.chain(edges.into_iter().map(|edge| Op::PutEdge { edge })).collect();
                let (author, hlc_us) = (journal.author(), map.max_hlc_us() + 1);
                map.apply(&Increment { author, number: u64::MAX, hlc_us, ops: ops.clone() });
                all.extend(ops);
            }
        }
        all
    }

    /// A patch with a node that has edges. In a gap too narrow for an edge it stands as near to it
    /// as the rectangle allows.
    fn joined(
        &self,
        patch: &Patch,
        goal: CoverageGoal,
        id: NodeId,
        map: &MapState,
        grid: &OccupancyGrid,
        hopeless: &mut HashSet<FixedPoint>,
    ) -> Option<(Patch, Vec<EdgeKey>)> {
        let places = match goal {
            CoverageGoal::Centre => vec![patch.place],
            CoverageGoal::Ground => patch.places(grid),
        };
        places.into_iter().find_map(|place| {
            if hopeless.contains(&place) {
                return None;
            }
            let edges = edges_of(map, grid, id, place, &self.config.edges);
            if edges.is_empty() {
                hopeless.insert(place);
            }
            (!edges.is_empty()).then(|| (patch.seen_from(place), edges))
        })
    }
}
