//! What every mesh format has to hold.

use hapteron_collision::Surface;
use hapteron_collision::mesh::{Format, mass_properties, parse};

/// Reads a mesh; what is accepted is finite, of valid indices, and fit for a query structure.
pub fn read(bytes: &[u8], format: Format) {
    let Ok(mesh) = parse(bytes, format, "fuzz") else { return };
    assert!(mesh.vertices().iter().flatten().all(|c| c.is_finite()));
    assert!(mesh.triangles().iter().flatten().all(|&i| (i as usize) < mesh.vertices().len()));
    if let Ok(mass) = mass_properties(&mesh) {
        assert!(mass.volume.is_finite());
    }
    let _ = Surface::build(&mesh);
}
