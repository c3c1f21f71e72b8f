//! The cache against damage, staleness and contradiction.
#![allow(clippy::unwrap_used)]

use super::*;

/// Points along an edge of the sheet: few, for some tests read it again for each byte of its cache.
const SIDE: u32 = 8;

fn surface(height: f64) -> Surface {
    let mut vertices = Vec::new();
    let mut triangles = Vec::new();
    for i in 0..SIDE {
        for j in 0..SIDE {
            let (x, y) = (f64::from(i) * 0.15, f64::from(j) * 0.15);
            vertices.push([x, y, height * (5.0 * x).sin() * (4.0 * y).cos()]);
            if i > 0 && j > 0 {
                let [a, b, c, d] =
                    [(i - 1) * SIDE + j - 1, i * SIDE + j - 1, i * SIDE + j, (i - 1) * SIDE + j];
                triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
    }
    Surface::of_triangles(&vertices, &triangles)
}

fn build(surface: &Surface) -> Hierarchy {
    let built = Hierarchy::build(surface, &mut |_| true).unwrap();
    assert!(built.levels >= 3, "only {} levels", built.levels);
    built
}

/// Would catch a damaged file that is used: every byte is flipped in turn, and the file is cut short everywhere.
#[test]
fn no_damage_is_accepted() {
    let surface = surface(0.05);
    let good = build(&surface).to_bytes(&surface);
    assert!(Hierarchy::from_bytes(&good, &surface).is_ok());
    for at in 0..good.len() {
        let mut bad = good.clone();
        bad[at] ^= 1 << (at % 8);
        assert!(Hierarchy::from_bytes(&bad, &surface).is_err(), "byte {at}");
    }
    for length in (0..good.len()).step_by(7) {
        assert!(Hierarchy::from_bytes(&good[..length], &surface).is_err(), "length {length}");
    }
    let mut version = good.clone();
    version[8] += 1;
    assert_eq!(Hierarchy::from_bytes(&version, &surface), Err(Refused::OtherVersion));
    assert_eq!(Hierarchy::from_bytes(&good, &super::tests::surface(0.06)), Err(Refused::OtherMesh));
    assert_eq!(Hierarchy::from_bytes(b"solid cube", &surface), Err(Refused::NotAHierarchy));
}

/// Would catch contents that fit their checksum (somebody made them) and send a query out of bounds: whatever passes the
/// checks must have every index in place, so walking through it must not panic.
#[test]
fn contradictions_are_found_behind_a_good_checksum() {
    let surface = surface(0.05);
    let good = build(&surface).to_bytes(&surface);
    let body = &good[76..];
    let mut refused = 0;
    for at in 0..body.len() {
        for change in [1u8, 0x80, 0xff] {
            let mut bad = body.to_vec();
            bad[at] ^= change;
            match Hierarchy::from_body(&bad, &surface) {
                Err(_) => refused += 1,
                Ok(h) => walk(&h, &surface),
            }
        }
    }
    assert!(refused > body.len() / 4, "{refused} of {}", body.len());
}

/// Would catch levels that are promised and have no patches: to list four thousand million of them takes for ever.
#[test]
fn levels_without_patches_are_found() {
    let triangle = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let one = Surface::of_triangles(&triangle, &[[0, 1, 2]]);
    let none = Surface::of_triangles(&[], &[]);
    for surface in [&one, &none, &surface(0.05)] {
        let built = Hierarchy::build(surface, &mut |_| true).unwrap();
        assert!(Hierarchy::from_bytes(&built.to_bytes(surface), surface).is_ok());
        let more = Hierarchy { levels: u32::MAX, ..built };
        let refused = Hierarchy::from_bytes(&more.to_bytes(surface), surface);
        assert!(matches!(refused, Err(Refused::Impossible(_))), "{refused:?}");
    }
}

/// Would catch a change of what is built, or of how it is written, without a new [`format_version`]: files of the old program would be
/// taken for its own. With a new version, the digest here has to be the new one. One system is enough, and others may round otherwise.
#[cfg(target_os = "linux")]
#[test]
fn what_is_built_belongs_to_its_version() {
    // Without a sine, which depends on the library.
    let bump = |i: u32| (i % 8) * (8 - i % 8);
    let height = |i: u32, j: u32| f64::from(bump(i) * bump(j)) / 2048.0;
    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    for (i, j) in (0..16).flat_map(|i| (0..16).map(move |j| (i, j))) {
        vertices.push([f64::from(i) / 8.0, f64::from(j) / 8.0, height(i, j)]);
        if i > 0 && j > 0 {
            let [a, b, c, d] = [(i - 1) * 16 + j - 1, i * 16 + j - 1, i * 16 + j, (i - 1) * 16 + j];
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    let surface = Surface::of_triangles(&vertices, &triangles);
    let digest = blake3::hash(&build(&surface).to_bytes(&surface)).to_hex();
    assert_eq!((format_version(), &digest[..16]), (2, "8d7a0b2c2bcde725"));
}

/// Would catch threads that write one file at the same time and spoil it for each other: every one of them finds or makes it whole.
#[test]
fn many_can_write_at_the_same_time() {
    let folder = std::env::temp_dir().join(format!("hapteron-cache-race-{}", std::process::id()));
    let _ = std::fs::remove_dir_all(&folder);
    let surface = surface(0.05);
    let path = file_in(&folder, &surface);
    let bytes = build(&surface).to_bytes(&surface);
    std::thread::scope(|scope| {
        for _ in 0..8 {
            scope.spawn(|| {
                for _ in 0..50 {
                    write_whole(&path, &bytes).unwrap();
                    assert!(std::fs::read(&path).unwrap() == bytes, "a part of it");
                }
            });
        }
    });
    assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 1);
    // What a killed writer left goes with the next writing, what another one is writing stays, and so do other files.
    let beside = |name: &str| folder.join(format!("{}.{name}", path.file_name().unwrap().to_string_lossy()));
    let old = std::time::SystemTime::now() - 2 * LEFT_BEHIND;
    for (place, time) in
        [(beside("1-0-0"), Some(old)), (beside("2-0-0"), None), (folder.join("other"), Some(old))]
    {
        let file = std::fs::File::create(&place).unwrap();
        time.map_or(Ok(()), |time| file.set_modified(time)).unwrap();
    }
    write_whole(&path, &bytes).unwrap();
    assert!(!beside("1-0-0").exists() && beside("2-0-0").exists() && folder.join("other").exists());
    std::fs::remove_dir_all(&folder).unwrap();
}

fn walk(h: &Hierarchy, surface: &Surface) {
    use crate::clod::range;
    assert_eq!(h.levels().len(), h.levels as usize);
    for node in &h.nodes {
        let _ = &h.nodes[range(node.children)];
        let hull = h.hull(node);
        h.faces[range(node.faces)]
            .iter()
            .flatten()
            .for_each(|&c| assert!(hull[usize::from(c)][0].is_finite()));
        h.samples[range(node.samples)]
            .iter()
            .for_each(|s| assert!(surface.vertices[s.vertex as usize][0].is_finite()));
        h.vertices[range(node.vertices)].iter().for_each(|&v| assert!((v as usize) < surface.vertices.len()));
        h.triangles[range(node.triangles)]
            .iter()
            .for_each(|&t| assert!((t as usize) < surface.triangles.len()));
    }
}

/// Would catch a cache that is not used, one that trusts a stale file, and leftovers of writing.
#[test]
fn files_are_made_used_and_replaced() {
    let folder = std::env::temp_dir().join(format!("hapteron-cache-test-{}", std::process::id()));
    let _ = std::fs::remove_dir_all(&folder);
    let surface = surface(0.05);
    let get = || load_or_build(&surface, Some(&folder), &mut |_| true).unwrap();
    let (built, origin) = get();
    let path = file_in(&folder, &surface);
    assert_eq!(origin, Origin::Built(path.clone()));
    assert_eq!(get(), (built.clone(), Origin::Cached(path.clone())));
    let mut bytes = std::fs::read(&path).unwrap();
    let last = bytes.len() - 1;
    bytes[last] ^= 1;
    std::fs::write(&path, bytes).unwrap();
    assert_eq!(get(), (built.clone(), Origin::Rebuilt(path.clone(), Refused::Damaged)));
    assert_eq!(get(), (built.clone(), Origin::Cached(path.clone())));
    assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 1);
    std::fs::remove_dir_all(&folder).unwrap();
    // A folder that cannot be made: the hierarchy is there all the same.
    std::fs::write(&folder, b"in the way").unwrap();
    let (again, origin) = get();
    assert!(matches!(origin, Origin::NotCached(_)));
    assert_eq!(again, built);
    std::fs::remove_file(&folder).unwrap();
    assert!(matches!(load_or_build(&surface, None, &mut |_| true).unwrap().1, Origin::NotCached(_)));
}
