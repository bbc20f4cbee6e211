//! The multifrontal factorisation: each front gathers matrix entries and its children's updates, eliminates its columns
//! and passes on what is left (Duff and Reid 1983; Liu 1992).

use pulp::Arch;

use super::blocks::{BLOCK, panel_index, triangle_len};
use super::buffer::Buffer;
use super::graph::Graph;
use super::kernels::{Eliminate, Pivot, Schur};
use super::tree::{Front, Tree};
use super::walk::{Plan, Received, Visit, walk};
use super::{NotPositive, pivot_floor};

/// Work of a front (multiplications) worth a second thread.
const FORK: usize = 1 << 20;
/// Block columns that are eliminated on one thread before all threads use them on the rows below.
const PIVOT_BLOCKS: usize = 16;

/// Factors the matrix of `graph` along `tree`. Returns all panels, one after the other.
pub(super) fn factor(tree: &Tree, graph: &Graph, arch: Arch) -> Result<Buffer, NotPositive> {
    let plan = Plan::new(tree, |index| tree.fronts[index].update_len());
    let root = tree.root();
    let mut panels = Buffer::zeroed(tree.fronts[root].subtree_panels);
    let (own, other) = plan.stacks(root);
    let (mut own, mut other) = (Buffer::zeroed(own), Buffer::zeroed(other));
    walk(tree, &plan, &Factor { tree, graph, arch }, root, &mut panels, &mut own, &mut other)?;
    Ok(panels)
}

struct Factor<'a> {
    tree: &'a Tree,
    graph: &'a Graph<'a>,
    arch: Arch,
}

impl Visit for Factor<'_> {
    type Error = NotPositive;

    fn store_len(&self, front: &Front) -> usize {
        front.panel_len()
    }

    fn subtree_store_len(&self, front: &Front) -> usize {
        front.subtree_panels
    }

    fn passed_len(&self, index: usize) -> usize {
        self.tree.fronts[index].update_len()
    }

    fn visit(
        &self,
        index: usize,
        panel: &mut [f64],
        update: &mut [f64],
        received: Received,
    ) -> Result<(), NotPositive> {
        let front = &self.tree.fronts[index];
        self.assemble(front, panel);
        let children: Vec<Child> = front.children.iter().map(|&child| self.child(child, front, &received)).collect();
        for child in &children {
            child.add_to_panel(front.columns, panel);
        }
        if front.columns == 0 {
            update.fill(0.0);
        }
        let mut rows = row_blocks(panel, front.columns);
        self.eliminate_columns(front, &mut rows)?;
        let lower = &rows[front.columns.div_ceil(BLOCK)..];
        schur(self.arch, lower, &mut update_blocks(update), 0, front.columns, &children);
        Ok(())
    }
}

impl Factor<'_> {
    /// Puts the matrix entries of the front's columns into its empty panel.
    fn assemble(&self, front: &Front, panel: &mut [f64]) {
        let end = front.start + front.columns;
        for (column, &unknown) in self.tree.order[front.start..end].iter().enumerate() {
            panel[panel_index(front.columns, column, column)] = self.graph.diagonal(unknown as usize);
            for (j, value) in self.graph.entries(unknown as usize) {
                let place = self.tree.place[j] as usize;
                if place <= front.start + column {
                    continue;
                }
                let row = match place < end {
                    true => place - front.start,
                    false => front.columns + front.rows.partition_point(|&row| (row as usize) < place),
                };
                panel[panel_index(front.columns, row, column)] = value;
            }
        }
    }

    fn child<'r>(&'r self, index: usize, parent: &Front, received: &Received<'r>) -> Child<'r> {
        let child = &self.tree.fronts[index];
        let inside = child.in_parent.partition_point(|&place| (place as usize) < parent.columns);
        let column = |&place: &u32| BLOCK as u32 * (place - parent.columns as u32);
        Child {
            in_parent: &child.in_parent,
            inside,
            outside: child.in_parent[inside..].iter().map(column).collect(),
            update: received.from(index, child.update_len()),
        }
    }

    /// Left-looking elimination, [`PIVOT_BLOCKS`] block columns at a time.
    fn eliminate_columns(&self, front: &Front, rows: &mut [&mut [f64]]) -> Result<(), NotPositive> {
        let k = front.columns;
        let unknowns = &self.tree.order[front.start..front.start + k];
        let floors: Vec<f64> = unknowns.iter().map(|&i| pivot_floor(self.graph.diagonal(i as usize))).collect();
        let blocks = k.div_ceil(BLOCK);
        for first in (0..blocks).step_by(PIVOT_BLOCKS) {
            let last = blocks.min(first + PIVOT_BLOCKS);
            for block in first..last {
                let (pivots, rest) = rows.split_at_mut(block);
                eliminate(self.arch, pivots, &mut rest[..1], first..block, k);
                let columns = BLOCK * block..k.min(BLOCK * block + BLOCK);
                let pivot = Pivot { row: rest[0], floors: &floors[columns.clone()] };
                let failed = |column| NotPositive { unknown: unknowns[columns.start + column] as usize };
                self.arch.dispatch(pivot).map_err(failed)?;
            }
            let (pivots, rest) = rows.split_at_mut(last);
            eliminate(self.arch, pivots, rest, first..last, k);
        }
        Ok(())
    }
}

/// Eliminates the block columns `blocks` in `rows`, on several threads where that pays.
fn eliminate(
    arch: Arch,
    pivots: &[&mut [f64]],
    rows: &mut [&mut [f64]],
    blocks: std::ops::Range<usize>,
    columns: usize,
) {
    let work = BLOCK * rows.len() * BLOCK * blocks.len() * BLOCK * blocks.end;
    if work > FORK && rows.len() > 3 {
        let (left, right) = rows.split_at_mut((rows.len() / 2).next_multiple_of(3));
        rayon::join(
            || eliminate(arch, pivots, left, blocks.clone(), columns),
            || eliminate(arch, pivots, right, blocks.clone(), columns),
        );
    } else {
        arch.dispatch(Eliminate { pivots, rows, first: blocks.start, last: blocks.end, columns });
    }
}

/// Computes the row blocks of the update from `first` on: minus the panel's product, plus what the children passed on.
fn schur(
    arch: Arch,
    lower: &[&mut [f64]],
    update: &mut [&mut [f64]],
    first: usize,
    columns: usize,
    children: &[Child],
) {
    let work = BLOCK * BLOCK * update.len() * (first + update.len() / 2) * columns;
    if work > FORK && update.len() > 3 {
        // Rows grow longer: about as much work is in the first six tenths as in the rest.
        let middle = if first == 0 { update.len() * 7 / 10 } else { update.len() * 6 / 10 }.next_multiple_of(3);
        let (left, right) = update.split_at_mut(middle.min(update.len()));
        rayon::join(
            || schur(arch, lower, left, first, columns, children),
            || schur(arch, lower, right, first + middle, columns, children),
        );
    } else {
        arch.dispatch(Schur { lower, update, first, columns });
        for child in children {
            child.add_to_update(update, first);
        }
    }
}

/// An update on its way into the parent's front.
struct Child<'a> {
    in_parent: &'a [u32],
    /// Number of its rows that are columns of the parent.
    inside: usize,
    /// Where the columns of its other rows start in a row block of the parent's update.
    outside: Vec<u32>,
    update: &'a [f64],
}

impl Child<'_> {
    /// Row `i` of the update, as blocks of eight rows of which lane `i % 8` is meant.
    fn row(&self, i: usize) -> &[[f64; BLOCK]] {
        self.update[triangle_len(i / BLOCK)..].as_chunks().0
    }

    /// Adds the columns that the parent eliminates.
    fn add_to_panel(&self, columns: usize, panel: &mut [f64]) {
        for (i, &place) in self.in_parent.iter().enumerate() {
            let start = panel_index(columns, place as usize, 0);
            let row = &mut panel[start..];
            for (&column, values) in self.in_parent[..self.inside.min(i + 1)].iter().zip(self.row(i)) {
                row[BLOCK * column as usize] += values[i % BLOCK];
            }
        }
    }

    /// Adds the rest to the row blocks `update` of the parent's update, of which `first` is the first.
    fn add_to_update(&self, update: &mut [&mut [f64]], first: usize) {
        let span = (BLOCK * BLOCK * first) as u32..(BLOCK * BLOCK * (first + update.len())) as u32;
        let start = self.outside.partition_point(|&row| row < span.start);
        let end = self.outside.partition_point(|&row| row < span.end);
        for row in start..end {
            let i = self.inside + row;
            let place = self.outside[row] as usize / BLOCK;
            let target = &mut update[place / BLOCK - first][place % BLOCK..];
            for (&column, values) in self.outside[..=row].iter().zip(&self.row(i)[self.inside..]) {
                target[column as usize] += values[i % BLOCK];
            }
        }
    }
}

/// The row blocks of a panel, those of its triangle first.
fn row_blocks(mut panel: &mut [f64], columns: usize) -> Vec<&mut [f64]> {
    let mut blocks = Vec::with_capacity(panel.len() / (BLOCK * columns).max(1) + 1);
    for start in (0..columns).step_by(BLOCK) {
        let (block, rest) = panel.split_at_mut(BLOCK * columns.min(start + BLOCK));
        blocks.push(block);
        panel = rest;
    }
    blocks.extend(panel.chunks_exact_mut((BLOCK * columns).max(1)));
    blocks
}

/// The row blocks of an update.
fn update_blocks(mut update: &mut [f64]) -> Vec<&mut [f64]> {
    let mut blocks = Vec::new();
    while !update.is_empty() {
        let (block, rest) = update.split_at_mut(BLOCK * BLOCK * (blocks.len() + 1));
        blocks.push(block);
        update = rest;
    }
    blocks
}
