//! The properties that clusters promise (method B).
#![allow(clippy::unwrap_used)]

mod common;

use common::Random;
use hapteron_collision::Contact;
use hapteron_collision::cluster::{Cluster, ClusterParameters, Clusterer};
use nalgebra::{Isometry3, Vector3};

const TOLERANCE: f64 = 1e-3;

fn contact(feature: u32, point: Vector3<f64>, normal: Vector3<f64>, depth: f64) -> Contact {
    Contact {
        point_body: point,
        point_obstacle: point - normal * depth,
        normal,
        depth,
        weight: 1.0,
        body_feature: feature,
        obstacle_feature: 7,
    }
}

/// Patches of contacts about some places.
fn patches(random: &mut Random, places: usize, each: usize) -> Vec<Contact> {
    let mut contacts = Vec::new();
    for place in 0..places {
        let middle = Vector3::new(0.03 * place as f64, 0.0, 0.0);
        let normal = Vector3::new(0.2 * random.number(), 0.2 * random.number(), -1.0).normalize();
        for _ in 0..each {
            let depth = TOLERANCE * (0.6 * random.number() - 0.2);
            let feature = contacts.len() as u32;
            contacts.push(contact(feature, middle + random.vector() * 2e-3, normal, depth));
        }
    }
    contacts
}

fn clusterer(max_clusters: usize) -> Clusterer {
    Clusterer::new(ClusterParameters { max_clusters, radius: 0.01 })
}

fn update(clusterer: &mut Clusterer, contacts: &[Contact]) -> Vec<Cluster> {
    clusterer.update(contacts, TOLERANCE, &Isometry3::identity()).to_vec()
}

/// Would catch clusters that are not found apart, outgrow their number, or lose weight.
#[test]
fn each_patch_becomes_a_cluster_and_no_weight_is_lost() {
    let mut random = Random::new(1);
    for places in [1, 3, 8, 20] {
        let contacts = patches(&mut random, places, 12);
        let found = update(&mut clusterer(8), &contacts);
        assert_eq!(found.len(), places.min(8));
        let weight: f64 = contacts.iter().map(|c| TOLERANCE + c.depth).sum();
        let kept: f64 = found.iter().map(|c| c.weight).sum();
        assert!((kept / weight - 1.0).abs() < 1e-12, "{places}: {kept} of {weight}");
        assert_eq!(found.iter().map(|c| c.contacts).sum::<usize>(), contacts.len());
    }
}

/// Would catch a representative that is not the weighted mean of its contacts.
#[test]
fn a_representative_is_the_weighted_mean() {
    let contacts = patches(&mut Random::new(2), 1, 9);
    let found = update(&mut clusterer(8), &contacts);
    let weight = |c: &Contact| TOLERANCE + c.depth;
    let sum: f64 = contacts.iter().map(weight).sum();
    let point = contacts.iter().map(|c| c.point_body * weight(c)).sum::<Vector3<f64>>() / sum;
    let depth = contacts.iter().map(|c| c.depth * weight(c)).sum::<f64>() / sum;
    assert!((found[0].point_body - point).norm() < 1e-15);
    assert!((found[0].depth - depth).abs() < 1e-15);
    assert!((found[0].point_body - found[0].normal * depth - found[0].point_obstacle).norm() < 1e-15);
    assert!((found[0].normal.norm() - 1.0).abs() < 1e-12);
}

/// Would catch a contact that jumps in or out: at depth -d it weighs nothing, alone or among others.
#[test]
fn contacts_are_born_and_die_with_zero_weight() {
    let mut contacts = patches(&mut Random::new(3), 2, 6);
    let before = update(&mut clusterer(8), &contacts);
    let normal = contacts[0].normal;
    for depth in [-TOLERANCE, -TOLERANCE * (1.0 - 1e-9)] {
        contacts.push(contact(99, contacts[0].point_body + Vector3::new(1e-3, 0.0, 0.0), normal, depth));
        let after = update(&mut clusterer(8), &contacts);
        contacts.pop();
        assert_eq!(before.len(), after.len());
        for (a, b) in before.iter().zip(&after) {
            assert!((a.point_body - b.point_body).norm() < 1e-9 && (a.depth - b.depth).abs() < 1e-9);
            assert!((a.weight - b.weight).abs() < 1e-9 * TOLERANCE.max(a.weight));
        }
    }
    let alone = update(&mut clusterer(8), &[contact(1, Vector3::zeros(), normal, -TOLERANCE)]);
    assert!(alone.iter().all(|c| c.weight == 0.0));
}

/// Would catch a result that depends on the order of the contacts, or on anything but the contacts.
#[test]
fn order_does_not_matter_and_repeats_are_the_same_bits() {
    let mut random = Random::new(4);
    let (mut straight, mut shuffled) = (clusterer(4), clusterer(4));
    for _ in 0..50 {
        let contacts = patches(&mut random, 6, 5);
        let mut other = contacts.clone();
        other.sort_by_key(|c| c.body_feature.wrapping_mul(2_654_435_761));
        assert_eq!(update(&mut straight, &contacts), update(&mut shuffled, &other));
    }
}

/// Would catch clusters that change their number or jump while contacts slide and the body turns.
#[test]
fn clusters_keep_their_identity_and_move_with_the_contacts() {
    let mut clusterer = clusterer(8);
    let start = patches(&mut Random::new(5), 4, 8);
    let mut last: Vec<Cluster> = Vec::new();
    for step in 0..200 {
        let t = f64::from(step) * 1e-3;
        let pose = Isometry3::new(Vector3::new(0.02 * t, 0.0, 0.0), Vector3::new(0.0, 0.0, 0.4 * t));
        let contacts: Vec<Contact> = start
            .iter()
            .map(|c| {
                let depth = c.depth + 1e-4 * (40.0 * t).sin();
                contact(
                    c.body_feature,
                    pose * nalgebra::Point3::from(c.point_body) - nalgebra::Point3::origin(),
                    pose * c.normal,
                    depth,
                )
            })
            .filter(|c| c.depth > -TOLERANCE)
            .collect();
        let found = clusterer.update(&contacts, TOLERANCE, &pose).to_vec();
        for (a, b) in last.iter().zip(&found) {
            assert_eq!(a.id, b.id, "step {step}");
            assert!((a.point_body - b.point_body).norm() < 1e-4, "step {step}");
            assert!((a.depth - b.depth).abs() < 2e-5, "step {step}");
        }
        assert_eq!(found.len(), 4);
        last = found;
    }
}

/// Would catch opposite walls of a slot that are averaged into a contact of no direction.
#[test]
fn opposite_walls_are_not_mixed() {
    let up = Vector3::z();
    let contacts: Vec<Contact> = (0..20)
        .map(|i| {
            let side = if i % 2 == 0 { 1.0 } else { -1.0 };
            contact(i, Vector3::new(1e-4 * f64::from(i), 0.0, 5e-4 * side), up * side, 1e-5)
        })
        .collect();
    let found = update(&mut clusterer(8), &contacts);
    assert!(found.len() >= 2);
    assert!(found.iter().all(|c| c.normal.z.abs() > 0.99), "{found:?}");
}

/// Would catch a number that is none which spreads from one contact to all.
#[test]
fn contacts_that_are_not_finite_are_left_out() {
    let mut contacts = patches(&mut Random::new(6), 1, 5);
    let clean = update(&mut clusterer(8), &contacts);
    contacts.push(contact(50, Vector3::repeat(f64::NAN), Vector3::z(), 0.0));
    contacts.push(contact(51, Vector3::zeros(), Vector3::z(), f64::INFINITY));
    let mut clusterer = clusterer(8);
    assert_eq!(update(&mut clusterer, &contacts), clean);
    assert_eq!(clusterer.ignored(), 2);
}
