//! The rows of all vertices once everything is solved for.

use super::block::{Block, BlockRows};
use super::constraint::Constraint;
use super::rows::{KnownRows, Ragged, Row};
use super::screened::Found;
use crate::adjacency::NONE;

/// Magnitude that is not worth to be kept: a tenth of what a screened solve leaves out.
const NOTHING: f64 = 1e-7;

/// The rows of all vertices, before anybody clamps or normalises them.
pub struct Filled<'a> {
    known: KnownRows<'a>,
    blocks: &'a [Block],
    rows: Vec<BlockRows<'a>>,
    /// Block and place in it of each vertex of the mesh that was solved on; [`NONE`] twice where nothing was solved for.
    places: Vec<(u32, u32)>,
}

impl<'a> Filled<'a> {
    pub(super) fn new(known: KnownRows<'a>, blocks: &'a [Block], rows: Vec<BlockRows<'a>>) -> Self {
        let mut places = vec![(NONE, NONE); known.known.unknown.len()];
        for (b, block) in blocks.iter().enumerate() {
            for (k, &i) in block.unknowns().iter().enumerate() {
                places[i as usize] = (b as u32, k as u32);
            }
        }
        Self { known, blocks, rows, places }
    }

    fn place(&self, i: usize) -> (u32, u32) {
        self.places[self.known.weld.map_or(i, |weld| weld.class_of()[i] as usize)]
    }

    /// Whether the row of vertex `i` was solved for.
    pub fn is_solved(&self, i: usize) -> bool {
        self.place(i).0 != NONE
    }

    /// Appends the row of vertex `i` to `out`, by column: solved for, or the given one. Nothing is appended for a free
    /// vertex that no known one is connected to.
    pub fn append_row(&self, i: usize, out: &mut Row) {
        let at = self.known.weld.map_or(i, |weld| weld.class_of()[i] as usize);
        match self.places[at] {
            (NONE, _) => match self.known.known.constraints[at] {
                Constraint::Fixed => self.known.append(at as u32, out),
                // Without a triangle there is nothing but the row it is pulled to.
                Constraint::Soft(b) if b > 0.0 => self.known.append(at as u32, out),
                Constraint::Soft(_) | Constraint::Free => {}
            },
            (b, k) => self.rows[b as usize].append_row(k as usize, out),
        }
    }

    /// What each of the four solves of a screened problem has found, if they were all kept.
    pub fn found(&self) -> Found {
        let table = |solve: usize| {
            Ragged::new(self.places.len(), |i, out| {
                if let (b, k) = self.places[i]
                    && b != NONE
                {
                    let row = self.rows[b as usize].found(solve, k as usize);
                    out.extend(row.filter(|(_, value)| value.abs() > NOTHING).map(|(c, value)| (c, value as f32)));
                }
            })
        };
        Found([0, 1, 2, 3].map(table))
    }

    /// The smallest value solved for, 0 where nothing was.
    pub fn minimum(&self) -> f64 {
        let least = std::iter::zip(self.blocks, &self.rows).map(|(block, rows)| rows.minimum(block.unknowns().len()));
        least.min_by(f64::total_cmp).unwrap_or(0.0)
    }

    /// The largest backward error of any block's solve.
    pub fn largest_residual(&self) -> f64 {
        self.rows.iter().map(BlockRows::residual).fold(0.0, f64::max)
    }
}
