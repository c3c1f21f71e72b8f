//! Shader programs.
#![allow(unsafe_code)]

use eframe::glow::{self, HasContext};

/// A linked program.
pub struct Program {
    program: glow::Program,
}

impl Program {
    /// Compiles and links, for desktop OpenGL or OpenGL ES as the context is.
    pub fn new(gl: &glow::Context, vertex: &str, fragment: &str) -> Result<Self, String> {
        let header = if gl.version().is_embedded {
            "#version 300 es\nprecision highp float;\n"
        } else {
            "#version 330 core\n"
        };
        // SAFETY: the context is current; the shaders are deleted once the program has them.
        unsafe {
            let program = gl.create_program()?;
            for (kind, text) in [(glow::VERTEX_SHADER, vertex), (glow::FRAGMENT_SHADER, fragment)] {
                let shader = gl.create_shader(kind)?;
                gl.shader_source(shader, &format!("{header}{text}"));
                gl.compile_shader(shader);
                if !gl.get_shader_compile_status(shader) {
                    return Err(gl.get_shader_info_log(shader));
                }
                gl.attach_shader(program, shader);
                gl.delete_shader(shader);
            }
            gl.link_program(program);
            if !gl.get_program_link_status(program) {
                return Err(gl.get_program_info_log(program));
            }
            Ok(Self { program })
        }
    }

    /// From now on this one draws.
    pub fn bind(&self, gl: &glow::Context) {
        // SAFETY: the program is alive and the context's own.
        unsafe { gl.use_program(Some(self.program)) }
    }

    /// Sets a 4x4 matrix, column by column, of the bound program.
    pub fn set_matrix(&self, gl: &glow::Context, name: &str, numbers: &[f32; 16]) {
        // SAFETY: the program is alive and bound; a name it does not have gives no location.
        unsafe {
            let location = gl.get_uniform_location(self.program, name);
            gl.uniform_matrix_4_f32_slice(location.as_ref(), false, numbers);
        }
    }

    /// Sets a number or a vector of up to four, of the bound program.
    pub fn set_vector(&self, gl: &glow::Context, name: &str, numbers: &[f32]) {
        // SAFETY: as above; the length decides which kind of vector it is.
        unsafe {
            let location = gl.get_uniform_location(self.program, name);
            match numbers.len() {
                1 => gl.uniform_1_f32_slice(location.as_ref(), numbers),
                2 => gl.uniform_2_f32_slice(location.as_ref(), numbers),
                3 => gl.uniform_3_f32_slice(location.as_ref(), numbers),
                _ => gl.uniform_4_f32_slice(location.as_ref(), numbers),
            }
        }
    }

    /// Frees it.
    pub fn destroy(&self, gl: &glow::Context) {
        // SAFETY: the program is the context's own and not used again.
        unsafe { gl.delete_program(self.program) }
    }
}
