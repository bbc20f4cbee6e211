//! The point of one triangle closest to a query.

use glam::{DVec3, Vec3};

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

/// About the squared distance of the triangle from the origin, the same way in f32: at most `rounding` times the farthest
/// corner's distance too long (see [`rounding`]), before it is squared. Branch-free, so that a loop over triangles becomes
/// SIMD code.
#[inline(always)]
pub(super) fn rough_squared_distance([a, b, c]: [Vec3; 3]) -> f32 {
    let positive = |squared_length: f32| squared_length.max(f32::MIN_POSITIVE);
    let (ab, ac, bc) = (b - a, c - a, c - b);
    let per_ab = 1.0 / positive(ab.length_squared());
    let v = -a.dot(ab) * per_ab;
    let on_ab = (a + ab * v.clamp(0.0, 1.0)).length_squared();
    let on_ac = (a + ac * (-a.dot(ac) / positive(ac.length_squared())).clamp(0.0, 1.0)).length_squared();
    let on_bc = (b + bc * (-b.dot(bc) / positive(bc.length_squared())).clamp(0.0, 1.0)).length_squared();

    let along = ac.dot(ab) * per_ab;
    let height = ac - ab * along;
    let height = height - ab * (height.dot(ab) * per_ab);
    let w = -a.dot(height) / positive(height.length_squared());
    let in_plane = (a + ab * v + height * w).length_squared();
    let v = v - along * w;
    let inside = (1.0 - v - w >= 0.0) & (v >= 0.0) & (w >= 0.0);

    let on_edge = on_ab.min(on_ac).min(on_bc);
    if inside { on_edge.min(in_plane) } else { on_edge }
}

/// Bound of the relative error of [`rough_squared_distance`] for a triangle; infinite where f32 tells nothing.
///
/// Points of edges are off by a few roundings of the corners' coordinates. A point of the plane is found along the height,
/// whose own rounding is that of the longest edge: hence the ratio of the two.
pub(super) fn rounding([a, b, c]: [DVec3; 3]) -> f32 {
    let edges = [b - a, c - a, c - b];
    let longest = edges.map(DVec3::length).into_iter().fold(0.0, f64::max);
    let height = edges[0].cross(edges[1]).length() / longest;
    // Beyond these lengths, squares leave the range of f32.
    if height > 0.0 && (1e-12..1e12).contains(&longest) {
        64.0 * f32::EPSILON * (longest / height) as f32
    } else {
        f32::INFINITY
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers in [-1, 1).
    struct Noise(u64);

    impl Noise {
        fn next(&mut self) -> f32 {
            self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (self.0 >> 40) as f32 / (1u64 << 23) as f32 - 1.0
        }

        fn point(&mut self) -> Vec3 {
            Vec3::new(self.next(), self.next(), self.next())
        }
    }

    #[test]
    fn the_rough_distance_is_never_longer_than_its_bound_allows() {
        let mut noise = Noise(1);
        let mut closest_call: f64 = 0.0;
        for i in 0..400_000 {
            let size = 10f32.powi(i % 9 - 6);
            let thin = 10f32.powi(i / 9 % 8 - 7);
            let query = noise.point() * 10f32.powi(i / 72 % 7 - 5);
            let (a, along) = (query + noise.point(), noise.point() * size);
            let c = a + along * noise.next() + noise.point() * size * thin;
            let corners = [a, a + along, c];
            let exact = corners.map(|p| p.as_dvec3() - query.as_dvec3());
            let rough = f64::from(rough_squared_distance(corners.map(|p| p - query))).sqrt();
            let farthest = exact.map(DVec3::length).into_iter().fold(0.0, f64::max);
            let excess = rough - closest_to_origin(exact).1.sqrt();
            let allowed = f64::from(rounding(exact)) * farthest;
            assert!(excess <= allowed, "{corners:?} {query:?}: {excess:e} > {allowed:e}");
            closest_call = closest_call.max(excess / allowed);
        }
        assert!(closest_call > 1e-3, "the bound is far too loose to be of use: {closest_call}");
    }
}
