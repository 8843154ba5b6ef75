//! Buildings drawn as lines, and maps of them as a robot with a scanner would make them.
#![allow(dead_code, clippy::unwrap_used)] // each test uses a part; tests may panic

use fht_map::MapState;
use fht_perception::pose::{Point2, Pose2, pose, to_fixed};
use fht_proto::{
    AuthorId, Descriptor, DescriptorModel, EdgeKey, FixedPose, Increment, ModelId, NodeId, NodeKind, Op, Rect,
    ScanRecord, Signature,
};

type Wall = [(f64, f64); 2];

/// Walls as lines, and places where a robot looks around.
#[derive(Clone, Debug, Default)]
pub struct Building {
    pub walls: Vec<Wall>,
    pub places: Vec<(f64, f64)>,
}

/// A room on a corridor: how wide, how deep, and where its door of 0.9 m begins.
pub type Room = (f64, f64, f64);

/// Rooms as no other building has them.
pub const ROOMS: [Room; 9] = [
    (3.1, 3.0, 0.7),
    (4.4, 4.2, 2.6),
    (2.6, 2.5, 0.5),
    (5.0, 3.6, 3.4),
    (3.7, 5.0, 1.3),
    (4.1, 3.2, 0.6),
    (2.9, 4.6, 1.6),
    (4.7, 2.8, 2.9),
    (3.4, 3.9, 0.9),
];

impl Building {
    /// A corridor along x, 2 m wide, with rooms on its left.
    pub fn wing(rooms: &[Room]) -> Self {
        const DOOR_M: f64 = 0.9;
        const CORRIDOR_M: f64 = 2.0;
        let mut building = Self::default();
        let length: f64 = rooms.iter().map(|room| room.0).sum();
        building.walls.push([(0.0, 0.0), (length, 0.0)]);
        building.walls.push([(0.0, 0.0), (0.0, CORRIDOR_M)]);
        building.walls.push([(length, 0.0), (length, CORRIDOR_M)]);
        let mut x = 0.0;
        for &(width, depth, door) in rooms {
            let (low, high) = (CORRIDOR_M, CORRIDOR_M + depth);
            building.walls.push([(x, low), (x + door, low)]);
            building.walls.push([(x + door + DOOR_M, low), (x + width, low)]);
            building.walls.push([(x, low), (x, high)]);
            building.walls.push([(x + width, low), (x + width, high)]);
            building.walls.push([(x, high), (x + width, high)]);
            building.places.push((x + 0.5 * width, 1.0));
            building.places.push((x + door + 0.5 * DOOR_M, low + 0.3));
            building.places.push((x + 0.5 * width, low + 0.5 * depth));
            x += width;
        }
        building
    }

    /// A box that stands around.
    pub fn with_box(mut self, (x, y): (f64, f64), side: f64) -> Self {
        let corners = [(x, y), (x + side, y), (x + side, y + side), (x, y + side)];
        self.walls.extend((0..4).map(|corner| [corners[corner], corners[(corner + 1) % 4]]));
        self
    }

    /// The same, seen only where x is in a range.
    pub fn seen_within(&self, range: std::ops::Range<f64>) -> Self {
        let places = self.places.iter().copied().filter(|(x, _)| range.contains(x)).collect();
        Self { walls: self.walls.clone(), places }
    }

    fn range_m(&self, at: Point2, angle: f64) -> Option<f64> {
        let (dy, dx) = angle.sin_cos();
        let meets = self.walls.iter().filter_map(|&[(x1, y1), (x2, y2)]| {
            let (ex, ey, ox, oy) = (x2 - x1, y2 - y1, x1 - at.x, y1 - at.y);
            let cross = dx * ey - dy * ex;
            let (t, u) = ((ox * ey - oy * ex) / cross, (ox * dy - oy * dx) / cross);
            (t > 0.0 && (0.0..=1.0).contains(&u)).then_some(t)
        });
        meets.min_by(f64::total_cmp).filter(|range| *range < 7.0)
    }

    /// What a scanner at a pose records: 360 beams up to 7 m, with a noise of about 1 cm.
    fn scan(&self, at: &Pose2, noise: &mut u32) -> ScanRecord {
        let here = Point2::from(at.translation.vector);
        let mut range = |beam: i32| {
            *noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let error = (f64::from(*noise >> 16) / 65_536.0 - 0.5) * 0.035;
            let range = self.range_m(here, f64::from(beam).to_radians() + at.rotation.angle());
            range.map_or(0, |metres| ((metres + error).max(0.1) * 200.0).round() as u16 * 5)
        };
        ScanRecord {
            base_from_sensor: FixedPose::default(),
            angle_min: 0.0,
            angle_increment: 1.0_f32.to_radians(),
            ranges_mm: (0..360).map(&mut range).collect(),
        }
    }

    /// The map of a robot called `robot` whose frame lies at `world_from_map`.
    pub fn mapped(&self, world_from_map: &Pose2, robot: &str, seed: u32) -> MapState {
        self.mapped_with_looks(world_from_map, robot, seed, |_| None)
    }

    /// The same, with what places look like.
    pub fn mapped_with_looks(
        &self,
        world_from_map: &Pose2,
        robot: &str,
        seed: u32,
        look: impl Fn(Point2) -> Option<Vec<f32>>,
    ) -> MapState {
        let author = AuthorId::of_robot(robot);
        let mut noise = seed;
        let mut ops = vec![Op::PutModel { model: model() }];
        for (number, &(x, y)) in (0_u32..).zip(&self.places) {
            let id = NodeId { author, number };
            // Robots look where they happen to look.
            let world_from_node = pose(x + 0.1 * f64::from(seed % 3), y, f64::from(number * seed));
            let position = to_fixed(&(world_from_map.inverse() * world_from_node));
            ops.push(Op::PutNode { id, kind: NodeKind::Main, pose: position });
            let descriptor = look(Point2::new(x, y)).map(|values| Descriptor::quantise(model().id, &values));
            let signature = Signature { descriptor, scan: self.scan(&world_from_node, &mut noise) };
            ops.push(Op::SetSignature { id, signature });
            let rect = Rect { west_mm: 200, south_mm: 200, east_mm: 200, north_mm: 200 };
            ops.push(Op::SetFreeSpace { id, rect: Some(rect) });
            // Room centres hang on their doors, doors on the corridor, the corridor on itself.
            let edge = |other: u32| Op::PutEdge { edge: EdgeKey::new(id, NodeId { author, number: other }) };
            match number % 3 {
                0 if number > 0 => ops.push(edge(number - 3)),
                0 => {}
                _ => ops.push(edge(number - 1)),
            }
        }
        let mut map = MapState::new();
        map.apply(&Increment { author, number: 1, hlc_us: 1, ops });
        map
    }
}

pub fn model() -> DescriptorModel {
    DescriptorModel { id: ModelId(7), name: "drawn".to_owned(), dimension: 8, match_threshold_e3: 500 }
}

/// How far nodes of `b` are from where they truly are in `a`, the greatest, metres.
pub fn worst_m(laid: &fht_merge::Alignment, b: &MapState, world_from_a: &Pose2, world_from_b: &Pose2) -> f64 {
    let a_from_b = world_from_a.inverse() * world_from_b;
    let off = |node: fht_map::NodeRef<'_>| {
        let truth = a_from_b * fht_perception::pose::from_fixed(node.pose);
        (laid.a_from_nodes[&node.id].translation.vector - truth.translation.vector).norm()
    };
    b.nodes().map(off).fold(0.0, f64::max)
}
