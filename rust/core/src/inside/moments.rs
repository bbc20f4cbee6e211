//! Far field of a cluster of triangles: its winding number as a Taylor series about one point, to second order.
//!
//! The winding number of a surface at q is the flux of g(x - q) = (x - q) / (4 pi |x - q|^3) through it. With y = x - p
//! and r = p - q, g(r + y) = g(r) + g'(r) y + g''(r) y y / 2 + ..., so that only the integrals of n, n y and n y y over the
//! triangles are kept. All derivatives of g are symmetric, hence so are the tensors: 3 + 6 + 10 numbers. The integrals over
//! triangles are exact.

use glam::DVec3;

/// Index pairs and triples of the stored entries of the symmetric tensors, and how often each occurs.
const PAIRS: [([usize; 2], f64); 6] =
    [([0, 0], 1.0), ([1, 1], 1.0), ([2, 2], 1.0), ([0, 1], 2.0), ([0, 2], 2.0), ([1, 2], 2.0)];
const TRIPLES: [([usize; 3], f64); 10] = [
    ([0, 0, 0], 1.0),
    ([1, 1, 1], 1.0),
    ([2, 2, 2], 1.0),
    ([0, 0, 1], 3.0),
    ([0, 0, 2], 3.0),
    ([0, 1, 1], 3.0),
    ([1, 1, 2], 3.0),
    ([0, 2, 2], 3.0),
    ([1, 2, 2], 3.0),
    ([0, 1, 2], 6.0),
];

/// The cluster as seen from afar.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Moments {
    /// Twice the sum of the triangles' areas.
    area: f64,
    /// Centre of the area, p.
    centre: DVec3,
    /// Distance from the centre to the farthest corner.
    radius: f64,
    /// Integral of n.
    first: DVec3,
    /// Symmetric part of the integral of n y, each entry times how often it occurs.
    second: [f64; 6],
    /// Symmetric part of the integral of n y y / 2, in the same way.
    third: [f64; 10],
}

impl Moments {
    /// Of these triangles.
    pub(super) fn new(triangles: &[[DVec3; 3]]) -> Self {
        let (area, centre) = area_and_centre(triangles);
        let mut moments = Self { area, centre, ..Self::default() };
        for triangle in triangles {
            moments.add(triangle.map(|x| x - moments.centre));
        }
        moments.with_radius(triangles)
    }

    /// Of both clusters' triangles, still without a radius.
    pub(super) fn joined(parts: [&Self; 2]) -> Self {
        let area = parts[0].area + parts[1].area;
        let share = if area > 0.0 { parts[1].area / area } else { 0.5 };
        let centre = parts[0].centre.lerp(parts[1].centre, share);
        let mut moments = Self { area, centre, ..Self::default() };
        parts.into_iter().for_each(|part| moments.add_cluster(part));
        moments
    }

    /// With the radius of these triangles, which are those of the cluster.
    pub(super) fn with_radius(self, triangles: &[[DVec3; 3]]) -> Self {
        let squared = |x: &DVec3| x.distance_squared(self.centre);
        Self { radius: triangles.iter().flatten().map(squared).fold(0.0, f64::max).sqrt(), ..self }
    }

    /// Seen from this centre the cluster's y is y + d.
    fn add_cluster(&mut self, part: &Self) {
        let (n, d) = (part.first, part.centre - self.centre);
        let mut matrix = [[0.0; 3]; 3];
        for (entry, ([i, j], times)) in part.second.iter().zip(PAIRS) {
            (matrix[i][j], matrix[j][i]) = (entry / times, entry / times);
        }
        self.first += n;
        for (k, ([i, j], times)) in PAIRS.into_iter().enumerate() {
            self.second[k] += part.second[k] + times * 0.5 * (n[i] * d[j] + n[j] * d[i]);
        }
        for (l, ([i, j, k], times)) in TRIPLES.into_iter().enumerate() {
            let once = matrix[i][j] * d[k] + matrix[i][k] * d[j] + matrix[j][k] * d[i];
            let twice = n[i] * d[j] * d[k] + n[j] * d[i] * d[k] + n[k] * d[i] * d[j];
            self.third[l] += part.third[l] + times * (once / 3.0 + twice / 6.0);
        }
    }

    fn add(&mut self, [a, b, c]: [DVec3; 3]) {
        // n times the area; of y, and of y y, the mean over the triangle.
        let n = 0.5 * (b - a).cross(c - a);
        let sum = a + b + c;
        let mean = sum / 3.0;
        let square = |i: usize, j: usize| (a[i] * a[j] + b[i] * b[j] + c[i] * c[j] + sum[i] * sum[j]) / 12.0;
        self.first += n;
        for (entry, ([i, j], times)) in self.second.iter_mut().zip(PAIRS) {
            *entry += times * 0.5 * (n[i] * mean[j] + n[j] * mean[i]);
        }
        for (entry, ([i, j, k], times)) in self.third.iter_mut().zip(TRIPLES) {
            *entry += times * (n[i] * square(j, k) + n[j] * square(i, k) + n[k] * square(i, j)) / 6.0;
        }
    }

    /// The winding number at `query`, or `None` if that is nearer than `accuracy` times the radius.
    #[inline]
    pub(super) fn winding(&self, query: DVec3, accuracy: f64) -> Option<f64> {
        let r = self.centre - query;
        let squared = r.length_squared();
        if squared <= (accuracy * self.radius).powi(2) {
            return None;
        }
        let (x, y, z) = (r.x, r.y, r.z);
        let per_squared = 1.0 / squared;
        let per_cube = per_squared * per_squared.sqrt();
        let (s, t) = (&self.second, &self.third);
        // g' = (1 - 3 r r / |r|^2) / |r|^3 and g'' = (15 r r r / |r|^2 - 3 (1 r + r 1 + ...)) / |r|^5.
        let first = self.first.dot(r);
        let trace = s[0] + s[1] + s[2];
        let pairs = s[0] * x * x + s[1] * y * y + s[2] * z * z + s[3] * x * y + s[4] * x * z + s[5] * y * z;
        let vector = 3.0 * (t[0] * x + t[1] * y + t[2] * z) + (t[5] + t[7]) * x + (t[3] + t[8]) * y + (t[4] + t[6]) * z;
        let triples = x * x * (t[0] * x + t[3] * y + t[4] * z)
            + y * y * (t[1] * y + t[5] * x + t[6] * z)
            + z * z * (t[2] * z + t[7] * x + t[8] * y)
            + t[9] * x * y * z;
        let second = trace - 3.0 * per_squared * pairs;
        let third = 3.0 * per_squared * (5.0 * per_squared * triples - vector);
        Some((first + second + third) * per_cube / (4.0 * std::f64::consts::PI))
    }
}

/// Twice the sum of areas, and their centre: the mean of the corners where no triangle has an area.
fn area_and_centre(triangles: &[[DVec3; 3]]) -> (f64, DVec3) {
    let (mut area, mut sum) = (0.0, DVec3::ZERO);
    for [a, b, c] in triangles {
        let weight = (b - a).cross(c - a).length();
        area += weight;
        sum += weight * (a + b + c) / 3.0;
    }
    if area > 0.0 {
        return (area, sum / area);
    }
    (0.0, triangles.iter().flatten().sum::<DVec3>() / (3 * triangles.len()).max(1) as f64)
}

#[cfg(test)]
mod tests {
    use super::super::solid_angle::half_solid_angle;
    use super::*;

    /// Six scattered triangles inside a ball of radius 1, roughly.
    fn cluster() -> Vec<[DVec3; 3]> {
        let corner = |k: usize| {
            let x = k as f64;
            DVec3::new((1.7 * x).sin(), (2.3 * x + 1.0).cos(), (0.9 * x * x).sin()) * 0.6 + 3.0
        };
        (0..6).map(|k| [corner(3 * k), corner(3 * k + 1), corner(3 * k + 2)]).collect()
    }

    fn error_at(distance: f64) -> f64 {
        let (triangles, moments) = (cluster(), Moments::new(&cluster()));
        let directions = [DVec3::X, DVec3::NEG_Y, DVec3::new(0.6, 0.0, -0.8), DVec3::new(-0.36, 0.48, 0.8)];
        let error = |direction: &DVec3| {
            let query = moments.centre + distance * direction;
            let exact: f64 = triangles.iter().map(|t| half_solid_angle(t.map(|x| x - query))).sum();
            (moments.winding(query, 1.0).unwrap() - exact / std::f64::consts::TAU).abs()
        };
        directions.iter().map(error).fold(0.0, f64::max)
    }

    /// The first term left out falls with the fifth power of the distance.
    #[test]
    fn the_series_is_of_second_order() {
        let (near, far) = (error_at(10.0), error_at(20.0));
        assert!(near < 1e-5, "{near}");
        assert!(near / far > 24.0, "{near} {far}");
    }

    #[test]
    fn a_cluster_of_clusters_is_the_cluster() {
        let (triangles, whole) = (cluster(), Moments::new(&cluster()));
        let parts = [Moments::new(&triangles[..2]), Moments::new(&triangles[2..])];
        let joined = Moments::joined([&parts[0], &parts[1]]).with_radius(&triangles);
        let (a, b) = ([whole, joined].map(|m| [[m.area, m.radius].as_slice(), &m.second, &m.third].concat())).into();
        std::iter::zip::<Vec<f64>, Vec<f64>>(a, b).for_each(|(a, b)| assert!((a - b).abs() < 1e-12, "{a} {b}"));
        assert!(whole.centre.distance(joined.centre) < 1e-12 && whole.first.distance(joined.first) < 1e-12);
    }

    #[test]
    fn near_queries_are_refused() {
        let moments = Moments::new(&cluster());
        assert!(moments.winding(moments.centre, 2.0).is_none());
        assert!(moments.winding(moments.centre + 1.9 * moments.radius, 4.0).is_none());
    }
}
