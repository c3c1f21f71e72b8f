//! The cross section of a jaw: base, gum and crown.

use super::teeth::Tooth;

/// A section, millimetres. Outward (towards lip and cheek) is positive; the gum line is at [`Section::GUM`], tips are near 0.
#[derive(Clone, Debug)]
pub struct Section {
    /// Control points from the outer edge of the base over the crown to the inner edge.
    points: [[f64; 2]; CONTROL],
}

/// Control points of the open outline; the underside closes it.
const CONTROL: usize = 17;
/// Spans of the outline between control points, and how densely each is sampled, from the outer edge to the fissure.
const DENSITY: [f64; 8] = [3.0, 2.0, 3.0, 2.0, 5.0, 7.0, 5.0, 4.0];
/// How far the crown's surface dips between two teeth, as a share of its height.
const DIP: f64 = 0.2;
/// Share of the vertices on the underside.
const UNDERSIDE: f64 = 8.0 / 70.0;

impl Section {
    /// Height of the gum line.
    pub const GUM: f64 = -10.3;
    /// Height of the underside.
    pub const BASE: f64 = -25.0;
    /// The section at a length of arc; `half_base` is the width of the base outside and inside the middle line.
    pub fn at(s: f64, teeth: &[Tooth], half_base: [f64; 2]) -> Self {
        let distance = |t: &Tooth| (s - t.center).abs() - 0.5 * t.width;
        let nearest = teeth.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)));
        let crown = nearest.map(|t| Crown::of(t, s)).unwrap_or_else(|| Crown::gum(0.0));
        Self { points: crown.control_points(half_base) }
    }

    /// `count` points of the closed outline, counter-clockwise about the direction of growing arc length.
    pub fn outline(&self, count: usize) -> Vec<[f64; 2]> {
        let underside = (UNDERSIDE * count as f64 + 0.5).floor() as usize;
        let half = (count - underside) / 2;
        let density: f64 = DENSITY.iter().sum();
        let mut outline = Vec::with_capacity(count);
        let mut taken = 0;
        let mut share = 0.0;
        let mut counts = [0; 8];
        for (n, d) in counts.iter_mut().zip(DENSITY) {
            share += d;
            let until = (share / density * half as f64 + 0.5).floor() as usize;
            *n = until - taken;
            taken = until;
        }
        for span in 0..CONTROL - 1 {
            let n = counts[span.min(CONTROL - 2 - span)];
            for k in 0..n {
                outline.push(self.between(span, k as f64 / n as f64));
            }
        }
        let [first, last] = [self.points[0], self.points[CONTROL - 1]];
        let rest = count - outline.len();
        for k in 0..rest {
            let f = k as f64 / rest as f64;
            outline.push([last[0] + (first[0] - last[0]) * f, last[1] + (first[1] - last[1]) * f]);
        }
        outline
    }

    /// Catmull-Rom spline through the control points.
    fn between(&self, span: usize, t: f64) -> [f64; 2] {
        let p = |i: isize| self.points[i.clamp(0, CONTROL as isize - 1) as usize];
        let i = span as isize;
        let [a, b, c, d] = [p(i - 1), p(i), p(i + 1), p(i + 2)];
        let (t2, t3) = (t * t, t * t * t);
        std::array::from_fn(|k| {
            let linear = c[k] - a[k];
            let square = 2.0 * a[k] - 5.0 * b[k] + 4.0 * c[k] - d[k];
            let cube = 3.0 * (b[k] - c[k]) + d[k] - a[k];
            0.5 * (2.0 * b[k] + linear * t + square * t2 + cube * t3)
        })
    }
}

/// What a section needs to know of the tooth it cuts.
struct Crown {
    /// Half thickness at the equator, cheek and tongue, and where it leaves the gum.
    equator: [f64; 2],
    neck: [f64; 2],
    /// Height of the equator over the gum line.
    equator_height: f64,
    /// Distance of the rows of cusps from the middle.
    tips: [f64; 2],
    /// Heights over the gum line: rows of cusps and fissure.
    rows: [f64; 2],
    fissure: f64,
    /// How much higher the gum stands here than at the middle of a tooth.
    papilla: f64,
}

impl Crown {
    fn of(tooth: &Tooth, s: f64) -> Self {
        let along = 2.0 * (s - tooth.center) / tooth.width * tooth.side;
        let beyond = along.abs() - 1.0;
        if beyond > 1e-9 {
            return Self::gum(beyond * 0.5 * tooth.width);
        }
        let u = along.clamp(-1.0, 1.0);
        // Seen from above a crown is round at its corners; at the contact with its neighbour two thirds of it are left.
        let roundness = 1.0 - libm::pow(u.abs(), 4.5);
        let round = 0.62 + 0.38 * roundness.max(0.0).sqrt();
        // Between two teeth the surface dips towards the gum.
        let dip = libm::pow(u.abs(), 7.0);
        let lower = |height: f64| height - dip * DIP * height;
        Self {
            equator: tooth.half_thickness.map(|x| x * round),
            neck: tooth.half_thickness.map(|x| 0.88 * x * (0.3 + 0.7 * round)),
            equator_height: 0.45 * tooth.floor,
            tips: tooth.tips.map(|x| x * (0.75 + 0.25 * roundness)),
            rows: [lower(tooth.ridge(0, u)), lower(tooth.ridge(1, u))],
            fissure: lower(tooth.fissure(u)),
            papilla: 1.9 * libm::pow(u.abs(), 3.0),
        }
    }

    /// The gum behind the last tooth, at a distance from it.
    fn gum(distance: f64) -> Self {
        let low = 1.0 + 3.2 * libm::exp(-distance / 1.2);
        let thick = 3.6 + 0.5 * low;
        Self {
            equator: [thick, thick],
            neck: [thick + 0.9, thick + 0.9],
            equator_height: 0.62 * low,
            tips: [2.4, 2.4],
            rows: [low, low],
            fissure: low + 0.25,
            papilla: 0.0,
        }
    }

    fn control_points(&self, half_base: [f64; 2]) -> [[f64; 2]; CONTROL] {
        let mut points = [[0.0; 2]; CONTROL];
        for (side, sign) in [(0, 1.0), (1, -1.0)] {
            let gum = Section::GUM + self.papilla;
            let (thick, tip) = (self.equator[side], self.tips[side]);
            let top = Section::GUM + self.rows[side];
            let fissure = Section::GUM + self.fissure;
            let base = half_base[side];
            let equator = (Section::GUM + self.equator_height)
                .max(gum + 0.4 * (top - gum))
                .min(gum + 0.7 * (top - gum));
            let neck = self.neck[side];
            let flank = [
                [base, Section::BASE],
                [base, Section::GUM - 7.5],
                [base - 2.2, Section::GUM - 3.4],
                [1.06 * neck + 0.75, gum - 0.65],
                [neck, gum + 0.3],
                [thick, equator],
                [tip, top],
                [0.52 * tip, 0.46 * top + 0.54 * fissure],
            ];
            for (i, [across, z]) in flank.into_iter().enumerate() {
                let place = if side == 0 { i } else { CONTROL - 1 - i };
                points[place] = [sign * across, z];
            }
        }
        points[CONTROL / 2] = [0.0, Section::GUM + self.fissure];
        points
    }
}
