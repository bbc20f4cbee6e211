//! The cells that a surface touches.

use glam::{DVec3, IVec3};
use rayon::prelude::*;

use super::cells::Cells;
use crate::mesh::TriMesh;

/// Triangles a worker takes at a time.
const RUN: usize = 1024;

/// Whether each cell is touched by a triangle of `mesh`.
pub(super) fn touched(mesh: &TriMesh<'_>, cells: &Cells) -> Vec<bool> {
    let of_run = |run: &[[u32; 3]]| {
        let mut found = Vec::new();
        for t in run {
            touched_by(t.map(|i| mesh.position(i)), cells, &mut found);
        }
        found
    };
    let runs: Vec<Vec<u32>> = mesh.triangles().par_chunks(RUN).map(of_run).collect();
    let mut touched = vec![false; cells.len()];
    runs.iter().flatten().for_each(|&cell| touched[cell as usize] = true);
    touched
}

fn touched_by(corners: [DVec3; 3], cells: &Cells, found: &mut Vec<u32>) {
    let [a, b, c] = corners;
    let (low, high) = (cells.place(a.min(b).min(c)), cells.place(a.max(b).max(c)));
    for z in low.z..=high.z {
        for y in low.y..=high.y {
            for x in low.x..=high.x {
                let place = IVec3::new(x, y, z);
                let middle = cells.middle(place);
                if touches(corners.map(|p| p - middle), 0.5 * cells.size()) {
                    found.push(cells.index(place) as u32);
                }
            }
        }
    }
}

/// Whether a triangle touches the cube of half edge `half` around the origin: no axis separates them (T. Akenine-Moller:
/// Fast 3D triangle-box overlap testing. Journal of Graphics Tools 6(1), 2001). The axes of the cube itself are left out:
/// the caller looks at cells within the triangle's box only.
fn touches([a, b, c]: [DVec3; 3], half: f64) -> bool {
    let edges = [b - a, c - b, a - c];
    let separates = |axis: DVec3| {
        let (x, y, z) = (axis.dot(a), axis.dot(b), axis.dot(c));
        let reach = half * axis.abs().element_sum() * (1.0 + 1e-9);
        x.min(y).min(z) > reach || x.max(y).max(z) < -reach
    };
    let crossed = edges.iter().flat_map(|e| [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| e.cross(axis)));
    !separates(edges[0].cross(edges[1])) && !crossed.into_iter().any(separates)
}
