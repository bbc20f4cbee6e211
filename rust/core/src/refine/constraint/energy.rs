//! Springs from the corners of a tetrahedron to its centre: a soft regulariser that takes away spikes.

use super::Constraint;
use crate::refine::number::{Number, Vector, add, dot, scaled, sub};

/// `sqrt(2 U)`, `2 U` the sum of the squared differences between the corners' distances to their centre and `at_rest`.
///
/// The root, because U itself is quadratic at its solution, where one projection only halves the error. The centre moves
/// with the corners, so each gradient lacks a quarter of all springs' pulls.
#[inline(always)]
pub fn energy<T: Number>(corners: [Vector<T>; 4], at_rest: [T; 4]) -> Constraint<T, 4> {
    let quarter = at_rest[0].constant(0.25);
    let [a, b, c, d] = corners;
    let centre = scaled(add(add(a, b), add(c, d)), quarter);
    let mut pull = corners;
    let (mut square, mut mean) = (quarter.constant(0.0), [quarter.constant(0.0); 3]);
    for k in 0..4 {
        let arm = sub(corners[k], centre);
        let length = dot(arm, arm).sqrt();
        let excess = length - at_rest[k];
        pull[k] = scaled(arm, excess / (length + quarter.constant(1e-12)));
        square = square + excess * excess;
        mean = add(mean, pull[k]);
    }
    let value = square.sqrt();
    let inverse = quarter.constant(1.0) / (value + quarter.constant(1e-12));
    let mean = scaled(mean, quarter);
    for k in 0..4 {
        pull[k] = scaled(sub(pull[k], mean), inverse);
    }
    Constraint { value, gradient: pull }
}
