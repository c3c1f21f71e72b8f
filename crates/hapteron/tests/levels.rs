//! Contact levels of detail in the whole loop: a coarse replay feels like the exact one.
#![allow(clippy::unwrap_used)]

use hapteron::recording::Recording;
use hapteron::scene::{Scene, SceneFile};
use hapteron::scenes::jaws;
use hapteron::session::run_virtual;
use std::path::PathBuf;

fn run(mut file: SceneFile, threshold: f64) -> Recording {
    file.contact.error_threshold = Some(threshold);
    run_virtual(&Scene::from_file(file).unwrap(), &mut |_| true).unwrap()
}

/// Root mean square of the difference of two runs' feedback force over that of the first.
fn difference(exact: &Recording, other: &Recording) -> f64 {
    let pairs = || exact.rows.iter().zip(&other.rows);
    let wrong: f64 = pairs().map(|(a, b)| (a.feedback[0] - b.feedback[0]).norm_squared()).sum();
    let all: f64 = pairs().map(|(a, _)| a.feedback[0].norm_squared()).sum();
    (wrong / all).sqrt()
}

/// Would catch coarse contacts that push otherwise than exact ones: too weak, too strong, or elsewhere.
#[test]
fn coarse_jaws_feel_like_exact_ones() {
    let exact = run(jaws(), 0.0);
    for threshold in [0.025, 0.01, 0.004] {
        let coarse = run(jaws(), threshold);
        let difference = difference(&exact, &coarse);
        let depth = coarse.summary().greatest_penetration;
        println!("{threshold}: {:.3} % rms, penetration {:.4} mm", 100.0 * difference, depth * 1e3);
        assert!(difference < 0.05, "{threshold}: {difference}");
        assert!(depth < 1e-4, "{threshold}: {depth} m deep");
    }
}

/// Would catch forces that jump when levels change: the jaws closed, ground slowly against each other, and opened so that
/// the contact grows and shrinks.
#[test]
fn a_slow_slide_does_not_jump() {
    let path = slide();
    let mut file = jaws();
    file.hand.trajectory = Some(path.display().to_string());
    let largest_step = |r: &Recording| {
        r.rows.windows(2).map(|w| (w[1].feedback[0] - w[0].feedback[0]).norm()).fold(0.0, f64::max)
    };
    let exact = largest_step(&run(file.clone(), 0.0));
    for threshold in [0.025, 0.004] {
        let coarse = largest_step(&run(file.clone(), threshold));
        println!("{threshold}: largest step {coarse:.4} N, exact {exact:.4} N");
        assert!(coarse < 0.1, "{threshold}: {coarse} N");
    }
    std::fs::remove_file(path).unwrap();
}

/// The upper jaw lowered by 7 mm in 0.7 s, moved sideways by 3 mm in 0.6 s, lifted again.
fn slide() -> PathBuf {
    use std::fmt::Write;
    let [x, y, z] = hapteron::scenes::JAW_GRIP;
    let smooth = |u: f64| {
        let u = u.clamp(0.0, 1.0);
        u * u * (3.0 - 2.0 * u)
    };
    let mut text = "t,px,py,pz,qw,qx,qy,qz\n".to_owned();
    for i in 0..=2000 {
        let t = f64::from(i) * 1e-3;
        let down = 7e-3 * (smooth(t / 0.7) - smooth((t - 1.3) / 0.7));
        let aside = 3e-3 * smooth((t - 0.7) / 0.6);
        let height = z + hapteron::scenes::JAW_OPENING - down;
        writeln!(text, "{t},{},{y},{height},1,0,0,0", x + aside).unwrap();
    }
    let path = std::env::temp_dir().join(format!("hapteron-slide-{}.csv", std::process::id()));
    std::fs::write(&path, text).unwrap();
    path
}
