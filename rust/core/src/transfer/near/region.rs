//! How far the change of a stroke reaches.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use crate::fill::{Constraint, Fill};
use crate::transfer::pipeline::Problem;

/// How far a change is followed, in lengths over which it falls to a third.
const REACH: f64 = 8.0;
/// No such length counts for more than this share of the source's size: what is trusted over more has little say.
const LONGEST: f64 = 0.1;
/// Most vertices that are solved near a stroke.
pub(super) const MOST: usize = 15_000;

/// The vertices that are solved again.
pub(super) struct Region {
    pub vertices: Vec<u32>,
    /// (V)
    pub contains: Vec<bool>,
}

impl Region {
    /// The vertices near the `changed` ones, the nearest first; `size` is the source's.
    pub fn around(fill: &Fill, problem: &Problem, changed: &[u32], size: f64) -> Self {
        let (mesh, laplacian) = (fill.mesh(), fill.laplacian());
        let rate = |i: usize| {
            let confidence = if let Constraint::Soft(confidence) = problem.constraints[i] { confidence } else { 0.0 };
            (confidence / laplacian.mass(i).max(f64::MIN_POSITIVE)).sqrt().max(1.0 / (LONGEST * size))
        };
        let mut distance = vec![f64::INFINITY; problem.constraints.len()];
        let mut region = Self { vertices: Vec::new(), contains: vec![false; distance.len()] };
        changed.iter().for_each(|&i| distance[i as usize] = 0.0);
        // Distances are not negative, so their bits order as they do.
        let mut queue: BinaryHeap<Reverse<(u64, u32)>> = changed.iter().map(|&i| Reverse((0, i))).collect();
        while let Some(Reverse((bits, i))) = queue.pop() {
            if std::mem::replace(&mut region.contains[i as usize], true) {
                continue;
            }
            region.vertices.push(i);
            if region.vertices.len() == MOST {
                break;
            }
            for &j in laplacian.neighbours(i as usize) {
                let length = mesh.position(i).distance(mesh.position(j));
                let there = f64::from_bits(bits) + length * (rate(i as usize) + rate(j as usize)) / 2.0;
                let is_open = problem.constraints[j as usize] != Constraint::Fixed;
                if is_open && there <= REACH && there < distance[j as usize] {
                    distance[j as usize] = there;
                    queue.push(Reverse((there.to_bits(), j)));
                }
            }
        }
        region
    }

    /// With the neighbours of its vertices, (V).
    pub fn widened(&self, fill: &Fill) -> Vec<bool> {
        let mut wider = self.contains.clone();
        for &i in &self.vertices {
            fill.laplacian().neighbours(i as usize).iter().for_each(|&j| wider[j as usize] = true);
        }
        wider
    }
}
