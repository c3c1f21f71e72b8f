//! Shaded triangles.

use nalgebra::{Isometry3, Point3, Vector3};

use super::{Camera, Colour, Picture};

/// Normals are averaged at vertices, except over edges sharper than this angle, radians.
const CREASE: f64 = 0.7;

/// Looks of a mesh.
#[derive(Clone, Copy, Debug)]
pub struct Style {
    /// Colour of the outside.
    pub colour: Colour,
    /// Cuts away what lies on the side of the normal: a point of the plane and the normal, world frame.
    pub cut: Option<(Point3<f64>, Vector3<f64>)>,
    /// Colour of the inside where a cut or a hole shows it; unshaded, so that it looks like the cut face.
    pub inside: Colour,
}

impl Style {
    /// A smooth surface of one colour.
    pub fn coloured(colour: Colour) -> Self {
        Self { colour, cut: None, inside: [196, 92, 84] }
    }
}

impl Picture {
    /// Draws a mesh (vertices in its own frame, metres) at a pose in the world.
    ///
    /// Triangles with an index out of range are left out, and so are those that reach behind the eye.
    pub fn draw_mesh(
        &mut self,
        camera: &Camera,
        vertices: &[[f64; 3]],
        triangles: &[[u32; 3]],
        world_from_mesh: &Isometry3<f64>,
        style: &Style,
    ) {
        let world: Vec<Point3<f64>> = vertices.iter().map(|&v| world_from_mesh * Point3::from(v)).collect();
        let valid = |t: &[u32; 3]| t.iter().all(|&i| (i as usize) < world.len());
        let normals = corner_normals(&world, triangles);
        for (index, triangle) in triangles.iter().enumerate().filter(|(_, t)| valid(t)) {
            let corners = triangle.map(|i| world[i as usize]);
            self.fill(camera, &corners, &normals[index], style);
        }
    }

    fn fill(
        &mut self,
        camera: &Camera,
        corners: &[Point3<f64>; 3],
        normals: &[Vector3<f64>; 3],
        style: &Style,
    ) {
        let (width, height) = self.samples();
        let mut on_screen = [[0.0; 3]; 3];
        for k in 0..3 {
            match camera.project(&corners[k], width as f64, height as f64) {
                Some(position) => on_screen[k] = position,
                None => return,
            }
        }
        let [a, b, c] = on_screen;
        let twice_area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        if twice_area == 0.0 || !twice_area.is_finite() {
            return;
        }
        let facing = (corners[1] - corners[0]).cross(&(corners[2] - corners[0]));
        let outside = facing.dot(&camera.towards_eye(&corners[0])) > 0.0;
        let range = |axis: usize, limit: usize| {
            let low = a[axis].min(b[axis]).min(c[axis]).floor().clamp(0.0, limit as f64) as usize;
            let high = a[axis].max(b[axis]).max(c[axis]).ceil().clamp(0.0, limit as f64) as usize;
            low..high
        };
        for y in range(1, height) {
            for x in range(0, width) {
                let (px, py) = (x as f64 + 0.5, y as f64 + 0.5);
                let wb = ((px - a[0]) * (c[1] - a[1]) - (py - a[1]) * (c[0] - a[0])) / twice_area;
                let wc = ((b[0] - a[0]) * (py - a[1]) - (b[1] - a[1]) * (px - a[0])) / twice_area;
                let wa = 1.0 - wb - wc;
                if wa < 0.0 || wb < 0.0 || wc < 0.0 {
                    continue;
                }
                let nearness = wa * a[2] + wb * b[2] + wc * c[2];
                if !self.would_show(x, y, nearness) {
                    continue;
                }
                let position =
                    Point3::from(corners[0].coords * wa + corners[1].coords * wb + corners[2].coords * wc);
                if style.cut.is_some_and(|(point, normal)| (position - point).dot(&normal) > 0.0) {
                    continue;
                }
                let shown = if outside {
                    let normal = normals[0] * wa + normals[1] * wb + normals[2] * wc;
                    lit(style.colour, &normal, &camera.towards_eye(&position), camera)
                } else {
                    style.inside
                };
                self.put(x, y, nearness, shown);
            }
        }
    }
}

/// A normal for each corner of each triangle.
fn corner_normals(world: &[Point3<f64>], triangles: &[[u32; 3]]) -> Vec<[Vector3<f64>; 3]> {
    let get = |i: u32| world.get(i as usize).copied().unwrap_or_else(Point3::origin);
    let faces: Vec<Vector3<f64>> =
        triangles.iter().map(|t| (get(t[1]) - get(t[0])).cross(&(get(t[2]) - get(t[0])))).collect();
    let mut around: Vec<Vec<u32>> = vec![Vec::new(); world.len()];
    for (index, triangle) in triangles.iter().enumerate() {
        for &i in triangle {
            if let Some(list) = around.get_mut(i as usize) {
                list.push(index as u32);
            }
        }
    }
    let limit = CREASE.cos();
    let mut normals = Vec::with_capacity(triangles.len());
    for (index, triangle) in triangles.iter().enumerate() {
        let own = faces[index];
        normals.push(triangle.map(|i| {
            let Some(list) = around.get(i as usize) else { return own };
            list.iter()
                .map(|&other| faces[other as usize])
                .filter(|other| own.dot(other) >= limit * own.norm() * other.norm())
                .sum::<Vector3<f64>>()
        }));
    }
    normals
}

/// Colour of a surface under two fixed lights that travel with the camera, with a soft highlight.
fn lit(colour: Colour, normal: &Vector3<f64>, towards_eye: &Vector3<f64>, camera: &Camera) -> Colour {
    let length = normal.norm();
    if length <= 0.0 || length.is_nan() {
        return colour;
    }
    let normal = normal / length;
    let [right, up, back] = camera.axes();
    let key = (right * -0.45 + up * 0.75 + back * 0.65).normalize();
    let fill = (right * 0.80 - up * 0.25 + back * 0.45).normalize();
    let diffuse = 0.16 + 0.68 * normal.dot(&key).max(0.0) + 0.22 * normal.dot(&fill).max(0.0);
    let shine = 0.14 * normal.dot(&(key + towards_eye).normalize()).max(0.0).powi(24);
    colour.map(|channel| {
        let linear = (f64::from(channel) / 255.0).powf(2.2) * diffuse + shine;
        (linear.clamp(0.0, 1.0).powf(1.0 / 2.2) * 255.0 + 0.5) as u8
    })
}
