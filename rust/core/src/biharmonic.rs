//! Biharmonic distances on a surface, from the truncated spectrum of its Laplacian.
//!
//! Lipman, Rustamov and Funkhouser, Biharmonic distance, ACM Transactions on Graphics 29(3), 2010,
//! doi:10.1145/1805964.1805971: `d(x, y)^2 = sum over k of (phi_k(x) - phi_k(y))^2 / lambda_k^2`, with the eigenpairs of the
//! Laplace-Beltrami operator. The columns `phi_k / lambda_k` are coordinates in which that is the Euclidean distance.

use glam::Vec3;
use rayon::prelude::*;
use skinwright_solve::SymmetricMatrix;
use skinwright_solve::eigen::{NoEigenpairs, smallest_eigenpairs};

use crate::adjacency::{NONE, Topology};
use crate::error::{Error, Result};
use crate::laplacian::Laplacian;
use crate::mesh::TriMesh;
use crate::progress::Progress;

/// Coordinates in which the Euclidean distance is the biharmonic one, each island by itself.
#[derive(Debug, Clone, PartialEq)]
pub struct BiharmonicEmbedding {
    columns: usize,
    values: Vec<f64>,
}

impl BiharmonicEmbedding {
    /// Computes the `n_pairs` smallest eigenpairs of each island that are not constant. An island with fewer vertices has
    /// fewer; what is missing is zero, and so is the row of a vertex without a triangle.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] if `n_pairs` is zero, [`Error::NotPositiveDefinite`], [`Error::Cancelled`].
    pub fn new(mesh: &TriMesh<'_>, n_pairs: usize, progress: &Progress) -> Result<Self> {
        if n_pairs == 0 {
            return Err(Error::InvalidParameter { name: "n_pairs", value: 0.0, must: "it must be at least 1" });
        }
        let topology = Topology::new(mesh.triangles(), mesh.vertex_count());
        let laplacian = Laplacian::new(mesh, &topology);
        let mut members = vec![Vec::new(); topology.islands.count()];
        for (i, &island) in topology.islands.of_vertex().iter().enumerate().filter(|&(_, &island)| island != NONE) {
            members[island as usize].push(i as u32);
        }
        let mut embedding = Self { columns: n_pairs, values: vec![0.0; n_pairs * mesh.vertex_count()] };
        let mut done = 0;
        for island in &members {
            let share = island.len() as f64 / mesh.vertex_count() as f64;
            let watch = |part: f64| {
                progress.report(done as f64 / mesh.vertex_count() as f64 + share * part);
                progress.check().is_ok()
            };
            embedding.fill(mesh, &laplacian, island, &watch)?;
            done += island.len();
        }
        Ok(embedding)
    }

    /// Number of coordinates.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Coordinates `phi_k / lambda_k` of vertex `i`.
    pub fn row(&self, i: usize) -> &[f64] {
        &self.values[i * self.columns..][..self.columns]
    }

    /// The same with the row of vertex `of[i]` for vertex i.
    pub fn at(&self, of: &[u32]) -> Self {
        let values = of.iter().flat_map(|&i| self.row(i as usize)).copied().collect();
        Self { columns: self.columns, values }
    }

    /// All coordinates, (V, columns) row-major.
    pub fn into_values(self) -> Vec<f64> {
        self.values
    }

    /// Biharmonic distance of two vertices of one island.
    pub fn distance(&self, i: usize, j: usize) -> f64 {
        self.row(i).iter().zip(self.row(j)).map(|(x, y)| (x - y) * (x - y)).sum::<f64>().sqrt()
    }

    /// Distances of all vertices from some (L), (V, L) row-major: the features of a vertex in surface matching.
    pub fn distances_from(&self, landmarks: &[u32]) -> Vec<f64> {
        let count = self.values.len() / self.columns;
        let row = |i: usize| landmarks.iter().map(move |&j| self.distance(i, j as usize)).collect::<Vec<f64>>();
        (0..count).into_par_iter().flat_map_iter(row).collect()
    }

    fn fill(
        &mut self,
        mesh: &TriMesh<'_>,
        laplacian: &Laplacian,
        island: &[u32],
        watch: &dyn Fn(f64) -> bool,
    ) -> Result<()> {
        let (stiffness, mass) = system(laplacian, island);
        let positions: Vec<Vec3> = island.iter().map(|&i| mesh.positions()[i as usize].into()).collect();
        let pairs = smallest_eigenpairs(&stiffness, &mass, &positions, self.columns + 1, watch);
        let pairs = pairs.map_err(|problem| match problem {
            NoEigenpairs::Stopped => Error::Cancelled,
            NoEigenpairs::NotPositive(e) => Error::NotPositiveDefinite { vertex: island[e.unknown] as usize },
        })?;
        let count = pairs.values.len();
        for (&i, vectors) in island.iter().zip(pairs.vectors.chunks_exact(count)) {
            let row = &mut self.values[i as usize * self.columns..][..self.columns];
            // The first pair is the constant.
            for (x, (phi, lambda)) in row.iter_mut().zip(vectors.iter().zip(&pairs.values).skip(1)) {
                *x = if *lambda > 0.0 { phi / lambda } else { 0.0 };
            }
        }
        Ok(())
    }
}

/// S and M of an island, its vertices numbered in order.
fn system(laplacian: &Laplacian, island: &[u32]) -> (SymmetricMatrix, Vec<f64>) {
    let mut matrix = SymmetricMatrix { column_starts: vec![0], ..Default::default() };
    for (k, &i) in island.iter().enumerate() {
        matrix.rows.push(k as u32);
        matrix.values.push(laplacian.diagonal(i as usize));
        let (neighbours, cotangents) = laplacian.row(i as usize);
        for (&j, &cotangent) in neighbours.iter().zip(cotangents).filter(|&(&j, _)| j > i) {
            matrix.rows.push(island.binary_search(&j).expect("neighbours share an island") as u32);
            matrix.values.push(-cotangent);
        }
        matrix.column_starts.push(matrix.rows.len());
    }
    (matrix, island.iter().map(|&i| laplacian.mass(i as usize)).collect())
}
