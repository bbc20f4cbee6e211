//! The search for the triangles nearest to sixteen queries side by side.
//!
//! One descent in f32 for all of them collects the triangles that may be nearest to any; of these, f64 chooses. Each query
//! has a bound of its own, so that none looks farther than it must; what they share is the way.

use pulp::{Simd, WithSimd};

use super::Found;
use super::bvh::Bvh;
use super::lanes::{LANES, Lanes, Register};
use super::nearest::{Nearest, Reach};
use super::node::{LEAF, WIDTH};

/// Candidates are looked at when there are so many, lest a million equal triangles fill the memory.
const MANY: usize = 1024;

/// Searches for consecutive queries that lie close together, each packet starting at the leaf where the last one ended.
///
/// Dispatched once for many queries, so that all below is compiled for the widest SIMD the machine has.
pub(super) struct Batch<'a> {
    pub(super) bvh: &'a Bvh,
    pub(super) queries: &'a [[f32; 3]],
    /// What is as near as the nearest triangle.
    pub(super) reach: Reach,
    pub(super) answers: &'a mut [Found],
}

impl WithSimd for Batch<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let mut search = Search { simd, bvh: self.bvh, reach: self.reach, stack: Vec::new(), candidates: Vec::new() };
        let mut start = 0;
        for (queries, answers) in self.queries.chunks(LANES).zip(self.answers.chunks_mut(LANES)) {
            let nearest = search.nearest(queries, start);
            for (lane, answer) in answers.iter_mut().enumerate() {
                *answer = Found { point: nearest.surface_point(lane), ties: nearest.ties(lane) };
            }
            start = nearest.place(queries.len() - 1) / WIDTH as u32;
        }
    }
}

struct Search<'a, S> {
    simd: S,
    bvh: &'a Bvh,
    reach: Reach,
    stack: Vec<Visit>,
    candidates: Vec<Candidate>,
}

/// A node or leaf to look into, and how far away it is at least, squared.
#[derive(Clone, Copy)]
pub(super) struct Visit {
    pub(super) at_least: Lanes,
    pub(super) child: u32,
}

/// The place of a triangle that may be the nearest to some query, likewise.
#[derive(Clone, Copy)]
struct Candidate {
    at_least: Lanes,
    place: u32,
}

/// Up to [`LANES`] queries and what is known of them.
struct Packet {
    /// World coordinates by axis, NaN where there is no finite query.
    queries: [Lanes; 3],
    /// Squared distance beyond which nothing can be the nearest.
    limit: Lanes,
    /// The query whose distances decide which box is looked into first.
    leader: usize,
    nearest: Nearest,
}

impl Packet {
    /// Lanes without a finite query ask for nothing.
    #[inline(always)]
    fn new(bvh: &Bvh, reach: Reach, queries: &[[f32; 3]]) -> Self {
        let (mut by_axis, mut limit) = ([Lanes([f32::NAN; LANES]); 3], Lanes([f32::NEG_INFINITY; LANES]));
        for (lane, query) in queries.iter().enumerate() {
            if query[0].is_finite() && query[1].is_finite() && query[2].is_finite() {
                limit.0[lane] = f32::INFINITY;
                for axis in 0..3 {
                    by_axis[axis].0[lane] = query[axis];
                }
            }
        }
        Self { queries: by_axis, limit, leader: queries.len() / 2, nearest: Nearest::new(bvh, reach) }
    }

    /// The queries for which something at this squared distance may be the nearest, as bits.
    #[inline(always)]
    fn asking(&self, at_least: &Lanes) -> u32 {
        at_least.at_most(&self.limit)
    }
}

impl<S: Simd> Search<'_, S> {
    /// `start` is a leaf that is likely near; it does not change the answer.
    #[inline(always)]
    fn nearest(&mut self, queries: &[[f32; 3]], start: u32) -> Nearest {
        let mut packet = Packet::new(self.bvh, self.reach, queries);
        self.visit_leaf(start, &mut packet);
        self.stack.push(Visit { at_least: Lanes::ZERO, child: self.bvh.root });
        while let Some(Visit { at_least, child }) = self.stack.pop() {
            if packet.asking(&at_least) == 0 {
                continue;
            }
            if child & LEAF == 0 {
                self.open_node(child, &packet);
            } else if child != LEAF | start {
                self.visit_leaf(child & !LEAF, &mut packet);
            }
        }
        self.choose(&mut packet);
        packet.nearest
    }

    /// Puts the children that may hold a nearest triangle on the stack, the nearest last.
    #[inline(always)]
    fn open_node(&mut self, node: u32, packet: &Packet) {
        let node = &self.bvh.nodes[node as usize];
        let local = node.local(self.simd, &packet.queries);
        let bottom = self.stack.len();
        for child in 0..node.count {
            let at_least = node.squared_distances(self.simd, child, &local);
            if packet.asking(&at_least) != 0 {
                let visit = Visit { at_least, child: node.children[child] };
                insert_descending(&mut self.stack, bottom, visit, packet.leader);
            }
        }
    }

    /// Lowers the limits to what the triangles of `leaf` allow, and collects those within them.
    #[inline(always)]
    fn visit_leaf(&mut self, leaf: u32, packet: &mut Packet) {
        let (simd, (factor, offset)) = (self.simd, self.reach.in_f32());
        let first = leaf as usize * WIDTH;
        let triangles = &self.bvh.flat[first..self.bvh.flat.len().min(first + WIDTH)];
        let mut at_least = [Lanes::ZERO; WIDTH];
        for (triangle, at_least) in triangles.iter().zip(&mut at_least) {
            for k in 0..Register::<S>::COUNT {
                let [x, y, z] = &packet.queries;
                let query = [Register::load(simd, x, k), Register::load(simd, y, k), Register::load(simd, z, k)];
                let (low, high) = triangle.squared_distance_bounds(simd, query);
                low.store(at_least, k);
                let high = high * Register::splat(simd, factor) + Register::splat(simd, offset);
                high.min(Register::load(simd, &packet.limit, k)).store(&mut packet.limit, k);
            }
        }
        for (at_least, place) in at_least[..triangles.len()].iter().zip(first as u32..) {
            if packet.asking(at_least) != 0 {
                self.candidates.push(Candidate { at_least: *at_least, place });
            }
        }
        if self.candidates.len() >= MANY {
            self.choose(packet);
        }
    }

    /// Takes the candidates into account, each for the queries that still ask for it.
    #[inline(always)]
    fn choose(&mut self, packet: &mut Packet) {
        let mut queries = [[0.0; LANES]; 3];
        for (wide, lanes) in queries.iter_mut().zip(&packet.queries) {
            wide.iter_mut().zip(lanes.0).for_each(|(wide, x)| *wide = x.into());
        }
        for candidate in self.candidates.drain(..) {
            let asking = candidate.at_least.at_most(&packet.limit);
            packet.nearest.consider(self.bvh, candidate.place, &queries, asking);
        }
    }
}

/// Inserts into `stack[bottom..]`, whose last is the nearest to query `leader`.
#[inline(always)]
pub(super) fn insert_descending(stack: &mut Vec<Visit>, bottom: usize, visit: Visit, leader: usize) {
    stack.push(visit);
    let mut place = stack.len() - 1;
    while place > bottom && stack[place - 1].at_least.0[leader] < visit.at_least.0[leader] {
        stack[place] = stack[place - 1];
        place -= 1;
    }
    stack[place] = visit;
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    #[test]
    fn the_machines_simd_does_not_change_a_bit() {
        let wave = |i: u32| (i as f32 * 12.9898).sin();
        let point = |i: u32| Vec3::new(wave(3 * i), wave(3 * i + 1), wave(3 * i + 2));
        let triangles: Vec<u32> = (0..2000).collect();
        let bvh = Bvh::new(&triangles, |t| [point(t), point(t) + 0.1 * point(t + 7), point(t) + 0.2 * point(t + 9)]);
        let queries: Vec<_> = (0..500).map(|i| (1.5 * point(31 * i)).to_array()).collect();
        for (count, reach) in [500, 1, 15, 17].into_iter().zip([0.0, 1e-3].map(Reach::new).into_iter().cycle()) {
            let mut answers = [vec![Found::default(); count], vec![Found::default(); count]];
            let [widest, scalar] = &mut answers;
            pulp::Arch::new().dispatch(Batch { bvh: &bvh, queries: &queries[..count], reach, answers: widest });
            Batch { bvh: &bvh, queries: &queries[..count], reach, answers: scalar }.with_simd(pulp::Scalar::new());
            assert_eq!(answers[0], answers[1]);
        }
    }
}
