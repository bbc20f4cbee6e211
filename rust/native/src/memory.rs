//! Memory: large work is estimated first, and refused with the estimate where it does not fit. Rust ends the process
//! when memory is refused to it, so nothing large begins that cannot be had.

use std::sync::atomic::{AtomicU64, Ordering};

use glam::DVec3;
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

/// Raises MemoryError unless an argument of so many bytes can be copied: Rust ends the process where it cannot.
pub fn expect_copies(bytes: u64) -> PyResult<()> {
    let total = usize::try_from(bytes.saturating_mul(3).saturating_add(1 << 20)).unwrap_or(usize::MAX);
    Vec::<u8>::new().try_reserve_exact(total).map_err(|_| {
        let megabytes = bytes.div_ceil(1 << 20);
        PyMemoryError::new_err(format!("an array of {megabytes} MiB cannot be copied: close other programs"))
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

/// Of automatic weights over `bones` bones: measured 1,800 bytes per vertex (grids of 3,600 to 160,000), and 6 per bone and
/// cell of the box around the mesh.
pub fn of_automatic(positions: &[[f32; 3]], resolution: f64, bones: usize) -> u64 {
    let (size, diagonal) = extent(positions);
    let cells = cells(size, diagonal / resolution).min(2e7) as u64;
    2_000 * positions.len() as u64 + cells * (40 + 8 * bones as u64)
}

/// Of embedding a skeleton, whose places are found on a lattice of the inside, from a character of `donor` vertices or none.
pub fn of_embedding(vertices: usize, donor: usize) -> u64 {
    (64 << 20) + 1_000 * vertices as u64 + 3_000 * donor as u64
}

/// Of retargeting: measured 1,000 to 2,200 bytes per vertex of both characters, and 20 to 40 more per eigenpair.
pub fn of_retarget(source: usize, target: usize, pairs: usize) -> u64 {
    2_500 * (source + target) as u64 + 40 * pairs as u64 * (source + target) as u64
}

/// Of a refiner: measured 1,000 bytes per vertex and 470 per tetrahedron, of which there are 12 to a cell.
pub fn of_refiner(positions: &[[f32; 3]], triangles: &[[u32; 3]], cell: Option<f64>) -> u64 {
    let cell = cell.unwrap_or(extent(positions).1 * 0.015);
    let within = |t: &&[u32; 3]| t.iter().all(|&i| (i as usize) < positions.len());
    let corner = |i: u32| DVec3::from(positions[i as usize].map(f64::from));
    let (mut volume, mut area) = (0.0, 0.0);
    for t in triangles.iter().filter(within) {
        let [a, b, c] = t.map(corner);
        volume += a.dot(b.cross(c)) / 6.0;
        area += (b - a).cross(c - a).length() / 2.0;
    }
    let cells = volume.abs() / cell.powi(3) + 1.5 * area / cell.powi(2);
    1_500 * positions.len() as u64 + (6_000.0 * cells.min(1e12)) as u64
}

/// Of a solve for `columns` values per vertex, none of which needs to be known.
pub fn of_fill(vertices: usize, columns: usize) -> u64 {
    of_solve(vertices, vertices) + 40 * vertices as u64 * columns as u64
}

/// Of depths of `points` in as many poses as are given, below a surface of so many triangles.
pub fn of_penetration(points: usize, poses: usize, triangles: usize) -> u64 {
    8 * points as u64 * poses as u64 + 500 * triangles as u64
}

/// Of posing, which makes a copy of positions and weights.
pub fn of_skinning(vertices: usize) -> u64 {
    120 * vertices as u64
}

/// Of a look for intersections.
pub fn of_pairs(triangles: usize) -> u64 {
    400 * triangles as u64
}

/// Size of the bounding box and length of its diagonal; nothing if a position is not finite.
fn extent(positions: &[[f32; 3]]) -> (DVec3, f64) {
    let places = positions.iter().map(|&p| DVec3::from(p.map(f64::from)));
    let empty = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let (low, high) = places.fold(empty, |(low, high), p| (low.min(p), high.max(p)));
    let size = high - low;
    if size.is_finite() { (size, size.length()) } else { (DVec3::ZERO, 0.0) }
}

/// Cubes of an edge in a box; there is always one.
fn cells(size: DVec3, edge: f64) -> f64 {
    let along = |length: f64| if edge > 0.0 { length / edge + 3.0 } else { 1.0 };
    along(size.x) * along(size.y) * along(size.z)
}
