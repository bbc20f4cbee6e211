//! The point of one triangle closest to a query.

use glam::DVec3;

/// Barycentric coordinates (non-negative, summing to 1) and squared distance of the point of the triangle
/// closest to the origin. `corners` are relative to the query.
///
/// The best of the three edges and, where the query projects into the triangle, of the plane. The projection uses `ab`
/// and the part of `ac` perpendicular to it, so that its error stays at the rounding of the lengths themselves even for
/// needles; the usual regions (Ericson, Real-Time Collision Detection, 5.1.5) divide by products that cancel. A
/// vanished area leaves the edges.
#[inline(always)]
pub(super) fn closest_to_origin([a, b, c]: [DVec3; 3]) -> ([f64; 3], f64) {
    let (ab, ac, bc) = (b - a, c - a, c - b);
    let per_ab = 1.0 / positive(ab.length_squared());
    let on_ab = (-a.dot(ab) * per_ab).clamp(0.0, 1.0);
    let on_ac = (-a.dot(ac) / positive(ac.length_squared())).clamp(0.0, 1.0);
    let on_bc = (-b.dot(bc) / positive(bc.length_squared())).clamp(0.0, 1.0);

    let along = ac.dot(ab) * per_ab;
    let height = ac - ab * along;
    let height = height - ab * (height.dot(ab) * per_ab);
    let w = -a.dot(height) / positive(height.length_squared());
    let v = -a.dot(ab) * per_ab;
    let in_plane = a + ab * v + height * w;
    let v = v - along * w;
    let u = 1.0 - v - w;
    let inside = (u >= 0.0) & (v >= 0.0) & (w >= 0.0);

    let best = ([1.0 - on_ab, on_ab, 0.0], (a + ab * on_ab).length_squared());
    let best = nearer(best, ([1.0 - on_ac, 0.0, on_ac], (a + ac * on_ac).length_squared()));
    let best = nearer(best, ([0.0, 1.0 - on_bc, on_bc], (b + bc * on_bc).length_squared()));
    let plane = if inside { in_plane.length_squared() } else { f64::INFINITY };
    nearer(best, ([u, v, w], plane))
}

#[inline(always)]
fn nearer(first: ([f64; 3], f64), second: ([f64; 3], f64)) -> ([f64; 3], f64) {
    if second.1 < first.1 { second } else { first }
}

/// Keeps a division by a squared length that vanished at 0 / tiny = 0.
#[inline(always)]
fn positive(squared_length: f64) -> f64 {
    squared_length.max(f64::MIN_POSITIVE)
}
