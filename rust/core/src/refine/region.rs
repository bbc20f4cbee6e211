//! The part of lattice and surface that a set of active joints solves for, with indices of its own.

use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use rayon::prelude::*;

use super::frame::ActiveJoint;
use super::holes::Rim;
use super::joints::Member;
use super::prepared::Prepared;
use super::projection::{Batch, Blocks, Colouring};

const NONE: u32 = u32::MAX;
/// Constraints that one task looks at.
const RUN: usize = 8192;

/// A surface vertex and where it hangs in the lattice, local indices.
#[derive(Debug, Clone, Copy)]
pub(super) struct Hung {
    pub(super) vertex: u32,
    pub(super) nodes: [u32; 4],
    pub(super) shares: [f32; 4],
}

/// The free particles of a joint with what limits them: skin with its distance from the bones and its side of the plane,
/// lattice nodes with their side.
#[derive(Debug)]
pub(super) struct Limited {
    pub(super) skin: Batch<1, 2>,
    pub(super) nodes: Batch<1, 1>,
}

impl Limited {
    /// Of `members`, nodes first.
    fn new(lattice: Blocks, skin: Blocks, members: &[Member], nodes: usize) -> Self {
        let (of_nodes, of_skin) = members.split_at(members.partition_point(|m| (m.particle as usize) < nodes));
        let colours = Colouring::single(members.len());
        let all: Vec<u32> = (0..of_skin.len() as u32).collect();
        let (node, vertex) = (|k: u32| &of_nodes[k as usize], |k: u32| &of_skin[k as usize]);
        let sided: Vec<u32> = (0..of_nodes.len() as u32).filter(|&k| node(k).side != 0.0).collect();
        Self {
            skin: Batch::new(skin, &colours, &all, |k| [vertex(k).particle], |k| [vertex(k).distance, vertex(k).side]),
            nodes: Batch::new(lattice, &colours, &sided, |k| [node(k).particle], |k| [node(k).side]),
        }
    }
}

/// Particles and constraints of a frame, as far as they depend on which joints are active and how far they reach.
#[derive(Debug)]
pub(super) struct Region {
    /// The particle of the whole that each local one is: first nodes, then surface vertices, both ascending.
    pub(super) global: Vec<u32>,
    /// How many are lattice nodes.
    pub(super) nodes: usize,
    /// Inverse masses: 1 where free, 0 where the skeleton decides.
    pub(super) masses: Vec<f32>,
    pub(super) edges: Batch<2, 1>,
    pub(super) sides: Batch<2, 1>,
    pub(super) tetrahedra: Batch<4, 0>,
    pub(super) hung: Vec<Hung>,
    /// The same by nodes: what hangs on each, counted from the first surface vertex, with its share.
    held_starts: Vec<u32>,
    held: Vec<(u32, f32)>,
    /// Members of each active joint with local indices, the free ones: nodes first, as everywhere.
    pub(super) free: Vec<Vec<Member>>,
    /// Six times the volume of each joint's region at rest, once asked for.
    pub(super) rest_volumes: Vec<OnceLock<f64>>,
    /// The free ones as the kernels take them.
    pub(super) limited: Vec<Limited>,
    /// Those beyond.
    pub(super) beyond: Vec<Vec<Member>>,
    /// Rings of local surface vertices, whole rings only for free ones.
    ring_starts: Vec<u32>,
    rings: Vec<u32>,
    /// How far those neighbours are at rest.
    ring_lengths: Vec<f32>,
    /// Triangles over local particles with a free corner.
    pub(super) triangles: Vec<[u32; 3]>,
    /// Their numbers in the surface.
    pub(super) triangle_names: Vec<u32>,
    /// And their connected components.
    pub(super) triangle_islands: Vec<u32>,
    /// The openings that have all of their rim here.
    pub(super) rims: Vec<Rim>,
}

/// The last region, for poses with the same joints and extents: it depends on nothing else.
#[derive(Debug, Default)]
pub(super) struct KeptRegion(Mutex<Option<Kept>>);

type Kept = (Vec<(usize, [u32; 3])>, Arc<Region>);

impl KeptRegion {
    /// The region of these joints, made if it is not the last one.
    pub(super) fn region(&self, prepared: &Prepared, active: &[ActiveJoint<'_>]) -> Arc<Region> {
        let key: Vec<_> = active.iter().map(|a| (a.joint.bone, a.extent().map(f32::to_bits))).collect();
        let last = self.0.lock().unwrap_or_else(PoisonError::into_inner).clone();
        if let Some((_, region)) = last.filter(|(known, _)| *known == key) {
            return region;
        }
        let region = Arc::new(Region::new(prepared, active));
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some((key, Arc::clone(&region)));
        region
    }
}

/// What of the whole takes part.
struct Chosen {
    edges: Vec<u32>,
    sides: Vec<u32>,
    tetrahedra: Vec<u32>,
    triangles: Vec<u32>,
}

impl Region {
    pub(super) fn new(prepared: &Prepared, active: &[ActiveJoint<'_>]) -> Self {
        let mut is_free = vec![false; prepared.rest.len()];
        active.iter().flat_map(ActiveJoint::free).for_each(|member| is_free[member.particle as usize] = true);
        let chosen = Chosen::new(prepared, &is_free);
        let (global, local) = chosen.particles(prepared, active, &is_free);
        let nodes = global.partition_point(|&p| (p as usize) < prepared.node_count());
        let map = |p: u32| local[p as usize];
        let surface = |i: u32| i + prepared.node_count() as u32;
        let (lattice, skin) = (Blocks::new(0, nodes), Blocks::new(nodes, global.len() - nodes));
        let (corners, edge_ends) = (&prepared.lattice.tetrahedra, &prepared.lattice.edges);
        let side_ends = &prepared.surface.edges;
        let edges = || {
            let length = |k: u32| [prepared.edge_lengths[k as usize]];
            let ends = |k: u32| edge_ends[k as usize].map(map);
            Batch::new(lattice, &prepared.edge_colours, &chosen.edges, ends, length)
        };
        let sides = || {
            let length = |k: u32| [prepared.side_lengths[k as usize]];
            let ends = |k: u32| side_ends[k as usize].map(|i| map(surface(i)));
            Batch::new(skin, &prepared.side_colours, &chosen.sides, ends, length)
        };
        let tetrahedra = || {
            let ends = |k: u32| corners[k as usize].map(map);
            Batch::new(lattice, &prepared.tetrahedron_colours, &chosen.tetrahedra, ends, |_| [])
        };
        let ((edges, sides), tetrahedra) = rayon::join(|| rayon::join(edges, sides), tetrahedra);

        let hung = global[nodes..].iter().filter_map(|&p| {
            let embedding = prepared.lattice.embedding[p as usize - prepared.node_count()]?;
            Some(Hung { vertex: map(p), nodes: embedding.nodes.map(map), shares: embedding.shares })
        });
        let hung: Vec<Hung> = hung.collect();
        let (held_starts, held) = by_nodes(&hung, nodes);
        let members = |chosen: &mut dyn Iterator<Item = &Member>| {
            let known = chosen.filter(|m| map(m.particle) != NONE);
            known.map(|m| Member { particle: map(m.particle), ..*m }).collect::<Vec<_>>()
        };
        let free: Vec<Vec<Member>> = active.iter().map(|joint| members(&mut joint.free())).collect();
        let limited = |(joint, members): (&ActiveJoint<'_>, &Vec<Member>)| {
            let beside: Vec<Member> = members.iter().filter(|member| joint.is_beside(member)).copied().collect();
            Limited::new(lattice, skin, &beside, nodes)
        };
        let limited = active.par_iter().zip(&free).map(limited).collect();
        let (ring_starts, rings) = rings(prepared, &global[nodes..], &local);
        let ring_lengths = lengths(prepared, &global, nodes, &ring_starts, &rings);
        let local_rim = |rim: &Rim| -> Option<Rim> {
            let named = rim.iter().map(|side| side.map(|i| map(surface(i))));
            named.map(|side| (!side.contains(&NONE)).then_some(side)).collect()
        };
        let named = |&t: &u32| prepared.surface.triangles[t as usize].map(|i| map(surface(i)));
        Self {
            nodes,
            masses: global.iter().map(|&p| f32::from(u8::from(is_free[p as usize]))).collect(),
            edges,
            sides,
            tetrahedra,
            hung,
            held_starts,
            held,
            rest_volumes: free.iter().map(|_| OnceLock::new()).collect(),
            free,
            limited,
            beyond: active.iter().map(|joint| members(&mut joint.beyond())).collect(),
            ring_starts,
            rings,
            ring_lengths,
            triangles: chosen.triangles.iter().map(named).collect(),
            triangle_islands: chosen.triangles.iter().map(|&t| prepared.surface.island_of(t)).collect(),
            triangle_names: chosen.triangles,
            rims: prepared.surface.rims.iter().filter_map(local_rim).collect(),
            global,
        }
    }

    /// The particles of joint `k`, free ones and those beyond.
    pub(super) fn members(&self, k: usize) -> impl Iterator<Item = &Member> {
        self.free[k].iter().chain(&self.beyond[k])
    }

    /// Surface neighbours of a local surface vertex.
    pub(super) fn ring(&self, particle: u32) -> &[u32] {
        let i = particle as usize - self.nodes;
        &self.rings[self.ring_starts[i] as usize..self.ring_starts[i + 1] as usize]
    }

    /// The distances of those neighbours at rest.
    pub(super) fn ring_lengths(&self, particle: u32) -> &[f32] {
        let i = particle as usize - self.nodes;
        &self.ring_lengths[self.ring_starts[i] as usize..self.ring_starts[i + 1] as usize]
    }

    /// The surface vertices that hang on a node (counted from the first one) and their shares.
    pub(super) fn hung_on(&self, node: usize) -> &[(u32, f32)] {
        &self.held[self.held_starts[node] as usize..self.held_starts[node + 1] as usize]
    }

    /// Whether a local particle moves freely.
    pub(super) fn is_free(&self, particle: u32) -> bool {
        self.masses[particle as usize] > 0.0
    }

    /// Whether a local particle is a surface vertex.
    pub(super) fn is_surface(&self, particle: u32) -> bool {
        particle as usize >= self.nodes
    }
}

impl Chosen {
    /// Whatever has a free particle.
    fn new(prepared: &Prepared, is_free: &[bool]) -> Self {
        let surface = |i: u32| i + prepared.node_count() as u32;
        let any = |particles: &[u32]| particles.iter().any(|&p| is_free[p as usize]);
        let (lattice, skin) = (&prepared.lattice, &prepared.surface);
        Self {
            edges: kept(lattice.edges.len(), |k| any(&lattice.edges[k])),
            sides: kept(skin.edges.len(), |k| any(&skin.edges[k].map(surface))),
            tetrahedra: kept(lattice.tetrahedra.len(), |k| any(&lattice.tetrahedra[k])),
            triangles: kept(skin.triangles.len(), |k| any(&skin.triangles[k].map(surface))),
        }
    }

    /// The particles that take part, ascending, and the local number of each of the whole.
    fn particles(&self, prepared: &Prepared, active: &[ActiveJoint<'_>], is_free: &[bool]) -> (Vec<u32>, Vec<u32>) {
        let nodes = prepared.node_count();
        let surface = |i: u32| i as usize + nodes;
        let mut takes_part = is_free.to_vec();
        let mut mark = |p: usize| takes_part[p] = true;
        self.edges.iter().flat_map(|&k| prepared.lattice.edges[k as usize]).for_each(|p| mark(p as usize));
        self.sides.iter().flat_map(|&k| prepared.surface.edges[k as usize]).for_each(|i| mark(surface(i)));
        self.triangles.iter().flat_map(|&k| prepared.surface.triangles[k as usize]).for_each(|i| mark(surface(i)));
        // Skin beyond a limb's region is kept near its bones as well, all of it.
        let limbs = active.iter().filter(|active| active.joint.is_limb);
        let skin = limbs.flat_map(ActiveJoint::beyond).filter(|m| m.particle as usize >= nodes);
        skin.for_each(|member| mark(member.particle as usize));
        for i in 0..prepared.surface.len() {
            if takes_part[nodes + i] {
                let embedding = prepared.lattice.embedding[i];
                embedding.iter().flat_map(|e| e.nodes).for_each(|node| takes_part[node as usize] = true);
            }
        }
        let global: Vec<u32> = (0..takes_part.len() as u32).filter(|&p| takes_part[p as usize]).collect();
        let mut local = vec![NONE; takes_part.len()];
        global.iter().enumerate().for_each(|(l, &p)| local[p as usize] = l as u32);
        (global, local)
    }
}

/// The numbers below `count` that `keep` accepts, ascending.
fn kept(count: usize, keep: impl Fn(usize) -> bool + Sync) -> Vec<u32> {
    (0..count).into_par_iter().with_min_len(RUN).filter(|&k| keep(k)).map(|k| k as u32).collect()
}

/// Where each of `nodes` nodes begins, and the vertices that hang on it, ascending.
fn by_nodes(hung: &[Hung], nodes: usize) -> (Vec<u32>, Vec<(u32, f32)>) {
    let mut starts = vec![0u32; nodes + 1];
    hung.iter().flat_map(|hung| hung.nodes).for_each(|node| starts[node as usize + 1] += 1);
    (0..nodes).for_each(|node| starts[node + 1] += starts[node]);
    let (mut next, mut held) = (starts.clone(), vec![(0, 0.0); 4 * hung.len()]);
    for hung in hung {
        for (&node, &share) in hung.nodes.iter().zip(&hung.shares) {
            held[next[node as usize] as usize] = (hung.vertex - nodes as u32, share);
            next[node as usize] += 1;
        }
    }
    (starts, held)
}

/// The distance at rest between each surface vertex and each neighbour.
fn lengths(prepared: &Prepared, global: &[u32], nodes: usize, starts: &[u32], rings: &[u32]) -> Vec<f32> {
    let rest = |p: usize| prepared.rest[global[p] as usize];
    let of_vertex = |(i, ends): (usize, &[u32])| {
        let ring = &rings[ends[0] as usize..ends[1] as usize];
        ring.iter().map(move |&n| rest(nodes + i).distance(rest(n as usize)))
    };
    starts.windows(2).enumerate().flat_map(of_vertex).collect()
}

fn rings(prepared: &Prepared, vertices: &[u32], local: &[u32]) -> (Vec<u32>, Vec<u32>) {
    let (mut starts, mut rings) = (vec![0], Vec::new());
    for &p in vertices {
        let ring = prepared.surface.ring(p as usize - prepared.node_count()).iter();
        let neighbours = ring.map(|&n| local[n as usize + prepared.node_count()]).filter(|&n| n != NONE);
        rings.extend(neighbours);
        starts.push(rings.len() as u32);
    }
    (starts, rings)
}
