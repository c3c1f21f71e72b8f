//! Pictures of a scene at a moment of a run.

use super::digest::Digest;
use crate::render::{Camera, Colour, Picture, Style};
use anyhow::Result;
use hapteron::collision::mesh::TriMesh;
use hapteron::collision::{Contact, QueryWorkspace, query};
use hapteron::recording::Row;
use hapteron::scene::Scene;
use nalgebra::{Isometry3, Point3, Vector3};

const SIZE: [usize; 2] = [720, 540];
const BACKGROUND: Colour = [255, 255, 255];
const BODY: Colour = [233, 178, 76];
const OBSTACLE: Colour = [168, 182, 198];
const PATH: Colour = [0, 114, 178];
const FORCE: Colour = [179, 38, 30];
const CONTACT: Colour = [0, 120, 80];
const FIELD_OF_VIEW: f64 = 0.5;

/// Pictures of a run with captions: the whole scene with the path, the moment of the greatest contact force, and a cut through it.
pub fn of_run(scene: &Scene, digest: &Digest) -> Result<Vec<(Vec<u8>, String)>> {
    let Some(first) = &digest.first else { return Ok(Vec::new()) };
    let force = |r: &Row| r.contact[0].norm_squared();
    let mut pictures = vec![overview(scene, &digest.way, first)?];
    if let Some(row) = digest.hardest.as_ref().filter(|r| force(r) > 0.0) {
        pictures.push(close_up(scene, row, false)?);
        pictures.push(close_up(scene, row, true)?);
    }
    Ok(pictures)
}

/// All points that must be seen.
#[derive(Default)]
struct Frame {
    points: Vec<Point3<f64>>,
}

impl Frame {
    fn take(&mut self, mesh: &TriMesh, pose: &Isometry3<f64>) {
        let vertices = mesh.vertices();
        let few = vertices.iter().step_by((vertices.len() / 5_000).max(1));
        self.points.extend(few.map(|&v| pose * Point3::from(v)));
    }

    fn camera(&self, direction: Vector3<f64>) -> Camera {
        let mut low = Vector3::repeat(f64::INFINITY);
        let mut high = -low;
        for point in &self.points {
            low = low.inf(&point.coords);
            high = high.sup(&point.coords);
        }
        let centre = Point3::from((low + high) * 0.5);
        // A sphere fills the picture's height; most scenes are wider than high.
        let radius = 0.85 * self.points.iter().map(|p| (p - centre).norm()).fold(0.0, f64::max);
        let aspect = SIZE[0] as f64 / SIZE[1] as f64;
        Camera::framing(centre, radius, direction, Vector3::z(), FIELD_OF_VIEW, aspect)
    }
}

fn sphere(mesh: &TriMesh, pose: &Isometry3<f64>) -> (Point3<f64>, f64) {
    let (centre, radius) = mesh.bounding_sphere();
    (pose * Point3::from(centre), radius)
}

fn draw(
    picture: &mut Picture,
    camera: &Camera,
    scene: &Scene,
    body: &Isometry3<f64>,
    cut: Option<Point3<f64>>,
) {
    let plane = cut.map(|point| (point, camera.axes()[2]));
    let style = |colour| Style { cut: plane, ..Style::coloured(colour) };
    for obstacle in &scene.obstacles {
        let (mesh, pose) = (&obstacle.model.mesh, &obstacle.world_from_mesh);
        let style = Style { inside: [112, 130, 152], ..style(OBSTACLE) };
        picture.draw_mesh(camera, mesh.vertices(), mesh.triangles(), pose, &style);
    }
    let mesh = &scene.model.mesh;
    let style = Style { inside: [186, 128, 26], ..style(BODY) };
    picture.draw_mesh(camera, mesh.vertices(), mesh.triangles(), body, &style);
}

fn overview(scene: &Scene, path: &[Point3<f64>], first: &Row) -> Result<(Vec<u8>, String)> {
    let mut frame = Frame::default();
    frame.take(&scene.model.mesh, &first.body);
    for obstacle in &scene.obstacles {
        frame.take(&obstacle.model.mesh, &obstacle.world_from_mesh);
    }
    frame.points.extend(path);
    let camera = frame.camera(Vector3::new(-0.75, 1.0, -0.6));
    let mut picture = Picture::new(SIZE[0], SIZE[1], BACKGROUND);
    draw(&mut picture, &camera, scene, &first.body, None);
    for pair in path.windows(2) {
        picture.draw_segment(&camera, &pair[0], &pair[1], 1.6, PATH);
    }
    let caption = "At the start; blue: the way of the handle.".to_owned();
    Ok((picture.to_png()?, caption))
}

/// The body at a row, the contacts there, and the force of the contacts on it.
fn close_up(scene: &Scene, row: &Row, cut: bool) -> Result<(Vec<u8>, String)> {
    let contacts = contacts(scene, &row.body);
    let (centre, radius) = sphere(&scene.model.mesh, &row.body);
    let middle = if contacts.is_empty() {
        centre
    } else {
        Point3::from(contacts.iter().map(|c| c.point_body).sum::<Vector3<f64>>() / contacts.len() as f64)
    };
    let mut frame = Frame::default();
    frame.take(&scene.model.mesh, &row.body);
    let direction = if cut { Vector3::new(-0.25, 1.0, -0.25) } else { Vector3::new(0.9, 1.0, -0.75) };
    let camera = frame.camera(direction);
    let mut picture = Picture::new(SIZE[0], SIZE[1], BACKGROUND);
    draw(&mut picture, &camera, scene, &row.body, cut.then_some(middle));
    for contact in &contacts {
        picture.draw_point(&camera, &Point3::from(contact.point_obstacle), 3.0, CONTACT);
    }
    let force = row.contact[0];
    let tip = middle + force / force.norm() * (0.55 * radius);
    picture.draw_arrow(&camera, &middle, &tip, 3.0, FORCE);
    let what =
        if cut { "The same moment, cut through the middle of the contacts." } else { "The hardest contact" };
    let caption = if cut {
        what.to_owned()
    } else {
        format!(
            "{what}, at {:.3} s: {:.2} N (red), {} contacts within d (green).",
            row.time,
            force.norm(),
            contacts.len()
        )
    };
    Ok((picture.to_png()?, caption))
}

fn contacts(scene: &Scene, body: &Isometry3<f64>) -> Vec<Contact> {
    let mut all = Vec::new();
    for obstacle in &scene.obstacles {
        let mut workspace = QueryWorkspace::new();
        let found = query(
            &scene.model.surface,
            body,
            &obstacle.model.surface,
            &obstacle.world_from_mesh,
            scene.contact.tolerance,
            &mut workspace,
        );
        all.extend_from_slice(found.contacts);
    }
    all
}
