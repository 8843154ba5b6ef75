//! Turns a layout into a scene: walls get a finish and pictures, things get sides and tops.

use crate::plan::FloorPlan;
use crate::scene::{Face, Ground, Scene, SceneBuilder, TextureId};
use crate::world::building::layout::{Layout, Placement, Solid};
use crate::world::building::polygon::sides;
use crate::world::building::style::{Hanging, Style};
use crate::world::draw::Panel;
use crate::world::draw::furniture;
use crate::world::draw::furniture::Kind;
use crate::world::draw::surfaces::{self, FloorSurface, Wall};
use fht_perception::pose::Point2;
use image::RgbImage;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;

/// Walls are finished in pieces of at most this length, metres, so that a long wall can run through
/// several zones.
const PIECE_M: f64 = 2.4;
/// Distance in front of a wall at which its zone is looked up, metres.
const IN_FRONT_M: f64 = 0.3;
/// How far pictures protrude from the wall, metres. Less than the LiDAR's noise.
const PROUD_M: f64 = 0.008;
/// Gap kept from the ends of a wall, metres.
const END_GAP_M: f64 = 0.12;
/// Faces of about this width are door niches, metres.
const NICHE_M: (f64, f64) = (1.1, 1.35);
/// Floors are darker within this distance of obstacles, metres.
const CORNER_SHADE_M: f64 = 0.35;

/// A drawn panel that may hang in several places.
#[derive(Clone, Copy)]
struct Hung {
    texture: TextureId,
    width_m: f64,
    height_m: f64,
    bottom_m: f64,
}

/// Draws and places everything from one seed.
struct Dresser<'a> {
    layout: &'a Layout<Style>,
    photographs: &'a [RgbImage],
    builder: SceneBuilder,
    rng: ChaCha8Rng,
    seed: u64,
    walls: BTreeMap<(Wall, u32), TextureId>,
    floors: BTreeMap<FloorSurface, TextureId>,
    sides: BTreeMap<(Kind, u32, u32, u32), TextureId>,
    tops: BTreeMap<(Kind, u32), TextureId>,
    copies: BTreeMap<(usize, usize), Hung>,
    /// Where the current wall stands, if not where it was drawn.
    placement: Option<Placement>,
}

/// The scene of a layout. `None` if it has no wall at all.
pub(crate) fn dress(layout: &Layout<Style>, plan: &FloorPlan, photographs: &[RgbImage], seed: u64) -> Option<Scene> {
    let mut dresser = Dresser {
        layout,
        photographs,
        builder: SceneBuilder::default(),
        rng: ChaCha8Rng::seed_from_u64(seed),
        seed,
        walls: BTreeMap::new(),
        floors: BTreeMap::new(),
        sides: BTreeMap::new(),
        tops: BTreeMap::new(),
        copies: BTreeMap::new(),
        placement: None,
    };
    for (index, ring) in layout.rings.iter().enumerate() {
        // A removed wall is drawn all the same, so that the others keep what the seed gave them.
        dresser.placement = layout.displaced.get(&index).copied();
        for (from, to) in sides(ring) {
            dresser.wall(Face { from, to, bottom_m: 0.0, top_m: layout.ceiling_m });
        }
    }
    dresser.placement = None;
    for solid in &layout.solids {
        dresser.solid(solid);
    }
    let ground = dresser.ground(plan);
    let overhead = surfaces::ceiling(layout.ceiling, &mut dresser.rng);
    let overhead = dresser.builder.texture(overhead);
    dresser.builder.build(ground, overhead, layout.ceiling_m)
}

impl<'a> Dresser<'a> {
    /// Adds a face of a wall where the wall stands.
    fn put(&mut self, face: Face, texture: TextureId, left_m: f64, texture_top_m: f64) {
        let by = match self.placement {
            Some(Placement::Gone) => return,
            Some(Placement::Moved(by)) => by,
            None => nalgebra::Vector2::zeros(),
        };
        let there = Face { from: face.from + by, to: face.to + by, ..face };
        self.builder.face(there, texture, left_m, texture_top_m);
    }

    /// A finished wall with what hangs on it.
    fn wall(&mut self, face: Face) {
        let along = face.to - face.from;
        let length = along.norm();
        if length < 1e-6 {
            return;
        }
        let pieces = (length / PIECE_M).ceil().max(1.0);
        // Seen from the front, the left end is `to`: the finish starts there.
        let at = |m: f64| face.to - along * (m / length);
        let in_front = nalgebra::Vector2::new(-along.y, along.x) * (IN_FRONT_M / length);
        for piece in 0..pieces as usize {
            let (left, right) = (length * piece as f64 / pieces, length * (piece + 1) as f64 / pieces);
            let zone = self.zone_at(at((left + right) / 2.0) + in_front);
            let finish = self.finish(self.style(zone).wall, face.top_m);
            let part = Face { from: at(right), to: at(left), ..face };
            self.put(part, finish, left, face.top_m);
        }
        let zone = self.zone_at(at(length / 2.0) + in_front);
        if let Some(colour) = self.style(zone).hangings.niche_door
            && (NICHE_M.0..NICHE_M.1).contains(&length)
        {
            let panel = Hanging::Door(colour).draw(self.photographs, &mut self.rng);
            let hung = self.keep(panel);
            self.hang(face, length / 2.0 - hung.width_m / 2.0, hung);
            return;
        }
        self.hang_along(face, length, |m| at(m) + in_front);
    }

    /// Hangs things from the left end to the right.
    fn hang_along(&mut self, face: Face, length: f64, in_front_of: impl Fn(f64) -> Point2) {
        let mut left = END_GAP_M;
        let mut misses = 0;
        let mut last = None;
        while left + 0.5 < length && misses < 4 {
            let zone = self.zone_at(in_front_of(left + 0.4));
            let hangings = &self.style(zone).hangings;
            if hangings.choice.is_empty() {
                left += 1.0;
                continue;
            }
            let gap = self.rng.random_range(hangings.gap_m.0..=hangings.gap_m.1);
            let count = hangings.choice.len();
            let drawn = self.rng.random_range(0..count);
            // Not the same kind twice in a row if there is a choice.
            let which = if last == Some(drawn) { (drawn + 1) % count } else { drawn };
            let (hanging, copies) = (hangings.choice[which], hangings.copies);
            let start = left + gap / 2.0;
            let hung = self.drawn(zone, which, hanging, copies);
            let fits = start + hung.width_m + END_GAP_M <= length && hung.bottom_m + hung.height_m < face.top_m - 0.03;
            if fits {
                self.hang(face, start, hung);
                last = Some(which);
                left = start + hung.width_m + gap / 2.0;
            } else {
                misses += 1;
            }
        }
    }

    fn drawn(&mut self, zone: usize, which: usize, hanging: Hanging, copies: bool) -> Hung {
        if !copies {
            let panel = hanging.draw(self.photographs, &mut self.rng);
            return self.keep(panel);
        }
        if let Some(&hung) = self.copies.get(&(zone, which)) {
            return hung;
        }
        let panel = hanging.draw(self.photographs, &mut self.rng);
        let hung = self.keep(panel);
        self.copies.insert((zone, which), hung);
        hung
    }

    fn keep(&mut self, panel: Panel) -> Hung {
        let texture = self.builder.texture(panel.texture);
        Hung { texture, width_m: panel.width_m, height_m: panel.height_m, bottom_m: panel.bottom_m }
    }

    /// Hangs a panel with its left edge `left_m` from the face's left end.
    fn hang(&mut self, face: Face, left_m: f64, hung: Hung) {
        let along = face.from - face.to;
        let unit = along / along.norm().max(1e-9);
        let out = nalgebra::Vector2::new(unit.y, -unit.x) * PROUD_M;
        let (left, right) = (face.to + unit * left_m + out, face.to + unit * (left_m + hung.width_m) + out);
        let top_m = hung.bottom_m + hung.height_m;
        self.put(Face { from: right, to: left, bottom_m: hung.bottom_m, top_m }, hung.texture, 0.0, top_m);
    }

    fn solid(&mut self, solid: &Solid) {
        for (from, to) in sides(&solid.footprint) {
            let face = Face { from: to, to: from, bottom_m: solid.bottom_m, top_m: solid.top_m };
            if solid.kind == Kind::Partition {
                self.wall(face);
            } else {
                let texture = self.side(solid, (to - from).norm());
                self.builder.face(face, texture, 0.0, solid.top_m);
            }
        }
        if solid.top_m < self.layout.ceiling_m - 0.01 {
            let texture = self.top(solid);
            self.builder.slab(&solid.footprint, solid.top_m, texture, true);
        }
        if solid.bottom_m > 0.0 {
            let texture = self.top(solid);
            self.builder.slab(&solid.footprint, solid.bottom_m, texture, false);
        }
    }

    fn side(&mut self, solid: &Solid, width_m: f64) -> TextureId {
        let height_m = solid.top_m - solid.bottom_m;
        let key = (solid.kind, solid.variant, (width_m * 100.0) as u32, (height_m * 100.0) as u32);
        if let Some(&texture) = self.sides.get(&key) {
            return texture;
        }
        let mut rng = self.rng_of(solid);
        let texture = self.builder.texture(furniture::side(solid.kind, width_m, height_m, &mut rng));
        self.sides.insert(key, texture);
        texture
    }

    fn top(&mut self, solid: &Solid) -> TextureId {
        if let Some(&texture) = self.tops.get(&(solid.kind, solid.variant)) {
            return texture;
        }
        let mut rng = self.rng_of(solid);
        let texture = self.builder.texture(furniture::top(solid.kind, &mut rng));
        self.tops.insert((solid.kind, solid.variant), texture);
        texture
    }

    /// Things of one kind and variant are drawn from the same random numbers.
    fn rng_of(&self, solid: &Solid) -> ChaCha8Rng {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        rng.set_stream(1 + (u64::from(solid.variant) << 8 | solid.kind as u64));
        rng
    }

    fn finish(&mut self, wall: Wall, height_m: f64) -> TextureId {
        let key = (wall, (height_m * 100.0) as u32);
        if let Some(&texture) = self.walls.get(&key) {
            return texture;
        }
        let texture = self.builder.texture(surfaces::wall(wall, height_m, &mut self.rng));
        self.walls.insert(key, texture);
        texture
    }

    fn floor(&mut self, floor: FloorSurface) -> TextureId {
        if let Some(&texture) = self.floors.get(&floor) {
            return texture;
        }
        let texture = self.builder.texture(surfaces::floor(floor, &mut self.rng));
        self.floors.insert(floor, texture);
        texture
    }

    fn ground(&mut self, plan: &FloorPlan) -> Ground {
        let outside = self.floor(self.layout.elsewhere.floor);
        let mut textures = vec![outside; plan.width() * plan.height()];
        let mut openness = vec![1.0; textures.len()];
        for row in 0..plan.height() {
            for column in 0..plan.width() {
                let index = row * plan.width() + column;
                let centre = plan.centre_of(column, row);
                openness[index] = (0.68 + 0.32 * (plan.clearance_m(centre) / CORNER_SHADE_M).min(1.0)) as f32;
                // At a slanting wall, part of an occupied cell is visible too.
                let is_free = |dx: usize, dy: usize| {
                    let (x, y) = ((column + dx).wrapping_sub(1), (row + dy).wrapping_sub(1));
                    x < plan.width() && y < plan.height() && !plan.cells()[y * plan.width() + x]
                };
                if (0..9).any(|neighbour| is_free(neighbour % 3, neighbour / 3)) {
                    let floor = self.layout.style_at(centre).floor;
                    textures[index] = self.floor(floor);
                }
            }
        }
        Ground {
            origin: plan.origin(),
            resolution_m: plan.resolution_m(),
            width: plan.width(),
            textures,
            openness,
            outside,
        }
    }

    fn zone_at(&self, point: Point2) -> usize {
        self.layout.zone_at(point)
    }

    fn style(&self, zone: usize) -> &'a Style {
        self.layout.zones.get(zone).unwrap_or(&self.layout.elsewhere)
    }
}
