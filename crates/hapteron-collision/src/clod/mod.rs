//! Contact levels of detail: a dual hierarchy over one surface, at the same time a multiresolution representation and a
//! bounding volume hierarchy (section 6.1 of Otaduy and Lin 2005, after Otaduy and Lin 2003).
//!
//! The leaves are the convex patches of the surface at full resolution. Every level above has about half as many, made by
//! filtered edge collapse and by merging patches whose union is convex. Where no valid patches can be made any more, nodes
//! of mere hulls lead up to the root. Each node knows how coarse it is, and how far from the original surface.

mod build;
pub mod cache;
mod middle;
mod nearest;
mod query;

use middle::Middle;

pub use build::{BuildError, Progress};
pub use query::{Combine, Detail, Lod, LodWorkspace, View, query_levels};

use crate::surface::Surface;
use crate::vector::Vec3;

/// Of what the building code makes and how it is written: a new one whenever either changes.
const fn format_version() -> u32 {
    2
}

/// A node whose hull has no valid surface; it must always be refined.
pub(crate) const PURE_HULL: u32 = u32::MAX;

/// A node of the hierarchy: a convex patch at one resolution, or a mere hull.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Node {
    /// Sphere around the part of the original surface that the node stands for.
    pub center: Vec3,
    pub radius: f64,
    /// Mean normal of that part, and between which heights along it it lies; zero where normals cancel.
    pub normal: Vec3,
    pub low: f64,
    pub high: f64,
    /// 1 / r: the longest edge that was collapsed into the patch, metres.
    pub edge: f64,
    /// s: two-sided distance between patch and original surface, metres; infinite for a mere hull.
    pub deviation: f64,
    /// h: the hulls of all descendants lie within this distance of this hull, metres.
    pub margin: f64,
    /// D: largest area that supports a contact anywhere on the patch, square metres.
    pub support: f64,
    /// 0 at the leaves; [`PURE_HULL`] for a mere hull.
    pub level: u32,
    /// None (the node's own index) for the root.
    pub parent: u32,
    /// Ranges: of nodes; of the hull's vertices; of the patch's faces; of the original triangles; of the original vertices that
    /// belong to it (each belongs to one leaf); of its samples.
    pub children: [u32; 2],
    pub hull: [u32; 2],
    pub faces: [u32; 2],
    pub triangles: [u32; 2],
    pub vertices: [u32; 2],
    pub samples: [u32; 2],
}

impl Node {
    /// phi = s / r^2: volume of the largest feature that the node lacks, cubic metres.
    pub(crate) fn feature_volume(&self) -> f64 {
        if self.level == PURE_HULL { f64::INFINITY } else { self.deviation * self.edge * self.edge }
    }
}

/// An original vertex where contacts of a node are made, and how many vertices it stands for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sample {
    pub vertex: u32,
    pub weight: f32,
}

/// Something about the mesh that its hierarchy has to live with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Defect {
    /// What it is.
    pub kind: DefectKind,
    /// How many of it.
    pub count: usize,
    /// The first of them, mesh frame, metres.
    pub place: [f64; 3],
}

/// Kinds of [`Defect`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DefectKind {
    /// Edges with one face: the surface is open. The rim is simplified along itself.
    Rim,
    /// Edges with more than two faces, or two of opposite orientation. Their vertices are kept in place at all levels.
    NonManifoldEdge,
    /// Vertices where the surface touches itself. They are kept in place at all levels.
    NonManifoldVertex,
}

/// One level of a hierarchy in numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LevelSummary {
    /// 0 is the original mesh.
    pub level: u32,
    /// Convex patches.
    pub patches: usize,
    /// Their faces.
    pub triangles: usize,
    /// 1 / r: the longest edge collapsed so far, metres; 0 at the leaves.
    pub edge: f64,
    /// Greatest deviation s of a patch from the original surface, metres.
    pub deviation: f64,
    /// Greatest margin h, metres.
    pub margin: f64,
    /// Greatest feature volume phi = s / r^2, cubic metres.
    pub feature_volume: f64,
}

/// A patch of a level, for pictures and checks.
#[derive(Clone, Debug, PartialEq)]
pub struct Patch {
    /// Mesh frame, metres.
    pub vertices: Vec<[f64; 3]>,
    /// Counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// s, metres.
    pub deviation: f64,
    /// Triangles of the [`Surface`] that it stands for.
    pub originals: Vec<u32>,
}

/// The contact levels of detail of one surface; frozen once built.
#[derive(Clone, Debug, PartialEq)]
pub struct Hierarchy {
    /// The root first, the children of a node side by side and after it.
    pub(crate) nodes: Vec<Node>,
    /// By node.
    pub(crate) middles: Vec<Middle>,
    pub(crate) hull_vertices: Vec<Vec3>,
    /// By corner the place in the node's range of hull vertices.
    pub(crate) faces: Vec<[u8; 3]>,
    /// The original triangles, those of a node side by side.
    pub(crate) triangles: Vec<u32>,
    /// The original vertices, those of a node side by side.
    pub(crate) vertices: Vec<u32>,
    pub(crate) samples: Vec<Sample>,
    /// Patch levels, without the mere hulls.
    pub(crate) levels: u32,
    /// Digest of the surface that this belongs to.
    pub(crate) identity: u64,
}

impl Hierarchy {
    /// Builds the hierarchy of a surface; set-up only. Deterministic; uses all cores.
    ///
    /// # Errors
    /// When `progress` asks to stop.
    pub fn build(surface: &Surface, progress: &mut Progress<'_>) -> Result<Self, BuildError> {
        build::hierarchy(surface, progress)
    }

    /// Whether it was built from this surface.
    #[must_use]
    pub fn belongs_to(&self, surface: &Surface) -> bool {
        self.identity == surface.identity
    }

    /// The patch levels, the finest first.
    #[must_use]
    pub fn levels(&self) -> Vec<LevelSummary> {
        (0..self.levels)
            .map(|level| {
                let own = || self.nodes.iter().filter(|n| n.level == level);
                let most = |f: fn(&Node) -> f64| own().map(f).fold(0.0, f64::max);
                LevelSummary {
                    level,
                    patches: own().count(),
                    triangles: own().map(|n| (n.faces[1] - n.faces[0]) as usize).sum(),
                    edge: most(|n| n.edge),
                    deviation: most(|n| n.deviation),
                    margin: most(|n| n.margin),
                    feature_volume: most(Node::feature_volume),
                }
            })
            .collect()
    }

    /// Nodes above the coarsest level, which are mere hulls.
    #[must_use]
    pub fn pure_hulls(&self) -> usize {
        self.nodes.iter().filter(|n| n.level == PURE_HULL).count()
    }

    /// The patches of a level.
    #[must_use]
    pub fn patches(&self, level: u32) -> Vec<Patch> {
        self.nodes.iter().filter(|n| n.level == level && level != PURE_HULL).map(|n| self.patch(n)).collect()
    }

    /// The level of a node, 0 at the finest; none for a mere hull, or where there is no such node.
    #[must_use]
    pub fn level_of(&self, node: u32) -> Option<u32> {
        self.nodes.get(node as usize).map(|n| n.level).filter(|level| *level != PURE_HULL)
    }

    fn patch(&self, node: &Node) -> Patch {
        Patch {
            vertices: self.hull(node).to_vec(),
            triangles: self.faces[range(node.faces)].iter().map(|t| t.map(u32::from)).collect(),
            deviation: node.deviation,
            originals: self.triangles[range(node.triangles)].to_vec(),
        }
    }

    pub(crate) fn hull(&self, node: &Node) -> &[Vec3] {
        &self.hull_vertices[range(node.hull)]
    }

    /// Radius of a sphere around the surface, metres: what error thresholds are a share of.
    #[must_use]
    pub fn radius(&self) -> f64 {
        self.nodes.first().map_or(0.0, |root| root.radius)
    }

    /// Memory that it holds, in bytes.
    #[must_use]
    pub fn memory_bytes(&self) -> usize {
        fn bytes<T>(list: &[T]) -> usize {
            core::mem::size_of_val(list)
        }
        core::mem::size_of::<Self>()
            + bytes(&self.nodes)
            + bytes(&self.middles)
            + bytes(&self.hull_vertices)
            + bytes(&self.faces)
            + bytes(&self.triangles)
            + bytes(&self.vertices)
            + bytes(&self.samples)
    }

    /// What is unusual about a surface, as its hierarchy sees it; empty for a closed manifold one.
    #[must_use]
    pub fn defects(surface: &Surface) -> Vec<Defect> {
        build::defects(surface)
    }
}

pub(crate) fn range([begin, end]: [u32; 2]) -> core::ops::Range<usize> {
    begin as usize..end as usize
}

#[cfg(test)]
mod tests;
