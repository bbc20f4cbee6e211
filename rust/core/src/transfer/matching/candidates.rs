//! One or several points of the source per target vertex.

use std::collections::BTreeSet;

use glam::DVec3;
use rayon::prelude::*;

use super::super::Source;
use super::super::source::merge_and_normalise;
use crate::fill::Row;
use crate::surface::SurfacePoint;

/// The points each vertex takes its weights from, with shares.
#[derive(Debug)]
pub struct Candidates {
    /// The first point of each vertex, (V).
    first: Vec<SurfacePoint>,
    /// All points of the vertices that have several; none if no vertex has.
    several: Several,
    /// Vertices whose first point is the only one, whatever they had before.
    replaced: BTreeSet<u32>,
}

#[derive(Debug, Default)]
struct Several {
    /// Where the points of each vertex start, (V+1); empty if no vertex has several. Vertices with one have none here.
    starts: Vec<u32>,
    points: Vec<(SurfacePoint, f64)>,
}

impl Several {
    /// The points of vertex `i`, empty if its first one is all it has.
    fn of(&self, i: usize) -> &[(SurfacePoint, f64)] {
        match self.starts.get(i..i + 2) {
            Some(&[start, end]) => &self.points[start as usize..end as usize],
            _ => &[],
        }
    }
}

impl Candidates {
    /// One point for each vertex, (V).
    pub fn one_each(points: Vec<SurfacePoint>) -> Self {
        Self { first: points, several: Several::default(), replaced: BTreeSet::new() }
    }

    /// The `first` point of each vertex (V), and for those that have more than one, all of them with their shares (V lists,
    /// empty for the others).
    pub fn several<'a>(first: Vec<SurfacePoint>, all: impl Iterator<Item = &'a [(SurfacePoint, f64)]>) -> Self {
        let mut several = Several { starts: Vec::with_capacity(first.len() + 1), points: Vec::new() };
        several.starts.push(0);
        for points in all {
            several.points.extend(points);
            several.starts.push(several.points.len() as u32);
        }
        Self { first, several, replaced: BTreeSet::new() }
    }

    /// The first point of each vertex, (V).
    pub fn first_points(&self) -> &[SurfacePoint] {
        &self.first
    }

    /// Lets another point stand for all that vertex `i` has; the one that stood first.
    pub(super) fn replace(&mut self, i: u32, point: SurfacePoint) -> SurfacePoint {
        self.replaced.insert(i);
        std::mem::replace(&mut self.first[i as usize], point)
    }

    /// Undoes [`Candidates::replace`].
    pub(super) fn restore(&mut self, i: u32, first: SurfacePoint) {
        self.replaced.remove(&i);
        self.first[i as usize] = first;
    }

    /// All points of vertex `i`, empty if its first one is all it has.
    fn several_of(&self, i: usize) -> &[(SurfacePoint, f64)] {
        if self.replaced.contains(&(i as u32)) { &[] } else { self.several.of(i) }
    }

    /// Whether the source has any weight at the points of each vertex, (V).
    pub(super) fn weighted(&self, source: &Source) -> Vec<bool> {
        let has_weight = |i| match self.several_of(i) {
            [] => source.is_weighted(&self.first[i]),
            points => points.iter().any(|(point, _)| source.is_weighted(point)),
        };
        (0..self.first.len()).into_par_iter().with_min_len(1024).map(has_weight).collect()
    }

    /// Mean of the points of vertex `i`, world space.
    pub(super) fn mean_position(&self, source: &Source, i: usize) -> DVec3 {
        match self.several_of(i) {
            [] => source.position(&self.first[i]),
            points => points.iter().map(|(point, share)| source.position(point) * *share).sum(),
        }
    }

    /// Appends the mean of the source's rows at the points of vertex `i`, normalised, in bone order.
    pub(super) fn append_row(&self, source: &Source, i: usize, row: &mut Row) {
        let points = self.several_of(i);
        if points.is_empty() {
            return source.blend(&self.first[i], row);
        }
        let start = row.len();
        for (point, share) in points {
            let before = row.len();
            source.blend(point, row);
            row[before..].iter_mut().for_each(|(_, value)| *value *= share);
        }
        merge_and_normalise(row, start);
    }
}
