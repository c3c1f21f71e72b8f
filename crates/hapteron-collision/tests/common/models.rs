//! Two surfaces with their contact levels.

use hapteron_collision::Surface;
use hapteron_collision::clod::{Hierarchy, Lod};
use hapteron_collision::mesh::TriMesh;

/// The body's and the obstacle's.
pub struct Models {
    pub surfaces: [Surface; 2],
    pub hierarchies: [Hierarchy; 2],
}

impl Models {
    pub fn new(meshes: [TriMesh; 2]) -> Self {
        let surfaces = meshes.each_ref().map(Surface::build);
        let hierarchies = surfaces.each_ref().map(|s| Hierarchy::build(s, &mut |_| true).unwrap());
        Self { surfaces, hierarchies }
    }

    pub fn lod(&self, k: usize) -> Lod<'_> {
        Lod { surface: &self.surfaces[k], hierarchy: &self.hierarchies[k] }
    }
}
