//! The map as a picture: cells, axes and their numbers.

use super::{Map, Outcome, Verdict};
use std::io;

/// Of the picture's cells, pixels.
const LARGEST_CELL: usize = 56;
const MAP_SIZE: usize = 560;
const MARGIN: [usize; 4] = [110, 20, 20, 46];
/// A character is 3 by 5 dots, a dot this many pixels.
const DOT: usize = 2;

type Colour = [u8; 3];

/// What a cell looks like: green and lighter with less swing; amber, red, black.
pub fn colour(cell: &Outcome) -> Colour {
    match cell.verdict {
        Verdict::Stable if cell.swing < 0.01 => [46, 139, 87],
        Verdict::Stable => [143, 188, 103],
        Verdict::Hums => [240, 180, 60],
        Verdict::Oscillates => [204, 62, 52],
        Verdict::Lost => [70, 50, 60],
    }
}

struct Canvas {
    width: usize,
    height: usize,
    rgb: Vec<u8>,
}

impl Canvas {
    fn fill(&mut self, x: usize, y: usize, width: usize, height: usize, colour: Colour) {
        for row in y..(y + height).min(self.height) {
            for column in x..(x + width).min(self.width) {
                let at = 3 * (row * self.width + column);
                self.rgb[at..at + 3].copy_from_slice(&colour);
            }
        }
    }

    /// Text with its left upper corner at (x, y).
    fn write(&mut self, x: usize, y: usize, text: &str) {
        for (i, c) in text.chars().enumerate() {
            for (row, bits) in glyph(c).into_iter().enumerate() {
                for column in 0..3 {
                    if bits >> (2 - column) & 1 == 1 {
                        let dot = (x + (4 * i + column) * DOT, y + row * DOT);
                        self.fill(dot.0, dot.1, DOT, DOT, [40, 40, 40]);
                    }
                }
            }
        }
    }
}

fn text_width(text: &str) -> usize {
    (4 * text.chars().count()).saturating_sub(1) * DOT
}

/// Rows of three dots.
fn glyph(c: char) -> [u8; 5] {
    match c.to_ascii_lowercase() {
        '0' => [7, 5, 5, 5, 7],
        '1' => [2, 6, 2, 2, 7],
        '2' => [7, 1, 7, 4, 7],
        '3' => [7, 1, 7, 1, 7],
        '4' => [5, 5, 7, 1, 1],
        '5' => [7, 4, 7, 1, 7],
        '6' => [7, 4, 7, 5, 7],
        '7' => [7, 1, 1, 2, 2],
        '8' => [7, 5, 7, 5, 7],
        '9' => [7, 5, 7, 1, 7],
        '.' => [0, 0, 0, 0, 2],
        '-' => [0, 0, 7, 0, 0],
        '+' => [0, 2, 7, 2, 0],
        'a' => [2, 5, 7, 5, 5],
        'b' => [6, 5, 6, 5, 6],
        'c' => [3, 4, 4, 4, 3],
        'd' => [6, 5, 5, 5, 6],
        'e' => [7, 4, 6, 4, 7],
        'f' => [7, 4, 6, 4, 4],
        'g' => [3, 4, 5, 5, 3],
        'h' => [5, 5, 7, 5, 5],
        'i' => [7, 2, 2, 2, 7],
        'j' => [1, 1, 1, 5, 2],
        'k' => [5, 5, 6, 5, 5],
        'l' => [4, 4, 4, 4, 7],
        'm' => [5, 7, 7, 5, 5],
        'n' => [6, 5, 5, 5, 5],
        'o' => [2, 5, 5, 5, 2],
        'p' => [6, 5, 6, 4, 4],
        'q' => [2, 5, 5, 6, 3],
        'r' => [6, 5, 6, 5, 5],
        's' => [3, 4, 2, 1, 6],
        't' => [7, 2, 2, 2, 2],
        'u' => [5, 5, 5, 5, 7],
        'v' => [5, 5, 5, 5, 2],
        'w' => [5, 5, 7, 7, 5],
        'x' => [5, 5, 2, 5, 5],
        'y' => [5, 5, 2, 2, 2],
        'z' => [7, 1, 2, 4, 7],
        '_' => [0, 0, 0, 0, 7],
        ' ' => [0; 5],
        _ => [7, 5, 5, 5, 7],
    }
}

/// The picture as PNG.
pub fn draw(map: &Map) -> io::Result<Vec<u8>> {
    let [x, y] = &map.axes;
    let (columns, rows) = (x.values.len(), y.values.len());
    let cell = (MAP_SIZE / columns.max(rows)).clamp(3, LARGEST_CELL);
    let [left, right, top, bottom] = MARGIN;
    let (width, height) = (left + columns * cell + right.max(60), top + rows * cell + bottom);
    let mut canvas = Canvas { width, height, rgb: vec![255; 3 * width * height] };
    for row in 0..rows {
        for column in 0..columns {
            let (px, py) = (left + column * cell, top + (rows - 1 - row) * cell);
            let gap = usize::from(cell > 8);
            canvas.fill(px, py, cell - gap, cell - gap, colour(map.at(column, row)));
        }
    }
    // As many numbers as there is room for.
    let widest = x.values.iter().map(|v| text_width(v)).max().unwrap_or(0) + 3 * DOT;
    let every = widest.div_ceil(cell).max(1);
    for column in (0..columns).step_by(every) {
        let text = &x.values[column];
        let middle = left + column * cell + cell / 2;
        canvas.write(middle.saturating_sub(text_width(text) / 2), top + rows * cell + 6, text);
    }
    let every = (7 * DOT).div_ceil(cell).max(1);
    for row in (0..rows).step_by(every) {
        let text = &y.values[row];
        let middle = top + (rows - 1 - row) * cell + cell / 2;
        canvas.write(left.saturating_sub(text_width(text) + 8), middle.saturating_sub(5 * DOT / 2), text);
    }
    canvas.write(left, top + rows * cell + 26, &x.key);
    canvas.write(4, 4, &y.key);
    encode(&canvas)
}

fn encode(canvas: &Canvas) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, canvas.width as u32, canvas.height as u32);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    let mut writer = encoder.write_header().map_err(io::Error::other)?;
    writer.write_image_data(&canvas.rgb).map_err(io::Error::other)?;
    writer.finish().map_err(io::Error::other)?;
    Ok(bytes)
}
