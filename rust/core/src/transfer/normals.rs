//! Normals for matching, where vertices are one that the file keeps apart, and where a sheet has two sides.

use glam::{DVec3, Vec3};

use crate::mesh::TriMesh;
use crate::weld::Weld;

/// Area vectors around a vertex cancel if no more than this is left of them: the two sides of a card.
const CANCELS: f64 = 1e-3;

/// Unit normals of a target (V), zero where there is no direction.
#[derive(Debug, Default)]
pub(super) struct Normals {
    pub of_vertex: Vec<Vec3>,
    /// Whether the surface at a vertex faces both ways, so that its normal may be taken for either side (V).
    pub two_sided: Vec<bool>,
}

impl Normals {
    /// Area-weighted normals of a welded mesh. Where opposite faces cancel, the side of the first face stands for both.
    pub fn of_target(mesh: &TriMesh<'_>) -> Self {
        let mut sums = mesh.vertex_area_vectors();
        let two_sided = choose_sides(mesh, &area_sums(mesh), &mut sums);
        Self { of_vertex: unit(sums), two_sided }
    }
}

/// Normals of a source: area-weighted over all vertices that are one, except where they face both ways: there each has its
/// own side's. Where opposite faces cancel at one vertex, the side of the first face stands for both.
pub(super) fn of_source(mesh: &TriMesh<'_>, weld: Option<&Weld>) -> Vec<Vec3> {
    let sizes = area_sums(mesh);
    let mut sums = mesh.vertex_area_vectors();
    choose_sides(mesh, &sizes, &mut sums);
    let Some(weld) = weld else { return unit(sums) };
    for class in 0..weld.class_count() {
        let members = weld.members(class);
        let sum: DVec3 = members.iter().map(|&i| sums[i as usize]).sum();
        if members.len() > 1 && !cancels(sum, members.iter().map(|&i| sizes[i as usize]).sum()) {
            members.iter().for_each(|&i| sums[i as usize] = sum);
        }
    }
    unit(sums)
}

/// Gives the vertices whose area vectors cancel those of their first side; returns which they are (V).
fn choose_sides(mesh: &TriMesh<'_>, sizes: &[f64], sums: &mut [DVec3]) -> Vec<bool> {
    let two_sided: Vec<bool> = std::iter::zip(&*sums, sizes).map(|(&sum, &size)| cancels(sum, size)).collect();
    if two_sided.contains(&true) {
        let sides = first_sides(mesh, &two_sided);
        for (i, _) in two_sided.iter().enumerate().filter(|(_, two_sided)| **two_sided) {
            sums[i] = sides[i];
        }
    }
    two_sided
}

fn unit(sums: Vec<DVec3>) -> Vec<Vec3> {
    sums.iter().map(|sum| sum.normalize_or_zero().as_vec3()).collect()
}

fn cancels(sum: DVec3, size: f64) -> bool {
    size > 0.0 && sum.length() <= CANCELS * size
}

/// Sum of the lengths of the area vectors around each vertex.
fn area_sums(mesh: &TriMesh<'_>) -> Vec<f64> {
    let mut sizes = vec![0.0; mesh.vertex_count()];
    for t in mesh.triangles() {
        let size = mesh.doubled_area(t).length();
        t.iter().for_each(|&i| sizes[i as usize] += size);
    }
    sizes
}

/// Around each vertex of `wanted`, the sum of the area vectors that agree with the first one.
fn first_sides(mesh: &TriMesh<'_>, wanted: &[bool]) -> Vec<DVec3> {
    let (mut first, mut sides) = (vec![DVec3::ZERO; wanted.len()], vec![DVec3::ZERO; wanted.len()]);
    for t in mesh.triangles().iter().filter(|t| t.iter().any(|&i| wanted[i as usize])) {
        let doubled_area = mesh.doubled_area(t);
        for i in t.map(|i| i as usize) {
            if first[i] == DVec3::ZERO {
                first[i] = doubled_area;
            }
            if first[i].dot(doubled_area) > 0.0 {
                sides[i] += doubled_area;
            }
        }
    }
    sides
}
