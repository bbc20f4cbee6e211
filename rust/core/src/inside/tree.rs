//! A binary tree of triangle clusters, complete: node k has the children 2k + 1 and 2k + 2, and all leaves are equally deep.

use std::ops::Range;

use glam::DVec3;
use rayon::prelude::*;

use super::moments::Moments;
use super::solid_angle::half_solid_angle;

/// Most triangles per leaf.
const LEAF: usize = 8;

/// Meshes with fewer triangles are sorted on one thread.
const FEW: usize = 4096;

#[derive(Debug)]
pub(super) struct Tree {
    nodes: Vec<Moments>,
    /// Sorted by leaf.
    triangles: Vec<[DVec3; 3]>,
    first_leaf: usize,
}

impl Tree {
    pub(super) fn new(mut triangles: Vec<[DVec3; 3]>) -> Self {
        let count = triangles.len();
        let leaves = count.div_ceil(LEAF).next_power_of_two();
        sort(&mut triangles, 0, count, leaves - 1);
        let first_leaf = leaves - 1;
        let mut nodes = vec![Moments::default(); 2 * leaves - 1];
        let leaf = |(k, node): (usize, &mut Moments)| *node = Moments::new(&triangles[range(first_leaf + k, count)]);
        nodes[first_leaf..].par_iter_mut().enumerate().for_each(leaf);
        for k in (0..first_leaf).rev() {
            nodes[k] = Moments::joined([&nodes[2 * k + 1], &nodes[2 * k + 2]]);
        }
        let measured = |(k, node): (usize, &mut Moments)| *node = node.with_radius(&triangles[range(k, count)]);
        nodes[..first_leaf].par_iter_mut().enumerate().for_each(measured);
        Self { nodes, triangles, first_leaf }
    }

    /// The winding number at `query`; `accuracy` says from how many radii on a cluster's far field stands for it.
    pub(super) fn winding(&self, query: DVec3, accuracy: f64) -> f64 {
        let (mut far, mut near) = (0.0, 0.0);
        let mut waiting = [0usize; 64];
        let mut count = 1;
        while count > 0 {
            count -= 1;
            let k = waiting[count];
            if let Some(winding) = self.nodes[k].winding(query, accuracy) {
                far += winding;
            } else if k < self.first_leaf {
                waiting[count..count + 2].copy_from_slice(&[2 * k + 2, 2 * k + 1]);
                count += 2;
            } else {
                let leaf = &self.triangles[range(k, self.triangles.len())];
                near += leaf.iter().map(|t| half_solid_angle(t.map(|x| x - query))).sum::<f64>();
            }
        }
        far + near / std::f64::consts::TAU
    }
}

/// Which of `count` triangles node `k` holds.
fn range(k: usize, count: usize) -> Range<usize> {
    let level = (k + 1).ilog2();
    let place = k + 1 - (1 << level);
    let bound = |place: usize| (place * count) >> level;
    bound(place)..bound(place + 1)
}

/// Orders the triangles of node `k`, of `count` in all, so that its descendants are compact: halves by the triangles'
/// middles along the widest axis.
fn sort(triangles: &mut [[DVec3; 3]], k: usize, count: usize, first_leaf: usize) {
    if k >= first_leaf {
        return;
    }
    let middle = |t: &[DVec3; 3]| t[0] + t[1] + t[2];
    let empty = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let (low, high) = triangles.iter().fold(empty, |(low, high), t| (low.min(middle(t)), high.max(middle(t))));
    let axis = (high - low).max_position();
    let half = range(2 * k + 1, count).len();
    triangles.select_nth_unstable_by(half, |s, t| middle(s)[axis].total_cmp(&middle(t)[axis]));
    let (left, right) = triangles.split_at_mut(half);
    if count < FEW {
        sort(left, 2 * k + 1, count, first_leaf);
        sort(right, 2 * k + 2, count, first_leaf);
    } else {
        rayon::join(|| sort(left, 2 * k + 1, count, first_leaf), || sort(right, 2 * k + 2, count, first_leaf));
    }
}
