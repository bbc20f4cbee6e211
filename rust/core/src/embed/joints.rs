//! Joints relative to the surface around them.

use glam::{DMat4, DVec3, DVec4};

use super::Template;
use super::template::Donor;
use crate::error::Result;
use crate::inside::Winding;
use crate::mesh::TriMesh;
use crate::progress::Progress;
use crate::registration::Match;
use crate::weights::Weights;
use crate::welded::Welded;

/// Joints closer than this share of the skeleton's size are one.
const SAME_JOINT: f64 = 1e-4;
/// Distance from its match at which a vertex is trusted half, as a share of the size.
const TRUSTED: f64 = 0.02;
/// Share of the vertices of one bone alone beside those that two bones have in common.
const ALONE: f64 = 0.05;
/// Pairs of bones farther from being mirror images than this share of the size are left alone.
const MIRRORED: f64 = 0.03;
/// Steps by which a joint outside is moved towards the middle of its surroundings.
const STEPS: usize = 40;

/// The template's surface before and after it was drawn onto the mesh, and the bones that move it.
pub(super) struct Surface<'a> {
    pub positions: &'a [DVec3],
    moved: Vec<DVec3>,
    areas: Vec<f64>,
    /// How far each vertex is to be trusted, 0 to 1.
    confidence: Vec<f64>,
    weights: &'a Weights,
    first: &'a [u32],
    size: f64,
}

impl<'a> Surface<'a> {
    /// `positions` (U) are the vertices of `body` as they were before, `moved` (U) on the mesh, whose diagonal is `size`;
    /// `matches` (U) are their points on it.
    pub fn new(
        body: &'a Welded,
        positions: &'a [DVec3],
        weights: &'a Weights,
        moved: &[DVec3],
        matches: &[Match],
        size: f64,
    ) -> Self {
        let mut areas = vec![0.0; positions.len()];
        for t in &body.triangles {
            let [a, b, c] = t.map(|i| positions[i as usize]);
            let third = (b - a).cross(c - a).length() / 6.0;
            t.iter().for_each(|&i| areas[i as usize] += third);
        }
        let trust = |(at, &z): (&Match, &DVec3)| {
            let far = at.position.distance(z) / (TRUSTED * size);
            at.cosine.max(0.0) / (1.0 + far * far)
        };
        let confidence = matches.iter().zip(moved).map(trust).collect();
        // Where a match is trusted, the mesh itself is the place.
        let settled = |(at, &z): (&Match, &DVec3)| z.lerp(at.position, trust((at, &z)));
        let moved = matches.iter().zip(moved).map(settled).collect();
        Self { positions, moved, areas, confidence, weights, first: &body.first, size }
    }

    /// The share of each vertex (U) in a joint between some bones: what they have in common, or what lies around the joint if
    /// they move nothing.
    fn shares(&self, bones: &[usize], joint: DVec3) -> Vec<f64> {
        let of_vertex = |(u, &area): (usize, &f64)| {
            let (found, values) = self.weights.row(self.first[u] as usize);
            let weight = |bone: usize| {
                let entries = std::iter::zip(found, values).filter(|(b, _)| **b as usize == bone);
                entries.map(|(_, &value)| f64::from(value)).sum::<f64>()
            };
            let weights: Vec<f64> = bones.iter().map(|&bone| weight(bone)).collect();
            let alone: f64 = weights.iter().sum();
            let together = if weights.len() > 1 { weights.iter().product::<f64>().max(0.0).sqrt() } else { alone };
            area * (together + ALONE * alone)
        };
        let shares: Vec<f64> = self.areas.iter().enumerate().map(of_vertex).collect();
        if shares.iter().filter(|&&share| share > 0.0).count() >= 4 {
            return shares;
        }
        let least = (1e-4 * self.size).powi(2);
        let near = |(p, area): (&DVec3, &f64)| area / (p.distance_squared(joint) + least).powi(2);
        self.positions.iter().zip(&self.areas).map(near).collect()
    }

    /// Where `joint` goes: the affine combination `w_i = p_i (a + b . x_i)` of smallest norm by the shares p that is the joint
    /// on the template, evaluated on the mesh. Returns the middle of the surroundings and their confidence too.
    fn place(&self, bones: &[usize], joint: DVec3) -> (DVec3, DVec3, f64) {
        let shares = self.shares(bones, joint);
        let total: f64 = shares.iter().sum();
        let mut middle = DVec3::ZERO;
        let mut moments = DMat4::ZERO;
        for (p, x) in shares.iter().zip(self.positions) {
            middle += p / total * *x;
        }
        let scale = 1.0 / self.spread(&shares, middle, total).max(f64::MIN_POSITIVE);
        let lifted = |x: DVec3| (scale * (x - middle)).extend(1.0);
        for (p, &x) in shares.iter().zip(self.positions) {
            let h = lifted(x);
            moments += DMat4::from_cols(h * h.x, h * h.y, h * h.z, h * h.w) * (p / total);
        }
        // Flat surroundings leave a direction open.
        moments += DMat4::from_diagonal(DVec4::new(1e-4, 1e-4, 1e-4, 0.0));
        let multipliers = moments.inverse() * lifted(joint);
        let (mut place, mut centre, mut confidence) = (DVec3::ZERO, DVec3::ZERO, 0.0);
        for (u, p) in shares.iter().enumerate() {
            let share = p / total;
            place += share * multipliers.dot(lifted(self.positions[u])) * self.moved[u];
            centre += share * self.moved[u];
            confidence += share * self.confidence[u];
        }
        (place, centre, confidence)
    }

    fn spread(&self, shares: &[f64], middle: DVec3, total: f64) -> f64 {
        let squares = shares.iter().zip(self.positions).map(|(p, x)| p * x.distance_squared(middle));
        (squares.sum::<f64>() / total).sqrt()
    }
}

/// Heads and tails of all bones on the mesh.
pub(super) struct Joints {
    pub heads: Vec<DVec3>,
    pub tails: Vec<DVec3>,
    pub confidence: Vec<f32>,
    /// The middle of what surrounds each head.
    centres: Vec<DVec3>,
    /// The child whose head is a bone's tail.
    child: Vec<Option<usize>>,
    size: f64,
}

impl Joints {
    pub fn new(template: &Template<'_>, surface: &Surface<'_>) -> Self {
        let count = template.len();
        let heads: Vec<DVec3> = (0..count).map(|j| template.head(j)).collect();
        let extent = heads.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), &p| (l.min(p), h.max(p)));
        let same = SAME_JOINT * extent.0.distance(extent.1);
        let continues = |j: usize| {
            let is_child = |&k: &usize| template.parent(k) == Some(j) && heads[k].distance(template.tail(j)) <= same;
            (0..count).find(is_child)
        };
        let mut joints = Self {
            heads: Vec::new(),
            tails: Vec::new(),
            confidence: Vec::new(),
            centres: Vec::new(),
            child: (0..count).map(continues).collect(),
            size: surface.size,
        };
        for (j, &head) in heads.iter().enumerate() {
            let bones: Vec<usize> = std::iter::once(j).chain(template.parent(j)).collect();
            let (place, centre, confidence) = surface.place(&bones, head);
            joints.heads.push(place);
            joints.centres.push(centre);
            joints.confidence.push(confidence.clamp(0.0, 1.0) as f32);
            joints.tails.push(surface.place(&[j], template.tail(j)).0);
        }
        joints.connect();
        joints
    }

    fn connect(&mut self) {
        for j in 0..self.heads.len() {
            if let Some(child) = self.child[j] {
                self.tails[j] = self.heads[child];
            }
        }
    }

    /// Makes pairs of bones mirror images and puts those of the middle on the plane between them. Returns whether there is one.
    pub fn make_symmetric(&mut self, template: &Template<'_>, mirror: &[i32]) -> bool {
        let pairs = || (0..mirror.len()).filter_map(|j| usize::try_from(mirror[j]).ok().map(|k| (j, k)));
        let across: DVec3 = pairs()
            .filter(|(j, k)| j < k)
            .map(|(j, k)| template.head(k) - template.head(j))
            .fold(DVec3::ZERO, |sum, step| if sum.dot(step) < 0.0 { sum - step } else { sum + step });
        let normal = across.normalize_or_zero();
        if normal == DVec3::ZERO {
            return false;
        }
        let offset = |heads: &dyn Fn(usize) -> DVec3| {
            let (sum, count) = pairs().fold((0.0, 0), |(s, n), (j, k)| (s + normal.dot(heads(j) + heads(k)), n + 2));
            sum / f64::from(count)
        };
        let (before, after) = (offset(&|j| template.head(j)), offset(&|j| self.heads[j]));
        let reflect = |p: DVec3, offset: f64| p - 2.0 * (normal.dot(p) - offset) * normal;
        let scale = self.size / template_size(template);
        let (heads, tails) = (self.heads.clone(), self.tails.clone());
        for (j, k) in pairs() {
            let error = template.head(j).distance(reflect(template.head(k), before)) * scale;
            if error < MIRRORED * self.size {
                self.heads[j] = 0.5 * (heads[j] + reflect(heads[k], after));
                self.tails[j] = 0.5 * (tails[j] + reflect(tails[k], after));
            }
        }
        self.connect();
        true
    }

    /// Moves heads that are outside although the template's are inside. Returns the bones for which that was not possible.
    pub fn move_inside(
        &mut self,
        template: &Template<'_>,
        donor: &Donor<'_>,
        mesh: &TriMesh<'_>,
        progress: &Progress,
    ) -> Result<Vec<u32>> {
        let own = Winding::new(&donor.mesh).are_inside(template.heads, progress)?;
        let winding = Winding::new(mesh);
        let inside = |p: DVec3| winding.is_inside(p.as_vec3().to_array());
        let mut outside = Vec::new();
        for j in (0..self.heads.len()).filter(|&j| own[j]) {
            if inside(self.heads[j]) {
                continue;
            }
            let (from, to) = (self.heads[j], self.centres[j]);
            let step = |k: usize| from.lerp(to, k as f64 / STEPS as f64);
            match (1..=STEPS).find(|&k| inside(step(k))) {
                // A little farther than the surface itself.
                Some(k) => {
                    self.heads[j] = if inside(step((k + 2).min(STEPS))) { step((k + 2).min(STEPS)) } else { step(k) }
                }
                None => outside.push(j as u32),
            }
        }
        self.connect();
        Ok(outside)
    }
}

/// Diagonal of the box around all heads.
fn template_size(template: &Template<'_>) -> f64 {
    let heads = (0..template.len()).map(|j| template.head(j));
    let (low, high) = heads.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), p| (l.min(p), h.max(p)));
    low.distance(high).max(f64::MIN_POSITIVE)
}
