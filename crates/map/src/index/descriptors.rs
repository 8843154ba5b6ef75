//! Main nodes by appearance: all descriptors of a model side by side, so that the most similar are
//! found by reading memory from one end to the other.
//!
//! The answer is that of comparing with every descriptor one by one, to the last bit: products of
//! whole numbers are exact in any order, and equal cosines are ordered by id. Rows may lie in any
//! order, so a row that goes is filled with the last one.

use crate::crdt::state::MapState;
use fht_proto::{Descriptor, ModelId, NodeId};
use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};

/// Numbers that are multiplied at a time; as many as an `i8` product can be added up in, before it
/// is widened.
const LANES: usize = 16;

/// Descriptors of one model and length.
#[derive(Clone, Debug, Default)]
struct Matrix {
    /// Numbers in a row, zeros up to a multiple of [`LANES`] included.
    width: usize,
    values: Vec<i8>,
    norms: Vec<f64>,
    ids: Vec<NodeId>,
}

/// The sum of products.
#[inline]
fn dot(a: &[i8], b: &[i8]) -> i32 {
    let mut sums = [0_i32; LANES];
    for (a, b) in a.as_chunks::<LANES>().0.iter().zip(b.as_chunks::<LANES>().0) {
        for lane in 0..LANES {
            sums[lane] += i32::from(a[lane]) * i32::from(b[lane]);
        }
    }
    sums.iter().sum()
}

fn padded(values: &[i8]) -> Vec<i8> {
    let mut padded = values.to_vec();
    padded.resize(values.len().next_multiple_of(LANES), 0);
    padded
}

/// A cosine that can be ordered.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Cosine(f32);

impl Eq for Cosine {}

impl Ord for Cosine {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.0.total_cmp(&other.0)
    }
}

impl PartialOrd for Cosine {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Matrix {
    fn push(&mut self, id: NodeId, values: &[i8], norm: f64) -> usize {
        let row = padded(values);
        self.width = row.len();
        self.values.extend(row);
        self.norms.push(norm);
        self.ids.push(id);
        self.ids.len() - 1
    }

    /// Takes a row away. The node whose row is there now, if another one is.
    fn remove(&mut self, row: usize) -> Option<NodeId> {
        let last = self.ids.len() - 1;
        self.values.copy_within(last * self.width.., row * self.width);
        self.values.truncate(last * self.width);
        self.norms.swap_remove(row);
        self.ids.swap_remove(row);
        self.ids.get(row).copied()
    }

    fn most_similar(&self, values: &[i8], norm: f64, k: usize) -> Vec<(NodeId, f32)> {
        let asked = padded(values);
        // The worst on top, so that it can go.
        let mut best: BinaryHeap<Reverse<(Cosine, Reverse<NodeId>)>> = BinaryHeap::new();
        let mut worst = f32::NEG_INFINITY;
        for ((row, &row_norm), &id) in self.values.chunks_exact(self.width.max(1)).zip(&self.norms).zip(&self.ids) {
            let cosine = (f64::from(dot(&asked, row)) / (norm * row_norm)) as f32;
            if cosine < worst {
                continue;
            }
            best.push(Reverse((Cosine(cosine), Reverse(id))));
            if best.len() > k {
                best.pop();
                worst = best.peek().map_or(f32::NEG_INFINITY, |Reverse((cosine, _))| cosine.0);
            }
        }
        let found = best.into_sorted_vec();
        found.into_iter().map(|Reverse((cosine, Reverse(id)))| (id, cosine.0)).collect()
    }
}

/// The descriptors of a map's main nodes. What has no direction (all numbers are 0) is like nothing
/// and not kept.
#[derive(Clone, Debug, Default)]
pub struct DescriptorIndex {
    matrices: BTreeMap<(ModelId, usize), Matrix>,
    rows: BTreeMap<NodeId, ((ModelId, usize), usize)>,
}

/// Length of a descriptor, in steps; `None` if it has no direction.
fn norm(descriptor: &Descriptor) -> Option<f64> {
    let squares: i64 = descriptor.values.iter().map(|&value| i64::from(value) * i64::from(value)).sum();
    (squares > 0).then(|| (squares as f64).sqrt())
}

impl DescriptorIndex {
    /// The descriptors of all main nodes shown.
    #[must_use]
    pub fn of_map(map: &MapState) -> Self {
        let mut all = Self::default();
        for node in map.main_nodes() {
            all.put(node.id, node.descriptor());
        }
        all
    }

    /// Gives a node this descriptor, or none.
    pub fn put(&mut self, id: NodeId, descriptor: Option<&Descriptor>) {
        if let Some((key, row)) = self.rows.remove(&id)
            && let Some(matrix) = self.matrices.get_mut(&key)
        {
            if let Some(moved) = matrix.remove(row) {
                self.rows.insert(moved, (key, row));
            }
            if matrix.ids.is_empty() {
                self.matrices.remove(&key);
            }
        }
        if let Some((descriptor, norm)) = descriptor.and_then(|descriptor| Some((descriptor, norm(descriptor)?))) {
            let key = (descriptor.model, descriptor.values.len());
            let row = self.matrices.entry(key).or_default().push(id, &descriptor.values, norm);
            self.rows.insert(id, (key, row));
        }
    }

    /// The `k` nodes whose descriptors are most like `descriptor`, most similar first, with the
    /// cosines: as [`lookup::most_similar`](crate::index::lookup::most_similar) answers.
    #[must_use]
    pub fn most_similar(&self, descriptor: &Descriptor, k: usize) -> Vec<(NodeId, f32)> {
        let matrix = self.matrices.get(&(descriptor.model, descriptor.values.len()));
        let asked = matrix.zip(norm(descriptor));
        asked.map(|(matrix, norm)| matrix.most_similar(&descriptor.values, norm, k)).unwrap_or_default()
    }

    /// Nodes with a descriptor.
    #[must_use]
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Whether no node has a descriptor.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// Bytes on the heap, those of the ids estimated.
    #[must_use]
    pub fn bytes(&self) -> usize {
        let matrix = |matrix: &Matrix| {
            matrix.values.capacity()
                + matrix.norms.capacity() * size_of::<f64>()
                + matrix.ids.capacity() * size_of::<NodeId>()
        };
        let rows = self.rows.len() * (size_of::<(NodeId, ((ModelId, usize), usize))>() + 2);
        self.matrices.values().map(matrix).sum::<usize>() + rows
    }
}
