//! Forward and backward substitution through the tree of fronts, for many right-hand sides.

pub(crate) mod backward;
pub(crate) mod columns;
pub(crate) mod forward;
pub(crate) mod rows;
pub(crate) mod solution;
pub(crate) mod sparse;
pub(crate) mod substitution;
