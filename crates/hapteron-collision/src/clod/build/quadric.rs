//! Sums of squared distances to planes (Garland and Heckbert 1997), weighted by area.

use crate::vector::{Vec3, add, cross, dot, scale, sub};
use nalgebra::{Matrix3, Vector3};

/// Directions in which the quadric is flatter than this, relative to its steepest, are left alone.
const FLAT: f64 = 1e-3;

/// x^T A x + 2 b^T x + c, and the sum of the weights.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Quadric {
    /// xx, xy, xz, yy, yz, zz.
    a: [f64; 6],
    b: Vec3,
    c: f64,
    weight: f64,
}

impl Quadric {
    /// Of the plane through `point` with a unit normal.
    pub(super) fn plane(normal: Vec3, point: Vec3, weight: f64) -> Self {
        let [x, y, z] = normal;
        let offset = -dot(normal, point);
        Self {
            a: [x * x, x * y, x * z, y * y, y * z, z * z].map(|c| c * weight),
            b: scale(normal, offset * weight),
            c: offset * offset * weight,
            weight,
        }
    }

    /// Of a triangle, weighted by its area.
    pub(super) fn triangle([p, q, r]: [Vec3; 3]) -> Self {
        let n = cross(sub(q, p), sub(r, p));
        let twice = dot(n, n).sqrt();
        if twice > 0.0 { Self::plane(scale(n, 1.0 / twice), p, 0.5 * twice) } else { Self::default() }
    }

    pub(super) fn add(&mut self, other: &Self) {
        for k in 0..6 {
            self.a[k] += other.a[k];
        }
        self.b = add(self.b, other.b);
        self.c += other.c;
        self.weight += other.weight;
    }

    /// Root mean square distance of a point to the planes.
    pub(super) fn distance(&self, p: Vec3) -> f64 {
        let [x, y, z] = p;
        let [xx, xy, xz, yy, yz, zz] = self.a;
        let square = x * (xx * x + 2.0 * (xy * y + xz * z)) + y * (yy * y + 2.0 * yz * z) + zz * z * z;
        let sum = square + 2.0 * dot(self.b, p) + self.c;
        if self.weight > 0.0 { (sum.max(0.0) / self.weight).sqrt() } else { 0.0 }
    }

    /// The minimiser nearest to `start`: directions in which the quadric says nothing stay as they are.
    pub(super) fn minimiser(&self, start: Vec3) -> Vec3 {
        let [xx, xy, xz, yy, yz, zz] = self.a;
        let a = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
        let from = Vector3::from(start);
        let slope = a * from + Vector3::from(self.b);
        let eigen = a.symmetric_eigen();
        let steepest = eigen.eigenvalues.amax();
        let mut step = Vector3::zeros();
        for k in 0..3 {
            let value = eigen.eigenvalues[k];
            if value > FLAT * steepest {
                let axis = eigen.eigenvectors.column(k);
                step -= axis * (axis.dot(&slope) / value);
            }
        }
        (from + step).into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Would catch a wrong sign or a wrong weight: three walls meet in one corner, two in the nearest point of a line.
    #[test]
    fn the_minimiser_is_the_corner_of_the_walls() {
        let mut q = Quadric::plane([1.0, 0.0, 0.0], [2.0, 5.0, 5.0], 3.0);
        q.add(&Quadric::plane([0.0, 1.0, 0.0], [7.0, -1.0, 5.0], 0.5));
        let on_line = q.minimiser([0.0, 0.0, 9.0]);
        assert!(on_line.iter().zip([2.0, -1.0, 9.0]).all(|(a, b)| (a - b).abs() < 1e-9), "{on_line:?}");
        q.add(&Quadric::plane([0.0, 0.0, 1.0], [7.0, -1.0, 4.0], 1.0));
        let corner = q.minimiser([0.0; 3]);
        assert!(corner.iter().zip([2.0, -1.0, 4.0]).all(|(a, b)| (a - b).abs() < 1e-9), "{corner:?}");
    }
}
