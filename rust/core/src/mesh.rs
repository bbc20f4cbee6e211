//! Triangle meshes, checked once.

use glam::{DVec3, Vec3};

use crate::error::{Error, Result};

/// A triangle mesh in world space whose positions are finite and whose indices are in range.
///
/// Borrowed: the arrays belong to the caller. Repeated vertices, zero areas, fins and loose
/// vertices are all allowed; every operation copes with them.
#[derive(Debug, Clone, Copy)]
pub struct TriMesh<'a> {
    positions: &'a [[f32; 3]],
    triangles: &'a [[u32; 3]],
}

impl<'a> TriMesh<'a> {
    /// Checks `positions` (V, world units) and `triangles` (T). `what` names the mesh in errors.
    ///
    /// # Errors
    /// [`Error::NoTriangles`], [`Error::PositionNotFinite`], [`Error::VertexOutOfRange`].
    pub fn new(positions: &'a [[f32; 3]], triangles: &'a [[u32; 3]], what: &'static str) -> Result<Self> {
        if triangles.is_empty() {
            return Err(Error::NoTriangles { what });
        }
        check_finite(positions, what)?;
        let count = positions.len();
        let out_of_range = |t: &[u32; 3]| t.iter().any(|&i| i as usize >= count);
        if let Some(triangle) = triangles.iter().position(out_of_range) {
            let vertex = *triangles[triangle].iter().find(|&&i| i as usize >= count).expect("just found");
            return Err(Error::VertexOutOfRange { what, triangle, vertex, count });
        }
        Ok(Self { positions, triangles })
    }

    /// The same with edges (E, 2); if there are some, there may be no triangle.
    ///
    /// # Errors
    /// Those of [`TriMesh::new`], [`Error::EdgeOutOfRange`].
    pub fn with_edges(
        positions: &'a [[f32; 3]],
        triangles: &'a [[u32; 3]],
        edges: &[[u32; 2]],
        what: &'static str,
    ) -> Result<Self> {
        let count = positions.len();
        if let Some(edge) = edges.iter().position(|edge| edge.iter().any(|&i| i as usize >= count)) {
            return Err(Error::EdgeOutOfRange { what, edge, count });
        }
        if triangles.is_empty() && !edges.is_empty() {
            check_finite(positions, what)?;
            return Ok(Self { positions, triangles });
        }
        Self::new(positions, triangles, what)
    }

    /// The same without a look, for arrays that were checked before; there may be no triangle at all.
    pub(crate) fn of_checked(positions: &'a [[f32; 3]], triangles: &'a [[u32; 3]]) -> Self {
        Self { positions, triangles }
    }

    /// Positions, (V, 3).
    pub fn positions(&self) -> &'a [[f32; 3]] {
        self.positions
    }

    /// Vertex indices, (T, 3).
    pub fn triangles(&self) -> &'a [[u32; 3]] {
        self.triangles
    }

    /// Number of vertices.
    pub fn vertex_count(&self) -> usize {
        self.positions.len()
    }

    /// Position of vertex `i` in f64.
    pub fn position(&self, i: u32) -> DVec3 {
        Vec3::from(self.positions[i as usize]).as_dvec3()
    }

    /// Diagonal of the bounding box of all vertices that a triangle uses, or of all if there is none, in world units.
    pub fn diagonal(&self) -> f64 {
        if self.triangles.is_empty() {
            return diagonal(self.positions.iter());
        }
        diagonal(self.triangles.as_flattened().iter().map(|&i| &self.positions[i as usize]))
    }

    /// Sums of the doubled area vectors of the triangles around each vertex, (V, 3).
    pub fn vertex_area_vectors(&self) -> Vec<DVec3> {
        let mut sums = vec![DVec3::ZERO; self.positions.len()];
        for t in self.triangles {
            let doubled_area = self.doubled_area(t);
            for &i in t {
                sums[i as usize] += doubled_area;
            }
        }
        sums
    }

    /// Doubled area vector of the triangle with these vertices.
    pub fn doubled_area(&self, triangle: &[u32; 3]) -> DVec3 {
        let [a, b, c] = triangle.map(|i| self.position(i));
        (b - a).cross(c - a)
    }

    /// Area-weighted vertex normals, (V, 3), unit length or zero where no direction exists.
    pub fn vertex_normals(&self) -> Vec<Vec3> {
        self.vertex_area_vectors().iter().map(|n| n.normalize_or_zero().as_vec3()).collect()
    }
}

fn check_finite(positions: &[[f32; 3]], what: &'static str) -> Result<()> {
    match positions.iter().position(|p| !p.iter().all(|x| x.is_finite())) {
        Some(vertex) => Err(Error::PositionNotFinite { what, vertex }),
        None => Ok(()),
    }
}

/// Diagonal of the box around positions.
fn diagonal<'p>(positions: impl Iterator<Item = &'p [f32; 3]>) -> f64 {
    let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for &p in positions {
        low = low.min(p.into());
        high = high.max(p.into());
    }
    high.as_dvec3().distance(low.as_dvec3())
}
