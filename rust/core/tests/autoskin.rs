//! Automatic weights: what must hold for every method on every mesh, and choices that can be worked out by hand.

mod common;

use common::{Fixture, degenerate, rigid_motion, tube};
use glam::{DVec3, Vec3};
use skinwright_core::autoskin::{AutoWeights, Method, Settings, Skeleton, automatic_weights};
use skinwright_core::inside::{Lattice, Paths, UNREACHED};
use skinwright_core::{Error, Progress, Result, TriMesh};

type Segment = [[f32; 3]; 2];

/// Four bones along the axis of the tube of height 4.
fn chain() -> (Vec<Segment>, Vec<i32>) {
    let segment = |j: i32| [[0.0, 0.0, j as f32], [0.0, 0.0, j as f32 + 1.0]];
    ((0..4).map(segment).collect(), (-1..3).collect())
}

fn run(mesh: &Fixture, bones: &(Vec<Segment>, Vec<i32>), settings: &Settings) -> Result<AutoWeights> {
    let mesh = TriMesh::new(&mesh.positions, &mesh.triangles, "rest")?;
    automatic_weights(&mesh, &Skeleton { segments: &bones.0, parents: &bones.1 }, settings, &Progress::default())
}

fn coarse(method: Method) -> Settings {
    Settings { method, resolution: 48.0, ..Settings::default() }
}

fn dense(result: &AutoWeights, i: usize) -> Vec<f32> {
    let mut row = vec![0.0; result.weights.n_bones() as usize];
    let (bones, values) = result.weights.row(i);
    bones.iter().zip(values).for_each(|(&bone, &value)| row[bone as usize] = value);
    row
}

/// Half the sum of the differences of two rows.
fn difference(x: &[f32], y: &[f32]) -> f32 {
    0.5 * x.iter().zip(y).map(|(x, y)| (x - y).abs()).sum::<f32>()
}

fn assert_sound(result: &AutoWeights, what: &str) {
    for i in 0..result.weights.vertex_count() {
        let (bones, values) = result.weights.row(i);
        let sum: f32 = values.iter().sum();
        assert!((sum - 1.0).abs() < 1e-5, "{what}: row {i} sums to {sum}");
        assert!(values.iter().all(|&x| x > 0.0), "{what}: row {i} is {values:?}");
        assert!(bones.len() <= 4 && bones.is_sorted_by(|a, b| a < b), "{what}: row {i} has bones {bones:?}");
    }
    assert_eq!(result.report.unweighted, 0, "{what}");
}

/// Two tubes side by side, `gap` apart, each with a bone.
fn two_legs(gap: f64) -> (Fixture, (Vec<Segment>, Vec<i32>)) {
    let apart = 2.6 + gap;
    let mesh = tube(24, 24).joined(tube(24, 24).mapped(|p| p + DVec3::new(apart, 0.0, 0.0)));
    let bone = |x: f32| [[x, 0.0, 0.2], [x, 0.0, 3.8]];
    (mesh.named("two legs"), (vec![bone(0.0), bone(apart as f32)], vec![-1, -1]))
}

#[test]
fn every_method_answers_everywhere_on_every_mesh() {
    for mesh in degenerate() {
        for method in Method::ALL {
            let result = run(&mesh, &chain(), &coarse(method)).unwrap();
            assert_sound(&result, &format!("{method:?} on {}", mesh.name));
        }
    }
}

#[test]
fn a_vertex_beside_the_middle_of_a_bone_belongs_to_it() {
    let mesh = tube(24, 32);
    for method in Method::ALL {
        let result = run(&mesh, &chain(), &coarse(method)).unwrap();
        for (i, p) in mesh.positions.iter().enumerate() {
            let (bone, along) = (p[2].floor().clamp(0.0, 3.0) as usize, p[2].fract());
            if (0.3..0.7).contains(&along) {
                let row = dense(&result, i);
                assert!(row.iter().all(|&x| x <= row[bone]), "{method:?}: {row:?} at height {}", p[2]);
            }
        }
    }
}

/// Where the straight distance bleeds from one leg to the other, the way through the inside does not.
#[test]
fn the_inside_keeps_legs_apart() {
    let (mesh, bones) = two_legs(0.3);
    let bleeding = |method| {
        let result = run(&mesh, &bones, &Settings { method, ..Settings::default() }).unwrap();
        let half = mesh.positions.len() / 2;
        (0..half).map(|i| dense(&result, i)[1]).fold(0.0, f32::max)
    };
    assert!(bleeding(Method::Euclidean) > 0.02);
    assert!(bleeding(Method::Geodesic) < bleeding(Method::Euclidean));
    assert!(bleeding(Method::Heat) < 1e-3);
}

#[test]
fn an_island_without_a_bone_follows_the_nearest_one() {
    let bead = tube(8, 4).mapped(|p| p * 0.05 + DVec3::new(0.0, 1.6, 0.5));
    let (mesh, count) = (tube(24, 32).joined(bead), tube(24, 32).positions.len());
    for method in [Method::Heat, Method::Geodesic] {
        let result = run(&mesh, &chain(), &coarse(method)).unwrap();
        for i in count..mesh.positions.len() {
            assert!(dense(&result, i)[0] > 0.5, "{method:?}: {:?}", dense(&result, i));
        }
    }
}

#[test]
fn seams_do_not_tear() {
    let whole = tube(24, 32);
    let corners = whole.triangles.as_flattened();
    let positions = corners.iter().map(|&i| whole.positions[i as usize]).collect();
    let triangles = (0..whole.triangles.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    let split = Fixture::new("split", positions, triangles);
    for method in Method::ALL {
        let (whole, split) = (run(&whole, &chain(), &coarse(method)).unwrap(), run(&split, &chain(), &coarse(method)));
        let split = split.unwrap();
        assert_eq!(split.report.distinct, whole.report.vertices);
        for (k, &i) in corners.iter().enumerate() {
            assert!(difference(&dense(&whole, i as usize), &dense(&split, k)) < 1e-5, "{method:?}");
        }
    }
}

/// Weights of the paper's method change little over a short way, also where a vertex changes its bones.
#[test]
fn inverse_distances_are_continuous() {
    let line = |k: usize| {
        let t = k as f32 / 4000.0;
        [1.1 + 0.4 * t, 0.3 - 0.2 * t, 4.2 * t - 0.1]
    };
    let mesh = Fixture::new("line", (0..4001).map(line).collect(), (0..3999).map(|i| [i, i + 1, i + 2]).collect());
    let result = run(&mesh, &chain(), &coarse(Method::Euclidean)).unwrap();
    for i in 1..mesh.positions.len() {
        let step = difference(&dense(&result, i - 1), &dense(&result, i));
        assert!(step < 0.01, "{step} at height {}", mesh.positions[i][2]);
    }
}

#[test]
fn motion_and_scale_change_little() {
    let (mesh, (segments, parents)) = (tube(24, 32), chain());
    for method in Method::ALL {
        let here =
            run(&mesh, &(segments.clone(), parents.clone()), &Settings { method, ..Settings::default() }).unwrap();
        for scale in [0.01, 100.0] {
            let moved = |p: DVec3| rigid_motion(p) * scale;
            let point = |p: [f32; 3]| moved(Vec3::from(p).as_dvec3()).as_vec3().to_array();
            let bones = segments.iter().map(|s| s.map(point)).collect();
            let settings = Settings { method, ..Settings::default() };
            let there = run(&mesh.mapped(moved), &(bones, parents.clone()), &settings).unwrap();
            let all = (0..mesh.positions.len()).map(|i| difference(&dense(&here, i), &dense(&there, i)));
            let mean = all.sum::<f32>() / mesh.positions.len() as f32;
            assert!(mean < 0.01, "{method:?}: {mean}");
        }
    }
}

#[test]
fn threads_change_no_bit() {
    let (mesh, bones) = two_legs(0.1);
    let with = |threads, method| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| run(&mesh, &bones, &coarse(method)).unwrap().weights)
    };
    for method in Method::ALL {
        assert_eq!(with(1, method), with(3, method));
    }
}

#[test]
fn limits_influences() {
    let thin = tube(24, 32).mapped(|p| DVec3::new(0.2 * p.x, 0.2 * p.y, p.z));
    for max_influences in [1, 2, 0] {
        let settings = Settings { max_influences, ..coarse(Method::Euclidean) };
        let most = run(&thin, &chain(), &settings).unwrap().report.most_influences;
        assert!(if max_influences > 0 { most == max_influences } else { most > 2 });
    }
}

#[test]
fn refuses_what_cannot_be_meant() {
    let mesh = tube(12, 8);
    let refused = |change: &dyn Fn(&mut Vec<Segment>, &mut Vec<i32>)| {
        let (mut segments, mut parents) = chain();
        change(&mut segments, &mut parents);
        run(&mesh, &(segments, parents), &Settings::default()).unwrap_err().to_string()
    };
    let no_bones = refused(&|segments, parents| (*segments, *parents) = (vec![], vec![]));
    assert!(no_bones.contains("no bones"), "{no_bones}");
    assert!(refused(&|segments, _| segments[2][1] = segments[2][0]).contains("bone 2 has no length"));
    assert!(
        refused(&|segments, _| segments[1][0][1] = f32::NAN).contains("bone 1 has a head or tail that is not finite")
    );
    assert!(refused(&|_, parents| parents[1] = 7).contains("parents of bone 1 lead"));
    assert!(refused(&|segments, _| segments.iter_mut().flatten().for_each(|p| p[0] += 99.0)).contains("outside"));
    let settings = Settings { stiffness: f64::NAN, ..Settings::default() };
    assert!(matches!(run(&mesh, &chain(), &settings), Err(Error::InvalidParameter { name: "stiffness", .. })));
}

#[test]
fn stops_when_asked() {
    let (mesh, (segments, parents)) = (tube(24, 32), chain());
    let mesh = TriMesh::new(&mesh.positions, &mesh.triangles, "rest").unwrap();
    let progress = Progress::default();
    progress.cancel();
    let skeleton = Skeleton { segments: &segments, parents: &parents };
    let result = automatic_weights(&mesh, &skeleton, &Settings::default(), &progress);
    assert_eq!(result.unwrap_err(), Error::Cancelled);
}

/// In a convex body ways are straight; the lattice makes them up to a tenth longer (26 directions).
#[test]
fn ways_are_as_long_as_they_should_be() {
    let (mesh, _) = two_legs(0.5);
    let checked = TriMesh::new(&mesh.positions, &mesh.triangles, "test").unwrap();
    let lattice = Lattice::new(&checked, 96.0, &Progress::default()).unwrap();
    let mut paths = Paths::new(&lattice);
    let start = DVec3::new(0.0, 0.0, 0.3);
    paths.search([(lattice.nearest_node(start), 0)], |_| UNREACHED - 1);
    for z in [1.0, 2.0, 3.5] {
        let end = DVec3::new(0.4, -0.5, z);
        let way = paths.length(paths.distance(lattice.nearest_node(end)));
        let straight = start.distance(end);
        assert!((0.95 * straight..1.15 * straight + 0.1).contains(&way), "{way} for {straight}");
        assert!(lattice.sees(start, end, 0.0));
    }
    // The other leg is reached over one bridge, and not seen.
    let other = DVec3::new(3.1, 0.0, 0.3);
    assert!(paths.distance(lattice.nearest_node(other)) < UNREACHED);
    assert!(!lattice.sees(start, other, 1.5));
}
