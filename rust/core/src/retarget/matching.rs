//! Where on the source each vertex of the warped target belongs.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::welded::Welded;
use crate::surface::OrientedSurface;

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

/// The source, prepared for matches of a target with given triangles.
#[derive(Debug)]
pub struct Matching<'a> {
    source: &'a Welded,
    /// Triangles of the source's mesh, in the surface's order.
    corners: Vec<[u32; 3]>,
    normals: Vec<Vec3>,
    surface: OrientedSurface,
    target: &'a Welded,
}

impl<'a> Matching<'a> {
    /// Prepares `source`, whose mesh has `triangles` (T), for the vertices of `target`. Normals that differ by a unit count as
    /// `normal_length`.
    pub fn new(
        source: &'a Welded,
        triangles: &[[u32; 3]],
        target: &'a Welded,
        points: MatchPoints,
        normal_length: f64,
    ) -> Self {
        let normals = source.normals(&source.positions);
        let (corners, welded) = match points {
            MatchPoints::Surface => (triangles.to_vec(), source.triangles.clone()),
            MatchPoints::Vertices => {
                let first = source.representatives();
                let mut used: Vec<u32> = source.triangles.as_flattened().to_vec();
                used.sort_unstable();
                used.dedup();
                used.iter().map(|&u| ([first[u as usize]; 3], [u; 3])).unzip()
            }
        };
        let surface = OrientedSurface::new(&source.positions, &normals, &welded, normal_length)
            .expect("a TriMesh has a triangle");
        Self { source, corners, normals, surface, target }
    }

    /// The match of each vertex of the target at `positions` (U).
    pub fn closest(&self, positions: &[DVec3]) -> Vec<Match> {
        let normals = self.target.normals(positions);
        let found = self.surface.closest_points(positions, &normals);
        let complete = |(at, normal): (&crate::surface::OrientedPoint, &Vec3)| {
            let corners = self.corners[at.triangle as usize];
            let (mut position, mut direction) = (DVec3::ZERO, DVec3::ZERO);
            for (corner, share) in std::iter::zip(corners, at.barycentric) {
                let u = self.source.of_vertex[corner as usize] as usize;
                position += share * self.source.positions[u];
                direction += share * self.normals[u].as_dvec3();
            }
            let cosine = direction.normalize_or_zero().dot(normal.as_dvec3());
            Match { corners, barycentric: at.barycentric, position, cosine }
        };
        found.par_iter().zip(&normals).map(complete).collect()
    }
}
