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

use discrete::Chosen;
use places::Places;
pub(super) use reduced::{Joint, Reduced};
use symmetry::Symmetry;
use ways::Points;

/// Cells along the diameter of the mesh.
const RESOLUTION: f64 = 96.0;

/// Moves and scales the template as a whole: to the middle and the size of the mesh.
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

/// A template's branches and extremities in a mesh.
pub(super) struct Found {
    points: Points,
    chosen: Chosen,
    alignment: Alignment,
    symmetry: Option<Symmetry>,
    places: usize,
    /// How long the limb that leads to each joint is in the mesh; 0 for the first joint.
    pub(super) lengths: Vec<f64>,
}

impl Found {
    /// Reports progress from `span.0` to `span.1`.
    pub(super) fn new(
        mesh: &TriMesh<'_>,
        template: &Template<'_>,
        reduced: &Reduced,
        resolution: f64,
        (progress, span): (&Progress, (f64, f64)),
    ) -> Result<Self> {
        let report = |share: f64| progress.report(span.0 + (span.1 - span.0) * share);
        let lattice = Lattice::new(mesh, resolution, progress)?;
        report(0.3);
        let symmetry = Symmetry::new(template, reduced, mesh, &lattice);
        let places = Places::new(mesh, &lattice, symmetry.as_ref(), progress)?;
        report(0.7);
        let alignment = Alignment::new(mesh, reduced, places.diameter());
        let chosen = discrete::choose(reduced, &places, &alignment, symmetry.as_ref(), progress)?;
        report(1.0);
        let points = ways::place(&lattice, &places, reduced, &chosen, symmetry.as_ref());
        let length = |(k, joint): (usize, &Joint)| match &joint.limb {
            Some(limb) => places.way(chosen.places[limb.from], chosen.places[k]),
            None => 0.0,
        };
        let lengths = reduced.joints.iter().enumerate().map(length).collect();
        Ok(Self { points, chosen, alignment, symmetry, places: places.len(), lengths })
    }

    /// Where each joint of the reduced template lies.
    pub(super) fn joints(&self) -> &[DVec3] {
        &self.points.joints
    }
}

pub(super) fn embed(mesh: &TriMesh<'_>, template: &Template<'_>, progress: &Progress) -> Result<Embedding> {
    let start = Instant::now();
    let reduced = Reduced::new(template)?;
    let found = Found::new(mesh, template, &reduced, RESOLUTION, (progress, (0.0, 0.9)))?;
    let Found { points, chosen, alignment, symmetry, places, .. } = found;
    let mut embedding = expand::expand(template, &reduced, &points, &chosen, &alignment, symmetry.as_ref());
    embedding.report = Report {
        places,
        main_joints: reduced.joints.len(),
        symmetric: symmetry.is_some(),
        outside: expand::outside(mesh, &mut embedding, progress)?,
        penalty: chosen.penalty,
        seconds: start.elapsed().as_secs_f64(),
    };
    progress.report(1.0);
    Ok(embedding)
}
