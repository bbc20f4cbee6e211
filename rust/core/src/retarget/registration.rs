//! Optional: the warped target drawn onto the source by smooth displacements, so that other proportions match too.
//!
//! Each round minimises `sum of m_i c_i |d_i - (p_i - z_i)|^2 + a l^2 <d, S d> + l^4 <d, S M^-1 S d>` for the displacements
//! d of the vertices z, p their closest points and c their confidence, at a length l that shrinks from round to round: first
//! the limbs' lengths and girths agree, then smaller forms.

use glam::DVec3;
use rayon::prelude::*;
use skinwright_solve::{Cholesky, RightHandSides, SymmetricMatrix};

use super::matching::Matching;
use crate::adjacency::Topology;
use crate::error::{Error, Result};
use crate::laplacian::Laplacian;
use crate::mesh::TriMesh;
use crate::progress::Progress;

/// Smoothness lengths of the rounds, as shares of the source's size.
pub const LENGTHS: [f64; 7] = [0.15, 0.1, 0.075, 0.05, 0.035, 0.025, 0.015];
/// Weight of the first-order term beside the second-order one.
const MEMBRANE: f64 = 0.1;
/// Pull to the place a vertex has, as a share of a confident match: parts without any match stay.
const STAY: f64 = 1e-3;
/// Distance at which confidence falls to 1 / e, as a share of the source's size.
const TRUSTED: f64 = 0.04;

/// Moves `positions` (U), the vertices of a mesh of `triangles` (T), towards the source in as many rounds as there are
/// lengths; `size` is the source's.
///
/// # Errors
/// [`Error::Cancelled`], [`Error::NotPositiveDefinite`].
pub fn register(
    matching: &Matching<'_>,
    triangles: &[[u32; 3]],
    positions: Vec<DVec3>,
    size: f64,
    progress: &Progress,
) -> Result<Vec<DVec3>> {
    let smoothness = Smoothness::new(&positions, triangles)?;
    let mut moved = positions;
    for (round, length) in LENGTHS.iter().enumerate() {
        progress.check()?;
        progress.report(0.1 + 0.6 * round as f64 / LENGTHS.len() as f64);
        let found = matching.closest(&moved);
        let confidence: Vec<f64> = found
            .iter()
            .zip(&moved)
            .map(|(at, &z)| at.cosine.max(0.0).powi(2) * (-(at.position.distance(z) / (TRUSTED * size)).powi(2)).exp())
            .collect();
        let wanted: Vec<DVec3> = found.iter().zip(&moved).map(|(at, &z)| at.position - z).collect();
        let displacement = smoothness.displacements(&confidence, &wanted, length * size, &moved)?;
        moved.iter_mut().zip(displacement).for_each(|(z, d)| *z += d);
    }
    Ok(moved)
}

/// S and S M^-1 S of a mesh over one pattern, the lower triangle by column.
#[derive(Debug)]
struct Smoothness {
    mass: Vec<f64>,
    column_starts: Vec<usize>,
    rows: Vec<u32>,
    /// Entries of S and of S M^-1 S.
    values: Vec<[f64; 2]>,
}

impl Smoothness {
    fn new(positions: &[DVec3], triangles: &[[u32; 3]]) -> Result<Self> {
        let single: Vec<[f32; 3]> = positions.iter().map(|p| p.as_vec3().to_array()).collect();
        let mesh = TriMesh::new(&single, triangles, "target")?;
        let laplacian = Laplacian::new(&mesh, &Topology::new(triangles, single.len()));
        let used: Vec<f64> = (0..positions.len()).map(|i| laplacian.mass(i)).collect();
        let least = 1e-3 * median(used.iter().copied().filter(|&m| m > 0.0).collect());
        let mass: Vec<f64> = used.iter().map(|m| m.max(least)).collect();
        let columns: Vec<Vec<(u32, [f64; 2])>> =
            (0..positions.len() as u32).into_par_iter().map(|j| column(&laplacian, &mass, j)).collect();
        let mut all = Self { mass, column_starts: vec![0], rows: Vec::new(), values: Vec::new() };
        for entries in columns {
            all.rows.extend(entries.iter().map(|entry| entry.0));
            all.values.extend(entries.iter().map(|entry| entry.1));
            all.column_starts.push(all.rows.len());
        }
        Ok(all)
    }

    fn displacements(
        &self,
        confidence: &[f64],
        wanted: &[DVec3],
        length: f64,
        positions: &[DVec3],
    ) -> Result<Vec<DVec3>> {
        let l2 = length * length;
        let mut values: Vec<f64> = self.values.par_iter().map(|[s, b]| MEMBRANE * l2 * s + l2 * l2 * b).collect();
        let mut rhs = Vec::with_capacity(3 * wanted.len());
        for (j, (c, d)) in confidence.iter().zip(wanted).enumerate() {
            values[self.column_starts[j]] += self.mass[j] * (c + STAY);
            rhs.extend((self.mass[j] * c * *d).to_array());
        }
        let matrix = SymmetricMatrix { column_starts: self.column_starts.clone(), rows: self.rows.clone(), values };
        let guide: Vec<_> = positions.iter().map(|p| p.as_vec3()).collect();
        let factor =
            Cholesky::factor(matrix, &guide).map_err(|e| Error::NotPositiveDefinite { vertex: e.unknown })?;
        let solution = factor.solve(&RightHandSides::dense(wanted.len(), 3, rhs));
        let row = |i: usize| {
            let mut row = solution.row(i);
            DVec3::from_array(std::array::from_fn(|_| row.next().expect("three columns")))
        };
        Ok((0..wanted.len()).map(row).collect())
    }
}

/// Rows >= j of column j of S and S M^-1 S, ascending.
fn column(laplacian: &Laplacian, mass: &[f64], j: u32) -> Vec<(u32, [f64; 2])> {
    let row_of_s = |i: u32| {
        let (neighbours, cotangents) = laplacian.row(i as usize);
        let others = neighbours.iter().zip(cotangents).map(|(&k, &cotangent)| (k, -cotangent));
        std::iter::once((i, laplacian.diagonal(i as usize))).chain(others)
    };
    let mut entries: Vec<(u32, [f64; 2])> = row_of_s(j).map(|(i, s)| (i, [s, 0.0])).collect();
    for (a, s_ja) in row_of_s(j) {
        entries.extend(row_of_s(a).map(|(i, s_ai)| (i, [0.0, s_ja * s_ai / mass[a as usize]])));
    }
    entries.retain(|entry| entry.0 >= j);
    entries.sort_by_key(|entry| entry.0);
    entries.dedup_by(|next, kept| {
        let same = next.0 == kept.0;
        if same {
            kept.1 = [kept.1[0] + next.1[0], kept.1[1] + next.1[1]];
        }
        same
    });
    entries
}

fn median(mut values: Vec<f64>) -> f64 {
    if values.is_empty() {
        return 1.0;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}
