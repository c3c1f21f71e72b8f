//! Building a [`Surface`]: order the triangles into leaves of sixteen, renumber everything in that order, collapse the
//! binary tree into one that is sixteen wide.

use super::{Cone, Edge, EdgeKind, LANES, LEAF, Leaf, Node, Surface, TriangleBlock, topology};
use crate::vector::{Vec3, add, cross, dot, norm, sub, unit_or_zero};

/// An axis-aligned box.
#[derive(Clone, Copy)]
struct Bounds {
    min: Vec3,
    max: Vec3,
}

impl Bounds {
    const NONE: Self = Self { min: [f64::INFINITY; 3], max: [f64::NEG_INFINITY; 3] };

    fn grow(&mut self, other: &Self) {
        for k in 0..3 {
            self.min[k] = self.min[k].min(other.min[k]);
            self.max[k] = self.max[k].max(other.max[k]);
        }
    }

    fn half_area(&self) -> f64 {
        let e = sub(self.max, self.min);
        if e[0] < 0.0 { 0.0 } else { e[0] * e[1] + e[1] * e[2] + e[2] * e[0] }
    }
}

/// The binary tree over ranges of the triangle order; a leaf has no children.
struct Branch {
    bounds: Bounds,
    begin: usize,
    end: usize,
    children: Option<[usize; 2]>,
}

struct Builder {
    boxes: Vec<Bounds>,
    order: Vec<u32>,
    branches: Vec<Branch>,
}

pub(super) fn surface(vertices: &[Vec3], triangles: &[[u32; 3]]) -> Surface {
    let (vertices, triangles) = topology::weld(vertices, triangles);
    let normals = topology::face_normals(&vertices, &triangles);
    let (edges, triangle_edges) = topology::edges(&vertices, &triangles, &normals);
    let vertex_normals = topology::vertex_normals(&vertices, &triangles, &normals, &edges);
    let radius = vertices.iter().map(|&v| norm(v)).fold(0.0, f64::max);

    let boxes = triangles.iter().map(|t| bounds_of(&t.map(|v| vertices[v as usize]))).collect();
    let mut builder = Builder { boxes, order: (0..triangles.len() as u32).collect(), branches: Vec::new() };
    if !triangles.is_empty() {
        builder.split(0, triangles.len());
    }
    let mut result = Surface {
        vertices,
        vertex_normals,
        triangles,
        triangle_edges,
        edges,
        edges_at_begin: Vec::new(),
        edges_at: Vec::new(),
        closed: false,
        blocks: Vec::new(),
        leaves: Vec::new(),
        corners: Vec::new(),
        nodes: Vec::new(),
        radius,
        identity: 0,
    };
    renumber(&mut result, &builder);
    (result.edges_at_begin, result.edges_at) = topology::edges_at(result.vertices.len(), &result.edges);
    result.closed = result.edges.iter().all(|e| matches!(e.kind, EdgeKind::Convex | EdgeKind::Hollow));
    result.nodes = collapse(&result, &builder.branches);
    result.identity = digest(&result);
    result
}

/// FNV-1a over all that a result depends on.
fn digest(surface: &Surface) -> u64 {
    let coordinates = surface.vertices.iter().flatten().map(|c| c.to_bits());
    let indices = surface.triangles.iter().flatten().map(|&i| u64::from(i));
    coordinates
        .chain(indices)
        .fold(0xcbf2_9ce4_8422_2325, |hash, word| (hash ^ word).wrapping_mul(0x0000_0100_0000_01b3))
}

fn bounds_of(corners: &[Vec3]) -> Bounds {
    corners.iter().fold(Bounds::NONE, |mut b, &c| {
        b.grow(&Bounds { min: c, max: c });
        b
    })
}

impl Builder {
    /// Orders `begin..end` and returns the branch over it.
    fn split(&mut self, begin: usize, end: usize) -> usize {
        let bounds = self.bounds(begin, end);
        let index = self.branches.len();
        self.branches.push(Branch { bounds, begin, end, children: None });
        if end - begin > LANES {
            let middle = self.partition(begin, end);
            let left = self.split(begin, middle);
            let right = self.split(middle, end);
            self.branches[index].children = Some([left, right]);
        }
        index
    }

    fn bounds(&self, begin: usize, end: usize) -> Bounds {
        self.order[begin..end].iter().fold(Bounds::NONE, |mut b, &t| {
            b.grow(&self.boxes[t as usize]);
            b
        })
    }

    fn center(&self, triangle: u32, axis: usize) -> f64 {
        let b = &self.boxes[triangle as usize];
        b.min[axis] + b.max[axis]
    }

    /// Sorts the range along the axis with the best split and returns where it is. The left part is a whole number of
    /// leaves, so that all leaves but the last are full.
    fn partition(&mut self, begin: usize, end: usize) -> usize {
        /// Above this the split is sought among a few positions only.
        const DENSE: usize = 1024;
        let count = end - begin;
        let step = if count > DENSE { (count / 32).next_multiple_of(LANES) } else { LANES };
        let mut best = (f64::INFINITY, 0, step);
        for axis in 0..3 {
            self.sort(begin, end, axis);
            let mut right_cost = vec![0.0; count.div_ceil(step)];
            let mut right = Bounds::NONE;
            for k in (1..right_cost.len()).rev() {
                for &t in &self.order[begin + k * step..(begin + (k + 1) * step).min(end)] {
                    right.grow(&self.boxes[t as usize]);
                }
                right_cost[k] = right.half_area() * (count - k * step) as f64;
            }
            let mut left = Bounds::NONE;
            for (k, &right_cost) in right_cost.iter().enumerate().skip(1) {
                for &t in &self.order[begin + (k - 1) * step..begin + k * step] {
                    left.grow(&self.boxes[t as usize]);
                }
                let cost = left.half_area() * (k * step) as f64 + right_cost;
                if cost < best.0 {
                    best = (cost, axis, k * step);
                }
            }
        }
        if best.1 != 2 {
            self.sort(begin, end, best.1);
        }
        begin + best.2
    }

    fn sort(&mut self, begin: usize, end: usize, axis: usize) {
        let mut part = self.order[begin..end].to_vec();
        part.sort_unstable_by(|&a, &b| self.center(a, axis).total_cmp(&self.center(b, axis)).then(a.cmp(&b)));
        self.order[begin..end].copy_from_slice(&part);
    }
}

/// Puts triangles, vertices and edges in the order of the leaves, and makes the leaves and blocks.
fn renumber(surface: &mut Surface, builder: &Builder) {
    let mut vertex_order = Vec::with_capacity(surface.vertices.len());
    let mut edge_order: Vec<u32> = Vec::with_capacity(surface.edges.len());
    let mut vertex_taken = vec![false; surface.vertices.len()];
    let mut edge_taken = vec![false; surface.edges.len()];
    for branch in builder.branches.iter().filter(|b| b.children.is_none()) {
        let own = &builder.order[branch.begin..branch.end];
        let (first_vertex, first_edge) = (vertex_order.len(), edge_order.len());
        for &t in own {
            take(&surface.triangles[t as usize], &mut vertex_taken, &mut vertex_order);
            take(&surface.triangle_edges[t as usize], &mut edge_taken, &mut edge_order);
        }
        let ridge = |e: u32| surface.edges[e as usize].kind != EdgeKind::Hollow;
        edge_order[first_edge..].sort_by_key(|&e| !ridge(e));
        let (normal, low, high) = slab(surface, own);
        surface.leaves.push(Leaf {
            min: branch.bounds.min.map(below),
            max: branch.bounds.max.map(above),
            normal,
            low,
            high,
            ridge_cone: ridge_cone(surface, edge_order[first_edge..].iter().filter(|&&e| ridge(e))),
            first_triangle: branch.begin as u32,
            first_vertex: first_vertex as u32,
            first_edge: first_edge as u32,
            first_corner: 0,
            corners: 0,
            triangles: own.len() as u8,
            vertices: (vertex_order.len() - first_vertex) as u8,
            ridges: edge_order[first_edge..].iter().filter(|&&e| ridge(e)).count() as u8,
        });
    }
    let new_vertex = inverse(&vertex_order, surface.vertices.len());
    let new_edge = inverse(&edge_order, surface.edges.len());
    let new_triangle = inverse(&builder.order, surface.triangles.len());
    surface.vertices = pick(&surface.vertices, &vertex_order);
    surface.vertex_normals = pick(&surface.vertex_normals, &vertex_order);
    surface.triangles = pick(&surface.triangles, &builder.order);
    surface.triangle_edges = pick(&surface.triangle_edges, &builder.order);
    surface.edges = pick(&surface.edges, &edge_order);
    for t in &mut surface.triangles {
        *t = t.map(|v| new_vertex[v as usize]);
    }
    for t in &mut surface.triangle_edges {
        *t = t.map(|e| new_edge[e as usize]);
    }
    for Edge { vertices, triangles, .. } in &mut surface.edges {
        *vertices = vertices.map(|v| new_vertex[v as usize]);
        *triangles = triangles.map(|t| new_triangle[t as usize]);
    }
    surface.blocks = surface.leaves.iter().map(|leaf| TriangleBlock::new(surface, leaf)).collect();
    for leaf in &mut surface.leaves {
        let triangles = &surface.triangles[leaf.first_triangle as usize..][..usize::from(leaf.triangles)];
        let mut corners: Vec<u32> = triangles.iter().flatten().copied().collect();
        corners.sort_unstable();
        corners.dedup();
        corners.resize(corners.len().next_multiple_of(2), corners[0]);
        leaf.first_corner = surface.corners.len() as u32;
        leaf.corners = corners.len() as u8;
        surface.corners.append(&mut corners);
    }
}

/// The mean normal of some triangles and the heights along it between which they lie.
fn slab(surface: &Surface, triangles: &[u32]) -> ([f32; 3], f32, f32) {
    let corners = |t: u32| surface.triangles[t as usize].map(|v| surface.vertices[v as usize]);
    let sum = triangles.iter().fold([0.0; 3], |sum, &t| {
        let [a, b, c] = corners(t);
        add(sum, cross(sub(b, a), sub(c, a)))
    });
    // Heights are taken along the normal as stored, so that rounding it costs nothing.
    let normal = unit_or_zero(sum).map(|c| c as f32);
    let heights = triangles.iter().flat_map(|&t| corners(t)).map(|v| dot(v, normal.map(f64::from)));
    let (low, high) =
        heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), h| (low.min(h), high.max(h)));
    (normal, below(low), above(high))
}

/// A cone around the normal cones of some edges.
fn ridge_cone<'a>(surface: &Surface, edges: impl Iterator<Item = &'a u32> + Clone) -> Cone {
    let normal = |e: &u32| surface.edges[*e as usize].normal.map(f64::from);
    let axis = unit_or_zero(edges.clone().fold([0.0; 3], |sum, e| add(sum, normal(e))));
    let cos = edges.fold(1.0f64, |least, e| {
        let own = f64::from(surface.edges[*e as usize].cone);
        let leaning = dot(normal(e), axis).clamp(-1.0, 1.0);
        let sines = ((1.0 - own * own) * (1.0 - leaning * leaning)).max(0.0).sqrt();
        // The cosine of the sum of the two angles, unless that is more than a straight one.
        least.min(if own + leaning <= 0.0 { -1.0 } else { own * leaning - sines })
    });
    Cone::wide(axis.map(|c| c as f32), if axis == [0.0; 3] { -1.0 } else { cos as f32 })
}

fn take(items: &[u32; 3], taken: &mut [bool], order: &mut Vec<u32>) {
    for &i in items {
        if !core::mem::replace(&mut taken[i as usize], true) {
            order.push(i);
        }
    }
}

fn inverse(order: &[u32], count: usize) -> Vec<u32> {
    let mut result = vec![0; count];
    for (new, &old) in order.iter().enumerate() {
        result[old as usize] = new as u32;
    }
    result
}

fn pick<T: Copy>(list: &[T], order: &[u32]) -> Vec<T> {
    order.iter().map(|&i| list[i as usize]).collect()
}

/// The binary tree with up to sixteen descendants of each kept branch as its children, largest opened first.
fn collapse(surface: &Surface, branches: &[Branch]) -> Vec<Node> {
    let mut leaf_index = vec![0; branches.len()];
    let mut leaves = 0;
    for (i, branch) in branches.iter().enumerate() {
        if branch.children.is_none() {
            leaf_index[i] = leaves;
            leaves += 1;
        }
    }
    let mut collapse = Collapse { surface, branches, leaf_index, nodes: Vec::new() };
    if !branches.is_empty() {
        collapse.from(0);
    }
    collapse.nodes
}

struct Collapse<'a> {
    surface: &'a Surface,
    branches: &'a [Branch],
    leaf_index: Vec<u32>,
    nodes: Vec<Node>,
}

impl Collapse<'_> {
    /// Makes the node over a branch and all below it; gives its number.
    fn from(&mut self, root: usize) -> u32 {
        let branches = self.branches;
        let mut open = vec![root];
        while open.len() < LANES {
            let largest = open
                .iter()
                .enumerate()
                .filter_map(|(i, &b)| branches[b].children.map(|c| (branches[b].bounds.half_area(), i, c)))
                .max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)));
            let Some((_, position, [left, right])) = largest else {
                break;
            };
            open[position] = left;
            open.insert(position + 1, right);
        }
        let index = self.nodes.len();
        self.nodes.push(Node::EMPTY);
        for (lane, &place) in open.iter().enumerate() {
            let branch = &branches[place];
            let child = match branch.children {
                None => LEAF | self.leaf_index[place],
                Some(_) => self.from(place),
            };
            let triangles: Vec<u32> = (branch.begin as u32..branch.end as u32).collect();
            let (normal, low, high) = slab(self.surface, &triangles);
            let node = &mut self.nodes[index];
            node.child[lane] = child;
            (node.low[lane], node.high[lane]) = (low, high);
            for axis in 0..3 {
                node.min[axis][lane] = below(branch.bounds.min[axis]);
                node.max[axis][lane] = above(branch.bounds.max[axis]);
                node.normal[axis][lane] = normal[axis];
            }
        }
        index as u32
    }
}

/// The nearest single-precision number that is not above `value`.
fn below(value: f64) -> f32 {
    let rounded = value as f32;
    if f64::from(rounded) > value { rounded.next_down() } else { rounded }
}

/// The nearest single-precision number that is not below `value`.
fn above(value: f64) -> f32 {
    let rounded = value as f32;
    if f64::from(rounded) < value { rounded.next_up() } else { rounded }
}
