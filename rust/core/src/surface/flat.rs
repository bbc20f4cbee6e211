//! A triangle in a plane of its own, from which squared distances in f32 are cheap and their error is known.

use glam::{DVec2, DVec3, Vec3};
use pulp::Simd;

use super::lanes::{Register, into_frame};

/// Squared distances in f32 are taken to err by this share of their value, ...
const SHARE: f32 = 2e-5;
/// ... this share of the longest edge's square, and `f32::MIN_POSITIVE` for what underflows.
const SHARE_OF_EDGE: f64 = 8e-6;

/// A triangle with its longest edge on the x axis from 0 to `length`, and the third corner, the apex, above it.
///
/// Each test is stable then, whatever the shape: the distance to an edge is one along and one across its direction, without
/// a division, and the angle at the apex, where the inside is decided by both sloping edges, is at least 60 degrees.
///
/// The bound, with u = 2^-24, d the distance, L the longest edge, and R = d + L, which the query is from the origin at most: a
/// coordinate in the frame is off by 6 u R (a difference, rounded axes, three products, two sums); how far along an edge and
/// how far across it by 15 u R and 13 u R (rounded direction and end, two products, a sum, a difference); the distance to
/// the edge by 20 u R. What the tests take for inside is outside by 26 u R at most, twice a test's error where two
/// sides meet at 60 degrees; what they take for outside is within 13 u R of a side. In all the distance is off by e < 36 u R
/// and its square by 2 d e + e^2 < 6.5e-6 d^2 + 2.2e-6 L^2, a third of what is allowed.
#[derive(Debug, Clone, Copy)]
pub(super) struct FlatTriangle {
    /// The longest edge's start in world space.
    origin: [f32; 3],
    /// Along the edge, towards the apex, along the normal.
    axes: [[f32; 3]; 3],
    length: f32,
    /// The edges to the apex from either end of the longest.
    slopes: [Slope; 2],
    /// [`SHARE_OF_EDGE`].
    margin: f32,
}

/// An edge that rises from the origin towards positive x.
#[derive(Debug, Clone, Copy)]
struct Slope {
    direction: [f32; 2],
    length: f32,
}

impl FlatTriangle {
    pub(super) fn new(corners: [Vec3; 3]) -> Self {
        let [a, b, c] = longest_edge_first(corners.map(Vec3::as_dvec3));
        let length = a.distance(b);
        let x = (b - a).try_normalize().unwrap_or(DVec3::X);
        let up = (c - a) - x * (c - a).dot(x);
        let up = up - x * up.dot(x); // what rounding has left along x counts in a needle
        // Where the height itself is rounding, any direction serves.
        let y = if up.length() > 1e-12 * length { up.normalize() } else { x.any_orthonormal_vector() };
        let apex = DVec2::new((c - a).dot(x).clamp(0.0, length), (c - a).dot(y).max(0.0));
        Self {
            origin: a.as_vec3().to_array(),
            axes: [x, y, x.cross(y)].map(|axis| axis.as_vec3().to_array()),
            length: narrow(length),
            slopes: [Slope::new(apex), Slope::new(DVec2::new(length - apex.x, apex.y))],
            margin: narrow(SHARE_OF_EDGE * length * length),
        }
    }

    /// Squared distances of queries (world coordinates by axis): no less than the first, but for an underflow that the second
    /// makes good, and no more than the second. Neither is NaN, whatever overflows.
    #[inline(always)]
    pub(super) fn squared_distance_bounds<S: Simd>(
        &self,
        simd: S,
        query: [Register<S>; 3],
    ) -> (Register<S>, Register<S>) {
        let (squared, margin) = (self.squared_distance(simd, query), Register::splat(simd, self.margin));
        let least = (squared - margin) * Register::splat(simd, 1.0 - SHARE);
        let most = (squared + margin) * Register::splat(simd, 1.0 + SHARE);
        (least, most + Register::splat(simd, f32::MIN_POSITIVE))
    }

    #[inline(always)]
    fn squared_distance<S: Simd>(&self, simd: S, query: [Register<S>; 3]) -> Register<S> {
        let [x, y, z] = into_frame(simd, query, &self.origin, &self.axes);
        let (length, zero) = (Register::splat(simd, self.length), Register::splat(simd, 0.0));
        let excess = x - x.max(zero).min(length);
        let base = excess * excess + y * y;
        let (left, outside_left) = self.slopes[0].squared_distance_and_side(simd, x, y);
        let (right, outside_right) = self.slopes[1].squared_distance_and_side(simd, length - x, y);
        // Without the test of x, a needle would seem to go on beyond its tip.
        let outside = outside_left.max(outside_right).max((zero - y).max(excess * excess));
        let in_plane = outside.positive_then(left.min(right).min(base));
        (in_plane + z * z).but_at_most(Register::splat(simd, f32::MAX))
    }
}

impl Slope {
    fn new(to_apex: DVec2) -> Self {
        let direction = to_apex.try_normalize().unwrap_or(DVec2::X);
        Self { direction: direction.as_vec2().to_array(), length: narrow(to_apex.length()) }
    }

    /// Squared distance in the plane to the edge, and how far on its outer side.
    #[inline(always)]
    fn squared_distance_and_side<S: Simd>(self, simd: S, x: Register<S>, y: Register<S>) -> (Register<S>, Register<S>) {
        let (dx, dy) = (Register::splat(simd, self.direction[0]), Register::splat(simd, self.direction[1]));
        let (along, across) = (x * dx + y * dy, y * dx - x * dy);
        let (length, zero) = (Register::splat(simd, self.length), Register::splat(simd, 0.0));
        let excess = along - along.max(zero).min(length);
        (excess * excess + across * across, across)
    }
}

fn longest_edge_first([a, b, c]: [DVec3; 3]) -> [DVec3; 3] {
    let [ab, bc, ca] = [a.distance_squared(b), b.distance_squared(c), c.distance_squared(a)];
    if ab >= bc && ab >= ca {
        [a, b, c]
    } else if bc >= ca {
        [b, c, a]
    } else {
        [c, a, b]
    }
}

fn narrow(x: f64) -> f32 {
    x.min(f32::MAX.into()) as f32
}

#[cfg(test)]
mod tests {
    use super::super::closest_point::closest_to_origin;
    use super::super::lanes::Lanes;
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

    fn exact_squared_distance(corners: [Vec3; 3], query: Vec3) -> f64 {
        closest_to_origin(corners.map(|p| p.as_dvec3() - query.as_dvec3())).1
    }

    /// Bounds and the number between them, for one query.
    fn bounds(triangle: &FlatTriangle, query: Vec3) -> [f64; 3] {
        let simd = pulp::Scalar::new();
        let query = query.to_array().map(|x| Register::splat(simd, x));
        let (least, most) = triangle.squared_distance_bounds(simd, query);
        [least, triangle.squared_distance(simd, query), most].map(|register| {
            let mut lanes = Lanes::ZERO;
            register.store(&mut lanes, 0);
            lanes.0[0].into()
        })
    }

    /// A needle, a cap or a sound triangle, of any size, at any distance from the origin, with a query near its surface, its
    /// corners or far away.
    fn case(noise: &mut Noise, i: i32) -> ([Vec3; 3], Vec3) {
        let size = 10f32.powi(i % 7 - 4);
        let thin = 10f32.powi(i / 7 % 9 - 8);
        let a = noise.point() * 10f32.powi(i / 63 % 4 - 1);
        let along = noise.point() * size;
        let c = a + along * (0.6 * noise.next() + 0.5) + noise.point() * size * thin;
        let corners = [a, a + along, c];
        let [u, v] = [0.7 * noise.next() + 0.4, 0.7 * noise.next() + 0.4];
        let on = if i % 5 == 0 { corners[i as usize / 5 % 3] } else { a + (a + along - a) * u + (c - a) * v };
        (corners, on + noise.point() * size * 10f32.powi(i / 252 % 9 - 7))
    }

    #[test]
    fn errs_by_less_than_half_of_what_is_allowed() {
        let mut noise = Noise(1);
        let mut worst: f64 = 0.0;
        for i in 0..1_000_000 {
            let (corners, query) = case(&mut noise, i);
            let triangle = FlatTriangle::new(corners);
            let (exact, [_, found, _]) = (exact_squared_distance(corners, query), bounds(&triangle, query));
            let share = (found - exact).abs() / (f64::from(SHARE) * exact + f64::from(triangle.margin));
            assert!(share < 0.5, "{corners:?} {query:?}: {found:e}, not {exact:e}");
            worst = worst.max(share);
        }
        assert!(worst > 0.01, "far more is allowed than needed: {worst}");
    }

    #[test]
    fn bounds_hold_whatever_overflows_or_vanishes() {
        let mut noise = Noise(2);
        for i in 0..200_000 {
            let size = 10f32.powi(i % 78 - 40).min(1e38);
            let mut corners = [0, 1, 2].map(|_| noise.point() * size);
            if i % 3 == 0 {
                corners[2] = corners[i as usize / 3 % 2];
            }
            if i % 21 == 0 {
                corners = [corners[0]; 3];
            }
            let query = noise.point() * 10f32.powi(i / 78 % 78 - 40).min(1e38);
            let [least, found, most] = bounds(&FlatTriangle::new(corners), query);
            let exact = exact_squared_distance(corners, query);
            let underflow = f64::from(f32::MIN_POSITIVE) / 100.0;
            assert!(
                least <= exact + underflow && exact + underflow <= most,
                "{corners:?} {query:?}: {least:e} {exact:e} {most:e} ({found:e})"
            );
        }
    }
}
