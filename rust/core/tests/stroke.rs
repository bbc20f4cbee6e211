//! Strokes of the mask on a large garment: what is solved near them, and that nothing of it remains.

#[allow(dead_code)]
mod common;

use common::{Fixture, body, tube};
use glam::DVec3;
use skinwright_core::transfer::{Inpainting, MaskValue, MatchMethod, Settings, Source, TargetMesh, Transfer};
use skinwright_core::{Progress, Weights};

/// A tube of 48,620 vertices around the body, close at one end and far out at the other.
fn large() -> Fixture {
    let flare = |p: DVec3| {
        let out = 1.03 + 0.3 * (p.z - 2.0).max(0.0);
        DVec3::new(p.x * out, p.y * out, p.z)
    };
    tube(220, 220).mapped(flare)
}

fn prepared(target: &Fixture, settings: &Settings) -> Inpainting {
    let (body, rows) = body();
    let (bones, values): (Vec<_>, Vec<_>) = rows.into_iter().unzip();
    let weights = Weights::new((0..=bones.len() as u32).map(|i| 2 * i).collect(), bones.concat(), values.concat(), 4);
    let source = Source::new(&body.positions, body.triangles, weights.unwrap()).unwrap();
    let target = TargetMesh { positions: target.positions.clone(), triangles: target.triangles.clone(), edges: vec![] };
    Inpainting::new(source, target, settings, &Progress::default()).unwrap()
}

fn confidence() -> Settings {
    Settings { method: MatchMethod::Confidence, ..Settings::default() }
}

/// A mask that is automatic but for the vertices within `radius` of a height on one side.
fn stroke(target: &Fixture, height: f32, radius: f32, value: MaskValue) -> Vec<MaskValue> {
    let centre = glam::Vec3::new(1.0, 0.0, height);
    let is_in = |p: &[f32; 3]| glam::Vec3::from(*p).distance(centre) < radius;
    target.positions.iter().map(|p| if is_in(p) { value } else { MaskValue::Automatic }).collect()
}

fn near(prepared: &mut Inpainting, mask: Option<&[MaskValue]>) -> Transfer {
    prepared.solve_near(mask, &confidence(), &Progress::default()).unwrap()
}

fn whole(prepared: &mut Inpainting, mask: Option<&[MaskValue]>) -> Transfer {
    prepared.solve(mask, &confidence(), &Progress::default()).unwrap()
}

/// Largest difference of any weight, for each vertex.
fn differences(a: &Weights, b: &Weights) -> Vec<f32> {
    let dense = |weights: &Weights, i: usize| {
        let mut row = [0.0; 4];
        std::iter::zip(weights.row(i).0, weights.row(i).1).for_each(|(&bone, &value)| row[bone as usize] = value);
        row
    };
    let largest = |i: usize| std::iter::zip(dense(a, i), dense(b, i)).fold(0.0, |d: f32, (x, y)| d.max((x - y).abs()));
    (0..a.vertex_count()).map(largest).collect()
}

fn largest(differences: &[f32]) -> f32 {
    differences.iter().copied().fold(0.0, f32::max)
}

#[test]
fn what_is_solved_near_a_stroke_is_nearly_the_whole() {
    let target = large();
    let mut prepared = prepared(&target, &confidence());
    let before = near(&mut prepared, None);
    assert_eq!(before.report.solved_near, None);
    for value in [MaskValue::Inpaint, MaskValue::ForceMatch] {
        let mask = stroke(&target, 2.4, 0.25, value);
        let soon = near(&mut prepared, Some(&mask));
        let count = soon.report.solved_near.expect("a stroke is small");
        assert!((1_000..=15_000).contains(&count), "{count}");
        let mut other = self::prepared(&target, &confidence());
        let exact = whole(&mut other, Some(&mask));
        let changed = differences(&before.weights, &exact.weights);
        assert!(largest(&changed) > 0.01, "the stroke changes nothing: {}", largest(&changed));
        let error = differences(&soon.weights, &exact.weights);
        assert!(largest(&error) < 2e-3, "{value:?}: {}", largest(&error));
        let in_stroke = std::iter::zip(&mask, &error).filter(|(mask, _)| **mask == value).map(|(_, &error)| error);
        assert!(largest(&in_stroke.collect::<Vec<_>>()) < 1e-4);
        assert_eq!(soon.matched, exact.matched);
        // Undone, it leaves nothing behind.
        let undone = near(&mut prepared, None);
        assert!(largest(&differences(&before.weights, &undone.weights)) < 1e-5);
    }
}

#[test]
fn strokes_before_do_not_show_in_the_whole() {
    let target = large();
    let mut painted = prepared(&target, &confidence());
    near(&mut painted, None);
    for height in [1.0, 2.0, 3.0] {
        near(&mut painted, Some(&stroke(&target, height, 0.2, MaskValue::Inpaint)));
    }
    let mask = stroke(&target, 3.0, 0.2, MaskValue::Inpaint);
    let after = whole(&mut painted, Some(&mask));
    assert_eq!(after.report.solved_near, None);
    assert_eq!(after.weights, whole(&mut prepared(&target, &confidence()), Some(&mask)).weights);
}

#[test]
fn the_neighbourhood_has_the_same_bits_on_any_number_of_threads() {
    let target = large();
    let mask = stroke(&target, 2.0, 0.2, MaskValue::Inpaint);
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut prepared = prepared(&target, &confidence());
            near(&mut prepared, None);
            near(&mut prepared, Some(&mask))
        })
    };
    let (one, three) = (on(1), on(3));
    assert!(one.report.solved_near.is_some());
    assert_eq!(one.weights, three.weights);
}

#[test]
fn what_cannot_be_solved_near_is_solved_as_a_whole() {
    let target = large();
    let mask = stroke(&target, 2.0, 0.2, MaskValue::Inpaint);
    let mut prepared = prepared(&target, &confidence());
    near(&mut prepared, None);
    let softer = Settings { softness: 1.0, ..confidence() };
    let changed = prepared.solve_near(Some(&mask), &softer, &Progress::default()).unwrap();
    assert_eq!(changed.report.solved_near, None);
    let many = stroke(&target, 2.0, 2.0, MaskValue::Inpaint);
    let large = prepared.solve_near(Some(&many), &softer, &Progress::default()).unwrap();
    assert_eq!(large.report.solved_near, None);
    let paper = prepared.solve_near(Some(&mask), &Settings::default(), &Progress::default()).unwrap();
    assert_eq!(paper.report.solved_near, None);
}

#[test]
fn a_solve_is_kept_of_large_meshes_with_confidences_and_without_smoothing() {
    let keeps = |target: &Fixture, settings: Settings| {
        let mut prepared = prepared(target, &settings);
        assert!(!prepared.has_base());
        prepared.solve(None, &settings, &Progress::default()).unwrap();
        assert!(!prepared.has_base(), "nobody has asked for strokes");
        prepared.solve_near(None, &settings, &Progress::default()).unwrap();
        prepared.has_base()
    };
    assert!(keeps(&large(), confidence()));
    assert!(!keeps(&common::skirt(), confidence()), "it is solved as fast as a whole");
    assert!(!keeps(&large(), Settings::default()));
    assert!(!keeps(&large(), Settings { smoothing_iterations: 1, ..confidence() }));
}
