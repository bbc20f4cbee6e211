//! The simplex solver against enumeration of all faces, and what must hold for every stroke.

use glam::{DAffine3, DMat3, DVec3, Vec3};
use proptest::prelude::*;
use skinwright_core::sculpt::{Options, SculptSolver, SimplexQp};
use skinwright_core::skinning::linear_blend;
use skinwright_core::{Error, Weights};

/// Deterministic numbers, uniform and roughly normal.
struct Random(u64);

impl Random {
    fn uniform(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }

    fn point(&mut self) -> DVec3 {
        DVec3::new(self.normal(), self.normal(), self.normal())
    }

    fn simplex<const N: usize>(&mut self) -> [f64; N] {
        let x: [f64; N] = std::array::from_fn(|_| self.uniform().powi(3));
        x.map(|y| y / x.iter().sum::<f64>())
    }
}

#[derive(Debug, Clone, Copy)]
enum Family {
    Generic,
    TargetInside,
    Coincident,
    Collinear,
    OneHot,
    Big,
    Small,
    ManyPoses,
}

const FAMILIES: [Family; 8] = [
    Family::Generic,
    Family::TargetInside,
    Family::Coincident,
    Family::Collinear,
    Family::OneHot,
    Family::Big,
    Family::Small,
    Family::ManyPoses,
];

const PULL: f64 = 0.05 * 0.05;

/// A problem as a stroke makes it: d_j and t, divided by the mesh' size, k = 0.05.
fn problem<const N: usize>(family: Family, random: &mut Random) -> (SimplexQp<N>, [f64; N]) {
    let mut start = random.simplex::<N>();
    let poses = if matches!(family, Family::ManyPoses) { 3 } else { 1 };
    let scale = match family {
        Family::Big => 1e3,
        Family::Small => 1e-3,
        _ => 1.0,
    };
    let mut qp = SimplexQp { h: [[0.0; N]; N], g: [0.0; N], n: N, mass: 1.0 };
    for _ in 0..poses {
        let mut d: [DVec3; N] = std::array::from_fn(|_| scale * random.point());
        let mut target = scale * random.point();
        match family {
            Family::TargetInside => target = d.iter().zip(random.simplex::<N>()).map(|(&d, w)| w * d).sum(),
            Family::Coincident => d = d.map(|x| d[0] + 1e-7 * x),
            Family::Collinear => d = std::array::from_fn(|_| d[0] + random.normal() * d[N - 1]),
            Family::OneHot => start = std::array::from_fn(|j| if j == 0 { 1.0 } else { 0.0 }),
            _ => {}
        }
        let e = d.map(|d| (d - target) / scale);
        for (row, e_i) in qp.h.iter_mut().zip(e) {
            row.iter_mut().zip(e).for_each(|(entry, e_j)| *entry += e_i.dot(e_j));
        }
    }
    (0..N).for_each(|j| qp.h[j][j] += PULL);
    qp.g = start.map(|o| PULL * o);
    (qp, start)
}

fn objective<const N: usize>(qp: &SimplexQp<N>, w: &[f64; N]) -> f64 {
    (0..N).map(|i| (0..N).map(|j| 0.5 * w[i] * qp.h[i][j] * w[j]).sum::<f64>() - qp.g[i] * w[i]).sum()
}

/// The stationary point of the face on which the Karush-Kuhn-Tucker conditions hold best, over all faces of the
/// simplex, each by Gaussian elimination with pivoting. (The objective cannot tell faces apart below its rounding.)
fn enumerate<const N: usize>(qp: &SimplexQp<N>) -> [f64; N] {
    let mut best = (f64::INFINITY, [0.0; N]);
    for face in 1usize..1 << N {
        let members: Vec<usize> = (0..N).filter(|j| face >> j & 1 == 1).collect();
        let m = members.len();
        // Stationarity with the sum's multiplier x: [H 1; 1' 0] [w; x] = [g; 1].
        let mut rows = vec![vec![0.0; m + 2]; m + 1];
        for (r, &i) in members.iter().enumerate() {
            for (c, &j) in members.iter().enumerate() {
                rows[r][c] = qp.h[i][j];
            }
            (rows[r][m], rows[m][r], rows[r][m + 1]) = (1.0, 1.0, qp.g[i]);
        }
        rows[m][m + 1] = qp.mass;
        let solution = eliminate(rows);
        let mut w = [0.0; N];
        members.iter().zip(&solution).for_each(|(&j, &x)| w[j] = x);
        let bound_multiplier = |j: usize| (0..N).map(|i| qp.h[j][i] * w[i]).sum::<f64>() - qp.g[j] + solution[m];
        let outside = (0..N).filter(|j| !members.contains(j)).map(|j| bound_multiplier(j) / PULL);
        let violation = w.iter().copied().chain(outside).fold(0.0, |worst, x| f64::max(worst, -x));
        if violation < best.0 {
            best = (violation, w);
        }
    }
    best.1
}

fn eliminate(mut rows: Vec<Vec<f64>>) -> Vec<f64> {
    let n = rows.len();
    for column in 0..n {
        let pivot = (column..n).max_by(|&a, &b| rows[a][column].abs().total_cmp(&rows[b][column].abs())).unwrap();
        rows.swap(column, pivot);
        let pivot_row = rows[column].clone();
        for row in rows.iter_mut().skip(column + 1) {
            let factor = row[column] / pivot_row[column];
            row.iter_mut().zip(&pivot_row).skip(column).for_each(|(x, p)| *x -= factor * p);
        }
    }
    let mut x = vec![0.0; n];
    for r in (0..n).rev() {
        let known: f64 = (r + 1..n).map(|c| rows[r][c] * x[c]).sum();
        x[r] = (rows[r][n] - known) / rows[r][r];
    }
    x
}

fn agrees_with_enumeration<const N: usize>(cases: usize) {
    let mut random = Random(0x9e37_79b9_7f4a_7c15);
    for family in FAMILIES {
        for case in 0..cases {
            let (qp, start) = problem::<N>(family, &mut random);
            let mut w = start;
            qp.minimise(&mut w);
            let expected = enumerate(&qp);
            let difference = w.iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(difference <= 1e-9, "{family:?} {case}: {w:?} is not {expected:?}");
            let rounding = 1e-14 * (0..N).map(|j| qp.h[j][j]).sum::<f64>();
            assert!(objective(&qp, &w) <= objective(&qp, &start) + rounding, "{family:?} {case}: worse than the start");
            assert!(w.iter().all(|&x| x >= 0.0) && (w.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        }
    }
}

#[test]
fn the_solver_agrees_with_enumeration_on_a_hundred_thousand_tetrahedra() {
    agrees_with_enumeration::<4>(13_000);
}

#[test]
fn the_solver_agrees_with_enumeration_on_other_simplices() {
    agrees_with_enumeration::<1>(10);
    agrees_with_enumeration::<2>(500);
    agrees_with_enumeration::<3>(500);
    agrees_with_enumeration::<7>(200);
    agrees_with_enumeration::<10>(10);
}

/// A small character: vertices in a unit box, `members` of its 6 bones each, random poses.
#[derive(Debug, Clone)]
struct Character {
    rest: Vec<[f32; 3]>,
    weights: Weights,
    poses: Vec<Vec<DAffine3>>,
    locked: Vec<bool>,
}

const BONES: u32 = 6;

impl Character {
    fn random(seed: u64, vertices: usize, members: usize, scale: f64, locked: Vec<bool>) -> Self {
        let mut random = Random(seed | 1);
        let _ = random.normal();
        let point = |random: &mut Random| (scale * random.point()).as_vec3().to_array();
        let rest = (0..vertices).map(|_| point(&mut random)).collect();
        let mut values = Vec::new();
        for _ in 0..vertices {
            let sharp = random.simplex::<6>();
            let sum: f64 = sharp[..members].iter().sum();
            values.extend(sharp[..members].iter().map(|w| (w / sum) as f32));
        }
        let bones = (0..vertices).flat_map(|i| (0..members).map(move |j| ((i + j) % BONES as usize) as u32)).collect();
        let indptr = (0..=vertices).map(|i| (i * members) as u32).collect();
        let pose = |random: &mut Random| {
            let turn = |random: &mut Random| {
                let matrix3 = DMat3::from_axis_angle(random.point().normalize(), 2.0 * random.uniform());
                DAffine3 { matrix3, translation: 0.1 * scale * random.point() }
            };
            (0..BONES).map(|_| turn(random)).collect()
        };
        let poses = (0..3).map(|_| pose(&mut random)).collect();
        Self { rest, weights: Weights::new(indptr, bones, values, BONES).unwrap(), poses, locked }
    }

    fn solver(&self) -> SculptSolver {
        SculptSolver::new(&self.rest, self.weights.clone(), &self.locked, Options::default()).unwrap()
    }

    fn posed(&self, weights: &Weights, pose: usize) -> Vec<DVec3> {
        let posed = linear_blend(&self.rest, weights, &self.poses[pose]).unwrap();
        posed.iter().map(|&p| Vec3::from(p).as_dvec3()).collect()
    }

    /// Somewhere near where the vertices lie in a pose.
    fn targets(&self, random: &mut Random, pose: usize, size: f64) -> Vec<[f32; 3]> {
        let posed = self.posed(&self.weights, pose);
        posed.iter().map(|&p| (p + size * random.point()).as_vec3().to_array()).collect()
    }

    fn all(&self) -> Vec<u32> {
        (0..self.rest.len() as u32).collect()
    }
}

/// Where vertex `i` lies in a pose, in f64, and how far that can be off because its weights are stored in f32.
fn blended(character: &Character, weights: &Weights, pose: usize, i: usize) -> (DVec3, f64) {
    let (bones, values) = weights.row(i);
    let rest = Vec3::from(character.rest[i]).as_dvec3();
    let moved = bones.iter().map(|&b| character.poses[pose][b as usize].transform_point3(rest));
    let members: Vec<(DVec3, f64)> = moved.zip(values.iter().map(|&w| f64::from(w))).collect();
    let total: f64 = members.iter().map(|m| m.1).sum();
    let position = members.iter().map(|&(p, w)| p * w).sum::<DVec3>() / total;
    // No weight is off by more than half the last bit of 1, 2^-25; doubled for the division by the total.
    let rounding = members.iter().map(|m| m.0.distance(position)).sum::<f64>() * f64::from(f32::EPSILON) / 2.0;
    (position, rounding)
}

/// Distance of vertex `i` to its targets in all poses together (the root of the sum of squares), and its rounding.
fn distance(character: &Character, weights: &Weights, sculpted: &[Vec<[f32; 3]>], i: usize) -> (f64, f64) {
    let (mut squared, mut roundings) = (0.0, 0.0);
    for (pose, targets) in sculpted.iter().enumerate() {
        let (position, rounding) = blended(character, weights, pose, i);
        squared += position.distance_squared(Vec3::from(targets[i]).as_dvec3());
        roundings += rounding;
    }
    (squared.sqrt(), roundings)
}

proptest! {
    #[test]
    fn strokes_keep_weights_valid_and_take_no_vertex_farther_from_its_targets(
        seed in any::<u64>(), members in 1usize..=6, size in 0.001f64..1.0, lock in prop::option::of(0usize..6)
    ) {
        let mut locked = vec![false; BONES as usize];
        lock.into_iter().for_each(|bone| locked[bone] = true);
        let character = Character::random(seed, 40, members, 1.0, locked);
        let mut random = Random(seed | 1);
        let mut solver = character.solver();
        let mut sculpted = Vec::new();
        for pose in 0..3 {
            let number = solver.add_pose(character.poses[pose].clone(), 1.0).unwrap();
            sculpted.push(character.targets(&mut random, pose, size));
            let old = solver.weights();
            let stroke = solver.stroke(number, &character.all(), &sculpted[pose]).unwrap();
            let weights = solver.weights();
            for i in 0..character.rest.len() {
                let (before, _) = distance(&character, &old, &sculpted, i);
                let (after, rounding) = distance(&character, &weights, &sculpted, i);
                prop_assert!(after <= before + rounding, "vertex {}: {} > {} + {}", i, after, before, rounding);
            }
            prop_assert!(stroke.reachability <= 1.0);
            prop_assert_eq!(weights.bones(), character.weights.bones());
            prop_assert_eq!(weights.indptr(), character.weights.indptr());
            prop_assert!(weights.values().iter().all(|&w| (0.0..=1.0).contains(&w)));
            for i in 0..character.rest.len() {
                prop_assert!((weights.row(i).1.iter().sum::<f32>() - 1.0).abs() < 1e-6);
                let (bones, old) = character.weights.row(i);
                for ((&bone, old), new) in bones.iter().zip(old).zip(weights.row(i).1) {
                    prop_assert!(!character.locked[bone as usize] || old.to_bits() == new.to_bits());
                }
            }
        }
    }

    #[test]
    fn undo_and_redo_give_back_every_bit(seed in any::<u64>()) {
        let character = Character::random(seed, 30, 4, 1.0, vec![]);
        let mut random = Random(seed | 1);
        let mut solver = character.solver();
        let poses = [0, 1].map(|p| solver.add_pose(character.poses[p].clone(), 1.0).unwrap());
        let mut states = vec![solver.weights()];
        let mut strokes = Vec::new();
        for (s, pose) in [poses[0], poses[1], poses[0], poses[1]].into_iter().enumerate() {
            let vertices: Vec<u32> = (0..30).filter(|i| !(i + s as u32).is_multiple_of(3)).collect();
            let targets: Vec<[f32; 3]> = vertices.iter().map(|_| random.point().as_vec3().to_array()).collect();
            solver.stroke(pose, &vertices, &targets).unwrap();
            states.push(solver.weights());
            strokes.push((pose, vertices, targets));
        }
        for s in (0..4).rev() {
            prop_assert_eq!(solver.undo(), Some(strokes[s].1.as_slice()));
            prop_assert_eq!(solver.weights(), states[s].clone());
        }
        prop_assert_eq!(solver.undo(), None);
        prop_assert_eq!(solver.reachability(), None);
        prop_assert!(solver.residuals(poses[0]).unwrap().vertices.is_empty(), "the memory is empty again");
        for s in 0..3 {
            prop_assert_eq!(solver.redo(), Some(strokes[s].1.as_slice()));
            prop_assert_eq!(solver.weights(), states[s + 1].clone());
        }
        // With the memory as it was, the fourth stroke gives the fourth state.
        let (pose, vertices, targets) = &strokes[3];
        solver.stroke(*pose, vertices, targets).unwrap();
        prop_assert_eq!(solver.weights(), states[4].clone());
        prop_assert_eq!(solver.redo(), None, "a stroke forgets what was taken back");
    }

    #[test]
    fn scale_does_not_matter(seed in any::<u64>()) {
        let solved = |scale: f64| {
            let character = Character::random(seed, 20, 4, scale, vec![]);
            let mut random = Random(seed | 1);
            let mut solver = character.solver();
            let pose = solver.add_pose(character.poses[0].clone(), 1.0).unwrap();
            let targets = character.targets(&mut random, 0, 0.3 * scale);
            solver.stroke(pose, &character.all(), &targets).unwrap();
            solver.weights()
        };
        let (small, big) = (solved(1.0), solved(1000.0));
        for (a, b) in small.values().iter().zip(big.values()) {
            prop_assert!((a - b).abs() < 1e-3, "{} {}", a, b);
        }
    }

    #[test]
    fn the_answer_is_the_same_on_any_number_of_threads(seed in any::<u64>()) {
        let character = Character::random(seed, 700, 4, 1.0, vec![]);
        let solved = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let mut solver = character.solver();
                solver.guard(&character.poses[1], 0.2).unwrap();
                let pose = solver.add_pose(character.poses[0].clone(), 1.0).unwrap();
                let targets = character.targets(&mut Random(seed | 1), 0, 0.3);
                let stroke = solver.stroke(pose, &character.all(), &targets).unwrap();
                (solver.weights(), stroke.reachability.to_bits())
            })
        };
        prop_assert_eq!(solved(1), solved(3));
    }
}

#[test]
fn a_target_that_weights_can_reach_is_reached() {
    let character = Character::random(7, 50, 4, 1.0, vec![]);
    let goal = Character::random(8, 50, 4, 1.0, vec![]).weights;
    let mut solver = character.solver();
    solver.set_options(Options { kappa: 0.001, passes: 3 }).unwrap();
    let pose = solver.add_pose(character.poses[0].clone(), 1.0).unwrap();
    let targets = linear_blend(&character.rest, &goal, &character.poses[0]).unwrap();
    let stroke = solver.stroke(pose, &character.all(), &targets).unwrap();
    assert!(stroke.reachability > 0.999, "{}", stroke.reachability);
    assert_eq!(solver.reachability(), Some(stroke.reachability));
    assert!(stroke.residuals.iter().flatten().all(|x| x.abs() < 1e-3));
}

#[test]
fn nothing_changes_where_nothing_was_sculpted() {
    let character = Character::random(9, 50, 4, 1.0, vec![]);
    let mut solver = character.solver();
    let pose = solver.add_pose(character.poses[0].clone(), 1.0).unwrap();
    let touched = [3, 17];
    solver.stroke(pose, &touched, &[[0.0; 3], [1.0; 3]]).unwrap();
    let weights = solver.weights();
    for i in (0..50).filter(|i| !touched.contains(&(*i as u32))) {
        assert_eq!(weights.row(i), character.weights.row(i));
    }
    assert_eq!(solver.weights_of(&[17, 2]).unwrap().row(0), weights.row(17));
    // A target where the vertex already is.
    let mut solver = character.solver();
    let pose = solver.add_pose(character.poses[1].clone(), 1.0).unwrap();
    let here = solver.posed(pose, &character.all(), &character.rest).unwrap();
    solver.stroke(pose, &character.all(), &here).unwrap();
    for (a, b) in solver.weights().values().iter().zip(character.weights.values()) {
        assert!((a - b).abs() < 1e-4);
    }
}

#[test]
fn earlier_poses_keep_their_targets_and_a_new_sculpt_of_a_pose_replaces_its_own() {
    let character = Character::random(11, 60, 6, 1.0, vec![]);
    let goal = Character::random(12, 60, 6, 1.0, vec![]).weights;
    let mean = |weights: &Weights, pose: usize| {
        let sum: f64 =
            character.posed(weights, pose).iter().zip(character.posed(&goal, pose)).map(|(a, b)| a.distance(b)).sum();
        sum / 60.0
    };
    let mut solver = character.solver();
    let poses = [0, 1].map(|p| solver.add_pose(character.poses[p].clone(), 1.0).unwrap());
    let targets = [0, 1].map(|p| linear_blend(&character.rest, &goal, &character.poses[p]).unwrap());
    let nonsense = vec![[5.0; 3]; 60];
    solver.stroke(poses[0], &character.all(), &nonsense).unwrap();
    solver.stroke(poses[0], &character.all(), &targets[0]).unwrap();
    solver.stroke(poses[1], &character.all(), &targets[1]).unwrap();
    let weights = solver.weights();
    for pose in 0..2 {
        assert!(mean(&weights, pose) < 0.1 * mean(&character.weights, pose), "pose {pose}");
    }
    // The same matrices again are the same pose.
    assert_eq!(solver.add_pose(character.poses[0].clone(), 1.0).unwrap(), poses[0]);
    assert_eq!(solver.add_pose(character.poses[2].clone(), 1.0).unwrap(), 2);
}

#[test]
fn guards_hold_other_poses_back() {
    let character = Character::random(13, 80, 4, 1.0, vec![]);
    let moved = |guard: bool, forget: bool| {
        let mut solver = character.solver();
        if guard {
            solver.guard(&character.poses[1], 0.3).unwrap();
            solver.guard(&character.poses[2], 0.3).unwrap();
        }
        if forget {
            solver.clear_guards();
        }
        let pose = solver.add_pose(character.poses[0].clone(), 1.0).unwrap();
        solver.stroke(pose, &character.all(), &character.targets(&mut Random(5), 0, 0.5)).unwrap();
        let distance = |pose: usize| -> f64 {
            let before = character.posed(&character.weights, pose);
            character.posed(&solver.weights(), pose).iter().zip(before).map(|(a, b)| a.distance(b)).sum()
        };
        distance(1) + distance(2)
    };
    assert!(moved(true, false) < 0.7 * moved(false, false));
    assert_eq!(moved(true, true), moved(false, false));
}

#[test]
fn a_range_of_motion_guards_only_what_hangs_on_the_joint() {
    // Bones 0 <- 1 <- 2; vertex 0 on bones 0 and 1, vertex 1 on bones 1 and 2.
    let rest = [[1.0, 0.1, 0.0], [2.0, 0.1, 0.0]];
    let weights = Weights::new(vec![0, 2, 4], vec![0, 1, 1, 2], vec![0.5; 4], 3).unwrap();
    let bend = |joint: usize| -> Vec<DAffine3> {
        let turn = DAffine3::from_axis_angle(DVec3::Z, 1.0);
        let place = DAffine3::from_translation(DVec3::X * joint as f64);
        (0..3).map(|b| if b >= joint { place * turn * place.inverse() } else { DAffine3::IDENTITY }).collect()
    };
    let heads = [[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]];
    let solve = |joints: &[u32]| {
        let mut solver = SculptSolver::new(&rest, weights.clone(), &[], Options::default()).unwrap();
        solver.guard_range_of_motion(&[-1, 0, 1], &heads, joints, 5.0).unwrap();
        for joint in [1, 2] {
            let pose = solver.add_pose(bend(joint), 1.0).unwrap();
            let goal = linear_blend(&rest, &weights, &bend(0)).unwrap()[joint - 1];
            solver.stroke(pose, &[joint as u32 - 1], &[goal]).unwrap();
        }
        solver.weights()
    };
    let change = |weights: &Weights, i: usize| (weights.row(i).1[0] - 0.5).abs();
    let (free, held) = (solve(&[]), solve(&[1]));
    assert!(change(&held, 0) < 0.9 * change(&free, 0), "vertex 0 crosses joint 1");
    assert_eq!(change(&held, 1), change(&free, 1), "both bones of vertex 1 turn together");
}

#[test]
fn residuals_are_what_is_left_and_the_rest_residual_makes_up_for_it() {
    let character = Character::random(17, 60, 4, 1.0, vec![]);
    let mut solver = character.solver();
    let pose = solver.add_pose(character.poses[0].clone(), 1.0).unwrap();
    let targets = character.targets(&mut Random(3), 0, 0.5);
    let vertices: Vec<u32> = (10..50).rev().collect();
    let goals: Vec<[f32; 3]> = vertices.iter().map(|&i| targets[i as usize]).collect();
    let stroke = solver.stroke(pose, &vertices, &goals).unwrap();
    let (left, offsets) = (solver.residuals(pose).unwrap(), solver.rest_residuals(pose).unwrap());
    assert_eq!(left.vertices, (10..50).collect::<Vec<u32>>());
    assert_eq!(left.vertices, offsets.vertices);
    assert_eq!(left.vectors[0], stroke.residuals[39]);
    let corrected: Vec<[f32; 3]> =
        (0..40).map(|k| (Vec3::from(character.rest[k + 10]) + Vec3::from(offsets.vectors[k])).to_array()).collect();
    let reached = solver.posed(pose, &left.vertices, &corrected).unwrap();
    let far: Vec<_> =
        (0..40).filter(|&k| Vec3::from(reached[k]).distance(Vec3::from(targets[k + 10])) > 1e-3).collect();
    assert!(far.len() <= 4, "all but the nearly singular blends land on the sculpt: {far:?}");
    assert!(offsets.vectors.iter().flatten().all(|x| x.is_finite()));
}

/// A bump that weights cannot make: every bone turns the same way in both poses, so only the rest shape can follow.
#[test]
fn the_rest_shape_follows_where_weights_cannot() {
    let character = Character::random(19, 40, 4, 1.0, vec![]);
    let mut solver = character.solver();
    let mut poses = [0, 1].map(|p| vec![character.poses[p][0]; BONES as usize]);
    poses[1][5] = poses[1][0] * DAffine3::from_translation(DVec3::X);
    let bump = Vec3::new(0.1, -0.2, 0.3);
    let bumped: Vec<[f32; 3]> = character.rest.iter().map(|&p| (Vec3::from(p) + bump).to_array()).collect();
    let vertices: Vec<u32> = (0..30).collect();
    for pose in &poses {
        let number = solver.add_pose(pose.clone(), 1.0).unwrap();
        let goals = linear_blend(&bumped, &character.weights, pose).unwrap();
        solver.stroke(number, &vertices, &goals[..30]).unwrap();
    }
    let before = solver.weights();
    let loose = solver.fit_rest_shape(&character.all(), 1e-6, 50).unwrap();
    assert_eq!(solver.weights(), before, "nothing has changed");
    for (k, offset) in loose.offsets.iter().enumerate() {
        let expected = if k < 30 { bump } else { Vec3::ZERO };
        assert!(Vec3::from(*offset).distance(expected) < 0.02, "{k}: {offset:?}");
        assert!((loose.weights.row(k).1.iter().sum::<f32>() - 1.0).abs() < 1e-6);
        assert!(k < 30 || loose.weights.row(k) == before.row(k));
    }
    let stiff = solver.fit_rest_shape(&vertices, 1e6, 5).unwrap();
    assert!(stiff.offsets.iter().flatten().all(|x| x.abs() < 1e-5));
    assert!(solver.fit_rest_shape(&vertices, 0.0, 5).is_err());
    assert!(solver.fit_rest_shape(&[99], 0.1, 5).is_err());
}

proptest! {
    #[test]
    fn more_rounds_of_the_rest_shape_never_do_worse(seed in any::<u64>(), stiffness in 0.01f64..1.0) {
        let character = Character::random(seed, 20, 4, 1.0, vec![]);
        let mut random = Random(seed | 1);
        let mut solver = character.solver();
        let mut goals = Vec::new();
        for pose in 0..3 {
            let number = solver.add_pose(character.poses[pose].clone(), 1.0).unwrap();
            goals.push(character.targets(&mut random, pose, 0.3));
            solver.stroke(number, &character.all(), &goals[pose]).unwrap();
        }
        let mut last = vec![f64::INFINITY; 20];
        for rounds in [0, 1, 3, 10] {
            let shape = solver.fit_rest_shape(&character.all(), stiffness, rounds).unwrap();
            let moved: Vec<[f32; 3]> = (0..20)
                .map(|i| (Vec3::from(character.rest[i]) + Vec3::from(shape.offsets[i])).to_array()).collect();
            let mut objective: Vec<f64> =
                shape.offsets.iter().map(|&d| stiffness * Vec3::from(d).as_dvec3().length_squared()).collect();
            for (pose, goals) in goals.iter().enumerate() {
                let posed = linear_blend(&moved, &shape.weights, &character.poses[pose]).unwrap();
                for (sum, (&p, &t)) in objective.iter_mut().zip(posed.iter().zip(goals)) {
                    *sum += Vec3::from(p).as_dvec3().distance_squared(Vec3::from(t).as_dvec3());
                }
            }
            for (now, before) in objective.iter().zip(&last) {
                prop_assert!(*now <= before * (1.0 + 1e-5) + 1e-9, "{} > {}", now, before);
            }
            last = objective;
        }
    }
}

#[test]
fn a_collapsed_blend_gives_a_finite_offset() {
    // Half a turn either way about z: the blend has lost x and y.
    let weights = Weights::new(vec![0, 2], vec![0, 1], vec![0.5; 2], 2).unwrap();
    let mut solver = SculptSolver::new(&[[1.0, 0.0, 0.0]], weights, &[], Options::default()).unwrap();
    let turn = |angle: f64| DAffine3::from_axis_angle(DVec3::Z, angle);
    let half = std::f64::consts::FRAC_PI_2;
    let pose = solver.add_pose(vec![turn(half), turn(-half)], 1.0).unwrap();
    solver.stroke(pose, &[0], &[[0.3, 0.0, 0.5]]).unwrap();
    let [x, y, z] = solver.rest_residuals(pose).unwrap().vectors[0];
    assert!(x.abs() < 10.0 && y.abs() < 10.0 && (z - 0.5).abs() < 0.05, "{x} {y} {z}");
}

#[test]
fn unweighted_vertices_stay_unweighted() {
    let weights = Weights::new(vec![0, 2, 4], vec![0, 1, 0, 1], vec![0.0, 0.0, 0.5, 0.5], 2).unwrap();
    let rest = [[0.0; 3], [1.0; 3]];
    let mut solver = SculptSolver::new(&rest, weights, &[], Options::default()).unwrap();
    let shift = DAffine3::from_translation(DVec3::ONE);
    let pose = solver.add_pose(vec![shift, DAffine3::IDENTITY], 1.0).unwrap();
    let stroke = solver.stroke(pose, &[0, 1], &[[0.5; 3], [1.9; 3]]).unwrap();
    assert_eq!(solver.weights().row(0).1, [0.0, 0.0]);
    assert_eq!(stroke.residuals[0], [0.5; 3]);
    assert!(solver.weights().row(1).1[0] > 0.85);
}

#[test]
fn a_locked_share_survives_weights_that_are_not_normalised() {
    let weights = Weights::new(vec![0, 3], vec![0, 1, 2], vec![0.3, 0.1, 0.2], 3).unwrap();
    let mut solver = SculptSolver::new(&[[1.0; 3]], weights, &[true, false, false], Options::default()).unwrap();
    let at = |x: f64| DAffine3::from_translation(DVec3::X * x);
    let pose = solver.add_pose(vec![at(0.0), at(1.0), at(2.0)], 1.0).unwrap();
    solver.stroke(pose, &[0], &[[1.5, 1.0, 1.0]]).unwrap();
    let weights = solver.weights();
    let values = weights.row(0).1;
    assert_eq!(values[0], 0.3);
    assert!((values.iter().sum::<f32>() - 0.6).abs() < 1e-6, "the sum is kept, or the share of 0.3 would change");
    assert!((values[1] - 0.3).abs() < 1e-3, "half of the weight, on bone 1, reaches 0.5: {values:?}");
}

#[test]
fn what_cannot_be_used_is_refused_and_changes_nothing() {
    let character = Character::random(21, 5, 4, 1.0, vec![]);
    let options = Options::default();
    let refused = |rest: &[[f32; 3]], locked: &[bool], options| {
        SculptSolver::new(rest, character.weights.clone(), locked, options).unwrap_err()
    };
    assert!(matches!(refused(&[], &[], options), Error::LengthMismatch { what: "rest_positions", .. }));
    assert!(matches!(refused(&character.rest, &[true], options), Error::LengthMismatch { what: "locked", .. }));
    assert!(matches!(refused(&[[f32::NAN; 3]; 5], &[], options), Error::PositionNotFinite { vertex: 0, .. }));
    for kappa in [0.0, -1.0, f64::NAN] {
        assert!(matches!(
            refused(&character.rest, &[], Options { kappa, ..options }),
            Error::InvalidParameter { name: "kappa", .. }
        ));
    }
    let many = Weights::new(vec![0, 13], (0..13).collect(), vec![0.1; 13], 13).unwrap();
    let error = SculptSolver::new(&[[0.0; 3]], many, &[], options).unwrap_err();
    assert!(error.to_string().contains("desparsify first"), "{error}");
    let negative = Weights::new(vec![0, 1], vec![0], vec![-0.5], 1).unwrap();
    assert!(matches!(
        SculptSolver::new(&[[0.0; 3]], negative, &[], options),
        Err(Error::WeightNegative { vertex: 0, bone: 0 })
    ));

    let mut solver = character.solver();
    let name = |error: Error| match error {
        Error::InvalidParameter { name, .. } => name,
        Error::LengthMismatch { what, .. } => what,
        _ => "another error",
    };
    assert_eq!(name(solver.stroke(0, &[0], &[[0.0; 3]]).unwrap_err()), "pose");
    assert_eq!(name(solver.add_pose(vec![], 1.0).unwrap_err()), "pose_from_rest");
    assert_eq!(name(solver.guard(&character.poses[0], 0.0).unwrap_err()), "alpha");
    let pose = solver.add_pose(character.poses[0].clone(), 1.0).unwrap();
    assert_eq!(name(solver.stroke(pose, &[0, 1], &[[0.0; 3]]).unwrap_err()), "targets");
    assert_eq!(name(solver.stroke(pose, &[5], &[[0.0; 3]]).unwrap_err()), "vertex");
    assert_eq!(name(solver.stroke(pose, &[1, 1], &[[0.0; 3]; 2]).unwrap_err()), "vertex");
    assert_eq!(name(solver.stroke(pose, &[1], &[[f32::INFINITY; 3]]).unwrap_err()), "targets");
    assert_eq!(solver.weights(), character.weights);
    assert_eq!(solver.undo(), None);
}
