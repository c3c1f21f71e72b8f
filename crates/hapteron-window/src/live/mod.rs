//! A scene that runs in the window.

mod bar;
mod control;
pub mod hand;
pub mod history;
mod kept;
mod panel;
mod past;
mod recorder;
mod session;
mod stage;
mod status;
mod steering;
mod values;

use crate::plots::Plots;
use crate::view::{self, Camera, Picker, Preset, Shapes, Shown, View};
use crate::widgets::Widgets;
use eframe::egui;
use hand::{Hold, Source};
use hapteron::device::{Device, drivers};
use hapteron::recording::Row;
use hapteron::scene::Scene;
use hapteron::session::real_time::End;
use hapteron::session::{Command, CommandError, Flags};
use history::{History, KEPT};
pub use kept::Kept;
use nalgebra::Isometry3;
use past::Past;
use recorder::{Recorded, Recorder};
use session::{Session, SessionError};
use std::sync::Arc;
use steering::Steering;
use values::Values;

/// Greatest force that a pointer can pull with, N: so far the handle may leave the body.
const FARTHEST_PULL: f64 = 20.0;

/// What the page asks of the window.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Wanted {
    /// Back to the start page.
    Scenes,
    /// A picture of the window.
    Picture,
}

/// Something to tell the user.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Notice {
    /// In words.
    pub text: String,
    /// Something went wrong.
    pub bad: bool,
}

/// A scene that is ready to run.
pub struct Opened {
    /// It.
    pub scene: Arc<Scene>,
    /// As it is drawn.
    pub shapes: Arc<Shapes>,
    /// The device that the scene names, or why it cannot be had; none where it names none.
    pub device: Option<Result<Box<dyn Device>, String>>,
}

/// A running scene with all that the page shows.
pub struct Live {
    /// As it was opened.
    scene: Arc<Scene>,
    shapes: Arc<Shapes>,
    session: Session,
    history: History,
    plots: Plots,
    values: Values,
    /// What the session has been told.
    told: Values,
    hold: Hold,
    source: Source,
    repeat: bool,
    /// Kind of the driver whose device is the hand; none: the window.
    device: Option<&'static str>,
    steering: Steering,
    /// Where the steering was in the last picture.
    last_goal: Isometry3<f64>,
    camera: Camera,
    hovered: bool,
    paused: bool,
    recorder: Option<Recorder>,
    recorded: Option<Recorded>,
    /// Where the recording was saved.
    saved: Option<std::path::PathBuf>,
    /// The session makes a recording again.
    replays: bool,
    /// A pass of its own for instants of the past.
    past: Past,
    /// To be shown, once.
    notices: Vec<Notice>,
}

impl Live {
    /// Starts a scene.
    ///
    /// # Errors
    /// [`SessionError`].
    pub fn start(opened: Opened) -> Result<Self, SessionError> {
        let Opened { scene, shapes, device } = opened;
        let kind = scene.driver().and_then(|(asked, _)| drivers::kinds().find(|kind| *kind == asked));
        let mut notices = Vec::new();
        let (session, device) = match device {
            Some(Ok(device)) => (Session::start_device(Arc::clone(&scene), device)?, kind),
            other => {
                if let Some(Err(problem)) = other {
                    notices.push(Notice { text: without_device(&scene, &problem), bad: true });
                }
                (Session::start(Arc::clone(&scene), Hold::Exact, false)?, None)
            }
        };
        let (center, radius) = view::bounds(&scene, &shapes);
        let values = Values::of(&scene);
        Ok(Self {
            steering: Steering::new(start_of_handle(&scene)),
            last_goal: start_of_handle(&scene),
            past: Past::new(&scene),
            scene,
            shapes,
            session,
            history: History::keeping(KEPT),
            plots: Plots::new(),
            values,
            told: values,
            hold: Hold::Exact,
            source: Source::Pointer,
            repeat: true,
            device,
            camera: Camera::framing(center, radius, Preset::Oblique),
            hovered: false,
            paused: false,
            recorder: None,
            recorded: None,
            saved: None,
            replays: false,
            notices,
        })
    }

    /// What there is to tell since the last time.
    pub fn take_notices(&mut self) -> Vec<Notice> {
        std::mem::take(&mut self.notices)
    }

    /// Whether the hand is a device other than the window's own.
    #[must_use]
    pub fn has_device(&self) -> bool {
        self.session.driver().is_some()
    }

    /// Whether contacts are made at levels of detail.
    fn has_levels(&self) -> bool {
        self.scene.model.lod().is_some() && !self.scene.contact.detail.is_exact()
    }

    /// Takes what has happened and tells what is wanted, without a picture.
    pub fn go_on(&mut self) {
        self.poll();
        self.tell();
    }

    /// The hand makes the scene's motion, over and over; from now on [`Live::take_kept`] tells of every tick.
    pub fn play_scene(&mut self) {
        self.source = Source::Motion;
        self.session.restart_motion();
        self.session.take_kept();
        self.go_on();
    }

    /// How the ticks since the last call have kept their time.
    pub fn take_kept(&mut self) -> Vec<Kept> {
        self.poll();
        self.session.take_kept()
    }

    /// Why the session ended, when it has.
    pub fn ended(&self) -> Option<&End> {
        self.session.ended()
    }

    /// One picture: takes what has happened, shows it, tells the session what is wanted.
    pub fn ui(
        &mut self,
        ui: &mut egui::Ui,
        view: &View,
        shown: &mut Shown,
        widgets: &mut Widgets,
    ) -> Option<Wanted> {
        self.poll();
        // As the picture begins: what ends the typing, such as Enter, may come together with the last digit.
        let typing = ui.egui_wants_keyboard_input();
        let mut wanted = self.bar(ui, widgets);
        egui::Panel::right("parameters").default_size(312.0).size_range(280.0..=420.0).show(ui, |ui| {
            self.panel(ui, shown, widgets);
        });
        egui::Panel::bottom("plots").resizable(true).default_size(206.0).size_range(120.0..=480.0).show(
            ui,
            |ui| {
                ui.add_space(4.0);
                self.plots.header(ui, widgets, &self.history);
                self.plots.show(ui, &self.history, self.session.timing());
            },
        );
        egui::CentralPanel::no_frame().show(ui, |ui| self.stage(ui, view, shown, widgets));
        self.keys(ui, typing, &mut wanted);
        self.tell();
        wanted
    }

    /// How well the threads have kept their time, in a line.
    #[must_use]
    pub fn timing_line(&self) -> String {
        let timing = self.session.timing();
        let late = |share: f64| timing.lateness.quantile_ns(share) as f64 * 1e-3;
        format!(
            "{} ticks; late by p50 {:.1}, p99 {:.1}, p99.9 {:.1} us; {} deadlines missed; {} records lost",
            timing.ticks,
            late(0.5),
            late(0.99),
            late(0.999),
            timing.missed,
            timing.lost
        )
    }

    fn poll(&mut self) {
        let before = self.session.ended().is_some();
        self.session.poll(&mut self.history, self.recorder.as_mut());
        if let Some(record) = self.session.latest() {
            let (time, flags) = (record.time, record.result.flags);
            self.plots.count(time, self.session.timing());
            self.paused = flags.contains(Flags::PAUSED);
            let motion_over = self.replays && self.source == Source::Motion && time > self.session.motion();
            if motion_over {
                self.source = Source::Pointer;
                self.say(format!(
                    "The replay of {:.1} s is over; the pointer has the handle.",
                    self.session.motion()
                ));
            }
        }
        let moved = self.session.take_moved();
        if (moved || self.source == Source::Motion)
            && let Some(handle) = self.handle()
        {
            self.steering.set(handle);
        }
        if !before && let Some(end) = self.session.ended() {
            let regular = end.is_regular();
            let text = format!("The session has ended: {end}.");
            if !regular {
                self.complain(text);
            }
        }
    }

    /// Tells the session where the handle should go and what has been changed.
    fn tell(&mut self) {
        let reach = (FARTHEST_PULL / self.values.gains.linear_stiffness.max(1e-9))
            .clamp(0.05 * self.radius(), self.radius());
        // Only a hand that moves is kept near: one that stands still must not be taken along by a body that flies off.
        let moves = self.steering.goal() != self.last_goal;
        if let Some(row) = self.history.newest().filter(|_| moves && self.session.is_held()) {
            let unstretched = row.body * self.session.grasp() * nalgebra::Point3::origin();
            self.steering.keep_near(&unstretched, reach);
        }
        self.last_goal = self.steering.goal();
        self.session.steer(&self.steering.goal(), self.source, self.hold, self.repeat && !self.replays);
        if self.values != self.told && self.session.ended().is_none() {
            match self.session.change(&self.values, &self.told) {
                Ok(()) => self.told = self.values,
                // It is sent again with the next picture.
                Err(CommandError::Full) => {}
                Err(problem) => {
                    self.complain(problem.to_string());
                    self.values = self.told;
                }
            }
        }
    }

    fn send(&mut self, command: Command) {
        if let Err(problem) = self.session.send(command) {
            self.complain(problem.to_string());
        }
    }

    fn say(&mut self, text: String) {
        self.notices.push(Notice { text, bad: false });
    }

    fn complain(&mut self, text: String) {
        self.notices.push(Notice { text, bad: true });
    }

    fn fit(&mut self) {
        let (center, radius) = view::bounds(&self.scene, &self.shapes);
        self.camera.fit(center, radius);
    }

    /// Of the body, metres.
    fn radius(&self) -> f64 {
        self.shapes.shapes.first().map_or(0.1, |s| s.radius)
    }

    fn handle(&self) -> Option<Isometry3<f64>> {
        self.session.latest().map(|r| {
            let handle = &r.result.handle;
            Isometry3::from_parts(handle.position.into(), handle.orientation)
        })
    }

    /// The row that is shown: the newest, or that at the cursor.
    fn shown_row(&self) -> Option<Row> {
        match self.plots.cursor() {
            Some(time) => self.history.at(time).copied(),
            None => self.history.newest().copied(),
        }
    }

    /// What the pointer points at: a point of the body.
    fn pick(
        &self,
        place: nalgebra::Point2<f64>,
        size: nalgebra::Vector2<f64>,
    ) -> Option<nalgebra::Point3<f64>> {
        let body = self.shown_row()?.body;
        let (eye, ray) = (self.camera.eye(), self.camera.ray(place, size));
        let on_body = Picker::distance(&self.scene.model.mesh, &body, &eye, &ray)?;
        let hidden = self.scene.obstacles.iter().any(|o| {
            Picker::distance(&o.model.mesh, &o.world_from_mesh, &eye, &ray).is_some_and(|d| d < on_body)
        });
        (!hidden).then(|| eye + ray * on_body)
    }
}

/// What to tell when a scene's own device is not there.
fn without_device(scene: &Scene, problem: &str) -> String {
    let kind = scene.driver().map_or("", |(kind, _)| kind).to_owned();
    format!(
        "The scene's device ({kind}) cannot be used: {problem}. Until then the pointer is the hand; when the device is there, choose it \
         under Hand, Device."
    )
}

/// Where a scene says that the handle is at its start.
fn start_of_handle(scene: &Scene) -> Isometry3<f64> {
    let first = scene.trajectory.sample(0.0, scene.time_step);
    Isometry3::from_parts(first.position.into(), first.orientation)
}
