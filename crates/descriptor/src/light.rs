//! The same place in another light: removes colour cast, contrast and brightness from all views
//! together.

use image::RgbImage;

/// Mean brightness after normalisation, 0 to 1.
const BRIGHTNESS: f64 = 0.45;
/// Share of pixels that saturate at either end.
const CLIPPED: f64 = 0.01;

/// Applies grey-world gains, a stretch between the darkest and the brightest per cent, and a gamma
/// that brings the mean to a fixed brightness. All views get the same mapping, so that they remain
/// one panorama.
pub(crate) fn normalise(views: &mut [RgbImage]) {
    let mut histograms = [[0_u64; 256]; 3];
    for pixel in views.iter().flat_map(|view| view.pixels()) {
        for (histogram, &value) in histograms.iter_mut().zip(&pixel.0) {
            histogram[usize::from(value)] += 1;
        }
    }
    let total: u64 = histograms[0].iter().sum();
    if total == 0 {
        return;
    }
    let mean = |histogram: &[u64; 256]| {
        histogram.iter().enumerate().map(|(value, &count)| value as f64 * count as f64).sum::<f64>() / total as f64
    };
    let means = [0, 1, 2].map(|channel| mean(&histograms[channel]).max(1.0));
    let grey = means.iter().sum::<f64>() / 3.0;
    let gains = means.map(|mean| (grey / mean).clamp(0.5, 2.0));

    // The distribution of all colours' values after the gains.
    let mut combined = [0_u64; 512];
    for (histogram, gain) in histograms.iter().zip(gains) {
        for (value, &count) in histogram.iter().enumerate() {
            combined[((value as f64 * gain) as usize).min(511)] += count;
        }
    }
    let quantile = |share: f64| {
        let wanted = (share * 3.0 * total as f64) as u64;
        let mut seen = 0;
        combined.iter().position(|&count| {
            seen += count;
            seen > wanted
        })
    };
    let low = quantile(CLIPPED).unwrap_or(0) as f64;
    let high = (quantile(1.0 - CLIPPED).unwrap_or(511) as f64).max(low + 16.0);
    let stretched = |value: f64| ((value - low) / (high - low)).clamp(0.0, 1.0);
    let sum: f64 = combined.iter().enumerate().map(|(value, &count)| stretched(value as f64) * count as f64).sum();
    let brightness = (sum / (3.0 * total as f64)).clamp(0.02, 0.98);
    let gamma = (BRIGHTNESS.ln() / brightness.ln()).clamp(0.4, 2.5);

    let table = gains.map(|gain| {
        let mut table = [0_u8; 256];
        for (value, mapped) in table.iter_mut().enumerate() {
            *mapped = (stretched(value as f64 * gain).powf(gamma) * 255.0).round() as u8;
        }
        table
    });
    for pixel in views.iter_mut().flat_map(|view| view.pixels_mut()) {
        for (value, table) in pixel.0.iter_mut().zip(&table) {
            *value = table[usize::from(*value)];
        }
    }
}
