//! Detail of the source's weights that a garment keeps even where it is smoothed.
//!
//! Smoothing over the width of a gap would blur the sharp changes at elbows and knees as well. Where two neighbours' points lie
//! on the source as the neighbours themselves lie to each other, the change of weight between them is the source's own and is
//! kept; where the points lie apart, as on two legs, or the surfaces tilt, the change is an accident of matching and is not.
//! With t the trust in an edge and `S_t` the stiffness whose edges are scaled by it, what is solved is
//! `S W + b (W - W0) = S_t W0`: gradient-domain blending (Pérez, Gangnet, Blake, *Poisson Image Editing*, SIGGRAPH 2003,
//! doi 10.1145/882262.882269) with the source's weights as guidance.

use glam::DVec3;
use rayon::prelude::*;

use super::Source;
use super::matching::Matches;
use crate::fill::{Constraint, Fill, Row};

/// Share of a trusted change that is kept at most; all of it would keep more torn edges as well.
const KEPT: f64 = 0.85;
/// Stretch of an edge on the source, beyond its own length, at which its change is trusted by half.
const STRETCH: f64 = 0.5;
/// Power of the cosine between the normals.
const TILT: i32 = 4;
/// Gap, as a share of the source's size, at which it is trusted by half.
const GAP: f64 = 0.05;

/// What a vertex's point says of the edges around it.
struct Place {
    /// On the source, world space.
    point: DVec3,
    gap: f64,
    cosine: f64,
}

impl Place {
    /// Trust, 0 to 1, in the change of weight along an edge of this `length` between two vertices.
    fn trust(&self, other: &Self, length: f64, source_size: f64) -> f64 {
        let stretch = self.point.distance(other.point) / length.max(f64::MIN_POSITIVE);
        let excess = ((stretch - 1.0).max(0.0) / STRETCH).powi(2);
        let gap = (self.gap.max(other.gap) / (GAP * source_size)).powi(4);
        KEPT * self.cosine.min(other.cosine).powi(TILT) / ((1.0 + excess) * (1.0 + gap))
    }
}

/// The source's rows, and what is added to those of soft vertices so that detail is kept: `S_t W0 / b`.
#[derive(Debug)]
pub(super) struct Detail {
    own: Vec<Row>,
    added: Vec<Row>,
}

impl Detail {
    /// `rows` appends the source's row of a vertex, `constraints` (V) say which are known and which are soft.
    pub fn new(
        source: &Source,
        matches: &Matches,
        fill: &Fill,
        constraints: &[Constraint],
        rows: impl Fn(u32, &mut Row) + Sync,
    ) -> Self {
        let own = |i: usize| {
            let mut row = Row::new();
            if constraints[i].is_known() {
                rows(i as u32, &mut row);
            }
            row
        };
        let own: Vec<Row> = (0..constraints.len()).into_par_iter().with_min_len(256).map(own).collect();
        let added = guidance(source, matches, fill, constraints, &own);
        Self { own, added }
    }

    /// The source's row of vertex `i`, empty where it is not asked for.
    pub fn own(&self, i: u32) -> &Row {
        &self.own[i as usize]
    }

    /// What is added to it.
    pub fn added(&self, i: u32) -> &Row {
        &self.added[i as usize]
    }
}

/// `S_t W0 / b`, a row for each soft vertex; edges to vertices without a row count for nothing.
fn guidance(source: &Source, matches: &Matches, fill: &Fill, constraints: &[Constraint], own: &[Row]) -> Vec<Row> {
    let place = |i: usize| {
        let (point, (gap, cosine)) = (matches.mean_position(source, i), matches.gap_and_cosine(i));
        Place { point, gap, cosine: cosine.abs() }
    };
    let places: Vec<Place> = (0..own.len()).into_par_iter().with_min_len(512).map(place).collect();
    let (mesh, laplacian) = (fill.mesh(), fill.laplacian());
    let row = |sum: &mut RowSum, i: usize| {
        let Constraint::Soft(confidence) = constraints[i] else { return Row::new() };
        for (&j, &cotangent) in std::iter::zip(laplacian.row(i).0, laplacian.row(i).1) {
            let (here, there) = (&own[i], &own[j as usize]);
            if here == there || here.is_empty() || there.is_empty() {
                continue;
            }
            let length = mesh.position(i as u32).distance(mesh.position(j));
            let weight = cotangent * places[i].trust(&places[j as usize], length, source.size()) / confidence;
            sum.add(here, weight);
            sum.add(there, -weight);
        }
        sum.take()
    };
    let start = || RowSum::new(source.n_bones());
    (0..own.len()).into_par_iter().with_min_len(256).map_init(start, row).collect()
}

/// A row under construction, dense, and the columns that it has.
struct RowSum {
    values: Vec<f64>,
    is_used: Vec<bool>,
    columns: Vec<u32>,
}

impl RowSum {
    fn new(n_columns: u32) -> Self {
        let n = n_columns as usize;
        Self { values: vec![0.0; n], is_used: vec![false; n], columns: Vec::new() }
    }

    fn add(&mut self, row: &Row, factor: f64) {
        for &(column, value) in row {
            let k = column as usize;
            if !std::mem::replace(&mut self.is_used[k], true) {
                self.columns.push(column);
            }
            self.values[k] += factor * value;
        }
    }

    /// The row, by column, and an empty one in its place.
    fn take(&mut self) -> Row {
        self.columns.sort_unstable();
        let row =
            self.columns.iter().map(|&column| (column, std::mem::take(&mut self.values[column as usize]))).collect();
        self.columns.drain(..).for_each(|column| self.is_used[column as usize] = false);
        row
    }
}
