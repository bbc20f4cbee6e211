//! Candidates by distance along the surface: the thesis's mesh infection (7.5.2) made exact and finite.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use glam::DVec3;
use rayon::prelude::*;

use crate::mesh::TriMesh;
use crate::weights::Weights;

/// Fills each row with the nearest bones, by distance along mesh edges from the region where the bone weighs
/// anything, then by distance to the bone itself, then by bone order. Bones that no edge path reaches come last.
pub(super) fn fill(kept: &Weights, n: usize, mesh: &TriMesh<'_>, segments: &[[DVec3; 2]], locked: &[bool]) -> Weights {
    let labels = spread(kept, n, &Edges::of(mesh), locked);
    let row = |found: &mut Vec<(f64, f64, u32)>, i: usize, out: &mut Vec<(u32, f32)>| {
        let (bones, values) = kept.row(i);
        let position = mesh.position(i as u32);
        let to_bone = |bone: u32| distance_to_segment(position, segments[bone as usize]);
        let near = labels[i].iter().filter(|l| !bones.contains(&l.bone));
        found.clear();
        found.extend(near.map(|l| (l.distance, to_bone(l.bone), l.bone)));
        let wanted = n.saturating_sub(bones.len());
        if found.len() < wanted {
            let is_known = |bone: u32| bones.contains(&bone) || labels[i].iter().any(|l| l.bone == bone);
            let unreached = (0..kept.n_bones()).filter(|&bone| !locked[bone as usize] && !is_known(bone));
            found.extend(unreached.map(|bone| (f64::INFINITY, to_bone(bone), bone)));
        }
        found.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.cmp(&b.2)));
        out.extend(bones.iter().copied().zip(values.iter().copied()));
        out.extend(found.iter().take(wanted).map(|&(_, _, bone)| (bone, 0.0)));
        out.sort_unstable_by_key(|&(bone, _)| bone);
    };
    Weights::from_rows(kept.vertex_count(), kept.n_bones(), Vec::new, row)
}

/// A bone and how far along the surface its region is.
#[derive(Clone, Copy)]
struct Label {
    bone: u32,
    distance: f64,
}

/// Multi-label Dijkstra: the `n` nearest bones of every vertex with all that tie with the last of them.
///
/// A bone that is among the `n` nearest of a vertex is so all along its shortest path there, so nothing else needs to
/// be carried on, and the answer is exact.
fn spread(kept: &Weights, n: usize, edges: &Edges, locked: &[bool]) -> Vec<Vec<Label>> {
    let own = |i: usize| kept.row(i).0.iter().copied().filter(|&bone| !locked[bone as usize]);
    let start = |i: usize| own(i).map(|bone| Label { bone, distance: 0.0 }).collect();
    let mut labels: Vec<Vec<Label>> = (0..kept.vertex_count()).map(start).collect();
    // Positive floats order as their bits do. Reverse: the heap gives the nearest first.
    let mut queue = BinaryHeap::new();
    let relax = |labels: &mut [Vec<Label>], queue: &mut BinaryHeap<_>, from: u32, bone: u32, distance: f64| {
        for (to, length) in edges.of_vertex(from) {
            let distance = distance + length;
            if offer(&mut labels[to as usize], n, Label { bone, distance }) {
                queue.push(Reverse((distance.to_bits(), to, bone)));
            }
        }
    };
    for i in 0..kept.vertex_count() {
        for bone in own(i) {
            relax(&mut labels, &mut queue, i as u32, bone, 0.0);
        }
    }
    while let Some(Reverse((bits, vertex, bone))) = queue.pop() {
        let distance = f64::from_bits(bits);
        let known = &labels[vertex as usize];
        let is_current = known.iter().any(|l| l.bone == bone && l.distance == distance);
        if is_current && nearer(known, distance) < n {
            relax(&mut labels, &mut queue, vertex, bone, distance);
        }
    }
    labels
}

/// Takes a label over if it may be among the `n` nearest and is nearer than the same bone was before.
fn offer(known: &mut Vec<Label>, n: usize, label: Label) -> bool {
    if let Some(same) = known.iter_mut().find(|l| l.bone == label.bone) {
        let improves = label.distance < same.distance;
        if improves {
            same.distance = label.distance;
        }
        return improves;
    }
    let fits = nearer(known, label.distance) < n;
    if fits {
        known.push(label);
    }
    fits
}

fn nearer(known: &[Label], distance: f64) -> usize {
    known.iter().filter(|l| l.distance < distance).count()
}

fn distance_to_segment(point: DVec3, [head, tail]: [DVec3; 2]) -> f64 {
    let along = tail - head;
    let share = (point - head).dot(along) / along.length_squared().max(f64::MIN_POSITIVE);
    point.distance(head + share.clamp(0.0, 1.0) * along)
}

/// The neighbours of every vertex and the lengths of the edges to them.
struct Edges {
    starts: Vec<u32>,
    ends: Vec<(u32, f64)>,
}

impl Edges {
    fn of(mesh: &TriMesh<'_>) -> Self {
        let sides = mesh.triangles().iter().flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)]);
        let mut pairs: Vec<(u32, u32)> = sides.map(|(a, b)| (a.min(b), a.max(b))).filter(|(a, b)| a != b).collect();
        pairs.par_sort_unstable();
        pairs.dedup();
        let mut starts = vec![0u32; mesh.vertex_count() + 1];
        for &(a, b) in &pairs {
            starts[a as usize + 1] += 1;
            starts[b as usize + 1] += 1;
        }
        for i in 1..starts.len() {
            starts[i] += starts[i - 1];
        }
        let mut next = starts.clone();
        let mut ends = vec![(0, 0.0); 2 * pairs.len()];
        for &(a, b) in &pairs {
            let length = mesh.position(a).distance(mesh.position(b));
            for (from, to) in [(a, b), (b, a)] {
                ends[next[from as usize] as usize] = (to, length);
                next[from as usize] += 1;
            }
        }
        Self { starts, ends }
    }

    fn of_vertex(&self, i: u32) -> impl Iterator<Item = (u32, f64)> + '_ {
        self.ends[self.starts[i as usize] as usize..self.starts[i as usize + 1] as usize].iter().copied()
    }
}
