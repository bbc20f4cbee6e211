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
        if let Some(vertex) = positions.iter().position(|p| !p.iter().all(|x| x.is_finite())) {
            return Err(Error::PositionNotFinite { what, vertex });
        }
        let count = positions.len();
        let out_of_range = |t: &[u32; 3]| t.iter().any(|&i| i as usize >= count);
        if let Some(triangle) = triangles.iter().position(out_of_range) {
            let vertex = *triangles[triangle].iter().find(|&&i| i as usize >= count).expect("just found");
            return Err(Error::VertexOutOfRange { what, triangle, vertex, count });
        }
        Ok(Self { positions, triangles })
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

    /// Diagonal of the bounding box of all vertices that a triangle uses, in world units.
    pub fn diagonal(&self) -> f64 {
        let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for &i in self.triangles.as_flattened() {
            let p = Vec3::from(self.positions[i as usize]);
            low = low.min(p);
            high = high.max(p);
        }
        high.as_dvec3().distance(low.as_dvec3())
    }

    /// Area-weighted vertex normals, (V, 3), unit length or zero where no direction exists.
    pub fn vertex_normals(&self) -> Vec<Vec3> {
        let mut normals = vec![DVec3::ZERO; self.positions.len()];
        for t in self.triangles {
            let [a, b, c] = t.map(|i| self.position(i));
            let doubled_area = (b - a).cross(c - a);
            for &i in t {
                normals[i as usize] += doubled_area;
            }
        }
        normals.iter().map(|n| n.normalize_or_zero().as_vec3()).collect()
    }
}
