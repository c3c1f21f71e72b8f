//! Triangles of one mesh that cut through each other, found without the library's own queries.

use std::collections::{BTreeMap, BTreeSet};

use hapteron_collision::mesh::TriMesh;

use crate::assets::shape::{Point, cross, dot, length, subtract};

/// Pairs of triangles without a common vertex of which an edge of one passes through the other.
///
/// Two triangles in general position intersect exactly when this is so for one of their six edges.
pub fn intersecting_pairs(mesh: &TriMesh) -> Vec<(usize, usize)> {
    let corners: Vec<[Point; 3]> =
        mesh.triangles().iter().map(|t| t.map(|i| mesh.vertices()[i as usize])).collect();
    let cell = cell_size(&corners);
    let mut grid: BTreeMap<[i64; 3], Vec<usize>> = BTreeMap::new();
    for (index, triangle) in corners.iter().enumerate() {
        let [low, high] = bounds(triangle).map(|p| p.map(|x| (x / cell).floor() as i64));
        for x in low[0]..=high[0] {
            for y in low[1]..=high[1] {
                for z in low[2]..=high[2] {
                    grid.entry([x, y, z]).or_default().push(index);
                }
            }
        }
    }
    let mut found = BTreeSet::new();
    for members in grid.values() {
        for (position, &first) in members.iter().enumerate() {
            for &second in &members[position + 1..] {
                let (a, b) = (mesh.triangles()[first], mesh.triangles()[second]);
                if a.iter().any(|i| b.contains(i)) || !overlap(&corners[first], &corners[second]) {
                    continue;
                }
                if crosses(&corners[first], &corners[second]) || crosses(&corners[second], &corners[first]) {
                    found.insert((first, second));
                }
            }
        }
    }
    found.into_iter().collect()
}

/// Twice the mean size of the triangles' boxes: few triangles a cell, few cells a triangle.
fn cell_size(corners: &[[Point; 3]]) -> f64 {
    let sum: f64 = corners
        .iter()
        .map(|triangle| {
            let [low, high] = bounds(triangle);
            (0..3).map(|axis| high[axis] - low[axis]).fold(0.0, f64::max)
        })
        .sum();
    2.0 * sum / corners.len() as f64
}

fn bounds(triangle: &[Point; 3]) -> [Point; 2] {
    let [a, b, c] = triangle;
    [[0, 1, 2].map(|k| a[k].min(b[k]).min(c[k])), [0, 1, 2].map(|k| a[k].max(b[k]).max(c[k]))]
}

fn overlap(first: &[Point; 3], second: &[Point; 3]) -> bool {
    let ([low_a, high_a], [low_b, high_b]) = (bounds(first), bounds(second));
    (0..3).all(|k| low_a[k] <= high_b[k] && low_b[k] <= high_a[k])
}

/// Whether an edge of `edges` passes through `triangle` (touching counts).
fn crosses(edges: &[Point; 3], triangle: &[Point; 3]) -> bool {
    let [a, b, c] = *triangle;
    let normal = cross(subtract(b, a), subtract(c, a));
    (0..3).any(|k| {
        let (from, to) = (edges[k], edges[(k + 1) % 3]);
        let (before, after) = (dot(subtract(from, a), normal), dot(subtract(to, a), normal));
        // An edge in the triangle's plane, up to rounding, is a neighbour's in a flat part: it decides nothing.
        if before * after > 0.0 || before.abs().max(after.abs()) < 1e-12 * length(normal) {
            return false;
        }
        // Signs of the volumes that the edge spans with the triangle's sides.
        let direction = subtract(to, from);
        let side = |p: Point, q: Point| dot(direction, cross(subtract(p, from), subtract(q, from)));
        let sides = [side(a, b), side(b, c), side(c, a)];
        sides.iter().all(|&s| s >= 0.0) || sides.iter().all(|&s| s <= 0.0)
    })
}

#[test]
fn the_search_finds_two_crossing_sheets() {
    // Would catch a search that never finds anything, which would make every other use of it pass.
    let vertices = vec![
        [-1.0, -1.0, 0.0],
        [1.0, -1.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, 0.1, -1.0],
        [0.1, 0.0, 1.0],
        [0.0, 3.0, 0.5],
        [0.0, 0.1, 5.0],
        [0.1, 0.0, 6.0],
        [0.0, 3.0, 5.5],
    ];
    let triangles = vec![[0, 1, 2], [3, 4, 5], [6, 7, 8]];
    let mesh = TriMesh::new(vertices, triangles).unwrap();
    assert_eq!(intersecting_pairs(&mesh), vec![(0, 1)]);
}
