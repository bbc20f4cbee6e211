//! Which place each joint of the reduced template takes: branch and bound over the tree.
//!
//! The penalty of a limb depends on the places of its two ends, so that the smallest penalty of a whole branch for each
//! place of its root follows from its children's (dynamic programming). That is the bound; what it leaves out is that limbs
//! which start at one joint must not run into each other.

use glam::DVec3;

use super::Alignment;
use super::places::Places;
use super::reduced::{Limb, Reduced};
use super::symmetry::{Side, Symmetry};
use crate::error::Result;
use crate::progress::Progress;

/// How much each penalty counts.
const LENGTH: f64 = 1.0;
const DIRECTION: f64 = 0.6;
const POSITION: f64 = 0.6;
const DETOUR: f64 = 1.0;
const NOT_AN_END: f64 = 1.5;
const SHARED_WAY: f64 = 3.0;

/// Distance, as a share of the diameter, from where it should lie at which a place is as bad as any farther one.
const FAR: f64 = 0.25;

/// Partial embeddings looked at; by then the best one found is taken.
const MOST_STEPS: usize = 100_000;

/// The place of each joint of the reduced template.
#[derive(Debug)]
pub(super) struct Chosen {
    /// Place of each joint; that of a joint on the negative side is its image's.
    pub(super) places: Vec<usize>,
    /// Penalty of each joint and the limb that leads to it.
    pub(super) penalties: Vec<f64>,
    pub(super) penalty: f64,
}

pub(super) fn choose(
    reduced: &Reduced,
    places: &Places,
    alignment: &Alignment,
    symmetry: Option<&Symmetry>,
    progress: &Progress,
) -> Result<Chosen> {
    let problem = Problem { reduced, places, alignment, symmetry };
    let order: Vec<usize> = (0..reduced.joints.len()).filter(|&k| problem.side(k) != Side::Negative).collect();
    let bounds = problem.bounds(&order);
    progress.check()?;
    let mut search = Search { problem, order, bounds, best: None, taken: Vec::new(), steps: 0 };
    search.descend(0.0);
    let (penalty, taken) = search.best.expect("every joint has a place");
    Ok(search.problem.chosen(&search.order, &taken, penalty))
}

struct Problem<'a> {
    reduced: &'a Reduced,
    places: &'a Places,
    alignment: &'a Alignment,
    symmetry: Option<&'a Symmetry>,
}

impl Problem<'_> {
    fn side(&self, joint: usize) -> Side {
        self.symmetry.map_or(Side::Positive, |symmetry| symmetry.side[joint])
    }

    fn limb(&self, joint: usize) -> Option<&Limb> {
        self.reduced.joints[joint].limb.as_ref()
    }

    /// Of a place for a joint, whatever the others.
    fn unary(&self, joint: usize, place: usize) -> f64 {
        if self.places.side[place] != self.side(joint) {
            return f64::INFINITY;
        }
        let joint = &self.reduced.joints[joint];
        let off = self.alignment.point(joint.position).distance(self.places.points[place]);
        let off = (off / (FAR * self.places.diameter())).min(1.0);
        let end = if joint.is_extremity && !self.places.is_extremity[place] { NOT_AN_END } else { 0.0 };
        POSITION * off * off + end
    }

    /// Of a limb from one place to another.
    fn pair(&self, joint: usize, limb: &Limb, from: usize, to: usize) -> f64 {
        let way = self.places.way(from, to);
        let straight = self.places.points[to] - self.places.points[from];
        let wanted: DVec3 = self.reduced.joints[joint].position - self.reduced.joints[limb.from].position;
        if way == 0.0 {
            return f64::INFINITY;
        }
        let stretch = (way / (self.alignment.scale * limb.length)).ln();
        let turn = 1.0 - straight.normalize_or_zero().dot(wanted.normalize_or_zero());
        let detour = (way / straight.length() / (limb.length / wanted.length().max(1e-9)).max(1.1)).ln().max(0.0);
        LENGTH * stretch * stretch + DIRECTION * turn + DETOUR * detour
    }

    /// For each joint, the smallest penalty of all that hangs on it for every place it may take.
    fn bounds(&self, order: &[usize]) -> Vec<Vec<f64>> {
        let n = self.places.len();
        let mut bounds = vec![vec![0.0; n]; self.reduced.joints.len()];
        for &joint in order.iter().rev() {
            let Some(limb) = self.limb(joint) else { continue };
            let below: Vec<f64> = (0..n).map(|place| self.unary(joint, place) + bounds[joint][place]).collect();
            let open: Vec<usize> = (0..n).filter(|&place| below[place].is_finite()).collect();
            for from in 0..n {
                let penalty = |&to: &usize| self.pair(joint, limb, from, to) + below[to];
                bounds[limb.from][from] += open.iter().map(penalty).fold(f64::INFINITY, f64::min);
            }
        }
        bounds
    }

    /// Of two limbs that start together and share most of their way.
    fn shared(&self, from: usize, to: usize, other: usize) -> f64 {
        let (a, b, apart) = (self.places.way(from, to), self.places.way(from, other), self.places.way(to, other));
        let common = 0.5 * (a + b - apart);
        SHARED_WAY * (common / a.min(b).max(f64::MIN_POSITIVE) - 0.5).max(0.0)
    }

    fn chosen(&self, order: &[usize], taken: &[usize], penalty: f64) -> Chosen {
        let count = self.reduced.joints.len();
        let (mut places, mut penalties) = (vec![0; count], vec![0.0; count]);
        for (&joint, &place) in order.iter().zip(taken) {
            places[joint] = place;
            let limb = self.limb(joint).map_or(0.0, |limb| self.pair(joint, limb, places[limb.from], place));
            penalties[joint] = self.unary(joint, place) + limb;
            if let Some(symmetry) = self.symmetry {
                places[symmetry.joint_image[joint]] = place;
                penalties[symmetry.joint_image[joint]] = penalties[joint];
            }
        }
        Chosen { places, penalties, penalty }
    }
}

struct Search<'a> {
    problem: Problem<'a>,
    /// Joints in the order in which they are placed, parents first.
    order: Vec<usize>,
    bounds: Vec<Vec<f64>>,
    best: Option<(f64, Vec<usize>)>,
    /// Places of the joints placed so far.
    taken: Vec<usize>,
    steps: usize,
}

impl Search<'_> {
    /// Places the next joint in every way that may still be the best, the most promising first. `so_far` is the penalty of
    /// those that are placed.
    fn descend(&mut self, so_far: f64) {
        self.steps += 1;
        if self.taken.len() == self.order.len() {
            if self.best.as_ref().is_none_or(|best| so_far < best.0) {
                self.best = Some((so_far, self.taken.clone()));
            }
            return;
        }
        let joint = self.order[self.taken.len()];
        let rest = self.rest(joint);
        let penalty = |place: usize| so_far + self.penalty(joint, place);
        let n = self.problem.places.len();
        let mut open: Vec<(f64, f64, usize)> = (0..n)
            .map(|place| (penalty(place), place))
            .map(|(p, k)| (p + self.bounds[joint][k] + rest, p, k))
            .collect();
        open.sort_by(|x, y| x.0.total_cmp(&y.0).then(x.2.cmp(&y.2)));
        for (bound, penalty, place) in open {
            let is_worse = self.best.as_ref().is_some_and(|best| bound >= best.0 || self.steps > MOST_STEPS);
            if is_worse {
                break;
            }
            self.taken.push(place);
            self.descend(penalty);
            self.taken.pop();
        }
    }

    fn place_of(&self, joint: usize) -> usize {
        self.taken[self.order.iter().position(|&k| k == joint).expect("parents are placed first")]
    }

    /// Of `place` for `joint`, given those that are placed.
    fn penalty(&self, joint: usize, place: usize) -> f64 {
        let unary = self.problem.unary(joint, place);
        let Some(limb) = self.problem.limb(joint) else { return unary };
        if !unary.is_finite() {
            return unary;
        }
        let from = self.place_of(limb.from);
        let siblings = self.order[..self.taken.len()].iter().zip(&self.taken);
        let siblings = siblings.filter(|&(&k, _)| self.problem.limb(k).is_some_and(|other| other.from == limb.from));
        let shared: f64 = siblings.map(|(_, &other)| self.problem.shared(from, place, other)).sum();
        unary + self.problem.pair(joint, limb, from, place) + shared
    }

    /// A bound for the joints after `joint` that do not hang on it.
    fn rest(&self, joint: usize) -> f64 {
        let after = self.order[self.taken.len() + 1..].iter();
        let bound = |&other: &usize| {
            let limb = self.problem.limb(other)?;
            // What hangs on joints that are not placed is in their own bounds, or in that of `joint`.
            let placed = self.order[..self.taken.len()].contains(&limb.from) && limb.from != joint;
            placed.then(|| self.best_limb(other, limb, self.place_of(limb.from)))
        };
        after.filter_map(bound).sum()
    }

    fn best_limb(&self, joint: usize, limb: &Limb, from: usize) -> f64 {
        let n = self.problem.places.len();
        let open = (0..n).filter(|&to| self.problem.places.side[to] == self.problem.side(joint));
        let penalty =
            |to| self.problem.unary(joint, to) + self.problem.pair(joint, limb, from, to) + self.bounds[joint][to];
        open.map(penalty).fold(f64::INFINITY, f64::min)
    }
}
