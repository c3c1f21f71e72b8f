//! Measures of a mesh, written independently of the library's own checks.

use std::collections::BTreeMap;

use hapteron_collision::mesh::TriMesh;

use crate::assets::shape::{Point, cross, dot, length, subtract};

/// What the tests look at.
pub struct Measures {
    /// Directed edges without exactly one partner of opposite direction.
    pub unmatched_edges: usize,
    /// Vertices that more than one fan of triangles share.
    pub pinched_vertices: usize,
    /// Vertices minus edges plus triangles; 2 - 2 genus for one closed surface.
    pub euler_characteristic: i64,
    /// Enclosed volume, cubic metres.
    pub volume: f64,
    /// Radius of the smallest enclosing sphere, metres.
    pub radius: f64,
    /// Smallest angle of each triangle in degrees, ascending.
    pub smallest_angles: Vec<f64>,
}

impl Measures {
    pub fn of(mesh: &TriMesh) -> Self {
        let mut edges: BTreeMap<(u32, u32), usize> = BTreeMap::new();
        let mut around: Vec<Vec<(u32, u32)>> = vec![Vec::new(); mesh.vertices().len()];
        let mut smallest_angles = Vec::new();
        let mut volume = 0.0;
        for &[a, b, c] in mesh.triangles() {
            for (from, to, other) in [(a, b, c), (b, c, a), (c, a, b)] {
                *edges.entry((from, to)).or_insert(0) += 1;
                around[from as usize].push((to, other));
            }
            let corners = [a, b, c].map(|i| mesh.vertices()[i as usize]);
            smallest_angles.push(smallest_angle(corners));
            volume += dot(corners[0], cross(corners[1], corners[2])) / 6.0;
        }
        smallest_angles.sort_by(f64::total_cmp);
        let unmatched =
            |&(&(from, to), &count): &(&(u32, u32), &usize)| count != 1 || !edges.contains_key(&(to, from));
        let unmatched_edges = edges.iter().filter(unmatched).count();
        let used = around.iter().filter(|list| !list.is_empty()).count();
        Self {
            unmatched_edges,
            pinched_vertices: around.iter().filter(|list| !is_one_fan(list)).count(),
            euler_characteristic: used as i64 - edges.len() as i64 / 2 + mesh.triangles().len() as i64,
            volume,
            radius: radius(mesh.vertices()),
            smallest_angles,
        }
    }

    pub fn worst_angle(&self) -> f64 {
        self.smallest_angles[0]
    }

    pub fn median_angle(&self) -> f64 {
        self.smallest_angles[self.smallest_angles.len() / 2]
    }
}

/// Whether the triangles about a vertex (given by their outer edges) are one closed fan.
fn is_one_fan(outer: &[(u32, u32)]) -> bool {
    let next: BTreeMap<u32, u32> = outer.iter().copied().collect();
    let Some(&(start, _)) = outer.first() else {
        return false;
    };
    let mut at = start;
    for step in 1..=outer.len() {
        match next.get(&at) {
            Some(&to) => at = to,
            None => return false,
        }
        if at == start {
            return step == outer.len();
        }
    }
    false
}

fn smallest_angle(corners: [Point; 3]) -> f64 {
    (0..3)
        .map(|k| {
            let u = subtract(corners[(k + 1) % 3], corners[k]);
            let v = subtract(corners[(k + 2) % 3], corners[k]);
            length(cross(u, v)).atan2(dot(u, v)).to_degrees()
        })
        .fold(180.0, f64::min)
}

/// Radius of the smallest enclosing sphere, to a thousandth: the centre steps ever less towards the farthest vertex (Badoiu and Clarkson 2003).
fn radius(vertices: &[Point]) -> f64 {
    let mut centre = vertices[0];
    let mut radius = f64::INFINITY;
    for step in 1..1000 {
        let distance = |v: &Point| length(subtract(*v, centre));
        let farthest = vertices.iter().copied().max_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap();
        radius = radius.min(distance(&farthest));
        centre = [0, 1, 2].map(|axis| centre[axis] + (farthest[axis] - centre[axis]) / (step as f64 + 1.0));
    }
    radius
}

/// FNV-1a over the bits of all coordinates and indices: equal only for the same mesh to the last bit.
pub fn digest(mesh: &TriMesh) -> u64 {
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    let mut take = |bytes: &[u8]| {
        for &byte in bytes {
            hash = (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
    };
    for vertex in mesh.vertices() {
        vertex.iter().for_each(|c| take(&c.to_bits().to_le_bytes()));
    }
    for triangle in mesh.triangles() {
        triangle.iter().for_each(|i| take(&i.to_le_bytes()));
    }
    hash
}
