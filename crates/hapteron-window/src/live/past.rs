//! Contacts of instants that are over.

use super::session;
use crate::view::Spot;
use hapteron::dynamics::State;
use hapteron::recording::Row;
use hapteron::scene::Scene;
use hapteron::session::{ContactPass, ContactSnapshot};
use nalgebra::Vector3;

/// Contacts of an instant that is over, found again.
pub struct Past {
    pass: ContactPass,
    snapshot: ContactSnapshot,
    time: Option<f64>,
    spots: Vec<Spot>,
}

impl Past {
    /// Knows of none yet.
    pub fn new(scene: &Scene) -> Self {
        Self {
            pass: ContactPass::new(scene),
            snapshot: ContactSnapshot::empty(&scene.body, &scene.start),
            time: None,
            spots: Vec::new(),
        }
    }

    /// Another session: its times are others.
    pub fn forget(&mut self) {
        self.time = None;
    }

    /// The contacts at a row, found once for each.
    pub fn spots(&mut self, scene: &Scene, row: &Row) -> &[Spot] {
        if self.time != Some(row.time) {
            self.time = Some(row.time);
            let position = row.body * nalgebra::Point3::from(scene.center_of_mass);
            let still = Vector3::zeros();
            let state = State::moving(&scene.body, position.coords, &row.body.rotation, &still, &still);
            self.pass.run(scene, &state, 0.0, row.time, &mut self.snapshot);
            self.spots.clear();
            self.spots.extend(self.snapshot.planes().iter().map(|p| session::spot(p, &state)));
        }
        &self.spots
    }
}
