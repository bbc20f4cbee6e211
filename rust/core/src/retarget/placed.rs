//! The target brought into the source's pose and proportions, and the match of each of its vertices there.

use glam::{DVec3, Vec3};

use super::prepared::Prepared;
use super::rows::Row;
use crate::error::Result;
use crate::progress::Progress;
use crate::registration::{Lengths, Match, MatchPoints, Matching, Schedule, register};

/// Length over which normals are smoothed for the final match, as a share of the source's diagonal.
const NORMAL_SMOOTHING: f64 = 0.02;
/// The same while surfaces are fitted: there knees and elbows tell where along a limb a vertex is.
const FITTING_SMOOTHING: f64 = 0.003;
/// How far apart normals that differ by a unit count while surfaces are fitted, as a share of the source's diagonal.
const FITTING_NORMAL: f64 = 0.06;
/// The rounds of the fitting; more of them gain nothing.
const ROUNDS: Schedule<'static> = Schedule { lengths: &[0.12, 0.06, 0.03], trusted: 0.04 };
/// How far vertices follow the weights of their first match.
const FOLLOW: f64 = 0.5;
/// Length of bones, as a share of the source's diagonal, whose vertices go half of the way of the fitting.
const HALF_FITTED: f64 = 0.09;
/// Power with which shorter bones hold their vertices.
const HOLDING: i32 = 4;
/// Share of equal triangles from which two meshes have one topology: Blender cuts a few quads by their shape.
const SAME_TRIANGLES: f64 = 0.9;
/// Median distance from the vertex of the same number, as a share of the source's diagonal, up to which numbers are believed.
const SAME_PLACE: f64 = 0.05;

/// The target in the source's pose, and the match of each of its distinct positions (U).
#[derive(Debug)]
pub(super) struct Placed {
    pub positions: Vec<DVec3>,
    /// Smooth normals of both sides, in the source's pose.
    pub normals: Vec<Vec3>,
    pub source_normals: Vec<Vec3>,
    pub matches: Vec<Match>,
    /// How far each position is from its match (U).
    pub gaps: Vec<f64>,
    /// Whether matches are vertices of the same number.
    pub by_number: bool,
}

impl Prepared<'_> {
    /// Warps, fits and matches the target.
    pub fn place(&self, progress: &Progress) -> Result<Placed> {
        let points = self.settings.match_points;
        let mut positions = self.warp.apply(&self.target.positions);
        let lengths = self.lengths(self.settings.normal_length, NORMAL_SMOOTHING);
        let matching = self.matching(&positions, points, lengths)?;
        progress.report(0.05);
        progress.check()?;
        let rows = self.rows_of(&matching.closest(&positions)?.0);
        self.follow_weights(&rows, &mut positions);
        progress.report(0.1);
        progress.check()?;
        let same = self.settings.vertex_order && self.has_same_vertices(&positions);
        if self.settings.registration && !same {
            positions = self.fitted(&positions, &rows, progress)?;
        }
        let (mut matches, normals) = matching.closest(&positions)?;
        progress.report(0.7);
        progress.check()?;
        let source_normals = matching.source_normals().to_vec();
        if same {
            matches = self.matches_by_number(&normals, &source_normals);
        }
        let gaps = std::iter::zip(&matches, &positions).map(|(at, z)| at.position.distance(*z)).collect();
        Ok(Placed { positions, normals, source_normals, matches, gaps, by_number: same })
    }

    /// World lengths from shares of the source's diagonal.
    fn lengths(&self, normal: f64, smoothing: f64) -> Lengths {
        Lengths { normal: normal * self.size, smoothing: smoothing * self.size }
    }

    fn matching(&self, positions: &[DVec3], points: MatchPoints, lengths: Lengths) -> Result<Matching<'_>> {
        let triangles = self.characters[0].mesh.triangles();
        Matching::new(&self.source, triangles, &self.target, positions, points, lengths)
    }

    /// Moves each vertex part of the way to where its weights (U) would carry it: the nearest bones change abruptly between
    /// limbs, painted weights do not.
    fn follow_weights(&self, rows: &[Row], positions: &mut [DVec3]) {
        let carried = self.warp.apply_weighted(&self.target.positions, rows, &self.guide_of());
        positions.iter_mut().zip(carried).for_each(|(position, carried)| *position = position.lerp(carried, FOLLOW));
    }

    /// The guide of each of the target's bones.
    fn guide_of(&self) -> Vec<Option<usize>> {
        let mut guide_of = vec![None; self.characters[1].skeleton.bones().len()];
        for (k, guide) in self.guides.iter().enumerate() {
            guide.targets.iter().for_each(|&t| guide_of[t as usize] = Some(k));
        }
        guide_of
    }

    /// The `positions` (U) drawn onto the source as far as the bones of their `rows` (U) are long. A thigh says little about
    /// where along it a vertex is, and the surface much; with fingers and faces it is the other way round.
    fn fitted(&self, positions: &[DVec3], rows: &[Row], progress: &Progress) -> Result<Vec<DVec3>> {
        let lengths = self.lengths(FITTING_NORMAL, FITTING_SMOOTHING);
        let matching = self.matching(positions, MatchPoints::Surface, lengths)?;
        let watch = (progress, (0.1, 0.7));
        let fitted = register(&matching, &self.target.triangles, positions.to_vec(), self.size, ROUNDS, watch)?;
        let guide_of = self.guide_of();
        let share = |row: &Row| {
            let ratio = (self.bone_length(row, &guide_of) / (HALF_FITTED * self.size)).powi(HOLDING);
            ratio / (ratio + 1.0)
        };
        let moved = |((z, to), row): ((&DVec3, &DVec3), &Row)| z.lerp(*to, share(row));
        Ok(positions.iter().zip(&fitted).zip(rows).map(moved).collect())
    }

    /// Mean length of the source's bones that a row stands for; 0 without any.
    fn bone_length(&self, row: &Row, guide_of: &[Option<usize>]) -> f64 {
        let (mut sum, mut total) = (0.0, 0.0);
        for &(bone, share) in row {
            if let Some(k) = guide_of[bone as usize] {
                sum += share * self.guides[k].source.length;
                total += share;
            }
        }
        if total > 0.0 { sum / total } else { 0.0 }
    }

    /// Whether both meshes are one in two shapes: the same triangles, and vertices of one number at about one place, the
    /// target's being at `positions` (U).
    fn has_same_vertices(&self, positions: &[DVec3]) -> bool {
        let [source, target] = self.characters.map(|character| character.mesh);
        let (a, b) = (source.triangles(), target.triangles());
        if source.vertex_count() != target.vertex_count() || a.len() != b.len() {
            return false;
        }
        let equal = std::iter::zip(a, b).filter(|(a, b)| a == b).count();
        if (equal as f64) < SAME_TRIANGLES * a.len() as f64 {
            return false;
        }
        let mut gaps: Vec<f64> =
            std::iter::zip(&self.target.first, positions).map(|(&i, z)| self.place_of(i).distance(*z)).collect();
        let middle = gaps.len() / 2;
        *gaps.select_nth_unstable_by(middle, f64::total_cmp).1 <= SAME_PLACE * self.size
    }

    /// Where vertex `i` of the source is.
    fn place_of(&self, i: u32) -> DVec3 {
        self.source.positions[self.source.of_vertex[i as usize] as usize]
    }

    fn matches_by_number(&self, normals: &[Vec3], source_normals: &[Vec3]) -> Vec<Match> {
        let matched = |(&i, normal): (&u32, &Vec3)| {
            let cosine = source_normals[self.source.of_vertex[i as usize] as usize].dot(*normal).into();
            Match { corners: [i; 3], barycentric: [1.0, 0.0, 0.0], position: self.place_of(i), cosine }
        };
        std::iter::zip(&self.target.first, normals).map(matched).collect()
    }
}
