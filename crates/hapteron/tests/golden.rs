//! Golden replays: the same input gives the same bits, in every profile and on every machine.
//!
//! A digest changes whenever the arithmetic does. When that is meant, look at what changed (`hapteron compare`), then put the new one here.
#![allow(clippy::unwrap_used)]

use hapteron::scene::file::Method;
use hapteron::scene::{ContactModel, Scene, SceneFile};
use hapteron::scenes::{jaws, spoon_in_cup, spoon_in_free_space};
use hapteron::session::run_virtual;

/// FNV-1a of the run as it is written.
fn digest(file: SceneFile) -> String {
    let recording = run_virtual(&Scene::from_file(file).unwrap(), &mut |_| true).unwrap();
    let mut bytes = Vec::new();
    recording.write_csv(&mut bytes).unwrap();
    let hash = bytes
        .iter()
        .fold(0xcbf2_9ce4_8422_2325_u64, |hash, &b| (hash ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3));
    format!("{hash:016x}")
}

/// Would catch a result that depends on the profile, the compiler's choice of instructions, hash maps or uninitialised state.
#[test]
fn runs_have_the_same_bits_everywhere() {
    let methods = [
        Method::BackwardEuler,
        Method::BackwardEulerNewton,
        Method::RungeKutta4,
        Method::ForwardEuler,
        Method::QuasiStatic,
    ];
    let free = methods.map(|m| digest(spoon_in_free_space(0.1, m)));
    assert_eq!(
        free,
        ["ed2a4b92db3da814", "94f8de780de48ee8", "27e7bfdaab3aba7f", "5d24a294ab3efa9d", "a6194c0ad8eae9a4"]
    );
    let models = [ContactModel::Planes, ContactModel::Linearized, ContactModel::Held].map(|model| {
        let mut scene = spoon_in_cup(0.01, 2e3, Method::BackwardEuler);
        scene.contact.model = Some(model);
        scene.contact_thread.period = Some(0.0023);
        scene.contact_thread.latency = Some(0.0017);
        digest(scene)
    });
    assert_eq!(models, ["6a83895d1cb9ca24", "f13e2b8f48620ac8", "1afe0294fecac5ad"]);
    assert_eq!(digest(jaws()), "0a698d5aeb5f3604");
}
