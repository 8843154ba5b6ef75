//! The neighbours of every node and the distances to them, side by side in one array.
//!
//! A block of the array holds the arcs of one node. Its size is the least power of two that fits
//! them. A node that outgrows its block moves to another one, and the old block waits for the next
//! node that needs its size. So the arcs stay compact while the map changes, and a change touches
//! only the blocks of its two ends.

/// Greatest length that an arc stores, micrometres (4.29 km). A longer one stores [`LONG`].
const LONG: u32 = u32::MAX;
/// Arcs in the smallest block.
const MIN_BLOCK: usize = 2;

/// One direction of an edge.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Arc {
    /// Where it leads.
    pub to: u32,
    stored_um: u32,
}

impl Arc {
    fn new(to: u32, length_um: u64) -> Self {
        Self { to, stored_um: u32::try_from(length_um).unwrap_or(LONG) }
    }

    /// Its length, micrometres; `None` if it is too long to be stored.
    #[inline]
    pub(crate) fn stored_um(self) -> Option<u32> {
        (self.stored_um != LONG).then_some(self.stored_um)
    }
}

#[derive(Clone, Copy, Debug, Default)]
struct Block {
    start: u32,
    len: u32,
}

/// The arcs of all nodes. A node is a number from 0; both directions of an edge are stored.
#[derive(Clone, Debug, Default)]
pub(crate) struct Adjacency {
    blocks: Vec<Block>,
    arcs: Vec<Arc>,
    /// Blocks that nobody uses, by the logarithm of their size.
    free: Vec<Vec<u32>>,
}

/// Arcs that a block for `len` of them has room for.
fn room(len: usize) -> usize {
    if len == 0 { 0 } else { len.next_power_of_two().max(MIN_BLOCK) }
}

impl Adjacency {
    /// Nodes, those without arcs included.
    pub(crate) fn len(&self) -> usize {
        self.blocks.len()
    }

    /// The arcs of a node; none if there is no such node.
    #[inline]
    pub(crate) fn arcs(&self, node: u32) -> &[Arc] {
        let block = self.blocks.get(node as usize).copied().unwrap_or_default();
        let start = block.start as usize;
        self.arcs.get(start..start + block.len as usize).unwrap_or_default()
    }

    /// Adds nodes without arcs until there are `len`.
    pub(crate) fn grow(&mut self, len: usize) {
        self.blocks.resize(len.max(self.blocks.len()), Block::default());
    }

    /// The arcs of `nodes` nodes, in blocks that lie in the order of the nodes. Each edge must be
    /// given once, and its ends must be nodes.
    pub(crate) fn of(nodes: usize, edges: &[(u32, u32, u64)]) -> Self {
        let mut blocks = vec![Block::default(); nodes];
        for end in edges.iter().flat_map(|&(a, b, _)| [a, b]) {
            blocks[end as usize].len += 1;
        }
        let mut start = 0;
        for block in &mut blocks {
            block.start = start;
            start += room(block.len as usize) as u32;
            block.len = 0;
        }
        let mut arcs = vec![Arc::default(); start as usize];
        for &(a, b, length_um) in edges {
            for (from, to) in [(a, b), (b, a)] {
                let block = &mut blocks[from as usize];
                arcs[(block.start + block.len) as usize] = Arc::new(to, length_um);
                block.len += 1;
            }
        }
        Self { blocks, arcs, free: Vec::new() }
    }

    /// Joins two nodes, or gives the edge that joins them another length. Whether there was no edge
    /// before.
    pub(crate) fn put(&mut self, a: u32, b: u32, length_um: u64) -> bool {
        let is_new = self.put_arc(a, Arc::new(b, length_um));
        self.put_arc(b, Arc::new(a, length_um));
        is_new
    }

    /// Takes an edge away. Whether there was one.
    pub(crate) fn remove(&mut self, a: u32, b: u32) -> bool {
        let was_there = self.remove_arc(a, b);
        self.remove_arc(b, a);
        was_there
    }

    /// Whether an edge joins two nodes; looks at the end with fewer arcs.
    pub(crate) fn is_joined(&self, a: u32, b: u32) -> bool {
        let (from, to) = if self.arcs(a).len() <= self.arcs(b).len() { (a, b) } else { (b, a) };
        self.arcs(from).iter().any(|arc| arc.to == to)
    }

    fn put_arc(&mut self, from: u32, arc: Arc) -> bool {
        let Some(&block) = self.blocks.get(from as usize) else { return false };
        let (start, len) = (block.start as usize, block.len as usize);
        if let Some(kept) = self.arcs[start..start + len].iter_mut().find(|kept| kept.to == arc.to) {
            *kept = arc;
            return false;
        }
        self.resize(from, len + 1);
        let start = self.blocks[from as usize].start as usize;
        self.arcs[start + len] = arc;
        true
    }

    fn remove_arc(&mut self, from: u32, to: u32) -> bool {
        let Some(&block) = self.blocks.get(from as usize) else { return false };
        let (start, len) = (block.start as usize, block.len as usize);
        let Some(place) = self.arcs[start..start + len].iter().position(|arc| arc.to == to) else { return false };
        self.arcs.swap(start + place, start + len - 1);
        self.resize(from, len - 1);
        true
    }

    /// Gives a node a block for `len` arcs, those that fit taken along.
    fn resize(&mut self, node: u32, len: usize) {
        let block = self.blocks[node as usize];
        let (before, after) = (room(block.len as usize), room(len));
        let mut start = block.start;
        if before != after {
            start = self.take(after);
            let from = block.start as usize;
            self.arcs.copy_within(from..from + len.min(block.len as usize), start as usize);
            self.give_back(block.start, before);
        }
        // Neither nodes nor arcs come near 2³²: the map that they are of would not fit into
        // memory.
        self.blocks[node as usize] = Block { start, len: len as u32 };
    }

    fn take(&mut self, size: usize) -> u32 {
        if size == 0 {
            return 0;
        }
        let waiting = self.free.get_mut(size.ilog2() as usize).and_then(Vec::pop);
        waiting.unwrap_or_else(|| {
            let start = self.arcs.len();
            self.arcs.resize(start + size, Arc::default());
            start as u32
        })
    }

    fn give_back(&mut self, start: u32, size: usize) {
        if size == 0 {
            return;
        }
        let class = size.ilog2() as usize;
        if self.free.len() <= class {
            self.free.resize(class + 1, Vec::new());
        }
        self.free[class].push(start);
    }

    /// Bytes on the heap.
    pub(crate) fn bytes(&self) -> usize {
        let free: usize = self.free.iter().map(|starts| starts.capacity() * size_of::<u32>()).sum();
        self.blocks.capacity() * size_of::<Block>() + self.arcs.capacity() * size_of::<Arc>() + free
    }
}
