//! Shortest ways through a lattice (E. W. Dijkstra: A note on two problems in connexion with graphs. Numerische Mathematik
//! 1, 1959).

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::lattice::Lattice;

/// Distance of a node that no way within the limit leads to.
pub const UNREACHED: u32 = u32::MAX;

/// Lengths are counted in this share of a cell, as integers, so that equal ways have equal lengths on every machine.
const PER_CELL: f64 = 256.0;

/// Distances from some sources to the nodes of a lattice; memory to be used again and again.
#[derive(Debug)]
pub struct Paths<'a> {
    lattice: &'a Lattice,
    steps: [(isize, u32); 26],
    distance: Vec<u32>,
    reached: Vec<u32>,
    queue: BinaryHeap<Reverse<u64>>,
}

impl<'a> Paths<'a> {
    /// Nothing is reached yet.
    pub fn new(lattice: &'a Lattice) -> Self {
        let steps = lattice.cells().neighbours().map(|(step, length)| (step, (length * PER_CELL).round() as u32));
        let distance = vec![UNREACHED; lattice.len()];
        Self { lattice, steps, distance, reached: Vec::new(), queue: BinaryHeap::new() }
    }

    /// World length of a distance.
    pub fn length(&self, distance: u32) -> f64 {
        f64::from(distance) / PER_CELL * self.lattice.cells().size()
    }

    /// Distance nearest to a world length.
    pub fn distance_of(&self, length: f64) -> u32 {
        (length / self.lattice.cells().size() * PER_CELL).round().clamp(0.0, f64::from(u32::MAX / 4)) as u32
    }

    /// Finds the shortest ways from `sources`, nodes with the distance they start at, to all nodes whose distance is at
    /// most their `limit`. Forgets what was found before.
    pub fn search(&mut self, sources: impl IntoIterator<Item = (u32, u32)>, limit: impl Fn(u32) -> u32) {
        for node in self.reached.drain(..) {
            self.distance[node as usize] = UNREACHED;
        }
        for (node, distance) in sources {
            self.offer(node, distance, &limit);
        }
        while let Some(Reverse(next)) = self.queue.pop() {
            let (distance, node) = ((next >> 32) as u32, next as u32);
            if distance == self.distance[node as usize] {
                self.leave(node, distance, &limit);
            }
        }
    }

    fn leave(&mut self, node: u32, distance: u32, limit: &impl Fn(u32) -> u32) {
        let cell = self.lattice.cell(node) as isize;
        for k in 0..self.steps.len() {
            let (step, length) = self.steps[k];
            let other = self.lattice.node_of_cell()[(cell + step) as usize];
            if other != crate::adjacency::NONE {
                self.offer(other, distance + length, limit);
            }
        }
        let bridges = self.lattice.bridges();
        let first = bridges.partition_point(|bridge| bridge.from < node);
        for bridge in bridges[first..].iter().take_while(|bridge| bridge.from == node) {
            self.offer(bridge.to, distance + (bridge.length * PER_CELL).round() as u32, limit);
        }
    }

    #[inline]
    fn offer(&mut self, node: u32, distance: u32, limit: &impl Fn(u32) -> u32) {
        let known = &mut self.distance[node as usize];
        if distance < *known && distance <= limit(node) {
            if *known == UNREACHED {
                self.reached.push(node);
            }
            *known = distance;
            self.queue.push(Reverse(u64::from(distance) << 32 | u64::from(node)));
        }
    }

    /// Distance of `node`, or [`UNREACHED`].
    pub fn distance(&self, node: u32) -> u32 {
        self.distance[node as usize]
    }

    /// Nodes that were reached, in no particular order.
    pub fn reached(&self) -> &[u32] {
        &self.reached
    }
}
