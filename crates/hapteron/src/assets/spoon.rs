//! The spoon of the paper's sections 7.2 and 7.3: 20 cm long, 1,344 triangles.

use super::shape::{Shape, smooth_step};

/// Vertices around one section.
const AROUND: usize = 16;
/// Length, millimetres.
const LENGTH: f64 = 200.0;
/// Half the bowl's length and width, and its depth, millimetres.
const BOWL: [f64; 3] = [31.0, 20.7, 7.6];
/// How much wider the bowl is towards the tip than towards the handle.
const EGG: f64 = 0.12;
/// Exponent of the bowl's outline (2 = ellipse).
const OUTLINE_EXPONENT: f64 = 2.6;
/// Half widths of the handle at the neck and at the end, millimetres.
const HANDLE_HALF_WIDTHS: [f64; 2] = [3.0, 6.5];
/// Thickness of the metal in the bowl and in the handle, millimetres.
const THICKNESS: [f64; 2] = [2.4, 2.5];
/// Height of the handle's arch over the bowl's rim, and where along the spoon it is highest, millimetres.
const ARCH: [f64; 2] = [12.0, 109.0];

/// Fractions of the half width at which the quarter of a section has its vertices, in the bowl and in the handle.
const ACROSS: [[f64; 5]; 2] = [[1.0, 0.93, 0.72, 0.40, 0.0], [1.0, 0.86, 0.62, 0.33, 0.0]];

/// Generates the spoon in metres; x along it (bowl at negative x), z up, origin at the centre of mass.
pub(crate) fn generate() -> Shape {
    let mut shape = Shape::default();
    let stations = stations();
    let mut rings = Vec::with_capacity(stations.len());
    for &x in &stations {
        let section = Section::at(x);
        let ring: Vec<u32> = (0..AROUND).map(|k| shape.vertex(section.point(x, k))).collect();
        rings.push(ring);
    }
    let tip = shape.vertex([0.0, 0.0, Section::at(0.0).height]);
    let end = shape.vertex([LENGTH, 0.0, Section::at(LENGTH).height]);
    for pair in rings.windows(2) {
        shape.band(&pair[0], &pair[1]);
    }
    if let (Some(first), Some(last)) = (rings.first(), rings.last()) {
        let reversed: Vec<u32> = first.iter().rev().copied().collect();
        shape.fan(&reversed, tip);
        shape.fan(last, end);
    }
    let (_, centroid) = shape.volume_and_centroid();
    shape.shift_and_scale(centroid.map(|c| -c), 1e-3);
    shape
}

/// Places of the 42 sections along the spoon: dense where the outline turns.
fn stations() -> Vec<f64> {
    let even = |from: f64, to: f64, count: usize| {
        (0..count).map(move |i| from + (to - from) * i as f64 / (count - 1) as f64)
    };
    let mut stations = vec![0.6, 2.0, 4.2, 7.2];
    stations.extend(even(10.8, 52.0, 12));
    stations.extend(even(55.0, 67.0, 5));
    stations.extend(even(71.5, 188.0, 18));
    stations.extend([192.5, 196.6, 199.3]);
    stations
}

/// Shape of one cross section, millimetres.
struct Section {
    half_width: f64,
    depth: f64,
    thickness: f64,
    height: f64,
    handle_share: f64,
}

impl Section {
    fn at(x: f64) -> Self {
        let [half_length, bowl_half_width, bowl_depth] = BOWL;
        let u = ((x - half_length) / half_length).clamp(-1.0, 1.0);
        let outline = (1.0 - libm::pow(u.abs(), OUTLINE_EXPONENT)).max(0.0).sqrt();
        let bowl = bowl_half_width * outline * (1.0 - EGG * u);
        let [neck, end] = HANDLE_HALF_WIDTHS;
        let rounding = 1.3 * end;
        let to_end = ((x - (LENGTH - rounding)) / rounding).clamp(0.0, 1.0);
        let handle = (neck + (end - neck) * smooth_step((x - 70.0) / 120.0)) * (1.0 - to_end * to_end).sqrt();
        let half_width = if x > half_length { smooth_maximum(bowl, handle, 3.5) } else { bowl };
        let handle_share = smooth_step((x - 40.0) / 50.0);
        let beyond = ((x - ARCH[1]) / (LENGTH - ARCH[1])).clamp(0.0, 1.0);
        Self {
            half_width,
            depth: bowl_depth * (1.0 - libm::pow(u.abs(), 2.2)),
            thickness: THICKNESS[0] + (THICKNESS[1] - THICKNESS[0]) * handle_share,
            height: ARCH[0] * (smooth_step((x - 50.0) / (ARCH[1] - 50.0)) - beyond * beyond),
            handle_share,
        }
    }

    /// Vertex `k` of the section, counter-clockwise about x from the rim at positive y.
    fn point(&self, x: f64, k: usize) -> [f64; 3] {
        let quarter = AROUND / 4;
        let fold = (k % (2 * quarter)).min(2 * quarter - k % (2 * quarter));
        let magnitude = ACROSS[0][fold] + (ACROSS[1][fold] - ACROSS[0][fold]) * self.handle_share;
        let across = if k > quarter && k < 3 * quarter { -magnitude } else { magnitude };
        let side = if k < 2 * quarter { 1.0 } else { -1.0 };
        let square = magnitude * magnitude;
        let half_thickness = 0.5 * self.thickness * libm::pow(1.0 - square * square, 0.45);
        let middle = self.height - self.depth * (1.0 - square);
        [x, self.half_width * across, middle + side * half_thickness]
    }
}

/// Larger of two numbers, rounded over a zone of width `blend`.
fn smooth_maximum(a: f64, b: f64, blend: f64) -> f64 {
    let share = (0.5 + 0.5 * (a - b) / blend).clamp(0.0, 1.0);
    b + (a - b) * share + blend * share * (1.0 - share)
}
