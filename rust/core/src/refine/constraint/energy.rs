//! Springs from the corners of a tetrahedron to its centre: a soft regulariser that takes away spikes.

use super::{Constraint, Projection};
use crate::refine::number::{Number, Vector, add, dot, scaled, sub};

/// `sqrt(2 U)`, `2 U` the sum of the squared `(d^2 - r^2) / 2 r`: by how much the corners' distances `d` to their centre
/// differ from those at rest. Near rest that is `d - r`, without a root and a division for each corner.
///
/// The root of the sum, because U itself is quadratic at its solution, where one projection only halves the error.
#[cfg(test)]
pub fn energy<T: Number>(corners: [Vector<T>; 4], at_rest: [T; 4]) -> Constraint<T, 4> {
    let (square, mut gradient) = springs(corners, at_rest);
    let value = square.sqrt();
    let inverse = value.constant(1.0) / (value + value.constant(1e-12));
    for k in 0..4 {
        gradient[k] = scaled(gradient[k], inverse);
    }
    Constraint { value, gradient }
}

/// [`Constraint::project`] of it with one division: numerator and denominator are multiplied by `2 U`.
#[inline(always)]
pub fn project_energy<T: Number>(
    corners: [Vector<T>; 4],
    w: [T; 4],
    at_rest: [T; 4],
    alpha: T,
    multiplier: T,
) -> Projection<T, 4> {
    let (square, mut moves) = springs(corners, at_rest);
    let value = square.sqrt();
    let mut sum = alpha * square + alpha.constant(1e-20);
    for k in 0..4 {
        sum = sum + w[k] * dot(moves[k], moves[k]);
    }
    let step = -(square + alpha * multiplier * value) / sum;
    for k in 0..4 {
        moves[k] = scaled(moves[k], w[k] * step);
    }
    Projection { moves, multiplier: step * value }
}

/// `2 U` and the derivatives of U. The centre moves with the corners, so each lacks a quarter of all springs' pulls.
#[inline(always)]
fn springs<T: Number>(corners: [Vector<T>; 4], at_rest: [T; 4]) -> (T, [Vector<T>; 4]) {
    let (half, quarter) = (at_rest[0].constant(0.5), at_rest[0].constant(0.25));
    let [a, b, c, d] = corners;
    let centre = scaled(add(add(a, b), add(c, d)), quarter);
    let mut pull = corners;
    let mut square = quarter.constant(0.0);
    for k in 0..4 {
        let inverse = quarter.constant(1.0) / at_rest[k];
        let arm = sub(corners[k], centre);
        let excess = (dot(arm, arm) - at_rest[k] * at_rest[k]) * (half * inverse);
        pull[k] = scaled(arm, excess * inverse);
        square = square + excess * excess;
    }
    let mean = scaled(add(add(pull[0], pull[1]), add(pull[2], pull[3])), quarter);
    for k in 0..4 {
        pull[k] = sub(pull[k], mean);
    }
    (square, pull)
}
