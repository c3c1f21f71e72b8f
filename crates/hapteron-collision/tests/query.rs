//! The exact query against brute force on small meshes.
#![allow(clippy::unwrap_used)]

mod common;

use common::{Random, block, bumpy_ball, corners, crossing, point_triangle, ring, sheet, triangles_apart};
use hapteron_collision::mesh::TriMesh;
use hapteron_collision::{Contact, QueryWorkspace, Surface, query};
use nalgebra::{Isometry3, Point3, Vector3};

const TOLERANCE: f64 = 0.12;

/// All pairs of triangles: least distance, and whether any cross.
fn brute(a: &TriMesh, pose_a: &Isometry3<f64>, b: &TriMesh, pose_b: &Isometry3<f64>) -> (f64, bool) {
    let (ta, tb) = (corners(a, pose_a), corners(b, pose_b));
    let mut least = f64::INFINITY;
    let mut cross = false;
    for x in &ta {
        for y in &tb {
            let center = |t: &[Vector3<f64>; 3]| (t[0] + t[1] + t[2]) / 3.0;
            let size = |t: &[Vector3<f64>; 3]| t.iter().map(|v| (v - center(t)).norm()).fold(0.0, f64::max);
            if (center(x) - center(y)).norm() - size(x) - size(y) > least {
                continue;
            }
            cross |= crossing(x, y);
            least = least.min(triangles_apart(x, y));
        }
    }
    (least, cross)
}

/// Distance of every vertex of `a` to the surface `b`.
fn vertex_distances(
    a: &TriMesh,
    pose_a: &Isometry3<f64>,
    b: &TriMesh,
    pose_b: &Isometry3<f64>,
) -> Vec<(Vector3<f64>, f64)> {
    let triangles = corners(b, pose_b);
    a.vertices()
        .iter()
        .map(|&v| {
            let p = (pose_a * Point3::from(v)).coords;
            (p, triangles.iter().map(|&t| point_triangle(p, t)).fold(f64::INFINITY, f64::min))
        })
        .collect()
}

/// Behind an open sheet counts as inside: there the number is a depth, which is no less than the distance.
fn assert_exact(found: f64, least: f64, open: bool) {
    let exact = (found - least).abs() < 1e-9 + 1e-6 * least;
    assert!(exact || (open && found <= -least * (1.0 - 1e-6)), "{found} instead of {least}");
}

fn median_edge(mesh: &TriMesh) -> f64 {
    let mut lengths: Vec<f64> = corners(mesh, &Isometry3::identity())
        .iter()
        .flat_map(|t| [(t[0] - t[1]).norm(), (t[1] - t[2]).norm(), (t[2] - t[0]).norm()])
        .collect();
    lengths.sort_by(f64::total_cmp);
    lengths[lengths.len() / 2]
}

fn assert_valid(contacts: &[Contact], tolerance: f64) {
    for c in contacts {
        assert!((c.normal.norm() - 1.0).abs() < 1e-9, "{c:?}");
        assert!((c.depth - (c.point_body - c.point_obstacle).dot(&c.normal)).abs() < 1e-9, "{c:?}");
        assert!(c.depth >= -tolerance * (1.0 + 1e-9), "{c:?}");
    }
}

fn shapes() -> Vec<TriMesh> {
    vec![
        bumpy_ball(3, 0.08),
        block([0.8, 0.5, 0.3]),
        ring(28, 12, 0.8, 0.25),
        sheet(12),
        block([0.9, 0.7, 0.02]),
    ]
}

/// Would catch a distance that misses an edge pair, a leaf or a thin wall; a crossing that is taken for a distance, and the reverse.
#[test]
fn least_distances_are_those_of_brute_force() {
    let shapes = shapes();
    let surfaces: Vec<Surface> = shapes.iter().map(Surface::build).collect();
    let mut random = Random::new(1);
    let (mut apart, mut crossed, mut far) = (0, 0, 0);
    for i in 0..shapes.len() {
        for j in 0..shapes.len() {
            let mut workspace = QueryWorkspace::new();
            for _ in 0..16 {
                let (pose_a, pose_b) = (random.pose(1.4), random.pose(0.4));
                let found = query(&surfaces[i], &pose_a, &surfaces[j], &pose_b, TOLERANCE, &mut workspace);
                let (least, cross) = brute(&shapes[i], &pose_a, &shapes[j], &pose_b);
                assert_valid(found.contacts, TOLERANCE);
                if cross {
                    crossed += 1;
                    // An open sheet has no inside: what runs through it shows only where it is close.
                    let open = [i, j].contains(&3);
                    assert!(
                        open || found.min_distance < 0.0,
                        "{i} {j}: crossing, got {}",
                        found.min_distance
                    );
                } else if least < TOLERANCE {
                    apart += 1;
                    assert_exact(found.min_distance, least, i == 3 || j == 3);
                } else {
                    far += 1;
                    assert!(
                        found.min_distance.is_infinite() && found.contacts.is_empty(),
                        "{i} {j}: {}",
                        found.min_distance
                    );
                }
            }
        }
    }
    assert!(apart > 25 && crossed > 100 && far > 25, "{apart} {crossed} {far}");
}

/// Moves a body along a direction until the brute-force distance to the obstacle is `gap`.
fn brought_near(a: &TriMesh, b: &TriMesh, random: &mut Random, gap: f64) -> Isometry3<f64> {
    let rotation = random.pose(0.0).rotation;
    let direction = random.vector().normalize();
    let still = Isometry3::identity();
    let mut distance = 4.0;
    for _ in 0..60 {
        let pose = Isometry3::from_parts((direction * distance).into(), rotation);
        let (least, cross) = brute(a, &pose, b, &still);
        assert!(!cross);
        if least - gap < 1e-6 {
            break;
        }
        // Never farther than the distance: it cannot run through.
        distance -= least.min(10.0) - gap;
    }
    Isometry3::from_parts((direction * distance).into(), rotation)
}

/// Would catch a region closer than d without a contact nearby, on either side, and a near pair of edges that no contact shows.
#[test]
fn all_that_is_near_has_a_contact_nearby() {
    let shapes = shapes();
    let surfaces: Vec<Surface> = shapes.iter().map(Surface::build).collect();
    let mut random = Random::new(2);
    let still = Isometry3::identity();
    let mut judged = 0;
    for i in 0..shapes.len() {
        for j in 0..shapes.len() {
            for _ in 0..4 {
                let gap = 0.05 * random.number().abs();
                let pose = brought_near(&shapes[i], &shapes[j], &mut random, gap);
                let mut workspace = QueryWorkspace::new();
                let found = query(&surfaces[i], &pose, &surfaces[j], &still, TOLERANCE, &mut workspace);
                let (least, _) = brute(&shapes[i], &pose, &shapes[j], &still);
                assert_exact(found.min_distance, least, i == 3 || j == 3);
                if found.min_distance < 0.0 {
                    // From behind: an open sheet is felt from its front only.
                    continue;
                }
                let best = found.contacts.iter().map(|c| -c.depth).fold(f64::INFINITY, f64::min);
                let there = (best - found.min_distance).abs() < 1e-12;
                assert!(there, "{i} {j}: no contact at the least distance");
                let of_body = vertex_distances(&shapes[i], &pose, &shapes[j], &still);
                let of_obstacle = vertex_distances(&shapes[j], &still, &shapes[i], &pose);
                let point =
                    |side: usize, c: &Contact| if side == 0 { c.point_body } else { c.point_obstacle };
                for (side, list, mesh) in [(0, of_body, &shapes[i]), (1, of_obstacle, &shapes[j])] {
                    let reach = TOLERANCE + 1.5 * median_edge(mesh);
                    for (p, distance) in list.iter().filter(|v| v.1 < TOLERANCE * (1.0 - 1e-6)) {
                        judged += 1;
                        let covered = found.contacts.iter().any(|c| (point(side, c) - p).norm() <= reach);
                        assert!(covered, "{i} {j} side {side}: {distance} away at {p:?} without a contact");
                    }
                }
            }
        }
    }
    assert!(judged > 500, "{judged}");
}

/// Would catch memory that changes a result or its order: the queries along motions from fast to slow, with jumps and changes of the
/// tolerance between them, are to the bit those of a workspace that knows nothing.
#[test]
fn memory_never_changes_a_result() {
    let (body, obstacle) = (Surface::build(&ring(40, 16, 0.8, 0.25)), Surface::build(&bumpy_ball(4, 0.06)));
    let mut random = Random::new(3);
    let mut workspace = QueryWorkspace::new();
    let mut seen = 0;
    for jump in 0..28 {
        let (start, drift) = (random.pose(0.5), random.pose(1.0));
        // From a step far larger than the tolerance to one far smaller.
        let step = 0.3 * 0.6f64.powi(jump);
        for k in 0..24 {
            let moved = drift.translation.vector * (step * f64::from(k));
            let turned =
                nalgebra::UnitQuaternion::new(drift.translation.vector * (0.3 * step * f64::from(k)));
            let pose =
                Isometry3::from_parts((start.translation.vector + moved).into(), turned * start.rotation);
            let still = Isometry3::identity();
            let tolerance = TOLERANCE * [1.0, 1.0, 0.6, 1.3][(k / 2 % 4) as usize];
            let mut fresh = QueryWorkspace::new();
            let cold = query(&body, &pose, &obstacle, &still, tolerance, &mut fresh);
            let warm = query(&body, &pose, &obstacle, &still, tolerance, &mut workspace);
            assert_eq!(cold.min_distance, warm.min_distance, "{jump} {k}");
            assert_eq!(cold.contacts, warm.contacts, "{jump} {k}");
            seen += cold.contacts.len();
        }
    }
    assert!(seen > 1000, "{seen}");
}

/// Would catch a result that depends on where in the world the pair is.
#[test]
fn contacts_move_with_the_pair() {
    let (body, obstacle) = (Surface::build(&bumpy_ball(3, 0.05)), Surface::build(&bumpy_ball(3, 0.08)));
    let mut random = Random::new(4);
    for _ in 0..20 {
        let relative = Isometry3::new(random.vector().normalize() * 2.05, random.vector());
        let world = random.pose(10.0);
        let (mut a, mut b) = (QueryWorkspace::new(), QueryWorkspace::new());
        let here = query(&body, &relative, &obstacle, &Isometry3::identity(), TOLERANCE, &mut a);
        let there = query(&body, &(world * relative), &obstacle, &world, TOLERANCE, &mut b);
        assert_eq!(here.contacts.len(), there.contacts.len());
        for (x, y) in here.contacts.iter().zip(there.contacts) {
            assert!((world * Point3::from(x.point_body) - Point3::from(y.point_body)).norm() < 1e-9);
            assert!((world * x.normal - y.normal).norm() < 1e-6);
        }
    }
}

/// Would catch a wall thinner than the tolerance that is felt from behind, or a depth with the wrong sign.
#[test]
fn thin_walls_are_felt_from_the_side_they_are_on() {
    let wall = Surface::build(&block([1.0, 1.0, 0.01]));
    let probe = Surface::build(&bumpy_ball(3, 0.0));
    for (side, gap) in [(1.0, 0.03), (-1.0, 0.03), (1.0, -0.004), (-1.0, -0.004)] {
        let pose = Isometry3::translation(0.013, 0.021, side * (1.01 + gap));
        let mut workspace = QueryWorkspace::new();
        let found = query(&probe, &pose, &wall, &Isometry3::identity(), 0.05, &mut workspace);
        assert!((found.min_distance - gap).abs() < 3e-3, "{side} {gap}: {}", found.min_distance);
        let deepest = found.contacts.iter().max_by(|a, b| a.depth.total_cmp(&b.depth)).unwrap();
        assert!((deepest.normal.z + side).abs() < 0.05, "{side} {gap}: {deepest:?}");
        let against = found.contacts.iter().filter(|c| c.normal.z * side > 0.1).count();
        assert_eq!(against, 0, "{side} {gap}: contacts that pull through the wall");
    }
}

/// Would catch a panic or a made-up contact on poses and tolerances that are none.
#[test]
fn nonsense_finds_nothing() {
    let ball = Surface::build(&bumpy_ball(1, 0.0));
    let still = Isometry3::identity();
    let lost = Isometry3::translation(f64::NAN, 0.0, 0.0);
    for (pose, tolerance) in
        [(lost, 0.1), (still, f64::NAN), (still, -1.0), (still, f64::INFINITY), (still, -f64::MIN_POSITIVE)]
    {
        let mut workspace = QueryWorkspace::new();
        let found = query(&ball, &pose, &ball, &still, tolerance, &mut workspace);
        assert!(found.contacts.is_empty() && found.min_distance.is_infinite(), "{pose} {tolerance}");
    }
}

/// Would catch a contact that ends at some depth, so that a hard push goes through: a ball pressed into a block, far deeper than the
/// tolerance, and coarse bars across each other with no vertex inside.
#[test]
fn depth_has_no_end() {
    let (block, ball) = (Surface::build(&block([1.0, 1.0, 1.0])), Surface::build(&bumpy_ball(4, 0.0)));
    let still = Isometry3::identity();
    for depth in [0.004, 0.02, 0.1, 0.5, 0.9] {
        let pose = Isometry3::translation(0.01, 0.02, 2.0 - depth);
        let mut workspace = QueryWorkspace::new();
        let found = query(&ball, &pose, &block, &still, 0.01, &mut workspace);
        assert!((found.min_distance + depth).abs() < 2e-3, "{depth}: {}", found.min_distance);
        let deepest = found.contacts.iter().max_by(|a, b| a.depth.total_cmp(&b.depth)).unwrap();
        assert!((deepest.depth - depth).abs() < 2e-3 && deepest.normal.z < -0.999, "{depth}: {deepest:?}");
        assert_valid(found.contacts, 0.01);
        let mirrored = query(&block, &still, &ball, &pose, 0.01, &mut QueryWorkspace::new()).min_distance;
        assert!((mirrored - found.min_distance).abs() < 1e-9, "{depth}: {mirrored}");
    }
}

/// Would catch parts that cross where no vertex shows it: two bars laid across each other and overlapping.
#[test]
fn crossing_bars_push_apart() {
    let bar = Surface::build(&block([1.0, 0.1, 0.1]));
    let still = Isometry3::identity();
    for overlap in [0.003, 0.02, 0.05] {
        let turned = Isometry3::new(Vector3::new(0.0, 0.0, 0.2 - overlap), Vector3::z() * 1.5);
        let mut workspace = QueryWorkspace::new();
        let found = query(&bar, &turned, &bar, &still, 0.01, &mut workspace);
        assert!((found.min_distance + overlap).abs() < 1e-6, "{overlap}: {}", found.min_distance);
        assert!(found.contacts.iter().any(|c| c.normal.z < -0.999 && (c.depth - overlap).abs() < 1e-6));
    }
}

/// Would catch a tolerance of zero with which a body falls through another one unseen.
#[test]
fn a_tolerance_of_zero_finds_what_crosses() {
    let (a, b) = (Surface::build(&block([0.1; 3])), Surface::build(&block([1.0; 3])));
    let mut workspace = QueryWorkspace::new();
    let mut at = |x| {
        let pose = Isometry3::translation(x, 0.2, 0.3);
        let found = query(&a, &pose, &b, &Isometry3::identity(), 0.0, &mut workspace);
        (found.min_distance, found.contacts.len())
    };
    let (crossing, contacts) = at(1.05);
    assert!((crossing + 0.05).abs() < 1e-12 && contacts > 0, "{crossing} {contacts}");
    assert_eq!(at(1.1001), (f64::INFINITY, 0));
}

/// Would catch numbers that single precision does not hold: whatever the tolerance and the poses, a query ends, and a tolerance
/// that covers everything finds the distance.
#[test]
fn any_tolerance_and_pose_is_answered() {
    let (a, b) = (Surface::build(&block([0.1; 3])), Surface::build(&bumpy_ball(2, 0.1)));
    let mut workspace = QueryWorkspace::new();
    let sizes = [1e-300, 1e-30, 1e-3, 1e6, 1e12, 1e19, 1e30, 1e39, 1e160, 1e300, f64::MAX];
    for tolerance in sizes {
        for far in sizes {
            let (pose, other) =
                (Isometry3::translation(far, 0.0, 3.0), Isometry3::translation(0.0, 0.0, 1e-3 * far));
            for other in [Isometry3::identity(), other] {
                let found = query(&a, &pose, &b, &other, tolerance, &mut workspace);
                assert!(!found.min_distance.is_nan() && found.contacts.iter().all(|c| c.depth.is_finite()));
                if other == Isometry3::identity() && far <= 1e-3 {
                    assert_eq!(found.min_distance.is_finite(), tolerance > 2.0, "{tolerance} {far}");
                }
            }
        }
    }
}
