//! Mesh files of every format, bad ones included, and mass properties.
#![allow(clippy::unwrap_used)]

mod common;

use common::{Random, block, bumpy_ball, ring};
use hapteron_collision::Surface;
use hapteron_collision::mesh::{Format, TriMesh, check, load, mass_properties, parse};
use nalgebra::{Isometry3, Matrix3, Point3, Vector3};
use proptest::prelude::*;
use std::fmt::Write;

const FORMATS: [Format; 4] = [Format::Obj, Format::Stl, Format::Ply, Format::Off];

fn tetrahedron() -> TriMesh {
    let vertices = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    TriMesh::new(vertices, vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]).unwrap()
}

fn obj(mesh: &TriMesh) -> Vec<u8> {
    let mut text = "# made by a test\no thing\n".to_owned();
    for v in mesh.vertices() {
        let _ = writeln!(text, "v {} {} {}", v[0], v[1], v[2]);
    }
    for t in mesh.triangles() {
        let _ = writeln!(text, "f {}/1/1 {}//2 {}", t[0] + 1, t[1] + 1, t[2] + 1);
    }
    text.into_bytes()
}

fn off(mesh: &TriMesh) -> Vec<u8> {
    let mut text = format!("OFF # comment\n{} {} 0\n", mesh.vertices().len(), mesh.triangles().len());
    for v in mesh.vertices() {
        let _ = writeln!(text, "{} {} {}", v[0], v[1], v[2]);
    }
    for t in mesh.triangles() {
        let _ = writeln!(text, "3 {} {} {}", t[0], t[1], t[2]);
    }
    text.into_bytes()
}

fn stl(mesh: &TriMesh, binary: bool) -> Vec<u8> {
    let mut text = "solid thing\n".to_owned();
    let mut bytes = vec![b' '; 80];
    bytes.extend((mesh.triangles().len() as u32).to_le_bytes());
    for t in mesh.triangles() {
        let corners = t.map(|i| mesh.vertices()[i as usize]);
        bytes.extend([0; 12]);
        corners.iter().flatten().for_each(|c| bytes.extend((*c as f32).to_le_bytes()));
        bytes.extend([0; 2]);
        text.push_str("facet normal 0 0 0\nouter loop\n");
        corners.iter().for_each(|c| writeln!(text, "vertex {} {} {}", c[0], c[1], c[2]).unwrap());
        text.push_str("endloop\nendfacet\n");
    }
    text.push_str("endsolid thing\n");
    if binary { bytes } else { text.into_bytes() }
}

/// With another element and further properties, which must be skipped.
fn ply(mesh: &TriMesh, encoding: &str) -> Vec<u8> {
    let mut bytes = format!(
        "ply\nformat {encoding} 1.0\ncomment test\nelement camera 1\nproperty list uchar short lens\nelement vertex {}\nproperty uchar red\n\
         property double x\nproperty double y\nproperty double z\nelement face {}\nproperty list uchar uint vertex_indices\nproperty float area\nend_header\n",
        mesh.vertices().len(),
        mesh.triangles().len()
    )
    .into_bytes();
    let big = encoding == "binary_big_endian";
    let text = encoding == "ascii";
    let mut put = |value: &str, little: &[u8], end: bool| {
        if text {
            bytes.extend(value.bytes().chain([if end { b'\n' } else { b' ' }]));
        } else if big {
            bytes.extend(little.iter().rev());
        } else {
            bytes.extend(little);
        }
    };
    put("2", &[2], false);
    put("5", &5i16.to_le_bytes(), false);
    put("6", &6i16.to_le_bytes(), true);
    for v in mesh.vertices() {
        put("9", &[9], false);
        (0..3).for_each(|k| put(&v[k].to_string(), &v[k].to_le_bytes(), k == 2));
    }
    for t in mesh.triangles() {
        put("3", &[3], false);
        t.iter().for_each(|i| put(&i.to_string(), &i.to_le_bytes(), false));
        put("0.5", &0.5f32.to_le_bytes(), true);
    }
    bytes
}

/// Would catch a format that is read wrongly: order of bytes, skipped elements, shared corners, comments.
#[test]
fn every_format_gives_the_same_mesh() {
    let mesh = tetrahedron();
    let files = [
        (Format::Obj, obj(&mesh)),
        (Format::Off, off(&mesh)),
        (Format::Ply, ply(&mesh, "ascii")),
        (Format::Ply, ply(&mesh, "binary_little_endian")),
        (Format::Ply, ply(&mesh, "binary_big_endian")),
    ];
    for (format, bytes) in files {
        let read = parse(&bytes, format, "t").unwrap();
        assert_eq!((read.vertices(), read.triangles()), (mesh.vertices(), mesh.triangles()), "{format:?}");
    }
    for binary in [true, false] {
        let read = parse(&stl(&mesh, binary), Format::Stl, "t").unwrap();
        assert_eq!(read.triangles().len(), 4);
        assert!((mass_properties(&read).unwrap().volume - 1.0 / 6.0).abs() < 1e-7, "binary {binary}");
        assert!(check(&read).is_closed());
    }
}

/// Would catch an announced count that is believed, a fault without its line, and a panic.
#[test]
fn bad_files_are_refused_with_the_reason() {
    let lie = |text: &str| text.as_bytes().to_vec();
    let mut liar = stl(&tetrahedron(), true);
    liar[80..84].copy_from_slice(&4_000_000_000u32.to_le_bytes());
    let big = ply(&tetrahedron(), "binary_big_endian");
    let swap = |from: &str, to: &str| {
        let at = big.windows(from.len()).position(|w| w == from.as_bytes()).unwrap();
        [&big[..at], to.as_bytes(), &big[at + from.len()..]].concat()
    };
    let cases: Vec<(Format, Vec<u8>, &str)> = vec![
        (Format::Obj, vec![], "empty"),
        (Format::Stl, vec![], "empty"),
        (Format::Ply, vec![], "empty"),
        (Format::Off, vec![], "empty"),
        (Format::Stl, liar, "4000000000"),
        (Format::Off, lie("OFF\n4000000000 4000000000 0\n0 0 0\n"), "4000000000"),
        (Format::Ply, swap("vertex 4", "vertex 4000000000"), "4000000000"),
        (Format::Ply, swap("face 4", "face 3999999999"), "3999999999"),
        (Format::Ply, big[..big.len() - 5].to_vec(), "truncated"),
        (Format::Obj, lie("v 0 0 0\nv 1 0 nan\nv 0 1 0\nf 1 2 3\n"), "line 2"),
        (Format::Obj, lie("v 0 0 0\nv 1 0 inf\nv 0 1 0\nf 1 2 3\n"), "line 2"),
        (Format::Off, lie("OFF\n3 1 0\n0 0 0\n1 0 1e300\n0 1 0\n3 0 1 2\n"), "line 4"),
        (Format::Obj, lie("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n"), "line 4"),
        (Format::Obj, lie("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 -4\n"), "line 4"),
        (Format::Obj, lie("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n"), "line 4"),
        (Format::Off, lie("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 -1\n"), "line 6"),
        (Format::Obj, lie("v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n"), "no triangle with an area"),
        (Format::Obj, lie("v 0 0 0\nv 1 zero 0\n"), "expected a number"),
    ];
    for (format, bytes, words) in cases {
        let error = parse(&bytes, format, "part.x").unwrap_err().to_string();
        assert!(error.contains("part.x") && error.contains(words), "{format:?}: '{error}' lacks '{words}'");
    }
    assert!(load("nowhere.stl").unwrap_err().to_string().contains("nowhere.stl"));
}

/// Would catch an index that wraps, a fan that loses corners, and dropped triangles that are not counted.
#[test]
fn polygons_negative_indices_and_degenerate_faces_are_handled() {
    let text = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf -4 -3 -2 -1\nf 1 1 2\nf 1 2 2\n";
    let mesh = parse(text.as_bytes(), Format::Obj, "t").unwrap();
    assert_eq!(mesh.triangles(), [[0, 1, 2], [0, 2, 3]]);
    assert_eq!(mesh.dropped_triangles(), 2);
    assert!(!check(&mesh).is_closed());
}

/// Would catch wrong integrals: a box and a ring have closed forms.
#[test]
fn mass_properties_are_those_of_closed_forms() {
    let [a, b, c] = [0.3, 0.2, 0.7];
    let m = mass_properties(&block([a, b, c])).unwrap();
    assert!((m.volume - 8.0 * a * b * c).abs() < 1e-14);
    assert!(m.center_of_mass.norm() < 1e-14);
    let expected = Matrix3::from_diagonal(&Vector3::new(b * b + c * c, a * a + c * c, a * a + b * b)) / 3.0;
    assert!((m.inertia_per_mass - expected).norm() < 1e-14);
    // A torus; the mesh is inside it by a share of the angle squared.
    let (r, t) = (1.0, 0.3);
    let m = mass_properties(&ring(400, 200, r, t)).unwrap();
    let volume = 2.0 * std::f64::consts::PI.powi(2) * r * t * t;
    assert!((m.volume / volume - 1.0).abs() < 5e-4);
    let about_z = r * r + 0.75 * t * t;
    let across = 0.5 * r * r + 0.625 * t * t;
    let expected = Matrix3::from_diagonal(&Vector3::new(across, across, about_z));
    assert!((m.inertia_per_mass - expected).norm() < 1e-3, "{}", m.inertia_per_mass);
}

/// Would catch wrong products of inertia or a wrong reference point: parry3d's integrals of the same moved shapes agree.
#[test]
fn mass_properties_agree_with_another_library() {
    use parry3d_f64::math::Vector;
    use parry3d_f64::shape::Shape;
    let mut random = Random::new(9);
    for _ in 0..20 {
        let pose: Isometry3<f64> = random.pose(2.0);
        let ball = bumpy_ball(2, 0.1);
        let moved = ball.vertices().iter().map(|&v| (pose * Point3::from(v)).coords.into()).collect();
        let mesh = TriMesh::new(moved, ball.triangles().to_vec()).unwrap();
        let ours = mass_properties(&mesh).unwrap();
        let vertices = mesh.vertices().iter().map(|v| Vector::new(v[0], v[1], v[2])).collect();
        let theirs = parry3d_f64::shape::TriMesh::new(vertices, mesh.triangles().to_vec())
            .unwrap()
            .mass_properties(1.0);
        assert!((ours.volume - theirs.mass()).abs() < 1e-9, "{} {}", ours.volume, theirs.mass());
        let center = theirs.local_com;
        assert!((ours.center_of_mass - Vector3::new(center.x, center.y, center.z)).norm() < 1e-9);
        let mut mine: Vec<f64> =
            (ours.inertia_per_mass * ours.volume).symmetric_eigenvalues().iter().copied().collect();
        let principal = theirs.principal_inertia();
        let mut other = vec![principal.x, principal.y, principal.z];
        mine.sort_by(f64::total_cmp);
        other.sort_by(f64::total_cmp);
        for (a, b) in mine.iter().zip(&other) {
            assert!((a - b).abs() < 1e-8, "{mine:?} {other:?}");
        }
    }
}

/// Would catch mass properties made up for a mesh that encloses nothing.
#[test]
fn open_flat_and_inverted_meshes_have_no_mass_properties() {
    let closed = tetrahedron();
    let open = TriMesh::new(closed.vertices().to_vec(), closed.triangles()[1..].to_vec()).unwrap();
    let inverted = closed.triangles().iter().map(|t| [t[0], t[2], t[1]]).collect();
    let inverted = TriMesh::new(closed.vertices().to_vec(), inverted).unwrap();
    let flat =
        TriMesh::new(vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], vec![[0, 1, 2], [0, 2, 1]]).unwrap();
    for mesh in [open, inverted, flat] {
        let error = mass_properties(&mesh).unwrap_err().to_string();
        assert!(error.contains("give the body mass"), "{error}");
    }
}

/// Would catch a query structure that outgrows its promise.
#[test]
fn the_query_structure_takes_less_than_250_bytes_a_triangle() {
    for mesh in [bumpy_ball(6, 0.05), ring(200, 80, 1.0, 0.3)] {
        let surface = Surface::build(&mesh);
        let bytes = surface.memory_bytes() / surface.triangle_count();
        assert!(bytes < 250, "{bytes}");
    }
}

proptest! {
    /// Would catch a panic, a hang or a huge allocation on any bytes at all.
    #[test]
    fn no_bytes_make_a_reader_panic(bytes in prop::collection::vec(any::<u8>(), 0..400), cut in 0usize..400) {
        for format in FORMATS {
            let _ = parse(&bytes, format, "t");
        }
        for valid in [obj(&tetrahedron()), off(&tetrahedron()), stl(&tetrahedron(), true), ply(&tetrahedron(), "binary_little_endian")] {
            let mut damaged = valid;
            let at = cut % damaged.len();
            for (byte, with) in damaged[at..].iter_mut().zip(&bytes).take(6) {
                *byte = *with;
            }
            for format in FORMATS {
                if let Ok(mesh) = parse(&damaged, format, "t") {
                    prop_assert!(mesh.vertices().iter().flatten().all(|c| c.is_finite()));
                    let _ = Surface::build(&mesh);
                }
            }
        }
    }
}

/// Would catch a part of a file that is passed over in silence: each of these once lost a vertex, a face or the end of the mesh.
#[test]
fn nothing_of_a_file_is_passed_over() {
    let expected = tetrahedron();
    let text = String::from_utf8(obj(&expected)).unwrap();
    let marked =
        [b"\xef\xbb\xbf".to_vec(), text.strip_prefix("# made by a test\no thing\n").unwrap().into()].concat();
    let commented = format!("# made in C:\\parts\\\n{}", text.split_once("o thing\n").unwrap().1);
    let continued = format!("{}\\", text.trim_end());
    for bytes in [marked, commented.into_bytes(), continued.into_bytes()] {
        assert_eq!(parse(&bytes, Format::Obj, "t").unwrap(), expected);
    }
    let text = String::from_utf8(stl(&expected, false)).unwrap();
    let one_line =
        text.replace('\n', " ").replace("solid thing", "\nsolid thing\n").replace("end\nsolid", "\nendsolid");
    for text in [text.to_uppercase(), one_line] {
        assert_eq!(parse(text.as_bytes(), Format::Stl, "t").unwrap().triangles().len(), 4, "{text}");
    }
    let error = |bytes: &[u8], format| parse(bytes, format, "t").unwrap_err().to_string();
    for end in [text.rfind("facet normal").unwrap(), text.rfind("endsolid").unwrap()] {
        assert!(error(&text.as_bytes()[..end], Format::Stl).contains("truncated"));
    }
    let mut fewer = stl(&expected, true);
    fewer[80] = 3;
    assert!(error(&fewer, Format::Stl).contains("more follow"));
    let text = String::from_utf8(off(&expected)).unwrap();
    assert!(error(text.replace("\n4 4 0\n", "\n4 3 0\n").as_bytes(), Format::Off).contains("more follow"));
    for encoding in ["ascii", "binary_little_endian"] {
        let mut bytes = ply(&expected, encoding);
        let at = bytes.windows(14).position(|w| w == b"element face 4").unwrap();
        bytes[at + 13] = b'3';
        assert!(error(&bytes, Format::Ply).contains("more follow"), "{encoding}");
    }
    assert!(error(b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf -9 1 2\n", Format::Obj).contains("vertex -9"));
}

/// Would catch files of other programs that are refused or misread: OFF without the number of edges, with colours that its header does not announce, with
/// counts in lines of their own; and lines that end in a carriage return alone. Vertices that only look as if they had colours are an error.
#[test]
fn loosely_written_files_are_read() {
    let expected = tetrahedron();
    let text = String::from_utf8(off(&expected)).unwrap();
    let coloured = |behind: &str| {
        let lines = text.lines().enumerate();
        lines
            .map(|(i, line)| format!("{line}{}\n", if (2..6).contains(&i) { behind } else { "" }))
            .collect::<String>()
    };
    for loose in [
        text.replace("4 4 0", "4 4"),
        text.replace("4 4 0", "4\n4\n0"),
        text.replace("4 4 0", "4 4\n0"),
        coloured(" 255 0 0"),
        coloured(" 0.5 0 0 1 # red"),
        coloured(" 7").replace("4 4 0", "4 4"),
        text.replace('\n', "\r\n"),
        text.replace('\n', "\r"),
    ] {
        let read = parse(loose.as_bytes(), Format::Off, "t").unwrap();
        assert_eq!(
            (read.vertices(), read.triangles()),
            (expected.vertices(), expected.triangles()),
            "{loose}"
        );
    }
    let read =
        parse(String::from_utf8(obj(&expected)).unwrap().replace('\n', "\r").as_bytes(), Format::Obj, "t");
    assert_eq!(read.unwrap().triangles(), expected.triangles());
    let two_a_line = "OFF\n4 1 0\n0 0 0 1 0 0\n0 1 0 0 0 1\n3 0 1 2\n";
    let error = parse(two_a_line.as_bytes(), Format::Off, "t").unwrap_err().to_string();
    assert!(error.contains("line 5") && error.contains("line of its own"), "{error}");
}

/// Would catch a polygon that is not convex and whose notch is filled: the least distance into the notch of an L tells.
#[test]
fn faces_that_are_not_convex_keep_their_notch() {
    let outline = [[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]];
    let mut text = String::new();
    for z in [0, 1] {
        outline.iter().for_each(|[x, y]| writeln!(text, "v {x} {y} {z}").unwrap());
    }
    // Seen from the corner (2, 0), the notch lies across the fan.
    text.push_str("f 2 1 6 5 4 3\nf 8 9 10 11 12 7\n");
    (0..6).for_each(|i| {
        writeln!(text, "f {} {} {} {}", i + 1, (i + 1) % 6 + 1, (i + 1) % 6 + 7, i + 7).unwrap()
    });
    let mesh = parse(text.as_bytes(), Format::Obj, "t").unwrap();
    assert!(check(&mesh).is_closed());
    assert!((check(&mesh).area - 14.0).abs() < 1e-12, "{}", check(&mesh).area);
    assert!((mass_properties(&mesh).unwrap().volume - 3.0).abs() < 1e-12);
}
