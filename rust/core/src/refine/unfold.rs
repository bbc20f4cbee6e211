//! Folds that pushing and smoothing leave, as on coarse skin: skin around them goes towards where skinning has it.

use glam::{DAffine3, Vec3};

use super::coupling::shift;
use super::predictor::{linear, skinned};
use super::skin::{corners, grown};
use super::solver::Frame;

/// Rings around a fold that go all the way, in the order they are tried.
const RINGS: [usize; 4] = [0, 1, 2, 3];
/// How far they go, in the order it is tried.
const SHARES: [f32; 2] = [0.5, 1.0];
/// Rings beyond over which that fades.
const FADING: usize = 3;
/// Times that it is done where pairs remain.
const ROUNDS: usize = 3;

/// How far vertices go: the particle and the share of its way.
type Shares = Vec<(u32, f32)>;

/// How many pairs remain, and the moves of particles that lead there.
type Unfolding = (usize, Vec<(u32, Vec3)>);

impl Frame<'_> {
    /// Moves skin around the folds towards linear or dual quaternion skinning, where that leaves fewer. `left` is the
    /// number of pairs of triangles that pass through each other.
    pub(super) fn unfold(&mut self, pose: &[DAffine3], mut left: usize) {
        if left == 0 {
            return;
        }
        let skins = [skinned, linear].map(|skin| skin(self.prepared, &self.local.region, pose));
        for _ in 0..ROUNDS {
            let (remain, moves) = self.best_unfolding(&skins);
            if remain >= left {
                return;
            }
            moves.into_iter().for_each(|(p, by)| shift(&mut self.local.particles[p as usize], by));
            left = remain;
        }
    }

    /// The moves that leave the fewest pairs, and how many that is; the first that leaves none.
    fn best_unfolding(&self, skins: &[Vec<Vec3>; 2]) -> Unfolding {
        let (region, places) = (&*self.local.region, self.places());
        let pairs = self.prepared.contact.all_own_pairs(region, &places, &self.slabs);
        let mut best = (pairs.len(), Vec::new());
        for rings in RINGS {
            let shares = self.faded(grown(region, corners(region, &pairs), rings));
            for (share, skin) in SHARES.iter().flat_map(|&share| skins.iter().map(move |skin| (share, skin))) {
                let by = |&(p, part): &(u32, f32)| (p, (skin[p as usize] - places[p as usize]) * (part * share));
                let moves: Vec<(u32, Vec3)> = shares.iter().map(by).collect();
                let remain = self.pairs_after(&places, &moves);
                if remain < best.0 {
                    best = (remain, moves);
                }
                if remain == 0 {
                    return best;
                }
            }
        }
        best
    }

    /// The free ones of these vertices go all the way, those around them less and less.
    fn faded(&self, vertices: Vec<u32>) -> Shares {
        let region = &*self.local.region;
        let mut share = vec![0.0f32; self.local.particles.len()];
        vertices.iter().for_each(|&p| share[p as usize] = 1.0);
        let around = grown(region, vertices, FADING);
        for _ in 0..FADING {
            let mean = |&p: &u32| {
                let ring = region.ring(p);
                let mean = ring.iter().map(|&n| share[n as usize]).sum::<f32>() / ring.len().max(1) as f32;
                share[p as usize].max(mean)
            };
            let next: Vec<f32> = around.iter().map(mean).collect();
            around.iter().zip(next).for_each(|(&p, next)| share[p as usize] = next);
        }
        around.into_iter().filter(|&p| region.is_free(p)).map(|p| (p, share[p as usize])).collect()
    }

    /// How many pairs there are after `moves`; all there were before have moved.
    fn pairs_after(&self, places: &[Vec3], moves: &[(u32, Vec3)]) -> usize {
        let region = &*self.local.region;
        let (mut places, moved): (_, Vec<u32>) = (places.to_vec(), moves.iter().map(|&(p, _)| p).collect());
        moves.iter().for_each(|&(p, by)| places[p as usize] += by);
        self.prepared.contact.all_own_pairs_again(region, &places, (Vec::new(), &moved), &self.slabs).len()
    }
}
