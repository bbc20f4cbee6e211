//! An order in which points near each other mostly have numbers near each other.

/// The place of a point of a grid along a Morton curve, which interleaves the bits of its coordinates (21 of each).
pub(super) fn morton(point: [i32; 3]) -> u64 {
    let spread = |x: i32| (0..21).fold(0u64, |bits, b| bits | u64::from((x.max(0) as u32 >> b) & 1) << (3 * b));
    spread(point[0]) | spread(point[1]) << 1 | spread(point[2]) << 2
}
