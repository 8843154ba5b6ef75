//! Graphs to search: square grids, the same disturbed, and buildings.

use fht_map::graph::road_graph::RoadGraph;
use fht_proto::{AuthorId, EdgeKey, FixedPoint, NodeId};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Spacing of nodes, millimetres.
const SPACING_MM: i32 = 1000;

/// Nodes by their number and edges between them.
#[derive(Clone, Default)]
pub struct Graph {
    pub positions: Vec<FixedPoint>,
    pub edges: Vec<(u32, u32)>,
}

pub fn id(number: u32) -> NodeId {
    NodeId { author: AuthorId(1), number }
}

pub fn key((a, b): (u32, u32)) -> EdgeKey {
    EdgeKey::new(id(a), id(b))
}

impl Graph {
    pub fn roads(&self) -> RoadGraph {
        let nodes = (0..).map(id).zip(self.positions.iter().copied());
        RoadGraph::new(nodes, self.edges.iter().copied().map(key))
    }

    fn add(&mut self, x_mm: i32, y_mm: i32) -> u32 {
        self.positions.push(FixedPoint { x_mm, y_mm });
        self.positions.len() as u32 - 1
    }

    /// Nodes with 1 m between them, each joined to its four neighbours.
    fn grid_at(&mut self, x_mm: i32, y_mm: i32, columns: i32, rows: i32) -> u32 {
        let first = self.positions.len() as u32;
        for row in 0..rows {
            for column in 0..columns {
                let node = self.add(x_mm + column * SPACING_MM, y_mm + row * SPACING_MM);
                self.edges.extend((column > 0).then(|| (node - 1, node)));
                self.edges.extend((row > 0).then(|| (node - columns as u32, node)));
            }
        }
        first
    }
}

/// A square grid of `side` × `side` nodes.
pub fn grid(side: u32) -> Graph {
    let mut graph = Graph::default();
    graph.grid_at(0, 0, side as i32, side as i32);
    graph
}

/// The same with nodes moved by up to 30 % of the spacing each way, and without 10 % of the edges.
pub fn disturbed(side: u32) -> Graph {
    let mut graph = grid(side);
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    disturb(&mut graph, &mut rng);
    graph.edges.retain(|_| rng.random_range(0..10) > 0);
    graph
}

fn disturb(graph: &mut Graph, rng: &mut ChaCha8Rng) {
    for place in &mut graph.positions {
        place.x_mm += rng.random_range(-300..=300);
        place.y_mm += rng.random_range(-300..=300);
    }
}

/// A row of buildings of six storeys. A storey has eight corridors of 200 m with rooms of 5 × 5
/// nodes on either side, and a cross corridor at both ends. Rooms have one door, and a third of
/// them a second one to the next room. Two stairs join storeys, and one way of 30 m joins
/// buildings. Nodes are moved by up to 30 % of the spacing. A building has 106,464 nodes.
pub fn buildings(count: i32) -> Graph {
    const CORRIDORS: i32 = 8;
    const LENGTH: i32 = 200;
    const ROOM: i32 = 5;
    const ACROSS: i32 = CORRIDORS * (2 * ROOM + 1);
    let mut graph = Graph::default();
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let mut way_in: Option<u32> = None;
    for building in 0..count {
        let x_mm = building * (LENGTH + 40) * SPACING_MM;
        let mut stairs: Option<[u32; 2]> = None;
        for _storey in 0..6 {
            let ends = [-1, LENGTH].map(|column| graph.grid_at(x_mm + column * SPACING_MM, 0, 1, ACROSS));
            for corridor in 0..CORRIDORS {
                let row = corridor * (2 * ROOM + 1) + ROOM;
                let middle = graph.grid_at(x_mm, row * SPACING_MM, LENGTH, 1);
                graph.edges.push((middle, ends[0] + row as u32));
                graph.edges.push((middle + LENGTH as u32 - 1, ends[1] + row as u32));
                for (first_row, door_row) in [(row - ROOM, ROOM - 1), (row + 1, 0)] {
                    let mut before = None;
                    for room in 0..LENGTH / ROOM {
                        let at = (x_mm + room * ROOM * SPACING_MM, first_row * SPACING_MM);
                        let first = graph.grid_at(at.0, at.1, ROOM, ROOM);
                        let door = rng.random_range(0..ROOM);
                        let inside = first + (door_row * ROOM + door) as u32;
                        graph.edges.push((inside, middle + (room * ROOM + door) as u32));
                        let side = (2 * ROOM) as u32;
                        let through = before.filter(|_| rng.random_range(0..3) == 0);
                        graph.edges.extend(through.map(|before| (before + side + ROOM as u32 - 1, first + side)));
                        before = Some(first);
                    }
                }
            }
            graph.edges.extend(stairs.into_iter().flat_map(|below| [(below[0], ends[0]), (below[1], ends[1] + 40)]));
            if stairs.is_none() {
                if let Some(from) = way_in {
                    let way = graph.grid_at(x_mm - 35 * SPACING_MM, 20 * SPACING_MM, 30, 1);
                    graph.edges.extend([(from, way), (way + 29, ends[0] + 20)]);
                }
                way_in = Some(ends[1] + 20);
            }
            stairs = Some([ends[0] + 3, ends[1] + 44]);
        }
    }
    disturb(&mut graph, &mut rng);
    graph
}
