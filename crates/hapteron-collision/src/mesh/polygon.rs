//! Faces with more than three corners, cut into triangles.

use crate::vector::{Vec3, add, cross, dot, sub};

/// Faces with more corners are cut like convex ones, so that a damaged file takes no time that grows with a power of its size.
const MOST_CORNERS: usize = 256;

/// Cuts a polygon into triangles that share its first corner.
pub(super) fn fan(corners: &[u32], triangles: &mut Vec<[u32; 3]>) {
    for pair in corners.windows(2).skip(1) {
        triangles.push([corners[0], pair[0], pair[1]]);
    }
}

/// Cuts a polygon into triangles: a convex one (or one that its first corner sees whole) from its first corner, any other one ear by
/// ear. The corners must be indices of vertices. Where no ear is left (a polygon that crosses itself), it is cut from the first corner.
pub(super) fn cut(corners: &[u32], vertices: &[Vec3], triangles: &mut Vec<[u32; 3]>) {
    let begin = triangles.len();
    fan(corners, triangles);
    if corners.len() <= 3 || corners.len() > MOST_CORNERS {
        return;
    }
    let area = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| vertices[v as usize]);
        cross(sub(b, a), sub(c, a))
    };
    let normal = triangles[begin..].iter().fold([0.0; 3], |sum, t| add(sum, area(t)));
    if triangles[begin..].iter().all(|t| dot(area(t), normal) >= 0.0) {
        return;
    }
    if let Some(ears) = ears(corners, vertices, normal) {
        triangles.truncate(begin);
        triangles.extend(ears);
    }
}

/// The triangles of a simple polygon, by cutting off one corner after the other; `None` when that does not work out.
fn ears(corners: &[u32], vertices: &[Vec3], normal: Vec3) -> Option<Vec<[u32; 3]>> {
    let along = |k: usize| normal[k].abs();
    let drop = if along(0) > along(1).max(along(2)) { 0 } else { 1 + usize::from(along(2) >= along(1)) };
    // Seen along the axis that the face is most across to, so that the corners run counter-clockwise.
    let [x, y] =
        if normal[drop] > 0.0 { [(drop + 1) % 3, (drop + 2) % 3] } else { [(drop + 2) % 3, (drop + 1) % 3] };
    let points: Vec<[f64; 2]> =
        corners.iter().map(|&v| [vertices[v as usize][x], vertices[v as usize][y]]).collect();
    let turn = |[a, b, c]: [usize; 3]| {
        let [a, b, c] = [points[a], points[b], points[c]];
        (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    };
    let holds = |[a, b, c]: [usize; 3], p: usize| {
        ![a, b, c].iter().any(|&q| points[q] == points[p])
            && turn([a, b, p]) >= 0.0
            && turn([b, c, p]) >= 0.0
            && turn([c, a, p]) >= 0.0
    };
    let mut rest: Vec<usize> = (0..corners.len()).collect();
    let mut found = Vec::with_capacity(corners.len());
    while rest.len() >= 3 {
        let at = |i: usize| {
            let count = rest.len();
            [rest[(i + count - 1) % count], rest[i], rest[(i + 1) % count]]
        };
        let is_ear = |&i: &usize| turn(at(i)) > 0.0 && !rest.iter().any(|&p| holds(at(i), p));
        // A corner in the middle of a straight side is no ear, but may be all that is left.
        let ear = (0..rest.len()).find(is_ear).or_else(|| (0..rest.len()).find(|&i| turn(at(i)) == 0.0))?;
        found.push(at(ear).map(|k| corners[k]));
        rest.remove(ear);
    }
    Some(found)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// Whether a point lies in a triangle of the plane z = 0.
    fn covers(t: &[u32; 3], vertices: &[Vec3], p: [f64; 2]) -> bool {
        let [a, b, c] = t.map(|v| vertices[v as usize]);
        let side = |a: Vec3, b: Vec3| (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]) > 0.0;
        side(a, b) == side(b, c) && side(b, c) == side(c, a)
    }

    /// Would catch a notch that is filled: triangles of polygons that are not convex must cover the polygon once and nothing else,
    /// whichever corner comes first and from whichever side it is seen. Points are in a polygon where a ray crosses it an odd number of times.
    #[test]
    fn polygons_that_are_not_convex_are_covered_once() {
        let shapes: [&[[f64; 2]]; 3] = [
            &[[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]],
            &[[0.0, 0.0], [1.0, 0.5], [2.0, 0.0], [1.0, 2.0]],
            // A comb, with corners in the middle of straight sides.
            &[
                [0.0, 0.0],
                [1.0, 0.0],
                [2.0, 0.0],
                [2.0, 2.0],
                [1.6, 2.0],
                [1.5, 0.5],
                [1.1, 0.5],
                [1.1, 2.0],
                [0.9, 2.0],
                [0.9, 0.5],
                [0.5, 0.5],
                [0.4, 2.0],
                [0.0, 2.0],
                [0.0, 1.0],
            ],
        ];
        for shape in shapes {
            for first in 0..shape.len() {
                for back in [false, true] {
                    let vertices: Vec<Vec3> = shape.iter().map(|p| [p[0], p[1], 0.0]).collect();
                    let mut corners: Vec<u32> = (0..shape.len() as u32).collect();
                    corners.rotate_left(first);
                    if back {
                        corners.reverse();
                    }
                    let mut triangles = Vec::new();
                    cut(&corners, &vertices, &mut triangles);
                    for step in 0..40 * 40 {
                        let p =
                            [f64::from(step % 40) * 0.0517 + 0.0031, f64::from(step / 40) * 0.0523 + 0.0017];
                        let crossed = (0..shape.len()).filter(|&i| {
                            let (a, b) = (shape[i], shape[(i + 1) % shape.len()]);
                            (a[1] > p[1]) != (b[1] > p[1])
                                && p[0] < a[0] + (p[1] - a[1]) / (b[1] - a[1]) * (b[0] - a[0])
                        });
                        let covered = triangles.iter().filter(|t| covers(t, &vertices, p)).count();
                        assert_eq!(covered, crossed.count() % 2, "{p:?} {corners:?} {triangles:?}");
                    }
                    let up = |t: &[u32; 3]| {
                        let [a, b, c] = t.map(|v| vertices[v as usize]);
                        cross(sub(b, a), sub(c, a))[2]
                    };
                    assert!(triangles.iter().all(|t| if back { up(t) <= 0.0 } else { up(t) >= 0.0 }));
                }
            }
        }
    }

    /// Would catch an endless loop or a panic: polygons that cross themselves, fold back or have no area at all still give triangles.
    #[test]
    fn any_polygon_is_cut() {
        let vertices =
            [[0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [f64::NAN, 0.0, 0.0]];
        let lists: [&[u32]; 5] =
            [&[0, 1, 2, 3], &[0, 1, 0, 1, 0], &[0, 0, 0, 0], &[4, 1, 2, 3], &[0, 2, 1, 3, 0, 1]];
        for corners in lists {
            let mut triangles = Vec::new();
            cut(corners, &vertices, &mut triangles);
            assert_eq!(triangles.len(), corners.len() - 2);
        }
    }
}
