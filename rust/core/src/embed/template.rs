//! A skeleton from a template character: mesh, weights and armature of another body.
//!
//! The template's character is moved to the mesh, its limbs turned as the mesh's are (`posed`); its surface is drawn onto the
//! mesh (`registration`); and each joint goes where it lies relative to its own surface: an affine combination of the points
//! around it, fixed on the template and evaluated on the mesh (`joints`). Then joints are made symmetric, and moved inside
//! where the template's own are inside.

use std::time::Instant;

use glam::DVec3;

use super::joints::{Joints, Surface};
use super::posed::Start;
use super::{Embedding, Report, Template};
use crate::error::{Error, Result};
use crate::mesh::TriMesh;
use crate::progress::Progress;
use crate::registration::{Lengths, Match, MatchPoints, Matching, Schedule, register};
use crate::weights::Weights;
use crate::welded::Welded;

/// Distance that normals which differ by a unit count, and length over which they are smoothed, as shares of the size.
const NORMAL: f64 = 0.05;
const SMOOTHING: f64 = 0.02;
/// The rounds of the registration. Without a skeleton to start from, more of them are needed at large lengths.
const ROUNDS: Schedule<'static> =
    Schedule { lengths: &[0.3, 0.3, 0.2, 0.2, 0.15, 0.15, 0.1, 0.1, 0.07, 0.05, 0.035, 0.025], trusted: 0.1 };

/// Mean gap, as a share of the size, from which on the template does not stand as the mesh does. Characters of one maker have
/// up to 0.015, an adult and a baby 0.034, a dog and a deer 0.042 and 0.05, a T pose and an A pose 0.07 to 0.09.
const POSED_APART: f64 = 0.04;

/// The body that a template's bones were made for.
#[derive(Debug, Clone, Copy)]
pub struct Donor<'a> {
    /// Its surface (V).
    pub mesh: TriMesh<'a>,
    /// Its weights (V) over the template's bones (B).
    pub weights: &'a Weights,
    /// The bone on the other side (B): a bone's own index if it lies in the middle, negative if there is none. None leaves the
    /// answer as asymmetric as the mesh.
    pub mirror: Option<&'a [i32]>,
    /// Pairs of a vertex of the donor and a vertex of the mesh that correspond; at least three move the start.
    pub landmarks: &'a [[u32; 2]],
}

/// Embeds the bones of `template`, made for `donor`, into `mesh`. Both must have the same directions up and front.
///
/// # Errors
/// [`Error::InvalidSkeleton`], [`Error::LengthMismatch`], [`Error::InvalidParameter`], [`Error::Cancelled`].
pub fn embed_from_character(
    mesh: &TriMesh<'_>,
    template: &Template<'_>,
    donor: &Donor<'_>,
    progress: &Progress,
) -> Result<Embedding> {
    let began = Instant::now();
    template.check()?;
    check(template, donor, mesh)?;
    let (body, target) = (Welded::new(&donor.mesh), Welded::new(mesh));
    let size = mesh.diagonal();
    let lengths = Lengths { normal: NORMAL * size, smoothing: SMOOTHING * size };
    let fit = |start: Start| Fit::new(start, &body, &target, mesh, lengths);
    let mut best = fit(aligned(template, donor, &body, mesh))?;
    if best.gap > POSED_APART * size {
        let posed = Start::posed(template, donor, &body, mesh, (progress, (0.0, 0.25)))?;
        if let Some(posed) = posed.map(fit).transpose()?.filter(|posed| posed.gap < best.gap) {
            best = posed;
        }
    }
    let Fit { matching, start, .. } = best;
    let moved = register(&matching, &body.triangles, start.positions.clone(), size, ROUNDS, (progress, (0.25, 0.8)))?;
    let matches = matching.closest(&moved)?.0;
    progress.check()?;
    let surface = Surface::new(&body, &start.positions, donor.weights, &moved, &matches, size);
    let placed = Template { heads: &start.heads, tails: &start.tails, parents: template.parents };
    let mut joints = Joints::new(&placed, &surface);
    let symmetric = donor.mirror.is_some_and(|mirror| joints.make_symmetric(template, mirror));
    progress.report(0.9);
    let outside = joints.move_inside(template, donor, mesh, progress)?;
    progress.report(1.0);
    let report = Report {
        places: body.positions.len(),
        main_joints: template.len(),
        symmetric,
        outside,
        penalty: 0.0,
        seconds: began.elapsed().as_secs_f64(),
    };
    let single = |points: &[DVec3]| points.iter().map(|p| p.as_vec3().to_array()).collect();
    Ok(Embedding { heads: single(&joints.heads), tails: single(&joints.tails), confidence: joints.confidence, report })
}

fn check(template: &Template<'_>, donor: &Donor<'_>, mesh: &TriMesh<'_>) -> Result<()> {
    let mismatch = |what, found, expected| Err(Error::LengthMismatch { what, found, expected });
    let (rows, bones) = (donor.weights.vertex_count(), donor.weights.n_bones() as usize);
    if rows != donor.mesh.vertex_count() {
        return mismatch("weights of the template", rows, donor.mesh.vertex_count());
    }
    if bones != template.len() {
        return mismatch("template_heads", template.len(), bones);
    }
    donor.weights.check_not_negative()?;
    if let Some(mirror) = donor.mirror {
        if mirror.len() != template.len() {
            return mismatch("mirror", mirror.len(), template.len());
        }
        if let Some(&value) = mirror.iter().find(|&&m| m >= template.len() as i32) {
            let must = "it must name a bone, or be negative for none";
            return Err(Error::InvalidParameter { name: "mirror", value: f64::from(value), must });
        }
    }
    let counts = [donor.mesh.vertex_count(), mesh.vertex_count()];
    let out_of_range = |pair: &&[u32; 2]| std::iter::zip(**pair, counts).any(|(i, count)| i as usize >= count);
    if let Some(pair) = donor.landmarks.iter().find(out_of_range) {
        let must = "a landmark must name a vertex of the template and one of the mesh";
        return Err(Error::InvalidParameter { name: "landmarks", value: f64::from(pair[0].max(pair[1])), must });
    }
    Ok(())
}

/// A start, and how well it fits.
struct Fit<'a> {
    matching: Matching<'a>,
    start: Start,
    /// Mean distance of a vertex from its match, which is farther away the less the normals agree.
    gap: f64,
}

impl<'a> Fit<'a> {
    fn new(start: Start, body: &'a Welded, target: &'a Welded, mesh: &TriMesh<'_>, lengths: Lengths) -> Result<Self> {
        let points = MatchPoints::Surface;
        let matching = Matching::new(target, mesh.triangles(), body, &start.positions, points, lengths)?;
        let matches = matching.closest(&start.positions)?.0;
        let gap = |(at, p): (&Match, &DVec3)| at.position.distance(*p) + lengths.normal * (1.0 - at.cosine);
        let gap = matches.iter().zip(&start.positions).map(gap).sum::<f64>() / start.positions.len() as f64;
        Ok(Self { matching, start, gap })
    }
}

/// The template's character where the mesh is: as large along the template's longest side, and in its middle, or where
/// landmarks say.
fn aligned(template: &Template<'_>, donor: &Donor<'_>, body: &Welded, mesh: &TriMesh<'_>) -> Start {
    let (from, to) = (extent(&donor.mesh), extent(mesh));
    let sides = (from.1 - from.0).to_array();
    let longest = (0..3).max_by(|&a, &b| sides[a].total_cmp(&sides[b])).expect("three axes");
    let scale = (to.1 - to.0).to_array()[longest] / sides[longest].max(f64::MIN_POSITIVE);
    let mut middles = [0.5 * (from.0 + from.1), 0.5 * (to.0 + to.1)];
    if donor.landmarks.len() >= 3 {
        let mean = |side: usize, mesh: &TriMesh<'_>| {
            donor.landmarks.iter().map(|pair| mesh.position(pair[side])).sum::<DVec3>() / donor.landmarks.len() as f64
        };
        middles = [mean(0, &donor.mesh), mean(1, mesh)];
    }
    Start::as_it_is(template, donor, body, scale, middles)
}

/// Lowest and highest coordinates of the vertices that triangles use.
fn extent(mesh: &TriMesh<'_>) -> (DVec3, DVec3) {
    let points = mesh.triangles().as_flattened().iter().map(|&i| mesh.position(i));
    points.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)))
}
