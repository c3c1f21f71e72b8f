//! The linear solver of the condensed step and of the quasi-static balance: six equations.

use nalgebra::{Matrix6, Vector6};

/// Gaussian elimination with partial pivoting; `None` when a pivot is zero or not a number.
///
/// Real time: bounded work, no panic.
pub(super) fn solve6(mut a: Matrix6<f64>, mut b: Vector6<f64>) -> Option<Vector6<f64>> {
    for column in 0..6 {
        let mut pivot = column;
        for row in column + 1..6 {
            if a[(row, column)].abs() > a[(pivot, column)].abs() {
                pivot = row;
            }
        }
        if !(a[(pivot, column)].abs() > 0.0) {
            return None;
        }
        if pivot != column {
            a.swap_rows(pivot, column);
            b.swap_rows(pivot, column);
        }
        let inverse = 1.0 / a[(column, column)];
        for row in column + 1..6 {
            let factor = a[(row, column)] * inverse;
            for k in column + 1..6 {
                a[(row, k)] -= factor * a[(column, k)];
            }
            b[row] -= factor * b[column];
        }
    }
    for row in (0..6).rev() {
        for k in row + 1..6 {
            b[row] -= a[(row, k)] * b[k];
        }
        b[row] /= a[(row, row)];
    }
    Some(b)
}
