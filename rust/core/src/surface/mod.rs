//! Closest points on a triangle mesh.

mod bvh;
mod cheapest;
mod closest_point;
mod flat;
mod lanes;
mod morton;
mod nearest;
mod node;
mod oriented;
mod search;

use glam::{DVec3, Vec3};
use pulp::Arch;
use rayon::prelude::*;

use crate::mesh::TriMesh;
use bvh::Bvh;
pub use cheapest::{Bound, Priced};
use nearest::Reach;
pub use oriented::{OrientedPoint, OrientedSurface};
use search::Batch;

pub(crate) use morton::order as morton_order;

/// Queries that one task answers; within a task each search starts from the last one's answer.
const BATCH: usize = 512;

/// A point on a surface.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SurfacePoint {
    /// Index of the triangle.
    pub triangle: u32,
    /// Barycentric coordinates, non-negative, summing to 1.
    pub barycentric: [f64; 3],
    /// Distance from the query, world units.
    pub distance: f64,
}

/// The answer of a search.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Found {
    point: SurfacePoint,
    ties: u32,
}

/// A mesh prepared for closest-point queries (bounding volume hierarchy).
///
/// Answers are exact and unique: the triangle with the smallest squared distance in f64 arithmetic, of equal ones the
/// lowest index, whatever the number of threads, the machine's SIMD and the order of the queries.
#[derive(Debug)]
pub struct SurfaceIndex {
    bvh: Bvh,
}

impl SurfaceIndex {
    /// Builds the hierarchy over all triangles of `mesh`.
    pub fn new(mesh: &TriMesh<'_>) -> Self {
        let all: Vec<u32> = (0..mesh.triangles().len() as u32).collect();
        Self::of_triangles(mesh, &all).expect("a TriMesh has a triangle")
    }

    /// Builds the hierarchy over some triangles of `mesh` (indices, in any order); answers name the mesh's triangles.
    ///
    /// None if `triangles` is empty. Panics if an index is out of range.
    pub fn of_triangles(mesh: &TriMesh<'_>, triangles: &[u32]) -> Option<Self> {
        let corners_of = |t: u32| mesh.triangles()[t as usize].map(|i| Vec3::from(mesh.positions()[i as usize]));
        (!triangles.is_empty()).then(|| Self { bvh: Bvh::new(triangles, corners_of) })
    }

    /// Exact closest point for each query (Q, 3), in the queries' order, on rayon's current pool.
    ///
    /// Queries must be finite; the distance to one that is not is NaN or infinite.
    pub fn closest_points(&self, queries: &[[f32; 3]]) -> Vec<SurfacePoint> {
        self.found(queries, 0.0, |found| found.point)
    }

    /// The same, and how many other triangles are as near: no more than `tolerance` (world units) farther away, or rounding
    /// errors if it is 0. Those that share the closest point are among them; some that are little farther away may be.
    pub fn closest_points_and_ties(&self, queries: &[[f32; 3]], tolerance: f64) -> (Vec<SurfacePoint>, Vec<u32>) {
        self.found(queries, tolerance, |found| (found.point, found.ties)).into_par_iter().unzip()
    }

    fn found<T: Send>(&self, queries: &[[f32; 3]], tolerance: f64, take: impl Fn(Found) -> T + Sync) -> Vec<T> {
        let order = morton::order(queries);
        let mut along_curve = vec![Found::default(); queries.len()];
        let batches = order.par_chunks(BATCH).zip(along_curve.par_chunks_mut(BATCH));
        batches.for_each(|(order, answers)| {
            let queries: Vec<_> = order.iter().map(|&i| queries[i as usize]).collect();
            self.answer(&queries, tolerance, answers);
        });
        let mut place = vec![0; queries.len()];
        order.iter().zip(0u32..).for_each(|(&i, along)| place[i as usize] = along);
        place.into_par_iter().with_min_len(BATCH).map(|along| take(along_curve[along as usize])).collect()
    }

    /// Exact closest point for one query, world space.
    pub fn closest_point(&self, query: [f32; 3]) -> SurfacePoint {
        let mut answer = [Found::default()];
        self.answer(&[query], 0.0, &mut answer);
        answer[0].point
    }

    /// The cheapest points for each query (Q, 3) of a `cost` that is at least the squared distance, and those that are
    /// nearly as cheap.
    ///
    /// `cost` prices the closest point of a triangle for a query, told by its number. `finish` makes the answer of what is
    /// found for a query: the closest points, by triangle, of all triangles that are within `near` of its bound (Q), or
    /// cost no more than the bound and no more than `slack` times the least cost. Exact, and in no way dependent on
    /// threads or the order of queries. For a query that is not finite nothing is found.
    pub fn cheapest_points<T: Send>(
        &self,
        queries: &[[f32; 3]],
        bounds: &[Bound],
        slack: f64,
        cost: impl Fn(usize, &SurfacePoint) -> f64 + Sync,
        finish: impl Fn(usize, &[Priced]) -> T + Sync,
    ) -> Vec<T> {
        let order = morton::order(queries);
        let answer = |numbers: &[u32]| {
            let (bvh, cost, finish) = (&self.bvh, &cost, &finish);
            Arch::new().dispatch(cheapest::Batch { bvh, queries, numbers, bounds, slack, cost, finish })
        };
        let along_curve: Vec<Vec<T>> = order.par_chunks(BATCH).map(answer).collect();
        let mut answers: Vec<Option<T>> = std::iter::repeat_with(|| None).take(queries.len()).collect();
        for (&number, found) in std::iter::zip(&order, along_curve.into_iter().flatten()) {
            answers[number as usize] = Some(found);
        }
        answers.into_iter().map(|answer| answer.expect("each query is on the curve once")).collect()
    }

    fn answer(&self, queries: &[[f32; 3]], tolerance: f64, answers: &mut [Found]) {
        Arch::new().dispatch(Batch { bvh: &self.bvh, queries, reach: Reach::new(tolerance), answers });
    }
}

/// Squared distance of a point to a triangle, as [`SurfaceIndex`] measures it.
pub(crate) fn squared_distance_to_triangle(query: DVec3, corners: [DVec3; 3]) -> f64 {
    closest_point::closest_to_origin(corners.map(|corner| corner - query)).1
}
