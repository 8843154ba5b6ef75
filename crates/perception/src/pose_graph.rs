//! Sparse pose-graph optimisation in the plane: poses, and what was measured between pairs of them.
//!
//! Levenberg-damped Gauss-Newton on the normal equations, which are solved by a sparse Cholesky
//! factorisation (`faer`). Edges that may be wrong (loop closures) are weighed down by the
//! Geman-McClure kernel, which is made steep gradually (Yang et al., "Graduated non-convexity for
//! robust spatial perception", RA-L 2020): a true loop that is far off at the start is not thrown
//! away, a false one that contradicts the others ends without weight.

mod constraint;
mod normal_equations;

pub use constraint::{PoseConstraint, chi2, residual};

use crate::pose::{Pose2, pose, wrap_angle};
use normal_equations::NormalEquations;
use serde::{Deserialize, Serialize};

/// Parameters of the optimisation.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct GraphConfig {
    /// Most iterations. Default 40.
    pub max_iterations: usize,
    /// Ends when no pose moves farther in an iteration, metres. Default 1e-4.
    pub least_step_m: f64,
    /// Squared Mahalanobis distance at which a doubtful edge has lost three quarters of its weight.
    /// Default 200.
    pub doubt_chi2: f64,
    /// Whether doubt begins mildly and grows: for poses that may be far off. Without, edges that
    /// have lost their weight hardly get it back, and few iterations are enough. Default true.
    pub is_graduated: bool,
}

impl Default for GraphConfig {
    fn default() -> Self {
        Self { max_iterations: 40, least_step_m: 1e-4, doubt_chi2: 200.0, is_graduated: true }
    }
}

/// Why a graph was not optimised; the poses are as they were.
#[derive(Clone, Debug, thiserror::Error)]
pub enum GraphError {
    /// An edge names a pose that is not there.
    #[error("an edge joins pose {from} to pose {to}, but there are {poses} poses")]
    NoSuchPose {
        /// Its first end.
        from: usize,
        /// Its second end.
        to: usize,
        /// How many there are.
        poses: usize,
    },
    /// Some pose is not fixed by any chain of edges, or a number is not finite.
    #[error("the system of {poses} poses and {edges} edges has no unique solution")]
    Singular {
        /// How many poses.
        poses: usize,
        /// How many edges.
        edges: usize,
    },
}

/// Moves `poses` to where the edges are satisfied best. Pose 0 stays.
///
/// # Errors
/// [`GraphError`]; the poses are then unchanged.
pub fn optimise(poses: &mut [Pose2], edges: &[PoseConstraint], config: &GraphConfig) -> Result<(), GraphError> {
    let count = poses.len();
    if let Some(edge) = edges.iter().find(|edge| edge.from >= count || edge.to >= count) {
        return Err(GraphError::NoSuchPose { from: edge.from, to: edge.to, poses: count });
    }
    if count < 2 {
        return Ok(());
    }
    let singular = || GraphError::Singular { poses: count, edges: edges.len() };
    let mut equations = NormalEquations::new(count, edges).ok_or_else(singular)?;
    let mut estimate = poses.to_vec();
    let worst = edges.iter().filter(|edge| edge.is_doubtful).map(|edge| chi2(edge, &estimate)).fold(0.0, f64::max);
    let mut widening = if config.is_graduated { (worst / config.doubt_chi2).max(1.0) } else { 1.0 };
    for _ in 0..config.max_iterations {
        let step = equations.step(&estimate, edges, config.doubt_chi2 * widening).ok_or_else(singular)?;
        let mut farthest = 0.0_f64;
        for (pose_here, step) in estimate.iter_mut().skip(1).zip(step.chunks_exact(3)) {
            farthest = farthest.max(step[0].hypot(step[1]));
            *pose_here = pose(
                pose_here.translation.x + step[0],
                pose_here.translation.y + step[1],
                wrap_angle(pose_here.rotation.angle() + step[2]),
            );
        }
        if widening <= 1.0 && farthest < config.least_step_m {
            break;
        }
        widening = (widening / 2.0).max(1.0);
    }
    poses.copy_from_slice(&estimate);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, Vector3};

    fn information(sigma_m: f64, sigma_rad: f64) -> Matrix3<f64> {
        Matrix3::from_diagonal(&Vector3::new(sigma_m.powi(-2), sigma_m.powi(-2), sigma_rad.powi(-2)))
    }

    /// Once around a square of side 10 m in steps of 1 m, turning 90° at the corners.
    fn square() -> Vec<Pose2> {
        let mut poses = vec![pose(0.0, 0.0, 0.0)];
        for step in 1..=40 {
            let turn = if step % 10 == 0 { std::f64::consts::FRAC_PI_2 } else { 0.0 };
            let last = poses[poses.len() - 1];
            poses.push(last * pose(1.0, 0.0, 0.0) * pose(0.0, 0.0, turn));
        }
        poses
    }

    fn chain(truth: &[Pose2], error: Pose2) -> Vec<PoseConstraint> {
        let edge = |index: usize| PoseConstraint {
            from: index,
            to: index + 1,
            measured: truth[index].inverse() * truth[index + 1] * error,
            information: information(0.02, 0.01),
            is_doubtful: false,
        };
        (0..truth.len() - 1).map(edge).collect()
    }

    fn driven(edges: &[PoseConstraint]) -> Vec<Pose2> {
        edges.iter().fold(vec![Pose2::identity()], |mut poses, edge| {
            poses.push(poses[poses.len() - 1] * edge.measured);
            poses
        })
    }

    fn loop_edge(truth: &[Pose2], from: usize, to: usize, error: Pose2) -> PoseConstraint {
        let measured = truth[from].inverse() * truth[to] * error;
        PoseConstraint { from, to, measured, information: information(0.02, 0.005), is_doubtful: true }
    }

    fn worst_m(poses: &[Pose2], truth: &[Pose2]) -> f64 {
        let off = |(a, b): (&Pose2, &Pose2)| (a.translation.vector - b.translation.vector).norm();
        poses.iter().zip(truth).map(off).fold(0.0, f64::max)
    }

    #[test]
    fn a_loop_is_closed_and_a_false_closure_ignored() {
        let truth = square();
        let mut edges = chain(&truth, pose(0.0, 0.0, 0.01));
        let mut poses = driven(&edges);
        assert!(worst_m(&poses, &truth) > 1.0);
        edges.push(loop_edge(&truth, 0, 40, Pose2::identity()));
        edges.push(loop_edge(&truth, 1, 39, Pose2::identity()));
        edges.push(loop_edge(&truth, 5, 25, pose(7.0, -3.0, 1.0)));
        optimise(&mut poses, &edges, &GraphConfig::default()).unwrap_or_else(|error| panic!("{error}"));
        assert!(worst_m(&poses, &truth) < 0.35, "{}", worst_m(&poses, &truth));
        assert!(worst_m(&poses[40..], &truth[40..]) < 0.02);
        assert!(chi2(&edges[edges.len() - 1], &poses) > 1000.0);
    }

    #[test]
    fn nonsense_is_refused_and_changes_nothing() {
        let truth = square();
        let mut edges = chain(&truth, Pose2::identity());
        let mut poses = driven(&edges);
        edges[3].to = 99;
        assert!(matches!(optimise(&mut poses, &edges, &GraphConfig::default()), Err(GraphError::NoSuchPose { .. })));
        edges[3].to = 4;
        edges[3].information[(0, 0)] = f64::NAN;
        assert!(matches!(optimise(&mut poses, &edges, &GraphConfig::default()), Err(GraphError::Singular { .. })));
        assert!(worst_m(&poses, &truth) < 1e-9);
    }
}
