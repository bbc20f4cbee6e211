//! Volumes of open surfaces.

use glam::DVec3;

use super::super::surface::Surface;
use crate::mesh::TriMesh;

/// A box from 0 to `size` without its sides across z, and the volume that its surface is said to enclose where it is moved.
fn duct(size: [f32; 3], moved: DVec3) -> (Surface, f64) {
    let corner = |k: usize| [0, 1, 2].map(|axis| if k >> axis & 1 == 1 { size[axis] } else { 0.0 });
    let positions: Vec<[f32; 3]> = (0..8).map(corner).collect();
    let sides = [[0, 1, 5, 4], [1, 3, 7, 5], [3, 2, 6, 7], [2, 0, 4, 6]];
    let triangles: Vec<[u32; 3]> = sides.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    let surface = Surface::new(&TriMesh::new(&positions, &triangles, "duct").unwrap());
    let volume = surface.volumes(|i| surface.rest[i as usize] + moved).iter().sum();
    (surface, volume)
}

#[test]
fn an_open_tube_encloses_what_it_would_with_its_ends_closed() {
    for moved in [DVec3::ZERO, DVec3::new(30.0, -4.0, 7.0)] {
        let (surface, volume) = duct([1.0, 2.0, 9.0], moved);
        assert!(surface.is_mostly_solid && surface.rims.len() == 2);
        assert!((volume - 18.0).abs() < 1e-9, "{volume}");
    }
}

#[test]
fn a_sheet_encloses_nothing() {
    let (surface, volume) = duct([1.0, 2.0, 0.3], DVec3::ONE);
    assert!(!surface.is_mostly_solid && surface.rims.is_empty());
    assert_eq!(volume, 0.0);
}
