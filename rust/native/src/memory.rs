//! Memory: large work is estimated first, and refused with the estimate where it does not fit. Rust ends the process
//! when memory is refused to it, so nothing large begins that cannot be had.

use std::sync::atomic::{AtomicU64, Ordering};

use pyo3::exceptions::PyMemoryError;
use pyo3::prelude::*;

/// Bytes that one piece of work may take; `u64::MAX` for whatever the machine has.
static BUDGET: AtomicU64 = AtomicU64::new(u64::MAX);

/// What any work takes beside that, in addresses rather than pages: stacks and heaps of threads, small buffers.
const ANY_WORK: u64 = 96 << 20;

/// Says how many bytes one piece of work may take, None for whatever the machine has. Work that is estimated at more is
/// refused with a MemoryError.
#[pyfunction]
#[pyo3(signature = (bytes))]
pub fn set_memory_budget(bytes: Option<u64>) {
    BUDGET.store(bytes.unwrap_or(u64::MAX), Ordering::Relaxed);
}

/// Raises MemoryError unless `bytes` are within the budget and can be had now.
pub fn expect(work: &str, bytes: u64) -> PyResult<()> {
    let megabytes = bytes.div_ceil(1 << 20);
    let budget = BUDGET.load(Ordering::Relaxed);
    if bytes > budget {
        let allowed = budget >> 20;
        return Err(PyMemoryError::new_err(format!(
            "{work} would take about {megabytes} MiB of memory, and {allowed} are allowed: use a smaller mesh, close \
             other programs, or allow more in the preferences"
        )));
    }
    let total = usize::try_from(bytes.saturating_add(ANY_WORK)).unwrap_or(usize::MAX);
    Vec::<u8>::new().try_reserve_exact(total).map_err(|_| {
        PyMemoryError::new_err(format!(
            "{work} would take about {megabytes} MiB of memory, which this machine does not have free: use a smaller \
             mesh or close other programs"
        ))
    })
}

/// Of a source with its search tree: vertices and triangles.
pub fn of_source(vertices: usize, triangles: usize) -> u64 {
    200 * vertices as u64 + 250 * triangles as u64
}

/// Of a target whose vertices have found their closest points.
pub fn of_target(vertices: usize, triangles: usize) -> u64 {
    250 * vertices as u64 + 100 * triangles as u64
}

/// Of solving `unknowns` of `vertices`: measured 85 to 235 bytes per unknown and binary digit of their number (grids of
/// 10,000 to 490,000 vertices, 20 to 200 bones), the rows that come out included.
pub fn of_solve(vertices: usize, unknowns: usize) -> u64 {
    let digits = u64::from(usize::BITS - unknowns.leading_zeros());
    150 * vertices as u64 + 260 * unknowns as u64 * digits
}

/// Of a sculpt solver: candidates, bone matrices and what each vertex was sculpted to.
pub fn of_sculpt(vertices: usize) -> u64 {
    700 * vertices as u64
}

/// Of desparsification to `n` members.
pub fn of_desparsify(vertices: usize, n: usize) -> u64 {
    200 * vertices as u64 + 100 * vertices as u64 * n as u64
}
