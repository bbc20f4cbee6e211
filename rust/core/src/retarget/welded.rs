//! A mesh whose vertices at equal positions are one, as its author saw it before an exporter cut it along seams.

use std::collections::HashMap;

use glam::{DVec3, Vec3};

use crate::mesh::TriMesh;

/// Distinct positions of a mesh.
#[derive(Debug)]
pub struct Welded {
    /// Distinct positions, in order of first appearance (U).
    pub positions: Vec<DVec3>,
    /// Which of them each vertex has, (V).
    pub of_vertex: Vec<u32>,
    /// Triangles over the distinct positions, as many as the mesh has (T).
    pub triangles: Vec<[u32; 3]>,
}

impl Welded {
    /// Finds the distinct positions, to the bit (but 0 and -0 are equal).
    pub fn new(mesh: &TriMesh<'_>) -> Self {
        let mut number = HashMap::with_capacity(mesh.vertex_count());
        let mut positions = Vec::new();
        let weld = |p: &[f32; 3]| {
            *number.entry(p.map(|x| (x + 0.0).to_bits())).or_insert_with(|| {
                positions.push(Vec3::from(*p).as_dvec3());
                positions.len() as u32 - 1
            })
        };
        let of_vertex: Vec<u32> = mesh.positions().iter().map(weld).collect();
        let triangles = mesh.triangles().iter().map(|t| t.map(|i| of_vertex[i as usize])).collect();
        Self { positions, of_vertex, triangles }
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

    /// The first vertex at each distinct position, (U).
    pub fn representatives(&self) -> Vec<u32> {
        let mut first = vec![u32::MAX; self.positions.len()];
        for (i, &u) in self.of_vertex.iter().enumerate().rev() {
            first[u as usize] = i as u32;
        }
        first
    }
}
