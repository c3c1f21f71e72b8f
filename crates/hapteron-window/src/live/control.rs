//! Sessions, one after another: stopped, started again, recorded, replayed.

use super::hand::Source;
use super::recorder::{self, Recorder};
use super::session::{self, Session};
use super::{Live, start_of_handle};
use hapteron::scene::Scene;
use hapteron::session::Command;
use std::sync::Arc;

impl Live {
    /// Zero force, and the end of the session.
    pub fn stop(&mut self) {
        self.session.stop();
        self.finish_recording();
    }

    /// The scene from its start again, with the values as they are.
    pub(super) fn start_again(&mut self) {
        match self.values.applied_to(&self.scene) {
            Ok(scene) => self.run(scene, false),
            Err(problem) => self.complain(problem.to_string()),
        }
    }

    /// The scene from its start again, with another device, or with the pointer.
    pub(super) fn switch_device(&mut self, kind: Option<&'static str>) {
        self.device = kind;
        self.start_again();
    }

    /// Another session in place of this one. A replay is always the window's own hand.
    fn run(&mut self, scene: Scene, play: bool) {
        self.session.stop();
        let scene = Arc::new(scene);
        let started = match self.device.filter(|_| !play) {
            Some(kind) => session::open_device(&scene, kind)
                .and_then(|device| Session::start_device(Arc::clone(&scene), device)),
            None => Session::start(Arc::clone(&scene), self.hold, play),
        };
        match started {
            Ok(session) => {
                self.session = session;
                self.told = self.values;
                self.source = if play { Source::Motion } else { Source::Pointer };
                self.replays = play;
                self.steering.set(start_of_handle(&scene));
                self.history.clear();
                self.plots.restart();
                self.past.forget();
            }
            Err(problem) => {
                self.device = None;
                self.complain(format!("Cannot start: {problem}"));
            }
        }
    }

    /// Begins a recording, or ends and saves it.
    pub(super) fn toggle_recording(&mut self) {
        if self.recorder.is_some() {
            self.finish_recording();
        } else if self.session.ended().is_none() {
            self.recorder = Some(Recorder::new(self.told));
        }
    }

    fn finish_recording(&mut self) {
        let Some(recorder) = self.recorder.take() else { return };
        let Some(recorded) = recorder.finish() else {
            self.complain("Nothing was recorded.".to_owned());
            return;
        };
        match recorded.save(&self.scene) {
            Ok(folder) => {
                self.say(format!("Recorded {:.1} s: {}", recorded.duration(), folder.display()));
                self.saved = Some(folder);
            }
            Err(problem) => self.complain(problem),
        }
        self.recorded = Some(recorded);
    }

    /// The recorded hand again, with the values as they are now.
    pub(super) fn replay(&mut self) {
        self.finish_recording();
        let Some(recorded) = &self.recorded else { return };
        match recorded.scene(&self.scene, &self.values) {
            Ok(scene) => self.run(scene, true),
            Err(problem) => self.complain(problem.to_string()),
        }
    }

    /// Grasps, or lets go.
    pub(super) fn toggle_grasp(&mut self) {
        let held = self.session.is_held();
        self.send(Command::Grasp(!held));
    }

    /// Saves the rows that the plots can show.
    pub(super) fn save_csv(&mut self) {
        match recorder::save_rows(self.history.rows(), self.scene.name()) {
            Ok(path) => self.say(format!("Saved {}", path.display())),
            Err(problem) => self.complain(problem),
        }
    }
}
