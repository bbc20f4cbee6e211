//! A character made ready: lattice, embedding, node weights, joints and coloured constraints, kept for every frame.

use glam::{DAffine3, DVec3, Vec3};

use super::contact::Contact;
use super::joints::{Joint, joints};
use super::lattice::Lattice;
use super::node_weights::particle_weights;
use super::projection::Colouring;
use super::region::KeptRegion;
use super::settings::Settings;
use super::skeleton::Skeleton;
use super::surface::Surface;
use crate::error::{Error, Result};
use crate::inside::Winding;
use crate::mesh::TriMesh;
use crate::progress::Progress;
use crate::weights::Weights;

/// Cells along the bounding box' diagonal by default: 1.5 % each.
const CELLS_PER_DIAGONAL: f64 = 1.0 / 0.015;
/// Enclosed volume, as a share of the cubed diagonal, below which a mesh is a sheet: on it winding numbers mean nothing.
const LEAST_VOLUME: f64 = 1e-8;
/// Vertices that a mesh may have: more would take minutes to prepare and gigabytes to keep.
const MOST_VERTICES: usize = 2_000_000;

/// Volume of every tetrahedron in cells: twelve to a cube, all alike.
pub(super) const TETRAHEDRON: f32 = 1.0 / 12.0;
/// Distance of its corners to its centre, a quarter of the root of 5.
pub(super) const ARM: f32 = 0.559_017;

/// Everything about a character that no pose changes. Lengths are in cells, about the middle of the mesh.
#[derive(Debug)]
pub(super) struct Prepared {
    pub(super) surface: Surface,
    pub(super) lattice: Lattice,
    pub(super) skeleton: Skeleton,
    pub(super) joints: Vec<Joint>,
    /// What intersects at rest.
    pub(super) contact: Contact,
    pub(super) kept: KeptRegion,
    /// Places of all particles: lattice nodes, then surface vertices.
    pub(super) rest: Vec<Vec3>,
    /// Weights of all particles.
    pub(super) weights: Weights,
    pub(super) edge_colours: Colouring,
    pub(super) side_colours: Colouring,
    pub(super) tetrahedron_colours: Colouring,
    pub(super) edge_lengths: Vec<f32>,
    pub(super) side_lengths: Vec<f32>,
    /// What makes cells of mesh units.
    pub(super) middle: DVec3,
    pub(super) cell: f64,
}

impl Prepared {
    /// # Errors
    /// See [`super::Refiner::new`].
    pub(super) fn new(
        mesh: &TriMesh<'_>,
        weights: &Weights,
        parents: &[i32],
        segments: &[[[f64; 3]; 2]],
        settings: &Settings,
        progress: &Progress,
    ) -> Result<Self> {
        check(mesh, weights)?;
        let skeleton = Skeleton::new(parents, segments, weights.n_bones() as usize)?;
        let surface = Surface::new(mesh);
        let cell = settings.cell.unwrap_or(mesh.diagonal() / CELLS_PER_DIAGONAL);
        if cell.is_nan() || cell <= 0.0 || enclosed(&surface) <= LEAST_VOLUME * mesh.diagonal().powi(3) {
            return Err(Error::NothingInside);
        }
        let winding = Winding::new(mesh);
        progress.report(0.1);
        let inside = |at: DVec3| winding.is_inside(at.as_vec3().to_array());
        let lattice = Lattice::new(&surface, cell, &inside, progress)?;
        progress.report(0.6);
        Ok(Self::assemble(surface, lattice, skeleton, weights, cell))
    }

    fn assemble(surface: Surface, lattice: Lattice, skeleton: Skeleton, weights: &Weights, cell: f64) -> Self {
        let middle = lattice.nodes.iter().sum::<DVec3>() / lattice.nodes.len() as f64;
        let rows = particle_weights(&lattice, &surface, weights);
        let places: Vec<DVec3> =
            lattice.nodes.iter().chain(&surface.rest).map(|&place| (place - middle) / cell).collect();
        let skeleton = Skeleton {
            segments: skeleton.segments.iter().map(|ends| ends.map(|end| (end - middle) / cell)).collect(),
            ..skeleton
        };
        let joints = joints(&skeleton, &places, &rows, lattice.nodes.len());
        let nodes = lattice.nodes.len() as u32;
        let distance = |[i, j]: [u32; 2]| places[i as usize].distance(places[j as usize]) as f32;
        let sides: Vec<[u32; 2]> = surface.edges.iter().map(|edge| edge.map(|i| i + nodes)).collect();
        Self {
            edge_colours: Colouring::new(&lattice.edges, places.len()),
            side_colours: Colouring::new(&sides, places.len()),
            tetrahedron_colours: Colouring::new(&lattice.tetrahedra, places.len()),
            edge_lengths: lattice.edges.iter().map(|&edge| distance(edge)).collect(),
            side_lengths: sides.iter().map(|&side| distance(side)).collect(),
            rest: places.iter().map(|place| place.as_vec3()).collect(),
            weights: csr(&rows, weights.n_bones()),
            contact: Contact::new(&surface),
            kept: KeptRegion::default(),
            surface,
            lattice,
            skeleton,
            joints,
            middle,
            cell,
        }
    }

    pub(super) fn node_count(&self) -> usize {
        self.lattice.nodes.len()
    }

    /// A pose in mesh units, in cells about the middle.
    pub(super) fn in_cells(&self, pose: &[DAffine3]) -> Vec<DAffine3> {
        let moved = |m: &DAffine3| DAffine3 {
            matrix3: m.matrix3,
            translation: (m.transform_point3(self.middle) - self.middle) / self.cell,
        };
        pose.iter().map(moved).collect()
    }

    /// A place in cells, in mesh units.
    pub(super) fn in_mesh(&self, place: Vec3) -> Vec3 {
        (place.as_dvec3() * self.cell + self.middle).as_vec3()
    }
}

/// The volume between the surface and the middle of its vertices, negative for a mesh that is inside out.
fn enclosed(surface: &Surface) -> f64 {
    let middle = surface.rest.iter().sum::<DVec3>() / surface.len().max(1) as f64;
    let corner = |i: u32| surface.rest[i as usize] - middle;
    let parts = surface.triangles.iter().map(|&[a, b, c]| corner(a).dot(corner(b).cross(corner(c))));
    parts.sum::<f64>() / 6.0
}

fn check(mesh: &TriMesh<'_>, weights: &Weights) -> Result<()> {
    if mesh.vertex_count() > MOST_VERTICES {
        return Err(Error::TooManyVertices { found: mesh.vertex_count(), most: MOST_VERTICES });
    }
    weights.check_not_negative()?;
    let (found, expected) = (weights.vertex_count(), mesh.vertex_count());
    if found == expected { Ok(()) } else { Err(Error::LengthMismatch { what: "weights", found, expected }) }
}

fn csr(rows: &[Vec<(u32, f32)>], bones: u32) -> Weights {
    let mut indptr = vec![0u32];
    for row in rows {
        indptr.push(indptr[indptr.len() - 1] + row.len() as u32);
    }
    let entries = || rows.iter().flatten();
    let (columns, values) = (entries().map(|e| e.0).collect(), entries().map(|e| e.1).collect());
    Weights::new(indptr, columns, values, bones).expect("rows of valid weights")
}
