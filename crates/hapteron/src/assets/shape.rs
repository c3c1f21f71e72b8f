//! The raw triangles that the generators fill, and the few measures they need of them.

/// A point or vector, metres in finished models and millimetres while a generator works.
pub(crate) type Point = [f64; 3];

/// Vertices and triangles under construction; outward normals by the right-hand rule.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Shape {
    /// Vertex positions.
    pub vertices: Vec<Point>,
    /// Vertex indices of each triangle, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

impl Shape {
    /// Adds a vertex and returns its index.
    pub fn vertex(&mut self, position: Point) -> u32 {
        self.vertices.push(position);
        (self.vertices.len() - 1) as u32
    }

    /// Adds a quadrilateral (corners counter-clockwise from outside), cut along the diagonal that leaves the larger
    /// smallest angle. A tie goes to the diagonal from the first corner.
    pub fn quad(&mut self, corners: [u32; 4]) {
        let [a, b, c, d] = corners;
        let [pa, pb, pc, pd] = corners.map(|i| self.vertices[i as usize]);
        let first = smallest_cosine_margin(pa, pb, pc).min(smallest_cosine_margin(pa, pc, pd));
        let second = smallest_cosine_margin(pa, pb, pd).min(smallest_cosine_margin(pb, pc, pd));
        if second > first + 1e-9 {
            self.triangles.extend([[a, b, d], [b, c, d]]);
        } else {
            self.triangles.extend([[a, b, c], [a, c, d]]);
        }
    }

    /// Joins two closed rings of equal length (both counter-clockwise about the direction from the first to the
    /// second) by a band of quadrilaterals facing away from the axis.
    pub fn band(&mut self, first: &[u32], second: &[u32]) {
        let n = first.len();
        for k in 0..n {
            let next = (k + 1) % n;
            self.quad([first[k], first[next], second[next], second[k]]);
        }
    }

    /// Joins a ring to one of half as many vertices, in the sense of [`Shape::band`].
    pub fn halving_band(&mut self, fine: &[u32], coarse: &[u32]) {
        let n = coarse.len();
        for k in 0..n {
            let next = (k + 1) % n;
            let [start, middle, end] = [2 * k, 2 * k + 1, (2 * k + 2) % fine.len()].map(|i| fine[i]);
            self.triangles.extend([
                [start, middle, coarse[k]],
                [middle, coarse[next], coarse[k]],
                [middle, end, coarse[next]],
            ]);
        }
    }

    /// Closes a ring with a fan about `apex`; facing along the ring's right-hand axis.
    pub fn fan(&mut self, ring: &[u32], apex: u32) {
        for k in 0..ring.len() {
            self.triangles.push([ring[k], ring[(k + 1) % ring.len()], apex]);
        }
    }

    /// Removes vertices that no triangle uses; the order of the others stays.
    pub fn compact(&mut self) {
        let mut used = vec![false; self.vertices.len()];
        for &i in self.triangles.iter().flatten() {
            used[i as usize] = true;
        }
        let mut renumbered = vec![0u32; self.vertices.len()];
        let mut count = 0;
        for (i, &keep) in used.iter().enumerate() {
            renumbered[i] = count;
            count += u32::from(keep);
        }
        let mut keep = used.iter();
        self.vertices.retain(|_| *keep.next().unwrap_or(&false));
        for triangle in &mut self.triangles {
            *triangle = triangle.map(|i| renumbered[i as usize]);
        }
    }

    /// Corner positions of a triangle.
    pub fn corners(&self, triangle: [u32; 3]) -> [Point; 3] {
        triangle.map(|i| self.vertices[i as usize])
    }

    /// Enclosed volume and its centroid, for a closed surface (divergence theorem).
    pub fn volume_and_centroid(&self) -> (f64, Point) {
        let mut volume = 0.0;
        let mut moment = [0.0; 3];
        for &triangle in &self.triangles {
            let [a, b, c] = self.corners(triangle);
            let part = dot(a, cross(b, c)) / 6.0;
            volume += part;
            for axis in 0..3 {
                moment[axis] += part * (a[axis] + b[axis] + c[axis]) / 4.0;
            }
        }
        (volume, moment.map(|m| m / volume))
    }

    /// Moves every vertex by `offset` and then multiplies by `factor`.
    pub fn shift_and_scale(&mut self, offset: Point, factor: f64) {
        for vertex in &mut self.vertices {
            *vertex = add(*vertex, offset).map(|x| x * factor);
        }
    }
}

/// One minus the largest cosine of the triangle's angles: grows with the smallest angle, needs no arc cosine.
pub(crate) fn smallest_cosine_margin(a: Point, b: Point, c: Point) -> f64 {
    let (ab, bc, ca) = (subtract(b, a), subtract(c, b), subtract(a, c));
    let (lab, lbc, lca) = (length(ab), length(bc), length(ca));
    let at_a = -dot(ab, ca) / (lab * lca);
    let at_b = -dot(ab, bc) / (lab * lbc);
    let at_c = -dot(bc, ca) / (lbc * lca);
    1.0 - at_a.max(at_b).max(at_c)
}

/// Sum of two vectors.
pub(crate) fn add(a: Point, b: Point) -> Point {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// Difference of two vectors.
pub(crate) fn subtract(a: Point, b: Point) -> Point {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// A vector times a number.
pub(crate) fn scale(a: Point, factor: f64) -> Point {
    a.map(|x| x * factor)
}

/// Scalar product.
pub(crate) fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Vector product.
pub(crate) fn cross(a: Point, b: Point) -> Point {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Euclidean length; the square root is exact by IEEE 754, so it is the same on every machine.
pub(crate) fn length(a: Point) -> f64 {
    dot(a, a).sqrt()
}

/// 0 below 0, 1 above 1, a cubic with flat ends between.
pub(crate) fn smooth_step(u: f64) -> f64 {
    let u = u.clamp(0.0, 1.0);
    u * u * (3.0 - 2.0 * u)
}
