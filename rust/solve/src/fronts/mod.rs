//! The factorisation over the tree of fronts, and the memory it lives in.

pub(crate) mod blocks;
pub(crate) mod buffer;
pub(crate) mod extend_add;
pub(crate) mod factor;
pub(crate) mod multifrontal;
pub(crate) mod tree;
pub(crate) mod walk;
