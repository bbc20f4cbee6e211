//! Which points of the source a target vertex takes its weights from, and how far they are trusted.
//!
//! A method finds the points of all vertices once ([`Matches::find`]) and turns them into constraints as often as thresholds
//! and mask change ([`Matches::constraints`]). To add one: a file in this folder, a variant of [`MatchMethod`], an entry in
//! [`MatchMethod::ALL`], and an arm in each of those two functions.

mod candidates;
mod closest;
mod confidence;
mod ties;
mod upright;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

pub use candidates::Candidates;
pub use closest::Criteria;
pub(super) use closest::DISTANCE_REFERENCE;

use super::Source;
use crate::fill::{Constraint, Fill, Row};
use crate::surface::SurfacePoint;

/// How matching points are found and trusted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum MatchMethod {
    /// The closest point, copied exactly if its distance and normal are within thresholds and ignored otherwise: the paper's
    /// method.
    #[default]
    ClosestPoint,
    /// The point nearest in position and direction, trusted over a length that grows with gap and tilt, with no threshold.
    Confidence,
}

impl MatchMethod {
    /// All methods, for tests and menus.
    pub const ALL: [Self; 2] = [Self::ClosestPoint, Self::Confidence];
}

/// What the artist asks of one vertex.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum MaskValue {
    /// Never match, always inpaint.
    Inpaint = 0,
    /// Let distance and angle decide.
    Automatic = 1,
    /// Match whatever distance and angle say.
    ForceMatch = 2,
}

/// The target as matching sees it.
#[derive(Debug, Clone, Copy)]
pub struct TargetSurface<'a> {
    /// Positions, (V, 3).
    pub positions: &'a [[f32; 3]],
    /// Triangles, (T, 3).
    pub triangles: &'a [[u32; 3]],
    /// Unit normals, zero where there is no direction, (V, 3).
    pub normals: &'a [Vec3],
    /// Whether the surface faces both ways, so that either direction of the normal will do, (V).
    pub two_sided: &'a [bool],
    /// Whether a vertex has edges but no triangle, so that no direction is asked for, (V).
    pub is_wire: &'a [bool],
}

impl TargetSurface<'_> {
    /// Angle between the normals of vertex `i` and of a point of the source, radians, NaN where one has no length.
    pub(super) fn angle(&self, source: &Source, i: usize, point: &SurfacePoint) -> f32 {
        let angle = angle(source, point, self.normals[i]);
        if self.two_sided[i] { angle.min(std::f32::consts::PI - angle) } else { angle }
    }
}

/// What makes constraints of points, besides the mask.
#[derive(Debug, Clone, Copy)]
pub struct Terms<'a> {
    /// The paper's thresholds.
    pub criteria: Criteria,
    /// Lengths of trust as multiples of gaps.
    pub softness: f64,
    /// The target's areas, edges and islands.
    pub fill: &'a Fill,
}

/// The points of all vertices, found once.
#[derive(Debug)]
pub struct Matches {
    method: MatchMethod,
    candidates: Candidates,
    /// What [`MatchMethod::Confidence`] trusts each vertex by.
    trust: confidence::Trust,
    source_size: f64,
    /// Angle between the target's normal and that of the first candidate (V), radians in [0, pi], NaN where one has no length.
    angles: Vec<f32>,
    /// Whether the source has any weight at the candidates (V).
    weighted: Vec<bool>,
    /// Whether no angle is asked for (V).
    is_wire: Vec<bool>,
    /// The thresholds in force when points were last found.
    criteria: Criteria,
    /// Vertices whose first candidate is not the closest point, with that point and its angle.
    moved: Vec<(u32, SurfacePoint, f32)>,
}

impl Matches {
    /// Finds the points of all vertices of `target` on `source`.
    pub fn find(method: MatchMethod, source: &Source, target: TargetSurface<'_>, criteria: &Criteria) -> Self {
        let (candidates, trust) = match method {
            MatchMethod::ClosestPoint => (closest::find(source, target, criteria.average_ties), Default::default()),
            MatchMethod::Confidence => confidence::find(source, target),
        };
        let points = candidates.first_points().par_iter().with_min_len(1024).enumerate();
        let angles = points.map(|(i, point)| target.angle(source, i, point)).collect();
        let (weighted, is_wire) = (candidates.weighted(source), target.is_wire.to_vec());
        let (criteria, moved) = (*criteria, Vec::new());
        let source_size = source.size();
        let mut matches = Self { method, candidates, trust, source_size, angles, weighted, is_wire, criteria, moved };
        matches.move_flipped(source, target);
        matches
    }

    /// Finds those points again that depend on `criteria`, if they are others.
    pub fn refresh(&mut self, source: &Source, target: TargetSurface<'_>, criteria: &Criteria) {
        if self.criteria != *criteria {
            self.criteria = *criteria;
            for (i, point, angle) in std::mem::take(&mut self.moved) {
                self.candidates.restore(i, point);
                self.angles[i as usize] = angle;
            }
            self.move_flipped(source, target);
            self.refresh_weighted(source);
        }
    }

    /// Moves vertices that would match flipped to a point that looks the right way, if there is one.
    fn move_flipped(&mut self, source: &Source, target: TargetSurface<'_>) {
        let found = match self.method {
            MatchMethod::ClosestPoint => {
                upright::find(source, target, self.candidates.first_points(), &self.angles, &self.criteria)
            }
            // Its cost has preferred them already.
            MatchMethod::Confidence => Vec::new(),
        };
        for (i, point) in found {
            let k = i as usize;
            self.moved.push((i, self.candidates.replace(i, point), self.angles[k]));
            self.angles[k] = target.angle(source, k, &point);
            self.weighted[k] = source.is_weighted(&point);
        }
    }

    /// What `terms` and the artist's `mask` (V, automatic everywhere if absent) make of the points, (V).
    pub fn constraints(&self, terms: &Terms<'_>, mask: Option<&[MaskValue]>) -> Vec<Constraint> {
        match self.method {
            MatchMethod::ClosestPoint => closest::constraints(self, &terms.criteria, mask),
            MatchMethod::Confidence => confidence::constraints(self, terms, mask),
        }
    }

    /// How far each vertex's row is trusted, 0 to 1, given the `constraints` that were made of it (V): all or nothing with
    /// the paper's method, and where the mask decides.
    pub fn confidence(&self, constraints: &[Constraint], softness: f64, mask: Option<&[MaskValue]>) -> Vec<f32> {
        let lengths = self.trust.lengths(softness, self.source_size);
        let is_automatic = |i: usize| mask.is_none_or(|mask| mask[i] == MaskValue::Automatic);
        let confidence = |(i, known): (usize, &Constraint)| match lengths.get(i) {
            Some(&length) if known.is_known() && is_automatic(i) => confidence::confidence(length, self.source_size),
            _ => f32::from(u8::from(known.is_known())),
        };
        constraints.iter().enumerate().map(confidence).collect()
    }

    /// Mean of the points on the source that vertex `i` takes its row from, world space.
    pub(super) fn mean_position(&self, source: &Source, i: usize) -> DVec3 {
        self.candidates.mean_position(source, i)
    }

    /// Distance to them, and the cosine between the normals; only [`MatchMethod::Confidence`] keeps them.
    pub(super) fn gap_and_cosine(&self, i: usize) -> (f64, f64) {
        (self.trust.gap[i], self.trust.cosine[i])
    }

    /// Whether points would be found otherwise by this method and with this choice for ties.
    pub(super) fn differ(&self, method: MatchMethod, average_ties: bool) -> bool {
        self.method != method || self.criteria.average_ties != average_ties
    }

    /// The method that found them.
    pub fn method(&self) -> MatchMethod {
        self.method
    }

    /// The point that distance, angle and island policies refer to, (V).
    pub fn points(&self) -> &[SurfacePoint] {
        self.candidates.first_points()
    }

    /// Angle between the normals at each vertex and at that point (V), radians in [0, pi], NaN where one is missing.
    pub fn angles(&self) -> &[f32] {
        &self.angles
    }

    /// Distance of each vertex (V) to its point, world units.
    pub fn distances(&self) -> Vec<f32> {
        self.points().iter().map(|point| point.distance as f32).collect()
    }

    /// Distances to points that have weights, of the vertices that `is_allowed` accepts.
    pub(super) fn weighted_distances(&self, is_allowed: impl Fn(usize) -> bool) -> impl Iterator<Item = f64> {
        let allowed = move |i: &usize| self.weighted[*i] && is_allowed(*i);
        (0..self.weighted.len()).filter(allowed).map(|i| self.points()[i].distance)
    }

    /// Finds out again which points have weights, after the source's weights changed.
    pub fn refresh_weighted(&mut self, source: &Source) {
        self.weighted = self.candidates.weighted(source);
    }

    /// Appends the weights that vertex `i` takes from the source to `row`: normalised, in bone order. A vertex that the
    /// mask forces takes those of its first point.
    pub fn append_row(&self, source: &Source, mask: Option<&[MaskValue]>, i: u32, row: &mut Row) {
        if mask.is_some_and(|mask| mask[i as usize] == MaskValue::ForceMatch) {
            source.blend(&self.points()[i as usize], row);
        } else {
            self.candidates.append_row(source, i as usize, row);
        }
    }

    /// The smallest distance at which some vertex would match, were the largest one that large.
    pub fn smallest_matching_distance(&self, criteria: &Criteria, mask: Option<&[MaskValue]>) -> Option<f64> {
        let any_distance = Criteria { max_distance: f64::INFINITY, ..*criteria };
        let possible = closest::constraints(self, &any_distance, mask);
        let distances = std::iter::zip(self.points(), possible).filter(|(_, known)| *known != Constraint::Free);
        distances.map(|(point, _)| point.distance).min_by(f64::total_cmp)
    }
}

/// Angle between a target normal and the source normal at `point`, which is the barycentric blend of the
/// vertex normals. By atan2, so that equal normals give exactly zero.
fn angle(source: &Source, point: &SurfacePoint, target_normal: Vec3) -> f32 {
    let corners = source.triangles()[point.triangle as usize];
    let blend: DVec3 = std::iter::zip(corners, point.barycentric)
        .map(|(i, share)| source.normals()[i as usize].as_dvec3() * share)
        .sum();
    let normal = target_normal.as_dvec3();
    if blend.length_squared() == 0.0 || normal.length_squared() == 0.0 {
        return f32::NAN;
    }
    normal.cross(blend).length().atan2(normal.dot(blend)) as f32
}
