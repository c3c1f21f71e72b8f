//! What a mesh is like, and what is wrong with it.

use super::{TriMesh, mass};
use crate::vector::{norm, sub};
use std::fmt;

/// A description of a mesh with its defects.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshReport {
    /// Vertices that differ in position and are used.
    pub vertices: usize,
    /// Vertices that coincide with an earlier one.
    pub duplicate_vertices: usize,
    /// Vertices that no triangle uses.
    pub unused_vertices: usize,
    /// Triangles with an area.
    pub triangles: usize,
    /// Triangles left out for having none.
    pub dropped_triangles: usize,
    /// Triangles with the same corners as an earlier one.
    pub duplicate_triangles: usize,
    /// Parts that share no vertex.
    pub components: usize,
    /// Edges with one face.
    pub boundary_edges: usize,
    /// Edges with more than two faces.
    pub non_manifold_edges: usize,
    /// Edges whose two faces run along them the same way: one of the two is inside out.
    pub inconsistent_edges: usize,
    /// The middle of the first few defective edges, metres, mesh frame.
    pub defects: Vec<[f64; 3]>,
    /// Least and greatest coordinates, metres.
    pub bounds: [[f64; 3]; 2],
    /// Radius of the bounding sphere, metres.
    pub radius: f64,
    /// Square metres.
    pub area: f64,
    /// Cubic metres; it has a meaning only for a closed mesh.
    pub volume: f64,
    /// Metres.
    pub median_edge: f64,
}

impl MeshReport {
    /// Every edge has two faces that agree about the outside.
    #[must_use]
    pub fn is_closed(&self) -> bool {
        self.boundary_edges == 0 && self.non_manifold_edges == 0 && self.inconsistent_edges == 0
    }

    /// What the size says about the unit of the file, when it is not that of a thing held in a hand.
    #[must_use]
    pub fn units_guess(&self) -> Option<&'static str> {
        if self.radius > 3.0 {
            Some("looks like millimetres: use scale = 0.001")
        } else if self.radius < 1e-4 {
            Some("smaller than a grain of sand: check the scale")
        } else {
            None
        }
    }
}

/// Examines a mesh; takes about a microsecond a triangle.
#[must_use]
pub fn check(mesh: &TriMesh) -> MeshReport {
    let position = positions(mesh);
    let mut used = vec![false; mesh.vertices().len()];
    let mut edges = Vec::with_capacity(3 * mesh.triangles().len());
    let mut faces = Vec::with_capacity(mesh.triangles().len());
    let mut parts: Vec<u32> = (0..mesh.vertices().len() as u32).collect();
    for triangle in mesh.triangles() {
        triangle.iter().for_each(|&v| used[v as usize] = true);
        let t = triangle.map(|v| position[v as usize]);
        for k in 0..3 {
            let (a, b) = (t[k], t[(k + 1) % 3]);
            edges.push(([a.min(b), a.max(b)], a < b));
            unite(&mut parts, a, b);
        }
        let mut sorted = t;
        sorted.sort_unstable();
        faces.push(sorted);
    }
    edges.sort_unstable();
    faces.sort_unstable();
    let touched = touched(mesh, &position);
    let mut report = MeshReport {
        vertices: touched.iter().filter(|t| **t).count(),
        duplicate_vertices: (0..used.len()).filter(|&v| position[v] as usize != v).count(),
        unused_vertices: used.iter().filter(|u| !**u).count(),
        triangles: mesh.triangles().len(),
        dropped_triangles: mesh.dropped_triangles(),
        duplicate_triangles: faces.windows(2).filter(|w| w[0] == w[1]).count(),
        components: (0..parts.len())
            .filter(|&v| touched[v] && find(&mut parts, v as u32) as usize == v)
            .count(),
        boundary_edges: 0,
        non_manifold_edges: 0,
        inconsistent_edges: 0,
        defects: Vec::new(),
        bounds: mesh.bounds(),
        radius: mesh.bounding_sphere().1,
        area: area(mesh),
        volume: mass::integrate(mesh).volume,
        median_edge: 0.0,
    };
    count_edges(mesh, &edges, &mut report);
    report
}

/// For every vertex the first one at the same position.
fn positions(mesh: &TriMesh) -> Vec<u32> {
    let key = |i: u32| mesh.vertices()[i as usize].map(|c| (c + 0.0).to_bits());
    let mut order: Vec<u32> = (0..mesh.vertices().len() as u32).collect();
    order.sort_unstable_by_key(|&i| (key(i), i));
    let mut result = vec![0; order.len()];
    let mut first = order.first().copied().unwrap_or(0);
    for &i in &order {
        if key(i) != key(first) {
            first = i;
        }
        result[i as usize] = first;
    }
    result
}

fn touched(mesh: &TriMesh, position: &[u32]) -> Vec<bool> {
    let mut result = vec![false; position.len()];
    for &v in mesh.triangles().iter().flatten() {
        result[position[v as usize] as usize] = true;
    }
    result
}

fn count_edges(mesh: &TriMesh, edges: &[([u32; 2], bool)], report: &mut MeshReport) {
    const SHOWN: usize = 5;
    let mut lengths = Vec::with_capacity(edges.len() / 2);
    for group in edges.chunk_by(|a, b| a.0 == b.0) {
        let [a, b] = group[0].0.map(|v| mesh.vertices()[v as usize]);
        lengths.push(norm(sub(b, a)));
        let defect = match group {
            [_] => &mut report.boundary_edges,
            [one, other] if one.1 == other.1 => &mut report.inconsistent_edges,
            [_, _] => continue,
            _ => &mut report.non_manifold_edges,
        };
        *defect += 1;
        if report.defects.len() < SHOWN {
            report.defects.push(crate::vector::scale(crate::vector::add(a, b), 0.5));
        }
    }
    let middle = lengths.len() / 2;
    report.median_edge =
        if lengths.is_empty() { 0.0 } else { *lengths.select_nth_unstable_by(middle, f64::total_cmp).1 };
}

fn area(mesh: &TriMesh) -> f64 {
    let one = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| mesh.vertices()[v as usize]);
        norm(crate::vector::cross(sub(b, a), sub(c, a))) / 2.0
    };
    mesh.triangles().iter().map(one).sum()
}

fn find(parts: &mut [u32], mut v: u32) -> u32 {
    while parts[v as usize] != v {
        parts[v as usize] = parts[parts[v as usize] as usize];
        v = parts[v as usize];
    }
    v
}

fn unite(parts: &mut [u32], a: u32, b: u32) {
    let (a, b) = (find(parts, a), find(parts, b));
    // The smaller becomes the root, so that the result does not depend on the order.
    parts[a.max(b) as usize] = a.min(b);
}

impl fmt::Display for MeshReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let size = sub(self.bounds[1], self.bounds[0]).map(|c| c * 1e3);
        writeln!(f, "triangles        {}", self.triangles)?;
        writeln!(f, "vertices         {}", self.vertices)?;
        writeln!(f, "components       {}", self.components)?;
        writeln!(
            f,
            "size             {:.2} x {:.2} x {:.2} mm, bounding radius {:.2} mm",
            size[0],
            size[1],
            size[2],
            self.radius * 1e3
        )?;
        if let Some(guess) = self.units_guess() {
            writeln!(f, "units            {guess}")?;
        }
        writeln!(f, "median edge      {:.3} mm", self.median_edge * 1e3)?;
        writeln!(f, "area             {:.2} cm2", self.area * 1e4)?;
        if self.is_closed() {
            writeln!(f, "closed           yes")?;
            writeln!(f, "volume           {:.3} cm3", self.volume * 1e6)?;
        } else {
            writeln!(
                f,
                "closed           no: queries work, with the sign of a depth as documented; mass properties must be given"
            )?;
        }
        let defects = [
            ("boundary edges", self.boundary_edges),
            ("edges with more than two faces", self.non_manifold_edges),
            ("edges between faces of opposite orientation", self.inconsistent_edges),
            ("triangles without area, left out", self.dropped_triangles),
            ("duplicate triangles", self.duplicate_triangles),
            ("coinciding vertices, joined", self.duplicate_vertices),
            ("unused vertices", self.unused_vertices),
        ];
        for (what, count) in defects.into_iter().filter(|d| d.1 > 0) {
            writeln!(f, "  {count} {what}")?;
        }
        for [x, y, z] in &self.defects {
            writeln!(f, "  defect near ({x:.6}, {y:.6}, {z:.6}) m")?;
        }
        Ok(())
    }
}
