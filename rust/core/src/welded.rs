//! A mesh whose coincident vertices are one, as its author saw it before an exporter cut it along seams.

use glam::{DVec3, Vec3};

use crate::mesh::TriMesh;
use crate::weld::Weld;

/// Vertices that are closer than this share of the diagonal are one.
const MERGE_DISTANCE: f64 = 1e-6;

/// Distinct positions of a mesh.
#[derive(Debug)]
pub struct Welded {
    /// Distinct positions (U).
    pub positions: Vec<DVec3>,
    /// Which of them each vertex has, (V).
    pub of_vertex: Vec<u32>,
    /// Triangles over the distinct positions, as many as the mesh has (T).
    pub triangles: Vec<[u32; 3]>,
    /// The first vertex at each distinct position, (U).
    pub first: Vec<u32>,
}

impl Welded {
    /// Unites vertices that are as close as the rounding of a file keeps equal ones apart.
    pub fn new(mesh: &TriMesh<'_>) -> Self {
        let weld = Weld::coincident(mesh.positions(), MERGE_DISTANCE * mesh.diagonal());
        let (of_vertex, first): (Vec<u32>, Vec<u32>) = match &weld {
            Some(weld) => (weld.class_of().to_vec(), weld.representatives().collect()),
            None => (0..mesh.vertex_count() as u32).map(|i| (i, i)).unzip(),
        };
        Self {
            positions: first.iter().map(|&i| mesh.position(i)).collect(),
            triangles: mesh.triangles().iter().map(|t| t.map(|i| of_vertex[i as usize])).collect(),
            of_vertex,
            first,
        }
    }

    /// Area-weighted unit normals at `positions` (U), zero where there is no direction.
    pub fn normals(&self, positions: &[DVec3]) -> Vec<Vec3> {
        let mut normals = vec![DVec3::ZERO; positions.len()];
        for t in &self.triangles {
            let [a, b, c] = t.map(|i| positions[i as usize]);
            let doubled_area = (b - a).cross(c - a);
            t.iter().for_each(|&i| normals[i as usize] += doubled_area);
        }
        normals.iter().map(|n| n.normalize_or_zero().as_vec3()).collect()
    }

    /// Values of distinct positions (U) for every vertex (V).
    pub fn spread<T: Copy>(&self, values: &[T]) -> Vec<T> {
        self.of_vertex.iter().map(|&u| values[u as usize]).collect()
    }
}
