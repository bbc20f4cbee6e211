//! Bodies made of flat walls, on which closest points and normals are known without a computer.

use crate::common::{Fixture, Row};
use glam::{DQuat, DVec3};
use skinwright_core::Weights;
use skinwright_core::transfer::{Source, TargetMesh};

/// A square wall around the x axis at `x`, `size` wide, of `n` x `n` quads; its normal points along x or, `facing` -1, against.
pub fn wall(x: f64, facing: i32, size: f64, n: usize) -> Fixture {
    relief(|_, _| x, facing, size, n)
}

/// The same with x as a function of y and z.
pub fn relief(x: impl Fn(f64, f64) -> f64, facing: i32, size: f64, n: usize) -> Fixture {
    let along = |k: usize| size * (k as f64 / n as f64 - 0.5);
    let position = |k: usize| {
        let (y, z) = (along(k / (n + 1)), along(k % (n + 1)));
        [x(y, z) as f32, y as f32, z as f32]
    };
    let quad = |k: usize| {
        let a = (k / n * (n + 1) + k % n) as u32;
        let [b, c, d] = [a + n as u32 + 1, a + n as u32 + 2, a + 1];
        if facing > 0 { [[a, b, c], [a, c, d]] } else { [[a, c, b], [a, d, c]] }
    };
    let positions = (0..(n + 1) * (n + 1)).map(position).collect();
    Fixture::new("wall", positions, (0..n * n).flat_map(quad).collect())
}

/// A body whose vertices have the rows that `row` makes of their position and of their part's number.
pub fn source(parts: &[Fixture], n_bones: u32, mut row: impl FnMut(usize, [f32; 3]) -> Row) -> Source {
    let rows: Vec<Row> = std::iter::zip(0.., parts)
        .flat_map(|(part, fixture)| fixture.positions.iter().map(move |&p| (part, p)))
        .map(|(part, p)| row(part, p))
        .collect();
    let mut indptr = vec![0];
    rows.iter().for_each(|(bones, _)| indptr.push(indptr[indptr.len() - 1] + bones.len() as u32));
    let (bones, values): (Vec<_>, Vec<_>) = rows.into_iter().unzip();
    let weights = Weights::new(indptr, bones.concat(), values.concat(), n_bones).unwrap();
    let whole = parts.iter().cloned().reduce(Fixture::joined).unwrap();
    Source::new(&whole.positions, whole.triangles, weights).unwrap()
}

/// A body whose every part has a bone of its own.
pub fn parts_with_bones(parts: &[Fixture]) -> Source {
    source(parts, parts.len() as u32, |part, _| (vec![part as u32], vec![1.0]))
}

pub fn target(fixture: &Fixture) -> TargetMesh {
    TargetMesh { positions: fixture.positions.clone(), triangles: fixture.triangles.clone(), edges: Vec::new() }
}

/// Row `i`, dense.
pub fn dense(weights: &Weights, i: usize) -> Vec<f32> {
    let mut row = vec![0.0; weights.n_bones() as usize];
    std::iter::zip(weights.row(i).0, weights.row(i).1).for_each(|(&bone, &value)| row[bone as usize] += value);
    row
}

/// Whether row `i` is this one within 1e-5.
pub fn is_row(weights: &Weights, i: usize, expected: &[f32]) -> bool {
    std::iter::zip(dense(weights, i), expected).all(|(found, expected)| (found - expected).abs() < 1e-5)
}

/// Distance of a point to a triangle, by its plane or else its sides.
pub fn distance_to_triangle(p: DVec3, corners: [DVec3; 3]) -> f64 {
    let [a, b, c] = corners;
    let normal = (b - a).cross(c - a).normalize();
    let sides = [(a, b), (b, c), (c, a)];
    if sides.iter().all(|(s, e)| (*e - *s).cross(p - *s).dot(normal) >= 0.0) {
        return (p - a).dot(normal).abs();
    }
    let to_side =
        |(s, e): (DVec3, DVec3)| p.distance(s.lerp(e, ((p - s).dot(e - s) / e.distance_squared(s)).clamp(0.0, 1.0)));
    sides.map(to_side).into_iter().fold(f64::INFINITY, f64::min)
}

/// A shaft of four walls around the y axis: bones 0 and 1 at x = -1 and 1, bones 2 and 3 at z = -1 and 1, all facing inwards.
pub fn shaft(scale: f64) -> Source {
    let turned = |p: DVec3| DQuat::from_rotation_y(-std::f64::consts::FRAC_PI_2) * p;
    // The walls' triangles differ, so that points on edges and corners tie with points in the middle of others.
    let sides = [wall(-1.0, 1, 1.9, 4), wall(1.0, -1, 1.9, 3)];
    let ends = [wall(-1.0, 1, 1.9, 2), wall(1.0, -1, 1.9, 5)].map(|wall| wall.mapped(turned));
    let walls: Vec<Fixture> = [sides, ends].concat().iter().map(|wall| wall.mapped(|p| p * scale)).collect();
    parts_with_bones(&walls)
}

/// A sheet of 3 x 3 vertices at height y = `height`, half a unit apart, whose normals point along y.
pub fn level(height: f64) -> Fixture {
    wall(height, 1, 1.0, 2).mapped(|p| DVec3::new(p.y, p.x, -p.z)).named("level sheet")
}
