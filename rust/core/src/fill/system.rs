//! The linear system: independent blocks of unknowns, and the rows of Q = S + l^2 S M^-1 S.

use rayon::prelude::*;

use crate::adjacency::{DisjointSets, NONE};
use crate::laplacian::Laplacian;
use skinwright_solve::SymmetricMatrix;

/// Rows a worker assembles at a time.
const ROWS_A_RUN: usize = 1024;

/// Finds the independent blocks among `unknown` vertices (V): connected components of the two-ring graph, or of the
/// one-ring graph where `length` is 0. Each ascending, ordered by first vertex.
pub fn independent_blocks(laplacian: &Laplacian, unknown: &[bool], length: f64) -> Vec<Vec<u32>> {
    let mut sets = DisjointSets::new(unknown.len());
    for i in 0..unknown.len() {
        if length == 0.0 && !unknown[i] {
            continue;
        }
        let mut first = if unknown[i] { Some(i as u32) } else { None };
        for &j in laplacian.neighbours(i).iter().filter(|&&j| unknown[j as usize]) {
            sets.union(*first.get_or_insert(j), j);
        }
    }
    let (block_of, count) = sets.number(|i| unknown[i as usize]);
    let mut blocks = vec![Vec::new(); count];
    for (i, &block) in block_of.iter().enumerate().filter(|&(_, &block)| block != NONE) {
        blocks[block as usize].push(i as u32);
    }
    blocks
}

/// Position of every unknown within its block (V), [`NONE`] for the other vertices.
pub fn number_unknowns(blocks: &[Vec<u32>], vertex_count: usize) -> Vec<u32> {
    let mut number = vec![NONE; vertex_count];
    for block in blocks {
        for (k, &i) in block.iter().enumerate() {
            number[i as usize] = k as u32;
        }
    }
    number
}

/// Q_UI of a block: for each unknown, its fixed two-ring. `vertices` are the distinct fixed vertices, and `columns`
/// index into them.
#[derive(Debug, Default)]
pub struct Boundary {
    /// Distinct fixed vertices, ascending.
    pub vertices: Vec<u32>,
    /// Row starts, (unknowns + 1).
    pub starts: Vec<usize>,
    /// Index into `vertices` of every entry.
    pub columns: Vec<u32>,
    /// Value of every entry.
    pub values: Vec<f64>,
}

/// Q_UU and Q_UI of the block of `unknowns`; `number` is from [`number_unknowns`]. The pattern is the structural
/// two-ring, or one-ring where `length` is 0: exact zeros stay, so that the pattern is symmetric.
pub fn assemble(laplacian: &Laplacian, unknowns: &[u32], number: &[u32], length: f64) -> (SymmetricMatrix, Boundary) {
    let assemble = |run: &[u32]| Rows::assemble(laplacian, run, number, length);
    Rows::concatenate(unknowns.par_chunks(ROWS_A_RUN).map(assemble).collect())
}

/// Assembled rows of Q of a run of unknowns: the lower triangle of Q_UU, read as columns of it, and Q_UI with
/// vertices in place of columns.
#[derive(Default)]
struct Rows {
    unknown_ends: Vec<usize>,
    unknown_rows: Vec<u32>,
    unknown_values: Vec<f64>,
    known_ends: Vec<usize>,
    known_vertices: Vec<u32>,
    known_values: Vec<f64>,
}

impl Rows {
    fn assemble(laplacian: &Laplacian, unknowns: &[u32], number: &[u32], length: f64) -> Self {
        let mut rows = Self::default();
        let (mut sum, mut entries) = (RowSum::new(), Vec::new());
        for &u in unknowns {
            row_of_q(laplacian, u, length, &mut sum);
            sum.drain_sorted(&mut entries);
            for &(v, value) in &entries {
                let k = number[v as usize];
                if k == NONE {
                    rows.known_vertices.push(v);
                    rows.known_values.push(value);
                } else if v >= u {
                    rows.unknown_rows.push(k);
                    rows.unknown_values.push(value);
                }
            }
            rows.unknown_ends.push(rows.unknown_rows.len());
            rows.known_ends.push(rows.known_vertices.len());
        }
        rows
    }

    fn concatenate(parts: Vec<Self>) -> (SymmetricMatrix, Boundary) {
        let mut matrix = SymmetricMatrix { column_starts: vec![0], ..SymmetricMatrix::default() };
        let mut boundary = Boundary { starts: vec![0], ..Boundary::default() };
        for part in parts {
            let (unknown_offset, known_offset) = (matrix.rows.len(), boundary.columns.len());
            matrix.column_starts.extend(part.unknown_ends.iter().map(|end| unknown_offset + end));
            matrix.rows.extend(part.unknown_rows);
            matrix.values.extend(part.unknown_values);
            boundary.starts.extend(part.known_ends.iter().map(|end| known_offset + end));
            boundary.columns.extend(part.known_vertices);
            boundary.values.extend(part.known_values);
        }
        boundary.number_columns();
        (matrix, boundary)
    }
}

impl Boundary {
    /// Turns vertices in `columns` into indices of the distinct ones.
    fn number_columns(&mut self) {
        self.vertices.clone_from(&self.columns);
        self.vertices.sort_unstable();
        self.vertices.dedup();
        let vertices = &self.vertices;
        self.columns.par_iter_mut().with_min_len(4096).for_each(|column| {
            *column = vertices.binary_search(column).expect("collected from the same list") as u32;
        });
    }
}

/// Adds row u of Q to `sum`.
fn row_of_q(laplacian: &Laplacian, u: u32, length: f64, sum: &mut RowSum) {
    add_row_of_s(laplacian, u, 1.0, sum);
    if length > 0.0 {
        let (neighbours, cotangents) = laplacian.row(u as usize);
        let l2 = length * length;
        let scale = |a: u32, s_ua: f64| l2 * s_ua / laplacian.mass(a as usize);
        add_row_of_s(laplacian, u, scale(u, laplacian.diagonal(u as usize)), sum);
        for (&a, &cotangent) in std::iter::zip(neighbours, cotangents) {
            add_row_of_s(laplacian, a, scale(a, -cotangent), sum);
        }
    }
}

fn add_row_of_s(laplacian: &Laplacian, i: u32, scale: f64, sum: &mut RowSum) {
    let (neighbours, cotangents) = laplacian.row(i as usize);
    sum.add(i, scale * laplacian.diagonal(i as usize));
    for (&j, &cotangent) in std::iter::zip(neighbours, cotangents) {
        sum.add(j, -scale * cotangent);
    }
}

/// A sparse row under construction: a small hash table from vertex to value. Sorting the fifty-odd terms of a two-ring
/// instead makes blocks and assembly together 1.6 times slower.
struct RowSum {
    slots: Vec<(u32, f64)>,
    used: Vec<u32>,
}

impl RowSum {
    fn new() -> Self {
        Self { slots: vec![(NONE, 0.0); 128], used: Vec::new() }
    }

    fn add(&mut self, vertex: u32, value: f64) {
        let slot = self.slot(vertex);
        if self.slots[slot].0 == NONE {
            self.slots[slot].0 = vertex;
            self.used.push(slot as u32);
        }
        self.slots[slot].1 += value;
        if self.used.len() * 2 > self.slots.len() {
            self.grow();
        }
    }

    /// Where `vertex` is, or the empty slot where it belongs.
    fn slot(&self, vertex: u32) -> usize {
        let last = self.slots.len() - 1;
        let mut slot = vertex.wrapping_mul(0x9E37_79B1) as usize >> 8 & last;
        while self.slots[slot].0 != vertex && self.slots[slot].0 != NONE {
            slot = (slot + 1) & last;
        }
        slot
    }

    fn grow(&mut self) {
        let entries: Vec<(u32, f64)> = self.used.iter().map(|&slot| self.slots[slot as usize]).collect();
        self.slots = vec![(NONE, 0.0); 2 * self.slots.len()];
        self.used.clear();
        for entry in entries {
            let slot = self.slot(entry.0);
            self.slots[slot] = entry;
            self.used.push(slot as u32);
        }
    }

    /// Moves the row into `entries`, by vertex, and forgets it.
    fn drain_sorted(&mut self, entries: &mut Vec<(u32, f64)>) {
        entries.clear();
        for slot in self.used.drain(..) {
            entries.push(std::mem::replace(&mut self.slots[slot as usize], (NONE, 0.0)));
        }
        entries.sort_unstable_by_key(|&(vertex, _)| vertex);
    }
}
