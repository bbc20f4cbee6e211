//! Step 3, optional: Jacobi smoothing around the inpainted vertices (paper, end of section 3.3).

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use crate::error::Result;
use crate::laplacian::Laplacian;
use crate::mesh::TriMesh;
use crate::progress::Progress;
use crate::weights::Weights;

/// Shares of a row below this are rounding noise beside the f32 that stores them, and are dropped.
const NEGLIGIBLE: f64 = 1e-7;

/// The vertices that smoothing may change (V): every `unmatched` one, and the matched ones within `reach` of one along
/// edges (world units, shortest edge path).
pub fn region(mesh: &TriMesh<'_>, laplacian: &Laplacian, unmatched: &[bool], reach: f64) -> Vec<bool> {
    let mut distance: Vec<f64> = unmatched.iter().map(|&u| if u { 0.0 } else { f64::INFINITY }).collect();
    let touches_matched = |i: &u32| laplacian.neighbours(*i as usize).iter().any(|&j| !unmatched[j as usize]);
    let starts = (0..unmatched.len() as u32).filter(|&i| unmatched[i as usize]).filter(touches_matched);
    // Distances are not negative, so their bits order as they do.
    let mut queue: BinaryHeap<Reverse<(u64, u32)>> = starts.map(|i| Reverse((0, i))).collect();
    while let Some(Reverse((bits, i))) = queue.pop() {
        let so_far = f64::from_bits(bits);
        if so_far > distance[i as usize] {
            continue;
        }
        for &j in laplacian.neighbours(i as usize) {
            let length = so_far + mesh.position(i).distance(mesh.position(j));
            if length <= reach && length < distance[j as usize] {
                distance[j as usize] = length;
                queue.push(Reverse((length.to_bits(), j)));
            }
        }
    }
    distance.into_iter().map(f64::is_finite).collect()
}

/// `iterations` passes of `w_i <- (1 - factor) w_i + factor * mean of the neighbours' w` over the vertices of `region`.
/// Rows that are empty stay empty and count for nothing.
///
/// # Errors
/// [`Error::Cancelled`](crate::Error::Cancelled).
pub fn smooth(
    mut weights: Weights,
    laplacian: &Laplacian,
    region: &[bool],
    iterations: u32,
    factor: f64,
    progress: &Progress,
) -> Result<Weights> {
    for _ in 0..iterations {
        progress.check()?;
        let smoother = pass(&weights, laplacian, region, factor);
        // Further passes change nothing either.
        if smoother == weights {
            break;
        }
        weights = smoother;
    }
    Ok(weights)
}

fn pass(weights: &Weights, laplacian: &Laplacian, region: &[bool], factor: f64) -> Weights {
    Weights::from_rows(
        region.len(),
        weights.n_bones(),
        || Accumulator::new(weights.n_bones()),
        |sum, i, out| {
            let own = weights.row(i);
            let neighbours = laplacian.neighbours(i);
            if !region[i] || own.0.is_empty() || neighbours.is_empty() {
                out.extend(std::iter::zip(own.0, own.1).map(|(&bone, &value)| (bone, value)));
                return;
            }
            sum.add(own, 1.0 - factor);
            for &j in neighbours {
                sum.add(weights.row(j as usize), factor / neighbours.len() as f64);
            }
            sum.drain_normalised(out);
        },
    )
}

/// A dense row of bones that remembers which 64-bone words it touched, so that draining is in bone order and cheap.
struct Accumulator {
    values: Vec<f64>,
    touched: Vec<u64>,
    row: Vec<(u32, f64)>,
}

impl Accumulator {
    fn new(n_bones: u32) -> Self {
        let words = (n_bones as usize).div_ceil(64);
        Self { values: vec![0.0; n_bones as usize], touched: vec![0; words], row: Vec::new() }
    }

    fn add(&mut self, (bones, values): (&[u32], &[f32]), scale: f64) {
        for (&bone, &value) in std::iter::zip(bones, values) {
            self.values[bone as usize] += scale * f64::from(value);
            self.touched[bone as usize / 64] |= 1 << (bone % 64);
        }
    }

    /// Appends the row, divided by its sum, in bone order, and forgets it.
    fn drain_normalised(&mut self, out: &mut Vec<(u32, f32)>) {
        self.row.clear();
        for word in 0..self.touched.len() {
            let mut bits = std::mem::take(&mut self.touched[word]);
            while bits != 0 {
                let bone = word * 64 + bits.trailing_zeros() as usize;
                self.row.push((bone as u32, std::mem::take(&mut self.values[bone])));
                bits &= bits - 1;
            }
        }
        push_normalised(&self.row, out);
    }
}

/// Appends the positive part of `row` divided by its sum, without negligible shares. Nothing where no share is positive.
pub(super) fn push_normalised(row: &[(u32, f64)], out: &mut Vec<(u32, f32)>) {
    let sum: f64 = row.iter().map(|&(_, value)| value.max(0.0)).sum();
    let kept = |&(bone, value): &(u32, f64)| (value > NEGLIGIBLE * sum).then(|| (bone, (value / sum) as f32));
    out.extend(row.iter().filter_map(kept));
}
