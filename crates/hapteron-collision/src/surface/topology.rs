//! Shared vertices, edges and pseudo-normals of a triangle list.

use super::{Edge, EdgeKind, VertexNormal};
use crate::vector::{Vec3, add, cross, dot, norm, scale, sub, unit_or_zero};

/// Added to a vertex's normal cone before a contact is refused for its direction. Surfaces that lean apart by more than
/// this are within the tolerance only close to a nearer contact.
const CONE_MARGIN: f64 = core::f64::consts::FRAC_PI_4;
/// Faces that bend apart by less than this (as 1 - cosine) count as one plane.
const FLAT: f64 = 1e-12;

/// Vertices that coincide exactly become one; triangles that lose a corner by it are left out.
pub(super) fn weld(vertices: &[Vec3], triangles: &[[u32; 3]]) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let mut order: Vec<u32> = (0..vertices.len() as u32).collect();
    // Adding zero turns -0 into 0, so that both weld.
    let key = |i: u32| vertices[i as usize].map(|c| (c + 0.0).to_bits());
    order.sort_unstable_by_key(|&i| (key(i), i));
    let mut renamed = vec![0u32; vertices.len()];
    let mut first = order.first().copied().unwrap_or(0);
    for &i in &order {
        if key(i) != key(first) {
            first = i;
        }
        renamed[i as usize] = first;
    }
    let mut kept = Vec::new();
    let mut index = vec![u32::MAX; vertices.len()];
    let mut faces = Vec::with_capacity(triangles.len());
    for triangle in triangles {
        let t = triangle.map(|v| renamed[v as usize]);
        if t[0] == t[1] || t[1] == t[2] || t[2] == t[0] {
            continue;
        }
        faces.push(t.map(|v| {
            if index[v as usize] == u32::MAX {
                index[v as usize] = kept.len() as u32;
                kept.push(vertices[v as usize]);
            }
            index[v as usize]
        }));
    }
    (kept, faces)
}

/// Unit normal of every triangle; zero for one without area.
pub(super) fn face_normals(vertices: &[Vec3], triangles: &[[u32; 3]]) -> Vec<Vec3> {
    triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|v| vertices[v as usize]);
            unit_or_zero(cross(sub(b, a), sub(c, a)))
        })
        .collect()
}

/// The edges, each once, and for every triangle the indices of its three.
pub(super) fn edges(
    vertices: &[Vec3],
    triangles: &[[u32; 3]],
    normals: &[Vec3],
) -> (Vec<Edge>, Vec<[u32; 3]>) {
    let mut halves: Vec<([u32; 2], u32, u8)> = Vec::with_capacity(triangles.len() * 3);
    for (i, t) in triangles.iter().enumerate() {
        for k in 0..3 {
            let (a, b) = (t[k], t[(k + 1) % 3]);
            halves.push(([a.min(b), a.max(b)], i as u32, k as u8));
        }
    }
    halves.sort_unstable();
    let mut list = Vec::with_capacity(halves.len() / 2);
    let mut of_triangle = vec![[0u32; 3]; triangles.len()];
    let mut rest = halves.as_slice();
    while let Some(&(ends, _, _)) = rest.first() {
        let count = rest.iter().take_while(|h| h.0 == ends).count();
        let (group, tail) = rest.split_at(count);
        for &(_, triangle, k) in group {
            of_triangle[triangle as usize][k as usize] = list.len() as u32;
        }
        list.push(edge(vertices, triangles, normals, ends, group));
        rest = tail;
    }
    (list, of_triangle)
}

fn edge(
    vertices: &[Vec3],
    triangles: &[[u32; 3]],
    normals: &[Vec3],
    ends: [u32; 2],
    faces: &[([u32; 2], u32, u8)],
) -> Edge {
    let from = |face: &([u32; 2], u32, u8)| triangles[face.1 as usize][face.2 as usize];
    let sum = faces.iter().fold([0.0; 3], |sum, f| add(sum, normals[f.1 as usize]));
    let mean = unit_or_zero(sum);
    let first = faces[0].1;
    let (kind, normal, cone, second) = match faces {
        [only] => {
            let along = sub(vertices[ends[1] as usize], vertices[ends[0] as usize]);
            let third = triangles[first as usize][(only.2 as usize + 2) % 3];
            let inward = sub(vertices[third as usize], vertices[ends[0] as usize]);
            let outward = sub(scale(along, dot(inward, along) / dot(along, along)), inward);
            (EdgeKind::Boundary, unit_or_zero(outward), 0.0, first)
        }
        [a, b] if from(a) != from(b) => {
            let (n, m) = (normals[a.1 as usize], normals[b.1 as usize]);
            let third = triangles[b.1 as usize][(b.2 as usize + 2) % 3];
            let beyond = dot(n, sub(vertices[third as usize], vertices[ends[0] as usize]));
            let bend = 1.0 - dot(n, m);
            let kind = if beyond < 0.0 && bend > FLAT { EdgeKind::Convex } else { EdgeKind::Hollow };
            (kind, mean, ((1.0 + dot(n, m)).max(0.0) / 2.0).sqrt(), b.1)
        }
        _ => (EdgeKind::Unoriented, mean, -1.0, faces[1].1),
    };
    Edge {
        vertices: ends,
        triangles: [first, second],
        normal: normal.map(|c| c as f32),
        cone: cone as f32,
        kind,
    }
}

/// The edges at each vertex: where each vertex's range begins, and the edges.
pub(super) fn edges_at(vertices: usize, edges: &[Edge]) -> (Vec<u32>, Vec<u32>) {
    let mut begin = vec![0u32; vertices + 1];
    for v in edges.iter().flat_map(|e| e.vertices) {
        begin[v as usize + 1] += 1;
    }
    for i in 0..vertices {
        begin[i + 1] += begin[i];
    }
    let mut next = begin.clone();
    let mut list = vec![0u32; 2 * edges.len()];
    for (edge, ends) in edges.iter().map(|e| e.vertices).enumerate() {
        for v in ends {
            let place = &mut next[v as usize];
            list[*place as usize] = edge as u32;
            *place += 1;
        }
    }
    (begin, list)
}

/// Angle-weighted vertex normals with their cones.
pub(super) fn vertex_normals(
    vertices: &[Vec3],
    triangles: &[[u32; 3]],
    normals: &[Vec3],
    edges: &[Edge],
) -> Vec<VertexNormal> {
    let mut sums = vec![[0.0; 3]; vertices.len()];
    for (t, &n) in triangles.iter().zip(normals) {
        for k in 0..3 {
            let corner = vertices[t[k] as usize];
            let a = sub(vertices[t[(k + 1) % 3] as usize], corner);
            let b = sub(vertices[t[(k + 2) % 3] as usize], corner);
            let angle = libm::atan2(norm(cross(a, b)), dot(a, b));
            sums[t[k] as usize] = add(sums[t[k] as usize], scale(n, angle));
        }
    }
    let mut cones = vec![1.0f64; vertices.len()];
    for sum in &mut sums {
        *sum = unit_or_zero(*sum);
    }
    for (t, &n) in triangles.iter().zip(normals) {
        for &v in t {
            cones[v as usize] = cones[v as usize].min(dot(sums[v as usize], n));
        }
    }
    let mut result: Vec<VertexNormal> = sums
        .iter()
        .zip(&cones)
        .map(|(sum, &cone)| {
            let half = libm::acos(cone.clamp(-1.0, 1.0)) + CONE_MARGIN;
            let cone = if half >= core::f64::consts::PI { -1.0 } else { libm::cos(half) };
            VertexNormal { normal: sum.map(|c| c as f32), cone: cone as f32 }
        })
        .collect();
    for edge in edges.iter().filter(|e| matches!(e.kind, EdgeKind::Boundary | EdgeKind::Unoriented)) {
        for v in edge.vertices {
            result[v as usize].cone = VertexNormal::OPEN;
        }
    }
    result
}
