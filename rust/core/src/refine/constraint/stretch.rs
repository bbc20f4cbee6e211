//! An edge keeps its length.

use super::Constraint;
use crate::refine::number::{Number, Vector, dot, scaled, sub};

/// `|a - b| - length`; no gradient between points that coincide.
#[inline(always)]
pub fn stretch<T: Number>([a, b]: [Vector<T>; 2], length: T) -> Constraint<T, 2> {
    let between = sub(a, b);
    let now = dot(between, between).sqrt();
    let direction = scaled(between, length.constant(1.0) / (now + length.constant(1e-12)));
    Constraint { value: now - length, gradient: [direction, scaled(direction, length.constant(-1.0))] }
}
