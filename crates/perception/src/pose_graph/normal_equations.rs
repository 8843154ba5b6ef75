//! The normal equations of a pose graph: three unknowns for each pose but the first, which stays.
//!
//! Which blocks of 3 × 3 they have depends on the edges alone, so the order of elimination, the
//! pattern and the place of each edge's blocks therein are found out once for all steps. The order
//! is found for poses rather than for single unknowns, of which there are three times as many.

use super::constraint::{PoseConstraint, geman_mcclure, residual};
use crate::pose::Pose2;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::perm::PermRef;
use faer::sparse::linalg::amd;
use faer::sparse::linalg::cholesky::{SymbolicCholesky, SymmetricOrdering, factorize_symbolic_cholesky};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, MatMut, Par, Side};
use nalgebra::{Matrix2, Matrix3, Vector2};

/// Added to each unknown's own information: a pose that no edge holds stays where it is rather than
/// making everything unsolvable.
const DAMPING: f64 = 1e-6;

/// See the module's documentation. Unknown `3 · rank[pose - 1] + k` is x, y or yaw of a pose.
pub(super) struct NormalEquations {
    /// The place of each pose but the first in the order of elimination.
    rank: Vec<usize>,
    /// The upper triangle's columns: without a permutation, `faer` wants that one.
    column_starts: Vec<usize>,
    rows: Vec<usize>,
    values: Vec<f64>,
    /// For each edge between two poses that move: which block of its column it adds to.
    blocks: Vec<usize>,
    symbolic: SymbolicCholesky<usize>,
    factor: Vec<f64>,
    room: MemBuffer,
}

impl NormalEquations {
    /// The equations of `poses` poses, all of whose edges are between these.
    pub fn new(poses: usize, edges: &[PoseConstraint]) -> Option<Self> {
        let count = poses - 1;
        let rank = elimination_order(count, edges)?;
        // Above the diagonal, column by column.
        let mut pairs: Vec<(usize, usize)> = edges.iter().filter_map(|edge| pair(edge, &rank)).collect();
        pairs.sort_unstable();
        pairs.dedup();
        let blocks = edges.iter().map(|edge| {
            let Some((column, row)) = pair(edge, &rank) else { return 0 };
            let first = pairs.partition_point(|pair| *pair < (column, 0));
            pairs.partition_point(|pair| *pair < (column, row)) - first
        });
        let blocks = blocks.collect();
        let mut column_starts = Vec::with_capacity(3 * count + 1);
        let mut rows = Vec::with_capacity(6 * count + 9 * pairs.len());
        let mut rest = pairs.as_slice();
        for column in 0..count {
            let (here, after) = rest.split_at(rest.partition_point(|pair| pair.0 == column));
            rest = after;
            for k in 0..3 {
                column_starts.push(rows.len());
                rows.extend(here.iter().flat_map(|(_, row)| (0..3).map(move |i| 3 * row + i)));
                rows.extend((0..=k).map(|i| 3 * column + i));
            }
        }
        column_starts.push(rows.len());
        let size = 3 * count;
        let pattern = SymbolicSparseColMatRef::new_checked(size, size, &column_starts, None, &rows);
        let symbolic =
            factorize_symbolic_cholesky(pattern, Side::Upper, SymmetricOrdering::Identity, Default::default()).ok()?;
        let need = symbolic
            .factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default())
            .or(symbolic.solve_in_place_scratch::<f64>(1, Par::Seq));
        let room = MemBuffer::try_new(need).ok()?;
        let (values, factor) = (vec![0.0; rows.len()], vec![0.0; symbolic.len_val()]);
        Some(Self { rank, column_starts, rows, values, blocks, symbolic, factor, room })
    }

    /// One Gauss-Newton step: three numbers for each pose but the first.
    pub fn step(&mut self, poses: &[Pose2], edges: &[PoseConstraint], width2: f64) -> Option<Vec<f64>> {
        let size = 3 * self.rank.len();
        self.values.fill(0.0);
        let mut unknowns = vec![0.0; size];
        for (number, edge) in edges.iter().enumerate() {
            let (from, to) = (&poses[edge.from], &poses[edge.to]);
            let error = residual(edge, from, to);
            let weight = match edge.is_doubtful {
                true => geman_mcclure(error.dot(&(edge.information * error)), width2),
                false => 1.0,
            };
            let information = edge.information * weight;
            let (of_from, of_to) = jacobians(from, to);
            let (from_side, to_side) = (of_from.transpose() * information, of_to.transpose() * information);
            for (end, jacobian, side) in [(edge.from, &of_from, &from_side), (edge.to, &of_to, &to_side)] {
                if let Some(&rank) = end.checked_sub(1).and_then(|end| self.rank.get(end)) {
                    self.add_diagonal(rank, &(side * jacobian));
                    let part = side * error;
                    (0..3).for_each(|k| unknowns[3 * rank + k] -= part[k]);
                }
            }
            if let Some((column, _)) = pair(edge, &self.rank) {
                let is_column_from = self.rank[edge.from - 1] == column;
                let block = if is_column_from { to_side * of_from } else { from_side * of_to };
                self.add_above(column, self.blocks[number], &block);
            }
        }
        for rank in 0..self.rank.len() {
            (1..=3).for_each(|k| self.values[self.column_starts[3 * rank + k] - 1] += DAMPING);
        }
        self.solve(&mut unknowns)?;
        let step: Vec<f64> = self.rank.iter().flat_map(|rank| unknowns[3 * rank..3 * rank + 3].to_vec()).collect();
        step.iter().all(|value| value.is_finite()).then_some(step)
    }

    fn add_diagonal(&mut self, rank: usize, block: &Matrix3<f64>) {
        for k in 0..3 {
            let start = self.column_starts[3 * rank + k + 1] - (k + 1);
            (0..=k).for_each(|i| self.values[start + i] += block[(i, k)]);
        }
    }

    fn add_above(&mut self, column: usize, number: usize, block: &Matrix3<f64>) {
        for k in 0..3 {
            let start = self.column_starts[3 * column + k] + 3 * number;
            (0..3).for_each(|i| self.values[start + i] += block[(i, k)]);
        }
    }

    /// Solves the equations that were put together; `unknowns` holds the right side before.
    fn solve(&mut self, unknowns: &mut [f64]) -> Option<()> {
        let size = unknowns.len();
        let pattern = SymbolicSparseColMatRef::new_checked(size, size, &self.column_starts, None, &self.rows);
        let matrix = SparseColMatRef::new(pattern, self.values.as_slice());
        let room = MemStack::new(&mut self.room);
        let (side, none) = (Side::Upper, Default::default());
        let factors = self
            .symbolic
            .factorize_numeric_llt(&mut self.factor, matrix, side, none, Par::Seq, room, Default::default())
            .ok()?;
        let unknowns = MatMut::from_column_major_slice_mut(unknowns, size, 1);
        factors.solve_in_place_with_conj(Conj::No, unknowns, Par::Seq, room);
        Some(())
    }
}

/// Column and row, above the diagonal, of the block of an edge between two poses that move.
fn pair(edge: &PoseConstraint, rank: &[usize]) -> Option<(usize, usize)> {
    let (from, to) = (rank[edge.from.checked_sub(1)?], rank[edge.to.checked_sub(1)?]);
    (from != to).then(|| (from.max(to), from.min(to)))
}

/// The place of each pose in an order of elimination that fills in little (approximate minimum
/// degree).
fn elimination_order(count: usize, edges: &[PoseConstraint]) -> Option<Vec<usize>> {
    let identity: Vec<usize> = (0..count).collect();
    let mut pairs: Vec<(usize, usize)> = edges.iter().filter_map(|edge| pair(edge, &identity)).collect();
    pairs.extend(identity.iter().map(|&pose| (pose, pose)));
    pairs.sort_unstable();
    pairs.dedup();
    let starts: Vec<usize> = (0..=count).map(|column| pairs.partition_point(|pair| pair.0 < column)).collect();
    let rows: Vec<usize> = pairs.iter().map(|pair| pair.1).collect();
    let pattern = SymbolicSparseColMatRef::new_checked(count, count, &starts, None, &rows);
    let (mut order, mut rank) = (vec![0; count], vec![0; count]);
    let mut room = MemBuffer::try_new(amd::order_scratch::<usize>(count, rows.len())).ok()?;
    amd::order(&mut order, &mut rank, pattern, amd::Control::default(), MemStack::new(&mut room)).ok()?;
    PermRef::new_checked(&order, &rank, count);
    Some(rank)
}

/// Derivatives of [`residual`] by x, y, yaw of both poses.
fn jacobians(from: &Pose2, to: &Pose2) -> (Matrix3<f64>, Matrix3<f64>) {
    let (sin, cos) = (from.rotation.im, from.rotation.re);
    let into_from = Matrix2::new(cos, sin, -sin, cos);
    let apart: Vector2<f64> = to.translation.vector - from.translation.vector;
    let by_yaw = Vector2::new(-sin * apart.x + cos * apart.y, -cos * apart.x - sin * apart.y);
    let mut of_from = Matrix3::zeros();
    of_from.fixed_view_mut::<2, 2>(0, 0).copy_from(&-into_from);
    of_from.fixed_view_mut::<2, 1>(0, 2).copy_from(&by_yaw);
    of_from[(2, 2)] = -1.0;
    let mut of_to = Matrix3::zeros();
    of_to.fixed_view_mut::<2, 2>(0, 0).copy_from(&into_from);
    of_to[(2, 2)] = 1.0;
    (of_from, of_to)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pose::pose;
    use nalgebra::{DMatrix, DVector, Vector3};
    use proptest::prelude::*;

    const POSES: usize = 9;

    fn any_pose() -> impl Strategy<Value = Pose2> {
        (-5.0..5.0_f64, -5.0..5.0_f64, -3.0..3.0_f64).prop_map(|(x, y, yaw)| pose(x, y, yaw))
    }

    fn any_edge() -> impl Strategy<Value = PoseConstraint> {
        let ends = (0..POSES, 1..POSES).prop_map(|(from, by)| (from, (from + by) % POSES));
        (ends, any_pose(), 1.0..100.0_f64, any::<bool>()).prop_map(|((from, to), measured, weight, is_doubtful)| {
            let information = Matrix3::from_diagonal(&Vector3::new(weight, 2.0 * weight, 10.0));
            PoseConstraint { from, to, measured, information, is_doubtful }
        })
    }

    /// The same step from a dense matrix.
    fn dense_step(poses: &[Pose2], edges: &[PoseConstraint], width2: f64) -> DVector<f64> {
        let mut matrix = DMatrix::identity(3 * POSES, 3 * POSES) * DAMPING;
        let mut right = DVector::zeros(3 * POSES);
        for edge in edges {
            let error = residual(edge, &poses[edge.from], &poses[edge.to]);
            let chi2 = error.dot(&(edge.information * error));
            let weight = if edge.is_doubtful { geman_mcclure(chi2, width2) } else { 1.0 };
            let (of_from, of_to) = jacobians(&poses[edge.from], &poses[edge.to]);
            let mut jacobian = DMatrix::zeros(3, 3 * POSES);
            jacobian.view_mut((0, 3 * edge.from), (3, 3)).copy_from(&of_from);
            jacobian.view_mut((0, 3 * edge.to), (3, 3)).copy_from(&of_to);
            let weighted = jacobian.transpose() * edge.information * weight;
            matrix += &weighted * &jacobian;
            right -= weighted * error;
        }
        let moving = 3 * (POSES - 1);
        let factor = matrix.view((3, 3), (moving, moving)).into_owned().cholesky();
        factor.map_or_else(|| DVector::zeros(moving), |factor| factor.solve(&right.rows(3, moving)))
    }

    proptest! {
        #[test]
        fn a_step_is_that_of_the_dense_equations(poses in proptest::collection::vec(any_pose(), POSES),
                                                 mut edges in proptest::collection::vec(any_edge(), 1..30)) {
            // A chain, so that all are held.
            edges.extend((1..POSES).map(|to| PoseConstraint {
                from: to - 1, to, measured: pose(1.0, 0.0, 0.1), information: Matrix3::identity(), is_doubtful: false,
            }));
            let mut equations = NormalEquations::new(POSES, &edges).expect("it has a pattern");
            for width2 in [10.0, 1000.0] {
                let step = DVector::from_vec(equations.step(&poses, &edges, width2).expect("all are held"));
                let dense = dense_step(&poses, &edges, width2);
                prop_assert!((&step - &dense).amax() < 1e-6 * (1.0 + dense.amax()), "{step} {dense}");
            }
        }
    }
}
