//! The part of lattice and surface that one frame solves for, with indices of its own.

use rayon::prelude::*;

use super::frame::ActiveJoint;
use super::joints::Member;
use super::prepared::Prepared;
use super::projection::{Batch, Particle};

const NONE: u32 = u32::MAX;

/// A surface vertex and where it hangs in the lattice, local indices.
#[derive(Debug, Clone, Copy)]
pub(super) struct Hung {
    pub(super) vertex: u32,
    pub(super) nodes: [u32; 4],
    pub(super) shares: [f32; 4],
}

/// Particles and constraints of a frame.
#[derive(Debug)]
pub(super) struct Local {
    /// The particle of the whole that each local one is: first nodes, then surface vertices, both ascending.
    pub(super) global: Vec<u32>,
    /// How many are lattice nodes.
    pub(super) nodes: usize,
    /// Places, and inverse masses: 1 where free, 0 where the skeleton decides.
    pub(super) particles: Vec<Particle>,
    pub(super) lattice_stretch: Batch<2, 1>,
    pub(super) surface_stretch: Batch<2, 1>,
    pub(super) volume: Batch<4, 2>,
    pub(super) energy: Batch<4, 4>,
    pub(super) hung: Vec<Hung>,
    /// Members of each active joint with local indices, the free ones.
    pub(super) free: Vec<Vec<Member>>,
    /// Those beyond.
    pub(super) beyond: Vec<Vec<Member>>,
    /// Rings of local surface vertices, whole rings only for free ones.
    ring_starts: Vec<u32>,
    rings: Vec<u32>,
    /// Triangles over local particles with a free corner.
    pub(super) triangles: Vec<[u32; 3]>,
    /// Their numbers in the surface.
    pub(super) triangle_names: Vec<u32>,
}

impl Local {
    pub(super) fn new(prepared: &Prepared, active: &[ActiveJoint<'_>]) -> Self {
        let mut is_free = vec![false; prepared.rest.len()];
        active.iter().flat_map(ActiveJoint::free).for_each(|member| is_free[member.particle as usize] = true);
        let any = |particles: &[u32]| particles.iter().any(|&p| is_free[p as usize]);
        let surface = |i: u32| i + prepared.node_count() as u32;
        let lattice = &prepared.lattice;
        let edges = prepared.edge_order.filtered(|k| any(&lattice.edges[k as usize]));
        let tetrahedra = prepared.tetrahedron_order.filtered(|k| any(&lattice.tetrahedra[k as usize]));
        let sides = prepared.side_order.filtered(|k| any(&prepared.surface.edges[k as usize].map(surface)));
        let corners = |t: u32| prepared.surface.triangles[t as usize].map(surface);
        let triangle_names: Vec<u32> =
            (0..prepared.surface.triangles.len() as u32).into_par_iter().filter(|&t| any(&corners(t))).collect();
        let triangles: Vec<[u32; 3]> = triangle_names.iter().map(|&t| corners(t)).collect();

        let mut local = vec![NONE; prepared.rest.len()];
        let touched = [
            edges.order.iter().flat_map(|&k| lattice.edges[k as usize]).collect::<Vec<_>>(),
            sides.order.iter().flat_map(|&k| prepared.surface.edges[k as usize].map(surface)).collect(),
            triangles.iter().flatten().copied().collect(),
        ];
        touched.iter().flatten().for_each(|&p| local[p as usize] = 0);
        // Skin beyond a limb's region is kept near its bones as well, all of it.
        let limbs = active.iter().filter(|active| active.joint.is_limb);
        let skin = limbs.flat_map(ActiveJoint::beyond).filter(|m| m.particle >= surface(0));
        skin.for_each(|member| local[member.particle as usize] = 0);
        for (p, free) in is_free.iter().enumerate() {
            let embedding = p.checked_sub(prepared.node_count()).and_then(|i| lattice.embedding[i]);
            if *free || local[p] == 0 {
                local[p] = 0;
                embedding.iter().flat_map(|e| e.nodes).for_each(|node| local[node as usize] = 0);
            }
        }
        let global: Vec<u32> = (0..local.len() as u32).filter(|&p| local[p as usize] == 0).collect();
        global.iter().enumerate().for_each(|(l, &p)| local[p as usize] = l as u32);
        let map = |p: u32| local[p as usize];

        let nodes = global.partition_point(|&p| (p as usize) < prepared.node_count());
        let hung = global[nodes..].iter().filter_map(|&p| {
            let embedding = lattice.embedding[p as usize - prepared.node_count()]?;
            Some(Hung { vertex: map(p), nodes: embedding.nodes.map(map), shares: embedding.shares })
        });
        let members = |chosen: &mut dyn Iterator<Item = &Member>| {
            let known = chosen.filter(|m| map(m.particle) != NONE);
            known.map(|m| Member { particle: map(m.particle), ..*m }).collect::<Vec<_>>()
        };
        let inverse_mass = |&p: &u32| [0.0, 0.0, 0.0, if is_free[p as usize] { 1.0 } else { 0.0 }];
        let (ring_starts, rings) = rings(prepared, &global[nodes..], &local);
        Self {
            nodes,
            particles: global.iter().map(inverse_mass).collect(),
            lattice_stretch: Batch::new(
                &edges,
                |k| lattice.edges[k as usize].map(map),
                |k| [prepared.edge_lengths[k as usize]],
            ),
            surface_stretch: Batch::new(
                &sides,
                |k| prepared.surface.edges[k as usize].map(surface).map(map),
                |k| [prepared.side_lengths[k as usize]],
            ),
            volume: Batch::new(
                &tetrahedra,
                |k| lattice.tetrahedra[k as usize].map(map),
                |_| prepared.tetrahedron_volume,
            ),
            energy: Batch::new(&tetrahedra, |k| lattice.tetrahedra[k as usize].map(map), |k| prepared.arms[k as usize]),
            hung: hung.collect(),
            free: active.iter().map(|joint| members(&mut joint.free())).collect(),
            beyond: active.iter().map(|joint| members(&mut joint.beyond())).collect(),
            ring_starts,
            rings,
            triangles: triangles.iter().map(|t| t.map(map)).collect(),
            triangle_names,
            global,
        }
    }

    /// Whether a local particle moves freely.
    pub(super) fn is_free(&self, particle: u32) -> bool {
        self.particles[particle as usize][3] > 0.0
    }

    /// Whether a local particle is a surface vertex.
    pub(super) fn is_surface(&self, particle: u32) -> bool {
        particle as usize >= self.nodes
    }

    /// Surface neighbours of a local surface vertex.
    pub(super) fn ring(&self, particle: u32) -> &[u32] {
        let i = particle as usize - self.nodes;
        &self.rings[self.ring_starts[i] as usize..self.ring_starts[i + 1] as usize]
    }

    /// Tetrahedra turned inside out.
    pub(super) fn inverted(&self) -> usize {
        let place = |p: u32| glam::Vec4::from(self.particles[p as usize]).truncate().as_dvec3();
        let [a, b, c, d] = &self.volume.particles;
        let volume = |k: usize| {
            let [a, b, c, d] = [a[k], b[k], c[k], d[k]].map(place);
            (b - a).dot((c - a).cross(d - a))
        };
        (0..self.volume.len()).filter(|&k| volume(k) <= 0.0).count()
    }
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
