//! Which point of a body of flat walls a vertex takes its weights from.

use crate::common::Fixture;
use crate::walls::{dense, is_row, level, parts_with_bones, relief, shaft, target, wall};
use glam::DVec3;
use skinwright_core::Progress;
use skinwright_core::transfer::{
    Inpainting, Length, MaskValue, MatchMethod, Settings, Source, Transfer, transfer_weights,
};
use std::f64::consts::PI;

fn transfer(source: &Source, fixture: &Fixture, settings: &Settings) -> Transfer {
    transfer_weights(source, target(fixture), None, settings).unwrap()
}

fn within(max_distance: f64) -> Settings {
    Settings { max_distance: Length::Absolute(max_distance), ..Settings::default() }
}

#[test]
fn equally_near_places_share_a_vertex() {
    let any_angle = Settings { max_normal_angle: PI, average_ties: true, ..within(3.0) };
    for (height, scale) in [(0.0, 1.0), (0.3, 1.0), (0.475, 1.0), (0.51, 1.0), (0.3, 0.01), (0.3, 64.0)] {
        let sheet = level(height).mapped(|p| p * scale);
        let any_angle = Settings { max_distance: Length::Absolute(3.0 * scale), ..any_angle.clone() };
        let result = transfer(&shaft(scale), &sheet, &any_angle);
        for (i, &[x, _, z]) in sheet.positions.iter().enumerate() {
            let reached = [-x, x, -z, z].map(|toward| toward >= x.abs().max(z.abs()));
            let count = reached.iter().filter(|&&is_reached| is_reached).count() as f32;
            let expected = reached.map(|is_reached| if is_reached { 1.0 / count } else { 0.0 });
            assert!(is_row(&result.weights, i, &expected), "{height}, {x} {z}: {:?}", dense(&result.weights, i));
        }
        let single = transfer(&shaft(1.0), &sheet, &Settings { average_ties: false, ..any_angle.clone() });
        assert!((0..9).all(|i| single.weights.row(i).0.len() == 1), "the first place counts alone");
    }
}

#[test]
fn equally_near_borders_share_a_vertex() {
    // Beyond the rims of two walls; a rim has a triangle on one side only, so a tie is not the edge's other triangle.
    let rims = parts_with_bones(&[wall(-1.0, 1, 1.9, 4), wall(1.0, -1, 1.9, 3)]);
    let settings = Settings { max_normal_angle: PI, average_ties: true, ..within(3.0) };
    let result = transfer(&rims, &level(1.2), &settings);
    assert!((3..6).all(|i| is_row(&result.weights, i, &[0.5, 0.5])));
}

#[test]
fn of_equally_near_places_those_whose_normals_agree_best_count() {
    let settings = Settings { max_normal_angle: PI, average_ties: true, ..within(3.0) };
    for (facing, bone) in [(1, 0), (-1, 1)] {
        let result = transfer(&shaft(1.0), &wall(0.0, facing, 0.2, 2), &settings);
        assert_eq!(result.weights.row(4), (&[bone][..], &[1.0][..]));
    }
    // A hair's breadth from the middle one place is nearer; on the surface there are no two.
    let aside = level(0.1).mapped(|p| p + DVec3::X * 1e-5);
    assert_eq!(transfer(&shaft(1.0), &aside, &settings).weights.row(4).0, [1]);
    let back_to_back = parts_with_bones(&[wall(0.0, 1, 2.0, 4), wall(0.0, -1, 2.0, 4)]);
    let result = transfer(&back_to_back, &wall(0.0, 1, 1.0, 3), &settings);
    assert!((0..16).all(|i| result.weights.row(i).0.len() == 1));
}

/// Two thighs: bone 0 at x = `left` faces right, `size` wide, bone 1 at x = `right` faces left.
fn thighs(left: f64, right: f64, size: f64) -> Source {
    parts_with_bones(&[wall(left, 1, size, 20), wall(right, -1, 4.0, 20)])
}

/// The inside of a trouser leg, 3 wide, facing right, which bulges from x = `rim` to x = `middle`.
fn trouser(rim: f64, middle: f64) -> Fixture {
    let is_middle = |y: f64, z: f64| y.abs().max(z.abs()) < 0.45;
    relief(|y, z| if is_middle(y, z) { middle } else { rim }, 1, 3.0, 15).named("trouser leg")
}

fn methods(settings: &Settings) -> [Settings; 2] {
    [MatchMethod::ClosestPoint, MatchMethod::Confidence].map(|method| Settings { method, ..settings.clone() })
}

fn follows(result: &Transfer, bone: usize) -> bool {
    let expected = [0, 1].map(|k| if k == bone { 1.0 } else { 0.0 });
    (0..result.weights.vertex_count()).all(|i| is_row(&result.weights, i, &expected))
}

#[test]
fn a_trouser_leg_that_bulges_to_the_other_thigh_follows_its_own() {
    let leg = trouser(-0.05, 0.02);
    for settings in methods(&within(0.3)) {
        let result = transfer(&thighs(-0.1, 0.1, 4.0), &leg, &settings);
        assert!(follows(&result, 0), "{:?}", settings.method);
        if settings.method == MatchMethod::ClosestPoint {
            assert_eq!(result.report.matched, leg.positions.len());
            assert!(result.angles.iter().all(|&angle| angle < 0.61), "no normal is opposite");
            for (distance, p) in std::iter::zip(&result.distances, &leg.positions) {
                assert!((distance - (p[0] + 0.1)).abs() < 1e-6);
            }
        }
    }
}

#[test]
fn a_lining_among_linings_stays_where_it_is() {
    // The left thigh lies behind the middle only: around it the sheet matches the right one flipped.
    for settings in methods(&within(0.3)) {
        let result = transfer(&thighs(-0.1, 0.1, 0.8), &trouser(0.05, 0.02), &settings);
        assert!(follows(&result, 1), "{:?}", settings.method);
    }
}

#[test]
fn a_face_that_looks_the_right_way_is_looked_for_near_by() {
    // Four times the distance of the flipped face is too little for this gap.
    let far = transfer(&thighs(-0.4, 0.1, 4.0), &trouser(-0.25, 0.02), &within(0.6));
    let middle = 8 * 16 + 8;
    assert!(is_row(&far.weights, middle, &[0.0, 1.0]) && is_row(&far.weights, 0, &[1.0, 0.0]));
    // Right at the flipped face a hundredth of the body's diagonal is enough.
    let close = transfer(&thighs(-0.015, 0.021, 4.0), &trouser(-0.01, 0.02), &within(0.3));
    assert!(follows(&close, 0));
    // Where either side will do, none is looked for.
    let either = Settings { max_normal_angle: 2.0, ..within(0.3) };
    let any = transfer(&thighs(-0.1, 0.1, 4.0), &trouser(-0.05, 0.02), &either);
    assert!(is_row(&any.weights, middle, &[0.0, 1.0]));
    // Nothing beyond the largest distance counts.
    let strict = transfer(&thighs(-0.1, 0.1, 4.0), &trouser(-0.05, 0.02), &within(0.11));
    assert!(is_row(&strict.weights, middle, &[0.0, 1.0]));
}

#[test]
fn other_thresholds_move_points_back_and_forth() {
    let (source, leg) = (thighs(-0.1, 0.1, 4.0), trouser(-0.05, 0.02));
    let progress = Progress::default();
    let base = within(0.3);
    let mut kept = Inpainting::new(source.clone(), target(&leg), &base, &progress).unwrap();
    let one_way = Settings { match_flipped_normals: false, ..base.clone() };
    let narrow = Settings { max_distance: Length::Absolute(0.11), ..base.clone() };
    for settings in [&base, &one_way, &narrow, &base] {
        let (again, fresh) = (kept.solve(None, settings, &progress).unwrap(), transfer(&source, &leg, settings));
        assert_eq!((again.weights, again.matched), (fresh.weights, fresh.matched));
        assert_eq!((again.distances, again.angles), (fresh.distances, fresh.angles));
    }
}

/// The wall with each triangle once more the other way round.
fn card(x: f64, facing: i32) -> Fixture {
    let mut card = wall(x, facing, 1.0, 3);
    card.triangles.extend(card.triangles.clone().iter().map(|&[a, b, c]| [a, c, b]));
    card.named("card")
}

#[test]
fn a_card_may_be_taken_from_either_side() {
    let source = parts_with_bones(&[wall(0.0, 1, 4.0, 4)]);
    let one_way = Settings { match_flipped_normals: false, ..within(0.1) };
    for facing in [1, -1] {
        let result = transfer(&source, &card(0.05, facing), &one_way);
        assert_eq!(result.report.matched, 16);
        assert!(result.angles.iter().all(|&angle| angle < 1e-6));
    }
    let upright = transfer(&source, &wall(0.05, 1, 1.0, 3), &one_way);
    assert!(upright.matched.iter().all(|&matched| matched));
    assert!(transfer_weights(&source, target(&wall(0.05, -1, 1.0, 3)), None, &one_way).unwrap().report.matched == 0);
}

#[test]
fn normals_of_the_source_are_shared_where_only_the_file_keeps_vertices_apart() {
    let ridge = relief(|y, _| -y.abs(), 1, 2.0, 2);
    let whole = parts_with_bones(std::slice::from_ref(&ridge));
    let split = Fixture {
        positions: ridge.triangles.iter().flatten().map(|&i| ridge.positions[i as usize]).collect(),
        triangles: (0..ridge.triangles.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect(),
        ..ridge.clone()
    };
    for (k, normal) in parts_with_bones(&[split]).normals().iter().enumerate() {
        let expected = whole.normals()[ridge.triangles[k / 3][k % 3] as usize];
        assert!(normal.distance(expected) < 1e-6, "{k}: {normal} is not {expected}");
    }
    // Two sheets back to back keep their own sides, and a card has that of its first face.
    let sheets = parts_with_bones(&[wall(0.0, 1, 1.0, 2), wall(0.0, -1, 1.0, 2)]);
    assert!(sheets.normals().iter().enumerate().all(|(i, normal)| normal.x == if i < 9 { 1.0 } else { -1.0 }));
    for facing in [1, -1] {
        assert!(parts_with_bones(&[card(0.0, facing)]).normals().iter().all(|normal| normal.x == facing as f32));
    }
}

#[test]
fn what_is_known_before_a_solve_is_what_the_solve_says() {
    let source = parts_with_bones(&[wall(0.0, 1, 4.0, 8)]);
    // Two sheets with a common seam that the file keeps apart, and a vertex on its own.
    let tilted = |p: DVec3| DVec3::new(0.05 + 0.1 * (p.y + 1.0), p.y, p.z);
    let half = wall(0.0, 1, 1.0, 4);
    let mut sheet = half.clone().joined(half.mapped(|p| p + DVec3::Y)).mapped(tilted);
    sheet.positions.push([0.1, 0.0, 0.0]);
    let mut mask = vec![MaskValue::Automatic; sheet.positions.len()];
    // The seam's copies are vertices 20.. and 25..: either says what both do, and forcing a match wins.
    (mask[20], mask[21], mask[26]) = (MaskValue::Inpaint, MaskValue::Inpaint, MaskValue::ForceMatch);
    let progress = Progress::default();
    let unwelded = Settings { weld_tolerance: Length::Absolute(0.0), ..within(0.2) };
    for settings in methods(&within(0.2)) {
        let mut kept = Inpainting::new(source.clone(), target(&sheet), &unwelded, &progress).unwrap();
        let (matched, confidence) = (kept.matched(Some(&mask), &settings), kept.confidence(Some(&mask), &settings));
        let result = kept.solve(Some(&mask), &settings, &progress).unwrap();
        assert_eq!((matched.unwrap(), confidence.unwrap()), (result.matched, result.confidence));
        assert_eq!(kept.distances(), result.distances);
        assert_eq!(kept.angles()[..50], result.angles[..50]);
        assert!(result.angles[50].is_nan(), "it has no normal");
        let islands = kept.island_of_vertex();
        assert!(islands[..50].iter().all(|&island| island == islands[0]) && islands[50] != islands[0]);
        assert_eq!((result.report.welded, result.report.islands, result.report.loose), (5, 1, 1));
        let matched = kept.matched(Some(&mask), &settings).unwrap();
        assert_eq!((matched[20], matched[25]), (false, false));
        assert_eq!((matched[21], matched[26]), (true, true));
    }
    let mut kept = Inpainting::new(source.clone(), target(&sheet), &within(0.2), &progress).unwrap();
    assert_eq!(kept.solve(None, &unwelded, &progress).unwrap().report.islands, 2);
    let seconds = kept.solve(None, &within(0.2), &progress).unwrap();
    assert_eq!(seconds.weights, transfer(&source, &sheet, &within(0.2)).weights);
}

/// A plate of 16 x 16 vertices, 0.004 apart, that stands out from `rim` to `top` in two steep steps.
fn hat(rim: f64, top: f64) -> Fixture {
    let height = |y: f64, z: f64| match (y.abs().max(z.abs()) / 0.004).floor() as u32 {
        0..3 => top,
        3 => f64::midpoint(rim, top),
        _ => rim,
    };
    relief(height, 1, 0.06, 15).named("hat")
}

#[test]
fn a_ring_that_agrees_neither_way_does_not_speak_for_the_patch_in_it() {
    // The top is nearer to the thigh that faces it, the brim to its own; the steep ring looks aside.
    for settings in methods(&within(0.3)) {
        let result = transfer(&thighs(-0.02, 0.02, 4.0), &hat(-0.018, 0.006), &settings);
        assert!(follows(&result, 0), "{:?}", settings.method);
    }
}

#[test]
fn a_vertex_inside_the_other_thigh_looks_for_its_own_as_far_as_it_may_match() {
    // The middle is 0.05 deep in the right thigh and 0.55 before the left one.
    let leg = trouser(-0.25, 0.15);
    let middle = 8 * 16 + 8;
    for (max_distance, row) in [(0.6, [1.0, 0.0]), (0.54, [0.0, 1.0])] {
        let result = transfer(&thighs(-0.4, 0.1, 4.0), &leg, &within(max_distance));
        assert!(is_row(&result.weights, middle, &row), "{max_distance}: {:?}", dense(&result.weights, middle));
        assert!(result.matched[middle]);
    }
}

#[test]
fn a_face_counts_only_for_vertices_before_it() {
    // Bone 2 looks the right way at x = 0.11, but the middle lies behind it; its own thigh is farther away.
    let walls = [wall(-0.1, 1, 4.0, 20), wall(0.1, -1, 4.0, 20), wall(0.11, 1, 0.5, 4)];
    let result = transfer(&parts_with_bones(&walls), &trouser(-0.05, 0.02), &within(0.3));
    let middle = 8 * 16 + 8;
    assert!(is_row(&result.weights, middle, &[1.0, 0.0, 0.0]), "{:?}", dense(&result.weights, middle));
}

#[test]
fn only_vertices_that_match_flipped_look_for_another_face() {
    // Over a floor and beside a wall; what is nearer to the wall is at a right angle to it.
    let upwards = |p: DVec3| DVec3::new(-p.z, p.y, p.x);
    let floor = wall(-0.15, 1, 4.0, 20).mapped(upwards);
    let body = parts_with_bones(&[floor, wall(0.0, 1, 4.0, 20)]);
    let plate = wall(0.0, 1, 1.0, 10).mapped(|p| upwards(p) + DVec3::X * 0.52);
    let result = transfer(&body, &plate, &within(0.3));
    for (i, p) in plate.positions.iter().enumerate() {
        assert_eq!(result.matched[i], p[0] > 0.15, "{p:?}");
        assert!((result.distances[i] - p[0].min(0.15)).abs() < 1e-6);
    }
}
