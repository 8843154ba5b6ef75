//! Bytes of maps: the whole as it travels, by kind of node and by field, beside the grid and MR-TopoMap.

use crate::systems::System;
use fht_map::MapState;
use fht_proto::{AuthorId, EdgeKey, Increment, NodeId, NodeKind, Op, decode};
use fht_tests::survey::Survey;
use fht_tests::systems::topo_map::{TopoMap, TopoMapConfig};
use serde::Serialize;
use std::collections::BTreeMap;

/// Bytes of one world's maps.
#[derive(Clone, Debug, Serialize)]
pub struct Storage {
    /// All increments with their envelopes.
    pub total: usize,
    /// The same by what it is for.
    pub parts: BTreeMap<&'static str, usize>,
    /// Main and support nodes, edges.
    pub counts: [usize; 3],
    /// The explorer's grid, a byte a cell of the cropped grid (paper).
    pub grid_raw: usize,
    /// The same, deflated.
    pub grid_deflated: usize,
    /// MR-TopoMap, in the coding that ours uses.
    pub topo_map: usize,
}

impl Storage {
    /// Of what was explored.
    pub fn of(survey: &Survey) -> Result<Self, String> {
        let mut parts: BTreeMap<&'static str, usize> = BTreeMap::new();
        let mut measured = 0;
        for bytes in &survey.increments {
            let increment = decode::<Increment>(bytes).map_err(|error| error.to_string())?;
            for op in &increment.ops {
                for (part, bytes) in split(op, &survey.map)? {
                    measured += bytes;
                    *parts.entry(part).or_default() += bytes;
                }
            }
        }
        let total: usize = survey.increments.iter().map(Vec::len).sum();
        parts.insert("envelopes", total.saturating_sub(measured));
        let topo_map = TopoMap::build(&survey.passes, &TopoMapConfig::default());
        let counts = survey.map.counts();
        Ok(Self {
            total,
            parts,
            counts: [counts.main_nodes, survey.map.nodes().count() - counts.main_nodes, survey.map.edges().count()],
            grid_raw: survey.grid.raw_bytes(),
            grid_deflated: survey.grid.deflated_bytes(),
            topo_map: topo_map.bytes().map_err(|error| error.to_string())?,
        })
    }

    /// The bytes that a system needs.
    pub fn bytes_of(&self, system: System) -> usize {
        match system {
            System::Ours | System::OursLidar | System::MainOnly => self.total,
            System::MrTopomap => self.topo_map,
            System::Amcl | System::AmclNav2 => self.grid_raw,
        }
    }
}

fn bytes_of(value: &impl Serialize) -> Result<usize, String> {
    postcard::to_stdvec(value).map(|bytes| bytes.len()).map_err(|error| error.to_string())
}

/// An operation with ids as short as they are inside an increment of the same author.
fn without_author(op: &Op) -> Op {
    let local = |id: NodeId| NodeId { author: AuthorId(0), number: id.number };
    let edge_of = |edge: &EdgeKey| EdgeKey::new(local(edge.low()), local(edge.high()));
    match op.clone() {
        Op::PutNode { id, kind, pose } => Op::PutNode { id: local(id), kind, pose },
        Op::RemoveNode { id } => Op::RemoveNode { id: local(id) },
        Op::SetPose { id, pose } => Op::SetPose { id: local(id), pose },
        Op::SetFreeSpace { id, rect } => Op::SetFreeSpace { id: local(id), rect },
        Op::SetSignature { id, signature } => Op::SetSignature { id: local(id), signature },
        Op::PutEdge { edge } => Op::PutEdge { edge: edge_of(&edge) },
        Op::RemoveEdge { edge } => Op::RemoveEdge { edge: edge_of(&edge) },
        Op::PutModel { model } => Op::PutModel { model },
    }
}

/// What the bytes of an operation are for.
fn split(op: &Op, map: &MapState) -> Result<Vec<(&'static str, usize)>, String> {
    let is_main = |id: &NodeId| map.node(*id).is_some_and(|node| node.kind == NodeKind::Main);
    let by_kind = |id: &NodeId, main: &'static str, support: &'static str| if is_main(id) { main } else { support };
    let whole = bytes_of(&without_author(op))?;
    Ok(match op {
        Op::PutNode { id, .. } => vec![(by_kind(id, "main nodes: poses", "support nodes: poses"), whole)],
        Op::SetPose { id, .. } => vec![(by_kind(id, "main nodes: corrections", "support nodes: corrections"), whole)],
        Op::SetFreeSpace { id, .. } => {
            vec![(by_kind(id, "main nodes: rectangles", "support nodes: rectangles"), whole)]
        }
        Op::SetSignature { signature, .. } => {
            let scan = bytes_of(&signature.scan)?;
            vec![("main nodes: scans", scan), ("main nodes: descriptors", whole.saturating_sub(scan))]
        }
        Op::PutEdge { .. } | Op::RemoveEdge { .. } => vec![("edges", whole)],
        Op::PutModel { .. } => vec![("the descriptor's model", whole)],
        Op::RemoveNode { .. } => vec![("nodes removed", whole)],
    })
}
