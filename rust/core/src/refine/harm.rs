//! Joints where solving has done worse than skinning.

use glam::{DAffine3, Vec3};

use super::constraint::Axis;
use super::coupling::place;
use super::local::Local;
use super::predictor::{linear, skinned};
use super::solver::Frame;

/// Loss of a joint's volume from which it is asked whether skinning did better.
const HARM: f64 = 0.1;

impl Frame<'_> {
    /// Gives joints back to skinning where solving has done worse: on very coarse skin nothing is left of the inner side
    /// once it is pressed into the plane. `left` is the number of pairs of triangles that pass through each other.
    /// `missing` is the share of each joint's volume that balloons could not restore.
    pub(super) fn undo_harm(&mut self, pose: &[DAffine3], axes: &[Axis], missing: &[f64], left: usize) {
        let all = 0..self.active.len();
        let lost =
            |frame: &Self, k: usize, places: &[Vec3]| frame.measure(k, pose, &axes[k], &|p| places[p as usize]).0;
        let may_harm = |&k: &usize| left > 0 || missing[k].is_nan() || missing[k].abs() > HARM / 2.0;
        let doubtful: Vec<usize> = all.clone().filter(may_harm).collect();
        if doubtful.is_empty() {
            return;
        }
        let solved = self.places();
        let suspects: Vec<usize> = doubtful.into_iter().filter(|&k| lost(self, k, &solved).abs() > HARM).collect();
        if suspects.is_empty() && left == 0 {
            return;
        }
        let skins = [skinned, linear].map(|skin| skin(self.prepared, &self.local.region, pose));
        let totals = skins.each_ref().map(|skin| self.pairs(skin).len());
        let skin = &skins[usize::from(totals[1] < totals[0])];
        for k in suspects {
            if lost(self, k, &solved).abs() > lost(self, k, skin).abs() + HARM / 2.0 {
                self.give_back(k, skin);
            }
        }
        let most = totals[0].min(totals[1]);
        let mut left = self.pairs(&self.places());
        for k in all.clone() {
            if left.len() <= most {
                return;
            }
            let before = self.local.particles.clone();
            self.give_back(k, skin);
            let now = self.pairs(&self.places());
            if now.len() < left.len() {
                left = now;
            } else {
                self.local.particles = before;
            }
        }
        if left.len() > most {
            all.for_each(|k| self.give_back(k, skin));
        }
    }

    pub(super) fn places(&self) -> Vec<Vec3> {
        self.local.particles.iter().map(place).collect()
    }

    /// The pairs of the region's triangles that pass through each other, but for those that do at rest.
    pub(super) fn pairs(&self, places: &[Vec3]) -> Vec<[u32; 2]> {
        self.prepared.contact.all_pairs(&*self.local.region, places, &self.slabs)
    }

    /// Puts a joint's skin where skinning has it.
    fn give_back(&mut self, k: usize, skin: &[Vec3]) {
        let Local { region, particles, .. } = &mut self.local;
        for member in region.free[k].iter().chain(&region.beyond[k]) {
            let particle = &mut particles[member.particle as usize];
            [particle[0], particle[1], particle[2]] = skin[member.particle as usize].to_array();
        }
    }
}
