//! At most k influences per vertex, as exporters ask for.

use crate::weights::Weights;

/// Keeps the `max_influences` largest influences of each row (ties: the lower bone) and renormalises those rows that had
/// more; 0 keeps all.
pub fn limit(weights: Weights, max_influences: usize) -> Weights {
    if max_influences == 0 || weights.indptr().windows(2).all(|w| (w[1] - w[0]) as usize <= max_influences) {
        return weights;
    }
    Weights::from_rows(
        weights.vertex_count(),
        weights.n_bones(),
        || (),
        |(), i, out| {
            let (bones, values) = weights.row(i);
            out.extend(std::iter::zip(bones, values).map(|(&bone, &value)| (bone, value)));
            if out.len() > max_influences {
                out.sort_by(|x, y| y.1.total_cmp(&x.1).then(x.0.cmp(&y.0)));
                out.truncate(max_influences);
                out.sort_by_key(|&(bone, _)| bone);
                let sum: f64 = out.iter().map(|&(_, value)| f64::from(value)).sum();
                for (_, value) in out {
                    *value = (f64::from(*value) / sum) as f32;
                }
            }
        },
    )
}
