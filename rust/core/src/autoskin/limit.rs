//! At most so many influences per vertex.

use crate::weights::Weights;

/// Shares below this are left out.
const NEGLIGIBLE: f32 = 1e-4;

/// Keeps the `max_influences` (0: all) largest shares of each row, of equal ones that of the lower bone, and normalises.
pub(super) fn limit(weights: &Weights, max_influences: usize) -> Weights {
    Weights::from_rows(
        weights.vertex_count(),
        weights.n_bones(),
        || (),
        |(), i, out| {
            let (bones, values) = weights.row(i);
            out.extend(std::iter::zip(bones, values).map(|(&bone, &value)| (bone, value)));
            out.sort_by(|x, y| y.1.total_cmp(&x.1).then(x.0.cmp(&y.0)));
            let kept = out.iter().take_while(|influence| influence.1 > NEGLIGIBLE * out[0].1).count();
            out.truncate(if max_influences > 0 { kept.min(max_influences) } else { kept });
            out.sort_by_key(|influence| influence.0);
            let sum: f64 = out.iter().map(|&(_, value)| f64::from(value)).sum();
            out.iter_mut().for_each(|(_, value)| *value = (f64::from(*value) / sum) as f32);
        },
    )
}
