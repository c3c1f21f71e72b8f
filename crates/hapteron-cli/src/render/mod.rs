//! Still pictures of meshes, drawn in software: no window, no graphics card, the same pixels on every machine.
//!
//! ```text
//! let camera = Camera::framing(centre, radius, direction, up, 0.5, 4.0 / 3.0);
//! let mut picture = Picture::new(800, 600, [255, 255, 255]);
//! picture.draw_mesh(&camera, vertices, triangles, &pose, &Style::coloured([220, 215, 200]));
//! picture.draw_arrow(&camera, point, tip, 2.0, [200, 30, 30]);
//! let bytes = picture.to_png()?;
//! ```
//!
//! Positions are metres in the world frame. Colours are sRGB bytes; light is added in linear intensity. Everything is
//! drawn at twice the size and averaged 2 x 2, which is the anti-aliasing.

mod camera;
mod marks;
mod mesh;
mod picture;

pub use camera::Camera;
pub use mesh::Style;
pub use picture::{Colour, Picture};
