//! The teeth of both jaws.

/// One tooth of an arch. Lengths in millimetres, heights over the gum line of the tooth.
#[derive(Clone, Debug)]
pub struct Tooth {
    /// Length of arc of its middle, from the middle of the jaw, positive to the right.
    pub center: f64,
    /// Along the arch.
    pub width: f64,
    /// Half the thickness at the equator, on the cheek's and on the tongue's side.
    pub half_thickness: [f64; 2],
    /// Distance of the cusps from the middle line, cheek and tongue.
    pub tips: [f64; 2],
    /// Cusps on the cheek's and on the tongue's side: place along the tooth (-1 to 1, to the back) and height.
    pub cusps: [&'static [[f64; 2]]; 2],
    /// Height of the fissure's floor.
    pub floor: f64,
    /// How steeply a cusp falls off along the tooth: height lost at half the tooth's width.
    pub slope: f64,
    /// +1 on the right side, -1 on the left: turns "to the back" into a direction along the arch.
    pub side: f64,
}

/// How much larger than life the teeth are.
const ENLARGED: f64 = 1.24;

/// A kind of tooth, life size; fields as in [`Tooth`].
struct Kind {
    width: f64,
    half_thickness: [f64; 2],
    tips: [f64; 2],
    cusps: [&'static [[f64; 2]]; 2],
    floor: f64,
    slope: f64,
}

type Cusps = &'static [[f64; 2]];

const fn kind(
    width: f64,
    half_thickness: [f64; 2],
    tips: [f64; 2],
    cusps: [Cusps; 2],
    heights: [f64; 2],
) -> Kind {
    Kind { width, half_thickness, tips, cusps, floor: heights[0], slope: heights[1] }
}

/// From the middle backwards: two incisors, canine, two premolars, two molars.
#[rustfmt::skip]
const LOWER: [Kind; 7] = [
    kind(5.3, [2.7, 3.1], [0.8, 0.8], [&[[0.0, 8.2]], &[[0.0, 8.1]]], [8.0, 0.35]),
    kind(5.7, [2.9, 3.2], [0.8, 0.8], [&[[0.1, 8.3]], &[[0.1, 8.2]]], [8.1, 0.40]),
    kind(6.8, [3.6, 3.7], [1.0, 0.9], [&[[-0.1, 8.5]], &[[-0.1, 8.0]]], [8.0, 3.0]),
    kind(7.0, [3.9, 3.7], [1.5, 2.2], [&[[-0.05, 8.2]], &[[-0.1, 7.0]]], [6.3, 3.0]),
    kind(7.1, [4.1, 4.1], [1.9, 2.3], [&[[-0.05, 8.2]], &[[-0.45, 8.0], [0.45, 7.8]]], [6.5, 3.4]),
    kind(11.2, [5.2, 5.1], [2.9, 3.0], [&[[-0.58, 8.7], [0.08, 8.7], [0.66, 8.2]], &[[-0.48, 8.9], [0.42, 8.8]]], [6.2, 7.0]),
    kind(10.5, [5.1, 5.0], [2.9, 2.9], [&[[-0.48, 8.5], [0.46, 8.4]], &[[-0.48, 8.6], [0.46, 8.5]]], [6.0, 6.5]),
];

#[rustfmt::skip]
const UPPER: [Kind; 7] = [
    kind(8.5, [3.1, 3.6], [0.85, 0.85], [&[[-0.1, 8.8]], &[[-0.1, 8.7]]], [8.6, 0.35]),
    kind(6.6, [2.9, 3.2], [0.85, 0.85], [&[[-0.1, 8.3]], &[[-0.1, 8.2]]], [8.1, 0.60]),
    kind(7.6, [3.8, 4.0], [1.0, 1.0], [&[[-0.05, 8.8]], &[[-0.05, 8.2]]], [8.2, 3.3]),
    kind(7.1, [4.4, 4.4], [2.5, 2.5], [&[[0.05, 8.8]], &[[-0.15, 8.2]]], [6.5, 3.6]),
    kind(6.8, [4.4, 4.4], [2.4, 2.4], [&[[0.0, 8.7]], &[[-0.1, 8.5]]], [6.6, 3.2]),
    kind(10.4, [5.5, 5.7], [3.0, 3.1], [&[[-0.50, 8.9], [0.44, 8.7]], &[[-0.42, 9.1], [0.56, 8.1]]], [6.2, 6.4]),
    kind(9.8, [5.4, 5.5], [2.9, 3.0], [&[[-0.48, 8.6], [0.46, 8.2]], &[[-0.40, 8.8], [0.58, 7.6]]], [6.0, 6.0]),
];

/// The lower teeth from the left end to the right one.
pub fn lower_teeth() -> Vec<Tooth> {
    arrange(&LOWER)
}

/// The upper teeth from the left end to the right one.
pub fn upper_teeth() -> Vec<Tooth> {
    arrange(&UPPER)
}

fn arrange(kinds: &[Kind; 7]) -> Vec<Tooth> {
    let mut right = Vec::with_capacity(kinds.len());
    let mut border = 0.0;
    for kind in kinds {
        let width = kind.width * ENLARGED;
        right.push(Tooth {
            center: border + 0.5 * width,
            width,
            half_thickness: kind.half_thickness.map(|x| x * ENLARGED),
            tips: kind.tips.map(|x| x * ENLARGED),
            cusps: kind.cusps,
            floor: kind.floor * ENLARGED,
            slope: kind.slope * ENLARGED,
            side: 1.0,
        });
        border += width;
    }
    let mirrored = right.iter().rev().map(|t| Tooth { center: -t.center, side: -1.0, ..t.clone() });
    mirrored.chain(right.iter().cloned()).collect()
}

impl Tooth {
    /// Height of the row of cusps on one side (0 cheek, 1 tongue) at a place along the tooth (-1 to 1, to the back).
    pub fn ridge(&self, side: usize, along: f64) -> f64 {
        let mut sum = 0.0;
        // A smooth maximum: the fissures between cusps are rounded over a tenth of a millimetre.
        let sharpness = 4.0;
        for &[place, height] in self.cusps[side] {
            let away = along - place;
            // Straight flanks with a rounded tip.
            let fall = self.slope * ((away * away + 0.01).sqrt() - 0.1);
            sum += libm::exp(sharpness * (height * ENLARGED - fall - self.floor));
        }
        self.floor + libm::log(sum) / sharpness
    }

    /// Height of the fissure between the rows: a groove along the tooth, deepest in its pits, closed by ridges at both ends.
    pub fn fissure(&self, along: f64) -> f64 {
        let rows = self.ridge(0, along).min(self.ridge(1, along));
        let depth = rows - self.floor;
        let end_ridge = 0.75 * libm::pow(along.abs(), 4.0);
        // Never above the lower row, so that there is a valley everywhere.
        (self.floor + depth.max(0.0) * end_ridge).min(rows)
    }
}
