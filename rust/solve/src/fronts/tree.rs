//! The elimination tree with the rows of every front: what the numbers will need, before any number is touched.

use crate::fronts::blocks::{panel_len, update_len};
use crate::ordering::dissection::Dissection;
use crate::ordering::graph::Graph;
use crate::ordering::patch::Node;

/// A dense piece of the elimination: some columns of the factor and the rows they touch.
#[derive(Debug)]
pub(crate) struct Front {
    /// Place of its first column.
    pub(crate) start: usize,
    /// Number of columns.
    pub(crate) columns: usize,
    /// Places of the rows under the columns, ascending.
    pub(crate) rows: Vec<u32>,
    /// Place of each of `rows` among the parent's columns and rows.
    pub(crate) in_parent: Vec<u32>,
    /// Indices of the children, ascending.
    pub(crate) children: Vec<usize>,
    /// Lengths of the panels and of the columns of the whole subtree.
    pub(crate) subtree_panels: usize,
    pub(crate) subtree_columns: usize,
    /// Multiplications and additions of the whole subtree.
    pub(crate) subtree_flops: f64,
}

impl Front {
    pub(crate) fn panel_len(&self) -> usize {
        panel_len(self.columns, self.rows.len())
    }

    pub(crate) fn update_len(&self) -> usize {
        update_len(self.rows.len())
    }

    pub(crate) fn flops(&self) -> f64 {
        let (k, m) = (self.columns as f64, self.rows.len() as f64);
        k * k * k / 3.0 + k * k * m + k * m * m
    }
}

/// Fronts in post-order, the last being the root.
#[derive(Debug)]
pub(crate) struct Tree {
    pub(crate) fronts: Vec<Front>,
    /// Unknown at each place.
    pub(crate) order: Vec<u32>,
    /// Place of each unknown.
    pub(crate) place: Vec<u32>,
    /// Front that holds each place.
    pub(crate) front_of: Vec<u32>,
}

impl Tree {
    pub(crate) fn new(graph: &Graph, dissection: Dissection) -> Self {
        let Dissection { order, place, nodes } = dissection;
        let mut fronts = bare_fronts(&nodes);
        let roots = [fronts.len() - 1];
        find_rows(&mut fronts, &roots, 0, &|front| coupled_later(graph, &order, &place, front));
        let front_of = fronts.iter().zip(0..).flat_map(|(front, k)| std::iter::repeat_n(k, front.columns)).collect();
        Self { fronts, order, place, front_of }
    }

    pub(crate) fn root(&self) -> usize {
        self.fronts.len() - 1
    }
}

fn bare_fronts(nodes: &[Node]) -> Vec<Front> {
    let mut start = 0;
    let front = |(index, node): (usize, &Node)| {
        let mut children = Vec::new();
        let mut end = index;
        while end > index - node.descendants {
            children.push(end - 1);
            end -= 1 + nodes[end - 1].descendants;
        }
        children.reverse();
        start += node.columns;
        Front {
            start: start - node.columns,
            columns: node.columns,
            rows: Vec::new(),
            in_parent: Vec::new(),
            children,
            subtree_panels: 0,
            subtree_columns: 0,
            subtree_flops: 0.0,
        }
    };
    nodes.iter().enumerate().map(front).collect()
}

/// Places after `front` of the unknowns its own columns are coupled to, unsorted.
fn coupled_later(graph: &Graph, order: &[u32], place: &[u32], front: &Front) -> Vec<u32> {
    let end = front.start + front.columns;
    let neighbours = order[front.start..end].iter().flat_map(|&unknown| graph.neighbours(unknown as usize));
    neighbours.map(|j| place[j]).filter(|&place| place as usize >= end).collect()
}

/// Subtrees of more fronts than this are analysed on two threads.
const FORK: usize = 128;

/// Finds the rows of all fronts of neighbouring subtrees with these `roots`; `first` is the index of `fronts[0]`.
fn find_rows(fronts: &mut [Front], roots: &[usize], first: usize, later: &(impl Fn(&Front) -> Vec<u32> + Sync)) {
    match roots {
        [] => {}
        &[root] => {
            let (front, below) = fronts[..=root - first].split_last_mut().expect("the root is there");
            find_rows(below, &front.children.clone(), first, later);
            join_children(front, below, first, later(front));
        }
        _ => {
            let (left, right) = roots.split_at(roots.len() / 2);
            let cut = left[left.len() - 1] + 1;
            let (before, after) = fronts.split_at_mut(cut - first);
            if before.len().min(after.len()) > FORK {
                rayon::join(|| find_rows(before, left, first, later), || find_rows(after, right, cut, later));
            } else {
                find_rows(before, left, first, later);
                find_rows(after, right, cut, later);
            }
        }
    }
}

/// Completes `front` from its children in `below` and from the places its own columns are coupled to.
fn join_children(front: &mut Front, below: &mut [Front], first: usize, mut rows: Vec<u32>) {
    let end = (front.start + front.columns) as u32;
    for &child in &front.children {
        let child = &below[child - first].rows;
        rows.extend_from_slice(&child[child.partition_point(|&row| row < end)..]);
    }
    rows.sort();
    rows.dedup();
    rows.shrink_to_fit();
    front.rows = rows;
    front.subtree_panels = front.panel_len();
    front.subtree_columns = front.columns;
    front.subtree_flops = front.flops();
    for &child in &front.children {
        let child = &mut below[child - first];
        front.subtree_panels += child.subtree_panels;
        front.subtree_columns += child.subtree_columns;
        front.subtree_flops += child.subtree_flops;
        child.in_parent = places_in_parent(&child.rows, front);
    }
}

/// Where each of `rows` is among the columns and rows of `parent`.
fn places_in_parent(rows: &[u32], parent: &Front) -> Vec<u32> {
    let end = parent.start + parent.columns;
    let mut later = 0;
    let place = |&row: &u32| {
        if (row as usize) < end {
            return row - parent.start as u32;
        }
        while parent.rows[later] != row {
            later += 1;
        }
        (parent.columns + later) as u32
    };
    rows.iter().map(place).collect()
}
