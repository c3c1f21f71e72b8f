//! Shapes, poses and brute force, written without the library's own geometry.
#![allow(dead_code)] // Each test file uses its share.

use hapteron_collision::mesh::TriMesh;
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use std::path::{Path, PathBuf};

/// Seeded random numbers (SplitMix64).
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// Uniform from -1 to 1.
    pub fn number(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    pub fn vector(&mut self) -> Vector3<f64> {
        Vector3::new(self.number(), self.number(), self.number())
    }

    pub fn pose(&mut self, reach: f64) -> Isometry3<f64> {
        Isometry3::new(self.vector() * reach, self.vector() * 3.0)
    }
}

/// Ball of radius 1 with bumps, from a subdivided octahedron; closed.
pub fn bumpy_ball(levels: usize, bumps: f64) -> TriMesh {
    let mut vertices: Vec<Vector3<f64>> = [
        [1.0, 0.0, 0.0],
        [-1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, -1.0, 0.0],
        [0.0, 0.0, 1.0],
        [0.0, 0.0, -1.0],
    ]
    .map(Vector3::from)
    .to_vec();
    let mut triangles: Vec<[u32; 3]> =
        vec![[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
    for _ in 0..levels {
        let mut middles = std::collections::BTreeMap::new();
        let mut finer = Vec::new();
        for [a, b, c] in triangles {
            let mut middle = |i: u32, j: u32| {
                *middles.entry((i.min(j), i.max(j))).or_insert_with(|| {
                    vertices.push((vertices[i as usize] + vertices[j as usize]).normalize());
                    vertices.len() as u32 - 1
                })
            };
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            finer.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        triangles = finer;
    }
    let bumpy = |v: &Vector3<f64>| {
        let r = 1.0 + bumps * ((5.0 * v.x).sin() * (4.0 * v.y).cos() + (6.0 * v.z + 1.0).sin());
        (v * r).into()
    };
    TriMesh::new(vertices.iter().map(bumpy).collect(), triangles).unwrap()
}

/// A closed box.
pub fn block(half: [f64; 3]) -> TriMesh {
    let vertices =
        (0..8).map(|i| [0, 1, 2].map(|k| if i >> k & 1 == 1 { half[k] } else { -half[k] })).collect();
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    TriMesh::new(vertices, quads.iter().flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]).collect())
        .unwrap()
}

/// A closed ring (torus) about z: not convex, with a hole.
pub fn ring(around: usize, across: usize, radius: f64, thickness: f64) -> TriMesh {
    let angle = |i: usize, n: usize| std::f64::consts::TAU * i as f64 / n as f64;
    let vertices = (0..around * across)
        .map(|i| {
            let (u, v) = (angle(i / across, around), angle(i % across, across));
            let r = radius + thickness * v.cos();
            [r * u.cos(), r * u.sin(), thickness * v.sin()]
        })
        .collect();
    let index = |i: usize, j: usize| (i % around * across + j % across) as u32;
    let quad = |i: usize, j: usize| {
        let [a, b, c, d] = [index(i, j), index(i + 1, j), index(i + 1, j + 1), index(i, j + 1)];
        [[a, b, c], [a, c, d]]
    };
    TriMesh::new(vertices, (0..around * across).flat_map(|k| quad(k / across, k % across)).collect()).unwrap()
}

/// An open wavy sheet.
pub fn sheet(cells: usize) -> TriMesh {
    let n = cells + 1;
    let at = |i: usize| 2.0 * i as f64 / cells as f64 - 1.0;
    let vertices = (0..n * n)
        .map(|k| {
            let (x, y) = (at(k % n), at(k / n));
            [x, y, 0.15 * (3.0 * x).sin() * (2.0 * y).cos()]
        })
        .collect();
    let index = |i: usize, j: usize| (j * n + i) as u32;
    let quad = |i: usize, j: usize| {
        let [a, b, c, d] = [index(i, j), index(i + 1, j), index(i + 1, j + 1), index(i, j + 1)];
        [[a, b, c], [a, c, d]]
    };
    TriMesh::new(vertices, (0..cells * cells).flat_map(|k| quad(k % cells, k / cells)).collect()).unwrap()
}

/// Corners of every triangle, moved.
pub fn corners(mesh: &TriMesh, pose: &Isometry3<f64>) -> Vec<[Vector3<f64>; 3]> {
    let at = |i: u32| (pose * Point3::from(mesh.vertices()[i as usize])).coords;
    mesh.triangles().iter().map(|t| t.map(at)).collect()
}

/// Distance of a point to a triangle: to its plane where the foot is inside, else to its sides.
pub fn point_triangle(p: Vector3<f64>, [a, b, c]: [Vector3<f64>; 3]) -> f64 {
    let normal = (b - a).cross(&(c - a));
    let inside = [(a, b), (b, c), (c, a)].iter().all(|(s, e)| (e - s).cross(&(p - s)).dot(&normal) >= 0.0);
    if inside {
        return ((p - a).dot(&normal) / normal.norm()).abs();
    }
    [(a, b), (b, c), (c, a)]
        .iter()
        .map(|(s, e)| {
            let t = ((p - s).dot(&(e - s)) / (e - s).norm_squared()).clamp(0.0, 1.0);
            (p - s - (e - s) * t).norm()
        })
        .fold(f64::INFINITY, f64::min)
}

/// Distance of two segments whose closest points are both inside; infinite otherwise (their ends are then closest to something).
pub fn middles(p: [Vector3<f64>; 2], q: [Vector3<f64>; 2]) -> f64 {
    let (d, e, r) = (p[1] - p[0], q[1] - q[0], p[0] - q[0]);
    let (a, b, c) = (d.dot(&d), d.dot(&e), e.dot(&e));
    let whole = a * c - b * b;
    if whole < 1e-14 * a * c {
        return f64::INFINITY;
    }
    let s = (b * e.dot(&r) - c * d.dot(&r)) / whole;
    let t = (a * e.dot(&r) - b * d.dot(&r)) / whole;
    let within = (0.0..=1.0).contains(&s) && (0.0..=1.0).contains(&t);
    if within { (r + d * s - e * t).norm() } else { f64::INFINITY }
}

/// Least distance of two triangles that do not cross.
pub fn triangles_apart(a: &[Vector3<f64>; 3], b: &[Vector3<f64>; 3]) -> f64 {
    let mut least = f64::INFINITY;
    for i in 0..3 {
        least = least.min(point_triangle(a[i], *b)).min(point_triangle(b[i], *a));
        for j in 0..3 {
            least = least.min(middles([a[i], a[(i + 1) % 3]], [b[j], b[(j + 1) % 3]]));
        }
    }
    least
}

/// Whether a side of one triangle runs through the other.
pub fn crossing(a: &[Vector3<f64>; 3], b: &[Vector3<f64>; 3]) -> bool {
    let pierces = |from: Vector3<f64>, to: Vector3<f64>, [x, y, z]: [Vector3<f64>; 3]| {
        let normal = (y - x).cross(&(z - x));
        let (before, after) = ((from - x).dot(&normal), (to - x).dot(&normal));
        if before * after >= 0.0 {
            return false;
        }
        let at = from + (to - from) * (before / (before - after));
        [(x, y), (y, z), (z, x)].iter().all(|(s, e)| (e - s).cross(&(at - s)).dot(&normal) > 0.0)
    };
    (0..3).any(|i| pierces(a[i], a[(i + 1) % 3], *b) || pierces(b[i], b[(i + 1) % 3], *a))
}

/// The folder of the real pairs, when it is there.
pub fn real_pairs() -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/queries");
    if path.is_dir() {
        return Some(path);
    }
    println!("skipped: {} is not there", path.display());
    None
}

/// A pose from a row `t,px,py,pz,qw,qx,qy,qz`.
pub fn pose_of(line: &str) -> Isometry3<f64> {
    let c: Vec<f64> = line.split(',').map(|x| x.parse().unwrap()).collect();
    let rotation = UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(c[4], c[5], c[6], c[7]));
    Isometry3::from_parts(Translation3::new(c[1], c[2], c[3]), rotation)
}
