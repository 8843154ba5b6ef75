//! How well descriptors tell places apart: recall, false matches, and the ROC.

use serde::Serialize;

/// How a query and a reference are related.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlaceRelation {
    /// One place.
    Same,
    /// Too near to be different, too far to be the same: not judged.
    Near,
    /// Two places.
    Different,
}

/// A query's cosine to every reference, with the relation of the pair.
pub type Row = Vec<(f32, PlaceRelation)>;

/// One point of the ROC.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Operating {
    /// Cosines of at least this count as a match.
    pub threshold: f32,
    /// Share of the pairs of different places that match.
    pub false_positive_rate: f64,
    /// Share of the pairs of one place that match.
    pub true_positive_rate: f64,
}

/// The figures of one evaluation.
#[derive(Clone, Debug, Serialize)]
pub struct Score {
    /// Queries that have a reference of the same place.
    pub queries: usize,
    /// References.
    pub references: usize,
    /// Share of the queries whose best reference is the same place.
    pub recall_at_1: f64,
    /// Share of the queries with the same place among the best four, as many as a client tries.
    pub recall_at_4: f64,
    /// Share of the queries whose best reference is a different place and over the model's
    /// threshold.
    pub false_best_at_threshold: f64,
    /// Share of the queries with the same place among the best four and over the model's threshold.
    pub found_at_threshold: f64,
    /// Mean cosine of one place.
    pub mean_same: f64,
    /// Mean cosine of different places.
    pub mean_different: f64,
    /// At the model's threshold.
    pub at_threshold: Operating,
    /// At one false match in 1000, 100 and 10 pairs of different places.
    pub roc: Vec<Operating>,
}

/// Scores `rows` for a model with this `threshold`; `None` without pairs of one place and of
/// different places.
pub fn score(mut rows: Vec<Row>, threshold: f32) -> Option<Score> {
    rows.retain(|row| row.iter().any(|&(_, relation)| relation == PlaceRelation::Same));
    let of = |wanted: PlaceRelation| -> Vec<f32> {
        let mut cosines: Vec<f32> =
            rows.iter().flatten().filter(|&&(_, relation)| relation == wanted).map(|&(cosine, _)| cosine).collect();
        cosines.sort_by(|a, b| b.total_cmp(a));
        cosines
    };
    let (same, different) = (of(PlaceRelation::Same), of(PlaceRelation::Different));
    if same.is_empty() || different.is_empty() {
        return None;
    }
    let operating = |threshold: f32| Operating {
        threshold,
        false_positive_rate: share_from(&different, threshold),
        true_positive_rate: share_from(&same, threshold),
    };
    let mut best = [0_usize; 4]; // at 1, at 4, false over the threshold, at 4 over the threshold
    for row in &mut rows {
        row.sort_by(|a, b| b.0.total_cmp(&a.0));
        let top = &row[..row.len().min(4)];
        let is_same = |&&(_, relation): &&(f32, PlaceRelation)| relation == PlaceRelation::Same;
        best[0] += usize::from(top[0].1 == PlaceRelation::Same);
        best[1] += usize::from(top.iter().any(|pair| is_same(&pair)));
        best[2] += usize::from(top[0].1 == PlaceRelation::Different && top[0].0 >= threshold);
        best[3] += usize::from(top.iter().filter(is_same).any(|&(cosine, _)| cosine >= threshold));
    }
    let share = |count: usize| count as f64 / rows.len() as f64;
    let mean = |cosines: &[f32]| cosines.iter().map(|&cosine| f64::from(cosine)).sum::<f64>() / cosines.len() as f64;
    let at_rate = |rate: f64| operating(different[((different.len() as f64 * rate) as usize).min(different.len() - 1)]);
    Some(Score {
        queries: rows.len(),
        references: rows[0].len(),
        recall_at_1: share(best[0]),
        recall_at_4: share(best[1]),
        false_best_at_threshold: share(best[2]),
        found_at_threshold: share(best[3]),
        mean_same: mean(&same),
        mean_different: mean(&different),
        at_threshold: operating(threshold),
        roc: [0.001, 0.01, 0.1].map(at_rate).to_vec(),
    })
}

/// Share of `cosines`, greatest first, that are `threshold` or more.
fn share_from(cosines: &[f32], threshold: f32) -> f64 {
    cosines.partition_point(|&cosine| cosine >= threshold) as f64 / cosines.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use PlaceRelation::{Different, Near, Same};

    #[test]
    fn shares_are_counted_over_queries_that_can_be_answered() {
        let rows = vec![
            vec![(0.9, Same), (0.2, Different), (0.1, Different)],
            vec![(0.4, Same), (0.8, Different), (0.5, Near)],
            vec![(0.7, Different), (0.6, Different), (0.1, Near)],
        ];
        let score = score(rows, 0.6).unwrap();
        assert_eq!((score.queries, score.references), (2, 3));
        assert!((score.recall_at_1 - 0.5).abs() < 1e-9 && (score.recall_at_4 - 1.0).abs() < 1e-9);
        assert!((score.false_best_at_threshold - 0.5).abs() < 1e-9);
        assert!((score.found_at_threshold - 0.5).abs() < 1e-9);
        assert!((score.at_threshold.false_positive_rate - 1.0 / 3.0).abs() < 1e-9);
        assert!((score.at_threshold.true_positive_rate - 0.5).abs() < 1e-9);
    }

    #[test]
    fn nothing_to_compare_gives_no_score() {
        assert!(score(vec![vec![(0.5, Different)]], 0.5).is_none());
        assert!(score(Vec::new(), 0.5).is_none());
    }
}
