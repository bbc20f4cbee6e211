//! What a stroke of the mask solves again, on ribbons before a wall, where every length is known in closed form.

use crate::common::Fixture;
use crate::walls::{dense, source, target, wall};
use skinwright_core::Progress;
use skinwright_core::transfer::{Inpainting, Length, MaskValue, MatchMethod, Settings, SmallIslands, Source, Transfer};

/// Vertices across a ribbon, and the distance between neighbours along and across it.
const ACROSS: usize = 30;
const STEP: f64 = 2e-3;

/// The body's size: 4.2 times the root mean square distance from the centre of a square of side 4.
fn size() -> f64 {
    4.2 * 4.0 / 6f64.sqrt()
}

/// A wall at x = 0 whose weights wander from bone to bone along y; above `bare` it has none.
fn body(bare: f32) -> Source {
    source(&[wall(0.0, 1, 4.0, 64)], 6, |_, [_, y, _]| {
        let s = (3.0 * (y + 2.0)).rem_euclid(6.0);
        let (bone, t) = (s as u32 % 6, s.fract());
        if y > bare { (vec![], vec![]) } else { (vec![bone, (bone + 1) % 6], vec![1.0 - t, t]) }
    })
}

/// A ribbon along y from -1.9 of so many rows, at the distance `gap` of the row's number from the wall.
fn ribbon(rows: usize, gap: impl Fn(usize) -> f64) -> Fixture {
    let position = |k: usize| {
        let (row, at) = (k / ACROSS, k % ACROSS);
        [gap(row), STEP * row as f64 - 1.9, STEP * at as f64 - 0.03].map(|x| x as f32)
    };
    let quad = |k: usize| {
        let a = (k / (ACROSS - 1) * ACROSS + k % (ACROSS - 1)) as u32;
        let n = ACROSS as u32;
        [[a, a + n, a + n + 1], [a, a + n + 1, a + 1]]
    };
    let positions = (0..rows * ACROSS).map(position).collect();
    Fixture::new("ribbon", positions, (0..(rows - 1) * (ACROSS - 1)).flat_map(quad).collect())
}

fn settings() -> Settings {
    Settings {
        method: MatchMethod::Confidence,
        small_islands: SmallIslands::Solved,
        max_distance: Length::Absolute(1.0),
        ..Settings::default()
    }
}

fn prepared(source: Source, ribbon: &Fixture) -> Inpainting {
    Inpainting::new(source, target(ribbon), &settings(), &Progress::default()).unwrap()
}

fn near(prepared: &mut Inpainting, mask: &[MaskValue]) -> Transfer {
    prepared.solve_near(Some(mask), &settings(), &Progress::default()).unwrap()
}

/// A mask that is automatic but for whole rows.
fn strokes(count: usize, strokes: &[(std::ops::Range<usize>, MaskValue)]) -> Vec<MaskValue> {
    let mut mask = vec![MaskValue::Automatic; count];
    strokes.iter().for_each(|(rows, value)| mask[rows.start * ACROSS..rows.end * ACROSS].fill(*value));
    mask
}

/// How far a stroke reaches, in lengths over which its change falls to a third.
const REACH: f64 = 8.0;

/// The inverse of such a length at a gap, and where nothing is known.
fn rate(gap: f64) -> f64 {
    let length = 0.7 * 0.93 * gap + (1e-3 * size()).min(gap / 2.0) + 1e-6 * size();
    (1.5f64.sqrt() / length).max(rate_of_unknown())
}

fn rate_of_unknown() -> f64 {
    1.0 / (0.1 * size())
}

/// How many rows are reached in one direction from a forced row, `rates` being those of the rows that follow it.
fn rows_reached(rates: impl Iterator<Item = f64>) -> usize {
    let mut so_far = (0.0, rate_of_unknown());
    rates
        .take_while(|&rate| {
            so_far = (so_far.0 + STEP * (so_far.1 + rate) / 2.0, rate);
            so_far.0 <= REACH
        })
        .count()
}

#[test]
fn a_stroke_reaches_eight_lengths_in_either_direction() {
    let ribbon = ribbon(1050, |_| 0.05);
    let count = ribbon.positions.len();
    let mut prepared = prepared(body(3.0), &ribbon);
    // What is inpainted already is not trusted at all, and a change goes a long way through it.
    let gap = (560..590, MaskValue::Inpaint);
    near(&mut prepared, &strokes(count, std::slice::from_ref(&gap)));
    let forced = strokes(count, &[gap, (500..501, MaskValue::ForceMatch)]);
    let soft = || std::iter::repeat(rate(0.05));
    let before = rows_reached(soft());
    let after = rows_reached(soft().take(59).chain(std::iter::repeat_n(rate_of_unknown(), 30)).chain(soft()));
    assert!(before > 100 && after > before + 20, "{before} {after}");
    assert_eq!(near(&mut prepared, &forced).report.solved_near, Some((before + 1 + after) * ACROSS));
}

#[test]
fn no_more_than_fifteen_thousand_vertices_are_solved_near_a_stroke() {
    let ribbon = ribbon(1050, |_| 0.5);
    let count = ribbon.positions.len();
    let mut prepared = prepared(body(3.0), &ribbon);
    near(&mut prepared, &strokes(count, &[]));
    let forced = strokes(count, &[(3..4, MaskValue::ForceMatch)]);
    assert_eq!(near(&mut prepared, &forced).report.solved_near, Some(15_000));
    // A third as many may have changed.
    for (changed, solved) in [(5000, Some(15_000)), (5001, None)] {
        let mut mask = strokes(count, &[]);
        mask[..changed].fill(MaskValue::Inpaint);
        assert_eq!(near(&mut prepared, &mask).report.solved_near, solved, "{changed}");
        near(&mut prepared, &strokes(count, &[]));
    }
}

fn largest_difference(a: &Transfer, b: &Transfer, i: usize) -> f32 {
    let pairs = std::iter::zip(dense(&a.weights, i), dense(&b.weights, i));
    pairs.map(|(x, y)| (x - y).abs()).fold(0.0, f32::max)
}

#[test]
fn the_neighbourhood_of_a_stroke_is_nearly_the_whole_and_the_rest_stays() {
    // From row 1040 on the ribbon lies on the skin, where rows are held.
    let ribbon = ribbon(1100, |row| if row < 1040 { 0.05 } else { 0.0 });
    let count = ribbon.positions.len();
    // What is solved near the stroke ends at row 856.
    assert_eq!(rows_reached(std::iter::repeat(rate(0.05))), 985 - 856);
    let gaps = [(1010..1016, MaskValue::Inpaint), (840..856, MaskValue::Inpaint), (300..310, MaskValue::Inpaint)];
    for stroke in [MaskValue::Inpaint, MaskValue::ForceMatch] {
        let mut kept = prepared(body(3.0), &ribbon);
        let before = near(&mut kept, &strokes(count, &gaps));
        let mask = strokes(count, &[&gaps[..], &[(985..995, stroke)]].concat());
        let soon = near(&mut kept, &mask);
        let solved = soon.report.solved_near.expect("a stroke is small");
        let exact = prepared(body(3.0), &ribbon).solve(Some(&mask), &settings(), &Progress::default()).unwrap();
        let (mut largest, mut untouched, mut worst) = (0.0f32, 0, 0.0f32);
        for i in 0..count {
            let (change, error) = (largest_difference(&before, &soon, i), largest_difference(&soon, &exact, i));
            // Inpainted rows are written in any case.
            assert!(change == 0.0 || change >= 1e-4 || mask[i] == MaskValue::Inpaint, "{i}: {change}");
            largest = largest.max(change);
            worst = worst.max(error);
            untouched += usize::from(before.weights.row(i) == soon.weights.row(i));
        }
        assert!(worst < 2e-4 && largest > 5e-3, "{stroke:?}: {worst} of {largest}");
        assert!(untouched > count - solved && untouched < count - 1000, "{untouched}");
        assert_eq!((soon.matched, soon.confidence), (exact.matched, exact.confidence));
    }
}

#[test]
fn a_mesh_with_vertices_that_lack_a_row_is_solved_as_a_whole() {
    let ribbon = ribbon(1050, |_| 0.05);
    let count = ribbon.positions.len();
    let forced = strokes(count, &[(500..501, MaskValue::ForceMatch)]);
    for (bare, is_near) in [(3.0, true), (0.15, false)] {
        let mut prepared = prepared(body(bare), &ribbon);
        near(&mut prepared, &strokes(count, &[]));
        assert_eq!(near(&mut prepared, &forced).report.solved_near.is_some(), is_near, "{bare}");
    }
}

/// A ribbon with a second one beside it, which is too far from the wall for the paper.
fn with_a_far_one() -> (Fixture, Settings) {
    let both = ribbon(1040, |_| 0.05).joined(ribbon(400, |_| 0.07).mapped(|p| p + glam::DVec3::Z));
    (both, Settings { max_distance: Length::Absolute(0.06), ..settings() })
}

#[test]
fn a_part_that_hangs_does_not_keep_the_rest_from_being_solved_near() {
    let (both, settings) = with_a_far_one();
    let count = both.positions.len();
    let progress = Progress::default();
    let mut prepared = Inpainting::new(body(3.0), target(&both), &settings, &progress).unwrap();
    let before = prepared.solve_near(None, &settings, &progress).unwrap();
    assert_eq!(before.report.unmatched_islands.len(), 1);
    for value in [MaskValue::ForceMatch, MaskValue::Inpaint] {
        let mask = strokes(count, &[(500..510, value)]);
        let soon = prepared.solve_near(Some(&mask), &settings, &progress).unwrap();
        assert!(soon.report.solved_near.is_some() && soon.report.unmatched_islands.len() == 1);
        let hung = 1040 * ACROSS..count;
        assert!(
            hung.clone().all(|i| soon.weights.row(i) == before.weights.row(i) && !soon.weights.row(i).0.is_empty())
        );
    }
}

#[test]
fn a_stroke_that_makes_a_part_reached_solves_all_of_it() {
    let (both, settings) = with_a_far_one();
    let (count, progress) = (both.positions.len(), Progress::default());
    let mut prepared = Inpainting::new(body(3.0), target(&both), &settings, &progress).unwrap();
    prepared.solve_near(None, &settings, &progress).unwrap();
    let mut mask = vec![MaskValue::Automatic; count];
    mask[1040 * ACROSS..1041 * ACROSS].fill(MaskValue::ForceMatch);
    // The mask has changed in one row, but constraints have in 400: too many to be solved near.
    let soon = prepared.solve_near(Some(&mask), &settings, &progress).unwrap();
    assert_eq!((soon.report.solved_near, soon.report.unmatched_islands.len()), (None, 0));
}

#[test]
fn what_lies_across_a_held_row_is_inpainted_again() {
    // The energy couples two-rings: what is inpainted on either side of row 450, which is held, depends on each other.
    let ribbon = ribbon(1050, |_| 0.05);
    let count = ribbon.positions.len();
    let held = [(450..451, MaskValue::ForceMatch), (451..460, MaskValue::Inpaint)];
    let mut kept = prepared(body(3.0), &ribbon);
    let before = near(&mut kept, &strokes(count, &held));
    let mask = strokes(count, &[&held[..], &[(430..450, MaskValue::Inpaint)]].concat());
    let soon = near(&mut kept, &mask);
    assert!(soon.report.solved_near.is_some());
    let exact = prepared(body(3.0), &ribbon).solve(Some(&mask), &settings(), &Progress::default()).unwrap();
    let largest = |a: &Transfer, b: &Transfer| {
        (451 * ACROSS..460 * ACROSS).map(|i| largest_difference(a, b, i)).fold(0.0, f32::max)
    };
    assert!(largest(&before, &exact) > 1e-3, "the stroke changes nothing there: {}", largest(&before, &exact));
    assert!(largest(&soon, &exact) < 2e-4, "{}", largest(&soon, &exact));
}

#[test]
fn a_solve_is_kept_for_strokes_from_thirty_thousand_unknowns_on() {
    let ribbon = ribbon(1001, |row| if row == 0 { 0.0 } else { 0.05 });
    let short = Length::Absolute(0.01);
    let paper = Settings { method: MatchMethod::ClosestPoint, max_distance: short, ..settings() };
    let smoothed = Settings { smoothing_iterations: 1, ..settings() };
    for (settings, held, keeps) in
        [(settings(), 30, true), (settings(), 31, false), (smoothed, 30, false), (paper, 30, false)]
    {
        let mut mask = strokes(30_030, &[]);
        mask[..held].fill(MaskValue::ForceMatch);
        let (mask, progress) = (Some(&mask[..]), Progress::default());
        let mut prepared = Inpainting::new(body(3.0), target(&ribbon), &settings, &progress).unwrap();
        let result = prepared.solve(mask, &settings, &progress).unwrap();
        assert_eq!(result.report.inpainted, 30_030 - held);
        assert!(!prepared.has_base(), "nobody has asked for strokes");
        prepared.solve_near(mask, &settings, &progress).unwrap();
        assert_eq!(prepared.has_base(), keeps, "{:?}, {held}", settings.method);
    }
}
