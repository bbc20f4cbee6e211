//! Parts that hang on a garment and on each other, against Prim's algorithm over all pairs.

use crate::common::{Fixture, noise};
use crate::walls::{dense, distance_to_triangle, is_row, relief, source, target, wall};
use glam::{DVec3, Vec3};
use skinwright_core::transfer::{IslandPolicy, Length, MaskValue, Settings, Source, Transfer, transfer_weights};

/// A body far behind everything, so that parts hang on the garment; its weights are linear in y and tell where.
fn body() -> Source {
    source(&[wall(-20.0, 1, 8.0, 16)], 2, |_, [_, y, _]| (vec![0, 1], vec![0.5 - y / 8.0, 0.5 + y / 8.0]))
}

/// `parts` on a garment at x = `at`, 4 wide, of `n` x `n` quads.
fn hung(at: f64, n: usize, parts: &[Fixture]) -> Transfer {
    let whole = parts.iter().cloned().fold(wall(at, 1, 4.0, n), Fixture::joined);
    let is_garment = |i: usize| i < (n + 1) * (n + 1);
    let force = |i| if is_garment(i) { MaskValue::ForceMatch } else { MaskValue::Automatic };
    let mask: Vec<MaskValue> = (0..whole.positions.len()).map(force).collect();
    let (island_policy, max_distance) = (IslandPolicy::Bridge, Length::Absolute(0.01));
    let settings = Settings { island_policy, max_distance, ..Settings::default() };
    transfer_weights(&body(), target(&whole), Some(&mask), &settings).unwrap()
}

/// Each part's y on the garment: that of the point it hangs on, or of the part it hangs on.
fn by_prim(at: f64, parts: &[Fixture]) -> Vec<f64> {
    let vertices = |k: usize| parts[k].positions.iter().map(|&p| Vec3::from(p).as_dvec3());
    let on_garment = |p: DVec3| p.distance(DVec3::new(at, p.y.clamp(-2.0, 2.0), p.z.clamp(-2.0, 2.0)));
    let to_garment = |k: usize| vertices(k).map(|p| (on_garment(p), p.y.clamp(-2.0, 2.0))).min_by(by_gap).unwrap();
    let mut best: Vec<(f64, f64)> = (0..parts.len()).map(to_garment).collect();
    let mut is_hung = vec![false; parts.len()];
    for _ in 0..parts.len() {
        let waiting = (0..parts.len()).filter(|&k| !is_hung[k]);
        let next = waiting.min_by(|&a, &b| best[a].0.total_cmp(&best[b].0)).unwrap();
        is_hung[next] = true;
        for k in (0..parts.len()).filter(|&k| !is_hung[k]) {
            let gap = vertices(k).map(|p| distance_to(p, &parts[next])).fold(f64::INFINITY, f64::min);
            if gap < best[k].0 {
                best[k] = (gap, best[next].1);
            }
        }
    }
    best.into_iter().map(|(_, y)| y).collect()
}

fn by_gap(a: &(f64, f64), b: &(f64, f64)) -> std::cmp::Ordering {
    a.0.total_cmp(&b.0)
}

fn distance_to(p: DVec3, part: &Fixture) -> f64 {
    let corners = |t: &[u32; 3]| t.map(|i| Vec3::from(part.positions[i as usize]).as_dvec3());
    part.triangles.iter().map(|t| distance_to_triangle(p, corners(t))).fold(f64::INFINITY, f64::min)
}

/// A part somewhere before the garment: a triangle, or every third time a curved plate of 32 triangles.
fn part(seed: u64, k: u64) -> Fixture {
    let at = |axis: u64| noise(seed * 1000 + k, axis);
    let centre = DVec3::new(0.2 + 2.0 * at(0), 5.0 * at(1) - 2.5, 5.0 * at(2) - 2.5);
    if k.is_multiple_of(3) {
        return relief(|y, z| 0.8 * y * z, 1, 0.1 + 0.5 * at(3), 4).mapped(|p| p + centre);
    }
    let corner = |j: u64| (centre + 0.3 * DVec3::new(at(3 + j), at(6 + j), at(9 + j))).as_vec3().to_array();
    Fixture::new("triangle", (0..3).map(corner).collect(), vec![[0, 1, 2]])
}

#[test]
fn parts_hang_where_prims_algorithm_hangs_them() {
    // Few parts look at some of a fine garment's triangles only; many wait in a tree.
    for (seed, count, n) in [(1, 1, 60), (2, 3, 60), (3, 5, 10), (4, 40, 4), (5, 90, 4), (6, 150, 4)] {
        agrees_with_prim(&(0..count).map(|k| part(seed, k)).collect::<Vec<_>>(), 0.0, n);
    }
    // Two groups on both sides of the origin: one close to the garment, the other nearer to that one than to the garment.
    for seed in 7..37 {
        let group = |k: u64, p: DVec3| {
            let aside = DVec3::new(1.5 + 0.1 * p.x, 0.3 + 0.3 * p.y, 0.3 + 0.3 * p.z);
            if (k + seed).is_multiple_of(2) { aside } else { -aside }
        };
        let parts: Vec<Fixture> = (0..12).map(|k| part(seed, k).mapped(|p| group(k, p))).collect();
        agrees_with_prim(&parts, -1.8, 4);
        agrees_with_prim(&parts, 1.8, 4);
    }
}

fn agrees_with_prim(parts: &[Fixture], at: f64, n: usize) {
    let (expected, result) = (by_prim(at, parts), hung(at, n, parts));
    let mut first = (n + 1) * (n + 1);
    for (k, (part, y)) in std::iter::zip(parts, expected).enumerate() {
        let row = [0.5 - y as f32 / 8.0, 0.5 + y as f32 / 8.0];
        let found = dense(&result.weights, first);
        assert!(is_row(&result.weights, first, &row), "{at}, {n}: part {k}: {found:?} is not {row:?}");
        assert!((first..first + part.positions.len()).all(|i| dense(&result.weights, i) == found), "one row");
        first += part.positions.len();
    }
    assert_eq!(result.report.unmatched_islands.len(), parts.len());
}

#[test]
fn of_equal_gaps_the_garment_counts() {
    let triangle = |corners: [[f32; 3]; 3]| Fixture::new("triangle", corners.to_vec(), vec![[0, 1, 2]]);
    // The second is half a unit from the garment and from the first, which is nearer to the garment.
    let first = triangle([[0.5, 0.5, 0.0], [0.25, 1.0, 0.0], [0.25, 1.0, 0.5]]);
    let second = triangle([[0.5, 0.0, 0.0], [0.75, -0.25, 0.0], [0.75, -0.25, 0.25]]);
    for parts in [[first.clone(), second.clone()], [second, first]] {
        let (result, is_swapped) = (hung(0.0, 4, &parts), parts[0].positions[0][1] == 0.0);
        let [first, second] = if is_swapped { [28, 25] } else { [25, 28] };
        assert!(is_row(&result.weights, first, &[0.375, 0.625]), "{:?}", dense(&result.weights, first));
        assert!(is_row(&result.weights, second, &[0.5, 0.5]), "{:?}", dense(&result.weights, second));
    }
}

#[test]
fn a_part_that_touches_the_garment_hangs_there() {
    let corners = vec![[0.0, 0.71, 0.3], [0.01, 0.71, 0.3], [0.01, 0.72, 0.3]];
    let touching = Fixture::new("triangle", corners, vec![[0, 1, 2]]);
    let first = 61 * 61;
    let result = hung(0.0, 60, &[touching]);
    let t = 0.71 / 8.0;
    assert!((first..first + 3).all(|i| is_row(&result.weights, i, &[0.5 - t, 0.5 + t])));
}
