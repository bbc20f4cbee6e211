//! The points that the method of confidences chooses, against a search through all triangles.

use crate::common::Fixture;
use crate::walls::{dense, distance_to_triangle, parts_with_bones, relief, target, wall};
use glam::{DVec3, Vec3};
use skinwright_core::transfer::{Length, MatchMethod, Settings, transfer_weights};

/// A triangle of the body as one vertex sees it.
struct Found {
    distance: f64,
    cost: f64,
    area: f64,
}

fn corners(mesh: &Fixture, t: &[u32; 3]) -> [DVec3; 3] {
    t.map(|i| Vec3::from(mesh.positions[i as usize]).as_dvec3())
}

fn area_vector([a, b, c]: [DVec3; 3]) -> DVec3 {
    (b - a).cross(c - a) / 2.0
}

/// Mean distance of what a vertex takes of the triangles found, and whether it leaves the nearest ones.
fn chosen(found: &[Found], size: f64) -> (f64, bool) {
    let least = |of: &dyn Fn(&Found) -> f64| found.iter().map(of).fold(f64::INFINITY, f64::min);
    let nearest = least(&|f| f.distance);
    let is_near = |f: &Found| f.distance <= nearest + 1e-6 * size;
    let least_near = least(&|f| if is_near(f) { f.cost } else { f64::INFINITY });
    let gains = 0.8 * least_near > nearest * nearest && least_near.sqrt() - nearest > 1e-3 * 0.015 * size;
    let moves = gains && least(&|f| f.cost) < 0.8 * least_near;
    let best = if moves { least(&|f| f.cost) } else { least_near };
    let weight = |f: &Found| {
        let counts = (moves || is_near(f)) && f.cost <= 1.72 * best + (1e-6 * size).powi(2);
        if counts { f.area * (-(f.cost - best) / (2.0 * 0.3 * 0.3 * best)).exp() } else { 0.0 }
    };
    let sum: f64 = found.iter().map(weight).sum();
    (found.iter().map(|f| weight(f) * f.distance).sum::<f64>() / sum, moves)
}

/// What every vertex of `sheet` takes from `body`; where those that leave a flipped face are a lining, either side will do.
fn expected(body: &Fixture, sheet: &Fixture, size: f64, are_lining: bool) -> Vec<f64> {
    let normals_around = |i: usize| {
        let around = sheet.triangles.iter().filter(move |t| t.contains(&(i as u32)));
        around.map(|t| area_vector(corners(sheet, t)))
    };
    let confidence = |i: usize| {
        let p = Vec3::from(sheet.positions[i]).as_dvec3();
        let normal = normals_around(i).sum::<DVec3>().normalize();
        let search = |both_ways: bool| -> Vec<Found> {
            let found = |t: &[u32; 3]| {
                let area = area_vector(corners(body, t));
                let cosine = normal.dot(area.normalize());
                let cosine = if both_ways { cosine.abs() } else { cosine };
                let distance = distance_to_triangle(p, corners(body, t));
                let cost = distance * distance + 2.0 * (0.015 * size).powi(2) * (1.0 - cosine);
                Found { distance, cost, area: area.length() }
            };
            body.triangles.iter().map(found).collect()
        };
        let (mut gap, moves) = chosen(&search(false), size);
        if moves && are_lining {
            gap = chosen(&search(true), size).0;
        }
        // The body's normals are all along x.
        let directions = normals_around(i).chain([normal]).map(|n| n.normalize().x.abs());
        let cosine = directions.fold(0.0, f64::max);
        let length =
            0.7 * gap * (0.93 + 2.8 * (1.0 / cosine.powi(2) - 1.0)) + (1e-3 * size).min(gap / 2.0) + 1e-6 * size;
        1.0 / (1.0 + (length / (0.02 * size)).powi(2))
    };
    (0..sheet.positions.len()).map(confidence).collect()
}

#[test]
fn choices_are_those_of_a_search_through_all_triangles() {
    let bulging = |rim: f64, middle: f64| {
        relief(move |y, z| if y.abs().max(z.abs()) < 0.45 { middle } else { rim + 0.01 * y }, 1, 3.0, 15)
    };
    // A trouser leg between two thighs, and a lining that the left one lies behind in the middle.
    for (width, rim, are_lining) in [(4.0, -0.05, false), (0.8, 0.05, true)] {
        for scale in [1.0, 300.0, 0.003] {
            let parts = [wall(-0.1, 1, width, 20), wall(0.1, -1, 4.0, 20)].map(|wall| wall.mapped(|p| p * scale));
            let sheet = bulging(rim, 0.02).mapped(|p| p * scale);
            let source = parts_with_bones(&parts);
            let max_distance = Length::Absolute(0.3 * scale);
            let settings = Settings { method: MatchMethod::Confidence, max_distance, ..Settings::default() };
            let result = transfer_weights(&source, target(&sheet), None, &settings).unwrap();
            let [left, right] = parts;
            let expected = expected(&left.joined(right), &sheet, source.size(), are_lining);
            for (i, (found, expected)) in std::iter::zip(&result.confidence, expected).enumerate() {
                assert!(
                    (f64::from(*found) - expected).abs() < 1e-4,
                    "{scale}, {width}: {i}: {found} is not {expected}"
                );
            }
        }
    }
}

#[test]
fn a_lining_stays_though_some_of_what_surrounds_it_is_none() {
    // The left thigh lies behind the middle and one side of it, where the sheet is close to it; on the other three sides the
    // sheet matches the right one flipped.
    let left = wall(-0.1, 1, 0.8, 20).mapped(|p| DVec3::new(p.x, if p.y > 0.0 { 4.0 * p.y } else { p.y }, p.z));
    let is_side = |y: f64, z: f64| y > 0.45 && z.abs() < 0.45;
    let is_middle = |y: f64, z: f64| y.abs().max(z.abs()) < 0.45;
    let at = |y, z| {
        if is_middle(y, z) {
            0.02
        } else if is_side(y, z) {
            -0.05
        } else {
            0.05
        }
    };
    let sheet = relief(at, 1, 3.0, 15);
    let source = parts_with_bones(&[left, wall(0.1, -1, 4.0, 20)]);
    let max_distance = Length::Absolute(0.3);
    for method in MatchMethod::ALL {
        let settings = Settings { method, max_distance, ..Settings::default() };
        let result = transfer_weights(&source, target(&sheet), None, &settings).unwrap();
        let (middle, side) = (dense(&result.weights, 7 * 16 + 7), dense(&result.weights, 12 * 16 + 7));
        assert!(middle[1] > 0.7 && side[0] > 0.7, "{method:?}: {middle:?} {side:?}");
    }
}
