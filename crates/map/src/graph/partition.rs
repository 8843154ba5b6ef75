//! Cuts a graph into pieces of bounded size that few edges join.
//!
//! Pieces grow in rounds, as graph partitioners make graphs coarser (heavy-edge matching; Karypis
//! and Kumar 1998): each piece, from the lowest number on, joins the neighbour with the most edges
//! between them for their sizes, unless one of the two has joined another one in this round.

use crate::graph::road_graph::GraphShape;

/// The piece of every node, numbered from 0 in the order of their first nodes, and how many there
/// are.
pub(crate) fn pieces(shape: &GraphShape, most_nodes: usize) -> (Vec<u32>, usize) {
    let nodes = shape.adjacency.len() as u32;
    let mut piece: Vec<u32> = (0..nodes).collect();
    let mut sizes = vec![1_u32; nodes as usize];
    // Both directions of each edge between pieces, sorted, with the number of edges that it stands
    // for.
    let mut links: Vec<(u32, u32, u32)> =
        (0..nodes).flat_map(|node| shape.adjacency.arcs(node).iter().map(move |arc| (node, arc.to, 1))).collect();
    links.sort_unstable();
    loop {
        let partners = partners(&links, &sizes, most_nodes as u64);
        let (renamed, joined) = merge(&partners, &sizes);
        // The last rounds join a few each; what is left apart is small or has few neighbours.
        let is_last = joined.len() * 50 >= sizes.len() * 49;
        for piece in &mut piece {
            *piece = renamed[*piece as usize];
        }
        sizes = joined;
        links = contracted(&links, &renamed);
        if is_last {
            return (piece, sizes.len());
        }
    }
}

/// Who joins whom; a piece that stays alone is its own partner.
fn partners(links: &[(u32, u32, u32)], sizes: &[u32], most_nodes: u64) -> Vec<u32> {
    let mut partners: Vec<u32> = (0..sizes.len() as u32).collect();
    for links in links.chunk_by(|a, b| a.0 == b.0) {
        let from = links[0].0;
        if partners[from as usize] != from {
            continue;
        }
        let size = |piece: u32| u64::from(sizes[piece as usize]);
        let fits = |to: u32| partners[to as usize] == to && size(from) + size(to) <= most_nodes;
        let mut best: Option<(u32, u32)> = None;
        for &(_, to, count) in links.iter().filter(|link| fits(link.1)) {
            let is_better =
                best.is_none_or(|(other, most)| u64::from(count) * size(other) > u64::from(most) * size(to));
            best = if is_better { Some((to, count)) } else { best };
        }
        if let Some((to, _)) = best {
            (partners[from as usize], partners[to as usize]) = (to, from);
        }
    }
    partners
}

/// New numbers of the pieces, and the sizes of the new ones.
fn merge(partners: &[u32], sizes: &[u32]) -> (Vec<u32>, Vec<u32>) {
    let (mut renamed, mut joined) = (vec![0; partners.len()], Vec::new());
    for (piece, &partner) in (0..).zip(partners) {
        if partner < piece {
            renamed[piece as usize] = renamed[partner as usize];
            joined[renamed[partner as usize] as usize] += sizes[piece as usize];
        } else {
            renamed[piece as usize] = joined.len() as u32;
            joined.push(sizes[piece as usize]);
        }
    }
    (renamed, joined)
}

fn contracted(links: &[(u32, u32, u32)], renamed: &[u32]) -> Vec<(u32, u32, u32)> {
    let between = links.iter().map(|&(a, b, count)| (renamed[a as usize], renamed[b as usize], count));
    let mut between: Vec<(u32, u32, u32)> = between.filter(|(a, b, _)| a != b).collect();
    between.sort_unstable();
    between.dedup_by(|later, kept| {
        let is_same = (later.0, later.1) == (kept.0, kept.1);
        kept.2 += if is_same { later.2 } else { 0 };
        is_same
    });
    between
}
