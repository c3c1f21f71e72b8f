//! Draws a [`Picture`] with OpenGL (3.3 or ES 3.0) into the frame that egui paints.
//!
//! The only module of the window with `unsafe`: every call of OpenGL is. All run on the thread that owns the context, within egui's paint
//! callback or at exit.
#![allow(unsafe_code)]

mod buffers;
mod program;
mod shaders;
mod target;

use super::picture::{Colour, Picture, Placed, Stroke};
use buffers::{Mesh, Strokes, Triangles};
use eframe::glow::{self, HasContext};
use nalgebra::{Isometry3, Matrix4};
use program::Program;
use std::time::{Duration, Instant};
use target::Target;

/// How far lines and dots are moved towards the eye, as a share of the distance: those on a surface must not sink into it.
const LIFT: f32 = 2e-3;

/// What is kept on the graphics card.
pub struct Renderer {
    surface: Program,
    stroke: Program,
    backdrop: Program,
    shapes: Option<u64>,
    meshes: Vec<Mesh>,
    cages: Vec<Strokes>,
    solid: Triangles,
    patches: Triangles,
    sheets: Triangles,
    strokes: Strokes,
    nothing: glow::VertexArray,
    /// With many samples a pixel, and with one.
    targets: [Option<Target>; 2],
    /// What was drawn last, whether finely, and since when it has been wanted.
    last: Option<(Picture, bool, Instant)>,
    /// The card is the processor: many samples take several times as long as one.
    software: bool,
}

/// On a processor a picture that changes is drawn with one sample a pixel; one that has stood for so long is drawn finely.
const STANDS: Duration = Duration::from_millis(250);

/// Where in the window a picture goes, in pixels.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    /// Of the lower left corner, from that of the window.
    pub corner: [i32; 2],
    /// Width and height.
    pub size: [i32; 2],
    /// Pixels a point.
    pub scale: f32,
}

impl Renderer {
    /// Compiles the shaders.
    ///
    /// # Errors
    /// What the driver says of them.
    pub fn new(gl: &glow::Context) -> Result<Self, String> {
        // SAFETY: the context is current, as in every paint callback.
        let nothing = unsafe { gl.create_vertex_array()? };
        Ok(Self {
            surface: Program::new(gl, shaders::SURFACE_VERTEX, shaders::SURFACE_FRAGMENT)?,
            stroke: Program::new(gl, shaders::STROKE_VERTEX, shaders::STROKE_FRAGMENT)?,
            backdrop: Program::new(gl, shaders::BACKDROP_VERTEX, shaders::BACKDROP_FRAGMENT)?,
            shapes: None,
            meshes: Vec::new(),
            cages: Vec::new(),
            solid: Triangles::new(gl)?,
            patches: Triangles::new(gl)?,
            sheets: Triangles::new(gl)?,
            strokes: Strokes::new(gl, &[], true)?,
            nothing,
            targets: [None, None],
            last: None,
            software: is_software(gl),
        })
    }

    /// Draws a picture into the window; one like the last is only copied.
    ///
    /// # Errors
    /// No memory on the card.
    pub fn draw(&mut self, gl: &glow::Context, picture: &Picture, place: &Place) -> Result<(), String> {
        if place.size.iter().any(|s| *s < 1) {
            return Ok(());
        }
        self.upload(gl, picture)?;
        // SAFETY: plain questions to the current context.
        let (window, scissor) = unsafe {
            let window = gl.get_parameter_framebuffer(glow::DRAW_FRAMEBUFFER_BINDING);
            (window, gl.is_enabled(glow::SCISSOR_TEST))
        };
        let now = Instant::now();
        let (drawn, finely, since) = match &self.last {
            Some((last, fine, since)) if last == picture => (true, *fine, *since),
            _ => (false, false, now),
        };
        let fine = finely || picture.fine || !self.software || since.elapsed() > STANDS;
        let target = self.target(gl, place.size, fine, window)?;
        let resized = target.1;
        let target = target.0;
        if !drawn || resized || fine != finely {
            // SAFETY: plain state of the current context, put back below.
            unsafe { gl.disable(glow::SCISSOR_TEST) };
            target.bind(gl);
            self.draw_all(gl, picture, place);
            target.resolve(gl);
            self.last = Some((picture.clone(), fine, since));
        }
        if scissor {
            // SAFETY: as above.
            unsafe { gl.enable(glow::SCISSOR_TEST) };
        }
        target.show(gl, window, place.corner);
        self.targets[usize::from(!fine)] = Some(target);
        Ok(())
    }

    /// Takes the target of a kind, made anew when its size has changed; tells whether it was.
    fn target(
        &mut self,
        gl: &glow::Context,
        size: [i32; 2],
        fine: bool,
        window: Option<glow::Framebuffer>,
    ) -> Result<(Target, bool), String> {
        match self.targets[usize::from(!fine)].take() {
            Some(target) if target.size() == size => Ok((target, false)),
            old => {
                if let Some(old) = old {
                    old.destroy(gl);
                }
                let made = Target::new(gl, size, fine);
                // SAFETY: the framebuffer was bound before.
                unsafe { gl.bind_framebuffer(glow::FRAMEBUFFER, window) };
                Ok((made?, true))
            }
        }
    }

    /// Draws everything into the bound target.
    fn draw_all(&mut self, gl: &glow::Context, picture: &Picture, place: &Place) {
        // SAFETY: the context is current; every object used was made by it and is alive.
        unsafe {
            gl.disable(glow::BLEND);
            gl.disable(glow::CULL_FACE);
            gl.disable(glow::DEPTH_TEST);
            gl.depth_mask(true);
            gl.color_mask(true, true, true, true);
            gl.clear_depth_f32(1.0);
            gl.clear(glow::DEPTH_BUFFER_BIT);
            self.draw_backdrop(gl, picture);
            gl.enable(glow::DEPTH_TEST);
            gl.depth_func(glow::LEQUAL);
        }
        self.draw_surfaces(gl, picture);
        // SAFETY: as above.
        unsafe {
            gl.enable(glow::BLEND);
            gl.blend_func(glow::SRC_ALPHA, glow::ONE_MINUS_SRC_ALPHA);
        }
        self.draw_translucent(gl, picture);
        let size = place.size.map(|s| s as f32);
        let view =
            View { clip: single(&picture.clip_from_world), eye: eye(picture), size, scale: place.scale };
        for placed in picture.placed.iter().filter(|p| p.cage) {
            if let Some(cage) = self.cages.get(placed.shape) {
                let world = single(&placed.world_from_mesh.to_homogeneous());
                self.draw_strokes(gl, &view, cage, world, tint(placed.colour));
            }
        }
        self.strokes.fill(gl, &picture.strokes);
        self.draw_strokes(gl, &view, &self.strokes, IDENTITY, [1.0; 4]);
        // SAFETY: as above.
        unsafe { gl.disable(glow::DEPTH_TEST) };
        self.strokes.fill(gl, &picture.overlay);
        self.draw_strokes(gl, &view, &self.strokes, IDENTITY, [1.0; 4]);
        // SAFETY: as above; back to what egui counts on.
        unsafe {
            gl.depth_mask(true);
            gl.bind_vertex_array(None);
            gl.use_program(None);
        }
    }

    /// Frees what is on the card.
    pub fn destroy(&mut self, gl: &glow::Context) {
        for mesh in self.meshes.drain(..) {
            mesh.destroy(gl);
        }
        for cage in self.cages.drain(..) {
            cage.destroy(gl);
        }
        self.solid.destroy(gl);
        self.patches.destroy(gl);
        self.sheets.destroy(gl);
        self.strokes.destroy(gl);
        for program in [&self.surface, &self.stroke, &self.backdrop] {
            program.destroy(gl);
        }
        for target in self.targets.iter_mut().filter_map(Option::take) {
            target.destroy(gl);
        }
        // SAFETY: the context is current and the object its own.
        unsafe { gl.delete_vertex_array(self.nothing) };
        self.shapes = None;
    }

    /// Sends the shapes of another scene.
    fn upload(&mut self, gl: &glow::Context, picture: &Picture) -> Result<(), String> {
        let Some(shapes) = &picture.shapes else { return Ok(()) };
        if self.shapes == Some(shapes.id) {
            return Ok(());
        }
        for mesh in self.meshes.drain(..) {
            mesh.destroy(gl);
        }
        for cage in self.cages.drain(..) {
            cage.destroy(gl);
        }
        for shape in &shapes.shapes {
            self.meshes.push(Mesh::new(gl, shape)?);
            let lines: Vec<Stroke> = shape
                .cage
                .iter()
                .map(|&[from, to]| Stroke { from, to, colour: [255; 4], width: 1.1 })
                .collect();
            self.cages.push(Strokes::new(gl, &lines, false)?);
        }
        self.shapes = Some(shapes.id);
        Ok(())
    }

    fn draw_backdrop(&self, gl: &glow::Context, picture: &Picture) {
        self.backdrop.bind(gl);
        self.backdrop.set_vector(gl, "u_top", &tint(picture.background[0]));
        self.backdrop.set_vector(gl, "u_bottom", &tint(picture.background[1]));
        // SAFETY: the vertex array has no attributes; the shader makes its three corners from their number.
        unsafe {
            gl.bind_vertex_array(Some(self.nothing));
            gl.draw_arrays(glow::TRIANGLES, 0, 3);
        }
    }

    /// Everything opaque.
    fn draw_surfaces(&mut self, gl: &glow::Context, picture: &Picture) {
        self.begin_surfaces(gl, picture);
        for placed in picture.placed.iter().filter(|p| !p.cage && p.colour[3] == 255) {
            self.draw_placed(gl, placed);
        }
        self.draw_patches(gl, picture);
        self.solid.fill(gl, &picture.solid);
        self.begin_mesh(gl, &Isometry3::identity(), [255; 4], true);
        self.solid.draw(gl);
    }

    /// The contact levels in use, a little nearer to the eye than the surfaces that they are pieces of.
    fn draw_patches(&mut self, gl: &glow::Context, picture: &Picture) {
        // SAFETY: plain state of the current context, put back below.
        unsafe {
            gl.enable(glow::POLYGON_OFFSET_FILL);
            gl.polygon_offset(-1.0, -4.0);
        }
        for patches in &picture.patches {
            self.patches.fill(gl, &patches.vertices);
            self.begin_mesh(gl, &patches.world_from_mesh, [255; 4], true);
            self.patches.draw(gl);
        }
        // SAFETY: as above.
        unsafe { gl.disable(glow::POLYGON_OFFSET_FILL) };
    }

    /// What is seen through, over what is not.
    fn draw_translucent(&mut self, gl: &glow::Context, picture: &Picture) {
        self.begin_surfaces(gl, picture);
        for placed in picture.placed.iter().filter(|p| !p.cage && p.colour[3] < 255) {
            // First its depth alone, so that only the nearest of its own surfaces shows.
            for colour in [false, true] {
                // SAFETY: plain state of the current context.
                unsafe { gl.color_mask(colour, colour, colour, colour) };
                self.draw_placed(gl, placed);
            }
        }
        self.sheets.fill(gl, &picture.sheets);
        self.begin_mesh(gl, &Isometry3::identity(), [255; 4], false);
        // SAFETY: plain state of the current context.
        unsafe { gl.depth_mask(false) };
        self.sheets.draw(gl);
    }

    fn begin_surfaces(&self, gl: &glow::Context, picture: &Picture) {
        let program = &self.surface;
        program.bind(gl);
        program.set_matrix(gl, "u_clip_from_world", &single(&picture.clip_from_world));
        program.set_vector(gl, "u_eye", &eye(picture));
        let [right, up, back] = picture.axes;
        let light = |v: nalgebra::Vector3<f64>| -> [f32; 3] { v.normalize().map(|c| c as f32).into() };
        program.set_vector(gl, "u_key", &light(right * -0.45 + up * 0.75 + back * 0.65));
        program.set_vector(gl, "u_fill", &light(right * 0.8 - up * 0.25 + back * 0.45));
        program.set_vector(gl, "u_inside", &tint(picture.inside));
    }

    fn begin_mesh(&self, gl: &glow::Context, pose: &Isometry3<f64>, colour: Colour, shaded: bool) {
        self.surface.set_matrix(gl, "u_world_from_mesh", &single(&pose.to_homogeneous()));
        self.surface.set_vector(gl, "u_colour", &tint(colour));
        self.surface.set_vector(gl, "u_shaded", &[if shaded { 1.0 } else { 0.0 }]);
    }

    fn draw_placed(&self, gl: &glow::Context, placed: &Placed) {
        if let Some(mesh) = self.meshes.get(placed.shape) {
            self.begin_mesh(gl, &placed.world_from_mesh, placed.colour, true);
            // Of a closed surface only what faces the eye can be seen.
            // SAFETY: plain state of the current context.
            unsafe {
                if mesh.is_closed() { gl.enable(glow::CULL_FACE) } else { gl.disable(glow::CULL_FACE) }
            };
            mesh.draw(gl);
            // SAFETY: as above.
            unsafe { gl.disable(glow::CULL_FACE) };
        }
    }

    fn draw_strokes(
        &self,
        gl: &glow::Context,
        view: &View,
        strokes: &Strokes,
        world: [f32; 16],
        tint: [f32; 4],
    ) {
        let program = &self.stroke;
        program.bind(gl);
        program.set_matrix(gl, "u_clip_from_world", &view.clip);
        program.set_matrix(gl, "u_world_from_local", &world);
        program.set_vector(gl, "u_eye", &view.eye);
        program.set_vector(gl, "u_size", &view.size);
        program.set_vector(gl, "u_scale", &[view.scale]);
        program.set_vector(gl, "u_lift", &[LIFT]);
        program.set_vector(gl, "u_tint", &tint);
        strokes.draw(gl);
    }
}

const IDENTITY: [f32; 16] = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0];

/// Whether OpenGL is made by the processor.
fn is_software(gl: &glow::Context) -> bool {
    // SAFETY: a plain question to the current context.
    let name = unsafe { gl.get_parameter_string(glow::RENDERER) }.to_ascii_lowercase();
    ["llvmpipe", "softpipe", "swiftshader", "software"].iter().any(|s| name.contains(s))
}

/// What all strokes of a picture share.
struct View {
    clip: [f32; 16],
    eye: [f32; 3],
    size: [f32; 2],
    scale: f32,
}

fn eye(picture: &Picture) -> [f32; 3] {
    super::picture::single(&picture.eye)
}

fn single(matrix: &Matrix4<f64>) -> [f32; 16] {
    let mut numbers = [0.0; 16];
    for (to, from) in numbers.iter_mut().zip(matrix.iter()) {
        *to = *from as f32;
    }
    numbers
}

fn tint(colour: Colour) -> [f32; 4] {
    colour.map(|c| f32::from(c) / 255.0)
}
