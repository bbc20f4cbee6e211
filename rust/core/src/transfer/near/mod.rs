//! The neighbourhood of a stroke of the mask, solved again by itself, so that an artist sees at once what it does.
//!
//! What a stroke changes dies away within a few of the lengths that rows are trusted over. The last solve of the whole mesh is
//! kept; after a stroke the vertices within a few such lengths of the change are solved, at most [`MOST`] of them, held
//! around at what was found before ([`Patch`]). Rows farther away stay. The exact answer is another solve of the whole, which
//! does not depend on what came before; the caller asks for it once the artist has seen this one.

mod region;

use region::{MOST, Region};

use super::pipeline::{self, Problem, Solved, trusted};
use super::report::Stages;
use super::smooth::push_normalised;
use super::{Inpainting, MaskValue, MatchMethod, Report, Settings, Transfer, detail};
use crate::error::Result;
use crate::fill::{Constraint, Fill, Found, Patch, Row, Screen};
use crate::progress::Progress;
use crate::weights::Weights;

/// Rows whose weights change by less stay as they are: to write them would take longer than to see a difference.
const NOTICEABLE: f32 = 1e-4;
/// Fewer unknowns than this are solved as fast as a whole.
const FEW: usize = 2 * MOST;
/// With more, what would have to be kept takes too much memory.
const MANY: usize = 300_000;

/// A solve of the whole mesh.
#[derive(Debug)]
pub(super) struct Base {
    settings: Settings,
    mask: Option<Vec<MaskValue>>,
    constraints: Vec<Constraint>,
    found: Found,
    /// The rows, before anything is done about islands.
    weights: Weights,
}

impl Base {
    pub fn new(
        problem: &Problem,
        mask: Option<&[MaskValue]>,
        settings: &Settings,
        found: Found,
        weights: &Weights,
    ) -> Self {
        let (mask, constraints) = (mask.map(<[MaskValue]>::to_vec), problem.constraints.clone());
        Self { settings: settings.clone(), mask, constraints, found, weights: weights.clone() }
    }

    fn mask(&self, i: usize) -> MaskValue {
        of_mask(self.mask.as_deref(), i)
    }

    /// The vertices of which something else is known now.
    fn changed(&self, problem: &Problem, mask: Option<&[MaskValue]>) -> Vec<u32> {
        let differs = |i: usize| {
            let (now, before) = (of_mask(mask, i), self.mask(i));
            problem.constraints[i] != self.constraints[i] || now != before
        };
        (0..self.constraints.len()).filter(|&i| differs(i)).map(|i| i as u32).collect()
    }
}

fn of_mask(mask: Option<&[MaskValue]>, i: usize) -> MaskValue {
    mask.map_or(MaskValue::Automatic, |mask| mask[i])
}

/// Whether the solve of a problem that is factored is worth keeping.
pub(super) fn keeps(prepared: &Inpainting, settings: &Settings) -> bool {
    let unknowns = || prepared.target.fill.unknown().iter().filter(|&&unknown| unknown).count();
    prepared.keeps_solves
        && settings.method == MatchMethod::Confidence
        && settings.smoothing_iterations == 0
        && (FEW..=MANY).contains(&unknowns())
}

/// Solves near what has changed since the kept solve, on the mesh that is solved on; None if the whole is to be solved.
///
/// # Errors
/// Those of [`Inpainting::solve`].
pub(super) fn solve(
    prepared: &mut Inpainting,
    mask: Option<&[MaskValue]>,
    settings: &Settings,
    progress: &Progress,
) -> Result<Option<Transfer>> {
    let Some(base) = prepared.base.take().filter(|base| base.settings == *settings) else { return Ok(None) };
    let transfer = solve_from(prepared, &base, mask, settings, progress);
    prepared.base = Some(base);
    transfer
}

fn solve_from(
    prepared: &mut Inpainting,
    base: &Base,
    mask: Option<&[MaskValue]>,
    settings: &Settings,
    progress: &Progress,
) -> Result<Option<Transfer>> {
    let mut stages = Stages::start();
    let problem = Problem::new(prepared, mask, settings)?;
    let changed = base.changed(&problem, mask);
    if changed.len() > MOST / 3 || lacks_rows(prepared, &problem, mask) {
        return Ok(None);
    }
    let region = Region::around(&prepared.target.fill, &problem, &changed, prepared.source.size());
    stages.end("assemble");
    let (weights, report) = screened(prepared, base, &problem, mask, &region, progress)?;
    let confidence = prepared.matches.confidence(&problem.constraints, settings.softness, mask);
    let report = report.of_problem(prepared, &problem, &trusted(&confidence));
    let report = Report { solved_near: Some(region.vertices.len()), ..report };
    stages.end("solve");
    let weights = inpainted(prepared, weights, &problem, mask, &region, settings, progress)?;
    stages.end("inpaint");
    let solved = Solved { problem, weights, confidence, report, stages };
    pipeline::finish(prepared, solved, settings, progress).map(Some)
}

/// Whether vertices that the mask leaves alone have no row: where there is a mask, they are inpainted too, which changes with
/// its first stroke.
fn lacks_rows(prepared: &Inpainting, problem: &Problem, mask: Option<&[MaskValue]>) -> bool {
    let unknown = |i: usize| problem.constraints[i] == Constraint::Free && of_mask(mask, i) != MaskValue::Inpaint;
    (0..problem.constraints.len()).any(|i| unknown(i) && problem.is_reached(&prepared.target.fill, i))
}

/// The rows of all vertices, those of the region solved again.
fn screened(
    prepared: &mut Inpainting,
    base: &Base,
    problem: &Problem,
    mask: Option<&[MaskValue]>,
    region: &Region,
    progress: &Progress,
) -> Result<(Weights, Report)> {
    let known = &problem.constraints;
    let of_region = |i: usize| if region.contains[i] { known[i] } else { Constraint::Fixed };
    let constraints: Vec<Constraint> = (0..known.len()).map(of_region).collect();
    let fill = &mut prepared.target.fill;
    let assembled = fill.assemble_screened(constraints.clone(), progress)?;
    let factored_blocks = assembled.missing_blocks();
    fill.factor(assembled, progress)?;
    progress.report(0.5);
    let Inpainting { source, matches, target, .. } = &*prepared;
    let fill = &target.fill;
    let wider = region.widened(fill);
    let own = |i: u32, row: &mut Row| {
        if wider[i as usize] && known[i as usize].is_known() {
            matches.append_row(source, mask, i, row);
        }
    };
    let rows = fill.row_table(&own);
    let kept = detail::kept(source, matches, fill, &constraints, &rows);
    let is_held: Vec<bool> = (0..known.len()).map(|i| !region.contains[i] && known[i] != Constraint::Fixed).collect();
    let patch = Some(Patch { found: &base.found, is_held: &is_held });
    let given = |i: u32, row: &mut Row| row.extend(rows.of(i as usize));
    let screen = Screen { rows: &rows, kept: &kept, patch, with_all_solves: false };
    let filled = fill.solve_screened(&given, screen, progress)?;
    let (raw_minimum, largest_residual) = (filled.minimum(), filled.largest_residual());
    let report = Report { raw_minimum, largest_residual, factored_blocks, ..Report::default() };
    let append = |i: usize, row: &mut Row| filled.append_row(i, row);
    Ok((replaced(&base.weights, &region.contains, append), report))
}

/// The rows of `weights`, those `chosen` (V) replaced by what `append` appends, clamped and normalised.
fn replaced(weights: &Weights, chosen: &[bool], append: impl Fn(usize, &mut Row) + Sync) -> Weights {
    Weights::from_rows(weights.vertex_count(), weights.n_bones(), Vec::new, |row, i, out| {
        if chosen[i] {
            row.clear();
            append(i, row);
            push_normalised(row, out);
        }
        if !chosen[i] || is_nearly(out, weights.row(i)) {
            out.clear();
            out.extend(std::iter::zip(weights.row(i).0, weights.row(i).1).map(|(&bone, &value)| (bone, value)));
        }
    })
}

/// Whether no weight of a row differs noticeably from that of another, both by bone.
fn is_nearly(row: &[(u32, f32)], (bones, values): (&[u32], &[f32])) -> bool {
    let mut others = std::iter::zip(bones, values).peekable();
    for &(bone, value) in row {
        while let Some((_, &other)) = others.next_if(|&(&other, _)| other < bone) {
            if other >= NOTICEABLE {
                return false;
            }
        }
        let other = others.next_if(|&(&other, _)| other == bone).map_or(0.0, |(_, &other)| other);
        if (value - other).abs() >= NOTICEABLE {
            return false;
        }
    }
    row.is_empty() == bones.is_empty() && others.all(|(_, &other)| other < NOTICEABLE)
}

/// The vertices that the mask says to inpaint are filled in, where anything has changed around them.
fn inpainted(
    prepared: &mut Inpainting,
    weights: Weights,
    problem: &Problem,
    mask: Option<&[MaskValue]>,
    region: &Region,
    settings: &Settings,
    progress: &Progress,
) -> Result<Weights> {
    let chosen = touched(&prepared.target.fill, mask, region);
    if !chosen.contains(&true) {
        return Ok(weights);
    }
    let is_open = |i: usize| chosen[i] || !problem.is_reached(&prepared.target.fill, i);
    let constraint = |i: usize| if is_open(i) { Constraint::Free } else { Constraint::Fixed };
    let constraints = (0..chosen.len()).map(constraint).collect();
    pipeline::inpaint(prepared, constraints, &weights, settings, progress, |_, filled| {
        replaced(&weights, &chosen, |i, row| filled.append_row(i, row))
    })
}

/// Which vertices that the mask says to inpaint hang together with the region, (V): the energy couples two-rings.
fn touched(fill: &Fill, mask: Option<&[MaskValue]>, region: &Region) -> Vec<bool> {
    let mut chosen = vec![false; region.contains.len()];
    let Some(mask) = mask.filter(|mask| mask.contains(&MaskValue::Inpaint)) else { return chosen };
    let mut open = region.vertices.clone();
    while let Some(i) = open.pop() {
        let mut reach = |j: u32| {
            if mask[j as usize] == MaskValue::Inpaint && !std::mem::replace(&mut chosen[j as usize], true) {
                open.push(j);
            }
        };
        // Every vertex is its neighbours' neighbour.
        for &j in fill.laplacian().neighbours(i as usize) {
            reach(j);
            fill.laplacian().neighbours(j as usize).iter().for_each(|&k| reach(k));
        }
    }
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;

    /// All rows of three bones with these values, 0 being no member.
    fn rows() -> Vec<[f32; 3]> {
        let values = [0.0, 3e-5, 9e-5, 1.1e-4, 1.3e-4, 0.5];
        (0..216).map(|k| [values[k % 6], values[k / 6 % 6], values[k / 36]]).collect()
    }

    fn members(row: [f32; 3]) -> Vec<(u32, f32)> {
        std::iter::zip(0.., row).filter(|&(_, value)| value > 0.0).collect()
    }

    #[test]
    fn rows_are_nearly_equal_if_no_weight_differs_noticeably() {
        for first in rows() {
            for second in rows() {
                let (bones, values): (Vec<u32>, Vec<f32>) = members(second).into_iter().unzip();
                let differs = std::iter::zip(first, second).any(|(x, y)| (x - y).abs() >= 1e-4);
                let is_one_empty = members(first).is_empty() != members(second).is_empty();
                let expected = !differs && !is_one_empty;
                assert_eq!(is_nearly(&members(first), (&bones, &values)), expected, "{first:?} {second:?}");
            }
        }
    }
}
