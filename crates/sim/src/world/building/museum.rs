//! The built-in museum: one irregular hall of about 24 m × 20 m around a spiral enclosure, with
//! thin partitions, pillars, a closed block, niches and exhibits.

use crate::world::building::layout::{Layout, Solid};
use crate::world::building::polygon::{Polygon, rectangle, regular, strip, turned_box};
use crate::world::building::style::{Hanging, Style};
use crate::world::building::zones::Zones;
use crate::world::draw::art::Genre;
use crate::world::draw::furniture::Kind;
use crate::world::draw::surfaces::{Ceiling, FloorSurface, Wall};
use fht_perception::pose::Point2;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;

/// A point in the drawing below, metres.
type Place = (f64, f64);

/// Height of the hall, metres.
const CEILING_M: f64 = 3.6;
/// Height of free-standing walls, metres.
const PARTITION_M: f64 = 2.8;
/// Thickness of free-standing walls, metres.
const THICKNESS_M: f64 = 0.2;
/// The world frame's origin, where an explorer starts, in the drawing below, metres.
const START: Place = (5.2, 8.4);

/// The hall's outline in the drawing's frame, counter-clockwise.
const OUTLINE: [Place; 32] = [
    (0.4, 4.2),
    (2.2, 4.2),
    (2.2, 2.6),
    (4.9, 2.4),
    (4.9, 0.3),
    (13.5, 0.3),
    (13.5, 1.7),
    (16.1, 1.7),
    (16.1, 0.3),
    (19.2, 0.3),
    (23.4, 4.1),
    (23.6, 8.6),
    (22.7, 8.6),
    (22.7, 10.6),
    (23.6, 10.6),
    (23.6, 15.4),
    (20.0, 15.5),
    (20.0, 17.0),
    (17.7, 19.6),
    (13.3, 19.6),
    (13.3, 18.3),
    (9.8, 18.3),
    (9.8, 19.6),
    (3.9, 19.2),
    (2.4, 17.9),
    (0.5, 16.4),
    (0.5, 13.6),
    (1.3, 13.6),
    (1.3, 11.2),
    (0.4, 11.2),
    (0.3, 8.0),
    (0.6, 5.6),
];

/// Centre lines of the free-standing walls. The first nine are the enclosure with its four doorways
/// and the spiral in it.
const PARTITIONS: [(Place, Place); 20] = [
    ((7.2, 6.2), (10.2, 6.1)),
    ((11.6, 6.05), (16.2, 5.9)),
    ((16.2, 5.9), (16.3, 8.8)),
    ((16.35, 10.2), (16.5, 14.2)),
    ((16.5, 14.2), (13.0, 14.3)),
    ((11.6, 14.3), (7.4, 14.4)),
    ((7.4, 14.4), (7.35, 12.1)),
    ((7.3, 10.7), (7.2, 6.2)),
    ((9.5, 8.5), (13.9, 8.3)),
    ((13.9, 8.3), (14.0, 12.0)),
    ((14.0, 12.0), (9.7, 12.1)),
    ((9.7, 12.1), (9.65, 10.4)),
    ((3.3, 4.9), (3.1, 7.0)),
    ((3.3, 9.9), (3.0, 14.6)),
    ((8.6, 0.3), (8.5, 2.9)),
    ((12.3, 0.3), (12.1, 3.3)),
    ((23.5, 6.1), (20.6, 6.3)),
    ((7.0, 19.45), (7.1, 16.9)),
    ((15.6, 19.6), (15.3, 16.8)),
    ((18.2, 3.0), (18.3, 5.6)),
];

fn at((x, y): Place) -> Point2 {
    Point2::new(x - START.0, y - START.1)
}

fn zone(x0: f64, y0: f64, x1: f64, y1: f64) -> Polygon {
    rectangle(x0 - START.0, y0 - START.1, x1 - START.0, y1 - START.1)
}

/// The museum. The seed shifts exhibits a little and chooses the pictures.
pub(crate) fn layout(seed: u64) -> Layout<Style> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut solids: Vec<Solid> =
        PARTITIONS.iter().enumerate().map(|(index, &(from, to))| partition(from, to, index as u32)).collect();
    for (index, centre) in [(5.2, 16.6), (19.2, 8.3)].into_iter().enumerate() {
        let footprint = regular(at(centre), 0.6, 12, 0.1);
        solids.push(Solid { footprint, bottom_m: 0.0, top_m: CEILING_M, kind: Kind::Pillar, variant: index as u32 });
    }
    // The closed block: its faces are walls like all others and reach the ceiling.
    let block = zone(18.1, 10.9, 21.4, 13.9);
    solids.push(Solid { footprint: block, bottom_m: 0.0, top_m: CEILING_M, kind: Kind::Partition, variant: 90 });
    exhibits(&mut solids, &mut rng);
    Layout {
        rings: vec![OUTLINE.map(at).to_vec()],
        displaced: BTreeMap::new(),
        solids,
        zones: Zones::new(zones(&mut rng)),
        elsewhere: Style::bare(Wall::Plaster([226, 222, 212]), FloorSurface::Parquet([158, 112, 70])),
        ceiling_m: CEILING_M,
        ceiling: Ceiling::Gallery,
    }
}

fn partition(from: Place, to: Place, variant: u32) -> Solid {
    // Ends overlap where walls meet, so that no slit remains.
    let (from, to) = (at(from), at(to));
    let reach = (to - from).normalize() * (THICKNESS_M / 2.0);
    let footprint = strip(from - reach, to + reach, THICKNESS_M);
    Solid { footprint, bottom_m: 0.0, top_m: PARTITION_M, kind: Kind::Partition, variant }
}

/// Plinths with exhibits, glass cases, benches and plants.
fn exhibits(solids: &mut Vec<Solid>, rng: &mut ChaCha8Rng) {
    let statues = [
        (6.3, 3.0),
        (10.4, 2.2),
        (14.7, 3.9),
        (20.3, 3.6),
        (17.2, 17.6),
        (13.4, 16.6),
        (9.4, 16.4),
        (1.9, 9.4),
        (5.4, 12.4),
        (11.6, 10.2),
        (19.0, 6.4),
        (2.0, 15.6),
    ];
    for (index, place) in statues.into_iter().enumerate() {
        let variant = index as u32;
        let centre = jittered(place, rng);
        let turn = rng.random_range(0.0..1.5);
        let plinth_top = rng.random_range(0.6..0.95);
        let side = rng.random_range(0.5..0.75);
        let plinth = turned_box(centre, side, side, turn);
        solids.push(Solid { footprint: plinth, bottom_m: 0.0, top_m: plinth_top, kind: Kind::Plinth, variant });
        figure(centre, plinth_top, side, turn, variant, solids, rng);
    }
    let cases = [
        (10.6, 4.4, 0.0),
        (14.2, 10.0 - 5.0 + 2.2, 0.0),
        (4.9, 5.6, 1.2),
        (23.2, 12.9, 1.57),
        (17.4, 1.9, 0.0),
        (11.9, 13.2, 0.0),
    ];
    for (index, (x, y, turn)) in cases.into_iter().enumerate() {
        let footprint = turned_box(jittered((x, y), rng), 1.4, 0.55, turn);
        solids.push(Solid { footprint, bottom_m: 0.0, top_m: 1.5, kind: Kind::Showcase, variant: index as u32 });
    }
    for (index, (x, y, turn)) in
        [(5.2, 10.3, 1.57), (18.8, 16.2, 0.0), (20.9, 9.6, 0.0), (9.3, 7.4 - 0.05, 0.05)].into_iter().enumerate()
    {
        let footprint = turned_box(jittered((x, y), rng), 1.5, 0.5, turn);
        solids.push(Solid { footprint, bottom_m: 0.0, top_m: 0.45, kind: Kind::Bench, variant: index as u32 });
    }
    for (index, place) in [(13.0, 0.75), (0.85, 4.7), (23.1, 8.1), (3.9, 18.8)].into_iter().enumerate() {
        let footprint = regular(at(place), 0.28, 8, 0.0);
        solids.push(Solid { footprint, bottom_m: 0.0, top_m: 1.5, kind: Kind::Plant, variant: index as u32 });
    }
}

/// Outlines of exhibits from the bottom up, as fractions of the plinth's half side; and their
/// number of corners.
const FIGURES: [(&[f64], u32); 6] = [
    (&[0.35, 0.5, 0.75, 0.9, 0.85, 0.65, 0.4, 0.32, 0.42], 12),
    (&[0.85, 0.95, 0.9, 0.65, 0.36, 0.34, 0.5, 0.58, 0.56, 0.42, 0.2], 12),
    (&[0.75, 0.7, 0.66, 0.61, 0.56, 0.52, 0.47, 0.42, 0.38, 0.2], 4),
    (&[0.9, 0.7, 0.7, 0.68, 0.68, 0.66, 0.66, 0.85, 0.9], 16),
    (&[0.3, 0.6, 0.8, 0.88, 0.88, 0.8, 0.6, 0.3], 14),
    (&[0.5, 0.4, 0.3, 0.3, 0.45, 0.6, 0.5, 0.35, 0.3, 0.5, 0.7], 6),
];

/// A vase, a bust, an obelisk, a column or a modern piece, in slices.
fn figure(
    centre: Point2,
    bottom_m: f64,
    side_m: f64,
    turn: f64,
    variant: u32,
    solids: &mut Vec<Solid>,
    rng: &mut ChaCha8Rng,
) {
    let (outline, corners) = FIGURES[variant as usize % FIGURES.len()];
    let slice = rng.random_range(0.07..0.12);
    for (index, part) in outline.iter().enumerate() {
        let bottom_m = bottom_m + slice * index as f64;
        let footprint = regular(centre, part * side_m / 2.0, corners, turn);
        solids.push(Solid { footprint, bottom_m, top_m: bottom_m + slice, kind: Kind::Exhibit, variant });
    }
}

fn jittered((x, y): Place, rng: &mut ChaCha8Rng) -> Point2 {
    at((x + rng.random_range(-0.12..0.12), y + rng.random_range(-0.12..0.12)))
}

fn zones(rng: &mut ChaCha8Rng) -> Vec<(Polygon, Style)> {
    let parquet = FloorSurface::Parquet([158, 112, 70]);
    let dark_parquet = FloorSurface::Parquet([104, 70, 46]);
    let stone = FloorSurface::Tiles([206, 200, 190], [196, 188, 176]);
    let chequered = FloorSurface::Tiles([214, 208, 198], [92, 88, 86]);
    let (red, green, blue) = ([128, 34, 38], [58, 88, 66], [44, 62, 100]);
    let classical =
        [Hanging::Painting(Genre::Portrait), Hanging::Painting(Genre::Landscape), Hanging::Painting(Genre::StillLife)];
    let modern =
        [Hanging::Painting(Genre::Geometric), Hanging::Painting(Genre::Gestural), Hanging::Painting(Genre::Orphic)];
    let towns = [Hanging::Painting(Genre::City), Hanging::Painting(Genre::Landscape), Hanging::Text("CITIES")];
    let mut galleries = vec![
        Style::hung(Wall::Damask(red), dark_parquet, &classical, (0.25, 0.7)),
        Style::hung(Wall::Damask(green), parquet, &[Hanging::Painting(Genre::Portrait)], (0.3, 0.6)),
        Style::hung(Wall::Plaster([238, 236, 230]), parquet, &modern, (0.5, 1.2)),
        Style::hung(Wall::Plaster(blue), parquet, &towns, (0.4, 0.9)),
    ];
    // The seed chooses which gallery hangs where.
    for index in (1..galleries.len()).rev() {
        galleries.swap(index, rng.random_range(0..=index));
    }
    let areas = [
        zone(0.0, 7.2, 7.2, 15.6),
        zone(2.0, 15.6, 12.0, 20.0),
        zone(12.0, 14.4, 21.0, 20.0),
        zone(16.4, 0.0, 24.0, 6.2),
    ];
    let mut zones: Vec<(Polygon, Style)> = vec![
        // The centre of the spiral is rich in pictures, the passage around it repeats one picture,
        // and the south of the outer ring is bare.
        (
            zone(9.6, 8.4, 14.0, 12.1),
            Style::hung(
                Wall::Plaster([66, 58, 84]),
                chequered,
                &[Hanging::AnyPainting, Hanging::Text("ORIGINS")],
                (0.3, 0.6),
            ),
        ),
        (
            zone(7.25, 6.1, 16.4, 8.4),
            Style::hung(Wall::Plaster([222, 214, 196]), chequered, &[Hanging::Poster], (0.6, 0.6)).repeating(),
        ),
        (
            zone(7.25, 8.4, 16.4, 14.3),
            Style::hung(
                Wall::Stripes([206, 186, 140], [188, 162, 112]),
                chequered,
                &[Hanging::Painting(Genre::StillLife), Hanging::Poster, Hanging::Map],
                (0.5, 1.0),
            ),
        ),
    ];
    zones.extend(areas.into_iter().zip(galleries));
    zones.push((
        zone(16.4, 6.2, 24.0, 15.6),
        Style::hung(
            Wall::Marble([206, 198, 184]),
            stone,
            &[Hanging::Relief, Hanging::Relief, Hanging::Text("ANTIQUITY")],
            (0.6, 1.4),
        ),
    ));
    zones.push((
        zone(8.6, 0.0, 16.4, 6.2),
        Style::hung(
            Wall::Brick([158, 84, 62]),
            stone,
            &[Hanging::Poster, Hanging::Poster, Hanging::Sign("TICKETS", [30, 30, 34]), Hanging::Door([96, 60, 40])],
            (0.5, 1.2),
        ),
    ));
    zones.push((
        zone(2.0, 0.0, 8.6, 4.5),
        Style::hung(Wall::Plaster([230, 226, 216]), stone, &[Hanging::Window], (0.8, 0.8)).repeating(),
    ));
    zones
}
