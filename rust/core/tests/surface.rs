//! Closest points against a brute-force search.

use skinwright_core::TriMesh;
use skinwright_core::surface::{SurfaceIndex, SurfacePoint};

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
