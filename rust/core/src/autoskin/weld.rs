//! Coincident vertices as one: meshes from games are split at UV and normal seams, and a seam must not tear.

use crate::mesh::TriMesh;
use crate::weights::Weights;
use crate::weld::Weld;

/// Vertices this near to each other are one, as a share of the mesh's diagonal: the rounding of `f32` after a transform.
const COINCIDENT: f64 = 1e-6;

/// A mesh without coincident vertices, and the way back.
pub(super) struct Welded {
    pub(super) positions: Vec<[f32; 3]>,
    pub(super) triangles: Vec<[u32; 3]>,
    /// None where no two vertices coincide.
    weld: Option<Weld>,
}

impl Welded {
    pub(super) fn new(mesh: &TriMesh<'_>) -> Self {
        let weld = Weld::coincident(mesh.positions(), COINCIDENT * mesh.diagonal());
        let (positions, triangles) = match &weld {
            Some(weld) => weld.welded(mesh.positions(), mesh.triangles()),
            None => (mesh.positions().to_vec(), mesh.triangles().to_vec()),
        };
        Self { positions, triangles, weld }
    }

    /// Weights of the mesh from those of the welded one.
    pub(super) fn spread(&self, weights: Weights) -> Weights {
        let Some(weld) = &self.weld else { return weights };
        Weights::from_rows(
            weld.class_of().len(),
            weights.n_bones(),
            || (),
            |(), i, out| {
                let (bones, values) = weights.row(weld.class_of()[i] as usize);
                out.extend(std::iter::zip(bones, values).map(|(&bone, &value)| (bone, value)));
            },
        )
    }
}
