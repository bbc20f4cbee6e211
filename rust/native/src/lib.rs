//! The Python module `skinwright_native`: one file per class or operation, and this list.

mod arrays;
mod autoskin;
mod biharmonic;
mod desparsify;
mod embed;
mod error;
mod fill;
mod inpainting;
mod job;
mod memory;
mod penetration;
mod ranges;
mod refine;
mod retarget;
mod sculpt;
mod settings;
mod skinning;
mod source;
mod transfer;
mod waiting;
mod weights;

use pyo3::prelude::*;

/// Skinwright's numerics.
#[pymodule]
mod skinwright_native {
    #[pymodule_export]
    use crate::autoskin::{AutoWeights, automatic_weights, start_automatic_weights};
    #[pymodule_export]
    use crate::biharmonic::biharmonic_embedding;
    #[pymodule_export]
    use crate::desparsify::desparsify;
    #[pymodule_export]
    use crate::embed::{Embedding, embed_skeleton, start_embed_skeleton};
    #[pymodule_export]
    use crate::error::{
        Cancelled, InvalidMesh, InvalidParameter, InvalidWeights, NotSolvable, NothingMatched, SkinwrightError,
    };
    #[pymodule_export]
    use crate::fill::fill;
    #[pymodule_export]
    use crate::inpainting::Inpainting;
    #[pymodule_export]
    use crate::job::Job;
    #[pymodule_export]
    use crate::memory::set_memory_budget;
    #[pymodule_export]
    use crate::penetration::penetration;
    #[pymodule_export]
    use crate::refine::{Refiner, intersecting_pairs};
    #[pymodule_export]
    use crate::retarget::{Retarget, retarget_weights, start_retarget_weights};
    #[pymodule_export]
    use crate::sculpt::{SculptSolver, Stroke, simplex_qp};
    #[pymodule_export]
    use crate::skinning::{dual_quaternion_blend, linear_blend};
    #[pymodule_export]
    use crate::source::{Source, transfer_weights};
    #[pymodule_export]
    use crate::transfer::Transfer;
    #[pymodule_export]
    use crate::weights::Weights;
    use pyo3::prelude::*;

    /// The version of this module, equal to the add-on's.
    #[pyfunction]
    fn version() -> &'static str {
        env!("CARGO_PKG_VERSION")
    }
}
