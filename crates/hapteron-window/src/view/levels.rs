//! The contact levels in use: where contacts are looked for, each patch of the hierarchy in a colour of its own.

use super::compose::Sight;
use super::geometry::Vertex;
use super::picture::Colour;
use hapteron::collision::clod::Lod;
use hapteron::session::LevelsInUse;
use nalgebra::Isometry3;

/// Patches of one surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Patches {
    /// Where.
    pub world_from_mesh: Isometry3<f64>,
    /// Corners of triangles, mesh frame.
    pub vertices: Vec<Vertex>,
}

/// The patches of body and obstacles that the last pass made its contacts with.
pub fn patches(sight: &Sight<'_>, levels: &LevelsInUse) -> Vec<Patches> {
    let mut all = Vec::new();
    for (front, obstacle) in levels.fronts.iter().zip(&sight.scene.obstacles) {
        let body = (sight.scene.model.lod(), sight.body);
        let other = (obstacle.model.lod(), obstacle.world_from_mesh);
        for (nodes, (lod, world_from_mesh)) in front.iter().zip([body, other]) {
            if let Some(lod) = lod.filter(|_| !nodes.is_empty()) {
                all.push(Patches { world_from_mesh, vertices: corners(&lod, nodes) });
            }
        }
    }
    all
}

fn corners(lod: &Lod<'_>, nodes: &[u32]) -> Vec<Vertex> {
    let of = |&node: &u32| {
        let colour = colour(node);
        lod.corners(node).map(move |(position, normal)| Vertex {
            position: position.map(|c| c as f32),
            normal,
            colour,
        })
    };
    nodes.iter().flat_map(of).collect()
}

/// A colour for a node, the same as long as it is in use; those of neighbours, which have neighbouring numbers, are far apart.
fn colour(node: u32) -> Colour {
    let hue = (f64::from(node) * 0.618_033_988_749_895).fract() * 6.0;
    let channel = |shift: f64| {
        let k = (shift + hue).rem_euclid(6.0);
        let share = 1.0 - 0.62 * k.min(4.0 - k).clamp(0.0, 1.0);
        (share * 245.0) as u8
    };
    [channel(5.0), channel(3.0), channel(1.0), 255]
}

/// How many patches there are and of which levels, for body and obstacle.
#[must_use]
pub fn words(sight: &Sight<'_>, levels: &LevelsInUse) -> String {
    let mut parts = Vec::new();
    for (front, obstacle) in levels.fronts.iter().zip(&sight.scene.obstacles) {
        for ((nodes, lod), name) in
            front.iter().zip([sight.scene.model.lod(), obstacle.model.lod()]).zip(["body", "obstacle"])
        {
            let Some(lod) = lod.filter(|_| !nodes.is_empty()) else { continue };
            let own: Vec<u32> = nodes.iter().filter_map(|&n| lod.hierarchy.level_of(n)).collect();
            let (low, high) = (own.iter().min().copied(), own.iter().max().copied());
            let range = match (low, high) {
                (Some(low), Some(high)) if low < high => format!(", levels {low} to {high}"),
                (Some(low), _) => format!(", level {low}"),
                _ => String::new(),
            };
            parts.push(format!("{name}: {} patches{range}", nodes.len()));
        }
    }
    if parts.is_empty() { "nothing near".to_owned() } else { parts.join("     ") }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Would catch patches side by side that cannot be told apart.
    #[test]
    fn neighbouring_nodes_have_different_colours() {
        for node in 0..500 {
            let (a, b) = (colour(node), colour(node + 1));
            let apart: i32 = a.iter().zip(b).map(|(x, y)| (i32::from(*x) - i32::from(y)).abs()).sum();
            assert!(apart > 80, "{node}: {a:?} {b:?}");
        }
    }
}
