//! The method of confidences against its formulas, over bodies where closest points are known in closed form.

use crate::common::Fixture;
use crate::dense::{Screened, stiffness_and_masses};
use crate::walls::{dense, is_row, parts_with_bones, relief, source, target, wall};
use glam::{DVec2, DVec3, Vec3};
use skinwright_core::transfer::{
    Length, MaskValue, MatchMethod, Settings, SmallIslands, Source, TargetMesh, Transfer, transfer_weights,
};

const SOFTNESS: f64 = 0.7;

fn transfer(source: &Source, fixture: &Fixture, mask: Option<&[MaskValue]>) -> Transfer {
    let settings = Settings {
        method: MatchMethod::Confidence,
        softness: SOFTNESS,
        small_islands: SmallIslands::Solved,
        max_distance: Length::Absolute(2.0),
        ..Settings::default()
    };
    transfer_weights(source, target(fixture), mask, &settings).unwrap()
}

/// The length over which a row is trusted, from gap, cosine between the normals, and the body's size.
fn length(gap: f64, cosine: f64, size: f64) -> f64 {
    let tangent_squared = 1.0 / cosine.powi(2) - 1.0;
    SOFTNESS * gap * (0.93 + 2.8 * tangent_squared) + (1e-3 * size).min(gap / 2.0) + 1e-6 * size
}

/// How far such a row is trusted.
fn trusted(gap: f64, cosine: f64, size: f64) -> f64 {
    1.0 / (1.0 + (length(gap, cosine, size) / (0.02 * size)).powi(2))
}

#[test]
fn confidence_falls_with_gap_and_tilt() {
    let size = size_of_wall();
    let flat = source(&[wall(0.0, 1, 4.0, 16)], 2, |_, _| (vec![0], vec![1.0]));
    assert!((flat.size() - size).abs() < 1e-5);
    for (gap, slope) in [(0.01, 0.0), (0.2, 0.0), (0.05, 0.5), (0.1, 1.0), (0.2, 4.0), (0.001, 60.0)] {
        let plate = relief(|y, _| gap + slope * (y + 0.02), 1, 0.04, 2);
        let result = transfer(&flat, &plate, None);
        for (i, p) in plate.positions.iter().enumerate() {
            let cosine = (1.0 / f64::hypot(1.0, slope)).max(0.05);
            let expected = trusted(p[0].into(), cosine, size);
            assert!((f64::from(result.confidence[i]) - expected).abs() < 2e-4, "{gap} {slope}: {i}");
            assert_eq!(result.matched[i], result.confidence[i] >= 0.5);
        }
    }
}

/// The nearest point of the valley x = |y| / 2, and its gap.
fn on_valley(p: DVec3) -> (DVec3, f64) {
    let nearest = [-1.0, 1.0].map(|side| {
        let along = DVec2::new(0.5, side).normalize();
        let foot = along * along.dot(p.truncate()).max(0.0);
        (DVec3::new(foot.x, foot.y, p.z), foot.distance(p.truncate()))
    });
    if nearest[0].1 < nearest[1].1 { nearest[0] } else { nearest[1] }
}

/// The body's normal there: at the vertices of the crease it points along x, a quarter away it is the plane's.
fn normal_of_valley(p: DVec3) -> DVec3 {
    let plane = DVec3::new(1.0, -0.5 * p.y.signum(), 0.0).normalize();
    DVec3::X.lerp(plane, (p.y.abs() / 0.25).min(1.0)).normalize()
}

/// What is known of a vertex of the plate.
#[derive(Clone, Copy)]
struct Place {
    vertex: DVec3,
    point: DVec3,
    gap: f64,
    cosine: f64,
    weight: f64,
}

/// Share of the change of weight along an edge that is kept.
fn kept(here: Place, there: Place, size: f64) -> f64 {
    let length = here.vertex.distance(there.vertex);
    let stretch = here.point.distance(there.point) / length;
    let gap = here.gap.max(there.gap) / (0.05 * size);
    let cosine = here.cosine.min(there.cosine);
    let steepness = (here.weight - there.weight).abs() * size / length;
    let trust = 0.85 * cosine.powi(4) / ((1.0 + ((stretch - 1.0).max(0.0) / 0.5).powi(2)) * (1.0 + gap.powi(4)));
    trust / (1.0 + (steepness / 25.0).powi(2))
}

/// A plate over a valley, whose neighbours across the valley have points that lie farther apart than they do.
#[test]
fn a_plate_over_a_valley_gets_the_rows_of_the_four_solves() {
    for slope in [0.2, 0.6] {
        let weight = |p: DVec3| (slope * p.y + 0.5).clamp(0.0, 1.0);
        let valley = relief(|y, _| y.abs() / 2.0, 1, 4.0, 16);
        let source = source(&[valley], 2, |_, p| {
            let t = weight(Vec3::from(p).as_dvec3()) as f32;
            (vec![0, 1], vec![1.0 - t, t])
        });
        // Means of x^2, y^2 and z^2 about the centroid.
        let size = 4.2 * (1.0 / 12.0 + 4.0 / 3.0 + 4.0 / 3.0f64).sqrt();
        assert!((source.size() - size).abs() < 1e-5);
        let plate = relief(|_, z| 0.25 + 0.1 * z, 1, 1.2, 5);
        let normal = DVec3::new(1.0, 0.0, -0.1).normalize();
        let place = |p: &[f32; 3]| {
            let vertex = Vec3::from(*p).as_dvec3();
            let (point, gap) = on_valley(vertex);
            Place { vertex, point, gap, cosine: normal.dot(normal_of_valley(point)), weight: weight(point) }
        };
        let places: Vec<Place> = plate.positions.iter().map(place).collect();
        let (stiffness, masses) = stiffness_and_masses(&plate);
        let lengths: Vec<f64> = places.iter().map(|place| length(place.gap, place.cosine, size)).collect();
        // One is forced, and a row that is trusted over less than a quarter of the shortest edge is held.
        let is_fixed: Vec<bool> = std::iter::zip(0.., &lengths).map(|(i, &h)| i == 14 || h < 0.25 * 0.24).collect();
        let confidence = |i: usize| 1.5 * masses[i] / lengths[i].powi(2);
        let problem = Screened {
            confidence: (0..places.len()).map(|i| if is_fixed[i] { 0.0 } else { confidence(i) }).collect(),
            rows: places.iter().map(|place| Some(vec![1.0 - place.weight, place.weight])).collect(),
            stiffness,
            masses: masses.clone(),
            is_fixed: is_fixed.clone(),
        };
        let expected = problem.solved(|i, j| kept(places[i], places[j], size));
        let mut mask = vec![MaskValue::Automatic; places.len()];
        mask[14] = MaskValue::ForceMatch;
        let result = transfer(&source, &plate, Some(&mask));
        for (i, expected) in expected.iter().enumerate() {
            let found = dense(&result.weights, i);
            assert!((f64::from(found[1]) - expected[1]).abs() < 1e-4, "{slope}, {i}: {found:?} is not {expected:?}");
        }
    }
}

#[test]
fn a_card_in_the_middle_takes_both_sides_by_area() {
    // Each vertex is as near to the inside of a triangle of one wall as to that of one of the other, larger or equal.
    let corners = vec![[0.0, 0.1, 0.3], [0.0, 0.2, 0.45], [0.0, -0.3, 0.4]];
    let card = Fixture::new("card", corners, vec![[0, 1, 2], [0, 2, 1]]);
    for (n, area) in [(3, 8.0 / 9.0), (4, 0.5)] {
        let sides = parts_with_bones(&[wall(-1.0, 1, 4.0, 4), wall(1.0, -1, 4.0, n)]);
        let result = transfer(&sides, &card, None);
        let expected = [0.5, area].map(|share| share / (0.5 + area));
        assert!((0..3).all(|i| is_row(&result.weights, i, &expected)), "{n}: {:?}", dense(&result.weights, 0));
    }
}

/// 4.2 times the root mean square distance from the centre of a square of side 4.
fn size_of_wall() -> f64 {
    4.2 * 4.0 / 6f64.sqrt()
}

#[test]
fn on_a_ridge_the_direction_of_the_vertex_counts_if_it_agrees_best() {
    let flat = source(&[wall(0.0, 1, 4.0, 16)], 2, |_, _| (vec![0], vec![1.0]));
    let roof = relief(|y, _| 0.3 - 0.8 * y.abs(), 1, 0.4, 4);
    let result = transfer(&flat, &roof, None);
    for (i, &[x, y, z]) in roof.positions.iter().enumerate().filter(|(_, p)| p[2].abs() < 0.15) {
        let cosine = if y == 0.0 { 1.0 } else { 1.0 / f64::hypot(1.0, 0.8) };
        let expected = trusted(x.into(), cosine, size_of_wall());
        assert!(
            (f64::from(result.confidence[i]) - expected).abs() < 1e-5,
            "{y} {z}: {} {expected}",
            result.confidence[i]
        );
    }
}

#[test]
fn of_a_wire_only_the_gap_counts() {
    let flat = source(&[wall(0.0, 1, 4.0, 16)], 2, |_, _| (vec![0], vec![1.0]));
    // Over an edge, over a vertex, and over the inside of a triangle.
    let positions = vec![[0.1, 0.25, 0.1], [0.2, 0.25, 0.25], [0.15, 0.3, 0.11]];
    let wire = TargetMesh { positions: positions.clone(), triangles: Vec::new(), edges: vec![[0, 1], [1, 2]] };
    let settings = Settings { method: MatchMethod::Confidence, softness: SOFTNESS, ..Settings::default() };
    let result = transfer_weights(&flat, wire, None, &settings).unwrap();
    for (i, [x, _, _]) in positions.into_iter().enumerate() {
        let expected = trusted(x.into(), 1.0, size_of_wall());
        assert!((f64::from(result.confidence[i]) - expected).abs() < 1e-5, "{i}: {}", result.confidence[i]);
    }
}

#[test]
fn on_the_skin_a_slight_tilt_is_no_reason_to_look_further() {
    // The second wall is as tilted as the plate and lies a little behind the first. All heights are shares of
    // the body's size.
    for (scale, tilt, plate, second, bone) in [
        (1.0, 8e-4, 0.0, -2e-6, 0),
        (1.0, 1.3e-3, 0.0, -2e-6, 1),
        (0.01, 1.3e-3, 0.0, -2e-6, 1),
        (100.0, 8e-4, 0.0, -2e-6, 0),
        (1.0, 1.15e-3, 1e-5, -3e-6, 0),
        (1.0, 2e-3, 1e-5, -3e-6, 1),
    ] {
        let tilted = |height: f64, size: f64| relief(move |y, _| tilt * y + height * size_of_wall(), 1, size, 3);
        let walls = [wall(0.0, 1, 4.0, 3), tilted(second, 0.5)].map(|wall| wall.mapped(|p| p * scale));
        let result = transfer(&parts_with_bones(&walls), &tilted(plate, 0.001).mapped(|p| p * scale), None);
        let expected = [0, 1].map(|k| if k == bone { 1.0 } else { 0.0 });
        let is_expected = (0..16).all(|i| is_row(&result.weights, i, &expected));
        assert!(is_expected, "{scale}, {tilt}, {plate}: {:?}", dense(&result.weights, 0));
    }
}

#[test]
fn between_two_walls_the_mean_of_both_points_tells_how_the_skin_stretches() {
    let weight = |p: [f32; 3]| 0.5 + 0.2 * p[1];
    let walls = [wall(-0.1, 1, 4.0, 4), wall(0.1, -1, 4.0, 3)];
    let source = source(&walls, 4, |part, p| {
        let bone = 2 * part as u32;
        (vec![bone, bone + 1], vec![1.0 - weight(p), weight(p)])
    });
    let size = 4.2 * (0.01 + 16.0 / 6.0f64).sqrt();
    assert!((source.size() - size).abs() < 1e-5);
    let mut card = wall(0.0, 1, 0.3, 3).mapped(|p| p + DVec3::new(0.0, 0.21, 0.42));
    let (stiffness, masses) = stiffness_and_masses(&card);
    card.triangles.extend(card.triangles.clone().iter().map(|&[a, b, c]| [a, c, b]));
    // The walls' triangles differ; both points are as near and agree as well, so that they count by the areas of
    // their triangles.
    let shares = [0.5, 8.0 / 9.0].map(|area| area / (0.5 + 8.0 / 9.0));
    let row = |p: &[f32; 3]| {
        let t = f64::from(weight(*p));
        shares.map(|share| [share * (1.0 - t), share * t]).concat()
    };
    let h = length(0.1, 1.0, size);
    let problem = Screened {
        confidence: masses.iter().map(|mass| 1.5 * mass / (h * h)).collect(),
        rows: card.positions.iter().map(|p| Some(row(p))).collect(),
        stiffness,
        masses,
        is_fixed: vec![false; 16],
    };
    let place = |i: usize| {
        let vertex = Vec3::from(card.positions[i]).as_dvec3();
        Place { vertex, point: vertex, gap: 0.1, cosine: 1.0, weight: vertex.y * 0.2 }
    };
    let expected = problem.solved(|i, j| kept(place(i), place(j), size));
    let result = transfer(&source, &card, None);
    for (i, expected) in expected.iter().enumerate() {
        let found = dense(&result.weights, i);
        let is_near = std::iter::zip(&found, expected).all(|(&x, y)| (f64::from(x) - y).abs() < 2e-5);
        assert!(is_near, "{i}: {found:?} is not {expected:?}");
    }
}

#[test]
fn a_garment_follows_bones_that_have_small_weights_only() {
    // Seventy bones, all of which the garment reaches; the last six have a thousandth each at one end of the body.
    let share = |y: f32| if y < -0.8 { 1e-3 } else { 0.0 };
    let body = source(&[wall(0.0, 1, 4.0, 64)], 70, |_, [_, y, z]| {
        let aside = if y > 0.5 { 32 } else { 0 };
        let (first, last) = ((((z + 2.0) * 16.0) as u32 + aside) % 64, 64 + ((z + 2.0) * 1.4) as u32);
        (vec![first, last], vec![1.0 - share(y), share(y)])
    });
    let plate = wall(0.15, 1, 3.0, 50);
    let result = transfer(&body, &plate, None);
    for (i, &[_, y, _]) in plate.positions.iter().enumerate().filter(|(_, p)| (p[1] + 0.8).abs() > 0.5) {
        let small: f32 = dense(&result.weights, i)[64..].iter().sum();
        assert!((small - share(y)).abs() < 1e-4, "{i}, {y}: {small}");
    }
}
