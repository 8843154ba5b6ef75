//! How much there is to see: the visual information I(φ) of a place (paper, equation 2).

/// Entropy of a pooled unit vector's components (paper, equation 2), as a share of the greatest
/// possible.
///
/// The paper divides `[0, 1]` into equal intervals, but the components of a unit vector of n
/// numbers are about 1/√n, so nearly all would fall into the first interval. Here 20 intervals
/// divide `[0, range/√n]`.
#[must_use]
pub(crate) fn information(pooled: &[f32], range: f64) -> f64 {
    const INTERVALS: usize = 20;
    let mut histogram = [0_usize; INTERVALS];
    let scale = (pooled.len() as f64).sqrt() / range * INTERVALS as f64;
    for &component in pooled {
        let interval = (f64::from(component).max(0.0) * scale) as usize;
        histogram[interval.min(INTERVALS - 1)] += 1;
    }
    let entropy: f64 = histogram
        .iter()
        .filter(|&&count| count > 0)
        .map(|&count| count as f64 / pooled.len() as f64)
        .map(|share| -share * share.log2())
        .sum();
    entropy / (INTERVALS as f64).log2()
}
