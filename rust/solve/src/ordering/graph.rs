//! A symmetric matrix seen by whole rows, from its stored lower half.

use crate::SymmetricMatrix;

/// The matrix and the transpose of its strictly lower half.
pub(crate) struct Graph<'m> {
    matrix: &'m SymmetricMatrix,
    row_starts: Vec<usize>,
    columns: Vec<u32>,
    values: Vec<f64>,
}

impl<'m> Graph<'m> {
    pub(crate) fn new(matrix: &'m SymmetricMatrix) -> Self {
        let n = matrix.size();
        let mut row_starts = vec![0usize; n + 2];
        for j in 0..n {
            for &i in below_diagonal(matrix, j).0 {
                row_starts[i as usize + 2] += 1;
            }
        }
        for i in 2..n + 2 {
            row_starts[i] += row_starts[i - 1];
        }
        let mut columns = vec![0; row_starts[n + 1]];
        let mut values = vec![0.0; row_starts[n + 1]];
        for j in 0..n {
            let (rows, entries) = below_diagonal(matrix, j);
            for (&i, &value) in rows.iter().zip(entries) {
                let slot = &mut row_starts[i as usize + 1];
                columns[*slot] = j as u32;
                values[*slot] = value;
                *slot += 1;
            }
        }
        Self { matrix, row_starts, columns, values }
    }

    /// Unknowns coupled to unknown `i`, without itself.
    pub(crate) fn neighbours(&self, i: usize) -> impl Iterator<Item = usize> {
        let before = &self.columns[self.row_starts[i]..self.row_starts[i + 1]];
        before.iter().chain(below_diagonal(self.matrix, i).0).map(|&j| j as usize)
    }

    /// The same with the entries' values.
    pub(crate) fn entries(&self, i: usize) -> impl Iterator<Item = (usize, f64)> {
        let before = self.row_starts[i]..self.row_starts[i + 1];
        let (rows, values) = below_diagonal(self.matrix, i);
        let before = self.columns[before.clone()].iter().zip(&self.values[before]);
        before.chain(rows.iter().zip(values)).map(|(&j, &value)| (j as usize, value))
    }

    pub(crate) fn diagonal(&self, i: usize) -> f64 {
        self.matrix.diagonal(i)
    }
}

/// Rows and values of column `j` under its diagonal.
fn below_diagonal(matrix: &SymmetricMatrix, j: usize) -> (&[u32], &[f64]) {
    let entries = matrix.column_starts[j] + 1..matrix.column_starts[j + 1];
    (&matrix.rows[entries.clone()], &matrix.values[entries])
}
