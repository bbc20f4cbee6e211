//! What is asked of skin that may fold: a region's, or the whole.

use super::region::Region;
use super::surface::Surface;

/// Some skin: triangles, their numbers in the whole, neighbours, and which vertices may move.
pub(super) trait Skin: Sync {
    fn triangles(&self) -> &[[u32; 3]];
    fn name(&self, triangle: u32) -> u32;
    fn ring(&self, vertex: u32) -> &[u32];
    fn is_free(&self, vertex: u32) -> bool;
    /// The connected component of a triangle.
    fn island(&self, triangle: u32) -> u32;
}

impl Skin for Surface {
    fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    fn name(&self, triangle: u32) -> u32 {
        triangle
    }

    fn ring(&self, vertex: u32) -> &[u32] {
        self.ring(vertex as usize)
    }

    fn is_free(&self, _vertex: u32) -> bool {
        true
    }

    fn island(&self, triangle: u32) -> u32 {
        self.island_of(triangle)
    }
}

impl Skin for Region {
    fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    fn name(&self, triangle: u32) -> u32 {
        self.triangle_names[triangle as usize]
    }

    fn ring(&self, vertex: u32) -> &[u32] {
        self.ring(vertex)
    }

    fn is_free(&self, vertex: u32) -> bool {
        self.is_free(vertex)
    }

    fn island(&self, triangle: u32) -> u32 {
        self.triangle_islands[triangle as usize]
    }
}

/// These triangles, those of an island one after the other.
pub(super) fn by_island(skin: &dyn Skin, mut triangles: Vec<u32>) -> Vec<u32> {
    triangles.sort_by_key(|&t| skin.island(t));
    triangles
}

/// All triangles, likewise.
pub(super) fn all_triangles(skin: &dyn Skin) -> Vec<u32> {
    by_island(skin, (0..skin.triangles().len() as u32).collect())
}

/// The vertices of these pairs, ascending.
pub(super) fn corners(skin: &dyn Skin, pairs: &[[u32; 2]]) -> Vec<u32> {
    let mut corners: Vec<u32> = pairs.iter().flatten().flat_map(|&t| skin.triangles()[t as usize]).collect();
    corners.sort_unstable();
    corners.dedup();
    corners
}

/// Vertices with some rings around, ascending.
pub(super) fn grown(skin: &dyn Skin, mut vertices: Vec<u32>, rings: usize) -> Vec<u32> {
    for _ in 0..rings {
        let ring: Vec<u32> = vertices.iter().flat_map(|&i| skin.ring(i)).copied().collect();
        vertices.extend(ring);
        vertices.sort_unstable();
        vertices.dedup();
    }
    vertices
}
