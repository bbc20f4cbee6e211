//! Loose parts over a flat wall whose weights are linear in y: what each choice gives them is known in closed form.

use crate::common::Fixture;
use crate::walls::{dense, is_row, relief, source, target, wall};
use skinwright_core::transfer::{
    IslandPolicy, Length, MaskValue, MatchMethod, Settings, SmallIslands, Source, Transfer, transfer_weights,
};

/// A wall at x = 0, 4 wide, facing along x; the weight of bone 1 is y times `slope` and a half, that of bone 0 the rest.
fn slope(slope: f32) -> Source {
    source(&[wall(0.0, 1, 4.0, 16)], 2, |_, [_, y, _]| {
        let t = (slope * y + 0.5).clamp(0.0, 1.0);
        (vec![0, 1], vec![1.0 - t, t])
    })
}

/// A right triangle before the wall with `legs` along y and z; x at the right angle, the end of each leg.
fn triangle([x, along_y, along_z]: [f64; 3], legs: [f64; 2], y: f64) -> Fixture {
    let corners = [[x, y, 0.0], [along_y, y + legs[0], 0.0], [along_z, y, legs[1]]];
    Fixture::new("triangle", corners.map(|p| p.map(|x| x as f32)).to_vec(), vec![[0, 1, 2]])
}

fn transfer(source: &Source, fixture: &Fixture, settings: &Settings) -> Transfer {
    transfer_weights(source, target(fixture), None, settings).unwrap()
}

fn rigid() -> Settings {
    Settings { small_islands: SmallIslands::Rigid, max_distance: Length::Absolute(0.9), ..Settings::default() }
}

/// Whether this triangle becomes rigid, and if so with the mean of its rows by area: half of it is at the right angle.
fn becomes_rigid(steepness: f32, triangle: &Fixture) -> bool {
    let result = transfer(&slope(steepness), triangle, &rigid());
    let t: Vec<f32> = triangle.positions.iter().map(|p| steepness * p[1] + 0.5).collect();
    let mean = 0.5 * t[0] + 0.25 * (t[1] + t[2]);
    let is_rigid = result.report.rigid_islands == 1;
    for (i, own) in t.into_iter().enumerate() {
        let expected = if is_rigid { mean } else { own };
        assert!(is_row(&result.weights, i, &[1.0 - expected, expected]), "{i}: {:?}", dense(&result.weights, i));
    }
    is_rigid
}

#[test]
fn small_parts_become_rigid_and_large_ones_do_not() {
    // The wall's size is 4.2 times 4 / sqrt(6), and the largest diagonal is 0.13 of it: 0.8916.
    assert!(becomes_rigid(0.2, &triangle([0.5; 3], [0.528, 0.704], 0.0)));
    assert!(!becomes_rigid(0.2, &triangle([0.5; 3], [0.54, 0.72], 0.0)));
    let solved = Settings { small_islands: SmallIslands::Solved, ..rigid() };
    let button = triangle([0.5; 3], [0.3, 0.4], 0.0);
    assert_eq!(transfer(&slope(0.2), &button, &solved).report.rigid_islands, 0);
}

#[test]
fn by_default_the_method_of_confidences_makes_parts_rigid() {
    for method in MatchMethod::ALL {
        let settings = Settings { method, small_islands: SmallIslands::Auto, ..rigid() };
        let result = transfer(&slope(0.2), &wall(0.3, 1, 0.3, 2), &settings);
        assert_eq!(result.report.rigid_islands == 1, method == MatchMethod::Confidence, "{method:?}");
    }
}

#[test]
fn loose_parts_become_rigid_and_those_on_the_skin_do_not() {
    // The median gap counts, and the least one is 0.04 of the diagonal: 0.02.
    for (gaps, is_loose) in
        [([0.0201; 3], true), ([0.0199; 3], false), ([0.03, 0.01, 0.03], true), ([0.01, 0.01, 0.05], false)]
    {
        assert_eq!(becomes_rigid(0.2, &triangle(gaps, [0.3, 0.4], 0.0)), is_loose, "{gaps:?}");
    }
}

#[test]
fn parts_that_bend_much_are_left_alone() {
    // Along a leg of 0.4 rows differ from their mean by 0.375 times what the ends differ by; up to 0.2 is rigid.
    assert!(becomes_rigid(1.31, &triangle([0.3; 3], [0.4, 0.3], -0.2)));
    assert!(!becomes_rigid(1.35, &triangle([0.3; 3], [0.4, 0.3], -0.2)));
}

#[test]
fn a_part_without_rows_is_left_to_the_policy() {
    // One triangle matches, the other is too far away.
    let both = triangle([0.05; 3], [0.3, 0.4], 0.0).joined(triangle([0.7; 3], [0.3, 0.4], -0.5));
    let skipping = Settings { island_policy: IslandPolicy::Skip, max_distance: Length::Absolute(0.1), ..rigid() };
    let result = transfer(&slope(0.2), &both, &skipping);
    assert_eq!((result.report.rigid_islands, result.report.unweighted), (1, 3));
    assert!((3..6).all(|i| result.weights.row(i).0.is_empty()));
}

/// Nothing matches at this distance.
fn unmatched(island_policy: IslandPolicy) -> Settings {
    let max_distance = Length::Absolute(0.01);
    Settings { island_policy, max_distance, small_islands: SmallIslands::Solved, ..Settings::default() }
}

#[test]
fn where_nothing_matches_parts_hang_on_the_body_and_on_each_other() {
    // The first is 0.2 before the wall; the second is nearer to the first than to the wall, and the third to the wall.
    let parts = triangle([0.2, 0.25, 0.25], [0.3, 0.3], -0.5)
        .joined(triangle([0.35, 0.36, 0.36], [0.3, 0.3], -0.5))
        .joined(triangle([0.3, 0.35, 0.4], [0.3, 0.3], 1.0));
    let result = transfer(&slope(0.2), &parts, &unmatched(IslandPolicy::Bridge));
    for (i, y) in (0..9).zip([-0.5, -0.5, -0.5, -0.5, -0.5, -0.5, 1.0, 1.0, 1.0]) {
        let t = 0.2 * y + 0.5;
        assert!(is_row(&result.weights, i, &[1.0 - t, t]), "{i}: {:?}", dense(&result.weights, i));
    }
    let policies: Vec<_> = result.report.unmatched_islands.iter().map(|island| island.policy).collect();
    assert_eq!((policies, result.report.matched), (vec![IslandPolicy::Bridge; 3], 0));
}

#[test]
fn a_part_over_skin_without_weights_hangs_while_others_take_their_own() {
    let bare = source(&[wall(0.0, 1, 4.0, 16)], 2, |_, [_, y, _]| {
        let t = 0.2 * y + 0.5;
        if y > 1.1 { (vec![], vec![]) } else { (vec![0, 1], vec![1.0 - t, t]) }
    });
    // The garment on the wall ends at y = 0.25; the other two match nothing.
    let parts =
        wall(0.005, 1, 0.5, 2).joined(triangle([0.1; 3], [0.2, 0.2], -1.0)).joined(triangle([0.1; 3], [0.2, 0.2], 1.4));
    for policy in [IslandPolicy::Rigid, IslandPolicy::Nearest] {
        let result = transfer(&bare, &parts, &unmatched(policy));
        let is_at = |i: usize, t: f32| is_row(&result.weights, i, &[1.0 - t, t]);
        let own = |i: usize| 0.2 * parts.positions[i][1] + 0.5;
        let mean = (own(9) + own(10) + own(11)) / 3.0;
        assert!((9..12).all(|i| is_at(i, if policy == IslandPolicy::Rigid { mean } else { own(i) })), "{policy:?}");
        assert!((12..15).all(|i| is_at(i, 0.2 * 0.25 + 0.5)), "{policy:?}: {:?}", dense(&result.weights, 12));
        let policies: Vec<_> = result.report.unmatched_islands.iter().map(|island| island.policy).collect();
        assert_eq!(policies, [policy, IslandPolicy::Bridge]);
    }
}

/// A part half a unit before the wall that looks the other way, and a garment 0.3 before it that ends `aside` of the part:
/// whether the part takes the row of the garment's edge, or else that of the wall below it.
fn hangs_on_the_garment(aside: f64, max_distance: f64) -> bool {
    let y = 0.25 + aside;
    let both = wall(0.3, 1, 0.5, 2).joined(triangle([0.5, 0.55, 0.55], [0.2, -0.2], y));
    let mask: Vec<_> = (0..12).map(|i| if i < 9 { MaskValue::ForceMatch } else { MaskValue::Automatic }).collect();
    let settings = Settings {
        max_distance: Length::Absolute(max_distance),
        match_flipped_normals: false,
        ..unmatched(IslandPolicy::Bridge)
    };
    let result = transfer_weights(&slope(0.2), target(&both), Some(&mask), &settings).unwrap();
    let is_at = |y: f64| {
        let t = 0.2 * y as f32 + 0.5;
        (9..12).all(|i| is_row(&result.weights, i, &[1.0 - t, t]))
    };
    assert_ne!(is_at(0.25), is_at(y), "{:?}", dense(&result.weights, 9));
    is_at(0.25)
}

#[test]
fn a_part_hangs_on_the_garment_unless_that_is_out_of_reach_and_the_body_nearer() {
    assert!(hangs_on_the_garment(0.1, 0.01), "the garment is nearer");
    assert!(!hangs_on_the_garment(1.0, 0.01), "the body is nearer");
    assert!(hangs_on_the_garment(1.0, 1.1), "the body is nearer, but the garment is within reach");
}

#[test]
fn rigid_is_the_mean_by_nearness_and_nearest_is_every_points_own() {
    // More than two thousand vertices of two bones each, tilted, so that near ones count more.
    let plate = relief(|y, _| 0.3 + 0.1 * y, 1, 1.5, 50);
    let own = |p: &[f32; 3]| 0.2 * f64::from(p[1]) + 0.5;
    let nearest = transfer(&slope(0.2), &plate, &unmatched(IslandPolicy::Nearest));
    for (i, t) in plate.positions.iter().map(own).enumerate() {
        assert!(is_row(&nearest.weights, i, &[1.0 - t as f32, t as f32]), "{i}");
    }
    let rigid = transfer(&slope(0.2), &plate, &unmatched(IslandPolicy::Rigid));
    let diagonal = 4.0 * 2f64.sqrt();
    let weigh = |p: &[f32; 3]| 1.0 / (f64::from(p[0]) + 1e-3 * diagonal);
    let sum: f64 = plate.positions.iter().map(weigh).sum();
    let mean: f64 = plate.positions.iter().map(|p| weigh(p) * own(p) / sum).sum();
    let expected = [1.0 - mean as f32, mean as f32];
    assert!((0..plate.positions.len()).all(|i| is_row(&rigid.weights, i, &expected)), "{:?}", dense(&rigid.weights, 0));
    assert!((mean - 0.5).abs() > 1e-3, "the plain mean is another");
}
