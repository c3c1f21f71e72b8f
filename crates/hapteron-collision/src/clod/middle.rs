//! By node the vertex in its middle, whose distance from another surface bounds those of all the node's vertices.

use super::{Node, range};
use crate::surface::Surface;
use crate::vector::{Vec3, dot, sub};
use rayon::prelude::*;

/// A vertex of a node and the greatest distance of the node's vertices from it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Middle {
    pub vertex: u32,
    /// Negative and infinite for a node without vertices of its own, which is never near anything.
    pub extent: f64,
}

/// The middles of nodes over a list of vertices. They are not kept in files: a wrong one would lose contacts.
pub(super) fn middles(surface: &Surface, nodes: &[Node], vertices: &[u32]) -> Vec<Middle> {
    nodes.par_iter().map(|node| middle(surface, node, &vertices[range(node.vertices)])).collect()
}

fn middle(surface: &Surface, node: &Node, own: &[u32]) -> Middle {
    let at = |v: u32| surface.vertices[v as usize];
    let squared = |v: u32, p: Vec3| {
        let d = sub(at(v), p);
        dot(d, d)
    };
    let nearest =
        own.iter().copied().min_by(|&a, &b| squared(a, node.center).total_cmp(&squared(b, node.center)));
    let Some(vertex) = nearest else {
        return Middle { vertex: 0, extent: f64::NEG_INFINITY };
    };
    let extent = own.iter().map(|&v| squared(v, at(vertex))).fold(0.0, f64::max).sqrt();
    Middle { vertex, extent: extent * (1.0 + 1e-12) }
}
