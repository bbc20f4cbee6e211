//! Skin weights as a sparse matrix (CSR), the only form in which they cross a boundary.

use rayon::prelude::*;

use crate::error::{Error, Result};

/// Rows a worker builds at a time.
const ROWS_A_RUN: usize = 4096;

/// Skin weights of V vertices over `n_bones` bones: row i holds the influences of vertex i.
///
/// A stored zero is a real membership (Blender keeps such members) and is never dropped silently.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Weights {
    indptr: Vec<u32>,
    bones: Vec<u32>,
    values: Vec<f32>,
    n_bones: u32,
}

impl Weights {
    /// Takes CSR arrays: `indptr` (V+1), `bones` and `values` (nnz).
    ///
    /// # Errors
    /// [`Error::InvalidWeights`] if the arrays do not fit together, [`Error::WeightNotFinite`].
    pub fn new(indptr: Vec<u32>, bones: Vec<u32>, values: Vec<f32>, n_bones: u32) -> Result<Self> {
        let invalid = |reason: String| Err(Error::InvalidWeights { reason });
        if indptr.first() != Some(&0) {
            return invalid("indptr must start with 0".into());
        }
        if indptr.windows(2).any(|w| w[0] > w[1]) {
            return invalid("indptr must not decrease".into());
        }
        let nnz = indptr[indptr.len() - 1] as usize;
        if bones.len() != nnz || values.len() != nnz {
            return invalid(format!(
                "indptr ends at {nnz}, but there are {} bones and {} values",
                bones.len(),
                values.len()
            ));
        }
        if let Some(&bone) = bones.iter().find(|&&j| j >= n_bones) {
            return invalid(format!("bone {bone} is out of range, there are {n_bones}"));
        }
        if let Some(at) = values.iter().position(|x| !x.is_finite()) {
            let bone = bones[at];
            let vertex = Self { indptr, bones, values, n_bones }.vertex_of_entry(at);
            return Err(Error::WeightNotFinite { vertex, bone });
        }
        Ok(Self { indptr, bones, values, n_bones })
    }

    /// Builds V rows in parallel: `row(state, i, out)` appends the influences of vertex i to `out`, in bone order.
    /// `state` is one worker's scratch memory; the answer must not depend on what an earlier row left in it.
    pub(crate) fn from_rows<S>(
        vertex_count: usize,
        n_bones: u32,
        state: impl Fn() -> S + Sync,
        row: impl Fn(&mut S, usize, &mut Vec<(u32, f32)>) + Sync,
    ) -> Self {
        let run = |k: usize| {
            let mut part = Self { indptr: Vec::with_capacity(ROWS_A_RUN), n_bones, ..Self::default() };
            let (mut state, mut influences) = (state(), Vec::new());
            for i in k * ROWS_A_RUN..((k + 1) * ROWS_A_RUN).min(vertex_count) {
                influences.clear();
                row(&mut state, i, &mut influences);
                part.bones.extend(influences.iter().map(|&(bone, _)| bone));
                part.values.extend(influences.iter().map(|&(_, value)| value));
                part.indptr.push(part.bones.len() as u32);
            }
            part
        };
        let parts: Vec<Self> = (0..vertex_count.div_ceil(ROWS_A_RUN)).into_par_iter().map(run).collect();
        Self::concatenate(parts, n_bones)
    }

    fn concatenate(parts: Vec<Self>, n_bones: u32) -> Self {
        let nnz = parts.iter().map(|part| part.bones.len()).sum();
        let mut indptr = Vec::with_capacity(parts.len() * ROWS_A_RUN + 1);
        let (mut bones, mut values) = (Vec::with_capacity(nnz), Vec::with_capacity(nnz));
        indptr.push(0);
        for part in parts {
            let offset = bones.len() as u32;
            indptr.extend(part.indptr.iter().map(|end| offset + end));
            bones.extend(part.bones);
            values.extend(part.values);
        }
        Self { indptr, bones, values, n_bones }
    }

    /// # Errors
    /// [`Error::WeightNegative`] with the first negative entry.
    pub fn check_not_negative(&self) -> Result<()> {
        self.values
            .iter()
            .position(|&x| x < 0.0)
            .map_or(Ok(()), |at| Err(Error::WeightNegative { vertex: self.vertex_of_entry(at), bone: self.bones[at] }))
    }

    fn vertex_of_entry(&self, at: usize) -> usize {
        self.indptr.partition_point(|&start| start as usize <= at) - 1
    }

    /// Number of vertices.
    pub fn vertex_count(&self) -> usize {
        self.indptr.len() - 1
    }

    /// Number of bones.
    pub fn n_bones(&self) -> u32 {
        self.n_bones
    }

    /// Row starts, (V+1).
    pub fn indptr(&self) -> &[u32] {
        &self.indptr
    }

    /// Bone of every entry, (nnz).
    pub fn bones(&self) -> &[u32] {
        &self.bones
    }

    /// Value of every entry, (nnz).
    pub fn values(&self) -> &[f32] {
        &self.values
    }

    /// Bones and values of vertex `i`.
    pub fn row(&self, i: usize) -> (&[u32], &[f32]) {
        let range = self.indptr[i] as usize..self.indptr[i + 1] as usize;
        (&self.bones[range.clone()], &self.values[range])
    }

    /// The rows of these indices, in their order.
    ///
    /// Panics if an index is out of range.
    pub fn take_rows(&self, rows: &[u32]) -> Self {
        Self::from_rows(
            rows.len(),
            self.n_bones,
            || (),
            |(), i, out| {
                let (bones, values) = self.row(rows[i] as usize);
                out.extend(std::iter::zip(bones, values).map(|(&bone, &value)| (bone, value)));
            },
        )
    }

    /// The arrays `(indptr, bones, values)`.
    pub fn into_arrays(self) -> (Vec<u32>, Vec<u32>, Vec<f32>) {
        (self.indptr, self.bones, self.values)
    }
}
