//! What a solver refuses: lengths that do not fit, numbers that are none, more members than it can take.

use super::{MAX_MEMBERS, Options};
use crate::error::{Error, Result};
use crate::weights::Weights;

pub(super) fn check_character(
    rest_positions: &[[f32; 3]],
    weights: &Weights,
    locked: &[bool],
    options: Options,
) -> Result<()> {
    check_options(options)?;
    check_length("rest_positions", rest_positions.len(), weights.vertex_count())?;
    if !locked.is_empty() {
        check_length("locked", locked.len(), weights.n_bones() as usize)?;
    }
    if let Some(vertex) = rest_positions.iter().position(|p| !p.iter().all(|x| x.is_finite())) {
        return Err(Error::PositionNotFinite { what: "rest", vertex });
    }
    for i in 0..weights.vertex_count() {
        let (bones, values) = weights.row(i);
        if bones.len() > MAX_MEMBERS {
            let reason = format!(
                "vertex {i} has {} influences, sculpting takes at most {MAX_MEMBERS}: desparsify first",
                bones.len()
            );
            return Err(Error::InvalidWeights { reason });
        }
        if let Some(at) = values.iter().position(|&x| x < 0.0) {
            return Err(Error::WeightNegative { vertex: i, bone: bones[at] });
        }
    }
    Ok(())
}

pub(super) fn check_options(options: Options) -> Result<()> {
    let invalid = |name, value, must| Err(Error::InvalidParameter { name, value, must });
    if !(options.kappa > 0.0 && options.kappa.is_finite()) {
        return invalid("kappa", options.kappa, "it must be more than 0, for instance 0.01");
    }
    if options.passes == 0 {
        return invalid("passes", 0.0, "at least one pass is needed");
    }
    Ok(())
}

pub(super) fn check_length(what: &'static str, found: usize, expected: usize) -> Result<()> {
    if found == expected { Ok(()) } else { Err(Error::LengthMismatch { what, found, expected }) }
}
