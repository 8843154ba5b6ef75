//! The built-in office: about 80 m × 39 m, nine rooms joined by corridors of 2 m, some of them
//! slanting, with loops of 30 to 100 m.

use crate::world::building::layout::{Layout, Solid};
use crate::world::building::polygon::{Polygon, holds, rectangle, regular, strip, turned_box, union};
use crate::world::building::style::{Hanging, Style};
use crate::world::building::zones::Zones;
use crate::world::draw::art::Genre;
use crate::world::draw::furniture::Kind;
use crate::world::draw::surfaces::{Ceiling, FloorSurface, Wall};
use fht_perception::pose::Point2;
use nalgebra::Vector2;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;

/// A point in the drawing below, metres.
type Place = (f64, f64);
/// A corridor's centre line, and whether a doorway stands at its start and at its end.
type Line = (Point2, Point2, [bool; 2]);

/// Height of the ceiling, metres.
const CEILING_M: f64 = 2.7;
/// Width of corridors, metres.
const CORRIDOR_M: f64 = 2.0;
/// Clear width of the doorways at their ends, metres.
const DOORWAY_M: f64 = 1.4;
/// Height of doorways, metres.
const LINTEL_M: f64 = 2.1;
/// The world frame's origin, where an explorer starts, in the drawing below, metres.
const START: Place = (9.0, 19.0);

/// What a room is for.
#[derive(Clone, Copy, PartialEq)]
enum Use {
    OpenOffice,
    Library,
    Meeting,
    Lab,
    Lounge,
}

/// Rooms: min corner, max corner, use.
const ROOMS: [(Place, Place, Use); 9] = [
    ((0.0, 0.5), (12.5, 11.0), Use::OpenOffice),
    ((18.0, 0.0), (29.0, 9.0), Use::Library),
    ((36.0, 3.5), (45.0, 12.0), Use::Meeting),
    ((52.0, 0.0), (66.0, 10.0), Use::OpenOffice),
    ((71.0, 3.0), (80.0, 12.0), Use::Lounge),
    ((0.0, 27.0), (11.5, 38.0), Use::Lab),
    ((20.0, 28.0), (29.0, 38.5), Use::Meeting),
    ((41.0, 28.0), (55.0, 37.5), Use::OpenOffice),
    ((66.0, 27.5), (78.0, 39.0), Use::Library),
];

/// Corridors: centre line, and whether a doorway stands at its start and at its end.
const CORRIDORS: [(Place, Place, [bool; 2]); 18] = [
    ((3.0, 19.0), (77.5, 19.0), [false, false]),
    ((6.0, 11.0), (6.0, 18.5), [true, false]),
    ((23.5, 9.0), (23.5, 18.5), [true, false]),
    ((40.0, 12.0), (40.0, 18.5), [true, false]),
    ((58.0, 10.0), (58.0, 18.5), [true, false]),
    ((75.5, 12.0), (75.5, 18.5), [true, false]),
    ((6.0, 19.5), (6.0, 27.0), [false, true]),
    ((24.5, 19.5), (24.5, 28.0), [false, true]),
    ((48.0, 19.5), (48.0, 28.0), [false, true]),
    ((72.0, 19.5), (72.0, 27.5), [false, true]),
    ((12.5, 5.0), (18.0, 5.0), [true, true]),
    ((29.0, 6.0), (36.0, 6.0), [true, true]),
    ((45.0, 8.5), (52.0, 4.5), [true, true]),
    ((66.0, 7.0), (71.0, 7.0), [true, true]),
    ((11.5, 34.0), (20.0, 34.0), [true, true]),
    ((55.0, 32.0), (66.0, 32.0), [true, true]),
    ((31.0, 19.5), (41.0, 31.0), [false, true]),
    ((29.0, 35.5), (41.0, 35.5), [true, true]),
];

fn at((x, y): Place) -> Point2 {
    Point2::new(x - START.0, y - START.1)
}

/// The office. The seed chooses the furniture and what hangs where.
pub(crate) fn layout(seed: u64) -> Layout<Style> {
    let rng = ChaCha8Rng::seed_from_u64(seed);
    let rooms: Vec<(Polygon, Use)> = ROOMS
        .iter()
        .map(|&(low, high, purpose)| {
            let (low, high) = (at(low), at(high));
            (rectangle(low.x, low.y, high.x, high.y), purpose)
        })
        .collect();
    let lines: Vec<Line> = CORRIDORS.iter().map(|&(a, b, doors)| (at(a), at(b), doors)).collect();
    let floors = rooms.iter().map(|(room, _)| room.clone()).collect();
    let mut furnisher = Furnisher { rooms: &rooms, lines: &lines, floors, solids: Vec::new(), rng };
    for &line in &lines {
        furnisher.corridor(line);
    }
    for (room, purpose) in &rooms {
        furnisher.room(room, *purpose);
    }
    let Furnisher { floors, solids, mut rng, .. } = furnisher;
    let zones = Zones::new(zones(&rooms, &lines, &mut rng));
    let elsewhere = Style::bare(Wall::Plaster([228, 226, 218]), FloorSurface::Linoleum([140, 146, 148]));
    Layout {
        rings: union(&floors),
        displaced: BTreeMap::new(),
        solids,
        zones,
        elsewhere,
        ceiling_m: CEILING_M,
        ceiling: Ceiling::Grid,
    }
}

/// Fills the building, drawing from one random stream.
struct Furnisher<'a> {
    rooms: &'a [(Polygon, Use)],
    lines: &'a [Line],
    floors: Vec<Polygon>,
    solids: Vec<Solid>,
    rng: ChaCha8Rng,
}

impl Furnisher<'_> {
    /// The corridor's floor, its door niches, doorways, pilasters and what stands along its walls,
    /// every 2 m to 3.5 m on alternating sides, so that a LiDAR finds features everywhere.
    fn corridor(&mut self, (from, to, doors): Line) {
        let along = (to - from).normalize();
        let left = Vector2::new(-along.y, along.x);
        let length = (to - from).norm();
        // It reaches a little into what it joins, so that a slanting mouth has no gap.
        self.floors.push(strip(from - along * 0.7, to + along * 0.7, CORRIDOR_M));
        for (there, end, inward) in [(doors[0], from, along), (doors[1], to, -along)] {
            if there {
                self.doorway(end + inward * 0.9, along);
            }
        }
        let mut place = 2.2;
        let mut side = if self.rng.random_bool(0.5) { 1.0 } else { -1.0 };
        while place < length - 2.0 {
            let wall = from + along * place + left * (side * CORRIDOR_M / 2.0);
            let mouth = self
                .lines
                .iter()
                .any(|&(a, b, _)| (a != from || b != to) && distance_to_segment(wall, a, b) < CORRIDOR_M / 2.0 + 1.3);
            let at_room =
                self.rooms.iter().any(|(room, _)| holds(room, wall + left * (side * 0.6)) || holds(room, wall));
            if !mouth && !at_room {
                self.wall(wall, along, left * side);
            }
            place += self.rng.random_range(1.6..2.6);
            side = -side;
        }
    }

    /// One thing at a corridor's wall: a door niche, a pilaster, a cupboard, lockers, a bench, a
    /// machine or a plant.
    fn wall(&mut self, wall: Point2, along: Vector2<f64>, outward: Vector2<f64>) {
        let turn = along.y.atan2(along.x);
        let variant = self.rng.random_range(0..40);
        let mut stand = |width: f64, depth: f64, height: f64, kind: Kind| {
            let footprint = turned_box(wall - outward * (depth / 2.0), width, depth, turn);
            self.solids.push(Solid { footprint, bottom_m: 0.0, top_m: height, kind, variant });
        };
        match self.rng.random_range(0..12) {
            0..=3 => {
                let depth = 0.28;
                let centre = wall + outward * (depth / 2.0 - 0.05);
                self.floors.push(strip(centre - along * 0.6, centre + along * 0.6, depth + 0.1));
            }
            4..=6 => stand(0.45, 0.22, CEILING_M, Kind::Frame),
            7 => stand(self.rng.random_range(0.9..1.3), 0.4, self.rng.random_range(1.0..1.9), Kind::Cupboard),
            8 => stand(self.rng.random_range(0.95..1.3), 0.42, 1.85, Kind::Lockers),
            9 => stand(1.4, 0.45, 0.45, Kind::Bench),
            10 => stand(0.9, 0.6, 1.85, Kind::Vending),
            _ => {
                let footprint = regular(wall - outward * 0.3, 0.27, 8, 0.0);
                self.solids.push(Solid { footprint, bottom_m: 0.0, top_m: 1.4, kind: Kind::Plant, variant });
            }
        }
    }

    /// Two posts and a lintel across a corridor.
    fn doorway(&mut self, centre: Point2, along: Vector2<f64>) {
        let left = Vector2::new(-along.y, along.x);
        let turn = along.y.atan2(along.x);
        let post = (CORRIDOR_M - DOORWAY_M) / 2.0;
        let mut frame = |centre: Point2, width: f64, bottom_m: f64, top_m: f64| {
            let footprint = turned_box(centre, 0.2, width, turn);
            self.solids.push(Solid { footprint, bottom_m, top_m, kind: Kind::Frame, variant: 0 });
        };
        for side in [1.0, -1.0] {
            frame(centre + left * (side * (DOORWAY_M + post) / 2.0), post + 0.02, 0.0, CEILING_M);
        }
        frame(centre, DOORWAY_M, LINTEL_M, CEILING_M);
    }

    /// Puts furniture into a room. Things stand flush with walls or at least 1.1 m from everything
    /// else.
    fn room(&mut self, room: &Polygon, purpose: Use) {
        let (low, high) = (room[0], room[2]);
        let mouths: Vec<Point2> = self.lines.iter().flat_map(|&(a, b, _)| [a, b]).collect();
        let near_mouth = |centre: Point2, reach: f64| mouths.iter().any(|mouth| (mouth - centre).norm() < reach);
        let mut placed: Vec<(Point2, f64)> = Vec::new();
        // Along the four walls.
        let inner: [(Point2, Vector2<f64>, f64); 4] = [
            (Point2::new(low.x, low.y), Vector2::x(), high.x - low.x),
            (Point2::new(high.x, low.y), Vector2::y(), high.y - low.y),
            (Point2::new(high.x, high.y), -Vector2::x(), high.x - low.x),
            (Point2::new(low.x, high.y), -Vector2::y(), high.y - low.y),
        ];
        for (corner, along, length) in inner {
            let inward = Vector2::new(-along.y, along.x);
            let mut place = self.rng.random_range(0.2..1.5);
            while place < length - 1.6 {
                let (width, depth, height, kind) = match (purpose, self.rng.random_range(0..6)) {
                    (Use::Library, 0..=4) => (1.5, 0.35, 2.0, Kind::Bookshelf),
                    (Use::Lab, 0..=2) => (1.6, 0.7, 0.85, Kind::Desk),
                    (_, 0) => (1.2, 0.4, 1.9, Kind::Cupboard),
                    (_, 1) => (1.4, 0.35, 1.9, Kind::Bookshelf),
                    (_, 2) => (1.2, 0.45, 1.85, Kind::Lockers),
                    (Use::Lounge | Use::Meeting, 3) => (1.6, 0.6, 0.45, Kind::Bench),
                    _ => (self.rng.random_range(1.2..2.6), 0.0, 0.0, Kind::Frame),
                };
                let centre = corner + along * (place + width / 2.0) + inward * (depth / 2.0);
                if depth > 0.0 && !near_mouth(centre, 2.2) {
                    let footprint = turned_box(centre, width, depth, along.y.atan2(along.x));
                    self.solids.push(Solid {
                        footprint,
                        bottom_m: 0.0,
                        top_m: height,
                        kind,
                        variant: self.rng.random_range(0..60),
                    });
                    placed.push((centre, width / 2.0));
                }
                place += width + if self.rng.random_bool(0.5) { 0.0 } else { 1.2 };
            }
        }
        // Islands, and one or two pillars.
        let pillars = if purpose == Use::OpenOffice { 2 } else { 1 };
        for attempt in 0..150 {
            let centre = Point2::new(
                self.rng.random_range(low.x + 2.2..high.x - 2.2),
                self.rng.random_range(low.y + 2.2..high.y - 2.2),
            );
            let pillar = attempt < pillars;
            let reach = if pillar { 0.45 } else { 1.0 };
            let crowded = placed.iter().any(|&(other, radius)| (other - centre).norm() < radius + reach + 1.05);
            if crowded || near_mouth(centre, reach + 1.8) {
                continue;
            }
            placed.push((centre, reach));
            if pillar {
                let corners = self.rng.random_range(5..9);
                let footprint = regular(centre, 0.42, corners, self.rng.random_range(0.0..1.0));
                self.solids.push(Solid {
                    footprint,
                    bottom_m: 0.0,
                    top_m: CEILING_M,
                    kind: Kind::Pillar,
                    variant: corners,
                });
            } else {
                self.island(centre, purpose);
            }
        }
    }

    /// A free-standing piece within 1 m of its centre.
    fn island(&mut self, centre: Point2, purpose: Use) {
        let variant = self.rng.random_range(0..60);
        let turn = if self.rng.random_bool(0.5) { 0.0 } else { std::f64::consts::FRAC_PI_2 };
        let mut stand = |offset: f64, width: f64, depth: f64, bottom_m: f64, top_m: f64, kind: Kind| {
            let across = Vector2::new(-turn.sin(), turn.cos()) * offset;
            let footprint = turned_box(centre + across, width, depth, turn);
            self.solids.push(Solid { footprint, bottom_m, top_m, kind, variant });
        };
        match purpose {
            Use::Library => stand(0.0, 1.8, 0.6, 0.0, 1.7, Kind::Bookshelf),
            Use::Meeting => stand(0.0, 1.8, 0.9, 0.0, 0.74, Kind::Desk),
            Use::Lounge => stand(0.0, 1.7, 0.8, 0.0, 0.45, Kind::Bench),
            Use::OpenOffice | Use::Lab => {
                stand(0.0, 1.6, 1.2, 0.0, 0.74, Kind::Desk);
                stand(0.0, 1.6, 0.06, 0.74, 1.25, Kind::Divider);
                stand(0.25, 0.55, 0.06, 0.85, 1.2, Kind::Screen);
                stand(-0.25, 0.55, 0.06, 0.85, 1.2, Kind::Screen);
            }
        }
    }
}

fn distance_to_segment(point: Point2, a: Point2, b: Point2) -> f64 {
    let along = b - a;
    let part = ((point - a).dot(&along) / along.norm_squared().max(1e-12)).clamp(0.0, 1.0);
    (a + along * part - point).norm()
}

/// Paints of plaster walls.
const PAINTS: [[u8; 3]; 5] = [[232, 228, 216], [214, 222, 226], [226, 216, 196], [208, 222, 206], [232, 214, 206]];

fn zones(rooms: &[(Polygon, Use)], lines: &[Line], rng: &mut ChaCha8Rng) -> Vec<(Polygon, Style)> {
    let mut zones: Vec<(Polygon, Style)> = Vec::new();
    for (index, (room, purpose)) in rooms.iter().enumerate() {
        let paint = PAINTS[(index + rng.random_range(0..5)) % 5];
        let (low, high) = (room[0], room[2]);
        let grown = rectangle(low.x - 0.02, low.y - 0.02, high.x + 0.02, high.y + 0.02);
        zones.push((grown, room_style(*purpose, paint)));
    }
    for (index, &(from, to, _)) in lines.iter().enumerate() {
        let floor = FloorSurface::Linoleum([[142, 148, 150], [150, 138, 120], [120, 138, 132]][index % 3]);
        // The long corridor changes its look along the way; the others have one each.
        let stretches = ((to - from).norm() / 13.0).ceil() as usize;
        for stretch in 0..stretches {
            let point = |part: usize| from + (to - from) * (part as f64 / stretches as f64);
            let reach = (to - from).normalize() * 0.75;
            let area = strip(point(stretch) - reach, point(stretch + 1) + reach, CORRIDOR_M + 0.9);
            zones.push((area, corridor_style(index + stretch, floor)));
        }
    }
    zones
}

fn room_style(purpose: Use, paint: [u8; 3]) -> Style {
    match purpose {
        Use::OpenOffice => Style::hung(
            Wall::Plaster(paint),
            FloorSurface::Carpet([84, 96, 112]),
            &[
                Hanging::Window,
                Hanging::Window,
                Hanging::NoticeBoard,
                Hanging::Whiteboard,
                Hanging::Map,
                Hanging::Clock,
            ],
            (0.4, 1.6),
        ),
        Use::Library => Style::hung(
            Wall::Wood([150, 112, 74]),
            FloorSurface::Parquet([150, 108, 70]),
            &[Hanging::Painting(Genre::Portrait), Hanging::Map, Hanging::Window],
            (0.8, 2.0),
        ),
        Use::Meeting => Style::hung(
            Wall::TwoTone(paint, [96, 116, 140]),
            FloorSurface::Carpet([110, 72, 66]),
            &[Hanging::Whiteboard, Hanging::Painting(Genre::Orphic), Hanging::Window, Hanging::Clock],
            (0.5, 1.5),
        ),
        Use::Lab => Style::hung(
            Wall::Concrete,
            FloorSurface::Tiles([204, 208, 210], [190, 196, 200]),
            &[Hanging::Whiteboard, Hanging::NoticeBoard, Hanging::Poster, Hanging::Extinguisher, Hanging::Window],
            (0.4, 1.2),
        ),
        Use::Lounge => Style::hung(
            Wall::Brick([172, 96, 70]),
            FloorSurface::Parquet([186, 148, 104]),
            &[Hanging::Poster, Hanging::Painting(Genre::City), Hanging::Window],
            (0.6, 1.4),
        ),
    }
}

/// The look of a stretch of corridor: five looks alternate.
fn corridor_style(number: usize, floor: FloorSurface) -> Style {
    let paint = PAINTS[number % 5];
    let (oak, grey, blue) = ([176, 132, 84], [150, 154, 158], [70, 96, 130]);
    match number % 5 {
        0 => Style::hung(
            Wall::TwoTone(paint, [126, 148, 160]),
            floor,
            &[Hanging::NoticeBoard, Hanging::Poster, Hanging::Extinguisher, Hanging::Sign("EXIT", [24, 130, 70])],
            (1.0, 2.6),
        )
        .with_doors(oak),
        1 => Style::bare(Wall::Plaster(paint), floor).with_doors(grey),
        2 => Style::hung(
            Wall::Plaster(paint),
            floor,
            &[Hanging::AnyPainting, Hanging::Sign("ROOMS", [40, 60, 120])],
            (1.2, 2.6),
        )
        .with_doors(blue),
        3 => Style::hung(Wall::TwoTone(paint, [176, 160, 120]), floor, &[Hanging::Poster], (1.4, 1.4))
            .repeating()
            .with_doors(oak),
        _ => Style::hung(
            Wall::Plaster(paint),
            floor,
            &[Hanging::Whiteboard, Hanging::Map, Hanging::NoticeBoard, Hanging::Clock],
            (1.2, 2.4),
        )
        .with_doors(oak),
    }
}
