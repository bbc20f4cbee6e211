//! Substitution for rows that are mostly zero, which touches nothing else.
//!
//! A solution that dies away within some distance of its data costs what it is long, in memory and in time, however many
//! columns there are elsewhere.

use std::sync::atomic::{AtomicBool, Ordering};

use pulp::Arch;

use crate::fronts::blocks::BLOCK;
use crate::fronts::buffer::Buffer;
use crate::fronts::tree::Tree;
use crate::fronts::walk::BRANCHES;
use crate::substitute::backward::Arithmetic;
use crate::substitute::forward::{Active, Stacks, activity, forward};
use crate::substitute::rows::{Builder, FrontRows, LINE, Place, SparseRows, Sum, noticeable};

/// Subtrees with more columns than this are divided between threads, unless there are [`BRANCHES`] larger ones for each.
const FORK_COLUMNS: usize = 1000;

/// Memory for one solve after the other.
#[derive(Debug, Default)]
pub struct Workspace {
    halfway: Option<Buffer<f32>>,
    stacks: Stacks<f32>,
}

/// Solves for `given` where the solution matters: `least` is the magnitude up to which it counts as zero at each place (n).
/// Once `stop` is set the answer means nothing.
pub(crate) fn solve<'f>(
    (tree, panels, arch): (&'f Tree, &[f32], Arch),
    given: &Sum<'_, 'f>,
    least: &[f32],
    work: &mut Workspace,
    stop: &AtomicBool,
) -> SparseRows<'f> {
    let active = activity(tree, given, None);
    let places = in_places_of_parents(tree, &active);
    let length = tree.fronts.iter().zip(&active).map(|(front, active)| front.columns * active.width).sum();
    let halfway = Buffer::at_least(&mut work.halfway, length);
    forward(tree, panels, arch, given, &places, None, halfway, &mut work.stacks);
    let (mut panel_starts, mut starts, mut subtree_least) = (Vec::new(), Vec::new(), Vec::<f32>::new());
    let (mut panel_start, mut start) = (0, 0);
    for (front, active) in tree.fronts.iter().zip(&active) {
        panel_starts.push(panel_start);
        starts.push(start);
        panel_start += front.panel_len();
        start += front.columns * active.width;
        let own = least[front.start..front.start + front.columns].iter().copied();
        let below = front.children.iter().map(|&child| subtree_least[child]);
        subtree_least.push(own.chain(below).fold(f32::INFINITY, f32::min));
    }
    let mut fronts = vec![Place::default(); tree.fronts.len()];
    let (root, halfway) = (tree.root(), &halfway[..]);
    let fork = FORK_COLUMNS.max(tree.order.len() / (BRANCHES * rayon::current_num_threads()));
    let pass = Backward {
        tree,
        panels,
        panel_starts,
        arch,
        active,
        places,
        starts,
        halfway,
        least,
        subtree_least,
        fork,
        stop,
    };
    let mut found = Found::default();
    pass.descend(root, pass.active[root], Vec::new(), &mut fronts, 0, &mut found);
    SparseRows { tree: Some(tree), fronts, chunks: found.rows.into_chunks() }
}

/// The columns of each front, or those of its parent where they take no more room: what the front passes on is then added
/// without looking up where each column is.
fn in_places_of_parents(tree: &Tree, active: &[Active]) -> Vec<Active> {
    let mut places = active.to_vec();
    for (index, front) in tree.fronts.iter().enumerate().rev() {
        let parent = places[index];
        for &child in front.children.iter().filter(|&&child| active[child].width == parent.width) {
            places[child] = parent;
        }
    }
    places
}

/// What a worker has found, and memory that it uses again.
#[derive(Debug, Default)]
struct Found {
    rows: Builder,
    free: Vec<Vec<f32>>,
}

impl Found {
    /// Memory for so many numbers, empty.
    fn memory(&mut self, len: usize) -> Vec<f32> {
        let mut memory = self.free.pop().unwrap_or_default();
        memory.clear();
        memory.reserve(len);
        memory
    }
}

/// Backward substitution. Each front is solved for the columns of the data in its subtree, and for those in which the
/// solution around is not negligible.
struct Backward<'a> {
    tree: &'a Tree,
    panels: &'a [f32],
    panel_starts: Vec<usize>,
    arch: Arch,
    /// What forward substitution has left: columns of each front, which of them are stored, where its rows start, and all
    /// rows.
    active: Vec<Active>,
    places: Vec<Active>,
    starts: Vec<usize>,
    halfway: &'a [f32],
    /// Magnitude that counts as zero, by place.
    least: &'a [f32],
    /// The smallest of them in each front's subtree.
    subtree_least: Vec<f32>,
    /// Columns of a subtree from which on it is divided between threads.
    fork: usize,
    stop: &'a AtomicBool,
}

/// A front whose solution is known.
struct Solved<'a> {
    index: usize,
    active: Active,
    own: &'a [f32],
    boundary: &'a [f32],
}

impl Backward<'_> {
    /// Solves the subtree of `index`, `fronts` being its own and `first` the index of the first of them, given the solution
    /// in the rows under the front, both for `active` columns.
    fn descend(
        &self,
        index: usize,
        active: Active,
        boundary: Vec<f32>,
        fronts: &mut [Place],
        first: usize,
        found: &mut Found,
    ) {
        let front = &self.tree.fronts[index];
        let (this, below) = fronts[..=index - first].split_last_mut().expect("the front is there");
        if active.mask == 0 || self.stop.load(Ordering::Relaxed) {
            return;
        }
        let width = active.width;
        let len = front.columns * width;
        let mut own = found.memory(len);
        let (done, stored) = (self.active[index], self.places[index]);
        let halfway = self.halfway[self.starts[index]..].chunks(stored.width.max(1));
        if stored.mask == active.mask {
            own.extend_from_slice(&self.halfway[self.starts[index]..][..len]);
        } else {
            own.resize(len, 0.0);
            let (from, to) = (stored.slots(&done), active.slots(&done));
            for (row, halfway) in own.chunks_exact_mut(width).zip(halfway) {
                from.iter().zip(&*to).for_each(|(&from, &to)| row[to] = halfway[from]);
            }
        }
        let panel = &self.panels[self.panel_starts[index]..][..front.panel_len()];
        Arithmetic { arch: self.arch, width }.solve_front(front, panel, &mut own, &boundary);
        let rows = FrontRows { mask: active.mask, values: &own };
        let kept = rows.noticeable(|k| self.least[front.start + k]);
        *this = found.rows.add_columns(rows, front.columns, kept);
        let solved = Solved { index, active, own: &own, boundary: &boundary };
        self.children(&front.children, &solved, below, first, found);
        found.free.extend([own, boundary]);
    }

    fn children(&self, roots: &[usize], parent: &Solved, fronts: &mut [Place], first: usize, found: &mut Found) {
        match roots {
            [] => {}
            &[root] => {
                let active = self.columns(root, parent);
                let boundary = self.boundary(root, active, parent, found);
                self.descend(root, active, boundary, fronts, first, found);
            }
            _ => {
                let (left, right) = roots.split_at(roots.len() / 2);
                let cut = left[left.len() - 1] + 1;
                let (before, after) = fronts.split_at_mut(cut - first);
                let columns =
                    |roots: &[usize]| roots.iter().map(|&root| self.tree.fronts[root].subtree_columns).sum::<usize>();
                if columns(left).min(columns(right)) > self.fork {
                    let mut other = Found::default();
                    rayon::join(
                        || self.children(left, parent, before, first, found),
                        || self.children(right, parent, after, cut, &mut other),
                    );
                    found.rows.append(other.rows, after);
                } else {
                    self.children(left, parent, before, first, found);
                    self.children(right, parent, after, cut, found);
                }
            }
        }
    }

    /// The rows of the parent's solution under the columns of `child`.
    fn rows_under<'a>(&'a self, child: usize, parent: &'a Solved) -> impl Iterator<Item = &'a [f32]> {
        let (columns, width) = (self.tree.fronts[parent.index].columns, parent.active.width);
        self.tree.fronts[child].in_parent.iter().map(move |&place| match (place as usize).checked_sub(columns) {
            None => &parent.own[place as usize * width..][..width],
            Some(row) => &parent.boundary[row * width..][..width],
        })
    }

    /// The columns that the subtree of `child` is solved for; its parent's where fewer would take as much room.
    fn columns(&self, child: usize, parent: &Solved) -> Active {
        let (all, own) = (parent.active, self.active[child].mask);
        if own != 0 && all.mask | own == all.mask && all.width == LINE {
            return all;
        }
        let active = Active::of::<f32>(own | self.noticeable(child, parent));
        if all.mask | own == all.mask && all.width == active.width { all } else { active }
    }

    /// The columns in which the solution around the subtree of `child` is not negligible.
    fn noticeable(&self, child: usize, parent: &Solved) -> u64 {
        let least = self.subtree_least[child];
        noticeable(parent.active, self.rows_under(child, parent).map(|row| (row, least)))
    }

    /// The solution in the rows under the columns of `child`, (rows padded to whole blocks, width).
    fn boundary(&self, child: usize, active: Active, parent: &Solved, found: &mut Found) -> Vec<f32> {
        let count = self.tree.fronts[child].rows.len().next_multiple_of(BLOCK);
        let mut boundary = found.memory(count * active.width);
        if active.mask == 0 {
            return boundary;
        }
        let (slots, padding) = (parent.active.slots(&active), [0.0; LINE]);
        for row in self.rows_under(child, parent) {
            if active.mask == parent.active.mask {
                boundary.extend_from_slice(row);
            } else {
                boundary.extend(slots.iter().map(|&slot| row[slot]));
                boundary.extend_from_slice(&padding[..active.width - slots.len()]);
            }
        }
        boundary.resize(count * active.width, 0.0);
        boundary
    }
}
