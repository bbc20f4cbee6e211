//! Coincident vertices as one: meshes from games are split at UV and normal seams, and a seam must not tear.

use std::collections::HashMap;

use crate::mesh::TriMesh;
use crate::weights::Weights;

/// A mesh without coincident vertices, and the way back.
pub(super) struct Welded {
    pub(super) positions: Vec<[f32; 3]>,
    pub(super) triangles: Vec<[u32; 3]>,
    /// Welded vertex of each vertex of the mesh.
    pub(super) vertex_of: Vec<u32>,
}

impl Welded {
    pub(super) fn new(mesh: &TriMesh<'_>) -> Self {
        let mut number: HashMap<[u32; 3], u32> = HashMap::with_capacity(mesh.vertex_count());
        let mut positions = Vec::new();
        let mut vertex = |p: &[f32; 3]| {
            // Adding zero turns -0 into 0.
            *number.entry(p.map(|x| (x + 0.0).to_bits())).or_insert_with(|| {
                positions.push(*p);
                positions.len() as u32 - 1
            })
        };
        let vertex_of: Vec<u32> = mesh.positions().iter().map(&mut vertex).collect();
        let triangles = mesh.triangles().iter().map(|t| t.map(|i| vertex_of[i as usize])).collect();
        Self { positions, triangles, vertex_of }
    }

    /// Weights of the mesh from those of the welded one.
    pub(super) fn spread(&self, weights: &Weights) -> Weights {
        Weights::from_rows(
            self.vertex_of.len(),
            weights.n_bones(),
            || (),
            |(), i, out| {
                let (bones, values) = weights.row(self.vertex_of[i] as usize);
                out.extend(std::iter::zip(bones, values).map(|(&bone, &value)| (bone, value)));
            },
        )
    }
}
