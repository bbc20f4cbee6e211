//! Which part of the solved surface can be nearest to an island: a few buttons need no index of the whole garment.

use rayon::prelude::*;

use super::bounds::Bounds;
use crate::mesh::TriMesh;
use crate::surface::squared_distance_to_triangle;

/// Neighbouring triangles or vertices that share a box. Files list neighbours near each other, mostly.
const RUN: usize = 64;

/// More comparisons of boxes than this cost as much as an index of everything, ...
const MOST_COMPARISONS: usize = 20_000_000;
/// ... and so do the comparisons of vertices and triangles of one run of an island with so many runs of triangles.
const RUNS_PER_GAP: usize = 8;

/// Those of the `solved` triangles that can be nearest to one of `islands` (lists of vertices), ascending; all if it does
/// not pay to choose.
pub(super) fn can_be_nearest(mesh: &TriMesh<'_>, solved: Vec<u32>, islands: &[&[u32]]) -> Vec<u32> {
    let runs_of_vertices: usize = islands.iter().map(|island| island.len().div_ceil(RUN)).sum();
    let runs: Vec<&[u32]> = solved.chunks(RUN).collect();
    let costs_more = runs_of_vertices.saturating_mul(runs.len()) > MOST_COMPARISONS;
    if costs_more || runs.len() < runs_of_vertices.saturating_mul(RUNS_PER_GAP) {
        return solved;
    }
    let position = |i: u32| mesh.positions()[i as usize];
    let corners = |t: &u32| mesh.triangles()[*t as usize].map(position);
    let boxes: Vec<Bounds> = runs.par_iter().map(|run| Bounds::of(run.iter().flat_map(corners))).collect();
    let mark = |mut wanted: Vec<bool>, island: &&[u32]| {
        let parts: Vec<Bounds> = island.chunks(RUN).map(|part| Bounds::of(part.iter().map(|&i| position(i)))).collect();
        // Not by the boxes' gap: that of a run from one end of the garment to the other is small anywhere.
        let nearest = |part: &Bounds| {
            let distances = boxes.iter().map(|b| b.farthest(part)).enumerate();
            distances.min_by(|a, b| a.1.total_cmp(&b.1)).expect("something is solved")
        };
        let candidates = parts.iter().enumerate().map(|(k, part)| (k, nearest(part)));
        let (k, (run, _)) = candidates.min_by(|a, b| a.1.1.total_cmp(&b.1.1)).expect("an island has vertices");
        let part = &island[k * RUN..island.len().min((k + 1) * RUN)];
        let at_most = gap_between(mesh, part, runs[run]);
        for part in &parts {
            let near = |b: &Bounds| b.distance(part) <= at_most;
            std::iter::zip(&mut wanted, &boxes).filter(|(_, b)| near(b)).for_each(|(wanted, _)| *wanted = true);
        }
        wanted
    };
    let nothing = || vec![false; runs.len()];
    let either = |left: Vec<bool>, right: Vec<bool>| std::iter::zip(left, right).map(|(a, b)| a | b).collect();
    let wanted = islands.par_iter().with_min_len(8).fold(nothing, mark).reduce(nothing, either);
    std::iter::zip(runs, wanted).filter(|(_, wanted)| *wanted).flat_map(|(run, _)| run).copied().collect()
}

/// Smallest distance of any of the `vertices` to any of the `triangles`, rounded up.
fn gap_between(mesh: &TriMesh<'_>, vertices: &[u32], triangles: &[u32]) -> f64 {
    let corners = |&t: &u32| mesh.triangles()[t as usize].map(|i| mesh.position(i));
    let of_vertex = |&i: &u32| {
        let query = mesh.position(i);
        triangles.iter().map(|t| squared_distance_to_triangle(query, corners(t))).fold(f64::INFINITY, f64::min)
    };
    // Boxes are compared in f32.
    vertices.iter().map(of_vertex).fold(f64::INFINITY, f64::min).sqrt() * (1.0 + 1e-6)
}
