//! The closed-loop tables of method.md (G.2) and experiments.md, each by the eigenvalues of `theory` and by simulation with the session's own code.
//!
//! Their assumptions, found by fitting them (docs/stability.md): G.2 has a wall of 5 kN/m with 5 N s/m, a velocity filter of 0.3, and counts the hand's
//! mass on top of the device's 0.136 kg. The other one has a device of 0.05 kg and 0.1 N s/m, plain differences as velocity,
//! walls without damping, and 'any wall' from 1 kN/m up.

use super::rig::{DT, Tool, direct_loop_dies_out, largest, linear, linear_loop_dies_out};
use super::theory::{Plant, Virtual, first_loss, is_stable};
use hapteron::device::simulated::SimulatedSettings;
use hapteron::device::{Grip, HandParameters};

/// Device, hand, delay and filter in both worlds.
fn both(device: (f64, f64), hand: HandParameters, delay: usize, filter: f64) -> (Plant, SimulatedSettings) {
    let plant = Plant {
        mass: device.0 + hand.mass,
        damping: device.1 + hand.damping,
        stiffness: hand.stiffness,
        delay,
        filter,
    };
    let usual = SimulatedSettings::new(linear(device.0, device.1), hand);
    (plant, SimulatedSettings { delay, velocity_filter: filter, ..usual })
}

/// Largest coupling stiffness by eigenvalues and by simulation.
fn coupling_limits(plant: &Plant, device: SimulatedSettings, b: f64, wall: (f64, f64)) -> [Option<f64>; 2] {
    let theory = first_loss(10.0, 1e6, |k| {
        is_stable(plant, &Virtual::Body { k, b, wall: wall.0, wall_damping: wall.1 })
    });
    let around = theory.filter(|k| k.is_finite()).unwrap_or(2000.0);
    let simulated = largest(around / 2.0, around * 2.0, |stiffness| {
        linear_loop_dies_out(Tool { mass: 0.01, stiffness, damping: b }, device, wall)
    });
    [theory, simulated]
}

fn assert_near(found: Option<f64>, expected: f64, what: &str) {
    let found = found.unwrap_or(0.0);
    assert!((found / expected - 1.0).abs() < 0.1, "{what}: {found:.0}, the table has {expected}");
}

/// Would catch a device, delay, filter, coupling or integrator that is not the one of the theory: G.2, no hand.
#[test]
fn a_released_handle_is_stable_up_to_the_predicted_coupling() {
    let table: [(usize, &[(f64, f64)]); 3] = [
        (0, &[(0.0, 107.0)]),
        (1, &[(0.0, 33.0), (1.0, 622.0), (2.0, 1121.0), (4.0, 1941.0), (10.0, 3496.0), (20.0, 4253.0)]),
        (2, &[(0.0, 20.0), (1.0, 374.0), (2.0, 673.0), (4.0, 1166.0), (10.0, 2019.0), (20.0, 2362.0)]),
    ];
    for (delay, row) in table {
        let (plant, device) = both((0.136, 0.05), HandParameters::default(), delay, 0.3);
        for &(b, expected) in row {
            let [theory, simulated] = coupling_limits(&plant, device, b, (5000.0, 5.0));
            println!(
                "delay {delay}, b_c {b}: table {expected}, eigenvalues {theory:.0?}, simulated {simulated:.0?}"
            );
            assert_near(theory, expected, "eigenvalues");
            assert_near(simulated, expected, "simulated");
        }
    }
}

/// Would catch a coupling that is limited where the table has no limit, and the reverse.
#[test]
fn without_delay_there_is_no_limit_and_too_much_damping_is_never_stable() {
    let (plant, device) = both((0.136, 0.05), HandParameters::default(), 0, 0.3);
    for b in [1.0, 2.0, 4.0] {
        let limit = first_loss(10.0, 1e6, |k| {
            is_stable(&plant, &Virtual::Body { k, b, wall: 5000.0, wall_damping: 5.0 })
        });
        assert_eq!(limit, Some(f64::INFINITY), "b_c {b}");
        for stiffness in [100.0, 1e4, 1e6] {
            assert!(linear_loop_dies_out(Tool { mass: 0.01, stiffness, damping: b }, device, (5000.0, 5.0)));
        }
    }
    let (plant, device) = both((0.136, 0.05), HandParameters::default(), 2, 0.3);
    for k in [10.0, 100.0, 1000.0, 1e4] {
        assert!(!is_stable(&plant, &Virtual::Body { k, b: 50.0, wall: 5000.0, wall_damping: 5.0 }));
        assert!(!linear_loop_dies_out(
            Tool { mass: 0.01, stiffness: k, damping: 50.0 },
            device,
            (5000.0, 5.0)
        ));
    }
}

/// G.2 with a hand, two samples late: more than 15 kN/m with an arm, 3.1 to 6.5 kN/m with a light pinch.
#[test]
fn a_hand_raises_the_limit_as_predicted() {
    let arm = HandParameters { mass: 0.554, damping: 6.45, stiffness: 135.0 };
    let pinch = HandParameters { mass: 0.05, damping: 4.0, stiffness: 100.0 };
    for b in [0.0, 4.0, 20.0] {
        let (plant, device) = both((0.136, 0.05), arm, 2, 0.3);
        let limits = coupling_limits(&plant, device, b, (5000.0, 5.0));
        println!("arm, b_c {b}: eigenvalues and simulated {limits:.0?}");
        assert!(limits.iter().all(|k| k.unwrap() > 15e3), "{limits:?}");
        let (plant, device) = both((0.136, 0.05), pinch, 2, 0.3);
        let limits = coupling_limits(&plant, device, b, (5000.0, 5.0));
        println!("pinch, b_c {b}: eigenvalues and simulated {limits:.0?}");
        assert!(limits.iter().all(|k| (3.1e3 * 0.9..6.5e3 * 1.1).contains(&k.unwrap())), "{limits:?}");
    }
}

/// The second table's device.
const LIGHT_DEVICE: (f64, f64) = (0.05, 0.1);

/// Direct rendering, B = 0 and 3.
#[test]
fn direct_rendering_is_stable_up_to_the_predicted_wall() {
    let table = [[67.0, 1930.0], [1406.0, 3337.0], [2407.0, 4370.0], [3410.0, 5380.0]];
    for (grip, row) in Grip::ALL.into_iter().zip(table) {
        let (plant, device) = both(LIGHT_DEVICE, grip.parameters(), 1, 1.0);
        for (b, expected) in [0.0, 3.0].into_iter().zip(row) {
            let theory = first_loss(10.0, 1e6, |k| is_stable(&plant, &Virtual::Direct { k, b }));
            let simulated = largest(expected / 2.0, expected * 2.0, |k| direct_loop_dies_out(device, k, b));
            println!(
                "{grip:?}, B {b}: table {expected}, eigenvalues {theory:.0?}, simulated {simulated:.0?}"
            );
            assert_near(theory, expected, "eigenvalues");
            assert_near(simulated, expected, "simulated");
        }
    }
}

const WALLS: [f64; 8] = [1e3, 2e3, 5e3, 1e4, 1e5, 1e6, 1e8, 1e9];

/// With a body of 10 g, b_c = 3: the largest coupling that is stable at any wall from 1 kN/m up.
#[test]
fn a_body_takes_the_wall_out_of_the_limit() {
    let table = [1045.0, 3337.0, 4370.0, 5380.0];
    for (grip, expected) in Grip::ALL.into_iter().zip(table) {
        let (plant, device) = both(LIGHT_DEVICE, grip.parameters(), 1, 1.0);
        let theory = first_loss(10.0, 1e6, |k| {
            WALLS.iter().all(|&wall| is_stable(&plant, &Virtual::Body { k, b: 3.0, wall, wall_damping: 0.0 }))
        });
        let simulated = largest(expected / 2.0, expected * 2.0, |stiffness| {
            let tool = Tool { mass: 0.01, stiffness, damping: 3.0 };
            WALLS.iter().all(|&wall| linear_loop_dies_out(tool, device, (wall, 0.0)))
        });
        println!("{grip:?}: table {expected}, eigenvalues {theory:.0?}, simulated {simulated:.0?}");
        assert_near(theory, expected, "eigenvalues");
        assert_near(simulated, expected, "simulated");
    }
}

/// The largest wall at k_c = 200, 500 (b_c = 2), 1000 (b_c = 3): any, any, and, with the handle released, 123 N/m.
#[test]
fn the_largest_wall_is_the_predicted_one() {
    for grip in Grip::ALL {
        let (plant, device) = both(LIGHT_DEVICE, grip.parameters(), 1, 1.0);
        for (stiffness, b) in [(200.0, 2.0), (500.0, 2.0), (1000.0, 3.0)] {
            let theory = first_loss(1.0, 1e9, |wall| {
                is_stable(&plant, &Virtual::Body { k: stiffness, b, wall, wall_damping: 0.0 })
            });
            let tool = Tool { mass: 0.01, stiffness, damping: b };
            let stable = |wall: f64| linear_loop_dies_out(tool, device, (wall, 0.0));
            if grip == Grip::Released && stiffness == 1000.0 {
                assert_near(theory, 123.0, "eigenvalues");
                assert_near(largest(60.0, 250.0, stable), 123.0, "simulated");
            } else {
                assert_eq!(theory, Some(f64::INFINITY), "{grip:?}, {stiffness}");
                for wall in [10.0, 50.0, 120.0, 200.0, 400.0].into_iter().chain(WALLS) {
                    assert!(stable(wall), "{grip:?}, k_c {stiffness}, wall {wall}");
                }
            }
        }
    }
    // Colgate and Schenkel say nothing of delay; the limit of Gil, Hulin and Diolaiti does: K < (b + B) / (T/2 + t_d).
    let (plant, _) = both(LIGHT_DEVICE, Grip::Light.parameters(), 1, 1.0);
    let limit = first_loss(10.0, 1e6, |k| is_stable(&plant, &Virtual::Direct { k, b: 0.0 }));
    assert_near(limit, (2.0 + 0.1) / (1.5 * DT), "Gil, Hulin and Diolaiti");
}
