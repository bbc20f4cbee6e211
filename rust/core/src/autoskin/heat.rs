//! Heat equilibrium on the surface (I. Baran, J. Popovic: Automatic rigging and animation of 3D characters. ACM
//! Transactions on Graphics 26(3), 2007, section 4).
//!
//! Each vertex is heated by its nearest bones and loses heat to its neighbours: (S + M n c / d^2) w_j = (M c / d^2) p_j, where S
//! is the stiffness, M the area of the vertices, d the distance of the nearest bone, p_j whether bone j is as near, and n how
//! many are: one, but for ties. The stiffness is clamped to positive weights, so that the matrix is positive definite and w
//! lies between 0 and 1 whatever the mesh. The paper sees a bone or does not; here distance is taken through the inside, so
//! that every vertex has a nearest bone.

use glam::Vec3;
use rayon::prelude::*;
use skinwright_solve::{Cholesky, Failure, RightHandSides, SymmetricMatrix};

use super::candidates::{Candidate, Candidates};
use super::report::Report;
use super::rows;
use crate::adjacency::Topology;
use crate::error::{Error, Result};
use crate::laplacian::Laplacian;
use crate::mesh::TriMesh;
use crate::progress::Progress;
use crate::weights::Weights;

/// Bones no more than this much farther than the nearest heat a vertex too: where two bones meet, both ends are equally near
/// but for rounding.
const AS_NEAR: f64 = 1.003;

/// Bones solved for at a time, between two looks at the cancel request.
const COLUMNS: usize = 32;

/// Shares below this are not kept.
const NEGLIGIBLE: f64 = 1e-5;

/// Shares fade from `FAINT.1` on and are gone at `FAINT.0`: what flows in from far is not meant, and it would bind a vertex to
/// bones that artists leave out.
const FAINT: (f64, f64) = (0.025, 0.05);

/// Cotangents are clamped to this share of their median and its inverse; areas to this share of theirs.
const LEAST_COTANGENT: f64 = 1e-3;
const LEAST_AREA: f64 = 1e-4;

/// Equilibrium weights of all bones; `stiffness` is c.
pub(super) fn solve(
    mesh: &TriMesh<'_>,
    candidates: &Candidates,
    stiffness: f64,
    progress: &Progress,
    report: &mut Report,
) -> Result<Weights> {
    let least = 1e-4 * mesh.diagonal().max(f64::MIN_POSITIVE);
    let heaters: Vec<Heater> = (0..mesh.vertex_count()).map(|i| Heater::new(candidates.of(i), least)).collect();
    let (heat, matrix) = assemble(mesh, &heaters, stiffness);
    progress.check()?;
    let positions: Vec<Vec3> = mesh.positions().iter().map(|&p| p.into()).collect();
    let factor = Cholesky::factor_until(matrix, &positions, progress.stop()).map_err(|failure| match failure {
        Failure::NotPositive(e) => Error::NotPositiveDefinite { vertex: e.unknown },
        Failure::Stopped => Error::Cancelled,
    })?;
    progress.report(0.75);
    let mut used: Vec<u32> = heaters.iter().flat_map(|h| &h.bones).copied().collect();
    used.sort_unstable();
    used.dedup();
    let mut rows = vec![Vec::new(); mesh.vertex_count()];
    for (k, bones) in used.chunks(COLUMNS).enumerate() {
        progress.check()?;
        let residual = solve_for(bones, &factor, &heaters, &heat, &mut rows);
        report.residual = report.residual.max(residual);
        progress.report(0.75 + 0.25 * ((k + 1) * COLUMNS) as f64 / (used.len() + COLUMNS) as f64);
    }
    Ok(Weights::from_rows(
        rows.len(),
        candidates.n_bones,
        || (),
        |(), i, out| rows::append(without_faint(&rows[i]), out),
    ))
}

/// The row without its faint shares.
fn without_faint(row: &[(u32, f32)]) -> Vec<(u32, f64)> {
    let sum: f64 = row.iter().map(|&(_, value)| f64::from(value)).sum();
    let (gone, fading) = FAINT;
    let fade = |value: f64| if value < fading { (value - gone) / (fading - gone) * fading } else { value };
    let kept = row.iter().map(|&(bone, value)| (bone, fade(f64::from(value) / sum)));
    kept.filter(|&(_, value)| value > 0.0).collect()
}

/// What heats a vertex: the bones that are nearest, and their distance.
struct Heater {
    bones: Vec<u32>,
    distance: f64,
}

impl Heater {
    fn new(candidates: &[Candidate], least: f64) -> Self {
        let nearest = candidates.iter().map(|c| c.effective).fold(f64::INFINITY, f64::min);
        let shares = candidates.iter().filter(|c| c.effective <= AS_NEAR * nearest);
        Self { bones: shares.map(|c| c.bone).collect(), distance: nearest.max(least) }
    }
}

/// Appends to `rows` the weights of some bones, and returns the residual.
fn solve_for(bones: &[u32], factor: &Cholesky, heaters: &[Heater], heat: &[f64], rows: &mut [Vec<(u32, f32)>]) -> f64 {
    let (n, columns) = (heaters.len(), bones.len());
    let (mut heated, mut values) = (Vec::new(), Vec::new());
    for (i, heater) in heaters.iter().enumerate() {
        let column = |bone| bones.binary_search(bone).ok();
        if !heater.bones.iter().any(|bone| column(bone).is_some()) {
            continue;
        }
        heated.push(i as u32);
        let start = values.len();
        values.resize(start + columns, 0.0);
        for column in heater.bones.iter().filter_map(column) {
            values[start + column] = heat[i];
        }
    }
    let solution = factor.solve(&RightHandSides::sparse(n, columns, &heated, values));
    rows.par_iter_mut().enumerate().for_each(|(i, row)| {
        let shares = bones.iter().zip(solution.row(i)).filter(|share| share.1 > NEGLIGIBLE);
        row.extend(shares.map(|(&bone, value)| (bone, value as f32)));
    });
    solution.residual()
}

/// What each bone of a vertex heats it by, M c / d^2 (V), and the matrix.
fn assemble(mesh: &TriMesh<'_>, heaters: &[Heater], stiffness: f64) -> (Vec<f64>, SymmetricMatrix) {
    let laplacian = Laplacian::new(mesh, &Topology::new(mesh.triangles(), mesh.vertex_count()));
    let n = mesh.vertex_count();
    let all_cotangents = (0..n).flat_map(|i| laplacian.row(i).1.iter().map(|x| x.abs()));
    let cotangent = median(all_cotangents.collect());
    let area = median((0..n).map(|i| laplacian.mass(i)).filter(|&area| area > 0.0).collect());
    let clamp = |x: f64| x.clamp(LEAST_COTANGENT * cotangent, cotangent / LEAST_COTANGENT);
    let heat =
        |i: usize| laplacian.mass(i).max(LEAST_AREA * area) * stiffness / (heaters[i].distance * heaters[i].distance);
    let heat: Vec<f64> = (0..n).map(heat).collect();
    let mut matrix = SymmetricMatrix { column_starts: vec![0], ..SymmetricMatrix::default() };
    for i in 0..n {
        let (neighbours, cotangents) = laplacian.row(i);
        matrix.rows.push(i as u32);
        matrix.values.push(heaters[i].bones.len() as f64 * heat[i] + cotangents.iter().map(|&x| clamp(x)).sum::<f64>());
        for (&j, &x) in neighbours.iter().zip(cotangents).filter(|&(&j, _)| j as usize > i) {
            matrix.rows.push(j);
            matrix.values.push(-clamp(x));
        }
        matrix.column_starts.push(matrix.rows.len());
    }
    (heat, matrix)
}

/// 1 where there are no values.
fn median(mut values: Vec<f64>) -> f64 {
    if values.is_empty() {
        return 1.0;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}
