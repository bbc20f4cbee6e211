//! Closest points against a brute-force search in exact integer arithmetic.

use proptest::prelude::*;
use rayon::ThreadPoolBuilder;
use skinwright_core::TriMesh;
use skinwright_core::surface::{Bound, Priced, SurfaceIndex, SurfacePoint};

type Point = [i64; 3];
type Triangle = [u32; 3];

/// A mesh on the integer grid, so that its distances can be told exactly.
struct GridMesh {
    name: &'static str,
    points: Vec<Point>,
    triangles: Vec<Triangle>,
}

// The oracle: squared distances as exact fractions.

#[derive(Clone, Copy)]
struct Fraction(i128, i128);

impl Fraction {
    fn value(self) -> f64 {
        self.0 as f64 / self.1 as f64
    }
}

fn sub(a: Point, b: Point) -> Point {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn dot(a: Point, b: Point) -> i128 {
    a.iter().zip(b).map(|(&x, y)| i128::from(x) * i128::from(y)).sum()
}

fn cross(a: Point, b: Point) -> Point {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn squared_to_segment(q: Point, a: Point, b: Point) -> Fraction {
    let (edge, offset) = (sub(b, a), sub(q, a));
    let (along, length) = (dot(edge, offset), dot(edge, edge));
    if along <= 0 {
        Fraction(dot(offset, offset), 1)
    } else if along >= length {
        Fraction(dot(sub(q, b), sub(q, b)), 1)
    } else {
        Fraction(dot(offset, offset) * length - along * along, length)
    }
}

fn squared_to_triangle(q: Point, [a, b, c]: [Point; 3]) -> f64 {
    let edges = [(a, b), (b, c), (c, a)];
    let normal = cross(sub(b, a), sub(c, a));
    let inside = |&(s, e): &(Point, Point)| dot(cross(sub(e, s), sub(q, s)), normal) >= 0;
    if normal != [0; 3] && edges.iter().all(inside) {
        let height = dot(normal, sub(q, a));
        return Fraction(height * height, dot(normal, normal)).value();
    }
    edges.iter().map(|&(s, e)| squared_to_segment(q, s, e).value()).fold(f64::INFINITY, f64::min)
}

fn squared_by_brute_force(mesh: &GridMesh, q: Point) -> f64 {
    let corners = mesh.triangles.iter().map(|t| t.map(|i| mesh.points[i as usize]));
    corners.map(|t| squared_to_triangle(q, t)).fold(f64::INFINITY, f64::min)
}

// Placing the integer grid in space: exact, as scales are powers of two and offsets whole.

#[derive(Clone, Copy)]
struct Placement {
    scale: f64,
    offset: Point,
}

const AS_IT_IS: Placement = Placement { scale: 1.0, offset: [0; 3] };

impl Placement {
    fn place(self, points: &[Point]) -> Vec<[f32; 3]> {
        let place = |p: &Point| [0, 1, 2].map(|k| ((p[k] + self.offset[k]) as f64 * self.scale) as f32);
        points.iter().map(place).collect()
    }
}

fn check(mesh: &GridMesh, placement: Placement, queries: &[Point]) {
    let positions = placement.place(&mesh.points);
    let surface = TriMesh::new(&positions, &mesh.triangles, mesh.name).unwrap();
    let found = SurfaceIndex::new(&surface).closest_points(&placement.place(queries));
    let unit = placement.scale * placement.scale;
    let tolerance = 1e-12 * surface.diagonal().powi(2);
    for ((answer, &q), placed) in found.iter().zip(queries).zip(placement.place(queries)) {
        let expected = squared_by_brute_force(mesh, q) * unit;
        let squared = answer.distance * answer.distance;
        let error = (squared - expected).abs();
        let name = mesh.name;
        assert!(error <= tolerance + 1e-14 * expected, "{name}: {q:?} is {expected:e} away, not {squared:e}");
        check_consistent(&surface, placed, answer);
    }
}

/// The barycentric coordinates are that: of a point at the given distance.
fn check_consistent(mesh: &TriMesh<'_>, query: [f32; 3], answer: &SurfacePoint) {
    let weights = answer.barycentric;
    assert!(weights.iter().all(|&w| w >= 0.0), "{weights:?}");
    assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-12, "{weights:?}");
    let corners = mesh.triangles()[answer.triangle as usize].map(|i| mesh.positions()[i as usize]);
    let offset =
        |k: usize| -> f64 { (0..3).map(|c| weights[c] * (f64::from(corners[c][k]) - f64::from(query[k]))).sum() };
    let distance = (0..3).map(|k| offset(k).powi(2)).sum::<f64>().sqrt();
    assert!((distance - answer.distance).abs() <= 1e-12 * (mesh.diagonal() + distance), "{query:?}: {answer:?}");
}

// Meshes.

/// Whole numbers that look random, in -range..=range.
struct Noise(u64);

impl Noise {
    fn whole(&mut self, range: i64) -> i64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 33) as i64).rem_euclid(2 * range + 1) - range
    }

    fn points(&mut self, count: usize, range: i64) -> Vec<Point> {
        (0..count).map(|_| [0; 3].map(|_| self.whole(range))).collect()
    }
}

fn soup(name: &'static str, corners: Vec<Point>) -> GridMesh {
    let triangles = (0..corners.len() as u32 / 3).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    GridMesh { name, points: corners, triangles }
}

/// A wavy sheet of 2 side^2 triangles.
fn sheet(side: u32) -> GridMesh {
    let height = |x: u32, y: u32| ((f64::from(x) * 0.3).sin() * 40.0 + (f64::from(y) * 0.2).cos() * 30.0) as i64;
    let point = |i: u32| (i % (side + 1), i / (side + 1));
    let points = (0..(side + 1).pow(2)).map(point).map(|(x, y)| [10 * i64::from(x), 10 * i64::from(y), height(x, y)]);
    let cell = |i: u32| (i / side) * (side + 1) + i % side;
    let halves = |a: u32| [[a, a + 1, a + side + 1], [a + 1, a + side + 2, a + side + 1]];
    let triangles = (0..side * side).map(cell).flat_map(halves).collect();
    GridMesh { name: "sheet", points: points.collect(), triangles }
}

fn needles(noise: &mut Noise) -> GridMesh {
    let needle = |noise: &mut Noise| {
        let start = noise.points(1, 1000)[0];
        let end = [0, 1, 2].map(|k| start[k] + 40 * noise.whole(2500));
        let aside = [0, 1, 2].map(|k| (start[k] + end[k]) / 2 + noise.whole(1));
        [start, end, aside]
    };
    soup("needles", (0..200).flat_map(|_| needle(noise)).collect())
}

fn fan() -> GridMesh {
    let rim = (0..500).map(|i| f64::from(i) * 0.012).map(|a| [(a.cos() * 1e3) as i64, (a.sin() * 1e3) as i64, 0]);
    GridMesh {
        name: "fan",
        points: std::iter::once([0, 0, 300]).chain(rim).collect(),
        triangles: (1..500).map(|i| [0, i, i + 1]).collect(),
    }
}

fn meshes() -> Vec<GridMesh> {
    let mut noise = Noise(7);
    let triangle = [[0, 0, 0], [90, 10, 0], [20, 70, 30]];
    let line = |noise: &mut Noise| [0; 3].map(|_| noise.whole(100)).map(|x| [x, 2 * x, -x]);
    vec![
        soup("one triangle", triangle.to_vec()),
        soup("one point", vec![[5, 6, 7]; 3]),
        soup("a few", noise.points(3 * 9, 50)),
        soup("large triangles", noise.points(3 * 300, 100)),
        soup("identical", triangle.repeat(1000)),
        soup("points", noise.points(400, 50).into_iter().flat_map(|p| [p; 3]).collect()),
        soup("collinear", (0..200).flat_map(|_| line(&mut noise)).collect()),
        soup(
            "far apart",
            [[0, 0, 0], [1, 0, 0], [0, 1, 0]].map(|p| p.map(|x| x + 100_000)).into_iter().chain(triangle).collect(),
        ),
        needles(&mut noise),
        fan(),
        sheet(40),
    ]
}

/// Around the mesh, far from it, and exactly on vertices and centroids of three grid cells' width.
fn queries(mesh: &GridMesh) -> Vec<Point> {
    let mut noise = Noise(11);
    let reach = mesh.points.as_flattened().iter().map(|x| x.abs()).max().unwrap_or(1).max(1);
    let mut queries = noise.points(150, reach + reach / 2);
    queries.extend(noise.points(20, 100 * reach.min(1000)));
    queries.extend(mesh.points.iter().step_by(mesh.points.len().div_ceil(60)));
    let near = |&p: &Point| [p[0] + 1, p[1] - 1, p[2] + 2];
    queries.extend(mesh.points.iter().step_by(mesh.points.len().div_ceil(60)).map(near));
    queries
}

#[test]
fn one_triangle_all_regions() {
    let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let mesh = TriMesh::new(&positions, &[[0, 1, 2]], "source").unwrap();
    let index = SurfaceIndex::new(&mesh);
    let cases = [
        ([0.25, 0.25, 2.0], [0.5, 0.25, 0.25], 2.0),
        ([-1.0, -1.0, 0.0], [1.0, 0.0, 0.0], 2.0_f64.sqrt()),
        ([2.0, -1.0, 0.0], [0.0, 1.0, 0.0], 2.0_f64.sqrt()),
        ([0.5, -3.0, 0.0], [0.5, 0.5, 0.0], 3.0),
        ([1.0, 1.0, 0.0], [0.0, 0.5, 0.5], 0.5_f64.sqrt()),
        ([0.0, 1.0, 0.0], [0.0, 0.0, 1.0], 0.0),
    ];
    for (query, barycentric, distance) in cases {
        let expected = SurfacePoint { triangle: 0, barycentric, distance };
        assert_eq!(index.closest_point(query), expected, "query {query:?}");
    }
}

#[test]
fn agrees_with_brute_force() {
    for mesh in meshes() {
        check(&mesh, AS_IT_IS, &queries(&mesh));
    }
}

#[test]
fn agrees_at_any_scale_and_offset() {
    for scale in [2.0_f64.powi(-27), 2.0_f64.powi(-20), 2.0_f64.powi(20)] {
        for offset in [[0; 3], [4_000_000, -3_000_000, 1_000_000]] {
            for mesh in meshes() {
                check(&mesh, Placement { scale, offset }, &queries(&mesh));
            }
        }
    }
}

proptest! {
    #[test]
    fn agrees_on_any_soup(
        corners in proptest::collection::vec(prop::array::uniform3(-20_i64..20), 3..120),
        queries in proptest::collection::vec(prop::array::uniform3(-40_i64..40), 1..30),
    ) {
        check(&soup("any", corners), AS_IT_IS, &queries);
    }
}

#[test]
fn of_equal_triangles_the_first_is_taken() {
    let mesh = sheet(20);
    let count = mesh.triangles.len() as u32;
    let tripled = GridMesh { name: "tripled", points: mesh.points.clone(), triangles: mesh.triangles.repeat(3) };
    let positions = AS_IT_IS.place(&tripled.points);
    let surface = TriMesh::new(&positions, &tripled.triangles, "tripled").unwrap();
    let found = SurfaceIndex::new(&surface).closest_points(&AS_IT_IS.place(&queries(&mesh)));
    assert!(found.iter().all(|answer| answer.triangle < count));
}

#[test]
fn neither_threads_nor_order_change_a_bit() {
    for mesh in meshes() {
        let positions = AS_IT_IS.place(&mesh.points);
        let surface = TriMesh::new(&positions, &mesh.triangles, mesh.name).unwrap();
        let queries = AS_IT_IS.place(&queries(&mesh).repeat(5));
        let answer = |threads: usize, queries: &[[f32; 3]]| {
            let pool = ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| SurfaceIndex::new(&surface).closest_points(queries))
        };
        let expected = answer(1, &queries);
        assert_eq!(answer(4, &queries), expected, "{}: threads", mesh.name);
        let backwards: Vec<_> = queries.iter().rev().copied().collect();
        let found: Vec<_> = answer(3, &backwards).into_iter().rev().collect();
        assert_eq!(found, expected, "{}: order", mesh.name);
        let index = SurfaceIndex::new(&surface);
        let one_by_one: Vec<_> = queries.iter().map(|&q| index.closest_point(q)).collect();
        assert_eq!(one_by_one, expected, "{}: one by one", mesh.name);
    }
}

#[test]
fn a_part_of_the_mesh_answers_with_the_meshs_triangles() {
    let mesh = sheet(30);
    let positions = AS_IT_IS.place(&mesh.points);
    let surface = TriMesh::new(&positions, &mesh.triangles, "sheet").unwrap();
    let part: Vec<u32> = (0..mesh.triangles.len() as u32).rev().filter(|t| t % 7 < 2).collect();
    let alone = GridMesh {
        name: "part",
        points: mesh.points.clone(),
        triangles: part.iter().map(|&t| mesh.triangles[t as usize]).collect(),
    };
    let index = SurfaceIndex::of_triangles(&surface, &part).unwrap();
    for (q, placed) in queries(&mesh).into_iter().zip(AS_IT_IS.place(&queries(&mesh))) {
        let answer = index.closest_point(placed);
        assert!(part.contains(&answer.triangle));
        assert!((answer.distance.powi(2) - squared_by_brute_force(&alone, q)).abs() < 1e-6);
        check_consistent(&surface, placed, &answer);
    }
    assert!(SurfaceIndex::of_triangles(&surface, &[]).is_none());
}

#[test]
fn a_million_identical_triangles() {
    let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let triangles = vec![[0, 1, 2]; 1_000_000];
    let mesh = TriMesh::new(&positions, &triangles, "source").unwrap();
    let answer = SurfaceIndex::new(&mesh).closest_point([0.25, 0.25, 2.0]);
    assert_eq!(answer, SurfacePoint { triangle: 0, barycentric: [0.5, 0.25, 0.25], distance: 2.0 });
}

#[test]
fn no_queries_and_queries_beyond_all_bounds() {
    let one = soup("one triangle", vec![[0, 0, 0], [9, 1, 0], [2, 7, 3]]);
    for mesh in [one, sheet(10)] {
        let positions = AS_IT_IS.place(&mesh.points);
        let index = SurfaceIndex::new(&TriMesh::new(&positions, &mesh.triangles, mesh.name).unwrap());
        assert!(index.closest_points(&[]).is_empty());
        let odd = [[f32::NAN, 0.0, 0.0], [0.0, f32::INFINITY, 0.0], [f32::MAX; 3], [3.0, 3.0, 0.0]];
        let found = index.closest_points(&odd);
        assert!(!found[0].distance.is_finite() && !found[1].distance.is_finite());
        assert!((found[2].distance / f64::from(f32::MAX) - 3.0_f64.sqrt()).abs() < 1e-9);
        assert_eq!(found[3], index.closest_point(odd[3]));
    }
}

#[test]
fn meshes_as_large_as_numbers_go() {
    let positions = [[-f32::MAX, 0.0, 0.0], [f32::MAX, 0.0, 0.0], [0.0, f32::MAX, f32::MAX]];
    let mesh = TriMesh::new(&positions, &[[0, 1, 2]], "source").unwrap();
    let answer = SurfaceIndex::new(&mesh).closest_point([0.0; 3]);
    assert!(answer.distance < 1e-9 * f64::from(f32::MAX), "{answer:?}");
}

// Cheapest points: what adds to the squared distance here is a price per triangle, so that brute force can tell.

fn price(t: u32) -> f64 {
    f64::from(t.wrapping_mul(2_654_435_761) % 1000) * 2e-4
}

/// Closest point of one triangle by its own index of one triangle, which the tests above hold against exact arithmetic.
fn priced_by_brute_force(mesh: &TriMesh<'_>, query: [f32; 3]) -> Vec<(u32, f64, f64)> {
    let price_of = |t: u32| {
        let one = SurfaceIndex::of_triangles(mesh, &[t]).expect("one triangle").closest_point(query);
        (t, one.distance, one.distance * one.distance + price(t))
    };
    (0..mesh.triangles().len() as u32).map(price_of).collect()
}

#[test]
fn ties_within_a_tolerance_are_those_of_brute_force() {
    let (positions, triangles) = scattered_triangles();
    let mesh = TriMesh::new(&positions, &triangles, "source").expect("a sound mesh");
    let index = SurfaceIndex::new(&mesh);
    let queries: Vec<[f32; 3]> = (0..200).map(|i| wave_point(31 * i + 5)).collect();
    let (mut counts, mut more_than_near) = ([0, 0], 0);
    for tolerance in [1e-6, 1e-3, 0.02] {
        let (closest, ties) = index.closest_points_and_ties(&queries, tolerance);
        assert_eq!(closest, index.closest_points(&queries));
        for (i, query) in queries.iter().enumerate() {
            let all = priced_by_brute_force(&mesh, *query);
            let least = closest[i].distance;
            let within = |limit: f64| all.iter().filter(|&&(_, d, _)| d <= limit).count() as u32 - 1;
            // The square of a little more than the least and the tolerance.
            let more = (least * least * (1.0 + 1e-4) + tolerance * tolerance * (1.0 + 1e4)).sqrt();
            assert!(ties[i] >= within(least + tolerance), "query {i}, {tolerance}: {}", ties[i]);
            more_than_near += u32::from(ties[i] > within(more));
            counts[usize::from(ties[i] > 0)] += 1;
        }
    }
    assert!(counts[0] > 50 && counts[1] > 50, "{counts:?}");
    // What was as near as the nearest one when it was looked at still counts.
    assert!(more_than_near < 20, "{more_than_near}");
}

fn wave_point(i: u32) -> [f32; 3] {
    let wave = |i: u32| ((i as f32 * 12.9898).sin() * 43_758.547).fract();
    [wave(3 * i), wave(3 * i + 1), wave(3 * i + 2)]
}

/// 300 small triangles in a box of side 2.
fn scattered_triangles() -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
    let corner =
        |t: u32, k: u32| std::array::from_fn(|axis| wave_point(t)[axis] + 0.1 * wave_point(7919 * (3 * t + k))[axis]);
    let positions = (0..900).map(|i| corner(i / 3, i % 3)).collect();
    (positions, (0..300).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect())
}

#[test]
fn cheapest_points_are_those_of_brute_force() {
    let (positions, triangles) = scattered_triangles();
    let mesh = TriMesh::new(&positions, &triangles, "source").expect("a sound mesh");
    let index = SurfaceIndex::new(&mesh);
    let mut queries: Vec<_> = (0..200).map(|i| wave_point(31 * i + 5)).collect();
    queries.push([f32::NAN, 0.0, 0.0]);
    let slack = 1.2;
    let bounds: Vec<_> =
        (0..queries.len()).map(|i| Bound { near: 1e-3 * i as f64, cost: 0.05 + 1e-3 * i as f64 }).collect();
    let cost = |_, p: &SurfacePoint| p.distance * p.distance + price(p.triangle);
    let finish = |_, found: &[Priced]| found.to_vec();
    let found = index.cheapest_points(&queries, &bounds, slack, cost, finish);
    for (i, (query, found)) in std::iter::zip(&queries[..200], &found).enumerate() {
        let all = priced_by_brute_force(&mesh, *query);
        let least = all.iter().map(|&(_, _, cost)| cost).fold(f64::INFINITY, f64::min);
        let counts = |&&(_, distance, cost): &&(u32, f64, f64)| {
            distance * distance <= bounds[i].near || cost <= bounds[i].cost.min(slack * least)
        };
        let expected: Vec<u32> = all.iter().filter(counts).map(|&(t, _, _)| t).collect();
        assert_eq!(found.iter().map(|p| p.point.triangle).collect::<Vec<_>>(), expected, "query {i}");
    }
    assert!(found[200].is_empty());
    let alone = ThreadPoolBuilder::new().num_threads(1).build().expect("a pool");
    assert_eq!(alone.install(|| index.cheapest_points(&queries, &bounds, slack, cost, finish)), found);
    let reversed: Vec<_> = queries.iter().rev().copied().collect();
    let bounds: Vec<_> = bounds.iter().rev().copied().collect();
    let mut backwards = index.cheapest_points(&reversed, &bounds, slack, cost, finish);
    backwards.reverse();
    assert_eq!(backwards, found);
}
