//! Connections between parts of a lattice that do not hang together, over the smallest gaps.

use std::collections::VecDeque;

use super::cells::Cells;
use super::lattice::Lattice;
use crate::adjacency::{DisjointSets, NONE};

/// A connection from one node to another, and its length in cells.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bridge {
    pub(super) from: u32,
    pub(super) to: u32,
    pub(super) length: f64,
}

/// Two nodes whose territories (the cells nearest to them) meet.
pub(super) type Gap = (u32, u32);

/// A node near each cell, breadth first, and the gaps between parts. Breadth first is not exactly nearest: cells are.
pub(super) fn nearest_nodes(cells: &Cells, node_of_cell: &[u32]) -> (Vec<u32>, Vec<Gap>) {
    let part = parts(cells, node_of_cell);
    let mut nearest = node_of_cell.to_vec();
    let is_node = |cell: &usize| node_of_cell[*cell] != NONE;
    let mut queue: VecDeque<usize> = (0..nearest.len()).filter(is_node).collect();
    let (neighbours, mut gaps) = (cells.neighbours(), Vec::new());
    while let Some(cell) = queue.pop_front() {
        if !cells.is_inner(cells.place_of(cell)) {
            continue;
        }
        for &(step, _) in &neighbours {
            let other = (cell as isize + step) as usize;
            if nearest[other] == NONE {
                nearest[other] = nearest[cell];
                queue.push_back(other);
            } else if part[nearest[other] as usize] != part[nearest[cell] as usize] {
                gaps.push((nearest[cell].min(nearest[other]), nearest[cell].max(nearest[other])));
            }
        }
    }
    gaps.sort_unstable();
    gaps.dedup();
    (nearest, gaps)
}

/// The part of each node: what hangs together through neighbours.
fn parts(cells: &Cells, node_of_cell: &[u32]) -> Vec<u32> {
    let count = node_of_cell.iter().filter(|&&node| node != NONE).count();
    let mut sets = DisjointSets::new(count);
    let neighbours = cells.neighbours();
    for (cell, &node) in node_of_cell.iter().enumerate().filter(|&(_, &node)| node != NONE) {
        for &(step, _) in &neighbours {
            let other = node_of_cell[(cell as isize + step) as usize];
            if other != NONE && other < node {
                sets.union(node, other);
            }
        }
    }
    sets.number(|_| true).0
}

/// The shortest bridges that connect all parts, each both ways, by their first node (Kruskal's algorithm).
pub(super) fn bridges(lattice: &Lattice, gaps: &[Gap]) -> Vec<Bridge> {
    let length = |&(from, to): &Gap| {
        let apart = (lattice.place(from) - lattice.place(to)).as_dvec3().length();
        Bridge { from, to, length: apart }
    };
    let mut candidates: Vec<Bridge> = gaps.iter().map(length).collect();
    candidates.sort_by(|x, y| x.length.total_cmp(&y.length).then((x.from, x.to).cmp(&(y.from, y.to))));
    let part = parts(lattice.cells(), lattice.node_of_cell());
    let count = part.iter().max().map_or(0, |&last| last as usize + 1);
    let mut sets = DisjointSets::new(count);
    let mut kept = Vec::new();
    for bridge in candidates {
        let (a, b) = (part[bridge.from as usize], part[bridge.to as usize]);
        if sets.find(a) != sets.find(b) {
            sets.union(a, b);
            kept.extend([bridge, Bridge { from: bridge.to, to: bridge.from, ..bridge }]);
        }
    }
    kept.sort_by_key(|bridge| (bridge.from, bridge.to));
    kept
}
