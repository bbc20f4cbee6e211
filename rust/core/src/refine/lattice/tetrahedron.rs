//! The tetrahedra of a body-centred cubic lattice: each joins the centres of two neighbouring cubes with an edge of
//! the square between them. All are congruent and of good shape (F. Labelle, J. R. Shewchuk: Isosurface stuffing. ACM
//! Transactions on Graphics 26(3), 2007).

use glam::DVec3;

/// A lattice point in half cells: even coordinates for the corners of cubes, odd ones for their centres.
pub(super) type Point = [i32; 3];

/// A tetrahedron: the cube on the lower side, the axis towards the other cube, and which edge of the square.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) struct Tetrahedron {
    pub(super) cube: [i32; 3],
    pub(super) axis: u8,
    pub(super) edge: u8,
}

impl Tetrahedron {
    /// The one that holds `place`, in cells.
    pub(super) fn at(place: DVec3) -> Self {
        let floor = place.floor();
        let mut cube = floor.as_ivec3().to_array();
        let from_centre = (place - floor - 0.5).to_array();
        let size = from_centre.map(f64::abs);
        let axis = (0..3).rev().max_by(|&a, &b| size[a].total_cmp(&size[b])).expect("three axes");
        if from_centre[axis] < 0.0 {
            cube[axis] -= 1;
        }
        let (u, v) = (from_centre[(axis + 1) % 3], from_centre[(axis + 2) % 3]);
        let edge = match (v.abs() >= u.abs(), v < 0.0, u > 0.0) {
            (true, true, _) => 0,
            (false, _, true) => 1,
            (true, false, _) => 2,
            (false, _, false) => 3,
        };
        Self { cube, axis: axis as u8, edge }
    }

    /// All that belong to the square above `cube` along each axis.
    pub(super) fn of_cube(cube: [i32; 3]) -> impl Iterator<Item = Self> {
        (0..12).map(move |k| Self { cube, axis: k / 4, edge: k % 4 })
    }

    /// Its corners, of positive volume.
    pub(super) fn corners(self) -> [Point; 4] {
        let axis = self.axis as usize;
        let centre = self.cube.map(|x| 2 * x + 1);
        let mut other = centre;
        other[axis] += 2;
        let corner = |k: u8| {
            let (u, v) = [(-1, -1), (1, -1), (1, 1), (-1, 1)][k as usize % 4];
            let mut point = centre;
            point[axis] += 1;
            point[(axis + 1) % 3] += u;
            point[(axis + 2) % 3] += v;
            point
        };
        [centre, other, corner(self.edge), corner(self.edge + 1)]
    }

    /// Its centre, in cells.
    pub(super) fn centre(self) -> DVec3 {
        self.corners().into_iter().map(place).sum::<DVec3>() / 4.0
    }

    /// Barycentric coordinates of `at` (cells).
    pub(super) fn barycentric(self, at: DVec3) -> [f64; 4] {
        let [a, b, c, d] = self.corners().map(place);
        let volume = |a: DVec3, b: DVec3, c: DVec3, d: DVec3| (b - a).dot((c - a).cross(d - a));
        let whole = volume(a, b, c, d);
        [volume(at, b, c, d), volume(a, at, c, d), volume(a, b, at, d), volume(a, b, c, at)].map(|part| part / whole)
    }
}

/// A lattice point's place, in cells.
pub(super) fn place(point: Point) -> DVec3 {
    DVec3::from(point.map(f64::from)) * 0.5
}
