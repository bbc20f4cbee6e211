//! What single particles may not leave: a distance from their bones, and their side of the plane between them.

// Loops and no closures, which are not compiled for the instruction set that calls them.
#![allow(clippy::needless_range_loop)]

use super::super::constraint::{Axis, HalfSpace};
use super::super::number::{Number, Vector, add, dot, scaled, sub};
use super::kind::Kind;

/// As good as no limit.
const FAR: f32 = 1e30;

/// Limits of one joint in one step. What they do is [`super::super::constraint::bind`], from above only, and
/// [`super::super::constraint::self_collision`].
#[derive(Debug, Clone, Copy)]
pub struct Limits {
    origin: Vector<f32>,
    directions: [Vector<f32>; 2],
    /// Zero where there is no plane.
    normal: Vector<f32>,
    gap: f32,
    most: f32,
}

impl Limits {
    /// Skin stays within `most` times its distance at rest (0: anywhere), and on its own side of the plane.
    pub fn new(axis: &Axis, plane: Option<&HalfSpace>, most: f32) -> Self {
        Self {
            origin: axis.origin.to_array(),
            directions: axis.directions.map(|direction| direction.to_array()),
            normal: plane.map_or([0.0; 3], |plane| plane.normal.to_array()),
            gap: plane.map_or(0.0, |plane| plane.gap),
            most: if most > 0.0 { most } else { FAR },
        }
    }

    /// The move back to at most `most` times a distance from the bones.
    #[inline(always)]
    fn bind<T: Number>(&self, arm: Vector<T>, distance: T) -> Vector<T> {
        let zero = distance.constant(0.0);
        let (a, b) = (offset(arm, self.directions[0]), offset(arm, self.directions[1]));
        let (square_a, square_b) = (dot(a, a), dot(b, b));
        let mut offset = a;
        for c in 0..3 {
            offset[c] = square_b.if_less(square_a, b[c], a[c]);
        }
        let now = square_a.lesser(square_b).sqrt() + zero.constant(1e-20);
        let excess = distance * zero.constant(self.most) / now - zero.constant(1.0);
        scaled(offset, excess.lesser(zero))
    }

    /// How far to move along the plane's normal from `height` above it. What lies in the plane at rest (side 0) stays between
    /// the sides by half a gap.
    #[inline(always)]
    fn lift<T: Number>(&self, height: T, side: T, holds_middle: bool) -> T {
        let (zero, gap) = (side.constant(0.0), side.constant(self.gap));
        let own = -(height * side - gap).lesser(zero) * side;
        if !holds_middle {
            return own;
        }
        let half = gap * side.constant(0.5);
        let middle = -(-height.lesser(half)).lesser(half);
        (side * side).if_less(side.constant(0.5), middle - height, own)
    }
}

/// Skin: its distance from the bones at rest and its side.
impl Kind<1, 2, 0> for Limits {
    #[inline(always)]
    fn project<T: Number>(
        self,
        places: &mut [Vector<T>; 1],
        w: [T; 1],
        [distance, side]: [T; 2],
        _multipliers: &mut [T; 0],
    ) {
        let (origin, normal) = (constant(w[0], self.origin), constant(w[0], self.normal));
        let mut at = places[0];
        at = add(at, self.bind(sub(at, origin), distance));
        let by = self.lift(dot(sub(at, origin), normal), side, true);
        places[0] = add(at, scaled(normal, by));
    }
}

/// The limits of the lattice: nodes have a side alone, those in the plane go where they like.
#[derive(Debug, Clone, Copy)]
pub struct OfNodes(pub Limits);

impl Kind<1, 1, 0> for OfNodes {
    #[inline(always)]
    fn project<T: Number>(self, places: &mut [Vector<T>; 1], w: [T; 1], [side]: [T; 1], _multipliers: &mut [T; 0]) {
        let (origin, normal) = (constant(w[0], self.0.origin), constant(w[0], self.0.normal));
        let by = self.0.lift(dot(sub(places[0], origin), normal), side, false);
        places[0] = add(places[0], scaled(normal, by));
    }
}

/// From the nearest point of a ray to the end of `arm`, which starts where the ray does.
#[inline(always)]
fn offset<T: Number>(arm: Vector<T>, direction: Vector<f32>) -> Vector<T> {
    let direction = constant(arm[0], direction);
    let along = -(-dot(arm, direction)).lesser(arm[0].constant(0.0));
    sub(arm, scaled(direction, along))
}

#[inline(always)]
fn constant<T: Number>(any: T, [x, y, z]: Vector<f32>) -> Vector<T> {
    [any.constant(x), any.constant(y), any.constant(z)]
}
