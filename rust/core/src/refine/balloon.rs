//! One volume for a whole joint: what sub-steps and membrane have lost is blown up again where nothing touches.

use glam::Vec3;
use rayon::prelude::*;

use super::coupling::{place, shift};
use super::holes::{Rim, fan};
use super::joints::Member;
use super::local::Local;

/// Rounds; each moves skin along its normals by what is still missing.
const ROUNDS: usize = 8;
/// Passes that fade the weight towards contacts and the ends of the region.
const FADING: usize = 8;
/// Rounds that keep the directions of the first of them.
const SAME_NORMALS: usize = 4;
/// Triangles that one task takes.
const RUN: usize = 2048;
/// Farthest that a round moves skin, in radii.
const STEP: f32 = 0.08;

/// The skin of one joint, its triangles and how much of the motion each vertex takes.
pub(super) struct Balloon {
    vertices: Vec<u32>,
    weights: Vec<f32>,
    triangles: Vec<[u32; 3]>,
    rims: Vec<Rim>,
}

impl Balloon {
    /// Over the free skin of `members`; `kept` are vertices that stay, as those in contact do.
    pub(super) fn new(local: &Local, members: &[Member], kept: &[u32]) -> Self {
        let mut balloon = Self::still(local, members);
        let mut weight = vec![0.0f32; local.particles.len()];
        balloon.vertices.iter().for_each(|&p| weight[p as usize] = 1.0);
        kept.iter().for_each(|&p| weight[p as usize] = 0.0);
        balloon.fade(local, &mut weight);
        balloon.weights = balloon.vertices.iter().map(|&p| weight[p as usize]).collect();
        balloon
    }

    /// The same to measure with: nothing of it can move.
    pub(super) fn still(local: &Local, members: &[Member]) -> Self {
        let vertices: Vec<u32> = members.iter().map(|m| m.particle).filter(|&p| local.is_surface(p)).collect();
        let mut is_member = vec![false; local.particles.len()];
        vertices.iter().for_each(|&p| is_member[p as usize] = true);
        let triangles = local.triangles.iter().filter(|t| t.iter().any(|&p| is_member[p as usize])).copied().collect();
        let rims =
            local.rims.iter().filter(|rim| rim.iter().any(|side| is_member[side[0] as usize])).cloned().collect();
        Self { vertices, weights: Vec::new(), triangles, rims }
    }

    /// Passes of means over the rings. What all of a ring agrees with stays as it is, so that only the borders between weights
    /// are visited, and one ring more with every pass.
    fn fade(&self, local: &Local, weight: &mut [f32]) {
        let mean = |weight: &[f32], p: u32| {
            let ring = local.ring(p);
            ring.iter().map(|&n| weight[n as usize]).sum::<f32>() / ring.len().max(1) as f32
        };
        let mut is_member = vec![false; local.particles.len()];
        self.vertices.iter().for_each(|&p| is_member[p as usize] = true);
        let differs = |p: &u32| local.ring(*p).iter().any(|&n| weight[n as usize] != weight[*p as usize]);
        let mut border: Vec<u32> = self.vertices.iter().copied().filter(differs).collect();
        for _ in 0..FADING {
            let faded: Vec<f32> = border.iter().map(|&p| mean(weight, p)).collect();
            border.iter().zip(faded).for_each(|(&p, w)| weight[p as usize] = w);
            border.iter().for_each(|&p| is_member[p as usize] = false);
            let from = border.len();
            for k in 0..from {
                for &n in local.ring(border[k]) {
                    if std::mem::take(&mut is_member[n as usize]) {
                        border.push(n);
                    }
                }
            }
        }
    }

    /// Six times the volume between the skin and `apex`. The ends of the region move rigidly about the joint, so that what
    /// they and the apex span does not change.
    pub(super) fn volume(&self, apex: Vec3, at: impl Fn(u32) -> Vec3 + Sync) -> f64 {
        let corner = |p: u32| (at(p) - apex).as_dvec3();
        let part = |&[a, b, c]: &[u32; 3]| corner(a).dot(corner(b).cross(corner(c)));
        let caps = self.rims.iter().flat_map(|rim| fan(rim, corner));
        let caps: f64 = caps.map(|[a, b, c]| a.dot(b.cross(c))).sum();
        // Sums of runs in their order: the same for any number of threads.
        let runs = self.triangles.par_chunks(RUN).map(|run| run.iter().map(part).sum());
        runs.collect::<Vec<f64>>().iter().sum::<f64>() + caps
    }

    /// Moves skin outwards (or inwards) until the volume is `target`; `limit` is applied after every round. Returns what is
    /// missing then.
    pub(super) fn inflate(
        &self,
        local: &mut Local,
        apex: Vec3,
        target: f64,
        radius: f32,
        mut limit: impl FnMut(&mut Local),
    ) -> f64 {
        let mut normals = vec![Vec3::ZERO; local.particles.len()];
        for round in 0..ROUNDS {
            let missing = target - self.volume(apex, |p| place(&local.particles[p as usize]));
            if missing.abs() < 1e-5 * target.abs() {
                return missing;
            }
            if round % SAME_NORMALS == 0 {
                self.normals(local, &mut normals);
            }
            let swept: f64 = self.sum(|p, w| f64::from(w * normals[p as usize].length()));
            let step = (missing / swept.max(1e-12)) as f32;
            let step = step.clamp(-STEP * radius, STEP * radius);
            for (&p, &w) in self.vertices.iter().zip(&self.weights) {
                shift(&mut local.particles[p as usize], normals[p as usize].normalize_or_zero() * (w * step));
            }
            limit(local);
        }
        target - self.volume(apex, |p| place(&local.particles[p as usize]))
    }

    /// Sums of the doubled areas around each vertex.
    fn normals(&self, local: &Local, normals: &mut [Vec3]) {
        self.vertices.iter().for_each(|&p| normals[p as usize] = Vec3::ZERO);
        for t in &self.triangles {
            let [a, b, c] = t.map(|p| place(&local.particles[p as usize]));
            let doubled = (b - a).cross(c - a);
            t.iter().for_each(|&p| normals[p as usize] += doubled);
        }
    }

    fn sum(&self, term: impl Fn(u32, f32) -> f64) -> f64 {
        self.vertices.iter().zip(&self.weights).map(|(&p, &w)| term(p, w)).sum()
    }
}
