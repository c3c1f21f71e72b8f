//! Queries by contact levels against the exact query.
#![allow(clippy::unwrap_used)]

#[path = "common/models.rs"]
mod models;
#[path = "common/ball.rs"]
mod shape;

use hapteron_collision::clod::{Combine, Detail, LodWorkspace, View, query_levels};
use hapteron_collision::mesh::TriMesh;
use hapteron_collision::{Contact, QueryWorkspace, query};
use models::Models;
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

impl Models {
    /// Contacts and least distance by levels.
    fn levels(
        &self,
        pose: &Isometry3<f64>,
        tolerance: f64,
        detail: &Detail,
        workspace: &mut LodWorkspace,
    ) -> (Vec<Contact>, f64) {
        let still = Isometry3::identity();
        let found = query_levels(self.lod(0), pose, self.lod(1), &still, tolerance, detail, workspace);
        (found.contacts.to_vec(), found.min_distance)
    }

    fn exact(
        &self,
        pose: &Isometry3<f64>,
        tolerance: f64,
        workspace: &mut QueryWorkspace,
    ) -> (Vec<Contact>, f64) {
        let [a, b] = &self.surfaces;
        let found = query(a, pose, b, &Isometry3::identity(), tolerance, workspace);
        (found.contacts.to_vec(), found.min_distance)
    }
}

/// A ball of 2 n^2 facets or so and its cavity, 1 mm apart.
fn ball_in_cavity(n: u32) -> Models {
    Models::new([ball(n, 0.06, false), ball(n, 0.061, true)])
}

fn ball(rings: u32, radius: f64, cavity: bool) -> TriMesh {
    let (vertices, triangles) = shape::ball(rings, |_, _| radius, cavity.then_some(0.0));
    TriMesh::new(vertices, triangles).unwrap()
}

fn bar(half: [f64; 3]) -> TriMesh {
    let vertices =
        (0..8).map(|i| [0, 1, 2].map(|k| if i >> k & 1 == 1 { half[k] } else { -half[k] })).collect();
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    TriMesh::new(vertices, triangles).unwrap()
}

fn swaying(i: u32) -> Isometry3<f64> {
    let phase = f64::from(i) * 0.02;
    let shift = Vector3::new(2e-4 * phase.sin(), 3e-4 * (1.3 * phase).cos(), 2e-4 * (0.7 * phase).sin());
    let turn = UnitQuaternion::from_euler_angles(0.0, 0.002 * phase.cos(), 0.004 * phase.sin());
    Isometry3::from_parts(Translation3::from(shift), turn)
}

/// Sum of the penalty forces for a stiffness of 1.
fn force(contacts: &[Contact], tolerance: f64) -> Vector3<f64> {
    contacts.iter().map(|c| -c.normal * (c.weight * (tolerance + c.depth).max(0.0))).sum()
}

/// Would catch a threshold of zero that is anything but the exact query.
#[test]
fn threshold_zero_is_the_exact_query() {
    let models = ball_in_cavity(30);
    let (mut coarse, mut exact) = (LodWorkspace::new(), QueryWorkspace::new());
    for i in 0..40 {
        let levels = models.levels(&swaying(i), 1.5e-3, &Detail::threshold(0.0), &mut coarse);
        let wanted = models.exact(&swaying(i), 1.5e-3, &mut exact);
        assert!(wanted.0.len() > 1000, "{}", wanted.0.len());
        assert_eq!(levels, wanted);
    }
}

/// Would catch a small contact that is not the exact one: here two edges that cross, which no vertex shows.
#[test]
fn a_small_contact_is_exact() {
    let models = Models::new([bar([0.05, 0.005, 0.005]), bar([0.05, 0.005, 0.005])]);
    let (mut coarse, mut exact) = (LodWorkspace::new(), QueryWorkspace::new());
    let roll = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), 0.7);
    let across = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 1.3);
    let mut crossing = 0;
    for i in 0..60 {
        let shift = Translation3::new(0.0, 0.0, 0.0127 - 2e-5 * f64::from(i));
        let pose = Isometry3::from_parts(shift, across * roll);
        let levels = models.levels(&pose, 1e-3, &Detail::threshold(2e-3), &mut coarse);
        let wanted = models.exact(&pose, 1e-3, &mut exact);
        assert_eq!(levels, wanted, "step {i}");
        crossing += wanted.0.iter().filter(|c| c.body_feature >= 8 && c.obstacle_feature >= 8).count();
    }
    assert!(crossing > 20, "{crossing}");
}

/// Would catch contacts that weigh more or less than the exact ones, push elsewhere, jump, or are not fewer: a ball that sinks
/// into contact with its cavity from afar, slides, and comes out, so that the ways of finding contacts change over.
#[test]
fn contacts_grow_and_shrink_without_a_jump() {
    let models = Models::new([ball(60, 0.05, false), ball(60, 0.061, true)]);
    let (tolerance, threshold) = (1.5e-3, 0.025 * 0.05);
    let (mut coarse, mut exact) = (LodWorkspace::new(), QueryWorkspace::new());
    let mut last: Option<[Vector3<f64>; 2]> = None;
    let (mut fewest, mut equal) = (1.0f64, 0);
    let (mut wrong, mut all) = (0.0, 0.0);
    for i in 0..1600 {
        let t = f64::from(i) * 1e-3;
        let down = 9e-3 + 2.2e-3 * (core::f64::consts::PI * t / 1.6).sin();
        let shift = Translation3::new(1e-3 * (2.0 * t).sin(), 0.0, -down);
        let pose = Isometry3::from_parts(shift, UnitQuaternion::from_euler_angles(0.0, 0.0, 0.2));
        let (a, least) = models.levels(&pose, tolerance, &Detail::threshold(threshold), &mut coarse);
        let (b, exact_least) = models.exact(&pose, tolerance, &mut exact);
        let forces = [force(&a, tolerance), force(&b, tolerance)];
        if !b.is_empty() {
            fewest = fewest.min(a.len() as f64 / b.len() as f64);
            assert!(least >= exact_least - 1e-12, "{least} {exact_least}");
        }
        equal += u32::from(!b.is_empty() && a == b);
        wrong += (forces[0] - forces[1]).norm_squared();
        all += forces[1].norm_squared();
        if let Some(last) = last {
            let [by_levels, exactly] = [0, 1].map(|k: usize| (forces[k] - last[k]).norm());
            // A twentieth of what the levels may be wrong by.
            let most = exactly + 0.01 * forces[1].norm() + 0.02 * tolerance;
            assert!(by_levels <= most, "step {i}: {by_levels} {exactly} {most}");
        }
        last = Some(forces);
    }
    let off = f64::sqrt(wrong / all);
    println!("least share of contacts {fewest:.2}, as exact {equal}, force off by {:.2} %", 100.0 * off);
    assert!(fewest < 0.6, "{fewest}");
    assert!(equal > 10, "{equal}");
    assert!(off < 0.05, "{off}");
}

/// Would catch a budget that changes nothing: with none to speak of contacts become few, and come back when there is time.
#[test]
fn a_budget_that_is_too_small_makes_contacts_fewer() {
    let models = ball_in_cavity(40);
    let detail = |budget_us| Detail { budget_us: Some(budget_us), ..Detail::threshold(1e-4) };
    let mut workspace = LodWorkspace::new();
    let mut count = |from: u32, budget| {
        (from..from + 150)
            .map(|i| models.levels(&swaying(i), 1.5e-3, &detail(budget), &mut workspace).0.len())
            .last()
            .unwrap()
    };
    let (much, little, again) = (count(0, 1e9), count(150, 1e-6), count(300, 1e9));
    assert!(little * 5 < much && little > 0, "{much} {little}");
    assert!(again * 10 > much * 9, "{much} {again}");
}

/// Would catch a panic at the smallest tolerance that there is, on the way to levels, which a budget that is too small asks for.
#[test]
fn the_smallest_tolerance_does_not_panic() {
    let models = ball_in_cavity(8);
    let detail = Detail { budget_us: Some(1e-9), ..Detail::threshold(1e-3) };
    let mut workspace = LodWorkspace::new();
    for i in 0..50 {
        let (contacts, _) = models.levels(&swaying(i), f64::from_bits(1), &detail, &mut workspace);
        assert!(contacts.iter().all(|c| c.depth.is_finite() && c.weight.is_finite()));
    }
}

/// Would catch metrics of view and velocity that are not asked: a near eye wants more contacts than a far one, a fast motion fewer than a
/// slow one.
#[test]
fn what_is_seen_or_slow_is_finer() {
    let models = ball_in_cavity(40);
    let count = |detail: Detail, speed: u32| {
        let mut workspace = LodWorkspace::new();
        // The levels take over from the exact query within these.
        (0..200)
            .map(|i| {
                // All end at the same pose.
                let pose = swaying(20_000 - (199 - i) * speed);
                models.levels(&pose, 1.5e-3, &detail, &mut workspace).0.len()
            })
            .last()
            .unwrap()
    };
    let plain = Detail::threshold(0.025 * 0.06);
    let seen = |distance: f64| {
        let view = View { eye: Point3::new(0.0, 0.0, distance), focal_px: 1000.0, error_px: 1.0 };
        count(Detail { view: Some(view), ..plain }, 1)
    };
    assert!(seen(0.2) > 2 * seen(50.0), "{} {}", seen(0.2), seen(50.0));
    let moving = |speed| {
        let fine = Detail { per_step: 4.0, combine: Combine::Any, ..Detail::threshold(1e-5) };
        count(Detail { combine: Combine::All, ..fine }, speed)
    };
    let (slow, fast) = (moving(1), moving(40));
    assert!(2 * fast < slow, "{slow} {fast}");
}

/// Would catch a hard push that goes through: a ball driven far into the wall of its cavity, deeper than any front looks, and back.
#[test]
fn a_deep_contact_is_exact() {
    let models = ball_in_cavity(30);
    let (tolerance, detail) = (5e-4, Detail::threshold(0.025));
    let mut coarse = LodWorkspace::new();
    let mut deepest: f64 = 0.0;
    for i in 0..240 {
        // 5 mm beyond the wall and back, 0.05 mm a query.
        let shift = 6e-3 - 5e-5 * f64::from((120 - i32::from(i as u8)).abs());
        let pose = Isometry3::translation(shift, 0.3 * shift, 0.1 * shift);
        let (contacts, least) = models.levels(&pose, tolerance, &detail, &mut coarse);
        let (wanted, exact) = models.exact(&pose, tolerance, &mut QueryWorkspace::new());
        if exact > -0.5 * tolerance {
            continue;
        }
        deepest = deepest.max(-exact);
        let depth = contacts.iter().map(|c| c.depth).fold(0.0, f64::max);
        // The query that finds it deep is still one by levels.
        assert!((least - exact).abs() < 6e-5 && (depth + exact).abs() < 6e-5, "{i}: {least} {depth} {exact}");
        let (felt, full) = (force(&contacts, tolerance), force(&wanted, tolerance));
        assert!(
            (felt - full).norm() < 0.1 * full.norm() || exact > -0.7 * tolerance,
            "{i}: {felt:?} {full:?}"
        );
    }
    assert!(deepest > 4e-3, "{deepest}");
}
