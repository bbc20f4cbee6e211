//! An edge keeps its length.

use super::{Constraint, Projection};
use crate::refine::number::{Number, Vector, dot, scaled, sub};

/// `|a - b| - length`; no gradient between points that coincide.
#[cfg(test)]
pub fn stretch<T: Number>([a, b]: [Vector<T>; 2], length: T) -> Constraint<T, 2> {
    let between = sub(a, b);
    let now = dot(between, between).sqrt();
    let direction = scaled(between, length.constant(1.0) / (now + length.constant(1e-12)));
    Constraint { value: now - length, gradient: [direction, scaled(direction, length.constant(-1.0))] }
}

/// [`Constraint::project`] of it with one division: gradients have a length of one.
#[inline(always)]
pub fn project_stretch<T: Number>(
    [a, b]: [Vector<T>; 2],
    w: [T; 2],
    length: T,
    alpha: T,
    multiplier: T,
) -> Projection<T, 2> {
    let between = sub(a, b);
    let now = dot(between, between).sqrt() + length.constant(1e-12);
    let sum = w[0] + w[1] + alpha + length.constant(1e-20);
    let share = (length - now - alpha * multiplier) / (sum * now);
    Projection { moves: [scaled(between, share * w[0]), scaled(between, -(share * w[1]))], multiplier: share * now }
}
