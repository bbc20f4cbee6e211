//! Where the particles of a region are in a frame, and its multipliers.

use std::ops::Deref;
use std::sync::Arc;

use super::projection::{Kernel, Limits, MULTIPLIERS, Multipliers, OfNodes, Particle, project};
use super::region::Region;

/// The changing part of a frame; the region is shared with other frames.
#[derive(Debug)]
pub(super) struct Local {
    pub(super) region: Arc<Region>,
    /// Places and inverse masses.
    pub(super) particles: Vec<Particle>,
    pub(super) of_edges: Multipliers<1>,
    pub(super) of_sides: Multipliers<1>,
    pub(super) of_loose: Multipliers<2>,
    pub(super) of_octahedra: Multipliers<MULTIPLIERS>,
}

impl Local {
    pub(super) fn new(region: Arc<Region>) -> Self {
        Self {
            particles: region.masses.iter().map(|&w| [0.0, 0.0, 0.0, w]).collect(),
            of_edges: Multipliers::new(region.edges.len()),
            of_sides: Multipliers::new(region.sides.len()),
            of_loose: Multipliers::new(region.loose.len()),
            of_octahedra: Multipliers::new(region.octahedra.len()),
            region,
        }
    }

    /// Forgets the multipliers, as every step does.
    pub(super) fn restart(&mut self) {
        self.of_edges.restart();
        self.of_sides.restart();
        self.of_loose.restart();
        self.of_octahedra.restart();
    }

    /// Puts the free skin of joint `k` back within its limits.
    pub(super) fn limit_skin(&mut self, kernel: Kernel, k: usize, limits: Limits) {
        project(kernel, limits, &self.region.limited[k].skin, &mut Multipliers::new(0), &mut self.particles);
    }

    /// Puts the free lattice nodes of joint `k` back on their sides.
    pub(super) fn limit_nodes(&mut self, kernel: Kernel, k: usize, limits: Limits) {
        let nodes = &self.region.limited[k].nodes;
        project(kernel, OfNodes(limits), nodes, &mut Multipliers::new(0), &mut self.particles);
    }

    /// Tetrahedra turned inside out.
    pub(super) fn inverted(&self) -> usize {
        let place = |p: u32| glam::Vec4::from(self.particles[p as usize]).truncate().as_dvec3();
        let [a, b, c, d] = &self.region.tetrahedra.particles;
        let volume = |k: usize| {
            let [a, b, c, d] = [a[k], b[k], c[k], d[k]].map(place);
            (b - a).dot((c - a).cross(d - a))
        };
        (0..self.region.tetrahedra.len()).filter(|&k| volume(k) <= 0.0).count()
    }
}

impl Deref for Local {
    type Target = Region;

    fn deref(&self) -> &Region {
        &self.region
    }
}
