//! Visiting points in an order that keeps neighbours together.

use glam::Vec3;
use rayon::prelude::*;

/// Indices of `points` along a Morton curve with 1024 cells a side over their bounding box.
pub(crate) fn order(points: &[[f32; 3]]) -> Vec<u32> {
    let empty = || (Vec3::INFINITY, Vec3::NEG_INFINITY);
    let join = |x: (Vec3, Vec3), y: (Vec3, Vec3)| (x.0.min(y.0), x.1.max(y.1));
    let extend = |x: (Vec3, Vec3), &p: &[f32; 3]| join(x, (p.into(), p.into()));
    let (low, high) = points.par_iter().with_min_len(4096).fold(empty, extend).reduce(empty, join);

    let cells_per_unit = 1023.0 / (high - low).max_element().max(f32::MIN_POSITIVE);
    let key = |(i, &p): (usize, &[f32; 3])| {
        let [x, y, z] = ((Vec3::from(p) - low) * cells_per_unit).to_array().map(|x| spread(x as u32));
        u64::from(x | y << 1 | z << 2) << 32 | i as u64
    };
    let mut keys: Vec<u64> = points.par_iter().with_min_len(4096).enumerate().map(key).collect();
    keys.par_sort_unstable();
    keys.into_iter().map(|key| key as u32).collect()
}

/// Moves the lowest ten bits of `x` three places apart.
fn spread(x: u32) -> u32 {
    let x = x.min(1023);
    let x = (x | x << 16) & 0x0300_00ff;
    let x = (x | x << 8) & 0x0300_f00f;
    let x = (x | x << 4) & 0x030c_30c3;
    (x | x << 2) & 0x0924_9249
}
