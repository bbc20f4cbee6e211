//! Joints where solving has done worse than skinning.

use glam::{DAffine3, Vec3};

use super::constraint::Axis;
use super::coupling::place;
use super::local::Local;
use super::predictor::{linear, skinned};
use super::skin::corners;
use super::solver::Frame;

/// Loss of a joint's volume from which it is asked whether skinning did better.
const HARM: f64 = 0.1;
/// Joints of a smaller radius, in cells, are judged by the volume about them whatever they are, and by their edges: a ball in a
/// finger's joint has no room in cells larger than it is.
const SMALL: f32 = 1.0;
/// Share of a small joint's skin that may have edges of [`LONG`] times their length at rest, beyond what skinning stretches.
const TORN: f64 = 0.05;
/// Edges this many times as long as at rest count as torn.
const LONG: f32 = 2.0;

impl Frame<'_> {
    /// Gives joints back to skinning where solving has done worse: on very coarse skin nothing is left of the inner side
    /// once it is pressed into the plane. `left` is the number of pairs of triangles that pass through each other.
    /// `missing` is the share of each joint's volume that balloons could not restore. Returns whether any was given back.
    pub(super) fn undo_harm(&mut self, pose: &[DAffine3], axes: &[Axis], missing: &[f64], left: usize) -> bool {
        let lost =
            |frame: &Self, k: usize, places: &[Vec3]| frame.measure(k, pose, &axes[k], &|p| places[p as usize]).0;
        let is_restored = |k: usize| missing[k].abs() <= HARM / 2.0;
        let is_small = |k: usize| self.active[k].joint.radius < SMALL;
        let is_judged = |k: usize| self.is_measured(k, pose) || is_small(k);
        let may_harm = |&k: &usize| is_judged(k) && (left > 0 || !is_restored(k));
        let solved = self.places();
        let doubtful: Vec<usize> = (0..self.active.len()).filter(may_harm).collect();
        let suspects: Vec<usize> = doubtful.into_iter().filter(|&k| lost(self, k, &solved).abs() > HARM).collect();
        let torn: Vec<usize> =
            (0..self.active.len()).filter(|&k| is_small(k) && self.torn(k, &solved) > TORN).collect();
        if suspects.is_empty() && torn.is_empty() && left == 0 {
            return false;
        }
        let skins = [skinned, linear].map(|skin| skin(self.prepared, &self.local.region, pose));
        let totals = skins.each_ref().map(|skin| self.own_pairs(skin));
        let skin = &skins[usize::from(totals[1] < totals[0])];
        let worse = |k: &usize| lost(self, *k, &solved).abs() > lost(self, *k, skin).abs() + HARM / 2.0;
        let is_torn = |&k: &usize| self.torn(k, &solved) > self.torn(k, skin) + TORN;
        let worse: Vec<usize> = suspects.into_iter().filter(worse).chain(torn.into_iter().filter(is_torn)).collect();
        worse.iter().for_each(|&k| self.give_back(k, skin));
        self.undo_folds(skin, totals[0].min(totals[1])) || !worse.is_empty()
    }

    /// The share of a joint's free skin vertices with an edge of [`LONG`] times its length at rest.
    fn torn(&self, k: usize, places: &[Vec3]) -> f64 {
        let region = &*self.local.region;
        let is_long =
            |p: u32, (&n, length): (&u32, &f32)| places[p as usize].distance(places[n as usize]) > LONG * length;
        let has_long = |p: u32| std::iter::zip(region.ring(p), region.ring_lengths(p)).any(|edge| is_long(p, edge));
        let particles = self.local.free[k].iter().map(|member| member.particle);
        let skin: Vec<u32> = particles.filter(|&p| p as usize >= self.local.nodes).collect();
        skin.iter().filter(|&&p| has_long(p)).count() as f64 / skin.len().max(1) as f64
    }

    /// Gives back joints until no more than `most` pairs are left; returns whether any was.
    fn undo_folds(&mut self, skin: &[Vec3], most: usize) -> bool {
        let (contact, region) = (&self.prepared.contact, self.local.region.clone());
        let (mut pairs, mut is_changed) = (contact.all_own_pairs(&*region, &self.places(), &self.slabs), false);
        for k in 0..self.active.len() {
            if pairs.len() <= most {
                return is_changed;
            }
            let members: Vec<u32> = region.members(k).map(|member| member.particle).collect();
            // Only what has a corner in a pair can part it.
            let corners = corners(&*region, &pairs);
            if members.iter().all(|member| corners.binary_search(member).is_err()) {
                continue;
            }
            let before = self.local.particles.clone();
            self.give_back(k, skin);
            let now = contact.all_own_pairs_again(&*region, &self.places(), (pairs.clone(), &members), &self.slabs);
            if now.len() < pairs.len() {
                (pairs, is_changed) = (now, true);
            } else {
                self.local.particles = before;
            }
        }
        if pairs.len() > most {
            (0..self.active.len()).for_each(|k| self.give_back(k, skin));
        }
        is_changed || pairs.len() > most
    }

    pub(super) fn places(&self) -> Vec<Vec3> {
        self.local.particles.iter().map(place).collect()
    }

    /// How many pairs of the region's triangles pass through each other within one piece of the skin and do not at rest.
    fn own_pairs(&self, places: &[Vec3]) -> usize {
        self.prepared.contact.all_own_pairs(&*self.local.region, places, &self.slabs).len()
    }

    /// Puts a joint's skin where skinning has it.
    fn give_back(&mut self, k: usize, skin: &[Vec3]) {
        let Local { region, particles, .. } = &mut self.local;
        for member in region.members(k) {
            let particle = &mut particles[member.particle as usize];
            [particle[0], particle[1], particle[2]] = skin[member.particle as usize].to_array();
        }
    }
}
