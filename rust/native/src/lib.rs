//! The Python module `skinwright_native`: one file per operation, and this list.

mod arrays;
mod desparsify;
mod error;
mod job;
mod sculpt;
mod skinning;
mod transfer;
mod weights;

use pyo3::prelude::*;

/// Skinwright's numerics.
#[pymodule]
mod skinwright_native {
    #[pymodule_export]
    use crate::desparsify::desparsify;
    #[pymodule_export]
    use crate::error::{
        Cancelled, InvalidMesh, InvalidParameter, InvalidWeights, NotSolvable, NothingMatched, SkinwrightError,
    };
    #[pymodule_export]
    use crate::job::Job;
    #[pymodule_export]
    use crate::sculpt::{SculptSolver, Stroke, simplex_qp};
    #[pymodule_export]
    use crate::skinning::linear_blend;
    #[pymodule_export]
    use crate::transfer::{Inpainting, Source, Transfer, transfer_weights};
    #[pymodule_export]
    use crate::weights::Weights;
    use pyo3::prelude::*;

    /// The version of this module, equal to the add-on's.
    #[pyfunction]
    fn version() -> &'static str {
        env!("CARGO_PKG_VERSION")
    }
}
