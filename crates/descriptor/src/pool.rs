//! Generalised-mean pooling (Radenović et al., TPAMI 2018): a network's output, wherever it is in
//! the pictures, becomes one number per channel.

use crate::network::Features;

/// Accumulates the outputs for all pictures of one place.
pub(crate) struct GemPool {
    power: f64,
    sums: Vec<f64>,
    count: usize,
}

impl GemPool {
    pub fn new(channels: usize, power: f64) -> Self {
        Self { power, sums: vec![0.0; channels], count: 0 }
    }

    /// Adds an output without `margin` columns at either side.
    pub fn add(&mut self, features: &Features, margin: usize) {
        let columns = features.columns;
        // A margin that would leave nothing is ignored.
        let kept = if 2 * margin < columns { margin..columns - margin } else { 0..columns };
        let plane = features.rows * columns;
        for (sum, channel) in self.sums.iter_mut().zip(features.values.chunks_exact(plane.max(1))) {
            for row in channel.chunks_exact(columns.max(1)) {
                *sum += row[kept.clone()].iter().map(|&value| f64::from(value.max(1e-6)).powf(self.power)).sum::<f64>();
            }
        }
        self.count += features.rows * kept.len();
    }

    /// The means, as a unit vector.
    pub fn finish(self) -> Vec<f32> {
        let mean = |sum: &f64| (sum / self.count.max(1) as f64).powf(1.0 / self.power) as f32;
        let mut pooled: Vec<f32> = self.sums.iter().map(mean).collect();
        make_unit(&mut pooled);
        pooled
    }
}

/// Scales a vector to length 1; a zero vector stays as it is.
pub(crate) fn make_unit(vector: &mut [f32]) {
    let norm = vector.iter().map(|&value| f64::from(value) * f64::from(value)).sum::<f64>().sqrt();
    if norm > 1e-12 {
        vector.iter_mut().for_each(|value| *value = (f64::from(*value) / norm) as f32);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn margins_are_left_out_and_pictures_pooled_together() {
        let features = |values: &[f32]| Features { channels: 2, rows: 1, columns: 3, values: values.to_vec() };
        let mut pool = GemPool::new(2, 1.0);
        pool.add(&features(&[9.0, 2.0, 9.0, 9.0, 1.0, 9.0]), 1);
        pool.add(&features(&[9.0, 4.0, 9.0, 9.0, 3.0, 9.0]), 1);
        let pooled = pool.finish();
        // Means 3 and 2.
        assert!((pooled[0] / pooled[1] - 1.5).abs() < 1e-6, "{pooled:?}");
        assert!((pooled[0].hypot(pooled[1]) - 1.0).abs() < 1e-6);
        let mut narrow = GemPool::new(2, 3.0);
        narrow.add(&features(&[1.0; 6]), 2);
        assert!(narrow.finish().iter().all(|value| value.is_finite()));
    }
}
