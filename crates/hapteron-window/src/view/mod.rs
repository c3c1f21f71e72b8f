//! The 3D view: camera, shapes, marks, and how they are drawn.

mod camera;
mod compose;
mod geometry;
mod gl;
mod labels;
mod levels;
mod marks;
mod pick;
mod picture;

pub use camera::{Camera, Preset};
pub use compose::{Shown, Sight, Spot};
pub use levels::words as level_words;
pub use pick::Picker;
pub use picture::{Colour, Shapes};

use crate::theme::Palette;
use eframe::egui_glow::CallbackFn;
use eframe::{egui, glow};
use geometry::Shape;
use gl::Renderer;
use hapteron::scene::Scene;
use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion, Vector2, Vector3};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// The shapes of a scene. Set-up: some tenths of a second for 100,000 triangles.
#[must_use]
pub fn shapes(scene: &Scene) -> Arc<Shapes> {
    static NEXT: AtomicU64 = AtomicU64::new(1);
    let body = Shape::of(&scene.model.mesh);
    let obstacles = scene.obstacles.iter().map(|o| Shape::of(&o.model.mesh));
    let shapes = std::iter::once(body).chain(obstacles).collect();
    Arc::new(Shapes { id: NEXT.fetch_add(1, Ordering::Relaxed), shapes })
}

/// The coupling frame in the body's mesh frame, as the scene says.
#[must_use]
pub fn grasp(scene: &Scene) -> Isometry3<f64> {
    let c = &scene.file.coupling;
    let p = c.grasp_position.unwrap_or_default();
    let [w, x, y, z] = c.grasp_orientation.unwrap_or([1.0, 0.0, 0.0, 0.0]);
    Isometry3::from_parts(
        Translation3::from(Vector3::from(p)),
        UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z)),
    )
}

/// A sphere around all that there is in a scene at its start.
#[must_use]
pub fn bounds(scene: &Scene, shapes: &Shapes) -> (Point3<f64>, f64) {
    let body = scene.world_from_mesh(&scene.start);
    let poses = std::iter::once(body).chain(scene.obstacles.iter().map(|o| o.world_from_mesh));
    let spheres: Vec<(Point3<f64>, f64)> =
        poses.zip(&shapes.shapes).map(|(pose, s)| (pose * s.center, s.radius)).collect();
    let whole = spheres.iter().map(|s| s.1).sum::<f64>().max(1e-9);
    let center = spheres.iter().map(|s| s.0.coords * (s.1 / whole)).sum::<Vector3<f64>>();
    let center = Point3::from(center);
    let radius = spheres.iter().map(|s| (s.0 - center).norm() + s.1).fold(1e-9, f64::max);
    (center, radius)
}

/// The part of the window that shows the scene.
#[derive(Default)]
pub struct View {
    renderer: Arc<Mutex<Option<Result<Renderer, String>>>>,
    /// The next pictures are to be kept.
    pub fine: bool,
}

impl View {
    /// Paints into the rectangle of a response that was allocated for it.
    pub fn paint(
        &self,
        ui: &egui::Ui,
        rect: egui::Rect,
        sight: &Sight<'_>,
        shapes: &Arc<Shapes>,
        shown: &Shown,
        camera: &Camera,
    ) {
        let palette = Palette::of(ui);
        let size = Vector2::new(f64::from(rect.width()), f64::from(rect.height()));
        let (mut picture, words) = compose::picture(sight, shapes, shown, camera, palette, size);
        picture.fine = self.fine;
        let renderer = Arc::clone(&self.renderer);
        let callback = CallbackFn::new(move |info, painter| {
            let mut kept = renderer.lock().unwrap_or_else(PoisonError::into_inner);
            let gl: &glow::Context = painter.gl();
            let made = kept.get_or_insert_with(|| Renderer::new(gl));
            let pixels = info.viewport_in_pixels();
            let place = gl::Place {
                corner: [pixels.left_px, pixels.from_bottom_px],
                size: [pixels.width_px, pixels.height_px],
                scale: info.pixels_per_point,
            };
            let outcome = match made {
                Ok(renderer) => renderer.draw(gl, &picture, &place),
                Err(_) => Ok(()),
            };
            if let Err(problem) = outcome {
                *made = Err(problem);
            }
        });
        ui.painter().add(egui::PaintCallback { rect, callback: Arc::new(callback) });
        labels::paint(ui, rect, camera, &words, shown, palette);
        if let Some(problem) = self.problem() {
            let text = format!("The 3D view cannot be drawn: {problem}");
            let font = egui::FontId::proportional(14.0);
            ui.painter().text(rect.center(), egui::Align2::CENTER_CENTER, text, font, egui::Color32::RED);
        }
    }

    /// Why nothing is drawn.
    fn problem(&self) -> Option<String> {
        let kept = self.renderer.lock().unwrap_or_else(PoisonError::into_inner);
        kept.as_ref().and_then(|made| made.as_ref().err().cloned())
    }

    /// Frees what is on the graphics card.
    pub fn destroy(&self, gl: &glow::Context) {
        let mut kept = self.renderer.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(Ok(renderer)) = kept.as_mut() {
            renderer.destroy(gl);
        }
        *kept = None;
    }
}
