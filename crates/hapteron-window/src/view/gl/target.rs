//! The picture that the scene is drawn into, with many samples a pixel, before it comes into the window.
#![allow(unsafe_code)]

use eframe::glow::{self, HasContext};

/// Samples a pixel that are asked for.
const SAMPLES: i32 = 4;

/// Buffers of one size.
pub struct Target {
    size: [i32; 2],
    /// With many samples a pixel.
    drawn: glow::Framebuffer,
    buffers: [glow::Renderbuffer; 2],
    /// With one.
    resolved: glow::Framebuffer,
    resolved_buffer: glow::Renderbuffer,
}

impl Target {
    /// Buffers of a size in pixels; without `fine` with one sample a pixel.
    pub fn new(gl: &glow::Context, size: [i32; 2], fine: bool) -> Result<Self, String> {
        // SAFETY: the context is current; every object is made by it, and the binding is put back by the caller.
        unsafe {
            let most = gl.get_parameter_i32(glow::MAX_SAMPLES);
            let samples = if fine { SAMPLES.min(most) } else { 0 };
            let renderbuffer = |format: u32, samples: i32| -> Result<glow::Renderbuffer, String> {
                let buffer = gl.create_renderbuffer()?;
                gl.bind_renderbuffer(glow::RENDERBUFFER, Some(buffer));
                let [width, height] = size;
                gl.renderbuffer_storage_multisample(glow::RENDERBUFFER, samples, format, width, height);
                gl.bind_renderbuffer(glow::RENDERBUFFER, None);
                Ok(buffer)
            };
            let drawn = gl.create_framebuffer()?;
            let buffers =
                [renderbuffer(glow::RGBA8, samples)?, renderbuffer(glow::DEPTH_COMPONENT24, samples)?];
            let resolved = gl.create_framebuffer()?;
            let resolved_buffer = renderbuffer(glow::RGBA8, 0)?;
            let attach = |point: u32, buffer: glow::Renderbuffer| {
                gl.framebuffer_renderbuffer(glow::FRAMEBUFFER, point, glow::RENDERBUFFER, Some(buffer));
            };
            gl.bind_framebuffer(glow::FRAMEBUFFER, Some(drawn));
            attach(glow::COLOR_ATTACHMENT0, buffers[0]);
            attach(glow::DEPTH_ATTACHMENT, buffers[1]);
            let first = gl.check_framebuffer_status(glow::FRAMEBUFFER);
            gl.bind_framebuffer(glow::FRAMEBUFFER, Some(resolved));
            attach(glow::COLOR_ATTACHMENT0, resolved_buffer);
            let second = gl.check_framebuffer_status(glow::FRAMEBUFFER);
            let target = Self { size, drawn, buffers, resolved, resolved_buffer };
            if first != glow::FRAMEBUFFER_COMPLETE || second != glow::FRAMEBUFFER_COMPLETE {
                target.destroy(gl);
                return Err(format!("no picture of {} x {} pixels with {samples} samples", size[0], size[1]));
            }
            Ok(target)
        }
    }

    /// In pixels.
    pub fn size(&self) -> [i32; 2] {
        self.size
    }

    /// From now on everything is drawn into it.
    pub fn bind(&self, gl: &glow::Context) {
        // SAFETY: the framebuffer is alive and the context's own.
        unsafe {
            gl.bind_framebuffer(glow::FRAMEBUFFER, Some(self.drawn));
            gl.viewport(0, 0, self.size[0], self.size[1]);
        }
    }

    /// Mixes the samples.
    pub fn resolve(&self, gl: &glow::Context) {
        let [width, height] = self.size;
        // SAFETY: both framebuffers are alive, of one size and one format.
        unsafe {
            gl.bind_framebuffer(glow::READ_FRAMEBUFFER, Some(self.drawn));
            gl.bind_framebuffer(glow::DRAW_FRAMEBUFFER, Some(self.resolved));
            let (color, nearest) = (glow::COLOR_BUFFER_BIT, glow::NEAREST);
            gl.blit_framebuffer(0, 0, width, height, 0, 0, width, height, color, nearest);
        }
    }

    /// Copies what was resolved last into a framebuffer, at a place from its lower left corner.
    pub fn show(&self, gl: &glow::Context, into: Option<glow::Framebuffer>, [left, bottom]: [i32; 2]) {
        let [width, height] = self.size;
        // SAFETY: the framebuffers are alive; what lies outside the target is cut off by the driver.
        unsafe {
            gl.bind_framebuffer(glow::READ_FRAMEBUFFER, Some(self.resolved));
            gl.bind_framebuffer(glow::DRAW_FRAMEBUFFER, into);
            let (color, nearest) = (glow::COLOR_BUFFER_BIT, glow::NEAREST);
            let (right, top) = (left + width, bottom + height);
            gl.blit_framebuffer(0, 0, width, height, left, bottom, right, top, color, nearest);
            gl.bind_framebuffer(glow::FRAMEBUFFER, into);
        }
    }

    /// Frees it.
    pub fn destroy(&self, gl: &glow::Context) {
        // SAFETY: the objects are the context's own and not used again.
        unsafe {
            gl.delete_framebuffer(self.drawn);
            gl.delete_framebuffer(self.resolved);
            for buffer in self.buffers {
                gl.delete_renderbuffer(buffer);
            }
            gl.delete_renderbuffer(self.resolved_buffer);
        }
    }
}
