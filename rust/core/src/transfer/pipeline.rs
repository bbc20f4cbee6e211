//! The steps of a transfer: constraints -> fill -> smooth -> islands -> limit.

use super::islands::Scene;
use super::matching::{DISTANCE_REFERENCE, Terms};
use super::report::{Report, Stages};
use super::smooth::{push_normalised, region, smooth};
use super::{
    Criteria, Inpainting, IslandPolicy, Length, MaskValue, MatchMethod, Settings, Transfer, detail, near, small_islands,
};
use crate::adjacency::NONE;
use crate::error::{Error, Result};
use crate::fill::{Assembled, Constraint, Fill, Filled, Row, Screen};
use crate::limit::limit;
use crate::mesh::TriMesh;
use crate::progress::Progress;
use crate::weights::Weights;

/// Where nothing matches at all, a target farther away than this share of the source's diagonal is a mistake, say of units.
const OUT_OF_REACH: f64 = 0.5;

/// Constraints and lengths of one solve.
pub(super) struct Problem {
    pub criteria: Criteria,
    pub smoothness_length: f64,
    /// What is known of each vertex that is solved on.
    pub constraints: Vec<Constraint>,
    /// Whether anything is known on each island.
    pub has_match: Vec<bool>,
}

impl Problem {
    /// Decides what is known, and which islands hang on nothing.
    pub fn new(prepared: &Inpainting, mask: Option<&[MaskValue]>, settings: &Settings) -> Result<Self> {
        let terms = terms(prepared, settings);
        let (criteria, constraints) = (terms.criteria, prepared.matches.constraints(&terms, mask));
        let islands = prepared.target.fill.islands();
        let mut has_match = vec![false; islands.count()];
        let known = std::iter::zip(islands.of_vertex(), &constraints);
        for (&island, _) in known.filter(|&(&island, c)| island != NONE && c.is_known()) {
            has_match[island as usize] = true;
        }
        if !has_match.contains(&true) && !can_do_without_match(prepared, mask, settings) {
            return Err(nothing_matched(prepared, &criteria, mask, settings));
        }
        let smoothness_length = match settings.method {
            MatchMethod::ClosestPoint => settings.smoothness_length.of(prepared.source.diagonal()),
            // Solving several times is what makes it smooth.
            MatchMethod::Confidence => 0.0,
        };
        Ok(Self { criteria, smoothness_length, constraints, has_match })
    }

    /// Poses the problem; what is missing waits to be factored.
    pub fn assemble(&self, prepared: &mut Inpainting, progress: &Progress) -> Result<Assembled> {
        let (constraints, fill) = (self.constraints.clone(), &mut prepared.target.fill);
        match prepared.matches.method() {
            MatchMethod::ClosestPoint => fill.assemble(constraints, self.smoothness_length, progress),
            MatchMethod::Confidence => fill.assemble_screened(constraints, progress),
        }
    }

    /// Whether vertex `i` is on an island where anything is known.
    pub fn is_reached(&self, fill: &Fill, i: usize) -> bool {
        let island = fill.islands().of_vertex()[i];
        self.has_match.get(island as usize).is_some_and(|&has_match| has_match)
    }
}

/// What makes constraints of the points that were found.
pub(super) fn terms<'a>(prepared: &'a Inpainting, settings: &Settings) -> Terms<'a> {
    let criteria = Criteria::new(settings, &prepared.source, &prepared.target);
    Terms { criteria, softness: settings.softness, fill: &prepared.target.fill }
}

/// Whether the policy for islands has an answer where nothing matches: it has one near the body, unless the mask forbids
/// every vertex to match.
fn can_do_without_match(prepared: &Inpainting, mask: Option<&[MaskValue]>, settings: &Settings) -> bool {
    let is_allowed = |i: usize| mask.is_none_or(|mask| mask[i] != MaskValue::Inpaint);
    let reach = OUT_OF_REACH * prepared.source.diagonal();
    let mut distances = prepared.matches.weighted_distances(is_allowed);
    settings.island_policy != IslandPolicy::Skip && distances.any(|distance| distance <= reach)
}

fn nothing_matched(
    prepared: &Inpainting,
    criteria: &Criteria,
    mask: Option<&[MaskValue]>,
    settings: &Settings,
) -> Error {
    let needed = prepared.matches.smallest_matching_distance(criteria, mask);
    let reference = Criteria::distance_reference(&prepared.source, &prepared.target);
    let relative = |needed: f64| match settings.max_distance {
        Length::Relative(_) => format!(" ({:.4} of {DISTANCE_REFERENCE})", needed / reference),
        Length::Absolute(_) => String::new(),
    };
    let advice = match needed {
        Some(needed) => format!("the smallest distance that matches something is {needed:.6}{}", relative(needed)),
        None => "no distance would help: check the mask, the largest normal angle and the source's weights".into(),
    };
    Error::NothingMatched { max_distance: criteria.max_distance, needed, advice }
}

/// Transfers the weights, on the mesh that is solved on.
pub(super) fn solve(
    prepared: &mut Inpainting,
    mask: Option<&[MaskValue]>,
    settings: &Settings,
    progress: &Progress,
) -> Result<Transfer> {
    let mut stages = Stages::start();
    let problem = Problem::new(prepared, mask, settings)?;
    let assembled = problem.assemble(prepared, progress)?;
    let factored_blocks = assembled.missing_blocks();
    stages.end("assemble");
    prepared.target.fill.factor(assembled, progress)?;
    progress.report(0.7);
    progress.check()?;
    stages.end("factor");
    let keeps = near::keeps(prepared, settings);
    let ((weights, report), found) = filled(prepared, &problem, mask, keeps, progress, |filled| {
        let (raw_minimum, largest_residual) = (filled.minimum(), filled.largest_residual());
        let report = Report { raw_minimum, largest_residual, factored_blocks, ..Report::default() };
        ((gather(prepared, filled), report), keeps.then(|| filled.found()))
    })?;
    let confidence = prepared.matches.confidence(&problem.constraints, settings.softness, mask);
    let report = report.of_problem(prepared, &problem, &trusted(&confidence));
    stages.end("solve");
    let weights = inpaint_masked(prepared, weights, &problem, mask, settings, progress)?;
    stages.end("inpaint");
    prepared.base = found.map(|found| near::Base::new(&problem, mask, settings, found, &weights));
    finish(prepared, Solved { problem, weights, confidence, report, stages }, settings, progress)
}

/// What has been solved, before islands without a match have their weights.
pub(super) struct Solved {
    pub problem: Problem,
    pub weights: Weights,
    pub confidence: Vec<f32>,
    pub report: Report,
    pub stages: Stages,
}

/// The steps after filling: smoothing, islands, limit.
pub(super) fn finish(
    prepared: &Inpainting,
    solved: Solved,
    settings: &Settings,
    progress: &Progress,
) -> Result<Transfer> {
    let Solved { problem, weights, confidence, report, mut stages } = solved;
    let weights = smoothed(prepared, weights, &problem, settings, progress)?;
    stages.end("smooth");
    progress.check()?;
    let (weights, rigid_islands) = stiffened(prepared, weights, settings);
    let surface = prepared.target.fill.triangles_and_wires();
    let (weights, unmatched_islands) =
        scene(prepared, &problem, &surface).fill(weights, settings.island_policy, progress)?;
    let weights = limit(weights, settings.max_influences);
    stages.end("islands and limit");
    let seconds = prepared.preparation.iter().copied().chain(stages.into_seconds()).collect();
    let report = Report { unmatched_islands, rigid_islands, seconds, ..report };
    let (distances, angles) = (prepared.matches.distances(), prepared.matches.angles().to_vec());
    let matched = trusted(&confidence);
    Ok(Transfer { report: report.counting(&weights), weights, matched, confidence, distances, angles })
}

/// Solves the problem that is factored and hands all rows to `take`.
pub(super) fn filled<T>(
    prepared: &Inpainting,
    problem: &Problem,
    mask: Option<&[MaskValue]>,
    with_all_solves: bool,
    progress: &Progress,
    take: impl FnOnce(&Filled<'_>) -> T,
) -> Result<T> {
    let Inpainting { source, matches, target, .. } = prepared;
    let own = |i: u32, row: &mut Row| matches.append_row(source, mask, i, row);
    if matches.method() == MatchMethod::ClosestPoint {
        return Ok(take(&target.fill.solve(&own, progress)?));
    }
    let fill = &target.fill;
    let rows = fill.row_table(&own);
    let kept = detail::kept(source, matches, fill, &problem.constraints, &rows);
    let own = |i: u32, row: &mut Row| row.extend(rows.of(i as usize));
    let screen = Screen { rows: &rows, kept: &kept, patch: None, with_all_solves };
    Ok(take(&fill.solve_screened(&own, screen, progress)?))
}

/// With [`MatchMethod::Confidence`], vertices that the mask says to inpaint are filled in last, by the paper's energy between
/// the rows of all others.
fn inpaint_masked(
    prepared: &mut Inpainting,
    weights: Weights,
    problem: &Problem,
    mask: Option<&[MaskValue]>,
    settings: &Settings,
    progress: &Progress,
) -> Result<Weights> {
    let Some(mask) = mask.filter(|mask| mask.contains(&MaskValue::Inpaint)) else { return Ok(weights) };
    if settings.method == MatchMethod::ClosestPoint {
        return Ok(weights);
    }
    let constraint = |(&known, &mask): (&Constraint, &MaskValue)| match mask {
        MaskValue::Automatic | MaskValue::ForceMatch if known.is_known() => Constraint::Fixed,
        _ => Constraint::Free,
    };
    let constraints = std::iter::zip(&problem.constraints, mask).map(constraint).collect();
    inpaint(prepared, constraints, &weights, settings, progress, gather)
}

/// Fills in the free vertices by the paper's energy, between the rows that `weights` has for the others, and hands all rows to
/// `take`.
pub(super) fn inpaint<T>(
    prepared: &mut Inpainting,
    constraints: Vec<Constraint>,
    weights: &Weights,
    settings: &Settings,
    progress: &Progress,
    take: impl FnOnce(&Inpainting, &Filled<'_>) -> T,
) -> Result<T> {
    let length = settings.smoothness_length.of(prepared.source.diagonal());
    let fill = &mut prepared.target.fill;
    let assembled = fill.assemble(constraints, length, progress)?;
    fill.factor(assembled, progress)?;
    let given = |i: u32, row: &mut Row| {
        let (bones, values) = weights.row(i as usize);
        row.extend(std::iter::zip(bones, values).map(|(&bone, &value)| (bone, f64::from(value))));
    };
    let filled = prepared.target.fill.solve(&given, progress)?;
    Ok(take(prepared, &filled))
}

fn stiffened(prepared: &Inpainting, weights: Weights, settings: &Settings) -> (Weights, usize) {
    if !settings.stiffens() {
        return (weights, 0);
    }
    let gaps: Vec<f64> = prepared.matches.points().iter().map(|point| point.distance).collect();
    small_islands::stiffen(weights, &prepared.target.fill, &gaps, prepared.source.size())
}

/// Clamps and normalises the rows; those of islands without a match stay empty.
fn gather(prepared: &Inpainting, filled: &Filled<'_>) -> Weights {
    let count = prepared.target.fill.unknown().len();
    Weights::from_rows(count, prepared.source.n_bones(), Vec::new, |row, i, out| {
        row.clear();
        filled.append_row(i, row);
        push_normalised(row, out);
    })
}

fn smoothed(
    prepared: &Inpainting,
    weights: Weights,
    problem: &Problem,
    settings: &Settings,
    progress: &Progress,
) -> Result<Weights> {
    if settings.smoothing_iterations == 0 || settings.smoothing_factor == 0.0 {
        return Ok(weights);
    }
    let fill = &prepared.target.fill;
    let region = region(&fill.mesh(), fill.laplacian(), fill.unknown(), problem.criteria.max_distance);
    smooth(weights, fill.laplacian(), &region, settings.smoothing_iterations, settings.smoothing_factor, progress)
}

fn scene<'a>(prepared: &'a Inpainting, problem: &'a Problem, surface: &'a [[u32; 3]]) -> Scene<'a> {
    Scene {
        source: &prepared.source,
        mesh: TriMesh::of_checked(prepared.target.fill.mesh().positions(), surface),
        islands: prepared.target.fill.islands(),
        points: prepared.matches.points(),
        has_match: &problem.has_match,
        max_distance: problem.criteria.max_distance,
    }
}

/// Which vertices trust the source's row by a half or more.
pub(super) fn trusted(confidence: &[f32]) -> Vec<bool> {
    confidence.iter().map(|&confidence| confidence >= 0.5).collect()
}
