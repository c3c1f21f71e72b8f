//! The tree over all levels: patches under the patches that they were merged into, and mere hulls up to one root.

use super::decompose::NONE;
use super::simplify::Level;
use crate::surface::Surface;
use crate::vector::{Vec3, add, scale};

/// A node while the tree is put together.
#[derive(Debug)]
pub(super) struct Branch {
    /// Level and patch; none for a mere hull.
    pub patch: Option<(u32, u32)>,
    pub parent: u32,
    pub children: [u32; 2],
    /// Ranges of [`Tree::triangles`] and [`Tree::vertices`].
    pub triangles: [u32; 2],
    pub vertices: [u32; 2],
}

/// The tree: the root first, breadth first, so that children lie side by side.
pub(super) struct Tree {
    pub branches: Vec<Branch>,
    /// Original triangles, those of a branch side by side.
    pub triangles: Vec<u32>,
    /// Original vertices likewise; each belongs to the leaf of its first triangle.
    pub vertices: Vec<u32>,
}

/// What becomes a branch.
enum Item {
    Patch(u32, u32),
    /// Patches of the coarsest level.
    Hull(Vec<u32>),
}

pub(super) fn tree(surface: &Surface, levels: &[Level]) -> Tree {
    let mut tree = Tree { branches: Vec::new(), triangles: Vec::new(), vertices: Vec::new() };
    let Some(coarsest) = levels.last().filter(|l| !l.patches.is_empty()) else {
        return tree;
    };
    let top = levels.len() as u32 - 1;
    let centers: Vec<Vec3> = (0..coarsest.patches.len()).map(|p| center(coarsest, p)).collect();
    let all: Vec<u32> = (0..coarsest.patches.len() as u32).collect();
    let item = |part: Vec<u32>| match part[..] {
        [only] => Item::Patch(top, only),
        _ => Item::Hull(part),
    };
    let mut items = vec![item(all)];
    tree.branches.push(Branch::new(&items[0], 0));
    let mut next = 0;
    while next < tree.branches.len() {
        let children: Vec<Item> = match &items[next] {
            Item::Hull(part) => halves(part.clone(), &centers).map(item).into(),
            Item::Patch(0, _) => Vec::new(),
            Item::Patch(level, patch) => levels[*level as usize].patches[*patch as usize]
                .children
                .iter()
                .map(|&c| Item::Patch(level - 1, c))
                .collect(),
        };
        let begin = tree.branches.len() as u32;
        for child in children {
            tree.branches.push(Branch::new(&child, next as u32));
            items.push(child);
        }
        tree.branches[next].children = [begin, tree.branches.len() as u32];
        next += 1;
    }
    tree.arrange(surface, &levels[0]);
    tree
}

impl Branch {
    fn new(item: &Item, parent: u32) -> Self {
        let patch = match *item {
            Item::Patch(level, patch) => Some((level, patch)),
            Item::Hull(_) => None,
        };
        Self { patch, parent, children: [0; 2], triangles: [0; 2], vertices: [0; 2] }
    }
}

/// The middle of a patch's corners.
fn center(level: &Level, patch: usize) -> Vec3 {
    let [begin, end] = level.patches[patch].faces;
    let corners = || level.faces[begin as usize..end as usize].iter().flatten();
    let sum = corners().fold([0.0; 3], |sum, &v| add(sum, level.vertices[v as usize]));
    scale(sum, 1.0 / corners().count().max(1) as f64)
}

/// Cuts in two at the median along the direction of largest spread.
fn halves(mut part: Vec<u32>, centers: &[Vec3]) -> [Vec<u32>; 2] {
    let spread = |axis: usize| {
        let values = || part.iter().map(|&p| centers[p as usize][axis]);
        values().fold(f64::NEG_INFINITY, f64::max) - values().fold(f64::INFINITY, f64::min)
    };
    let axis = (0..3).max_by(|&a, &b| spread(a).total_cmp(&spread(b))).unwrap_or(0);
    part.sort_by(|&a, &b| centers[a as usize][axis].total_cmp(&centers[b as usize][axis]).then(a.cmp(&b)));
    let second = part.split_off(part.len() / 2);
    [part, second]
}

impl Tree {
    /// Lays the triangles and vertices of each branch side by side.
    fn arrange(&mut self, surface: &Surface, leaves: &Level) {
        let mut leaf_of = vec![NONE; surface.triangles.len()];
        for (patch, p) in leaves.patches.iter().enumerate() {
            for &t in &p.triangles {
                leaf_of[t as usize] = patch as u32;
            }
        }
        let mut owned: Vec<Vec<u32>> = vec![Vec::new(); leaves.patches.len()];
        let mut taken = vec![false; surface.vertices.len()];
        for (t, corners) in surface.triangles.iter().enumerate() {
            for &v in corners {
                if !std::mem::replace(&mut taken[v as usize], true) {
                    owned[leaf_of[t] as usize].push(v);
                }
            }
        }
        self.visit(0, leaves, &owned);
    }

    fn visit(&mut self, root: u32, leaves: &Level, owned: &[Vec<u32>]) {
        // Depth first without recursion: a branch is opened, and closed when its children are done.
        let mut stack = vec![(root, false)];
        while let Some((index, done)) = stack.pop() {
            let ends = [self.triangles.len() as u32, self.vertices.len() as u32];
            let i = index as usize;
            if done {
                self.branches[i].triangles[1] = ends[0];
                self.branches[i].vertices[1] = ends[1];
                continue;
            }
            self.branches[i].triangles[0] = ends[0];
            self.branches[i].vertices[0] = ends[1];
            stack.push((index, true));
            if let Some((0, patch)) = self.branches[i].patch {
                self.triangles.extend(&leaves.patches[patch as usize].triangles);
                self.vertices.extend(&owned[patch as usize]);
            }
            let [begin, end] = self.branches[i].children;
            stack.extend((begin..end).rev().map(|c| (c, false)));
        }
    }
}
