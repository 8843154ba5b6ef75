//! A robot's body on the floor: it drives, slides along walls, and counts what it hits.

use crate::world::{BODY_HEIGHT_M, World};
use fht_perception::pose::{Point2, Pose2, pose};
use nalgebra::Vector2;

/// Integration steps in one LiDAR period: at 0.5 m/s and 5 Hz the body moves 1 cm in each, less
/// than any wall's width.
pub(crate) const SUBSTEPS: u32 = 10;

/// A push out of an obstacle by less than this is rounding, not contact, metres.
const TOUCH_M: f64 = 1e-4;

/// A disc that drives, and what has become of it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Chassis {
    pub(crate) world_from_base: Pose2,
    pub(crate) radius_m: f64,
    pub(crate) driven_m: f64,
    /// How many times it has hit a wall or a thing.
    pub(crate) collisions: u64,
    pub(crate) is_touching: bool,
}

/// A small step that a robot wants to take: along an arc from one place to another.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Step {
    pub(crate) from: Point2,
    /// Where it gets.
    pub(crate) to: Point2,
    /// Direction of the arc's middle: cosine and sine.
    ahead: Vector2<f64>,
    heading: f64,
    turn_rad: f64,
}

/// What the wheels turn in a step: the distance that the body really moved along its own x, metres,
/// since blocked wheels stall; and the turn, radians.
pub(crate) type Roll = (f64, f64);

impl Chassis {
    pub(crate) fn at(world_from_base: Pose2, radius_m: f64) -> Self {
        Self { world_from_base, radius_m, driven_m: 0.0, collisions: 0, is_touching: false }
    }

    pub(crate) fn position(&self) -> Point2 {
        Point2::from(self.world_from_base.translation.vector)
    }

    /// A step of so much along a small arc, as far as walls let it.
    pub(crate) fn step(&mut self, world: &World, forward_m: f64, turn_rad: f64) -> Step {
        let heading = self.world_from_base.rotation.angle();
        let (sin, cos) = (heading + turn_rad / 2.0).sin_cos();
        let from = self.position();
        let wanted = Point2::new(from.x + forward_m * cos, from.y + forward_m * sin);
        let to = self.keep_out(world, from, wanted);
        Step { from, to, ahead: Vector2::new(cos, sin), heading, turn_rad }
    }

    /// Takes the step; how it moved, metres, and what the wheels say.
    pub(crate) fn take(&mut self, step: &Step) -> (Vector2<f64>, Roll) {
        let moved = step.to - step.from;
        self.world_from_base = pose(step.to.x, step.to.y, step.heading + step.turn_rad);
        self.driven_m += moved.norm();
        (moved, (moved.x * step.ahead.x + moved.y * step.ahead.y, step.turn_rad))
    }

    /// The place nearest to `wanted` where the body touches nothing: pushed off the walls, or
    /// `from` if the corner is too tight for that.
    fn keep_out(&mut self, world: &World, from: Point2, wanted: Point2) -> Point2 {
        let radius = self.radius_m;
        let mut at = wanted;
        let mut touched = false;
        // Two pushes resolve a corner; the third confirms it.
        for _ in 0..3 {
            let (nearest, distance) = world.scene().nearest(at, BODY_HEIGHT_M);
            if distance >= radius - TOUCH_M {
                break;
            }
            touched = true;
            let away = at - nearest;
            let length = away.norm();
            if length < 1e-9 {
                at = from;
                break;
            }
            at = nearest + away * (radius / length);
        }
        if touched && world.scene().nearest(at, BODY_HEIGHT_M).1 < radius - 10.0 * TOUCH_M {
            at = from;
        }
        if touched && !self.is_touching {
            self.collisions += 1;
        }
        self.is_touching = touched;
        at
    }
}
