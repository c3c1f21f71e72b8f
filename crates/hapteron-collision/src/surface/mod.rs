//! The frozen query structure of one mesh: triangles in blocks of sixteen, shared vertices and edges with their
//! normals, and a flat sixteen-wide tree of boxes over the blocks. Built once, then never changed.

mod block;
mod build;
mod topology;

pub(crate) use block::{ERROR, TriangleBlock};

use crate::mesh::TriMesh;

/// Triangles in one leaf of the tree, and lanes of one inner loop.
pub(crate) const LANES: usize = 16;
/// Marks a child of a [`Node`] as a leaf; the other bits are its index.
pub(crate) const LEAF: u32 = 1 << 31;
/// Marks an absent child of a [`Node`].
pub(crate) const EMPTY: u32 = u32::MAX;

/// What the two sides of an edge make of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum EdgeKind {
    /// Two faces that bend away from each other, seen from outside: such an edge can touch another in its middle.
    Convex,
    /// Two faces in one plane or bent towards each other: nothing can touch its middle before it touches a face.
    Hollow,
    /// One face: the rim of an open surface.
    Boundary,
    /// More than two faces, or two of opposite orientation: it has no inside.
    Unoriented,
}

/// An edge of the surface, shared by its faces.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Edge {
    pub vertices: [u32; 2],
    /// The two faces; the same one twice at a boundary.
    pub triangles: [u32; 2],
    /// Unit pseudo-normal: the mean of the two faces' normals; at a boundary, away from the face in its plane.
    pub normal: [f32; 3],
    /// Cosine of half the angle between the faces' normals: the edge's normal cone.
    pub cone: f32,
    pub kind: EdgeKind,
}

/// The outward direction of a vertex.
#[derive(Clone, Copy, Debug)]
pub(crate) struct VertexNormal {
    /// Angle-weighted pseudo-normal, unit (Baerentzen and Aanaes 2005: its sign tells inside from outside).
    pub normal: [f32; 3],
    /// Cosine of the half-angle of the cone of the faces' normals around `normal`; [`VertexNormal::OPEN`] at a rim.
    pub cone: f32,
}

impl VertexNormal {
    /// Cone of a vertex on the rim of an open surface: every direction belongs to it.
    pub const OPEN: f32 = -2.0;
}

/// All unit directions within an angle of an axis.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cone {
    pub axis: [f32; 3],
    /// Cosine and sine of the angle.
    pub cos: f32,
    pub sin: f32,
}

impl Cone {
    /// Widens the angle (in its cosine): more than what single precision loses, and as much as a contact of two edges may lean out.
    pub const SLACK: f32 = 1e-4;

    /// The cone around a unit vector with (almost) this cosine, on the safe side.
    #[inline(always)]
    pub(crate) fn wide(axis: [f32; 3], cos: f32) -> Self {
        let cos = Self::wide_cos(cos);
        Self { axis, cos, sin: (1.0 - cos * cos).max(0.0).sqrt() }
    }

    /// The cosine of such a cone.
    #[inline(always)]
    pub(crate) fn wide_cos(cos: f32) -> f32 {
        (cos - 1.5 * Self::SLACK).max(-1.0)
    }

    /// True when some direction of this cone may be opposite to one of the other.
    #[inline(always)]
    pub(crate) fn faces_cone(&self, other: &Self) -> bool {
        let aligned = (0..3).map(|k| self.axis[k] * other.axis[k]).sum();
        self.faces(other.cos, other.sin, aligned)
    }

    /// The same for a cone of this cosine and sine; `aligned` is the cosine between the axes.
    #[inline(always)]
    pub(crate) fn faces(&self, other_cos: f32, other_sin: f32, aligned: f32) -> bool {
        // The angle between one axis and the reverse of the other is at most the sum of the angles.
        (self.cos + other_cos <= 0.0) | (aligned <= self.sin * other_sin - self.cos * other_cos + Self::SLACK)
    }
}

/// One leaf: a block of triangles with the vertices and edges that it owns (each belongs to one leaf).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Leaf {
    pub min: [f32; 3],
    pub max: [f32; 3],
    /// Mean normal of the triangles, and between which heights along it they lie; zero where the normals cancel.
    pub normal: [f32; 3],
    pub low: f32,
    pub high: f32,
    /// Directions along which the leaf's ridges can touch something.
    pub ridge_cone: Cone,
    pub first_triangle: u32,
    pub first_vertex: u32,
    pub first_edge: u32,
    /// Of the list of corners.
    pub first_corner: u32,
    pub triangles: u8,
    pub vertices: u8,
    /// Distinct vertices of its triangles, own ones and others; an even number, for which one may be there twice.
    pub corners: u8,
    /// Edges that can touch in their middle (all but [`EdgeKind::Hollow`]); they come first.
    pub ridges: u8,
}

impl Leaf {
    /// The triangle in a lane of the leaf's block.
    #[inline(always)]
    pub(crate) fn triangle(&self, lane: usize) -> u32 {
        self.first_triangle + if lane < usize::from(self.triangles) { lane as u32 } else { 0 }
    }
}

/// Up to sixteen children with their boxes and slabs by axis and lane.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub(crate) struct Node {
    pub min: [[f32; LANES]; 3],
    pub max: [[f32; LANES]; 3],
    /// Mean normals of the children's triangles, and between which heights along them these lie; zero where the normals cancel.
    pub normal: [[f32; LANES]; 3],
    pub low: [f32; LANES],
    pub high: [f32; LANES],
    pub child: [u32; LANES],
}

impl Node {
    /// A node without children: its boxes overlap nothing.
    const EMPTY: Self = Self {
        min: [[f32::INFINITY; LANES]; 3],
        max: [[f32::NEG_INFINITY; LANES]; 3],
        normal: [[0.0; LANES]; 3],
        low: [0.0; LANES],
        high: [0.0; LANES],
        child: [EMPTY; LANES],
    };
}

/// A triangle mesh made ready for queries.
///
/// Vertices that coincide exactly are one. Any mesh is accepted: the sign of a depth is taken from the normal of the
/// closest feature (face, edge or vertex, the last two with angle-weighted pseudo-normals), so that for a closed and
/// consistently oriented surface it is exact; behind an open sheet counts as inside, and beyond the rim of an open sheet, or
/// nearest to an edge that has more than two faces or two of opposite orientation, counts as outside. An edge that runs through an
/// open surface shows by its ends only, as far as they are within the tolerance of it.
#[derive(Clone, Debug)]
pub struct Surface {
    pub(crate) vertices: Vec<[f64; 3]>,
    pub(crate) vertex_normals: Vec<VertexNormal>,
    pub(crate) triangles: Vec<[u32; 3]>,
    /// Edge opposite to nothing in particular: edge `k` of a triangle runs from its vertex `k` to vertex `k + 1`.
    pub(crate) triangle_edges: Vec<[u32; 3]>,
    pub(crate) edges: Vec<Edge>,
    /// By vertex, and one more: where its range of `edges_at` begins.
    pub(crate) edges_at_begin: Vec<u32>,
    /// The edges at each vertex.
    pub(crate) edges_at: Vec<u32>,
    /// No rim, no edge with more than two faces or with two of opposite orientation: it has an inside.
    pub(crate) closed: bool,
    pub(crate) blocks: Vec<TriangleBlock>,
    pub(crate) leaves: Vec<Leaf>,
    /// Vertices of the triangles, leaf by leaf.
    pub(crate) corners: Vec<u32>,
    /// The root is the first.
    pub(crate) nodes: Vec<Node>,
    pub(crate) radius: f64,
    /// Tells surfaces apart: a digest of the vertices and triangles.
    pub(crate) identity: u64,
}

impl Surface {
    /// Builds the query structure; not for the haptic thread (it allocates, and takes about a microsecond a triangle).
    #[must_use]
    pub fn build(mesh: &TriMesh) -> Self {
        build::surface(mesh.vertices(), mesh.triangles())
    }

    /// The same for triangles that are known to be sound.
    pub(crate) fn of_triangles(vertices: &[[f64; 3]], triangles: &[[u32; 3]]) -> Self {
        build::surface(vertices, triangles)
    }

    /// The vertices of a leaf's triangles.
    #[inline(always)]
    pub(crate) fn corners(&self, leaf: &Leaf) -> &[u32] {
        &self.corners[leaf.first_corner as usize..][..usize::from(leaf.corners)]
    }

    /// The edges that end at a vertex.
    pub(crate) fn edges_at(&self, vertex: u32) -> &[u32] {
        let [begin, end] = [0, 1].map(|k| self.edges_at_begin[vertex as usize + k] as usize);
        &self.edges_at[begin..end]
    }

    /// Triangles in the structure: those of the mesh less the ones whose corners coincide.
    #[must_use]
    pub fn triangle_count(&self) -> usize {
        self.triangles.len()
    }

    /// Greatest distance of a vertex from the origin of the mesh frame, in metres.
    #[must_use]
    pub fn radius(&self) -> f64 {
        self.radius
    }

    /// Memory that the structure holds, in bytes.
    #[must_use]
    pub fn memory_bytes(&self) -> usize {
        fn bytes<T>(list: &[T]) -> usize {
            core::mem::size_of_val(list)
        }
        core::mem::size_of::<Self>()
            + bytes(&self.vertices)
            + bytes(&self.vertex_normals)
            + bytes(&self.triangles)
            + bytes(&self.triangle_edges)
            + bytes(&self.edges)
            + bytes(&self.edges_at_begin)
            + bytes(&self.edges_at)
            + bytes(&self.blocks)
            + bytes(&self.leaves)
            + bytes(&self.corners)
            + bytes(&self.nodes)
    }
}
