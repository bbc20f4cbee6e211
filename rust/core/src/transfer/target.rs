//! The target as it is solved on: vertices that are one are one, and every copy gets the same row.

use super::matching::{MaskValue, TargetSurface};
use super::normals::Normals;
use super::{Length, Transfer, UnmatchedIsland};
use crate::adjacency::NONE;
use crate::error::{Error, Result};
use crate::fill::Fill;
use crate::mesh::TriMesh;
use crate::weld::Weld;

/// A target mesh: V positions in the source's space, T triangles, and E edges, of which those count that lead to a vertex
/// without a triangle (wires, hair strands).
#[derive(Debug, Clone, Default)]
pub struct TargetMesh {
    /// Positions, (V, 3).
    pub positions: Vec<[f32; 3]>,
    /// Triangles, (T, 3).
    pub triangles: Vec<[u32; 3]>,
    /// Edges, (E, 2); those of triangles may be among them.
    pub edges: Vec<[u32; 2]>,
}

/// The target and its weld.
#[derive(Debug)]
pub(super) struct Target {
    vertex_count: usize,
    weld_tolerance: Length,
    weld: Option<Weld>,
    /// The mesh as it was given, where it is not the one that is solved on.
    given: Option<TargetMesh>,
    pub fill: Fill,
    pub normals: Normals,
    /// Whether a vertex has edges but no triangle.
    is_wire: Vec<bool>,
    /// Diagonal of the bounding box, world units.
    pub diagonal: f64,
}

impl Target {
    /// Checks and welds a mesh, and assembles its Laplacian.
    ///
    /// # Errors
    /// Those of [`TriMesh::new`], unless there are edges in place of triangles.
    pub fn new(given: TargetMesh, weld_tolerance: Length) -> Result<Self> {
        let mesh = TriMesh::with_edges(&given.positions, &given.triangles, &given.edges, "target")?;
        let vertex_count = given.positions.len();
        let weld = Weld::coincident(&given.positions, weld_tolerance.of(mesh.diagonal()));
        let (positions, triangles, edges, given) = match &weld {
            None => (given.positions, given.triangles, given.edges, None),
            Some(weld) => {
                let (positions, triangles) = weld.welded(&given.positions, &given.triangles);
                (positions, triangles, weld.welded_edges(&given.edges), Some(given))
            }
        };
        let mesh = TriMesh::of_checked(&positions, &triangles);
        let (normals, diagonal) = (Normals::of_target(&mesh), mesh.diagonal());
        let fill = Fill::with_edges(positions, triangles, edges, None)?;
        let is_wire = fill.is_wire();
        Ok(Self { vertex_count, weld_tolerance, weld, given, fill, normals, is_wire, diagonal })
    }

    /// Welds with another tolerance; whether it is another.
    pub fn weld_again(&mut self, weld_tolerance: Length) -> Result<bool> {
        let is_another = self.weld_tolerance != weld_tolerance;
        if is_another {
            *self = Self::new(self.given.clone().unwrap_or_else(|| self.given_mesh()), weld_tolerance)?;
        }
        Ok(is_another)
    }

    fn given_mesh(&self) -> TargetMesh {
        let (positions, triangles, edges) = self.fill.arrays();
        TargetMesh { positions: positions.to_vec(), triangles: triangles.to_vec(), edges: edges.to_vec() }
    }

    /// What matching sees of it.
    pub fn surface(&self) -> TargetSurface<'_> {
        let Normals { of_vertex, two_sided } = &self.normals;
        let mesh = self.fill.mesh();
        TargetSurface {
            positions: mesh.positions(),
            triangles: mesh.triangles(),
            normals: of_vertex,
            two_sided,
            is_wire: &self.is_wire,
        }
    }

    /// One mask value for each vertex that is solved on. Where copies differ, forcing a match wins over forbidding it, and
    /// either over neither.
    pub fn mask(&self, mask: Option<&[MaskValue]>) -> Result<Option<Vec<MaskValue>>> {
        let Some(mask) = mask else { return Ok(None) };
        let (found, expected) = (mask.len(), self.vertex_count);
        if found != expected {
            return Err(Error::LengthMismatch { what: "mask", found, expected });
        }
        let rank = |value: &MaskValue| match value {
            MaskValue::Automatic => 0,
            MaskValue::Inpaint => 1,
            MaskValue::ForceMatch => 2,
        };
        let of_class = |weld: &Weld, class| {
            let values = weld.members(class).iter().map(|&i| mask[i as usize]);
            values.max_by_key(rank).expect("no class is empty")
        };
        Ok(Some(match &self.weld {
            None => mask.to_vec(),
            Some(weld) => (0..weld.class_count()).map(|class| of_class(weld, class)).collect(),
        }))
    }

    /// One value for each vertex of the mesh as it was given.
    pub fn expand<T: Clone>(&self, values: Vec<T>) -> Vec<T> {
        match &self.weld {
            None => values,
            Some(weld) => weld.class_of().iter().map(|&class| values[class as usize].clone()).collect(),
        }
    }

    /// A transfer with one row for each vertex of the mesh as it was given, and its counts.
    pub fn expand_transfer(&self, transfer: Transfer) -> Transfer {
        let Some(weld) = &self.weld else { return transfer };
        let mut report = transfer.report;
        let weights = transfer.weights.take_rows(weld.class_of());
        let matched = self.expand(transfer.matched);
        let count = |flags: Vec<bool>| flags.into_iter().filter(|&flag| flag).count();
        report.matched = count(matched.clone());
        report.inpainted = count(self.expand(self.fill.unknown().to_vec()));
        report.loose = count(self.expand(self.is_loose()));
        report.unmatched_islands = self.expand_islands(weld, report.unmatched_islands);
        report.welded = self.vertex_count - weld.class_count();
        let confidence = self.expand(transfer.confidence);
        let (distances, angles) = (self.expand(transfer.distances), self.expand(transfer.angles));
        Transfer { report: report.counting(&weights), weights, matched, confidence, distances, angles }
    }

    /// Which vertices of the mesh that is solved on have neither triangle nor edge.
    pub fn is_loose(&self) -> Vec<bool> {
        self.fill.islands().of_vertex().iter().map(|&island| island == NONE).collect()
    }

    fn expand_islands(&self, weld: &Weld, mut unmatched: Vec<UnmatchedIsland>) -> Vec<UnmatchedIsland> {
        let of_vertex = self.fill.islands().of_vertex();
        let mut vertices = vec![0; self.fill.islands().count()];
        for (class, &island) in of_vertex.iter().enumerate().filter(|(_, island)| **island != NONE) {
            vertices[island as usize] += weld.members(class).len();
        }
        for island in &mut unmatched {
            let class = island.first_vertex as usize;
            island.vertices = vertices[of_vertex[class] as usize];
            island.first_vertex = weld.members(class)[0];
        }
        unmatched
    }
}
