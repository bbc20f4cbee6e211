//! The multifrontal factorisation: each front gathers matrix entries and its children's updates, eliminates its columns
//! and passes on what is left (Duff and Reid 1983; Liu 1992).

use std::marker::PhantomData;
use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};

use pulp::Arch;

use crate::fronts::blocks::{BLOCK, FORK, middle_row, panel_index};
use crate::fronts::buffer::Buffer;
use crate::fronts::extend_add::{Child, add_children};
use crate::fronts::tree::{Front, Tree};
use crate::fronts::walk::{Plan, Received, Visit, walk};
use crate::kernels::{Eliminate, Pivot, Product, Real};
use crate::ordering::graph::Graph;
use crate::{Failure, NotPositive, pivot_floor};

/// Block columns that are eliminated on one thread before all threads use them on the rows below.
const PIVOT_BLOCKS: usize = 16;

/// How the arithmetic is done, and whether it still is.
#[derive(Clone, Copy)]
struct Work<'a> {
    arch: Arch,
    stop: &'a AtomicBool,
}

impl Work<'_> {
    /// Once this is so, results mean nothing, and the next front ends the walk.
    fn is_over(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }
}

/// Factors the matrix of `graph` along `tree`. Returns all panels, one after the other.
pub(crate) fn factor<R: Real>(tree: &Tree, graph: &Graph, arch: Arch, stop: &AtomicBool) -> Result<Buffer<R>, Failure> {
    let plan = Plan::new(tree, |index| tree.fronts[index].update_len());
    let root = tree.root();
    let mut panels = Buffer::zeroed(tree.fronts[root].subtree_panels);
    let (own, other) = plan.stacks(root);
    let (mut own, mut other) = (Buffer::zeroed(own), Buffer::zeroed(other));
    let factor = Factor { tree, graph, work: Work { arch, stop }, stored: PhantomData::<R> };
    walk(tree, &plan, &factor, root, &mut panels, &mut own, &mut other)?;
    if factor.work.is_over() { Err(Failure::Stopped) } else { Ok(panels) }
}

struct Factor<'a, R> {
    tree: &'a Tree,
    graph: &'a Graph<'a>,
    work: Work<'a>,
    stored: PhantomData<R>,
}

impl<R: Real> Visit for Factor<'_, R> {
    type Error = Failure;
    type Stored = R;
    type Passed = f64;

    fn store_len(&self, index: usize) -> usize {
        self.tree.fronts[index].panel_len()
    }

    fn subtree_store_len(&self, index: usize) -> usize {
        self.tree.fronts[index].subtree_panels
    }

    fn passed_len(&self, index: usize) -> usize {
        self.tree.fronts[index].update_len()
    }

    fn visit(&self, index: usize, panel: &mut [R], update: &mut [f64], received: Received<f64>) -> Result<(), Failure> {
        if self.work.is_over() {
            return Err(Failure::Stopped);
        }
        R::fill_stored(panel, |panel| self.front(&self.tree.fronts[index], panel, update, received))
    }
}

impl<R: Real> Factor<'_, R> {
    /// Fills the panel of a front, which is zero, and the update for its parent.
    fn front(
        &self,
        front: &Front,
        panel: &mut [f64],
        update: &mut [f64],
        received: Received<f64>,
    ) -> Result<(), Failure> {
        self.assemble(front, panel);
        let children: Vec<Child> = front
            .children
            .iter()
            .map(|&index| {
                let child = &self.tree.fronts[index];
                Child::new(self.work.arch, &child.in_parent, front.columns, received.from(index, child.update_len()))
            })
            .collect();
        let mut rows = row_blocks(panel, front.columns);
        if front.columns == 0 {
            update.fill(0.0);
        } else {
            children.iter().for_each(|child| child.add_to_panel(&mut rows));
        }
        self.eliminate_columns(front, &mut rows)?;
        let lower: Vec<&[f64]> = rows[front.columns.div_ceil(BLOCK)..].iter().map(|row| &**row).collect();
        let mut update = update_blocks(update);
        product(self.work, &lower, &lower, &mut update, 0, true);
        add_children(&mut update, 0, &children);
        Ok(())
    }

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

    /// Left-looking elimination, [`PIVOT_BLOCKS`] block columns at a time.
    fn eliminate_columns(&self, front: &Front, rows: &mut [&mut [f64]]) -> Result<(), Failure> {
        let k = front.columns;
        let blocks = k.div_ceil(BLOCK);
        for first in (0..blocks).step_by(PIVOT_BLOCKS) {
            let last = blocks.min(first + PIVOT_BLOCKS);
            subtract_earlier(self.work, &mut rows[first..], first, last - first);
            for block in first..last {
                let (pivots, rest) = rows.split_at_mut(block);
                eliminate(self.work, pivots, &mut rest[..1], first..block, k);
                self.pivot(front, block, &mut rest[0][BLOCK * BLOCK * first..])?;
            }
            let (pivots, rest) = rows.split_at_mut(last);
            eliminate(self.work, pivots, rest, first..last, k);
        }
        Ok(())
    }

    /// Factors block `block` of the front's diagonal, the last one of `row`.
    fn pivot(&self, front: &Front, block: usize, row: &mut [f64]) -> Result<(), Failure> {
        let columns = front.start + BLOCK * block..front.start + front.columns.min(BLOCK * block + BLOCK);
        let unknowns = &self.tree.order[columns];
        let floors: Vec<f64> = unknowns.iter().map(|&i| pivot_floor(self.graph.diagonal(i as usize))).collect();
        let failed = |column: usize| match self.work.is_over() {
            true => Failure::Stopped,
            false => Failure::NotPositive(NotPositive { unknown: unknowns[column] as usize }),
        };
        self.work.arch.dispatch(Pivot { row, floors: &floors }).map_err(failed)
    }
}

/// Subtracts what the block columns before `first` contribute to the next `count` ones of `rows`, the first of which is
/// row block `first`.
fn subtract_earlier(work: Work<'_>, rows: &mut [&mut [f64]], first: usize, count: usize) {
    if first == 0 {
        return;
    }
    let (earlier, mut now): (Vec<&[f64]>, Vec<&mut [f64]>) = rows
        .iter_mut()
        .map(|row| {
            let (earlier, now) = row.split_at_mut(BLOCK * BLOCK * first);
            (&*earlier, now)
        })
        .unzip();
    product(work, &earlier, &earlier[..count], &mut now, 0, false);
}

/// [`Product`] on several threads where that pays.
fn product(work: Work<'_>, a: &[&[f64]], b: &[&[f64]], target: &mut [&mut [f64]], first: usize, overwrite: bool) {
    if work.is_over() {
        return;
    }
    let depth = b.first().map_or(0, |b| b.len());
    if target.len() > 3 && BLOCK * depth * target.len() * b.len().min(first + target.len()) > FORK {
        let middle = middle_row(first, target.len(), b.len());
        let (above, below) = a.split_at(middle);
        let (left, right) = target.split_at_mut(middle);
        rayon::join(
            || product(work, above, b, left, first, overwrite),
            || product(work, below, b, right, first + middle, overwrite),
        );
    } else {
        work.arch.dispatch(Product { a, b, target, first, overwrite });
    }
}

/// Eliminates the block columns `blocks` in `rows`, on several threads where that pays.
fn eliminate(work: Work<'_>, pivots: &[&mut [f64]], rows: &mut [&mut [f64]], blocks: Range<usize>, columns: usize) {
    if work.is_over() {
        return;
    }
    if rows.len() > 3 && BLOCK * rows.len() * (BLOCK * blocks.len()).pow(2) > FORK {
        let (left, right) = rows.split_at_mut((rows.len() / 6 * 3).max(3));
        rayon::join(
            || eliminate(work, pivots, left, blocks.clone(), columns),
            || eliminate(work, pivots, right, blocks.clone(), columns),
        );
    } else {
        work.arch.dispatch(Eliminate { pivots, rows, first: blocks.start, last: blocks.end, columns });
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
