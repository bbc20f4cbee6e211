//! The problem of one vertex.

use glam::{DAffine3, DVec3};
use rayon::prelude::*;

use super::{MAX_MEMBERS, SculptSolver, SimplexQp};
use crate::skinning::LEAST_TOTAL_WEIGHT;

/// What the guard poses ask of every vertex: sum of alpha E'E over its members, lower triangles packed by row.
///
/// Empty until the first guard.
#[derive(Debug, Clone, Default)]
pub(super) struct Guards {
    starts: Vec<usize>,
    packed: Vec<f64>,
}

impl Guards {
    /// Adds the pose's E'E to every vertex, the target being where the vertex now lies in it.
    pub(super) fn hold(&mut self, solver: &SculptSolver, pose_from_rest: &[DAffine3], alpha: f64) {
        if self.starts.is_empty() {
            self.starts = std::iter::once(0)
                .chain((0..solver.vertex_count()).scan(0, |end, i| {
                    *end += packed_length(solver.range(i).len());
                    Some(*end)
                }))
                .collect();
            self.packed = vec![0.0; self.starts[solver.vertex_count()]];
        }
        let mut rest = self.packed.as_mut_slice();
        let mut triangles = Vec::with_capacity(solver.vertex_count());
        for window in self.starts.windows(2) {
            let (triangle, after) = rest.split_at_mut(window[1] - window[0]);
            triangles.push(triangle);
            rest = after;
        }
        triangles.into_par_iter().enumerate().with_min_len(1024).for_each(|(i, triangle)| {
            let (bones, values) = solver.row(i);
            let target =
                crate::skinning::blended_transform(bones, values, pose_from_rest).transform_point3(solver.rest[i]);
            let mut offsets = [DVec3::ZERO; MAX_MEMBERS];
            solver.offsets(i, solver.rest[i], pose_from_rest, target, &mut offsets);
            let pairs = (0..bones.len()).flat_map(|a| (0..=a).map(move |b| (a, b)));
            for (entry, (a, b)) in triangle.iter_mut().zip(pairs) {
                *entry += alpha * offsets[a].dot(offsets[b]);
            }
        });
    }

    fn entry(&self, i: usize, a: usize, b: usize) -> f64 {
        self.starts.get(i).map_or(0.0, |start| self.packed[start + packed_length(a.max(b)) + a.min(b)])
    }
}

fn packed_length(n: usize) -> usize {
    n * (n + 1) / 2
}

impl SculptSolver {
    /// E of one pose: where each member alone would take vertex `i`, from `target`, in rest diagonals.
    fn offsets(&self, i: usize, rest: DVec3, pose_from_rest: &[DAffine3], target: DVec3, offsets: &mut [DVec3]) {
        for (offset, &bone) in offsets.iter_mut().zip(&self.bones[self.range(i)]) {
            *offset = (pose_from_rest[bone as usize].transform_point3(rest) - target) / self.diagonal;
        }
    }

    /// The weights of vertex `i`, in the order of its members, that best meet its targets and guards when it rests at
    /// `rest` and had the weights `values` before.
    pub(super) fn solve_vertex(&self, i: usize, rest: DVec3, values: &[f32]) -> [f32; MAX_MEMBERS] {
        if values.len() <= 4 {
            self.solve_members::<4>(i, rest, values)
        } else {
            self.solve_members::<MAX_MEMBERS>(i, rest, values)
        }
    }

    fn solve_members<const N: usize>(&self, i: usize, rest: DVec3, values: &[f32]) -> [f32; MAX_MEMBERS] {
        let mut solved = [0.0; MAX_MEMBERS];
        solved[..values.len()].copy_from_slice(values);
        let total: f64 = values.iter().map(|&x| f64::from(x)).sum();
        let members = FreeFirst::<N>::of(self.row(i).0, &self.locked);
        let mut w = members.order.map(|a| values.get(a).map_or(0.0, |&x| f64::from(x) / total));
        let mass: f64 = w[..members.free].iter().sum();
        // An unweighted vertex is not skinned, and has no feasible weights to start from.
        if total <= LEAST_TOTAL_WEIGHT || mass <= 0.0 {
            return solved;
        }
        let h = self.quadratic(i, rest, &members);
        self.minimise(h, &members, mass, &mut w);
        // A row that holds a locked weight keeps its sum, or the locked share would change.
        let sum = if members.free < members.len { total } else { 1.0 };
        for (&a, &x) in members.order[..members.free].iter().zip(&w) {
            solved[a] = (x * sum) as f32;
        }
        solved
    }

    /// H = sum of alpha E'E over targets and guards, members free ones first.
    fn quadratic<const N: usize>(&self, i: usize, rest: DVec3, members: &FreeFirst<N>) -> [[f64; N]; N] {
        let order = &members.order;
        let held = |a: usize, b: usize| self.guards.entry(i, order[a], order[b]);
        let is_member = |a: usize| a < members.len;
        let mut h: [[f64; N]; N] = std::array::from_fn(|a| {
            std::array::from_fn(|b| if is_member(a) && is_member(b) { held(a, b) } else { 0.0 })
        });
        for target in &self.targets[i] {
            let pose = &self.poses[target.pose];
            let mut offsets = [DVec3::ZERO; N];
            self.offsets(i, rest, &pose.pose_from_rest, target.position, &mut offsets);
            let e = order.map(|a| offsets[a]);
            for (row, e_a) in h.iter_mut().zip(e) {
                row.iter_mut().zip(e).for_each(|(entry, e_b)| *entry += pose.alpha * e_a.dot(e_b));
            }
        }
        h
    }

    /// Proximal passes over the free members; the locked ones only shift the linear term.
    fn minimise<const N: usize>(&self, h: [[f64; N]; N], members: &FreeFirst<N>, mass: f64, w: &mut [f64; N]) {
        let pull = self.options.kappa * self.options.kappa;
        let locked = members.free..members.len;
        let shift: [f64; N] = std::array::from_fn(|a| locked.clone().map(|b| -h[a][b] * w[b]).sum());
        let mut qp = SimplexQp { h, g: shift, n: members.free, mass };
        (0..N).for_each(|a| qp.h[a][a] += pull);
        w[locked].fill(0.0);
        for _ in 0..self.options.passes {
            qp.g = std::array::from_fn(|a| shift[a] + pull * w[a]);
            qp.minimise(w);
        }
    }
}

/// The members of a vertex by position in its row, those that may change first.
struct FreeFirst<const N: usize> {
    order: [usize; N],
    free: usize,
    len: usize,
}

impl<const N: usize> FreeFirst<N> {
    fn of(bones: &[u32], locked: &[bool]) -> Self {
        let mut members = Self { order: std::array::from_fn(|a| a), free: 0, len: bones.len().min(N) };
        for a in 0..members.len {
            if !locked[bones[a] as usize] {
                members.order[..=a].rotate_right(1);
                members.free += 1;
            }
        }
        members.order[..members.free].reverse();
        members
    }
}
