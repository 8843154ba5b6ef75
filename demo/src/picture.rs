//! A map as a picture, like the paper's figure 1: main nodes red, support nodes yellow, rectangles
//! green, edges, and a path.

use fht_map::MapState;
use fht_perception::pose::{Point2, Pose2};
use fht_proto::NodeKind;
use fht_sim::FloorPlan;
use std::path::Path;
use tiny_skia::{Color, FillRule, LineCap, Paint, PathBuilder, Pixmap, Rect, Stroke, Transform};

/// How a picture is drawn.
#[derive(Clone, Debug)]
pub struct PictureConfig {
    /// Pixels of the longer side. Default 1600.
    pub pixels: u32,
    /// Room around the floor plan, metres. Default 0.5.
    pub margin_m: f64,
}

impl Default for PictureConfig {
    fn default() -> Self {
        Self { pixels: 1600, margin_m: 0.5 }
    }
}

/// Why there is no picture.
#[derive(Debug, thiserror::Error)]
pub enum PictureError {
    /// The plan has no area.
    #[error("there is nothing to draw")]
    Empty,
    /// The file cannot be written.
    #[error("{path} cannot be written: {reason}", path = path.display())]
    Write {
        /// Which file.
        path: std::path::PathBuf,
        /// Why.
        reason: String,
    },
}

/// What is drawn. All but the plan is in the map frame.
pub struct MapPicture<'a> {
    /// The true floor plan, world frame.
    pub plan: &'a FloorPlan,
    /// Where the map frame truly is.
    pub world_from_map: Pose2,
    /// The map.
    pub map: &'a MapState,
    /// Where the client truly drove.
    pub driven: &'a [Point2],
    /// Where it started, and its goal.
    pub ends: Option<(Point2, Point2)>,
}

const WALL: Color = Color::BLACK;
const RED: [u8; 4] = [214, 39, 40, 255];
const YELLOW: [u8; 4] = [255, 200, 0, 255];
const GREEN_FILL: [u8; 4] = [44, 160, 44, 26];
const GREEN_LINE: [u8; 4] = [44, 160, 44, 110];
const EDGE: [u8; 4] = [90, 90, 90, 170];
const BLUE: [u8; 4] = [31, 90, 200, 255];
const DARK: [u8; 4] = [40, 40, 40, 255];

struct Canvas {
    pixmap: Pixmap,
    pixels_per_m: f64,
    left_m: f64,
    top_m: f64,
}

impl Canvas {
    /// World metres to pixels; y points up in the world and down in the picture.
    fn pixel(&self, world: Point2) -> (f32, f32) {
        (((world.x - self.left_m) * self.pixels_per_m) as f32, ((self.top_m - world.y) * self.pixels_per_m) as f32)
    }

    fn metres(&self, metres: f64) -> f32 {
        (metres * self.pixels_per_m) as f32
    }

    fn line(&mut self, points: &[Point2], color: [u8; 4], width_px: f32) {
        let mut builder = PathBuilder::new();
        for (index, point) in points.iter().enumerate() {
            let (x, y) = self.pixel(*point);
            if index == 0 {
                builder.move_to(x, y);
            } else {
                builder.line_to(x, y);
            }
        }
        let stroke = Stroke { width: width_px, line_cap: LineCap::Round, ..Stroke::default() };
        if let Some(path) = builder.finish() {
            self.pixmap.stroke_path(&path, &paint(color), &stroke, Transform::identity(), None);
        }
    }

    fn polygon(&mut self, corners: &[Point2], fill: [u8; 4], line: [u8; 4]) {
        let mut builder = PathBuilder::new();
        for (index, corner) in corners.iter().enumerate() {
            let (x, y) = self.pixel(*corner);
            if index == 0 {
                builder.move_to(x, y);
            } else {
                builder.line_to(x, y);
            }
        }
        builder.close();
        if let Some(path) = builder.finish() {
            self.pixmap.fill_path(&path, &paint(fill), FillRule::Winding, Transform::identity(), None);
            let stroke = Stroke { width: 1.0, ..Stroke::default() };
            self.pixmap.stroke_path(&path, &paint(line), &stroke, Transform::identity(), None);
        }
    }

    fn dot(&mut self, centre: Point2, radius_px: f32, fill: [u8; 4]) {
        let (x, y) = self.pixel(centre);
        if let Some(path) = PathBuilder::from_circle(x, y, radius_px) {
            self.pixmap.fill_path(&path, &paint(fill), FillRule::Winding, Transform::identity(), None);
            let stroke = Stroke { width: 1.2, ..Stroke::default() };
            self.pixmap.stroke_path(&path, &paint(DARK), &stroke, Transform::identity(), None);
        }
    }
}

fn paint([r, g, b, a]: [u8; 4]) -> Paint<'static> {
    let mut paint = Paint::default();
    paint.set_color_rgba8(r, g, b, a);
    paint.anti_alias = true;
    paint
}

/// Draws a scene.
///
/// # Errors
/// [`PictureError::Empty`] for a plan without cells.
fn draw(scene: &MapPicture<'_>, config: &PictureConfig) -> Result<Pixmap, PictureError> {
    let plan = scene.plan;
    let width_m = plan.width() as f64 * plan.resolution_m() + 2.0 * config.margin_m;
    let height_m = plan.height() as f64 * plan.resolution_m() + 2.0 * config.margin_m;
    let pixels_per_m = f64::from(config.pixels) / width_m.max(height_m);
    let size = |metres: f64| (metres * pixels_per_m).ceil() as u32;
    let pixmap = Pixmap::new(size(width_m), size(height_m)).ok_or(PictureError::Empty)?;
    let left_m = plan.origin().x - config.margin_m;
    let top_m = plan.origin().y + height_m - config.margin_m;
    let mut canvas = Canvas { pixmap, pixels_per_m, left_m, top_m };
    canvas.pixmap.fill(Color::WHITE);

    let to_world = |x: f64, y: f64| scene.world_from_map * Point2::new(x, y);
    for node in scene.map.nodes() {
        if let Some(rect) = node.free_space {
            let (min, max) = (rect.min(node.pose.position), rect.max(node.pose.position));
            let corners = [(min.0, min.1), (max.0, min.1), (max.0, max.1), (min.0, max.1)].map(|(x, y)| to_world(x, y));
            canvas.polygon(&corners, GREEN_FILL, GREEN_LINE);
        }
    }
    draw_walls(&mut canvas, plan);
    for edge in scene.map.edges() {
        if let (Some(a), Some(b)) = (scene.map.node(edge.low()), scene.map.node(edge.high())) {
            let ends = [a, b].map(|node| to_world(node.pose.position.x(), node.pose.position.y()));
            canvas.line(&ends, EDGE, 1.5);
        }
    }
    let driven: Vec<Point2> = scene.driven.iter().map(|point| scene.world_from_map * point).collect();
    canvas.line(&driven, BLUE, canvas.metres(0.12).max(3.0));
    for kind in [NodeKind::Support, NodeKind::Main] {
        let (color, radius_m) = match kind {
            NodeKind::Main => (RED, 0.16),
            NodeKind::Support => (YELLOW, 0.11),
        };
        let radius = canvas.metres(radius_m).max(3.0);
        for node in scene.map.nodes().filter(|node| node.kind == kind) {
            canvas.dot(to_world(node.pose.position.x(), node.pose.position.y()), radius, color);
        }
    }
    if let Some((start, goal)) = scene.ends {
        let radius = canvas.metres(0.24).max(5.0);
        canvas.dot(scene.world_from_map * start, radius, [255, 255, 255, 255]);
        canvas.dot(scene.world_from_map * goal, radius, BLUE);
    }
    Ok(canvas.pixmap)
}

/// Occupied cells, a run of a row at a time.
fn draw_walls(canvas: &mut Canvas, plan: &FloorPlan) {
    let mut paint = Paint::default();
    paint.set_color(WALL);
    let cell = plan.resolution_m();
    for row in 0..plan.height() {
        let mut column = 0;
        while column < plan.width() {
            let is_wall = |column: usize| column < plan.width() && plan.cells()[row * plan.width() + column];
            let first = column;
            while is_wall(column) {
                column += 1;
            }
            if column > first {
                let corner = plan.centre_of(first, row) + nalgebra::Vector2::new(-0.5 * cell, 0.5 * cell);
                let (x, y) = canvas.pixel(corner);
                let width = canvas.metres((column - first) as f64 * cell);
                if let Some(rect) = Rect::from_xywh(x, y, width, canvas.metres(cell)) {
                    canvas.pixmap.fill_rect(rect, &paint, Transform::identity(), None);
                }
            }
            column += 1;
        }
    }
}

/// Draws a scene into a PNG file.
///
/// # Errors
/// [`PictureError`].
pub fn save_picture(scene: &MapPicture<'_>, config: &PictureConfig, path: &Path) -> Result<(), PictureError> {
    let pixmap = draw(scene, config)?;
    let write_error = |reason: String| PictureError::Write { path: path.to_owned(), reason };
    let png = pixmap.encode_png().map_err(|error| write_error(error.to_string()))?;
    std::fs::write(path, png).map_err(|error| write_error(error.to_string()))
}
