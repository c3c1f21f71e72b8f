//! From what happens in a scene to a [`Picture`] of it.

use super::camera::Camera;
use super::levels;
use super::marks;
use super::picture::{Colour, Picture, Placed, Shapes, Stroke};
use crate::theme::Palette;
use hapteron::scene::Scene;
use hapteron::session::LevelsInUse;
use nalgebra::{Isometry3, Point3, Vector2, Vector3};
use std::sync::Arc;

/// What is shown, as the user chose.
#[derive(Clone, Copy, Debug, PartialEq, serde::Deserialize, serde::Serialize)]
#[serde(default)]
pub struct Shown {
    /// The device's pose as a wire.
    pub ghost: bool,
    /// The coupling's stretch.
    pub coupling: bool,
    /// Contacts as points.
    pub contacts: bool,
    /// Their normals.
    pub normals: bool,
    /// The planes made of them.
    pub planes: bool,
    /// Force and torque at the grip.
    pub forces: bool,
    /// The floor.
    pub grid: bool,
    /// Axes and scale bar.
    pub axes: bool,
    /// The body is glass.
    pub see_through: bool,
    /// The contact levels in use; the body is glass then, for contacts lie between the surfaces.
    pub levels: bool,
    /// Length of the arrow of 1 N, as a share of the body's radius.
    pub newton: f64,
}

impl Default for Shown {
    fn default() -> Self {
        Self {
            ghost: true,
            coupling: true,
            contacts: true,
            normals: true,
            planes: true,
            forces: true,
            grid: true,
            axes: true,
            see_through: false,
            levels: false,
            newton: 0.12,
        }
    }
}

/// A contact. World, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spot {
    /// On the body.
    pub point: Point3<f64>,
    /// Unit, outward from the body.
    pub normal: Vector3<f64>,
    /// Positive inside the obstacle.
    pub depth: f64,
}

/// What there is to see at one instant. World, SI.
#[derive(Clone, Copy, Debug)]
pub struct Sight<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Pose of the body's mesh frame.
    pub body: Isometry3<f64>,
    /// Pose of the handle.
    pub handle: Isometry3<f64>,
    /// Pose of the coupling frame in the body's mesh frame.
    pub grasp: Isometry3<f64>,
    /// Whether the hand holds the body.
    pub held: bool,
    /// Force and torque that the hand feels.
    pub feedback: [Vector3<f64>; 2],
    /// Contacts.
    pub spots: &'a [Spot],
    /// The contact levels in use, when they are to be shown.
    pub levels: Option<&'a LevelsInUse>,
}

/// Words at a place of the world.
#[derive(Clone, Debug, PartialEq)]
pub struct Label {
    /// Where.
    pub at: Point3<f64>,
    /// What.
    pub text: String,
    /// Its colour.
    pub colour: Colour,
}

/// Longest force arrow, in radii of the body.
const LONGEST: f64 = 1.4;
/// Torque at which the bent arrow is half of its greatest sweep, N m.
const HALF_TURN: f64 = 0.05;
/// Most contacts that are drawn with normal and plane.
const MOST_SPOTS: usize = 400;

/// Makes the picture, and the words over it.
#[must_use]
pub fn picture(
    sight: &Sight<'_>,
    shapes: &Arc<Shapes>,
    shown: &Shown,
    camera: &Camera,
    palette: &Palette,
    size: Vector2<f64>,
) -> (Picture, Vec<Label>) {
    let mut picture = Picture {
        clip_from_world: camera.clip_from_world(size.x / size.y.max(1.0)),
        eye: camera.eye(),
        axes: camera.axes(),
        background: palette.background,
        inside: palette.inside,
        shapes: Some(Arc::clone(shapes)),
        placed: Vec::new(),
        patches: sight.levels.map(|l| levels::patches(sight, l)).unwrap_or_default(),
        solid: Vec::new(),
        sheets: Vec::new(),
        strokes: Vec::new(),
        overlay: Vec::new(),
        fine: false,
    };
    let mut labels = Vec::new();
    place(&mut picture, sight, shown, palette, shapes);
    if shown.grid {
        let (center, radius, floor) = ground(sight.scene, shapes);
        marks::grid(&mut picture.strokes, &center, floor, radius, palette.grid);
    }
    draw_spots(&mut picture, sight, shown, camera, palette, size);
    let radius = shapes.shapes.first().map_or(0.1, |s| s.radius);
    let handle = Point3::from(sight.handle.translation.vector);
    if sight.held && shown.coupling {
        let coupled = sight.body * (sight.grasp * Point3::origin());
        draw_coupling(&mut picture, &handle, &coupled, palette);
    }
    if sight.held && shown.forces {
        draw_wrench(&mut picture, &mut labels, sight, shown, palette, radius);
    }
    (picture, labels)
}

/// Body, obstacles and ghost.
fn place(picture: &mut Picture, sight: &Sight<'_>, shown: &Shown, palette: &Palette, shapes: &Shapes) {
    for (index, obstacle) in sight.scene.obstacles.iter().enumerate() {
        picture.placed.push(Placed {
            shape: index + 1,
            world_from_mesh: obstacle.world_from_mesh,
            colour: palette.obstacles[index % palette.obstacles.len()],
            cage: false,
        });
    }
    let [r, g, b, _] = palette.body;
    let opacity = if shown.see_through || sight.levels.is_some() { 92 } else { 255 };
    picture.placed.push(Placed {
        shape: 0,
        world_from_mesh: sight.body,
        colour: [r, g, b, opacity],
        cage: false,
    });
    if shown.ghost && sight.held {
        let ghost = sight.handle * sight.grasp.inverse();
        let Some(shape) = shapes.shapes.first() else { return };
        let apart = distance_of_poses(&ghost, &sight.body, shape.radius);
        // Where ghost and body are one, its lines would only flicker on the body.
        let share = (apart / (0.01 * shape.radius)).clamp(0.0, 1.0);
        let [r, g, b, a] = palette.ghost;
        let colour = [r, g, b, (f64::from(a) * share) as u8];
        if share > 0.02 {
            picture.placed.push(Placed { shape: 0, world_from_mesh: ghost, colour, cage: true });
        }
    }
}

/// How far a point at `radius` is apart at most between two poses.
fn distance_of_poses(a: &Isometry3<f64>, b: &Isometry3<f64>, radius: f64) -> f64 {
    (a.translation.vector - b.translation.vector).norm() + a.rotation.angle_to(&b.rotation) * radius
}

/// Centre, radius and height of the floor: below everything that stands still.
fn ground(scene: &Scene, shapes: &Shapes) -> (Point3<f64>, f64, f64) {
    let (center, radius) = super::bounds(scene, shapes);
    let lowest = scene
        .obstacles
        .iter()
        .map(|o| {
            let down = o.world_from_mesh.inverse_transform_vector(&-Vector3::z());
            let vertices = o.model.mesh.vertices().iter();
            let farthest = vertices.map(|v| Vector3::from(*v).dot(&down)).fold(f64::NEG_INFINITY, f64::max);
            o.world_from_mesh.translation.vector.z - farthest
        })
        .fold(f64::INFINITY, f64::min);
    let floor = if lowest.is_finite() { lowest } else { center.z - radius };
    (center, radius, floor - 0.002 * radius)
}

/// Points, normals and planes of contacts. Those hidden by the surfaces shine through faintly: contacts lie between surfaces.
fn draw_spots(
    picture: &mut Picture,
    sight: &Sight<'_>,
    shown: &Shown,
    camera: &Camera,
    palette: &Palette,
    size: Vector2<f64>,
) {
    if !shown.contacts && !shown.normals && !shown.planes {
        return;
    }
    let tolerance = sight.scene.contact.tolerance;
    let point = camera.metres_per_point(size.y);
    let step = sight.spots.len().div_ceil(MOST_SPOTS).max(1);
    // Contacts that are only near come first, so that the others lie over them.
    for pushes in [false, true] {
        let those = sight.spots.iter().filter(|s| (s.depth > -tolerance) == pushes);
        for (index, spot) in those.enumerate() {
            let chosen = index % step == 0;
            let colour = if pushes { palette.touching } else { palette.near };
            if shown.planes && pushes && chosen {
                let [r, g, b, _] = palette.plane;
                marks::disc(
                    &mut picture.sheets,
                    &mut picture.strokes,
                    &(spot.point - spot.normal * spot.depth),
                    &spot.normal,
                    18.0 * point,
                    palette.plane,
                    [r, g, b, 170],
                );
            }
            if shown.normals && pushes && chosen {
                let tip = spot.point - spot.normal * (22.0 * point);
                let [r, g, b, _] = colour;
                picture.overlay.push(Stroke::line(&spot.point, &tip, 1.6, [r, g, b, 200]));
            }
            if shown.contacts && (pushes || chosen) {
                let width = if pushes { 5.5 } else { 3.0 };
                picture.overlay.push(Stroke::dot(&spot.point, width, colour));
            }
        }
    }
}

/// A line from the handle to the point it holds, with both ends.
fn draw_coupling(picture: &mut Picture, handle: &Point3<f64>, coupled: &Point3<f64>, palette: &Palette) {
    let [r, g, b, _] = palette.coupling;
    picture.overlay.push(Stroke::line(handle, coupled, 2.5, palette.coupling));
    picture.overlay.push(Stroke::dot(coupled, 5.0, [r, g, b, 255]));
    picture.overlay.push(Stroke::dot(handle, 8.0, palette.ghost));
    picture.overlay.push(Stroke::dot(handle, 4.0, palette.background[1]));
}

/// The force and torque that the hand feels, at the handle.
fn draw_wrench(
    picture: &mut Picture,
    labels: &mut Vec<Label>,
    sight: &Sight<'_>,
    shown: &Shown,
    palette: &Palette,
    radius: f64,
) {
    let handle = Point3::from(sight.handle.translation.vector);
    let [force, torque] = sight.feedback;
    let (newtons, moment) = (force.norm(), torque.norm());
    let thick = 0.018 * radius;
    if newtons > 0.01 && newtons.is_finite() {
        let length = (newtons * shown.newton).min(LONGEST) * radius;
        let along = force * (length / newtons);
        marks::arrow(&mut picture.solid, &handle, &along, thick, palette.force);
        let at = handle + along * (1.0 + 0.06 * radius / length);
        labels.push(Label { at, text: format!("{newtons:.2} N"), colour: palette.force });
    }
    if moment > 5e-4 && moment.is_finite() {
        let sweep = 5.2 * moment / (moment + HALF_TURN);
        let tip = marks::turn(
            &mut picture.solid,
            &handle,
            &torque,
            0.3 * radius,
            sweep.max(0.35),
            0.75 * thick,
            palette.torque,
        );
        if let Some(tip) = tip {
            let at = tip + (tip - handle) * 0.25;
            labels.push(Label { at, text: format!("{:.1} mN m", moment * 1e3), colour: palette.torque });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::theme::DARK;
    use crate::view::{self, Preset};
    use hapteron::scenes;

    fn scene() -> (Scene, Arc<Shapes>) {
        let scene = Scene::from_file(scenes::builtin("spoon_in_cup").unwrap()).unwrap();
        let shapes = view::shapes(&scene);
        (scene, shapes)
    }

    fn sight<'a>(scene: &'a Scene, spots: &'a [Spot]) -> Sight<'a> {
        let body = scene.world_from_mesh(&scene.start);
        let grasp = view::grasp(scene);
        Sight {
            scene,
            body,
            handle: body * grasp,
            grasp,
            held: true,
            feedback: [Vector3::zeros(); 2],
            spots,
            levels: None,
        }
    }

    fn compose(sight: &Sight<'_>, shapes: &Arc<Shapes>) -> (Picture, Vec<Label>) {
        let (center, radius) = view::bounds(sight.scene, shapes);
        let camera = Camera::framing(center, radius, Preset::Oblique);
        picture(sight, shapes, &Shown::default(), &camera, &DARK, Vector2::new(800.0, 600.0))
    }

    /// Would catch a ghost that hides the body it coincides with, or that does not show where the device is.
    #[test]
    fn the_ghost_appears_where_the_handle_has_left_the_body() {
        let (scene, shapes) = scene();
        let mut sight = sight(&scene, &[]);
        assert!(!compose(&sight, &shapes).0.placed.iter().any(|p| p.cage));
        sight.handle.translation.vector.z += 0.01;
        let (picture, _) = compose(&sight, &shapes);
        let ghost = picture.placed.iter().find(|p| p.cage).unwrap();
        let apart = ghost.world_from_mesh.translation.vector - sight.body.translation.vector;
        assert!((apart - Vector3::new(0.0, 0.0, 0.01)).norm() < 1e-12);
    }

    /// Would catch a force shown with the wrong size or unit.
    #[test]
    fn force_and_torque_are_labelled_with_their_units() {
        let (scene, shapes) = scene();
        let mut sight = sight(&scene, &[]);
        sight.feedback = [Vector3::new(0.0, 0.0, 1.5), Vector3::new(0.0, 0.012, 0.0)];
        let (picture, labels) = compose(&sight, &shapes);
        let texts: Vec<&str> = labels.iter().map(|l| l.text.as_str()).collect();
        assert_eq!(texts, ["1.50 N", "12.0 mN m"]);
        assert!(!picture.solid.is_empty());
        sight.held = false;
        assert!(compose(&sight, &shapes).1.is_empty());
    }

    /// Would catch planes drawn for contacts that do not push.
    #[test]
    fn only_contacts_within_the_tolerance_have_a_plane() {
        let (scene, shapes) = scene();
        let spot = |depth| Spot { point: Point3::origin(), normal: Vector3::z(), depth };
        let near = [spot(-2.0 * scene.contact.tolerance)];
        assert!(compose(&sight(&scene, &near), &shapes).0.sheets.is_empty());
        let touching = [spot(0.0)];
        assert!(!compose(&sight(&scene, &touching), &shapes).0.sheets.is_empty());
    }

    /// Would catch a floor that cuts through what stands on it.
    #[test]
    fn the_floor_is_below_the_obstacles() {
        let (scene, shapes) = scene();
        let (_, _, floor) = ground(&scene, &shapes);
        assert!(floor < 0.0 && floor > -0.01, "{floor}");
    }
}
