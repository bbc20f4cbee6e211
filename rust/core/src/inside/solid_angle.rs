//! The solid angle of one triangle.

use glam::DVec3;

/// Half the signed solid angle under which the triangle is seen from the origin, positive from behind its normal, i.e.
/// from inside of a closed surface (A. Van Oosterom, J. Strackee: The solid angle of a plane triangle. IEEE Transactions
/// on Biomedical Engineering 30(2), 1983).
///
/// Zero, not NaN, where a corner is the origin.
pub(super) fn half_solid_angle([a, b, c]: [DVec3; 3]) -> f64 {
    let (la, lb, lc) = (a.length(), b.length(), c.length());
    let volume = a.dot(b.cross(c));
    let denominator = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
    volume.atan2(denominator)
}
