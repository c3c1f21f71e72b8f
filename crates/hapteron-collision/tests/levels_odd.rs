//! Queries by contact levels with odd tolerances, thresholds, budgets and poses.
#![allow(clippy::unwrap_used)]

#[path = "common/models.rs"]
mod models;
#[path = "common/ball.rs"]
mod shape;

use hapteron_collision::clod::{Detail, Lod, LodWorkspace, View, query_levels};
use hapteron_collision::mesh::TriMesh;
use hapteron_collision::{Contact, QueryWorkspace, query};
use models::Models;
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

const TOLERANCE: f64 = 1.5e-3;

impl Models {
    /// A bumpy ball and its cavity, 1 mm apart.
    fn balls(rings: u32) -> Self {
        let bump = |theta: f64, phi: f64| 2e-4 * (14.0 * theta).sin() * (12.0 * phi).cos() * theta.sin();
        Self::new([(0.06, None), (0.061, Some(0.0))].map(|(size, cavity)| {
            let (vertices, triangles) = shape::ball(rings, |theta, phi| size + bump(theta, phi), cavity);
            TriMesh::new(vertices, triangles).unwrap()
        }))
    }

    fn lods(&self) -> [Lod<'_>; 2] {
        [0, 1].map(|k| self.lod(k))
    }

    fn levels(
        &self,
        pose: &Isometry3<f64>,
        tolerance: f64,
        detail: &Detail,
        workspace: &mut LodWorkspace,
    ) -> (Vec<Contact>, f64) {
        let [body, obstacle] = self.lods();
        let found = query_levels(body, pose, obstacle, &Isometry3::identity(), tolerance, detail, workspace);
        assert!(!found.min_distance.is_nan());
        assert!(found.contacts.iter().all(|c| c.depth.is_finite() && c.weight > 0.0 && c.weight.is_finite()));
        (found.contacts.to_vec(), found.min_distance)
    }

    fn exact(&self, pose: &Isometry3<f64>, tolerance: f64) -> (Vec<Contact>, f64) {
        let [a, b] = &self.surfaces;
        let mut workspace = QueryWorkspace::new();
        let found = query(a, pose, b, &Isometry3::identity(), tolerance, &mut workspace);
        (found.contacts.to_vec(), found.min_distance)
    }
}

fn swaying(i: u32) -> Isometry3<f64> {
    let phase = f64::from(i) * 0.02;
    let shift = Vector3::new(2e-4 * phase.sin(), 3e-4 * (1.3 * phase).cos(), 2e-4 * (0.7 * phase).sin());
    let turn = UnitQuaternion::from_euler_angles(0.0, 0.002 * phase.cos(), 0.004 * phase.sin());
    Isometry3::from_parts(Translation3::from(shift), turn)
}

/// Would catch levels that find nothing at a tolerance of zero, where the exact query finds what crosses, or that take another
/// tolerance for wrong than that.
#[test]
fn the_same_tolerances_are_right_as_for_the_exact_query() {
    let models = Models::balls(12);
    let detail = Detail::threshold(1e-3);
    let pressed = Isometry3::translation(2.2e-3, 0.0, 0.0);
    for tolerance in [0.0, f64::from_bits(1), 1e-15, 1e-9, 1e13, 1e300, f64::MAX] {
        for (pose, name) in [(pressed, "pressed"), (Isometry3::identity(), "apart")] {
            let found = models.levels(&pose, tolerance, &detail, &mut LodWorkspace::new());
            let wanted = models.exact(&pose, tolerance);
            assert_eq!(found, wanted, "{name} at {tolerance:e}");
            assert!(name == "apart" || wanted.1 < -5e-4, "they do not cross");
        }
    }
    for tolerance in [-1e-3, f64::NAN, f64::INFINITY] {
        let (contacts, least) = models.levels(&pressed, tolerance, &detail, &mut LodWorkspace::new());
        assert!(contacts.is_empty() && least == f64::INFINITY, "{tolerance}");
    }
}

/// Asserts, over some queries, that levels take over and that no contact at a vertex is missing.
fn assert_levels(models: &Models, workspace: &mut LodWorkspace, from: u32, name: &str) {
    // So fine that every vertex in contact is a sample.
    let detail = Detail::threshold(4e-5);
    let vertices = 24 * 46 + 2;
    let mut by_levels = 0;
    for i in from..from + 300 {
        let (found, least) = models.levels(&swaying(i), TOLERANCE, &detail, workspace);
        if workspace.front()[0].is_empty() {
            continue;
        }
        by_levels += 1;
        if i % 20 == 0 {
            let (wanted, exact) = models.exact(&swaying(i), TOLERANCE);
            let features = |c: &Contact| (c.body_feature, c.obstacle_feature);
            let found: Vec<_> = found.iter().map(features).collect();
            let at_vertex = wanted.iter().map(features).filter(|f| f.0.min(f.1) < vertices);
            let missing = at_vertex.filter(|f| !found.contains(f)).count();
            assert_eq!(missing, 0, "{name}, query {i}");
            assert!((least - exact).abs() < 1e-12, "{name}, query {i}: {least} {exact}");
        }
    }
    assert!(by_levels > 100, "{name}: {by_levels} by levels");
}

/// Would catch a workspace that a jump spoils for good: after the body was far away, even farther than numbers reach, levels come
/// back as they came first.
#[test]
fn a_body_that_was_far_away_has_its_levels_again() {
    let models = Models::balls(24);
    let mut workspace = LodWorkspace::new();
    workspace.watch(true);
    assert_levels(&models, &mut workspace, 0, "at first");
    for (n, far) in (1..).zip([1.0, 1e9, 1e13, 1e100, 1e160, 1e300]) {
        let away = Isometry3::translation(far, 0.0, -far);
        let detail = Detail::threshold(4e-5);
        let (contacts, least) = models.levels(&away, TOLERANCE, &detail, &mut workspace);
        assert!(contacts.is_empty() && least == f64::INFINITY);
        assert_levels(&models, &mut workspace, 300 * n, &format!("after {far:e} m"));
    }
}

/// Would catch a workspace that takes what it knows of one pair of surfaces for another.
#[test]
fn a_workspace_can_change_its_surfaces() {
    let pairs = [Models::balls(24), Models::new([bar(0.02), bar(0.03)])];
    let mut workspace = LodWorkspace::new();
    workspace.watch(true);
    assert_levels(&pairs[0], &mut workspace, 0, "balls");
    for _ in 0..3 {
        let crossing = Isometry3::translation(0.0, 0.0, 0.0495);
        let found = pairs[1].levels(&crossing, TOLERANCE, &Detail::threshold(1e-3), &mut workspace);
        assert_eq!(found, pairs[1].exact(&crossing, TOLERANCE));
        assert!(!found.0.is_empty());
        assert!(workspace.front().iter().all(|nodes| nodes.is_empty()), "a front of other surfaces");
    }
    assert_levels(&pairs[0], &mut workspace, 300, "balls again");
}

fn bar(half: f64) -> TriMesh {
    let vertices = (0..8).map(|i| [0, 1, 2].map(|k| if i >> k & 1 == 1 { half } else { -half })).collect();
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    TriMesh::new(vertices, triangles).unwrap()
}

/// Would catch a front of an earlier query that is shown for one that had none.
#[test]
fn an_exact_query_has_no_front() {
    let models = Models::balls(24);
    let mut workspace = LodWorkspace::new();
    workspace.watch(true);
    let nothing = |w: &LodWorkspace| w.samples() == [0; 2] && w.front().iter().all(|nodes| nodes.is_empty());
    let far = Isometry3::translation(5.0, 0.0, 0.0);
    for (pose, threshold) in
        [(swaying(0), 0.0), (far, 4e-5), (Isometry3::translation(f64::NAN, 0.0, 0.0), 4e-5)]
    {
        assert_levels(&models, &mut workspace, 0, "balls");
        assert!(!nothing(&workspace));
        models.levels(&pose, TOLERANCE, &Detail::threshold(threshold), &mut workspace);
        assert!(nothing(&workspace), "{threshold} {pose}");
    }
}

/// Would catch a threshold, metric or budget that makes contacts disappear, weigh nothing or no number, or panics: each has about the
/// force of exact contacts, once levels have taken over and on the way there.
#[test]
fn odd_details_leave_the_contact_as_it_is() {
    let models = Models::balls(24);
    let plain = Detail::threshold(1e-3);
    let view = |distance: f64, focal_px, error_px| Detail {
        view: Some(View { eye: Point3::new(distance, 0.0, 0.0), focal_px, error_px }),
        ..plain
    };
    let mut details: Vec<Detail> = [1e-300, 1e-12, 1e3, 1e300, f64::MAX].map(Detail::threshold).into();
    details.extend([f64::NAN, f64::INFINITY, -1.0].map(Detail::threshold));
    details
        .extend([0.0, -1.0, f64::NAN, f64::INFINITY, 1e-300].map(|b| Detail { budget_us: Some(b), ..plain }));
    details.extend([f64::NAN, f64::INFINITY, -1.0, 1e300].map(|p| Detail { per_step: p, ..plain }));
    details.extend([f64::NAN, -1.0, 0.0, 1e300].map(|f| Detail { force_from: Some(f), ..plain }));
    details.extend([view(0.0, 1e3, 1.0), view(f64::INFINITY, 1e3, 1.0), view(0.2, 0.0, 0.0)]);
    details.extend([
        view(0.2, f64::NAN, f64::NAN),
        view(0.2, f64::INFINITY, -1.0),
        view(1e300, 1e300, 1e-300),
    ]);
    let stiff = |contacts: &[Contact]| -> f64 {
        contacts.iter().map(|c| c.weight * (TOLERANCE + c.depth).max(0.0)).sum()
    };
    for detail in details {
        let mut workspace = LodWorkspace::new();
        for i in 0..240 {
            let (contacts, _) = models.levels(&swaying(i), TOLERANCE, &detail, &mut workspace);
            if i % 40 == 39 {
                let (wanted, _) = models.exact(&swaying(i), TOLERANCE);
                let (felt, full) = (stiff(&contacts), stiff(&wanted));
                assert!((felt - full).abs() < 0.5 * full, "query {i}: {felt} {full} with {detail:?}");
            }
        }
    }
}
