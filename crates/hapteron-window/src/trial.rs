//! A scene that runs while its window is opened, moved about, frozen and closed: what `hapteron bench --window` measures.
//!
//! One session runs through all of it. Its ticks are told apart by what the window did meanwhile, so that nothing else differs.

use crate::live::{Kept, Live};
use crate::opening::{self, Source};
use crate::view::{Shown, View};
use crate::widgets::Widgets;
use crate::{WindowError, theme};
use eframe::egui;
use std::time::{Duration, Instant};

/// What is done with the open window.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Treatment {
    /// It shows the scene.
    Open,
    /// In every picture it has another size and another place.
    Moved,
    /// It stands still for a second, again and again.
    Frozen,
}

/// How ticks kept their time during one treatment.
#[derive(Clone, Debug, Default)]
pub struct Block {
    /// From deadline to start, nanoseconds.
    pub lateness_ns: Vec<u64>,
    /// Age of the contacts in use, ticks.
    pub contact_age: Vec<u64>,
    /// Deadlines without a tick.
    pub missed: u64,
    /// Ticks with contacts.
    pub in_contact: u64,
}

/// A window that was open for a while.
#[derive(Clone, Debug, Default)]
pub struct Shows {
    /// Until it had settled, and from when it was told to close.
    pub around: Block,
    /// Between the two.
    pub steady: Block,
    /// Pictures while it was steady, and how long that was, seconds.
    pub pictures: (u64, f64),
}

/// Between two looks at the session without a window, and between two pictures with one.
const LOOK: Duration = Duration::from_millis(15);
/// A window has settled so long after its first picture.
const SETTLES: Duration = Duration::from_millis(600);
/// A frozen window stands still for so long.
const FREEZE: Duration = Duration::from_millis(1000);
/// A window that shows nothing for so long is hidden, or has no display.
const PATIENCE: Duration = Duration::from_secs(30);

/// A built-in scene that runs, its hand making the scene's motion over and over.
pub struct Trial {
    live: Live,
}

impl Trial {
    /// Starts a scene.
    ///
    /// # Errors
    /// In words: no display, no such scene, no threads.
    pub fn start(scene: &str) -> Result<Self, WindowError> {
        crate::display::check(|name| std::env::var_os(name)).map_err(WindowError)?;
        let opened = opening::read(&Source::Builtin(scene.to_owned())).map_err(WindowError)?;
        let mut live = Live::start(opened).map_err(|e| WindowError(e.to_string()))?;
        live.play_scene();
        Ok(Self { live })
    }

    /// For so many seconds without a window.
    ///
    /// # Errors
    /// The session has ended.
    pub fn without(&mut self, seconds: f64) -> Result<Block, WindowError> {
        self.live.take_kept();
        let begun = Instant::now();
        while begun.elapsed().as_secs_f64() < seconds {
            std::thread::sleep(LOOK);
            self.live.go_on();
        }
        self.goes_on()?;
        Ok(self.live.take_kept().into())
    }

    /// For so many seconds with a window, which is opened before and closed after.
    ///
    /// # Errors
    /// No display, a window that stays hidden, or the session has ended.
    pub fn with(&mut self, treatment: Treatment, seconds: f64) -> Result<Shows, WindowError> {
        self.live.take_kept();
        let mut around: Vec<Kept> = Vec::new();
        let mut steady: Vec<Kept> = Vec::new();
        let mut pictures = (0, 0.0);
        {
            let plan = Plan {
                treatment,
                seconds,
                created: Instant::now(),
                first: None,
                settled: None,
                closing: false,
            };
            let show = Show {
                live: &mut self.live,
                view: View::default(),
                shown: Shown::default(),
                plan,
                around: &mut around,
                steady: &mut steady,
                pictures: &mut pictures,
            };
            crate::run(
                [1280.0, 800.0],
                Box::new(move |creation| {
                    theme::apply(&creation.egui_ctx);
                    creation.egui_ctx.set_theme(egui::ThemePreference::Dark);
                    Ok(Box::new(show))
                }),
            )?;
        }
        self.goes_on()?;
        around.extend(self.live.take_kept());
        if steady.is_empty() {
            return Err(WindowError("the window showed nothing; was it hidden or closed?".to_owned()));
        }
        Ok(Shows { around: around.into(), steady: steady.into(), pictures })
    }

    /// Ends the session; how it went, in a line.
    #[must_use]
    pub fn stop(mut self) -> String {
        self.live.stop();
        self.live.timing_line()
    }

    fn goes_on(&self) -> Result<(), WindowError> {
        match self.live.ended() {
            Some(end) => Err(WindowError(format!("the session has ended: {end}"))),
            None => Ok(()),
        }
    }
}

/// What a window does, and when.
struct Plan {
    treatment: Treatment,
    seconds: f64,
    created: Instant,
    first: Option<Instant>,
    settled: Option<Instant>,
    closing: bool,
}

/// The page of the window, around a scene that was there before and will be there after.
struct Show<'a> {
    live: &'a mut Live,
    view: View,
    shown: Shown,
    plan: Plan,
    around: &'a mut Vec<Kept>,
    steady: &'a mut Vec<Kept>,
    pictures: &'a mut (u64, f64),
}

impl Show<'_> {
    /// Tells the ticks apart, and closes the window when it is time.
    fn follow(&mut self, ctx: &egui::Context) {
        let now = Instant::now();
        let Plan { seconds, created, first, .. } = self.plan;
        match self.plan.settled {
            None if first.is_some_and(|first| now > first + SETTLES) => {
                self.around.extend(self.live.take_kept());
                self.plan.settled = Some(now);
            }
            Some(settled) if !self.plan.closing && (now - settled).as_secs_f64() >= seconds => {
                self.steady.extend(self.live.take_kept());
                self.pictures.1 = (now - settled).as_secs_f64();
                self.plan.closing = true;
            }
            _ => {}
        }
        if self.plan.closing || (first.is_none() && now > created + PATIENCE) {
            ctx.send_viewport_cmd(egui::ViewportCommand::Close);
        }
        ctx.request_repaint_after(LOOK);
    }

    fn treat(&mut self, ctx: &egui::Context) {
        let Some(settled) = self.plan.settled.filter(|_| !self.plan.closing) else { return };
        match self.plan.treatment {
            Treatment::Open => {}
            Treatment::Moved => {
                let t = settled.elapsed().as_secs_f32();
                let swing = |rate: f32| 0.5 + 0.5 * (rate * t).sin();
                let size = egui::vec2(860.0 + 400.0 * swing(4.0), 580.0 + 200.0 * swing(5.3));
                ctx.send_viewport_cmd(egui::ViewportCommand::InnerSize(size.round()));
                let place = egui::pos2(120.0 * swing(3.1), 60.0 * swing(4.7));
                ctx.send_viewport_cmd(egui::ViewportCommand::OuterPosition(place.round()));
            }
            Treatment::Frozen => std::thread::sleep(FREEZE),
        }
    }
}

impl eframe::App for Show<'_> {
    fn logic(&mut self, ctx: &egui::Context, _frame: &mut eframe::Frame) {
        self.live.go_on();
        self.follow(ctx);
    }

    fn ui(&mut self, ui: &mut egui::Ui, _frame: &mut eframe::Frame) {
        let ctx = ui.ctx().clone();
        self.plan.first.get_or_insert_with(Instant::now);
        self.live.ui(ui, &self.view, &mut self.shown, &mut Widgets::default());
        if self.plan.settled.is_some() && !self.plan.closing {
            self.pictures.0 += 1;
        }
        self.treat(&ctx);
    }

    fn on_exit(&mut self, gl: Option<&eframe::glow::Context>) {
        if let Some(gl) = gl {
            self.view.destroy(gl);
        }
    }
}

impl From<Vec<Kept>> for Block {
    fn from(ticks: Vec<Kept>) -> Self {
        Self {
            lateness_ns: ticks.iter().map(|t| t.lateness_ns).collect(),
            contact_age: ticks.iter().map(|t| t.contact_age).collect(),
            missed: ticks.iter().map(|t| t.missed).sum(),
            in_contact: ticks.iter().filter(|t| t.contacts > 0).count() as u64,
        }
    }
}

impl Block {
    /// Adds the ticks of another block.
    pub fn append(&mut self, other: &Self) {
        self.lateness_ns.extend(&other.lateness_ns);
        self.contact_age.extend(&other.contact_age);
        self.missed += other.missed;
        self.in_contact += other.in_contact;
    }
}
