//! Exact Euclidean distance transforms of cell sets (lower envelope of parabolas, one pass along
//! each axis; Felzenszwalb and Huttenlocher 2012).

/// Squared distance, cells, that stands for "nothing in this line".
const FAR: f64 = 1e12;

/// Distance from the centre of each cell to the border of the nearest set cell or of the outside,
/// metres; 0 in set cells.
pub(super) fn clearance(set: &[bool], width: usize, height: usize, resolution_m: f64) -> Vec<f32> {
    // The outside counts as set: a border of one cell stands for it.
    let (framed_width, framed_height) = (width + 2, height + 2);
    let mut framed = vec![true; framed_width * framed_height];
    for row in 0..height {
        let at = (row + 1) * framed_width + 1;
        framed[at..at + width].copy_from_slice(&set[row * width..(row + 1) * width]);
    }
    let squared = squared_distance(&framed, framed_width, framed_height);
    let border = |cells: f64| ((cells.sqrt() - 0.5).max(0.0) * resolution_m) as f32;
    (0..width * height).map(|index| border(squared[(index / width + 1) * framed_width + index % width + 1])).collect()
}

/// Distance from the centre of each cell to the centre of the nearest set cell, metres; huge when
/// the set is empty.
pub(super) fn to_set(set: &[bool], width: usize, height: usize, resolution_m: f64) -> Vec<f32> {
    squared_distance(set, width, height).iter().map(|cells| (cells.sqrt() * resolution_m) as f32).collect()
}

fn squared_distance(set: &[bool], width: usize, height: usize) -> Vec<f64> {
    let mut field: Vec<f64> = set.iter().map(|&inside| if inside { 0.0 } else { FAR }).collect();
    let mut envelope = Envelope::new(width.max(height));
    let mut line = vec![0.0; height];
    for column in 0..width {
        for row in 0..height {
            line[row] = field[row * width + column];
        }
        envelope.transform(&mut line);
        for row in 0..height {
            field[row * width + column] = line[row];
        }
    }
    for row in field.chunks_exact_mut(width.max(1)) {
        envelope.transform(row);
    }
    field
}

/// Scratch space of the one-dimensional transform.
struct Envelope {
    apex: Vec<usize>,
    from: Vec<f64>,
    result: Vec<f64>,
}

impl Envelope {
    fn new(length: usize) -> Self {
        Self { apex: vec![0; length + 1], from: vec![0.0; length + 2], result: vec![0.0; length] }
    }

    fn transform(&mut self, line: &mut [f64]) {
        if line.is_empty() {
            return;
        }
        let mut count = 0;
        self.apex[0] = 0;
        self.from[0] = f64::NEG_INFINITY;
        self.from[1] = f64::INFINITY;
        for q in 1..line.len() {
            let mut meet = intersection(line, self.apex[count], q);
            while meet <= self.from[count] {
                count -= 1;
                meet = intersection(line, self.apex[count], q);
            }
            count += 1;
            self.apex[count] = q;
            self.from[count] = meet;
            self.from[count + 1] = f64::INFINITY;
        }
        let mut at = 0;
        for q in 0..line.len() {
            while self.from[at + 1] < q as f64 {
                at += 1;
            }
            let offset = q as f64 - self.apex[at] as f64;
            self.result[q] = offset * offset + line[self.apex[at]];
        }
        line.copy_from_slice(&self.result[..line.len()]);
    }
}

/// Where the parabola with apex `q` falls below the one with apex `p` < `q`.
fn intersection(line: &[f64], p: usize, q: usize) -> f64 {
    let (fp, fq) = (p as f64, q as f64);
    ((line[q] + fq * fq) - (line[p] + fp * fp)) / (2.0 * fq - 2.0 * fp)
}

#[cfg(test)]
mod tests {
    use super::{clearance, to_set};

    #[test]
    fn distances_are_exact() {
        let (width, height) = (37, 23);
        let set: Vec<bool> = (0..width * height).map(|i| i % 101 == 7).collect();
        let fast = to_set(&set, width, height, 0.5);
        for (index, &found) in fast.iter().enumerate() {
            let brute = (0..set.len())
                .filter(|&other| set[other])
                .map(|other| {
                    let dx = (other % width) as f64 - (index % width) as f64;
                    let dy = (other / width) as f64 - (index / width) as f64;
                    dx.hypot(dy) * 0.5
                })
                .fold(f64::INFINITY, f64::min);
            assert!((f64::from(found) - brute).abs() < 1e-5);
        }
    }

    #[test]
    fn the_outside_is_an_obstacle() {
        let free = vec![false; 25];
        let field = clearance(&free, 5, 5, 1.0);
        assert!((field[12] - 2.5).abs() < 1e-6);
        assert!((field[0] - 0.5).abs() < 1e-6);
    }
}
