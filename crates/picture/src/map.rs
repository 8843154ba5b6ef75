//! A map as a picture, like the paper's figure 1: main nodes red, support nodes yellow, rectangles
//! green, edges, and a path, on the floor that they are of.

use crate::file::PictureError;
use crate::plot::{Extent, PictureConfig, Plot, Rgb};
use crate::sheet::{LegendEntry, Sheet, Swatch};
use fht_map::MapState;
use fht_perception::grid::{CellState, OccupancyGrid};
use fht_perception::pose::Point2;
use fht_proto::NodeKind;
use std::path::Path;

const FREE: Rgb = [255, 255, 255];
const UNKNOWN: Rgb = [226, 226, 226];
const WALL: Rgb = [45, 45, 50];
const RECTANGLE: Rgb = [214, 239, 214];
const RECTANGLE_LINE: Rgb = [140, 200, 140];
const EDGE: Rgb = [120, 120, 120];
const MAIN: Rgb = [214, 39, 40];
const SUPPORT: Rgb = [255, 200, 0];
const PATH: Rgb = [31, 90, 200];
const END: Rgb = [120, 190, 255];

/// What a map is drawn on, map frame.
pub trait Floor {
    /// The box outside of which nothing is known; none if nothing is known at all.
    fn extent(&self) -> Option<Extent>;

    /// What is known of a place.
    fn state_at(&self, place: Point2) -> CellState;
}

impl Floor for OccupancyGrid {
    fn extent(&self) -> Option<Extent> {
        let bounds = self.bounds();
        let cells = (0..bounds.width() * bounds.height()).map(|index| bounds.cell(index));
        let known = cells.filter(|cell| self.state(*cell) != CellState::Unknown);
        Extent::around(known.map(|cell| self.centre(cell)))
    }

    fn state_at(&self, place: Point2) -> CellState {
        Self::state_at(self, place)
    }
}

/// A place that is marked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mark {
    /// Where a robot began.
    Start,
    /// Where it was to go.
    Goal,
    /// Where it was in the end.
    End,
}

impl Mark {
    fn entry(self) -> LegendEntry {
        let (colour, label) = match self {
            Self::Start => (FREE, "start"),
            Self::Goal => (PATH, "goal"),
            Self::End => (END, "end"),
        };
        LegendEntry { swatch: Swatch::Dot, colour, label }
    }
}

/// What is drawn, all in the map frame.
pub struct MapPicture<'a> {
    /// Above the picture.
    pub title: String,
    /// What the map is drawn on.
    pub floor: &'a dyn Floor,
    /// The map.
    pub map: &'a MapState,
    /// Where a robot drove.
    pub driven: &'a [Point2],
    /// Places that are marked.
    pub marks: &'a [(Mark, Point2)],
}

impl MapPicture<'_> {
    /// Draws the map into a PNG file.
    ///
    /// # Errors
    /// [`PictureError`].
    pub fn save(&self, config: &PictureConfig, path: &Path) -> Result<(), PictureError> {
        let (plot, legend) = self.draw(config)?;
        Sheet { plot: &plot, title: &self.title, legend: &legend }.save(path)
    }

    fn rectangles(&self) -> Vec<Extent> {
        let of = |(x, y): (f64, f64)| Point2::new(x, y);
        let rectangles = self.map.nodes().filter_map(|node| {
            let rect = node.free_space?;
            Some(Extent { min: of(rect.min(node.pose.position)), max: of(rect.max(node.pose.position)) })
        });
        rectangles.collect()
    }

    fn nodes(&self, kind: NodeKind) -> Vec<Point2> {
        let place = |node: fht_map::NodeRef<'_>| Point2::new(node.pose.position.x(), node.pose.position.y());
        self.map.nodes().filter(|node| node.kind == kind).map(place).collect()
    }

    fn edges(&self) -> Vec<[Point2; 2]> {
        let place = |id| {
            let position = self.map.node(id)?.pose.position;
            Some(Point2::new(position.x(), position.y()))
        };
        self.map.edges().filter_map(|edge| Some([place(edge.low())?, place(edge.high())?])).collect()
    }

    /// The plot, and what its colours mean.
    fn draw(&self, config: &PictureConfig) -> Result<(Plot, Vec<LegendEntry>), PictureError> {
        let (rectangles, edges) = (self.rectangles(), self.edges());
        let [main, support] = [NodeKind::Main, NodeKind::Support].map(|kind| self.nodes(kind));
        let marks = self.marks.iter().map(|(_, place)| place);
        let points = main.iter().chain(&support).chain(self.driven).chain(marks).copied();
        let boxes = rectangles.iter().copied().chain(self.floor.extent()).chain(Extent::around(points));
        let mut plot = Plot::new(boxes.reduce(Extent::join).ok_or(PictureError::Empty)?, config)?;

        let (mut has_wall, mut has_free) = (false, false);
        plot.fill(|place| {
            let state = self.floor.state_at(place);
            has_wall |= state == CellState::Occupied;
            has_free |= state == CellState::Free;
            Some(if state == CellState::Free { FREE } else { UNKNOWN })
        });
        plot.boxes(&rectangles, RECTANGLE, RECTANGLE_LINE);
        plot.fill(|place| (self.floor.state_at(place) == CellState::Occupied).then_some(WALL));
        edges.iter().for_each(|edge| plot.line(edge, EDGE, 1.3));
        let px = |metres: f64, least: f64| (metres * plot.px_per_m()).clamp(least, 4.0 * least);
        let (way, main_px, support_px, mark_px) = (px(0.1, 3.0), px(0.16, 3.5), px(0.11, 3.0), px(0.24, 5.0));
        plot.line(self.driven, PATH, way);
        // Below the nodes, which are smaller: a robot begins at one.
        self.marks.iter().for_each(|(mark, place)| plot.dot(*place, mark_px, mark.entry().colour));
        support.iter().for_each(|place| plot.dot(*place, support_px, SUPPORT));
        main.iter().for_each(|place| plot.dot(*place, main_px, MAIN));

        let entry = |is_there: bool, swatch, colour, label| is_there.then_some(LegendEntry { swatch, colour, label });
        let legend = [
            entry(!main.is_empty(), Swatch::Dot, MAIN, "main node"),
            entry(!support.is_empty(), Swatch::Dot, SUPPORT, "support node"),
            entry(!edges.is_empty(), Swatch::Line, EDGE, "edge"),
            entry(!rectangles.is_empty(), Swatch::Area, RECTANGLE, "free rectangle"),
            entry(self.driven.len() > 1, Swatch::Line, PATH, "path driven"),
        ];
        let marked = self.marks.iter().map(|(mark, _)| mark.entry());
        // Around what is known there always is something unknown.
        let ground = [
            entry(has_wall, Swatch::Area, WALL, "wall"),
            entry(has_free, Swatch::Area, FREE, "free"),
            entry(true, Swatch::Area, UNKNOWN, "unknown"),
        ];
        let legend = legend.into_iter().flatten().chain(marked).chain(ground.into_iter().flatten()).collect();
        Ok((plot, legend))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_perception::grid::{Cell, CellBounds, GridConfig};
    use fht_proto::{AuthorId, EdgeKey, FixedPose, Increment, NodeId, Op, Rect};
    use std::collections::BTreeSet;

    /// Two nodes 2 m apart, whose rectangles abut.
    fn two_rooms() -> MapState {
        let author = AuthorId(1);
        let id = |number| NodeId { author, number };
        let pose = |x_mm| FixedPose { position: fht_proto::FixedPoint { x_mm, y_mm: 0 }, ..FixedPose::default() };
        let rect = Some(Rect { west_mm: 1000, south_mm: 1000, east_mm: 1000, north_mm: 1000 });
        let ops = vec![
            Op::PutNode { id: id(0), kind: NodeKind::Main, pose: pose(0) },
            Op::PutNode { id: id(1), kind: NodeKind::Support, pose: pose(2000) },
            Op::SetFreeSpace { id: id(0), rect },
            Op::SetFreeSpace { id: id(1), rect },
            Op::PutEdge { edge: EdgeKey::new(id(0), id(1)) },
        ];
        let mut map = MapState::new();
        map.apply(&Increment { author, number: 1, hlc_us: 1, ops });
        map
    }

    fn labels(picture: &MapPicture<'_>) -> Vec<&'static str> {
        let (_, legend) = picture.draw(&PictureConfig::default()).unwrap();
        legend.into_iter().map(|entry| entry.label).collect()
    }

    #[test]
    fn the_legend_names_what_is_in_the_picture_and_nothing_else() {
        let empty = OccupancyGrid::new(GridConfig::default());
        let map = two_rooms();
        let bare = MapPicture { title: String::new(), floor: &empty, map: &map, driven: &[], marks: &[] };
        assert_eq!(labels(&bare), ["main node", "support node", "edge", "free rectangle", "unknown"]);
        let way = [Point2::origin(), Point2::new(2.0, 0.0)];
        let marks = [(Mark::Start, way[0]), (Mark::Goal, way[1])];
        let driven = MapPicture { map: &MapState::new(), driven: &way, marks: &marks, ..bare };
        assert_eq!(labels(&driven), ["path driven", "start", "goal", "unknown"]);
        let nothing = MapPicture { driven: &[], marks: &[], ..driven };
        assert!(matches!(nothing.draw(&PictureConfig::default()), Err(PictureError::Empty)));
    }

    #[test]
    fn what_the_legend_says_has_its_colour_in_the_picture() {
        let bounds = CellBounds { min: Cell { i: 0, j: 20 }, max: Cell { i: 40, j: 30 } };
        let states = (0..400).map(|index| if index < 200 { CellState::Free } else { CellState::Occupied });
        let grid = OccupancyGrid::from_states(GridConfig::default(), bounds, states);
        let map = two_rooms();
        let way = [Point2::new(0.3, 0.5), Point2::new(1.8, 0.5)];
        let marks = [(Mark::Start, way[0]), (Mark::Goal, way[1])];
        let picture = MapPicture { title: String::new(), floor: &grid, map: &map, driven: &way, marks: &marks };
        let (plot, legend) = picture.draw(&PictureConfig::default()).unwrap();
        let colours: BTreeSet<Rgb> =
            plot.pixmap().pixels().iter().map(|pixel| [pixel.red(), pixel.green(), pixel.blue()]).collect();
        assert_eq!(legend.len(), 10);
        for entry in legend {
            // A thin line need not cover a pixel whole.
            let slack = if entry.swatch == Swatch::Line { 45 } else { 0 };
            let is_near = |colour: &Rgb| colour.iter().zip(entry.colour).all(|(a, b)| a.abs_diff(b) <= slack);
            assert!(colours.iter().any(is_near), "{} has no pixel", entry.label);
        }
    }

    #[test]
    fn two_rectangles_that_abut_are_one_area() {
        let empty = OccupancyGrid::new(GridConfig::default());
        let map = two_rooms();
        let picture = MapPicture { title: String::new(), floor: &empty, map: &map, driven: &[], marks: &[] };
        let (plot, _) = picture.draw(&PictureConfig::default()).unwrap();
        let (px, extent) = (plot.px_per_m(), plot.extent());
        let pixel = |x: f64, y: f64| (((x - extent.min.x) * px) as u32, ((extent.max.y - y) * px) as u32);
        // From inside of one to inside of the other, below the edge and the nodes.
        let ((from, row), (to, _)) = (pixel(-0.8, -0.5), pixel(2.8, -0.5));
        let known = [RECTANGLE, RECTANGLE_LINE];
        for x in from..to {
            let pixel = plot.pixmap().pixel(x, row).unwrap();
            assert!(known.contains(&[pixel.red(), pixel.green(), pixel.blue()]), "{pixel:?} at {x}, {row}");
        }
    }
}
