//! Where on the source each vertex of the warped target belongs.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::smooth::Smoother;
use crate::error::Result;
use crate::progress::Progress;
use crate::surface::{OrientedPoint, OrientedSurface};
use crate::welded::Welded;

/// What a match may be.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum MatchPoints {
    /// Any point of the source's surface; for meshes of different topology.
    #[default]
    Surface,
    /// A vertex of the source; for meshes made from one base mesh, whose vertices correspond.
    Vertices,
}

impl MatchPoints {
    /// Every kind.
    pub const ALL: [Self; 2] = [Self::Surface, Self::Vertices];
}

/// A match on the source.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Match {
    /// Vertices of the source's triangle (of the mesh, not of the welded one).
    pub corners: [u32; 3],
    /// Barycentric coordinates in it.
    pub barycentric: [f64; 3],
    /// Where that is.
    pub position: DVec3,
    /// Cosine of the angle between the normals.
    pub cosine: f64,
}

/// The source, prepared for matches of a target. Normals are smoothed on both sides, so that neither the folds of clothes nor
/// the facets of a coarse mesh decide, but which way a part of the body faces.
#[derive(Debug)]
pub struct Matching<'a> {
    source: &'a Welded,
    /// Triangles of the source's mesh, in the surface's order.
    corners: Vec<[u32; 3]>,
    normals: Vec<Vec3>,
    surface: OrientedSurface,
    target: &'a Welded,
    smoother: Smoother,
}

/// Lengths of a matching, world units in the source's space.
#[derive(Debug, Clone, Copy)]
pub struct Lengths {
    /// How far apart normals that differ by a unit count.
    pub normal: f64,
    /// Length over which normals are smoothed.
    pub smoothing: f64,
}

impl<'a> Matching<'a> {
    /// Prepares `source`, whose mesh has `triangles` (T), for the vertices of `target`, which lie at about `positions` (U).
    ///
    /// # Errors
    /// Those of [`Smoother::new`].
    pub fn new(
        source: &'a Welded,
        triangles: &[[u32; 3]],
        target: &'a Welded,
        positions: &[DVec3],
        points: MatchPoints,
        lengths: Lengths,
    ) -> Result<Self> {
        let smoother_of = |positions: &[DVec3], welded: &Welded| {
            let mut smoother = Smoother::new(positions, &welded.triangles)?;
            smoother.set_diffusion(lengths.smoothing, &Progress::default())?;
            Ok(smoother)
        };
        let raw = source.normals(&source.positions);
        let normals = smoother_of(&source.positions, source)?.smooth_directions(&raw, &Progress::default())?;
        let (corners, welded) = match points {
            MatchPoints::Surface => (triangles.to_vec(), source.triangles.clone()),
            MatchPoints::Vertices => {
                let mut used: Vec<u32> = source.triangles.as_flattened().to_vec();
                used.sort_unstable();
                used.dedup();
                used.iter().map(|&u| ([source.first[u as usize]; 3], [u; 3])).unzip()
            }
        };
        let surface = OrientedSurface::new(&source.positions, &normals, &welded, lengths.normal)
            .expect("a TriMesh has a triangle");
        Ok(Self { source, corners, normals, surface, target, smoother: smoother_of(positions, target)? })
    }

    /// Smooth normals of the source (U).
    pub fn source_normals(&self) -> &[Vec3] {
        &self.normals
    }

    /// The match of each vertex of the target at `positions` (U), and the smooth normals it was found with (U).
    ///
    /// # Errors
    /// Those of [`Smoother::smooth`].
    pub fn closest(&self, positions: &[DVec3]) -> Result<(Vec<Match>, Vec<Vec3>)> {
        let normals = self.smoother.smooth_directions(&self.target.normals(positions), &Progress::default())?;
        let found = self.surface.closest_points(positions, &normals);
        let matches = found.par_iter().zip(&normals).map(|(at, normal)| self.complete(at, *normal)).collect();
        Ok((matches, normals))
    }

    fn complete(&self, at: &OrientedPoint, normal: Vec3) -> Match {
        let corners = self.corners[at.triangle as usize];
        let (mut position, mut direction) = (DVec3::ZERO, DVec3::ZERO);
        for (corner, share) in std::iter::zip(corners, at.barycentric) {
            let u = self.source.of_vertex[corner as usize] as usize;
            position += share * self.source.positions[u];
            direction += share * self.normals[u].as_dvec3();
        }
        let cosine = direction.normalize_or_zero().dot(normal.as_dvec3());
        Match { corners, barycentric: at.barycentric, position, cosine }
    }
}
