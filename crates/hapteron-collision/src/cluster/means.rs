//! The iteration: assign, average, split what cancels, join what is alike.

use super::ClusterParameters;
use nalgebra::Vector3;

const ITERATIONS: usize = 10;
/// Clusters whose normals differ by less than this cosine may join.
const ALIKE: f64 = 0.9;
/// A cluster whose summed normals are shorter than this share of its weight has normals that cancel.
const CANCELLING: f64 = 0.3;

/// A contact as K-means sees it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sample {
    pub order: (u32, u32),
    pub point: Vector3<f64>,
    pub normal: Vector3<f64>,
    pub depth: f64,
    pub weight: f64,
    pub center: usize,
}

/// A cluster in the making.
#[derive(Clone, Copy, Debug)]
pub(super) struct Center {
    pub id: Option<u64>,
    pub point: Vector3<f64>,
    pub normal: Vector3<f64>,
    pub depth: f64,
    pub weight: f64,
    pub contacts: usize,
    /// Length of the mean normal before it was made unit.
    agreement: f64,
}

impl Center {
    pub(super) fn new(id: Option<u64>, point: Vector3<f64>, normal: Vector3<f64>) -> Self {
        Self { id, point, normal, depth: 0.0, weight: 0.0, contacts: 0, agreement: 1.0 }
    }
}

/// Squared distance in position and normal; normals on opposite walls of a slot are a radius apart.
fn distance(sample: &Sample, center: &Center, radius: f64) -> f64 {
    let turn = (sample.normal - center.normal).norm_squared();
    let scale = if radius.is_finite() { 0.25 * radius * radius } else { 1.0 };
    (sample.point - center.point).norm_squared() + scale * turn
}

/// Clusters the samples, starting from the given centers.
pub(super) fn cluster(parameters: &ClusterParameters, samples: &[Sample], centers: &mut Vec<Center>) {
    if samples.iter().all(|s| s.weight <= 0.0) {
        centers.clear();
        return;
    }
    let mut samples: Vec<Sample> = samples.to_vec();
    seed(parameters, &samples, centers);
    for _ in 0..ITERATIONS {
        if !assign(parameters, &mut samples, centers) {
            break;
        }
        average(&samples, centers);
    }
    for _ in 0..parameters.max_clusters {
        if !split(parameters, &mut samples, centers) {
            break;
        }
    }
    centers.retain(|c| c.weight > 0.0);
    join(parameters, centers);
}

/// Adds centers where samples are far from all of them, heaviest and farthest first.
fn seed(parameters: &ClusterParameters, samples: &[Sample], centers: &mut Vec<Center>) {
    centers.truncate(parameters.max_clusters);
    let radius2 = parameters.radius * parameters.radius;
    while centers.len() < parameters.max_clusters {
        let mut best: Option<(f64, usize)> = None;
        for (index, sample) in samples.iter().enumerate().filter(|(_, s)| s.weight > 0.0) {
            let nearest =
                centers.iter().map(|c| distance(sample, c, parameters.radius)).fold(f64::INFINITY, f64::min);
            // Without any center the heaviest comes first.
            let urgency = sample.weight * if nearest.is_finite() { nearest } else { 1.0 };
            if nearest > radius2 && best.is_none_or(|(most, _)| urgency > most) {
                best = Some((urgency, index));
            }
        }
        let Some((_, index)) = best else { break };
        centers.push(Center::new(None, samples[index].point, samples[index].normal));
    }
    if centers.is_empty() {
        let heaviest = samples.iter().max_by(|a, b| a.weight.total_cmp(&b.weight));
        centers.extend(heaviest.map(|s| Center::new(None, s.point, s.normal)));
    }
}

/// Gives every sample its nearest center, the first of equals; tells whether anything changed.
fn assign(parameters: &ClusterParameters, samples: &mut [Sample], centers: &[Center]) -> bool {
    let mut changed = centers.iter().all(|c| c.contacts == 0);
    for sample in samples {
        let mut nearest = (f64::INFINITY, 0);
        for (index, center) in centers.iter().enumerate() {
            let d = distance(sample, center, parameters.radius);
            if d < nearest.0 {
                nearest = (d, index);
            }
        }
        changed |= sample.center != nearest.1;
        sample.center = nearest.1;
    }
    changed
}

/// Moves every center to the weighted mean of its samples; one without weight stays where it is.
fn average(samples: &[Sample], centers: &mut [Center]) {
    for (index, center) in centers.iter_mut().enumerate() {
        let (mut weight, mut depth, mut contacts) = (0.0, 0.0, 0);
        let (mut point, mut normal) = (Vector3::zeros(), Vector3::zeros());
        for sample in samples.iter().filter(|s| s.center == index) {
            weight += sample.weight;
            depth += sample.weight * sample.depth;
            point += sample.point * sample.weight;
            normal += sample.normal * sample.weight;
            contacts += 1;
        }
        center.contacts = contacts;
        center.weight = weight;
        if weight > 0.0 {
            center.point = point / weight;
            center.depth = depth / weight;
            center.agreement = normal.norm() / weight;
            if normal.norm() > 0.0 {
                center.normal = normal.normalize();
            }
        }
    }
}

/// Splits one cluster whose normals cancel, along the normal of its heaviest sample. With no room for another cluster the
/// weaker side is left out, since a mean of opposite normals would push nowhere.
fn split(parameters: &ClusterParameters, samples: &mut Vec<Sample>, centers: &mut Vec<Center>) -> bool {
    let Some(index) = centers.iter().position(|c| c.weight > 0.0 && c.agreement < CANCELLING) else {
        return false;
    };
    let own = |s: &&Sample| s.center == index && s.weight > 0.0;
    let Some(heaviest) = samples.iter().filter(own).max_by(|a, b| a.weight.total_cmp(&b.weight)).copied()
    else {
        return false;
    };
    let room = centers.len() < parameters.max_clusters;
    let other = centers.len();
    if room {
        centers.push(Center::new(None, heaviest.point, -heaviest.normal));
    }
    let against = |s: &Sample| s.center == index && s.normal.dot(&heaviest.normal) < 0.0;
    if room {
        samples.iter_mut().filter(|s| against(s)).for_each(|s| s.center = other);
    } else {
        samples.retain(|s| !against(s));
    }
    average(samples, centers);
    true
}

/// Joins clusters that are close and face alike; the older number stays.
fn join(parameters: &ClusterParameters, centers: &mut Vec<Center>) {
    let near = 0.5 * parameters.radius;
    let mut index = 0;
    while index < centers.len() {
        let mut other = index + 1;
        while other < centers.len() {
            let (a, b) = (centers[index], centers[other]);
            let close = (a.point - b.point).norm_squared() < near * near;
            if !(close && a.normal.dot(&b.normal) > ALIKE) {
                other += 1;
                continue;
            }
            let weight = a.weight + b.weight;
            let mean = |u: Vector3<f64>, v: Vector3<f64>| (u * a.weight + v * b.weight) / weight;
            centers[index] = Center {
                id: match (a.id, b.id) {
                    (Some(a), Some(b)) => Some(a.min(b)),
                    (a, b) => a.or(b),
                },
                point: mean(a.point, b.point),
                normal: mean(a.normal, b.normal).normalize(),
                depth: (a.depth * a.weight + b.depth * b.weight) / weight,
                weight,
                contacts: a.contacts + b.contacts,
                agreement: 1.0,
            };
            centers.remove(other);
        }
        index += 1;
    }
}
