//! The report of `mesh --build`: every level of a contact hierarchy, its patches coloured.

use super::{Cell, Page};
use crate::render::{Camera, Colour, Picture, Style};
use anyhow::Result;
use hapteron::collision::clod::{Hierarchy, LevelSummary, Patch};
use nalgebra::{Isometry3, Point3, Vector3};

const SIZE: [usize; 2] = [560, 420];
const BACKGROUND: Colour = [255, 255, 255];

/// A report of all levels.
pub fn levels(name: &str, hierarchy: &Hierarchy) -> Result<String> {
    let mut page = Page::new(&format!("Contact levels of detail of {name}"), None);
    let levels = hierarchy.levels();
    page.paragraph(
        "Each level has about half as many convex patches as the one before. A patch, in a colour of its own, is both a piece of the \
         simplified surface and, with its convex hull, a bounding volume of what it stands for. Resolution: one over the longest edge that \
         was collapsed; deviation: greatest distance between the level and the original surface, both ways; margin: how far a hull of a \
         finer level may stand out.",
        true,
    );
    let rows: Vec<Vec<Cell>> = levels.iter().map(row).collect();
    page.table(
        &["level", "patches", "triangles", "resolution [1/m]", "deviation [mm]", "margin [mm]"],
        &rows,
    );
    let mut pictures = Vec::new();
    let finest = hierarchy.patches(0);
    let camera = camera(&finest);
    for level in &levels {
        let patches = hierarchy.patches(level.level);
        let caption =
            format!("Level {}: {} patches, {} triangles", level.level, level.patches, level.triangles);
        pictures.push((picture(&patches, &camera).to_png()?, caption));
    }
    page.pictures(&pictures);
    Ok(page.finish())
}

fn row(level: &LevelSummary) -> Vec<Cell> {
    let resolution = if level.edge > 0.0 { format!("{:.1}", 1.0 / level.edge) } else { "full".to_owned() };
    [
        level.level.to_string(),
        level.patches.to_string(),
        level.triangles.to_string(),
        resolution,
        format!("{:.4}", level.deviation * 1e3),
        format!("{:.4}", level.margin * 1e3),
    ]
    .into_iter()
    .map(Cell::Text)
    .collect()
}

/// Shows the whole mesh across its shortest extent, from a little beside and above.
fn camera(patches: &[Patch]) -> Camera {
    let mut low = Vector3::repeat(f64::INFINITY);
    let mut high = -low;
    for &v in patches.iter().flat_map(|p| &p.vertices) {
        low = low.inf(&Vector3::from(v));
        high = high.sup(&Vector3::from(v));
    }
    let radius = 0.42 * (high - low).norm();
    let centre = Point3::from((low + high) * 0.5);
    let flattest = (high - low).imin();
    // From the side that shows more patches.
    let facing = |p: &Patch| {
        let [a, b, c] = p.triangles[0].map(|v| Vector3::from(p.vertices[v as usize]));
        (b - a).cross(&(c - a))[flattest]
    };
    let above = patches.iter().filter(|p| facing(p) > 0.0).count();
    let mut direction = Vector3::new(0.3, 0.4, 0.3);
    direction[flattest] = if 2 * above > patches.len() { -1.0 } else { 1.0 };
    let up = if flattest == 2 { Vector3::y() } else { Vector3::z() };
    Camera::framing(centre, radius, direction, up, 0.5, SIZE[0] as f64 / SIZE[1] as f64)
}

fn picture(patches: &[Patch], camera: &Camera) -> Picture {
    let mut picture = Picture::new(SIZE[0], SIZE[1], BACKGROUND);
    for (index, patch) in patches.iter().enumerate() {
        let style = Style::coloured(colour(index));
        picture.draw_mesh(camera, &patch.vertices, &patch.triangles, &Isometry3::identity(), &style);
    }
    picture
}

/// Colours that lie far from each other for numbers that are close: hue by the golden ratio, three lightnesses.
fn colour(index: usize) -> Colour {
    let hue = (index as f64 * 0.618_033_988_75).fract() * 6.0;
    let value = [0.95, 0.78, 0.62][index % 3];
    let chroma = 0.55 * value;
    let channel = |offset: f64| {
        let k = (hue + offset).rem_euclid(6.0);
        value - chroma * k.min(4.0 - k).clamp(0.0, 1.0)
    };
    [5.0, 3.0, 1.0].map(|offset| (channel(offset) * 255.0) as u8)
}
