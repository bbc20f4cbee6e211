//! What the two ways of substitution through the tree share, forward from the leaves and backward from the root.

use crate::fronts::blocks::{BLOCK, panel_len};
use crate::fronts::tree::Front;

/// Work of a front (multiplications) worth a second thread.
pub(crate) const FORK: usize = 1 << 19;
/// Row blocks solved on one thread before the rest makes use of them.
pub(crate) const PIVOT_BLOCKS: usize = 16;

/// The row blocks of the panel at the start of `panels`, those of its triangle first.
pub(crate) fn row_blocks<'a, R>(panels: &'a [R], front: &Front) -> Vec<&'a [R]> {
    let k = front.columns;
    let mut panel = &panels[..panel_len(k, front.rows.len())];
    let mut blocks = Vec::with_capacity(k.div_ceil(BLOCK) + front.rows.len().div_ceil(BLOCK));
    for start in (0..k).step_by(BLOCK) {
        let (block, rest) = panel.split_at(BLOCK * k.min(start + BLOCK));
        blocks.push(block);
        panel = rest;
    }
    blocks.extend(panel.chunks_exact((BLOCK * k).max(1)));
    blocks
}
