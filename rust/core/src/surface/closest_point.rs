//! The point of one triangle closest to a query.

use glam::DVec3;

/// Barycentric coordinates (non-negative, summing to 1) and squared distance of the point of
/// triangle `corners` closest to `query`.
///
/// The best of the three edges and, where the query projects into the triangle, of the plane.
/// Stable for any shape: the projection uses `ab` and the part of `ac` perpendicular to it, so the error
/// stays at the rounding of the lengths themselves, even for needles (Ericson's regions, Real-Time
/// Collision Detection 5.1.5, divide by products that cancel). A zero area leaves its edges.
pub(super) fn closest_on_triangle(query: DVec3, corners: [DVec3; 3]) -> ([f64; 3], f64) {
    let [a, b, c] = corners.map(|p| p - query);
    let (ab, ac) = (b - a, c - a);
    let on_ab = clamped_parameter(a, ab);
    let on_ac = clamped_parameter(a, ac);
    let on_bc = clamped_parameter(b, c - b);
    let candidates = [
        [1.0 - on_ab, on_ab, 0.0],
        [1.0 - on_ac, 0.0, on_ac],
        [0.0, 1.0 - on_bc, on_bc],
        projection(a, ab, ac).unwrap_or([1.0, 0.0, 0.0]),
    ];
    let measured = candidates.map(|w| (w, (a * w[0] + b * w[1] + c * w[2]).length_squared()));
    measured.into_iter().reduce(|best, next| if next.1 < best.1 { next } else { best }).expect("four candidates")
}

/// Parameter in 0..1 of the point closest to the origin on the segment from `start` along `edge`.
fn clamped_parameter(start: DVec3, edge: DVec3) -> f64 {
    (-start.dot(edge) / positive(edge.length_squared())).clamp(0.0, 1.0)
}

/// Barycentric coordinates of the origin's projection, where it falls into the triangle.
fn projection(a: DVec3, ab: DVec3, ac: DVec3) -> Option<[f64; 3]> {
    let per_ab = 1.0 / positive(ab.length_squared());
    let along = ac.dot(ab) * per_ab;
    let height = ac - along * ab;
    let height = height - height.dot(ab) * per_ab * ab;
    let w = -a.dot(height) / positive(height.length_squared());
    let v = -a.dot(ab) * per_ab - along * w;
    let u = 1.0 - v - w;
    (u >= 0.0 && v >= 0.0 && w >= 0.0).then_some([u, v, w])
}

/// Keeps a division by a squared length that vanished at 0 / tiny = 0.
fn positive(squared_length: f64) -> f64 {
    squared_length.max(f64::MIN_POSITIVE)
}
