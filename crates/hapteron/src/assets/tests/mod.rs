//! What the built-in models promise.

mod intersections;
mod measures;

use hapteron_collision::mesh::{Format, mass_properties, parse};

use super::*;
use measures::{Measures, digest};

fn model(name: &str) -> TriMesh {
    builtin(name).unwrap_or_else(|error| panic!("{error}"))
}

/// Counts, closedness, orientation and genus of one model, and its smallest enclosing sphere.
fn assert_sound(name: &str, triangles: usize, euler: i64, radius: std::ops::Range<f64>) -> Measures {
    let mesh = model(name);
    let measures = Measures::of(&mesh);
    assert_eq!(mesh.triangles().len(), triangles, "{name}");
    assert_eq!(
        measures.unmatched_edges, 0,
        "{name}: an edge is open, shared by more than two, or badly oriented"
    );
    assert_eq!(measures.pinched_vertices, 0, "{name}");
    assert_eq!(measures.euler_characteristic, euler, "{name}");
    assert!(measures.volume > 0.0, "{name} is inside out");
    assert!(radius.contains(&measures.radius), "{name}: radius {} m", measures.radius);
    let found = intersections::intersecting_pairs(&mesh);
    assert!(found.is_empty(), "{name}: {} intersecting pairs: {found:?}", found.len());
    measures
}

/// Would catch a model that is open, turned inside out, self-intersecting, of another size or count than the paper's.
#[test]
fn spoon_and_cup_are_sound() {
    let spoon = assert_sound("spoon", 1_344, 2, 0.095..0.105);
    assert!(
        spoon.worst_angle() > 2.0 && spoon.median_angle() > 15.0,
        "{} {}",
        spoon.worst_angle(),
        spoon.median_angle()
    );
    // The handle is a tunnel.
    let cup = assert_sound("cup", 4_000, 0, 0.070..0.080);
    assert!(
        cup.worst_angle() > 2.0 && cup.median_angle() > 15.0,
        "{} {}",
        cup.worst_angle(),
        cup.median_angle()
    );
}

/// As above, for the jaws. A closed surface has an even number of triangles, so the upper jaw has one more than the paper's 47,339.
#[test]
fn jaws_are_sound() {
    for (name, triangles) in [("lower_jaw", 40_180), ("upper_jaw", 47_340)] {
        let jaw = assert_sound(name, triangles, 2, 0.059..0.061);
        assert!(
            jaw.worst_angle() > 0.2 && jaw.median_angle() > 15.0,
            "{name}: {} {}",
            jaw.worst_angle(),
            jaw.median_angle()
        );
    }
}

/// Would catch teeth that are missing or without cusps: tips are vertices higher than all within 1.5 mm.
#[test]
fn jaws_have_fourteen_teeth_with_cusps() {
    for (name, up) in [("lower_jaw", 1.0), ("upper_jaw", -1.0)] {
        let mesh = model(name);
        let height = |v: &[f64; 3]| up * v[2];
        let crowns: Vec<&[f64; 3]> = mesh.vertices().iter().filter(|v| height(v) > -0.004).collect();
        let near =
            |a: &[f64; 3], b: &[f64; 3]| (a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2) < 1.5e-3f64.powi(2);
        let tips =
            crowns.iter().filter(|v| !crowns.iter().any(|w| near(v, w) && height(w) > height(v))).count();
        // 6 front teeth with one edge each, 4 premolars with 2 or 3, 4 molars with 4 or 5.
        assert!((30..=60).contains(&tips), "{name}: {tips} tips");
    }
}

/// Would catch jaws that do not meet: at the identity the cusps stand between each other without touching.
#[test]
fn jaws_are_in_occlusion_at_the_identity() {
    use hapteron_collision::{QueryWorkspace, Surface, query};
    use nalgebra::{Isometry3, Translation3};
    let [upper, lower] = ["upper_jaw", "lower_jaw"].map(|name| Surface::build(&model(name)));
    let mut workspace = QueryWorkspace::new();
    let still = Isometry3::identity();
    let gap = query(&upper, &still, &lower, &still, 1e-3, &mut workspace).min_distance;
    assert!((1e-4..3e-4).contains(&gap), "{gap}");
    let lowered = Isometry3::from(Translation3::new(0.0, 0.0, -0.6e-3));
    let found = query(&upper, &lowered, &lower, &still, 5e-4, &mut workspace);
    assert!(found.min_distance < 0.0, "{}", found.min_distance);
    let on_the_left = found.contacts.iter().filter(|c| c.point_body.x < -0.01).count();
    let on_the_right = found.contacts.iter().filter(|c| c.point_body.x > 0.01).count();
    assert!(on_the_left > 20 && on_the_right > 20, "{on_the_left} {on_the_right}");
}

/// Would catch a model whose bits depend on the machine, the profile, or an unintended change.
#[test]
fn models_have_the_same_bits_everywhere() {
    let digests = BUILTIN_NAMES.map(|name| (name, format!("{:016x}", digest(&model(name)))));
    let expected = [
        ("spoon", "2dd2b4172ad9bc6b"),
        ("cup", "9abb8c3bc3d87fb9"),
        ("lower_jaw", "97b48588a3a7a382"),
        ("upper_jaw", "71135af0997cfa5b"),
    ];
    assert_eq!(digests.each_ref().map(|(n, d)| (*n, d.as_str())), expected);
}

/// Would catch a writer whose file reads back as another mesh.
#[test]
fn written_models_read_back() {
    for name in BUILTIN_NAMES {
        let mesh = model(name);
        let mut obj = Vec::new();
        write_obj(&mesh, name, &mut obj).unwrap();
        let again = parse(&obj, Format::Obj, name).unwrap();
        assert_eq!((again.vertices(), again.triangles()), (mesh.vertices(), mesh.triangles()), "{name}");
        let mut stl = Vec::new();
        write_stl(&mesh, &mut stl).unwrap();
        let again = parse(&stl, Format::Stl, name).unwrap();
        assert_eq!(again.triangles().len(), mesh.triangles().len(), "{name}");
        let (a, b) = (mass_properties(&mesh).unwrap().volume, mass_properties(&again).unwrap().volume);
        assert!((a / b - 1.0).abs() < 1e-5, "{name}: {a} {b}");
    }
    assert!(builtin("knife").unwrap_err().to_string().contains("spoon, cup"));
}
