//! Shows what would match at several distances, without solving anything: what a slider with a preview does.

mod read;

use std::error::Error;

use skinwright_core::Progress;
use skinwright_core::transfer::{Inpainting, Length, Settings, Source, TargetMesh};

fn main() -> Result<(), Box<dyn Error>> {
    let (positions, triangles) = read::mesh(read::data("arm.obj"))?;
    let weights = read::weights(read::data("arm.weights"), positions.len())?;
    let source = Source::new(&positions, triangles, weights)?;
    let (positions, triangles) = read::mesh(read::data("sleeve.obj"))?;
    let target = TargetMesh { positions, triangles, ..TargetMesh::default() };
    let settings = Settings::default();
    let mut inpainting = Inpainting::new(source, target, &settings, &Progress::default())?;
    for distance in [0.01, 0.02, 0.03] {
        let settings = Settings { max_distance: Length::Absolute(distance), ..settings.clone() };
        let matched = inpainting.matched(None, &settings)?;
        println!("{distance}: {} of {} match", matched.iter().filter(|&&matched| matched).count(), matched.len());
    }
    Ok(())
}
