//! Ground truth between pairs of scans, and the error against it.

use fht_perception::pose::{Pose2, pose, wrap_angle};
use std::path::Path;

/// Greatest difference between a relation's time and its scan's, microseconds.
const TOLERANCE_US: u64 = 1_000;

/// The pose of one scan in the frame of another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Relation {
    /// Times of the scans, microseconds.
    pub times_us: [u64; 2],
    /// Pose of the second in the frame of the first.
    pub first_from_second: Pose2,
}

/// Reads a file of relations, a line each: `t1 t2 x y z roll pitch yaw`. Empty lines and those that
/// begin with `#` are skipped.
pub fn read(path: &Path) -> Result<Vec<Relation>, String> {
    let text = std::fs::read_to_string(path).map_err(|error| format!("{} cannot be read: {error}", path.display()))?;
    let relations = parse(&text).map_err(|error| format!("{}: {error}", path.display()))?;
    if relations.is_empty() {
        return Err(format!("{} has no relation", path.display()));
    }
    Ok(relations)
}

fn parse(text: &str) -> Result<Vec<Relation>, String> {
    let lines = text.lines().enumerate().map(|(number, line)| (number + 1, line.trim()));
    let lines = lines.filter(|(_, line)| !line.is_empty() && !line.starts_with('#'));
    lines.map(|(number, line)| parse_line(line).ok_or_else(|| wrong(number, line))).collect()
}

fn wrong(number: usize, line: &str) -> String {
    format!("line {number} is not 't1 t2 x y z roll pitch yaw': {line}")
}

fn parse_line(line: &str) -> Option<Relation> {
    let values: Option<Vec<f64>> = line.split_whitespace().map(|word| word.parse().ok()).collect();
    let &[first_s, second_s, x, y, _, _, _, yaw] = values?.as_slice() else { return None };
    let is_finite = [x, y, yaw].iter().all(|value| value.is_finite());
    let is_time = [first_s, second_s].iter().all(|time| (0.0..1e11).contains(time));
    let micros = |seconds: f64| (seconds * 1e6).round() as u64;
    let relation = || Relation { times_us: [micros(first_s), micros(second_s)], first_from_second: pose(x, y, yaw) };
    (is_finite && is_time).then(relation)
}

/// Mean, standard deviation and greatest value.
#[derive(Clone, Copy, Debug, Default)]
pub struct Spread {
    pub mean: f64,
    pub std: f64,
    pub max: f64,
}

impl Spread {
    fn of(values: &[f64]) -> Self {
        let count = values.len().max(1) as f64;
        let mean = values.iter().sum::<f64>() / count;
        let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / count;
        Self { mean, std: variance.sqrt(), max: values.iter().copied().fold(0.0, f64::max) }
    }
}

/// Errors of a trajectory.
#[derive(Clone, Copy, Debug, Default)]
pub struct Errors {
    /// Absolute translational error, metres.
    pub translation_m: Spread,
    /// Absolute rotational error, degrees.
    pub rotation_deg: Spread,
    /// Relations that were judged.
    pub relations: usize,
    /// Relations whose scans the trajectory does not have.
    pub missing: usize,
}

/// Index of the pose of that time, if there is one.
pub fn pose_at(trajectory: &[(u64, Pose2)], time_us: u64) -> Option<usize> {
    let next = trajectory.partition_point(|(at_us, _)| *at_us < time_us);
    let apart = |index: &usize| trajectory[*index].0.abs_diff(time_us);
    let near = (next.saturating_sub(1)..trajectory.len()).take(2);
    near.min_by_key(apart).filter(|index| apart(index) <= TOLERANCE_US)
}

/// Errors of `trajectory` (times in microseconds, ascending, with poses) against relations.
pub fn errors(trajectory: &[(u64, Pose2)], relations: &[Relation]) -> Errors {
    let (mut metres, mut degrees) = (Vec::new(), Vec::new());
    for relation in relations {
        let [first, second] = relation.times_us.map(|time_us| Some(trajectory[pose_at(trajectory, time_us)?].1));
        if let (Some(first), Some(second)) = (first, second) {
            let error = relation.first_from_second.inverse() * (first.inverse() * second);
            metres.push(error.translation.vector.norm());
            degrees.push(wrap_angle(error.rotation.angle()).abs().to_degrees());
        }
    }
    Errors {
        translation_m: Spread::of(&metres),
        rotation_deg: Spread::of(&degrees),
        relations: metres.len(),
        missing: relations.len() - metres.len(),
    }
}

/// Says so if none of the `known` relations could be judged by a log from one time to another,
/// microseconds.
pub fn check_judged(errors: Option<&Errors>, known: &[Relation], log_us: [u64; 2]) -> Result<(), String> {
    if errors.is_none_or(|errors| errors.relations > 0) {
        return Ok(());
    }
    let times = || known.iter().flat_map(|relation| relation.times_us);
    let theirs_us = [times().min().unwrap_or_default(), times().max().unwrap_or_default()];
    let span = |[from, to]: [u64; 2]| format!("from {:.3} s to {:.3} s", from as f64 * 1e-6, to as f64 * 1e-6);
    Err(format!(
        "none of the {} relations can be judged: they are of scans {}, and the log's scans are {}; are they of another \
         log?",
        known.len(),
        span(theirs_us),
        span(log_us)
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_read_and_nonsense_is_named() {
        let text = "# made by hand\n1.5 2.000001 1 2 0 0 0 0.5\n\n";
        let relation = Relation { times_us: [1_500_000, 2_000_001], first_from_second: pose(1.0, 2.0, 0.5) };
        assert_eq!(parse(text), Ok(vec![relation]));
        for bad in ["1 2 3", "1 2 x 0 0 0 0 0", "1 2 nan 0 0 0 0 0", "-1 2 0 0 0 0 0 0"] {
            let error = parse(&format!("1 2 0 0 0 0 0 0\n{bad}")).expect_err(bad);
            assert!(error.contains("line 2") && error.contains(bad), "{error}");
        }
    }

    #[test]
    fn errors_are_those_of_the_pose_between() {
        let relation = |first_from_second| Relation { times_us: [1_000_000, 2_000_000], first_from_second };
        let start = pose(3.0, -1.0, 2.0);
        let trajectory = [(1_000_000, start), (1_999_990, start * pose(1.0, 0.0, 0.1)), (3_000_000, start)];
        let found = errors(&trajectory, &[relation(pose(1.0, 0.5, 0.1)), relation(pose(1.0, 0.0, -0.1))]);
        assert!((found.translation_m.mean - 0.25).abs() < 1e-9 && (found.translation_m.std - 0.25).abs() < 1e-9);
        assert!((found.rotation_deg.max - 0.2_f64.to_degrees()).abs() < 1e-9);
        assert_eq!((found.relations, found.missing), (2, 0));
        let elsewhere = Relation { times_us: [1_000_000, 9_000_000], first_from_second: start };
        assert_eq!(errors(&trajectory, &[elsewhere]).missing, 1);
        assert_eq!(errors(&[], &[elsewhere]).missing, 1);
        let log_us = [1_000_000, 3_000_000];
        let none = check_judged(Some(&errors(&trajectory, &[elsewhere])), &[elsewhere], log_us);
        assert!(none.as_ref().is_err_and(|said| said.contains("from 1.000 s to 9.000 s")), "{none:?}");
        assert!(check_judged(Some(&found), &[elsewhere], log_us).is_ok() && check_judged(None, &[], log_us).is_ok());
    }
}
