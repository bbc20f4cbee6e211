//! What an artist can choose.

use crate::error::{Error, Result};
use crate::registration::MatchPoints;

/// How vertices of the target find their place on the source.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Method {
    /// The target is brought into the source's pose and proportions bone by bone, then matched by position and normal. The
    /// best on every pair of characters measured.
    #[default]
    SkeletonAligned,
    /// Biharmonic distances to landmarks, independent of pose; for characters whose bones fit the mesh badly.
    Biharmonic,
}

impl Method {
    /// Every method.
    pub const ALL: [Self; 2] = [Self::SkeletonAligned, Self::Biharmonic];
}

/// Settings of a retargeting. Lengths are relative to the source's bounding-box diagonal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// How vertices are matched.
    pub method: Method,
    /// What a match may be.
    pub match_points: MatchPoints,
    /// Whether vertices are matched by their numbers where both meshes have the same triangles and these lie at about the
    /// same places: bodies that are shapes of one base mesh.
    pub vertex_order: bool,
    /// Whether the warped target is drawn onto the source by smooth displacements, as far as its bones are long.
    pub registration: bool,
    /// How far apart normals that differ by a unit count, relative.
    pub normal_length: f64,
    /// Largest distance of a reliable match, relative.
    pub max_distance: f64,
    /// Largest angle between the normals of a reliable match, radians.
    pub max_normal_angle: f64,
    /// Largest ratio by which a reliable match may stretch the edges around it.
    pub max_stretch: f64,
    /// Eigenpairs of the Biharmonic method.
    pub n_pairs: usize,
    /// Passes of smoothing over vertices without a reliable match and their neighbours.
    pub smoothing_iterations: u32,
    /// Share of the neighbours' mean per pass, 0 to 1.
    pub smoothing_factor: f64,
    /// Largest number of influences per vertex, 0 for no limit.
    pub max_influences: usize,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            method: Method::default(),
            match_points: MatchPoints::default(),
            vertex_order: true,
            registration: true,
            normal_length: 0.02,
            max_distance: 0.08,
            max_normal_angle: 80f64.to_radians(),
            max_stretch: 6.0,
            n_pairs: 100,
            smoothing_iterations: 0,
            smoothing_factor: 0.2,
            max_influences: 0,
        }
    }
}

impl Settings {
    /// # Errors
    /// [`Error::InvalidParameter`] with the first value out of its range.
    pub fn check(&self) -> Result<()> {
        let at_least_0 = "it must be at least 0 and finite";
        let rules = [
            ("normal_length", self.normal_length, self.normal_length >= 0.0, at_least_0),
            ("max_distance", self.max_distance, self.max_distance >= 0.0, at_least_0),
            ("max_normal_angle", self.max_normal_angle, self.max_normal_angle >= 0.0, at_least_0),
            ("max_stretch", self.max_stretch, self.max_stretch >= 1.0, "it must be at least 1 and finite"),
            ("n_pairs", self.n_pairs as f64, (1..=2000).contains(&self.n_pairs), "it must lie between 1 and 2000"),
            (
                "smoothing_iterations",
                f64::from(self.smoothing_iterations),
                self.smoothing_iterations <= 1000,
                "it must be at most 1000",
            ),
            (
                "smoothing_factor",
                self.smoothing_factor,
                (0.0..=1.0).contains(&self.smoothing_factor),
                "it must lie between 0 and 1",
            ),
        ];
        let broken = rules.into_iter().find(|(_, value, holds, _)| !holds || !value.is_finite());
        broken.map_or(Ok(()), |(name, value, _, must)| Err(Error::InvalidParameter { name, value, must }))
    }
}
