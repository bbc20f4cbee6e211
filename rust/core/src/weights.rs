//! Skin weights as a sparse matrix (CSR), the only form in which they cross a boundary.

use crate::error::{Error, Result};

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
            let vertex = indptr.partition_point(|&start| start as usize <= at) - 1;
            return Err(Error::WeightNotFinite { vertex, bone: bones[at] });
        }
        Ok(Self { indptr, bones, values, n_bones })
    }

    /// One list of (bone, weight) a vertex.
    pub(crate) fn from_rows<'r>(rows: impl Iterator<Item = &'r [(u32, f64)]>, n_bones: u32) -> Self {
        let mut out = Self { indptr: vec![0], n_bones, ..Self::default() };
        for row in rows {
            out.push_row(row);
        }
        out
    }

    pub(crate) fn push_row(&mut self, row: &[(u32, f64)]) {
        for &(bone, value) in row {
            self.bones.push(bone);
            self.values.push(value as f32);
        }
        self.indptr.push(self.bones.len() as u32);
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

    /// The arrays `(indptr, bones, values)`.
    pub fn into_arrays(self) -> (Vec<u32>, Vec<u32>, Vec<f32>) {
        (self.indptr, self.bones, self.values)
    }
}
