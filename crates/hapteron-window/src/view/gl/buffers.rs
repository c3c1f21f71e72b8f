//! Vertices on the graphics card.
#![allow(unsafe_code)]

use crate::view::geometry::{Shape, Vertex};
use crate::view::picture::Stroke;
use eframe::glow::{self, HasContext};

/// A vertex array with its buffers.
struct Buffers {
    array: glow::VertexArray,
    vertices: glow::Buffer,
}

impl Buffers {
    /// Both, bound.
    fn new(gl: &glow::Context) -> Result<Self, String> {
        // SAFETY: the context is current.
        unsafe {
            let array = gl.create_vertex_array()?;
            let vertices = gl.create_buffer()?;
            gl.bind_vertex_array(Some(array));
            gl.bind_buffer(glow::ARRAY_BUFFER, Some(vertices));
            Ok(Self { array, vertices })
        }
    }

    fn fill(&self, gl: &glow::Context, bytes: &[u8], usage: u32) {
        // SAFETY: the buffer is the context's own; the bytes are copied before the call returns.
        unsafe {
            gl.bind_buffer(glow::ARRAY_BUFFER, Some(self.vertices));
            gl.buffer_data_u8_slice(glow::ARRAY_BUFFER, bytes, usage);
        }
    }

    fn destroy(&self, gl: &glow::Context) {
        // SAFETY: the objects are the context's own and not used again.
        unsafe {
            gl.delete_vertex_array(self.array);
            gl.delete_buffer(self.vertices);
        }
    }
}

/// Tells the bound array where the parts of a [`Vertex`] are in the bound buffer.
fn describe_vertex(gl: &glow::Context) {
    let stride = size_of::<Vertex>() as i32;
    // SAFETY: the offsets and types are those of `Vertex`, which is `repr(C)`.
    unsafe {
        gl.enable_vertex_attrib_array(0);
        gl.vertex_attrib_pointer_f32(0, 3, glow::FLOAT, false, stride, 0);
        gl.enable_vertex_attrib_array(1);
        gl.vertex_attrib_pointer_f32(1, 3, glow::FLOAT, false, stride, 12);
        gl.enable_vertex_attrib_array(2);
        gl.vertex_attrib_pointer_f32(2, 4, glow::UNSIGNED_BYTE, true, stride, 24);
    }
}

/// A shape that stays.
pub struct Mesh {
    buffers: Buffers,
    indices: glow::Buffer,
    count: i32,
    closed: bool,
}

impl Mesh {
    /// Sends a shape.
    pub fn new(gl: &glow::Context, shape: &Shape) -> Result<Self, String> {
        let buffers = Buffers::new(gl)?;
        buffers.fill(gl, bytemuck::cast_slice(&shape.vertices), glow::STATIC_DRAW);
        describe_vertex(gl);
        // SAFETY: the context is current and its array bound; the bytes are copied before the call returns.
        let indices = unsafe {
            let indices = gl.create_buffer()?;
            gl.bind_buffer(glow::ELEMENT_ARRAY_BUFFER, Some(indices));
            let bytes = bytemuck::cast_slice(&shape.indices);
            gl.buffer_data_u8_slice(glow::ELEMENT_ARRAY_BUFFER, bytes, glow::STATIC_DRAW);
            gl.bind_vertex_array(None);
            indices
        };
        Ok(Self { buffers, indices, count: shape.indices.len() as i32, closed: shape.closed })
    }

    /// Whether its inside cannot be seen from outside.
    pub fn is_closed(&self) -> bool {
        self.closed
    }

    /// Draws it with the bound program.
    pub fn draw(&self, gl: &glow::Context) {
        // SAFETY: every index is one of the vertices that were sent: `Shape` makes them together.
        unsafe {
            gl.bind_vertex_array(Some(self.buffers.array));
            gl.draw_elements(glow::TRIANGLES, self.count, glow::UNSIGNED_INT, 0);
        }
    }

    /// Frees it.
    pub fn destroy(&self, gl: &glow::Context) {
        self.buffers.destroy(gl);
        // SAFETY: the buffer is the context's own and not used again.
        unsafe { gl.delete_buffer(self.indices) }
    }
}

/// Triangles that are new in every picture.
pub struct Triangles {
    buffers: Buffers,
    count: i32,
}

impl Triangles {
    /// None yet.
    pub fn new(gl: &glow::Context) -> Result<Self, String> {
        let buffers = Buffers::new(gl)?;
        describe_vertex(gl);
        Ok(Self { buffers, count: 0 })
    }

    /// Replaces them.
    pub fn fill(&mut self, gl: &glow::Context, vertices: &[Vertex]) {
        self.buffers.fill(gl, bytemuck::cast_slice(vertices), glow::STREAM_DRAW);
        self.count = vertices.len() as i32;
    }

    /// Draws them with the bound program.
    pub fn draw(&self, gl: &glow::Context) {
        if self.count == 0 {
            return;
        }
        // SAFETY: the count is that of the vertices that were sent.
        unsafe {
            gl.bind_vertex_array(Some(self.buffers.array));
            gl.draw_arrays(glow::TRIANGLES, 0, self.count);
        }
    }

    /// Frees them.
    pub fn destroy(&self, gl: &glow::Context) {
        self.buffers.destroy(gl);
    }
}

/// Lines and dots, each drawn as a rectangle that the card spans between its ends.
pub struct Strokes {
    buffers: Buffers,
    count: i32,
    usage: u32,
}

impl Strokes {
    /// Sends strokes; `changing` ones may be replaced in every picture.
    pub fn new(gl: &glow::Context, strokes: &[Stroke], changing: bool) -> Result<Self, String> {
        let buffers = Buffers::new(gl)?;
        let stride = size_of::<Stroke>() as i32;
        // SAFETY: the offsets and types are those of `Stroke`, which is `repr(C)`; one stroke an instance.
        unsafe {
            for (index, (count, kind, normalized, offset)) in [
                (3, glow::FLOAT, false, 0),
                (3, glow::FLOAT, false, 12),
                (4, glow::UNSIGNED_BYTE, true, 24),
                (1, glow::FLOAT, false, 28),
            ]
            .into_iter()
            .enumerate()
            {
                gl.enable_vertex_attrib_array(index as u32);
                gl.vertex_attrib_pointer_f32(index as u32, count, kind, normalized, stride, offset);
                gl.vertex_attrib_divisor(index as u32, 1);
            }
        }
        let mut made =
            Self { buffers, count: 0, usage: if changing { glow::STREAM_DRAW } else { glow::STATIC_DRAW } };
        made.fill(gl, strokes);
        Ok(made)
    }

    /// Replaces them.
    pub fn fill(&mut self, gl: &glow::Context, strokes: &[Stroke]) {
        self.buffers.fill(gl, bytemuck::cast_slice(strokes), self.usage);
        self.count = strokes.len() as i32;
    }

    /// Draws them with the bound program.
    pub fn draw(&self, gl: &glow::Context) {
        if self.count == 0 {
            return;
        }
        // SAFETY: the count is that of the strokes that were sent; the corners come from the vertex's number.
        unsafe {
            gl.bind_vertex_array(Some(self.buffers.array));
            gl.draw_arrays_instanced(glow::TRIANGLE_STRIP, 0, 4, self.count);
        }
    }

    /// Frees them.
    pub fn destroy(&self, gl: &glow::Context) {
        self.buffers.destroy(gl);
    }
}
