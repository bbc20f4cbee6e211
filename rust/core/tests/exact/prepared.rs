//! What a prepared target does again for other settings and other weights of the source, against one that is prepared for them.

use std::f64::consts::PI;

use crate::common::Fixture;
use crate::dense::{energy, minimiser, stiffness_and_masses};
use crate::walls::{dense, is_row, level, relief, shaft, source, target, wall};
use glam::DVec3;
use skinwright_core::transfer::{
    Inpainting, IslandPolicy, Length, MaskValue, MatchMethod, Settings, SmallIslands, Transfer, transfer_weights,
};
use skinwright_core::{Error, Progress, Weights};

fn any_angle() -> Settings {
    Settings { max_normal_angle: PI, max_distance: Length::Absolute(3.0), ..Settings::default() }
}

fn assert_same(again: &Transfer, fresh: &Transfer) {
    assert_eq!((&again.weights, &again.matched), (&fresh.weights, &fresh.matched));
    assert_eq!((&again.confidence, &again.distances), (&fresh.confidence, &fresh.distances));
}

#[test]
fn other_methods_and_ties_find_other_points() {
    let (progress, base) = (Progress::default(), any_angle());
    let (shaft, sheet) = (shaft(1.0), level(0.3));
    let mut kept = Inpainting::new(shaft.clone(), target(&sheet), &base, &progress).unwrap();
    let ties = Settings { average_ties: true, ..base.clone() };
    let confidence = Settings { method: MatchMethod::Confidence, ..base.clone() };
    for settings in [&base, &ties, &base, &confidence, &ties, &confidence, &base] {
        let fresh = transfer_weights(&shaft, target(&sheet), None, settings).unwrap();
        assert_same(&kept.solve(None, settings, &progress).unwrap(), &fresh);
    }
}

#[test]
fn a_forced_vertex_takes_one_point_where_others_take_the_mean() {
    let ties = Settings { average_ties: true, ..any_angle() };
    let mut mask = vec![MaskValue::Automatic; 9];
    mask[4] = MaskValue::ForceMatch;
    let result = transfer_weights(&shaft(1.0), target(&level(0.3)), Some(&mask), &ties).unwrap();
    assert_eq!(result.weights.row(4).0.len(), 1);
    assert_eq!(result.weights.row(0).0.len(), 2);
}

/// Weights of a wall of 17 x 17 vertices: bone 0, but none where y is above this.
fn up_to(y: f64) -> Weights {
    let rows = wall(0.0, 1, 4.0, 16).positions.iter().map(|p| u32::from(f64::from(p[1]) <= y)).collect::<Vec<_>>();
    let mut indptr = vec![0];
    rows.iter().for_each(|count| indptr.push(indptr[indptr.len() - 1] + count));
    let count = rows.iter().sum::<u32>() as usize;
    Weights::new(indptr, vec![0; count], vec![1.0; count], 1).unwrap()
}

#[test]
fn other_weights_of_the_source_change_what_can_match() {
    let progress = Progress::default();
    let settings = Settings { max_distance: Length::Absolute(0.1), ..Settings::default() };
    let full = source(&[wall(0.0, 1, 4.0, 16)], 1, |_, _| (vec![0], vec![1.0]));
    let sheet = wall(0.05, 1, 2.0, 5);
    let mut kept = Inpainting::new(full.clone(), target(&sheet), &settings, &progress).unwrap();
    for y in [0.1, 5.0, -0.4] {
        kept.set_source_weights(up_to(y)).unwrap();
        let fresh = transfer_weights(&full.with_weights(up_to(y)).unwrap(), target(&sheet), None, &settings).unwrap();
        let again = kept.solve(None, &settings, &progress).unwrap();
        assert_same(&again, &fresh);
        // The body has quads of a quarter.
        let has_weight = |p: &[f32; 3]| f64::from(p[1]) < y + 0.15;
        assert!(std::iter::zip(&again.matched, &sheet.positions).all(|(&matched, p)| matched == has_weight(p)), "{y}");
    }
    assert!(kept.solve(None, &Settings { island_policy: IslandPolicy::Skip, ..settings.clone() }, &progress).is_ok());
    // Only what has weights and may match counts as near.
    kept.set_source_weights(up_to(-1.6)).unwrap();
    assert!(kept.solve(None, &settings, &progress).is_err());
    let mut mask = vec![MaskValue::Inpaint; sheet.positions.len()];
    kept.set_source_weights(up_to(5.0)).unwrap();
    assert!(kept.solve(Some(&mask), &settings, &progress).is_err(), "the mask forbids every vertex to match");
    mask[3] = MaskValue::Automatic;
    assert!(kept.solve(Some(&mask), &settings, &progress).is_ok());
}

/// A sheet on a wall, bone 1 above y = 0, and a plate 0.4 before its lower end.
fn sheet_and_plate(mask_of_plate: &[(usize, MaskValue)], max_distance: f64) -> (Transfer, Fixture) {
    let body = source(&[wall(0.0, 1, 4.0, 16)], 2, |_, [_, y, _]| {
        let t = (0.2 * y + 0.5).clamp(0.0, 1.0);
        (vec![0, 1], vec![1.0 - t, t])
    });
    let plate = wall(0.4, 1, 1.5, 3).mapped(|p| p - DVec3::Y);
    let both = wall(0.02, 1, 1.0, 4).joined(plate);
    let settings = Settings {
        method: MatchMethod::Confidence,
        small_islands: SmallIslands::Solved,
        max_distance: Length::Absolute(max_distance),
        ..Settings::default()
    };
    let mut mask = vec![MaskValue::Automatic; both.positions.len()];
    mask_of_plate.iter().for_each(|&(i, value)| mask[25 + i] = value);
    (transfer_weights(&body, target(&both), Some(&mask), &settings).unwrap(), both)
}

#[test]
fn a_part_out_of_the_papers_reach_hangs_unless_a_vertex_is_forced() {
    let is_one_row = |result: &Transfer| (25..41).all(|i| is_row(&result.weights, i, &dense(&result.weights, 25)));
    let (hung, _) = sheet_and_plate(&[], 0.1);
    assert!(is_one_row(&hung) && hung.confidence[25..].iter().all(|&confidence| confidence == 0.0));
    assert_eq!(hung.report.unmatched_islands.len(), 1);
    // One vertex within reach, or one that is forced, makes it a part of the garment.
    let (reached, _) = sheet_and_plate(&[], 0.41);
    let (forced, _) = sheet_and_plate(&[(5, MaskValue::ForceMatch)], 0.1);
    for result in [&reached, &forced] {
        assert!(!is_one_row(result) && result.confidence[25..].iter().all(|&confidence| confidence > 0.0));
        assert!(result.report.unmatched_islands.is_empty());
    }
    assert_eq!(forced.confidence[30], 1.0);
}

#[test]
fn vertices_over_skin_without_weights_do_not_make_a_part_reached() {
    let body = source(&[wall(0.0, 1, 4.0, 16)], 2, |_, [_, y, _]| {
        let t = (0.2 * y + 0.5).clamp(0.0, 1.0);
        if y > 1.1 { (vec![], vec![]) } else { (vec![0, 1], vec![1.0 - t, t]) }
    });
    // The sheet lies on the wall; of the plate only what is over bare skin is within reach.
    let plate = relief(|y, _| if y > 0.0 { 0.05 } else { 0.4 }, 1, 0.8, 2).mapped(|p| p + DVec3::Y * 1.0);
    assert!(plate.positions.iter().any(|p| p[0] == 0.05 && p[1] > 1.3) && plate.positions.iter().any(|p| p[1] < 1.1));
    let both = wall(0.02, 1, 1.0, 4).mapped(|p| p - DVec3::Y).joined(plate);
    let settings = Settings {
        method: MatchMethod::Confidence,
        small_islands: SmallIslands::Solved,
        max_distance: Length::Absolute(0.1),
        max_normal_angle: PI,
        ..Settings::default()
    };
    let result = transfer_weights(&body, target(&both), None, &settings).unwrap();
    assert!(result.confidence[25..].iter().all(|&confidence| confidence == 0.0), "{:?}", &result.confidence[25..]);
    assert_eq!(result.report.unmatched_islands.len(), 1);
}

#[test]
fn what_has_no_row_is_filled_in_by_the_papers_energy_beside_what_the_mask_forbids() {
    let body = source(&[wall(0.0, 1, 4.0, 16)], 2, |_, [_, y, _]| {
        let t = (0.2 * y * y + 0.2).clamp(0.0, 1.0);
        if y > 1.1 { (vec![], vec![]) } else { (vec![0, 1], vec![1.0 - t, t]) }
    });
    let sheet = wall(0.2, 1, 1.6, 8).mapped(|p| p + DVec3::Y * 0.8);
    let settings = Settings {
        method: MatchMethod::Confidence,
        small_islands: SmallIslands::Solved,
        max_distance: Length::Absolute(1.0),
        smoothness_length: Length::Absolute(0.3),
        ..Settings::default()
    };
    let mut mask = vec![MaskValue::Automatic; 81];
    mask[12] = MaskValue::Inpaint;
    let result = transfer_weights(&body, target(&sheet), Some(&mask), &settings).unwrap();
    // Above y = 1.25 the wall has no weights.
    let is_known = |i: usize| i != 12 && sheet.positions[i][1] < 1.24;
    let own = |i: usize| [0, 1].map(|bone| f64::from(dense(&result.weights, i)[bone]));
    let fixed: Vec<_> = (0..81).filter(|&i| is_known(i)).map(|i| (i, own(i))).collect();
    assert!(fixed.len() < 70 && (0..81).all(|i| is_known(i) == (result.confidence[i] > 0.0)));
    let (stiffness, masses) = stiffness_and_masses(&sheet);
    let expected = minimiser(&energy(&stiffness, &masses, 0.3), &[], &fixed);
    for (i, expected) in expected.iter().enumerate() {
        assert!((own(i)[1] - expected[1]).abs() < 1e-5, "{i}: {:?} is not {expected:?}", own(i));
    }
}

#[test]
fn rows_of_the_source_that_do_not_sum_to_one_are_counted() {
    let sums = [1.0, 1.0009, 0.9991, 1.002, 0.998, 2.0, 0.25, 0.0, 0.0];
    let mut at = 0;
    let body = source(&[wall(0.0, 1, 4.0, 2)], 1, |_, _| {
        at += 1;
        (vec![0], vec![sums[at - 1]])
    });
    let result = transfer_weights(&body, target(&wall(0.01, 1, 1.0, 2)), None, &Settings::default()).unwrap();
    assert_eq!((result.report.source_unweighted, result.report.source_unnormalised), (2, 4));
}

#[test]
fn a_source_without_area_is_as_large_as_its_bounding_box() {
    let line = Fixture::new("line", vec![[0.0; 3], [1.0, 2.0, 2.0], [2.0, 4.0, 4.0]], vec![[0, 1, 2]]);
    assert!((source(&[line], 1, |_, _| (vec![0], vec![1.0])).size() - 6.0).abs() < 1e-6);
}

#[test]
fn vertices_of_the_source_are_one_within_a_millionth_of_its_diagonal() {
    // Two quads that meet at a right angle at the z axis, one of them moved away by a share of the diagonal.
    for scale in [1.0, 1000.0] {
        let first = wall(0.0, 1, 2.0, 1).mapped(|p| p + DVec3::Y);
        let second = first.mapped(|p| DVec3::new(-p.y, p.x, p.z));
        let diagonal = scale * 12f64.sqrt();
        for (share, is_one) in [(5e-7, true), (2e-6, false)] {
            let moved = second.mapped(|p| p * scale - DVec3::X * share * diagonal);
            let both = [first.mapped(|p| p * scale), moved];
            let body = source(&both, 1, |_, _| (vec![0], vec![1.0]));
            let positions = both.iter().flat_map(|part| &part.positions);
            for (normal, _) in std::iter::zip(body.normals(), positions)
                .filter(|(_, p)| f64::from(p[1]) < 0.1 && f64::from(p[0]) > -0.1)
            {
                assert_eq!(normal.abs().max_element() < 0.9, is_one, "{scale}, {share}: {normal}");
            }
        }
    }
}

#[test]
fn settings_out_of_range_are_refused_by_name() {
    let refused = |settings: Settings| match settings.check() {
        Err(Error::InvalidParameter { name, .. }) => name,
        other => panic!("{other:?}"),
    };
    let base = Settings::default;
    assert!(base().check().is_ok());
    for bad in [-0.1, f64::NAN, f64::INFINITY] {
        for length in [Length::Absolute(bad), Length::Relative(bad)] {
            assert_eq!(refused(Settings { max_distance: length, ..base() }), "max_distance");
            assert_eq!(refused(Settings { weld_tolerance: length, ..base() }), "weld_tolerance");
            assert_eq!(refused(Settings { smoothness_length: length, ..base() }), "smoothness_length");
        }
        assert_eq!(refused(Settings { softness: bad, ..base() }), "softness");
        assert_eq!(refused(Settings { max_normal_angle: bad, ..base() }), "max_normal_angle");
        assert_eq!(refused(Settings { smoothing_factor: bad, ..base() }), "smoothing_factor");
    }
    assert_eq!(refused(Settings { softness: 0.0, ..base() }), "softness");
    assert_eq!(refused(Settings { smoothing_factor: 1.01, ..base() }), "smoothing_factor");
    let zero = Length::Absolute(0.0);
    let least = Settings { max_distance: zero, weld_tolerance: zero, smoothness_length: zero, ..base() };
    assert!(Settings { max_normal_angle: 0.0, smoothing_factor: 1.0, ..least }.check().is_ok());
}

#[test]
fn every_stage_books_its_seconds() {
    let result = transfer_weights(&shaft(1.0), target(&level(0.3)), None, &any_angle()).unwrap();
    let stages: Vec<_> = result.report.seconds.iter().map(|&(stage, _)| stage).collect();
    let preparation = ["laplacian", "match"];
    let solve = ["assemble", "factor", "solve", "inpaint", "smooth", "islands and limit"];
    assert_eq!(stages, [&preparation[..], &solve].concat());
    assert!(result.report.seconds.iter().all(|&(_, seconds)| seconds >= 0.0));
}
