//! Puts a map of the toy room (see `04_own_robot`) on a server, so that there is something to try
//! the other examples with. Your maps are made by explorers; this shows what they are made of:
//! nodes with scans, free rectangles, edges.
//!
//! `cargo run --release -p fht --example 00_toy_room -- tcp/localhost:7447 toy`

#[path = "04_own_robot.rs"]
#[allow(dead_code)]
mod own_robot;

use fht::wire::{AuthorId, EdgeKey, NodeKind, Op, Rect, Signature};
use fht::{Map, NodeId, Pose2, pose, to_fixed};
use own_robot::Toy;

/// Where the nodes are, and the free rectangle around each: `[min_x, min_y, max_x, max_y]`, metres.
const NODES: [([f64; 2], [f64; 4]); 6] = [
    ([1.2, 1.2], [0.0, 0.0, 4.0, 3.0]),
    ([4.0, 1.5], [2.0, 0.0, 6.0, 3.0]),
    ([6.8, 1.2], [4.0, 0.0, 8.0, 3.0]),
    ([1.2, 3.8], [0.0, 2.0, 3.0, 5.0]),
    ([4.0, 3.8], [2.0, 0.0, 5.0, 5.0]),
    ([7.1, 4.0], [6.0, 2.0, 8.0, 5.0]),
];
const EDGES: [(u32, u32); 7] = [(0, 1), (1, 2), (0, 3), (1, 4), (3, 4), (2, 5), (0, 4)];

#[tokio::main]
async fn main() {
    if let Err(error) = run().await {
        eprintln!("{error}"); // an error that main returns is printed with Debug
        std::process::exit(1);
    }
}

async fn run() -> Result<(), Box<dyn std::error::Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [endpoint, name] = [args.first(), args.get(1)].map(|arg| arg.map(String::as_str));
    // There is no such map yet: the first increment begins it.
    let map = Map::connect(endpoint.unwrap_or("tcp/localhost:7447"), name.unwrap_or("toy")).create().await?;

    let author = "toy-surveyor";
    let id = |number| NodeId { author: AuthorId::of_robot(author), number };
    let mut ops = Vec::new();
    for (number, ([x, y], [min_x, min_y, max_x, max_y])) in (0..).zip(NODES) {
        let map_from_node: Pose2 = pose(x, y, 0.0);
        let at = to_fixed(&map_from_node);
        let scan = Toy::at(map_from_node).scan().to_record();
        ops.push(Op::PutNode { id: id(number), kind: NodeKind::Main, pose: at });
        ops.push(Op::SetSignature { id: id(number), signature: Signature { descriptor: None, scan } });
        let rect = Rect::around(at.position, (min_x, min_y), (max_x, max_y));
        ops.push(Op::SetFreeSpace { id: id(number), rect: Some(rect) });
    }
    ops.extend(EDGES.map(|(a, b)| Op::PutEdge { edge: EdgeKey::new(id(a), id(b)) }));

    let head = map.author(author).write(ops).await?;
    println!("map {}: {} nodes, {} edges, version {}", head.map, head.main_nodes, head.edges, head.version);
    Ok(())
}
