//! Invariants of the transfer over ordinary and degenerate meshes.

mod common;

use common::{Fixture, Row, body, button, degenerate, rigid_motion, skirt};
use skinwright_core::transfer::{
    Inpainting, IslandPolicy, Length, MaskValue, MatchMethod, Settings, SmallIslands, Source, TargetMesh, Transfer,
    transfer_weights,
};
use skinwright_core::{Error, Progress, Weights};

fn weights_of(rows: &[Row], n_bones: u32) -> Weights {
    let mut indptr = vec![0];
    for (bones, _) in rows {
        indptr.push(indptr[indptr.len() - 1] + bones.len() as u32);
    }
    let (bones, values) = rows.iter().cloned().unzip::<_, _, Vec<_>, Vec<_>>();
    Weights::new(indptr, bones.concat(), values.concat(), n_bones).unwrap()
}

fn source_of(fixture: &Fixture, rows: &[Row]) -> Source {
    Source::new(&fixture.positions, fixture.triangles.clone(), weights_of(rows, 4)).unwrap()
}

fn source() -> Source {
    let (fixture, rows) = body();
    source_of(&fixture, &rows)
}

fn transfer(source: &Source, target: &Fixture, settings: &Settings) -> Transfer {
    transfer_masked(source, target, None, settings)
}

fn transfer_masked(source: &Source, target: &Fixture, mask: Option<&[MaskValue]>, settings: &Settings) -> Transfer {
    transfer_weights(source, target_mesh(target), mask, settings).unwrap_or_else(|e| panic!("{}: {e}", target.name))
}

fn target_mesh(fixture: &Fixture) -> TargetMesh {
    TargetMesh { positions: fixture.positions.clone(), triangles: fixture.triangles.clone(), edges: Vec::new() }
}

fn dense(weights: &Weights) -> Vec<Vec<f32>> {
    let row = |i| {
        let mut row = vec![0.0; weights.n_bones() as usize];
        let (bones, values) = weights.row(i);
        for (&bone, &value) in std::iter::zip(bones, values) {
            row[bone as usize] += value;
        }
        row
    };
    (0..weights.vertex_count()).map(row).collect()
}

fn largest_difference(a: &Weights, b: &Weights) -> f32 {
    let (a, b) = (dense(a).concat(), dense(b).concat());
    assert_eq!(a.len(), b.len());
    std::iter::zip(a, b).map(|(x, y)| (x - y).abs()).fold(0.0, f32::max)
}

#[test]
fn every_degenerate_mesh_gets_proper_rows_under_every_policy() {
    let source = source();
    for target in degenerate() {
        for island_policy in IslandPolicy::ALL {
            let energies = [Length::Relative(0.05), Length::Absolute(0.0)].map(|l| (MatchMethod::ClosestPoint, l));
            for (method, smoothness_length) in energies.into_iter().chain([(MatchMethod::Confidence, energies[0].1)]) {
                let small_islands = SmallIslands::Rigid;
                let smoothing_iterations = 2;
                let settings = Settings {
                    method,
                    island_policy,
                    small_islands,
                    smoothness_length,
                    smoothing_iterations,
                    ..Settings::default()
                };
                let result = transfer(&source, &target, &settings);
                assert_eq!(result.weights.vertex_count(), target.positions.len());
                for i in 0..target.positions.len() {
                    let (bones, values) = result.weights.row(i);
                    let skipped = island_policy == IslandPolicy::Skip && values.is_empty();
                    let sum: f32 = values.iter().sum();
                    assert!(skipped || (sum - 1.0).abs() < 1e-6, "{}: row {i} sums to {sum}", target.name);
                    assert!(values.iter().all(|&x| x > 0.0 && x <= 1.0), "{}: row {i} is {values:?}", target.name);
                    assert!(bones.is_sorted(), "{}: row {i}", target.name);
                }
                let most = if method == MatchMethod::Confidence { 1e-5 } else { 1e-12 };
                assert!(result.report.largest_residual < most, "{}: {:?}", target.name, result.report);
            }
        }
    }
}

#[test]
fn a_mesh_onto_itself_is_the_identity() {
    let (fixture, rows) = body();
    let result = transfer(&source(), &fixture, &Settings { max_normal_angle: 0.0, ..Settings::default() });
    assert_eq!(result.report.matched, fixture.positions.len());
    assert!(largest_difference(&result.weights, &weights_of(&rows, 4)) < 1e-6);
}

#[test]
fn rigid_motion_scale_and_vertex_order_change_nothing() {
    let (body, rows) = body();
    let target = skirt();
    let settings = Settings { smoothing_iterations: 3, ..Settings::default() };
    let expected = transfer(&source(), &target, &settings);
    assert!(expected.report.inpainted > 100);

    // A box around a turned mesh is another box: only absolute lengths can be invariant.
    let absolute = Settings {
        max_distance: Length::Absolute(expected.report.max_distance),
        smoothness_length: Length::Absolute(expected.report.smoothness_length),
        ..settings.clone()
    };
    let moved = transfer(&source_of(&body.mapped(rigid_motion), &rows), &target.mapped(rigid_motion), &absolute);
    assert!(largest_difference(&expected.weights, &moved.weights) < 1e-5);
    for scale in [0.01, 100.0] {
        let scaled = transfer(&source_of(&body.mapped(|p| p * scale), &rows), &target.mapped(|p| p * scale), &settings);
        assert!(largest_difference(&expected.weights, &scaled.weights) < 1e-5, "scale {scale}");
    }

    let count = target.positions.len();
    let place = |i: usize| (i * 7 + 3) % count;
    assert_ne!(count % 7, 0);
    let mut permuted = target.clone();
    (0..count).for_each(|i| permuted.positions[place(i)] = target.positions[i]);
    permuted.triangles = target.triangles.iter().rev().map(|t| t.map(|i| place(i as usize) as u32)).collect();
    let result = dense(&transfer(&source(), &permuted, &settings).weights);
    for (i, row) in dense(&expected.weights).iter().enumerate() {
        let differs = std::iter::zip(row, &result[place(i)]).any(|(x, y)| (x - y).abs() > 1e-5);
        assert!(!differs, "vertex {i}: {row:?} is {:?} after the permutation", result[place(i)]);
    }
}

#[test]
fn the_bits_do_not_depend_on_the_number_of_threads() {
    let source = source();
    let settings = Settings { smoothing_iterations: 3, max_influences: 3, ..Settings::default() };
    let target = common::tube(60, 200).mapped(|p| p * if p.z > 2.0 { 1.4 } else { 1.02 });
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| transfer(&source, &target, &settings).weights)
    };
    let one = on(1);
    assert!(one == on(2) && one == on(5));
}

#[test]
fn matched_rows_are_copies_and_inpainting_has_no_scale_of_its_own() {
    let (fixture, rows) = body();
    let target = fixture.mapped(|p| p * 1.001).named("tight");
    let mask: Vec<_> = (0..target.positions.len())
        .map(|i| if i % 24 < 12 && i > 300 { MaskValue::Inpaint } else { MaskValue::Automatic })
        .collect();
    let result = transfer_masked(&source(), &target, Some(&mask), &Settings::default());
    let expected = dense(&weights_of(&rows, 4));
    for (i, row) in dense(&result.weights).iter().enumerate().filter(|&(i, _)| mask[i] == MaskValue::Automatic) {
        let near = std::iter::zip(row, &expected[i]).all(|(x, y)| (x - y).abs() < 0.02);
        assert!(result.matched[i] && near, "vertex {i}: {row:?}");
    }
    assert!(mask.iter().zip(&result.matched).all(|(m, matched)| (*m == MaskValue::Automatic) == *matched));
}

#[test]
fn the_mask_forces_and_forbids_matches() {
    let target = skirt();
    let automatic = transfer(&source(), &target, &Settings::default());
    let far = automatic.matched.iter().position(|&m| !m).unwrap();
    let near = automatic.matched.iter().position(|&m| m).unwrap();
    let mut mask = vec![MaskValue::Automatic; target.positions.len()];
    (mask[far], mask[near]) = (MaskValue::ForceMatch, MaskValue::Inpaint);
    let result = transfer_masked(&source(), &target, Some(&mask), &Settings::default());
    let mut expected = automatic.matched;
    (expected[far], expected[near]) = (true, false);
    assert_eq!(result.matched, expected);
}

#[test]
fn a_buckle_on_a_belt_on_the_skirt_follows_the_belt() {
    // The belt hangs on the skirt at z = 3.6 (bones 2 and 3), the buckle on the belt; the body is nearer to neither.
    let target = skirt().joined(button([2.4, 0.0, 3.6], 0.1)).joined(button([2.7, 0.0, 3.6], 0.1));
    let first_belt = target.positions.len() - 14;
    let settings = Settings { max_distance: Length::Absolute(0.1), ..Settings::default() };
    let result = transfer(&source(), &target, &settings);
    let islands = &result.report.unmatched_islands;
    assert_eq!(islands.iter().map(|island| island.vertices).collect::<Vec<_>>(), [7, 7]);
    let rows = dense(&result.weights);
    for i in first_belt..target.positions.len() {
        assert_eq!(rows[i], rows[first_belt], "vertex {i} is rigid with the belt");
    }
}

#[test]
fn policies_differ_as_they_say() {
    let target = skirt().joined(button([1.45, 0.0, 2.2], 0.2).mapped(|p| p));
    let first = target.positions.len() - 7;
    let with = |island_policy| {
        let settings = Settings { island_policy, max_distance: Length::Absolute(0.05), ..Settings::default() };
        dense(&transfer(&source(), &target, &settings).weights)[first..].to_vec()
    };
    let all_equal = |rows: &[Vec<f32>]| rows.iter().all(|row| *row == rows[0]);
    assert!(all_equal(&with(IslandPolicy::Bridge)) && all_equal(&with(IslandPolicy::Rigid)));
    assert!(!all_equal(&with(IslandPolicy::Nearest)) || with(IslandPolicy::Nearest)[0] == with(IslandPolicy::Rigid)[0]);
    assert!(with(IslandPolicy::Skip).iter().flatten().all(|&x| x == 0.0));
}

#[test]
fn the_limit_keeps_the_largest_and_renormalises() {
    let settings = Settings { max_influences: 2, smoothing_iterations: 5, ..Settings::default() };
    let free = transfer(&source(), &skirt(), &Settings { max_influences: 0, ..settings.clone() }).weights;
    let limited = transfer(&source(), &skirt(), &settings).weights;
    assert!((0..free.vertex_count()).any(|i| free.row(i).0.len() > 2));
    for i in 0..free.vertex_count() {
        let mut expected: Vec<_> = std::iter::zip(free.row(i).0, free.row(i).1).collect();
        expected.sort_by(|x, y| y.1.total_cmp(x.1).then(x.0.cmp(y.0)));
        expected.truncate(2);
        let sum: f32 = expected.iter().map(|(_, value)| **value).sum();
        let (bones, values) = limited.row(i);
        for (bone, value) in expected {
            let at = bones.iter().position(|x| x == bone).unwrap();
            assert!((values[at] - value / sum).abs() < 1e-6, "vertex {i}");
        }
        assert!((values.iter().sum::<f32>() - 1.0).abs() < 1e-6);
    }
}

#[test]
fn kept_factorisations_give_the_same_answer_as_fresh_ones() {
    let target = skirt();
    let progress = Progress::default();
    let mut kept = Inpainting::new(source(), target_mesh(&target), &Settings::default(), &progress).unwrap();
    let base = Settings { max_distance: Length::Absolute(0.15), ..Settings::default() };
    assert!(kept.solve(None, &base, &progress).unwrap().report.factored_blocks > 0);
    let smoothed = Settings { smoothing_iterations: 2, max_influences: 2, ..base.clone() };
    let again = kept.solve(None, &smoothed, &progress).unwrap();
    assert_eq!(again.report.factored_blocks, 0);
    assert_eq!(again.weights, transfer(&source(), &target, &smoothed).weights);

    let mut mask = vec![MaskValue::Automatic; target.positions.len()];
    mask[100] = MaskValue::Inpaint;
    let painted = kept.solve(Some(&mask), &base, &progress).unwrap();
    assert!(painted.report.blocks > 1, "{:?}", painted.report);
    assert_eq!(painted.report.factored_blocks, 1);
    assert_eq!(painted.weights, transfer_masked(&source(), &target, Some(&mask), &base).weights);

    let (_, rows) = body();
    let reversed: Vec<_> = rows
        .into_iter()
        .map(|(bones, values)| (bones.iter().map(|j| 3 - j).rev().collect(), values.into_iter().rev().collect()))
        .collect();
    kept.set_source_weights(weights_of(&reversed, 4)).unwrap();
    let other = kept.solve(Some(&mask), &base, &progress).unwrap();
    assert_eq!(other.report.factored_blocks, 0);
    let mirrored: Vec<Vec<f32>> =
        dense(&painted.weights).into_iter().map(|row| row.into_iter().rev().collect()).collect();
    for (x, y) in std::iter::zip(dense(&other.weights).concat(), mirrored.concat()) {
        assert!((x - y).abs() < 1e-5);
    }
}

#[test]
fn what_cannot_be_answered_is_a_typed_error() {
    let (fixture, rows) = body();
    let far = skirt().mapped(|p| p + glam::DVec3::X * 50.0);
    let run = |target: &Fixture, settings: &Settings| {
        transfer_weights(&source(), target_mesh(target), None, settings).map(|_| ())
    };
    let Err(Error::NothingMatched { needed: Some(needed), .. }) = run(&far, &Settings::default()) else {
        panic!("matched at a distance of 50")
    };
    let enough = Settings { max_distance: Length::Absolute(needed), ..Settings::default() };
    assert_eq!(run(&far, &enough), Ok(()));

    let mut broken = skirt();
    broken.positions[7][1] = f32::NAN;
    assert_eq!(run(&broken, &Settings::default()), Err(Error::PositionNotFinite { what: "target", vertex: 7 }));
    broken = skirt();
    broken.triangles[3][2] = 99_999;
    let out_of_range =
        Error::VertexOutOfRange { what: "target", triangle: 3, vertex: 99_999, count: broken.positions.len() };
    assert_eq!(run(&broken, &Settings::default()), Err(out_of_range));
    broken.triangles.clear();
    assert_eq!(run(&broken, &Settings::default()), Err(Error::NoTriangles { what: "target" }));

    let nan = Weights::new(vec![0, 1, 2], vec![0, 3], vec![1.0, f32::NAN], 4);
    assert_eq!(nan, Err(Error::WeightNotFinite { vertex: 1, bone: 3 }));
    let mut negative = rows.clone();
    negative[5].1[0] = -0.1;
    let refused = Source::new(&fixture.positions, fixture.triangles.clone(), weights_of(&negative, 4));
    assert!(matches!(refused, Err(Error::WeightNegative { vertex: 5, .. })));
    let bad = Settings { smoothing_factor: 1.5, ..Settings::default() };
    assert!(matches!(run(&skirt(), &bad), Err(Error::InvalidParameter { name: "smoothing_factor", .. })));
}

#[test]
fn a_cancelled_solve_gives_nothing_and_the_next_one_is_whole() {
    let target = skirt();
    let cancelled = Progress::default();
    cancelled.cancel();
    let fresh = Progress::default();
    let settings = Settings::default();
    assert!(Inpainting::new(source(), target_mesh(&target), &settings, &cancelled).is_err());
    let mut kept = Inpainting::new(source(), target_mesh(&target), &settings, &fresh).unwrap();
    assert_eq!(kept.solve(None, &settings, &cancelled).unwrap_err(), Error::Cancelled);
    assert_eq!(kept.solve(None, &settings, &fresh).unwrap().weights, transfer(&source(), &target, &settings).weights);
}

#[test]
fn source_rows_are_normalised_and_empty_ones_do_not_match() {
    let (fixture, mut rows) = body();
    let (scaled, unscaled) = (rows.clone(), source());
    rows.iter_mut().enumerate().for_each(|(i, (_, values))| values.iter_mut().for_each(|x| *x *= 1.0 + i as f32));
    let result = transfer(&source_of(&fixture, &rows), &skirt(), &Settings::default());
    assert!(result.report.source_unnormalised > 700);
    assert!(largest_difference(&result.weights, &transfer(&unscaled, &skirt(), &Settings::default()).weights) < 1e-6);

    let mut bare = scaled;
    bare.iter_mut().take(240).for_each(|(bones, values)| (bones.clear(), values.clear()).0);
    let result = transfer(&source_of(&fixture, &bare), &fixture, &Settings::default());
    assert_eq!(result.report.source_unweighted, 240);
    assert!(result.matched.iter().take(240).all(|&m| !m) && result.matched.iter().skip(240).all(|&m| m));
    assert_eq!(result.report.unweighted, 0);
}

#[test]
fn three_hundred_bones() {
    let (fixture, _) = body();
    let row = |p: &[f32; 3]| {
        let bone = (((4.0 - p[2]) / 4.0 * 299.0) as u32).min(298);
        (vec![bone, bone + 1], vec![0.5, 0.5])
    };
    let rows: Vec<_> = fixture.positions.iter().map(row).collect();
    let source = Source::new(&fixture.positions, fixture.triangles.clone(), weights_of(&rows, 300)).unwrap();
    let result = transfer(&source, &skirt(), &Settings::default());
    assert!(result.weights.bones().iter().any(|&bone| bone > 256));
    assert!(
        (0..result.weights.vertex_count()).all(|i| (result.weights.row(i).1.iter().sum::<f32>() - 1.0).abs() < 1e-6)
    );
}
