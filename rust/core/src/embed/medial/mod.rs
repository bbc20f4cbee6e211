//! Embedding by the shape of the mesh alone, after I. Baran, J. Popovic: Automatic rigging and animation of 3D characters.
//! ACM Transactions on Graphics 26(3), 2007, section 3.
//!
//! The template is reduced to its branches and extremities (`reduced`); spheres inside the mesh are the places they may take
//! (`places`); branch and bound finds the places with the smallest penalty for lengths, directions, ends that are not
//! extremities and limbs that share a way (`discrete`); what was left out is put along the ways between them and moved to the
//! middle of the limb (`ways`), and everything small follows the bone it hangs on (`expand`). A mesh and a template that are
//! their own mirror images are embedded as such (`symmetry`), so that left and right cannot be swapped.

mod discrete;
mod expand;
mod places;
mod reduced;
mod symmetry;
mod ways;

use std::time::Instant;

use glam::DVec3;

use super::{Embedding, Report, Template};
use crate::error::Result;
use crate::inside::Lattice;
use crate::mesh::TriMesh;
use crate::progress::Progress;

use places::Places;
use reduced::Reduced;
use symmetry::Symmetry;

/// Cells along the diameter of the mesh.
const RESOLUTION: f64 = 96.0;

/// Turns and scales the template as a whole: to the middle and the size of the mesh.
#[derive(Debug, Clone, Copy)]
struct Alignment {
    scale: f64,
    from: DVec3,
    to: DVec3,
}

impl Alignment {
    fn new(mesh: &TriMesh<'_>, reduced: &Reduced, diameter: f64) -> Self {
        let from = middle(reduced.joints.iter().map(|joint| joint.position));
        let to = middle(mesh.triangles().as_flattened().iter().map(|&i| mesh.position(i)));
        Self { scale: diameter / reduced.diameter().max(f64::MIN_POSITIVE), from, to }
    }

    fn point(&self, p: DVec3) -> DVec3 {
        self.to + self.scale * (p - self.from)
    }
}

fn middle(points: impl Iterator<Item = DVec3>) -> DVec3 {
    let empty = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let (low, high) = points.fold(empty, |(low, high), p| (low.min(p), high.max(p)));
    0.5 * (low + high)
}

pub(super) fn embed(mesh: &TriMesh<'_>, template: &Template<'_>, progress: &Progress) -> Result<Embedding> {
    let start = Instant::now();
    let reduced = Reduced::new(template)?;
    let lattice = Lattice::new(mesh, RESOLUTION, progress)?;
    progress.report(0.3);
    let symmetry = Symmetry::new(template, &reduced, mesh, &lattice);
    let places = Places::new(mesh, &lattice, symmetry.as_ref(), progress)?;
    progress.report(0.7);
    let alignment = Alignment::new(mesh, &reduced, places.diameter());
    let chosen = discrete::choose(&reduced, &places, &alignment, symmetry.as_ref(), progress)?;
    progress.report(0.9);
    let points = ways::place(&lattice, &places, &reduced, &chosen, symmetry.as_ref());
    let mut embedding = expand::expand(template, &reduced, &points, &chosen, &alignment, symmetry.as_ref());
    embedding.report = Report {
        places: places.len(),
        main_joints: reduced.joints.len(),
        symmetric: symmetry.is_some(),
        outside: expand::outside(mesh, &mut embedding, progress)?,
        penalty: chosen.penalty,
        seconds: start.elapsed().as_secs_f64(),
    };
    progress.report(1.0);
    Ok(embedding)
}
