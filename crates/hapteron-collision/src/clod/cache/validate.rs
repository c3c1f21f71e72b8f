//! Whether a hierarchy that came from a file is one: queries index its lists without looking.

use crate::clod::{Hierarchy, Node, PURE_HULL, range};
use crate::surface::Surface;

/// Checks every index, number and relation that queries rely on.
pub(super) fn validate(hierarchy: &Hierarchy, surface: &Surface) -> Result<(), &'static str> {
    let h = hierarchy;
    permutes(&h.triangles, surface.triangles.len(), "triangles")?;
    permutes(&h.vertices, surface.vertices.len(), "vertices")?;
    if h.nodes.is_empty() != surface.triangles.is_empty() {
        return Err("nodes");
    }
    if h.nodes.is_empty() && h.levels > 1 {
        return Err("levels");
    }
    if !h.hull_vertices.iter().flatten().all(|c| c.is_finite()) {
        return Err("hull vertices");
    }
    let vertices = surface.vertices.len();
    if !h.samples.iter().all(|s| (s.vertex as usize) < vertices && s.weight >= 0.0 && s.weight.is_finite()) {
        return Err("samples");
    }
    let mut next_child = 1;
    for (index, node) in h.nodes.iter().enumerate() {
        numbers(node)?;
        ranges(h, node)?;
        // Breadth first: children side by side in the order of their parents.
        let [begin, end] = node.children;
        if begin != next_child || end < begin || end as usize > h.nodes.len() {
            return Err("children");
        }
        next_child = end;
        family(h, index, node)?;
    }
    if next_child as usize != h.nodes.len().max(1) {
        return Err("children");
    }
    Ok(())
}

/// Whether the list holds each number below `count` once.
fn permutes(list: &[u32], count: usize, what: &'static str) -> Result<(), &'static str> {
    let mut seen = vec![false; count];
    let fresh = |&i: &u32| seen.get_mut(i as usize).is_some_and(|s| !std::mem::replace(s, true));
    if list.len() == count && list.iter().all(fresh) { Ok(()) } else { Err(what) }
}

fn numbers(node: &Node) -> Result<(), &'static str> {
    let finite = node.center.iter().chain(&node.normal).chain([&node.radius, &node.low, &node.high]);
    let sizes = [node.radius, node.margin, node.support];
    let patch = [node.edge, node.deviation];
    let good = finite.into_iter().all(|c| c.is_finite())
        && sizes.iter().all(|&s| s >= 0.0 && s.is_finite())
        && patch.iter().all(|&s| s >= 0.0)
        && (node.level == PURE_HULL || patch.iter().all(|s| s.is_finite()));
    if good { Ok(()) } else { Err("numbers") }
}

fn ranges(h: &Hierarchy, node: &Node) -> Result<(), &'static str> {
    let within = |[begin, end]: [u32; 2], count: usize| begin <= end && end as usize <= count;
    let good = within(node.hull, h.hull_vertices.len())
        && within(node.faces, h.faces.len())
        && within(node.triangles, h.triangles.len())
        && within(node.vertices, h.vertices.len())
        && within(node.samples, h.samples.len());
    if !good {
        return Err("ranges");
    }
    let corners = node.hull[1] - node.hull[0];
    if h.faces[range(node.faces)].iter().flatten().any(|&c| u32::from(c) >= corners) {
        return Err("faces");
    }
    let weight: f64 = h.samples[range(node.samples)].iter().map(|s| f64::from(s.weight)).sum();
    let stands_for = f64::from(node.vertices[1] - node.vertices[0]);
    if node.level != PURE_HULL && (weight - stands_for).abs() > 1e-6 * stands_for {
        Err("weights")
    } else {
        Ok(())
    }
}

/// A node stands for what its children stand for together, and levels fall by one from parent to child.
fn family(h: &Hierarchy, index: usize, node: &Node) -> Result<(), &'static str> {
    let children = range(node.children);
    if (node.level == 0) != children.is_empty() || (node.level != PURE_HULL && node.level >= h.levels) {
        return Err("levels");
    }
    let (mut triangles, mut vertices) = (node.triangles[0], node.vertices[0]);
    for c in children {
        let child = &h.nodes[c];
        let level_fits = if node.level == PURE_HULL {
            child.level == PURE_HULL || child.level + 1 == h.levels
        } else {
            child.level + 1 == node.level
        };
        if child.parent as usize != index
            || child.triangles[0] != triangles
            || child.vertices[0] != vertices
            || !level_fits
        {
            return Err("family");
        }
        (triangles, vertices) = (child.triangles[1], child.vertices[1]);
    }
    let leaf = node.level == 0;
    if !leaf && (triangles != node.triangles[1] || vertices != node.vertices[1]) {
        return Err("family");
    }
    let is_root = index == 0;
    // Or else there were levels without nodes.
    if is_root && node.level != PURE_HULL && node.level + 1 != h.levels {
        return Err("levels");
    }
    let whole =
        node.triangles == [0, h.triangles.len() as u32] && node.vertices == [0, h.vertices.len() as u32];
    if is_root && !(whole && node.parent == 0) { Err("root") } else { Ok(()) }
}
