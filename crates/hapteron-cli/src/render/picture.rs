//! The pixels of a picture and their way into a PNG file.

use std::io;

/// Red, green, blue; sRGB bytes.
pub type Colour = [u8; 3];

/// Samples per pixel in each direction.
pub(super) const OVERSAMPLING: usize = 2;

/// A picture under construction: colours with a depth for each sample.
#[derive(Clone, Debug)]
pub struct Picture {
    width: usize,
    height: usize,
    colours: Vec<Colour>,
    nearness: Vec<f64>,
}

impl Picture {
    /// An empty picture of a size in pixels.
    pub fn new(width: usize, height: usize, background: Colour) -> Self {
        let samples = width * height * OVERSAMPLING * OVERSAMPLING;
        Self { width, height, colours: vec![background; samples], nearness: vec![f64::NEG_INFINITY; samples] }
    }

    /// Width and height in samples.
    pub(super) fn samples(&self) -> (usize, usize) {
        (self.width * OVERSAMPLING, self.height * OVERSAMPLING)
    }

    /// Puts a sample where nothing nearer has been drawn yet.
    pub(super) fn put(&mut self, x: usize, y: usize, nearness: f64, colour: Colour) {
        let index = y * self.width * OVERSAMPLING + x;
        if nearness >= self.nearness[index] {
            self.nearness[index] = nearness;
            self.colours[index] = colour;
        }
    }

    /// Whether a sample would be seen.
    pub(super) fn would_show(&self, x: usize, y: usize, nearness: f64) -> bool {
        nearness >= self.nearness[y * self.width * OVERSAMPLING + x]
    }

    /// The finished pixels, three bytes each, row by row from the top.
    pub fn to_rgb(&self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(self.width * self.height * 3);
        let stride = self.width * OVERSAMPLING;
        let count = OVERSAMPLING * OVERSAMPLING;
        for y in 0..self.height {
            for x in 0..self.width {
                for channel in 0..3 {
                    let mut sum = 0;
                    for dy in 0..OVERSAMPLING {
                        for dx in 0..OVERSAMPLING {
                            let index = (y * OVERSAMPLING + dy) * stride + x * OVERSAMPLING + dx;
                            sum += usize::from(self.colours[index][channel]);
                        }
                    }
                    bytes.push(((sum + count / 2) / count) as u8);
                }
            }
        }
        bytes
    }

    /// The picture as the bytes of a PNG file.
    ///
    /// # Errors
    /// When the picture is too large or empty for the format.
    pub fn to_png(&self) -> io::Result<Vec<u8>> {
        let invalid = |error: png::EncodingError| io::Error::new(io::ErrorKind::InvalidData, error);
        let size =
            |n: usize| u32::try_from(n).map_err(|error| io::Error::new(io::ErrorKind::InvalidData, error));
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, size(self.width)?, size(self.height)?);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        let mut writer = encoder.write_header().map_err(invalid)?;
        writer.write_image_data(&self.to_rgb()).map_err(invalid)?;
        writer.finish().map_err(invalid)?;
        Ok(bytes)
    }
}
