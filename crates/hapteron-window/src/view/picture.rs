//! What one picture of the 3D view shows, without saying how it is drawn.

use super::geometry::{Shape, Vertex};
use super::levels::Patches;
use nalgebra::{Isometry3, Matrix4, Point3, Vector3};
use std::sync::Arc;

/// Red, green, blue, opacity; sRGB bytes.
pub type Colour = [u8; 4];

/// A straight line with round ends, or a dot when both ends are one place. World, metres.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Stroke {
    /// One end.
    pub from: [f32; 3],
    /// The other.
    pub to: [f32; 3],
    /// Its colour.
    pub colour: Colour,
    /// Width on the screen, points.
    pub width: f32,
}

impl Stroke {
    /// A line.
    #[must_use]
    pub fn line(from: &Point3<f64>, to: &Point3<f64>, width: f32, colour: Colour) -> Self {
        Self { from: single(from), to: single(to), colour, width }
    }

    /// A dot.
    #[must_use]
    pub fn dot(at: &Point3<f64>, width: f32, colour: Colour) -> Self {
        Self::line(at, at, width, colour)
    }
}

/// In the precision of the graphics card.
pub fn single(point: &Point3<f64>) -> [f32; 3] {
    point.coords.map(|c| c as f32).into()
}

/// The shapes of a scene: sent to the graphics card once.
#[derive(Debug)]
pub struct Shapes {
    /// Tells sets of shapes apart.
    pub id: u64,
    /// The body first, then the obstacles.
    pub shapes: Vec<Shape>,
}

impl PartialEq for Shapes {
    fn eq(&self, other: &Self) -> bool {
        self.id == other.id
    }
}

/// One of the [`Shapes`] in the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placed {
    /// Which.
    pub shape: usize,
    /// Where.
    pub world_from_mesh: Isometry3<f64>,
    /// Of its outside; less than full opacity lets what is behind it shine through.
    pub colour: Colour,
    /// Draws its cage instead of its surface.
    pub cage: bool,
}

/// A picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Of the camera.
    pub clip_from_world: Matrix4<f64>,
    /// Of the camera, world.
    pub eye: Point3<f64>,
    /// Right, up and back of the camera: lights move with it.
    pub axes: [Vector3<f64>; 3],
    /// At the top and at the bottom.
    pub background: [Colour; 2],
    /// Of surfaces seen from inside.
    pub inside: Colour,
    /// Sent to the card when it has others.
    pub shapes: Option<Arc<Shapes>>,
    /// What is where.
    pub placed: Vec<Placed>,
    /// The contact levels in use, over the surfaces.
    pub patches: Vec<Patches>,
    /// Shaded triangles that are new in every picture: arrows.
    pub solid: Vec<Vertex>,
    /// Flat coloured triangles that one sees through: contact planes.
    pub sheets: Vec<Vertex>,
    /// Lines and dots that surfaces hide.
    pub strokes: Vec<Stroke>,
    /// Lines and dots in front of everything.
    pub overlay: Vec<Stroke>,
    /// Drawn as well as can be, however long it takes: it is to be kept.
    pub fine: bool,
}
