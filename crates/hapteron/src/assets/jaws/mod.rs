//! Lower and upper jaw: dental arches of fourteen teeth each on a cast base, after the scene of the paper's section 7.4.
//!
//! A closed cross section (base, gum, crown) is swept along the arch; the teeth are in how it changes on the way. Lengths in this module
//! are millimetres of a jaw that is enlarged at the end ([`SCALE`]). Proportions of the crowns follow the averages of dental anatomy textbooks.

mod section;
mod teeth;

use super::shape::{Point, Shape};
use section::Section;
use teeth::{Tooth, lower_teeth, upper_teeth};

/// Metres a unit: the teeth are drawn in millimetres, and the jaws then enlarged to the 6 cm of the paper.
const SCALE: f64 = 1.2e-3;

/// Height by which the upper jaw is held over the place where its tips and the lower jaw's would be level, millimetres: at the identity
/// poses of both jaws their surfaces are a fifth of a millimetre apart, cusps between cusps.
const OCCLUSION: f64 = -1.0;

/// The middle line of a dental arch, seen from above: half an ellipse with straight ends. x to the right, y to the front.
struct Arch {
    half_width: f64,
    depth: f64,
    /// Points on the right half from the middle backwards, evenly spaced, with the length of arc up to each.
    points: Vec<([f64; 2], f64)>,
    /// Width of the base outside and inside the line, millimetres.
    half_base: [f64; 2],
}

/// Length of the straight end behind the last tooth, millimetres.
const STRAIGHT: f64 = 9.0;
/// How the ends diverge, per millimetre.
const DIVERGENCE: f64 = 0.008;

impl Arch {
    fn new(half_width: f64, depth: f64) -> Self {
        let mut arch = Self { half_width, depth, points: Vec::new(), half_base: [10.0; 2] };
        let steps = 2000;
        let mut length = 0.0;
        let mut last = arch.ellipse(0.0);
        for i in 0..=steps {
            let point = arch.ellipse(std::f64::consts::FRAC_PI_2 * f64::from(i) / f64::from(steps));
            let [dx, dy] = [point[0] - last[0], point[1] - last[1]];
            length += (dx * dx + dy * dy).sqrt();
            arch.points.push((point, length));
            last = point;
        }
        arch
    }

    fn ellipse(&self, angle: f64) -> [f64; 2] {
        [self.half_width * libm::sin(angle), self.depth * libm::cos(angle)]
    }

    /// From the middle to the end of one side.
    fn half_length(&self) -> f64 {
        self.points[self.points.len() - 1].1 + STRAIGHT
    }

    /// Point and outward direction at a length of arc from the middle, positive to the right.
    fn at(&self, s: f64) -> ([f64; 2], [f64; 2]) {
        let side = if s < 0.0 { -1.0 } else { 1.0 };
        let s = s.abs();
        let curved = self.points[self.points.len() - 1].1;
        if s >= curved {
            // Slightly diverging, as a jaw is.
            let t = s - curved;
            let slope = 2.0 * DIVERGENCE * t;
            let length = (1.0 + slope * slope).sqrt();
            return ([side * (self.half_width + DIVERGENCE * t * t), -t], [side / length, slope / length]);
        }
        let after = self.points.partition_point(|p| p.1 <= s).max(1);
        let ((a, sa), (b, sb)) = (self.points[after - 1], self.points[after]);
        let f = (s - sa) / (sb - sa);
        let point = [a[0] + (b[0] - a[0]) * f, a[1] + (b[1] - a[1]) * f];
        // The ellipse's normal.
        let normal = [point[0] / (self.half_width * self.half_width), point[1] / (self.depth * self.depth)];
        let length = (normal[0] * normal[0] + normal[1] * normal[1]).sqrt();
        ([side * point[0], point[1]], [side * normal[0] / length, normal[1] / length])
    }
}

/// The lower jaw in metres: tips of the teeth near z = 0, base below.
pub(crate) fn lower() -> Shape {
    let arch = Arch { half_base: [10.5, 11.5], ..Arch::new(35.0, 49.0) };
    sweep(&arch, &lower_teeth(), [287, 70], false)
}

/// The upper jaw in metres: tips of the teeth near z = 0, base above.
pub(crate) fn upper() -> Shape {
    let arch = Arch { half_base: [7.5, 12.5], ..Arch::new(38.5, 53.0) };
    sweep(&arch, &upper_teeth(), [263, 90], true)
}

/// Sweeps the section along the arch through `stations` places with `around` vertices each.
fn sweep(arch: &Arch, teeth: &[Tooth], [stations, around]: [usize; 2], upper: bool) -> Shape {
    let mut shape = Shape::default();
    let places = places(arch, teeth, stations);
    let mut rings: Vec<Vec<u32>> = Vec::with_capacity(stations);
    let middle_height = Section::BASE * 0.5;
    let place = |s: f64, across: f64, z: f64| -> Point {
        let (p, out) = arch.at(s);
        let z = if upper { OCCLUSION - z } else { z };
        [p[0] + out[0] * across, p[1] + out[1] * across, z]
    };
    for &s in &places {
        let outline = Section::at(s, teeth, arch.half_base).outline(around);
        rings.push(outline.iter().map(|&[across, z]| shape.vertex(place(s, across, z))).collect());
    }
    let ends = [places[0], places[places.len() - 1]].map(|s| shape.vertex(place(s, 0.0, middle_height)));
    if upper {
        for ring in &mut rings {
            ring.reverse();
        }
    }
    for pair in rings.windows(2) {
        shape.band(&pair[0], &pair[1]);
    }
    if let (Some(first), Some(last)) = (rings.first(), rings.last()) {
        let reversed: Vec<u32> = first.iter().rev().copied().collect();
        shape.fan(&reversed, ends[0]);
        shape.fan(last, ends[1]);
    }
    shape.shift_and_scale([0.0; 3], SCALE);
    shape
}

/// Lengths of arc of the sections: each tooth and each end gets its share, so that the gaps between teeth lie on sections.
fn places(arch: &Arch, teeth: &[Tooth], stations: usize) -> Vec<f64> {
    let end = arch.half_length();
    let mut borders = vec![-end];
    borders.extend(teeth.iter().map(|t| t.center - 0.5 * t.width));
    borders.push(teeth[teeth.len() - 1].center + 0.5 * teeth[teeth.len() - 1].width);
    borders.push(end);
    // Sections are counted from the start: border i comes at the section nearest to its share of the length.
    let total = 2.0 * end;
    let at: Vec<usize> =
        borders.iter().map(|b| ((b + end) / total * (stations - 1) as f64 + 0.5).floor() as usize).collect();
    let mut places = Vec::with_capacity(stations);
    for i in 1..borders.len() {
        let count = at[i] - at[i - 1];
        for k in 0..count {
            places.push(borders[i - 1] + (borders[i] - borders[i - 1]) * k as f64 / count as f64);
        }
    }
    places.push(end);
    places
}
