//! Search without an initial guess: every heading and every translation of a window, on blurred
//! images of the reference, coarse to fine.

use super::{MatchConfig, NoMatch, ReferenceCloud, ScanMatch, refine};
use crate::pose::{Point2, Pose2, pose, wrap_angle};

/// Where to look.
#[derive(Clone, Debug)]
pub struct SearchWindow {
    /// Middle of the window: pose of the moving scan in the reference's frame.
    pub centre: Pose2,
    /// Half width along the reference's x, metres.
    pub half_x_m: f64,
    /// Half width along the reference's y, metres.
    pub half_y_m: f64,
    /// Half width of the headings, radians; π looks all around.
    pub half_yaw_rad: f64,
}

/// A blurred picture of the reference: each cell holds how well a point there would fit, 0 to 255.
struct Picture {
    resolution: f64,
    min: Point2,
    width: usize,
    height: usize,
    values: Vec<u8>,
}

impl Picture {
    /// Draws each reference point with a linear fall-off over `blur` metres.
    fn draw(reference: &ReferenceCloud, resolution: f64, blur: f64) -> Option<Self> {
        let mut points = reference.positions();
        let first = points.next()?;
        let (min, max) = points.fold((first, first), |(min, max), p| (min.inf(&p), max.sup(&p)));
        let margin = blur + resolution;
        let (width, height) =
            ((max.x - min.x + 2.0 * margin) / resolution, (max.y - min.y + 2.0 * margin) / resolution);
        // Scans reach some 100 m at most; a larger picture would mean broken data.
        if !(width * height).is_finite() || width * height > 64e6 {
            return None;
        }
        let (width, height) = (width.ceil() as usize + 1, height.ceil() as usize + 1);
        let min = Point2::new(min.x - margin, min.y - margin);
        let mut values = vec![0_u8; width * height];
        let radius = (blur / resolution).ceil() as i64;
        for point in reference.positions() {
            let (i, j) = (((point.x - min.x) / resolution) as i64, ((point.y - min.y) / resolution) as i64);
            for y in (j - radius).max(0)..=(j + radius).min(height as i64 - 1) {
                for x in (i - radius).max(0)..=(i + radius).min(width as i64 - 1) {
                    let centre_x = min.x + (x as f64 + 0.5) * resolution;
                    let centre_y = min.y + (y as f64 + 0.5) * resolution;
                    let distance = (centre_x - point.x).hypot(centre_y - point.y);
                    let value = (255.0 * (1.0 - distance / (blur + 0.5 * resolution)).max(0.0)) as u8;
                    let cell = &mut values[y as usize * width + x as usize];
                    *cell = (*cell).max(value);
                }
            }
        }
        Some(Self { resolution, min, width, height, values })
    }

    fn sum(&self, rotated: &[Point2], x: f64, y: f64) -> u64 {
        let scale = 1.0 / self.resolution;
        let (offset_x, offset_y) = ((x - self.min.x) * scale, (y - self.min.y) * scale);
        let mut sum = 0_u64;
        for point in rotated {
            let (i, j) = ((point.x * scale + offset_x) as isize, (point.y * scale + offset_y) as isize);
            if i >= 0 && j >= 0 && (i as usize) < self.width && (j as usize) < self.height {
                sum += u64::from(self.values[j as usize * self.width + i as usize]);
            }
        }
        sum
    }
}

#[derive(Clone, Copy)]
struct Candidate {
    sum: u64,
    x: f64,
    y: f64,
    yaw: f64,
}

/// The best alignments of `moving` with the reference anywhere in `window`, without a guess:
/// refined, each with the share of `moving` that it explains. None when there are too few points.
#[must_use]
pub fn alignments(
    reference: &ReferenceCloud,
    moving: &[Point2],
    window: &SearchWindow,
    config: &MatchConfig,
) -> Vec<ScanMatch> {
    if moving.len() < config.min_points || reference.len() < config.min_points {
        return Vec::new();
    }
    let Some(coarse) = Picture::draw(reference, config.coarse_step_m * 0.5, config.coarse_step_m * 1.2) else {
        return Vec::new();
    };
    let Some(fine) = Picture::draw(reference, 0.05, 0.1) else { return Vec::new() };

    let thinned = thin(moving, config.coarse_points);
    let mut found = sweep(&coarse, &thinned, window, config.coarse_step_m, config.coarse_step_rad);
    found.sort_by(|a, b| b.sum.cmp(&a.sum).then(a.yaw.total_cmp(&b.yaw)).then(a.x.total_cmp(&b.x)));
    let narrow = |candidate: &Candidate| SearchWindow {
        centre: pose(candidate.x, candidate.y, candidate.yaw),
        half_x_m: config.coarse_step_m * 0.75,
        half_y_m: config.coarse_step_m * 0.75,
        half_yaw_rad: config.coarse_step_rad * 0.75,
    };
    let refined = |candidate: &Candidate| {
        let near = sweep(&fine, &thinned, &narrow(candidate), config.coarse_step_m / 4.0, config.coarse_step_rad / 4.0);
        let finest = near.into_iter().max_by(|a, b| a.sum.cmp(&b.sum).then(b.yaw.total_cmp(&a.yaw)))?;
        refine(reference, moving, &pose(finest.x, finest.y, finest.yaw), config)
    };
    keep_apart(&found, config).iter().filter_map(refined).collect()
}

/// Finds the pose of the scan `moving` in the frame of the scan `reference` anywhere in `window`,
/// without a guess.
///
/// # Errors
/// [`NoMatch`] when even the best alignment leaves too much of either scan unexplained.
pub fn search(
    reference: &ReferenceCloud,
    moving: &[Point2],
    window: &SearchWindow,
    config: &MatchConfig,
) -> Result<ScanMatch, NoMatch> {
    let own = ReferenceCloud::from_scan(moving);
    let mut best: Option<ScanMatch> = None;
    for mut found in alignments(reference, moving, window, config) {
        let back = found.reference_from_moving.inverse();
        if let Some(backward) = own.explained_share(reference.points(), &back, config.explained_m) {
            found.score = found.score.min(backward);
        }
        if best.as_ref().is_none_or(|best| found.score > best.score) {
            best = Some(found);
        }
    }
    match best {
        Some(best) if best.score >= config.min_score => Ok(best),
        best => Err(NoMatch { best_score: best.map_or(0.0, |best| best.score) }),
    }
}

/// About `count` of the points, evenly spread over the scan.
pub(super) fn thin(points: &[Point2], count: usize) -> Vec<Point2> {
    let count = count.clamp(1, points.len());
    (0..count).map(|index| points[index * points.len() / count]).collect()
}

fn sweep(picture: &Picture, points: &[Point2], window: &SearchWindow, step_m: f64, step_rad: f64) -> Vec<Candidate> {
    let steps = |half: f64, step: f64| (half / step).ceil().max(0.0) as i32;
    let (nx, ny) = (steps(window.half_x_m, step_m), steps(window.half_y_m, step_m));
    let nyaw = steps(window.half_yaw_rad, step_rad);
    let mut found = Vec::new();
    for k in -nyaw..=nyaw {
        let yaw = window.centre.rotation.angle() + f64::from(k) * step_rad;
        let rotation = nalgebra::Rotation2::new(yaw);
        let rotated: Vec<Point2> = points.iter().map(|point| rotation * point).collect();
        let mut best_here = Candidate { sum: 0, x: 0.0, y: 0.0, yaw: wrap_angle(yaw) };
        for i in -nx..=nx {
            for j in -ny..=ny {
                let x = window.centre.translation.x + f64::from(i) * step_m;
                let y = window.centre.translation.y + f64::from(j) * step_m;
                let sum = picture.sum(&rotated, x, y);
                if sum > best_here.sum {
                    best_here = Candidate { sum, x, y, ..best_here };
                }
            }
        }
        found.push(best_here);
    }
    found
}

/// The best candidates that are not each other's neighbours.
fn keep_apart(sorted: &[Candidate], config: &MatchConfig) -> Vec<Candidate> {
    let mut kept: Vec<Candidate> = Vec::new();
    for candidate in sorted {
        let is_near = |other: &Candidate| {
            (candidate.x - other.x).hypot(candidate.y - other.y) < 1.5 * config.coarse_step_m
                && wrap_angle(candidate.yaw - other.yaw).abs() < 1.5 * config.coarse_step_rad
        };
        if !kept.iter().any(is_near) {
            kept.push(*candidate);
            if kept.len() >= config.candidates {
                break;
            }
        }
    }
    kept
}
