//! Pictures of the display, and how alike two of them are.

use std::path::Path;

/// References are so small: what differs from one driver to another by a pixel's share is averaged away.
const SMALL: [usize; 2] = [320, 200];
/// Of the small pictures' pixels, so many may differ by so much: plots and numbers are never the same twice.
const FAR: i32 = 40;
const FAR_SHARE: f64 = 0.04;
/// And the mean difference of all is at most this, of 255.
const MEAN: f64 = 4.0;

/// Rows of red, green and blue from the top left corner.
pub struct Picture {
    width: usize,
    height: usize,
    pixels: Vec<[u8; 3]>,
}

impl Picture {
    /// Of one colour.
    pub fn plain(width: usize, height: usize, colour: [u8; 3]) -> Self {
        Self { width, height, pixels: vec![colour; width * height] }
    }

    /// From an X window dump with 32 bits a pixel, as Xvfb keeps it (`XWDFile.h`).
    pub fn from_xwd(bytes: &[u8]) -> Self {
        let word = |i: usize| {
            let four: [u8; 4] = bytes[4 * i..4 * i + 4].try_into().unwrap();
            u32::from_be_bytes(four) as usize
        };
        let (header, width, height) = (word(0), word(4), word(5));
        let (least_first, bits, line, colours) = (word(7) == 0, word(11), word(12), word(19));
        assert!(bits == 32 && least_first, "a dump of {bits} bits a pixel");
        let start = header + 12 * colours;
        let pixel = |x: usize, y: usize| {
            let at = start + y * line + 4 * x;
            [bytes[at + 2], bytes[at + 1], bytes[at]]
        };
        let pixels =
            (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| pixel(x, y)).collect();
        Self { width, height, pixels }
    }

    fn read_png(path: &Path) -> Self {
        let file = std::fs::File::open(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        let mut reader = png::Decoder::new(std::io::BufReader::new(file)).read_info().unwrap();
        let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut bytes).unwrap();
        assert_eq!((info.color_type, info.bit_depth), (png::ColorType::Rgb, png::BitDepth::Eight));
        let pixels = bytes[..info.buffer_size()].chunks(3).map(|p| [p[0], p[1], p[2]]).collect();
        Self { width: info.width as usize, height: info.height as usize, pixels }
    }

    /// Saves it.
    pub fn write_png(&self, path: &Path) {
        let file = std::fs::File::create(path).unwrap();
        let mut encoder =
            png::Encoder::new(std::io::BufWriter::new(file), self.width as u32, self.height as u32);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_compression(png::Compression::High);
        let bytes: Vec<u8> = self.pixels.iter().flatten().copied().collect();
        encoder.write_header().unwrap().write_image_data(&bytes).unwrap();
    }

    /// Averaged down.
    fn small(&self) -> Self {
        let [width, height] = SMALL;
        if (self.width, self.height) == (width, height) {
            return Self { width, height, pixels: self.pixels.clone() };
        }
        let mut pixels = Vec::with_capacity(width * height);
        for y in 0..height {
            for x in 0..width {
                let range = |i: usize, from: usize, to: usize| {
                    i * from / to..((i + 1) * from / to).max(i * from / to + 1)
                };
                let mut sum = [0usize; 3];
                let mut count = 0;
                for v in range(y, self.height, height) {
                    for u in range(x, self.width, width) {
                        let pixel = self.pixels[v * self.width + u];
                        for (s, p) in sum.iter_mut().zip(pixel) {
                            *s += usize::from(p);
                        }
                        count += 1;
                    }
                }
                pixels.push(sum.map(|s| (s / count) as u8));
            }
        }
        Self { width, height, pixels }
    }

    /// Whether another picture shows the same, to the tolerances above; how they differ when not.
    pub fn resembles(&self, other: &Self) -> Result<(), String> {
        let (a, b) = (self.small(), other.small());
        let distance = |p: &[u8; 3], q: &[u8; 3]| {
            p.iter().zip(q).map(|(x, y)| (i32::from(*x) - i32::from(*y)).abs()).max()
        };
        let distances: Vec<i32> =
            a.pixels.iter().zip(&b.pixels).map(|(p, q)| distance(p, q).unwrap_or(0)).collect();
        let mean = f64::from(distances.iter().sum::<i32>()) / distances.len() as f64;
        let far = distances.iter().filter(|d| **d > FAR).count() as f64 / distances.len() as f64;
        if mean <= MEAN && far <= FAR_SHARE {
            return Ok(());
        }
        Err(format!(
            "mean difference {mean:.2} of 255 (at most {MEAN}), {:.2} % of the pixels far off (at most {:.0} %)",
            100.0 * far,
            100.0 * FAR_SHARE
        ))
    }

    /// Whether pictures are to be stored instead of compared.
    pub fn are_stored() -> bool {
        std::env::var_os("HAPTERON_NEW_PICTURES").is_some()
    }

    /// Whether it shows what a stored picture does.
    pub fn resembles_file(&self, reference: &Path) -> bool {
        self.resembles(&Self::read_png(reference)).is_ok()
    }

    /// Compares with a stored picture; with `HAPTERON_NEW_PICTURES=1` stores this one instead.
    pub fn must_resemble(&self, reference: &Path) {
        if Self::are_stored() {
            self.small().write_png(reference);
            return;
        }
        if let Err(how) = self.resembles(&Self::read_png(reference)) {
            let shown =
                std::env::temp_dir().join(format!("hapteron-{}", reference.file_name().unwrap().display()));
            self.write_png(&shown);
            panic!("{} shows something else than {}: {how}", shown.display(), reference.display());
        }
    }

    /// Share (0 to 1) of an area (left, top, right, bottom) whose pixels are clearly different.
    pub fn difference_within(&self, other: &Self, [left, top, right, bottom]: [i32; 4]) -> f64 {
        let mut different = 0;
        let mut count = 0;
        for y in top.max(0) as usize..(bottom as usize).min(self.height) {
            for x in left.max(0) as usize..(right as usize).min(self.width) {
                let (p, q) = (self.pixels[y * self.width + x], other.pixels[y * self.width + x]);
                count += 1;
                different += usize::from(p.iter().zip(q).any(|(a, b)| a.abs_diff(b) > 24));
            }
        }
        different as f64 / f64::from(count.max(1))
    }
}
