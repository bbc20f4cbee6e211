//! The search for the cheapest points where something adds to the squared distance, say the angle between two normals.
//!
//! The same descent as for nearest triangles: a box's squared distance is a lower bound of any cost in it. Here every query
//! keeps all triangles whose cost is close to its least, so that ties can be told.

use pulp::{Simd, WithSimd};

use super::SurfacePoint;
use super::bvh::Bvh;
use super::closest_point::closest_to_origin;
use super::lanes::{LANES, Lanes, Register};
use super::node::{LEAF, WIDTH};
use super::search::{Visit, insert_descending};
use glam::{DVec3, Vec3};

/// Where the search of one query ends.
#[derive(Debug, Clone, Copy)]
pub struct Bound {
    /// Squared distance within which every triangle counts, whatever it costs.
    pub near: f64,
    /// Cost above which no other triangle counts.
    pub cost: f64,
}

/// The closest point of one triangle, and its cost.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Priced {
    /// The point of the triangle that is closest to the query.
    pub point: SurfacePoint,
    /// At least its squared distance.
    pub cost: f64,
}

/// Searches for consecutive queries that lie close together. `cost` and `finish` are told which query asks, by its number.
pub(super) struct Batch<'a, C, F> {
    pub(super) bvh: &'a Bvh,
    /// World coordinates of all queries, and which of them to answer.
    pub(super) queries: &'a [[f32; 3]],
    pub(super) numbers: &'a [u32],
    pub(super) bounds: &'a [Bound],
    /// Triangles that cost up to this times the least are kept.
    pub(super) slack: f64,
    pub(super) cost: &'a C,
    pub(super) finish: &'a F,
}

impl<T, C, F> WithSimd for Batch<'_, C, F>
where
    C: Fn(usize, &SurfacePoint) -> f64,
    F: Fn(usize, &[Priced]) -> T,
{
    type Output = Vec<T>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Vec<T> {
        let mut search = Search { simd, batch: &self, stack: Vec::new() };
        let mut answers = Vec::with_capacity(self.numbers.len());
        let mut packet = Packet::new();
        for numbers in self.numbers.chunks(LANES) {
            packet.fill(&self, numbers);
            search.descend(&mut packet);
            for (lane, &number) in numbers.iter().enumerate() {
                answers.push((self.finish)(number as usize, packet.kept(lane)));
            }
        }
        answers
    }
}

/// Up to [`LANES`] queries and what each has found.
struct Packet {
    numbers: [usize; LANES],
    /// World coordinates by axis, NaN where there is no finite query.
    queries: [Lanes; 3],
    /// Squared distance beyond which nothing counts.
    limit: Lanes,
    bounds: [Bound; LANES],
    found: [Vec<Priced>; LANES],
    /// The query whose distances decide which box is looked into first.
    leader: usize,
}

impl Packet {
    fn new() -> Self {
        Self {
            numbers: [0; LANES],
            queries: [Lanes::ZERO; 3],
            limit: Lanes::ZERO,
            bounds: [Bound { near: 0.0, cost: 0.0 }; LANES],
            found: Default::default(),
            leader: 0,
        }
    }

    /// Starts anew with other queries; lanes without a finite one ask for nothing.
    fn fill<C, F>(&mut self, batch: &Batch<'_, C, F>, numbers: &[u32]) {
        self.limit = Lanes([f32::NEG_INFINITY; LANES]);
        self.queries = [Lanes([f32::NAN; LANES]); 3];
        self.found.iter_mut().for_each(Vec::clear);
        self.leader = numbers.len() / 2;
        for (lane, &number) in numbers.iter().enumerate() {
            self.numbers[lane] = number as usize;
            self.bounds[lane] = batch.bounds[number as usize];
            let query = batch.queries[number as usize];
            if query.iter().all(|x| x.is_finite()) {
                self.lower_limit(lane);
                for axis in 0..3 {
                    self.queries[axis].0[lane] = query[axis];
                }
            }
        }
    }

    /// The limit in f32, rounded up.
    #[inline(always)]
    fn lower_limit(&mut self, lane: usize) {
        let Bound { near, cost } = self.bounds[lane];
        self.limit.0[lane] = (near.max(cost) * (1.0 + 1e-6)) as f32 + f32::MIN_POSITIVE;
    }

    /// Keeps a triangle's point if it counts; a low cost lowers the bound.
    #[inline(always)]
    fn consider(&mut self, lane: usize, priced: Priced, squared: f64, slack: f64) {
        let bound = &mut self.bounds[lane];
        if squared > bound.near && priced.cost > bound.cost {
            return;
        }
        self.found[lane].push(priced);
        if slack * priced.cost < bound.cost {
            bound.cost = slack * priced.cost;
            self.lower_limit(lane);
        }
    }

    /// What counts for one query in the end, by triangle.
    fn kept(&mut self, lane: usize) -> &[Priced] {
        let bound = self.bounds[lane];
        let found = &mut self.found[lane];
        found.retain(|p| p.cost <= bound.cost || p.point.distance * p.point.distance <= bound.near * (1.0 + 1e-12));
        found.sort_unstable_by_key(|p| p.point.triangle);
        found
    }
}

struct Search<'a, 'b, S, C, F> {
    simd: S,
    batch: &'a Batch<'b, C, F>,
    stack: Vec<Visit>,
}

impl<S, T, C, F> Search<'_, '_, S, C, F>
where
    S: Simd,
    C: Fn(usize, &SurfacePoint) -> f64,
    F: Fn(usize, &[Priced]) -> T,
{
    #[inline(always)]
    fn descend(&mut self, packet: &mut Packet) {
        self.stack.push(Visit { at_least: Lanes::ZERO, child: self.batch.bvh.root });
        while let Some(Visit { at_least, child }) = self.stack.pop() {
            if at_least.at_most(&packet.limit) == 0 {
                continue;
            }
            if child & LEAF == 0 {
                self.open_node(child, packet);
            } else {
                self.visit_leaf(child & !LEAF, packet);
            }
        }
    }

    /// Puts the children that may hold something cheap on the stack, the nearest last.
    #[inline(always)]
    fn open_node(&mut self, node: u32, packet: &Packet) {
        let node = &self.batch.bvh.nodes[node as usize];
        let local = node.local(self.simd, &packet.queries);
        let bottom = self.stack.len();
        for child in 0..node.count {
            let at_least = node.squared_distances(self.simd, child, &local);
            if at_least.at_most(&packet.limit) != 0 {
                let visit = Visit { at_least, child: node.children[child] };
                insert_descending(&mut self.stack, bottom, visit, packet.leader);
            }
        }
    }

    /// Prices the triangles of a leaf that f32 leaves near enough.
    #[inline(always)]
    fn visit_leaf(&mut self, leaf: u32, packet: &mut Packet) {
        let simd = self.simd;
        let first = leaf as usize * WIDTH;
        let triangles = &self.batch.bvh.flat[first..self.batch.bvh.flat.len().min(first + WIDTH)];
        for (triangle, place) in triangles.iter().zip(first..) {
            let mut at_least = Lanes::ZERO;
            for k in 0..Register::<S>::COUNT {
                let [x, y, z] = &packet.queries;
                let query = [Register::load(simd, x, k), Register::load(simd, y, k), Register::load(simd, z, k)];
                triangle.squared_distance_bounds(simd, query).0.store(&mut at_least, k);
            }
            let mut asking = at_least.at_most(&packet.limit);
            while asking != 0 {
                let lane = asking.trailing_zeros() as usize;
                asking &= asking - 1;
                self.price(place, lane, packet);
            }
        }
    }

    #[inline(always)]
    fn price(&self, place: usize, lane: usize, packet: &mut Packet) {
        let [x, y, z] = packet.queries.map(|axis| f64::from(axis.0[lane]));
        let corners = self.batch.bvh.corners[place].map(|p| Vec3::from(p).as_dvec3() - DVec3::new(x, y, z));
        let (barycentric, squared) = closest_to_origin(corners);
        let bound = packet.bounds[lane];
        if squared <= bound.near.max(bound.cost) {
            let triangle = self.batch.bvh.triangles[place];
            let point = SurfacePoint { triangle, barycentric, distance: squared.sqrt() };
            let cost = (self.batch.cost)(packet.numbers[lane], &point);
            packet.consider(lane, Priced { point, cost }, squared, self.batch.slack);
        }
    }
}
