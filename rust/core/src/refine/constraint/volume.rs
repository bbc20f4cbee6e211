//! A tetrahedron keeps its signed volume.

use super::Constraint;
use crate::refine::number::{Number, Vector, add, cross, dot, scaled, sub};

/// `(b - a) . ((c - a) x (d - a)) / 6 - at_rest`.
#[inline(always)]
pub fn volume<T: Number>([a, b, c, d]: [Vector<T>; 4], at_rest: T) -> Constraint<T, 4> {
    let (e, f, g) = (sub(b, a), sub(c, a), sub(d, a));
    let sixth = at_rest.constant(1.0 / 6.0);
    let (at_b, at_c, at_d) = (scaled(cross(f, g), sixth), scaled(cross(g, e), sixth), scaled(cross(e, f), sixth));
    let at_a = scaled(add(add(at_b, at_c), at_d), at_rest.constant(-1.0));
    Constraint { value: dot(e, at_b) - at_rest, gradient: [at_a, at_b, at_c, at_d] }
}
