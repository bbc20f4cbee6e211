//! Axis-aligned boxes and the distances between them.

use glam::Vec3;

/// An axis-aligned box.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bounds {
    low: Vec3,
    high: Vec3,
}

impl Bounds {
    pub(super) const NOTHING: Self = Self { low: Vec3::INFINITY, high: Vec3::NEG_INFINITY };

    pub(super) fn of(positions: impl Iterator<Item = [f32; 3]>) -> Self {
        let around = |b: Self, p: Vec3| Self { low: b.low.min(p), high: b.high.max(p) };
        positions.map(Vec3::from).fold(Self::NOTHING, around)
    }

    /// The box around both.
    pub(super) fn and(&self, other: &Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    pub(super) fn centre(&self) -> [f32; 3] {
        self.low.midpoint(self.high).to_array()
    }

    /// Distance between the boxes, 0 where they meet.
    pub(super) fn distance(&self, other: &Self) -> f64 {
        let gap = (self.low - other.high).max(other.low - self.high).max(Vec3::ZERO);
        f64::from(gap.length())
    }

    /// Largest distance between a point of one and a point of the other.
    pub(super) fn farthest(&self, other: &Self) -> f64 {
        f64::from((self.high - other.low).max(other.high - self.low).length())
    }
}
