//! The window: which page is shown, and what concerns all of them.

use crate::live::{Live, Notice, Wanted};
use crate::opening::{self, Opening, Source};
use crate::recent::{self, Recent};
use crate::start::StartPage;
use crate::view::{Shown, View};
use crate::widgets::Widgets;
use crate::{Options, picture, theme};
use eframe::egui::{self, Align2, RichText};
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{Duration, Instant};

/// How long a notice stays.
const NOTICE: Duration = Duration::from_secs(7);
/// Between two pictures.
const FRAME: Duration = Duration::from_millis(15);

/// The application.
pub struct Window {
    start: StartPage,
    live: Option<Box<Live>>,
    opening: Option<Opening>,
    recent: Recent,
    recent_file: Option<PathBuf>,
    view: View,
    shown: Shown,
    widgets: Widgets,
    notices: Vec<(Notice, Instant)>,
    /// Frames to be drawn finely before a picture is taken of the next.
    picture_in: Option<u32>,
    /// What has become of pictures.
    pictures: (Sender<Notice>, Receiver<Notice>),
    /// A picture to be saved at a time, and then the end.
    shot: Option<(Instant, PathBuf)>,
    end_at: Option<Instant>,
    frames: Frames,
}

/// Counts pictures.
struct Frames {
    count: u64,
    since: Instant,
}

impl Window {
    /// The window as it opens.
    #[must_use]
    pub fn new(ctx: &egui::Context, options: Options) -> Self {
        theme::apply(ctx);
        ctx.set_theme(match options.light {
            Some(true) => egui::ThemePreference::Light,
            Some(false) => egui::ThemePreference::Dark,
            None => egui::ThemePreference::System,
        });
        let recent_file = recent::place();
        let now = Instant::now();
        let after = options.after.map(|seconds| now + Duration::from_secs_f64(seconds));
        let shot = options.screenshot.map(|path| (after.unwrap_or(now + Duration::from_secs(3)), path));
        let mut window = Self {
            start: StartPage::default(),
            live: None,
            opening: None,
            recent: Recent::load(recent_file.as_deref()),
            recent_file,
            view: View::default(),
            shown: Shown::default(),
            widgets: Widgets::new(options.widgets.as_deref()),
            notices: Vec::new(),
            picture_in: None,
            pictures: channel(),
            end_at: if shot.is_some() { None } else { after },
            shot,
            frames: Frames { count: 0, since: now },
        };
        if let Some(source) = options.open {
            window.open(ctx, source);
        }
        window
    }

    /// Begins to read a scene.
    pub fn open(&mut self, ctx: &egui::Context, source: Source) {
        // A device can be held by one session only.
        if let Some(live) = self.live.as_mut().filter(|live| live.has_device()) {
            live.stop();
        }
        let ctx = ctx.clone();
        match Opening::begin(source, move || ctx.request_repaint()) {
            Ok(opening) => self.opening = Some(opening),
            Err(problem) => self.start.complain(problem),
        }
    }

    /// Takes over a scene that has been read.
    fn take_opened(&mut self) {
        let Some((source, result)) = self.opening.as_ref().and_then(|o| Some((o.source.clone(), o.done()?)))
        else {
            return;
        };
        self.opening = None;
        match result.and_then(|opened| Live::start(opened).map_err(|e| e.to_string())) {
            Ok(live) => {
                if let Source::File(path) = &source {
                    self.recent.add(path, self.recent_file.as_deref());
                }
                self.live = Some(Box::new(live));
                self.frames = Frames { count: 0, since: Instant::now() };
            }
            Err(problem) => {
                let text = format!("Cannot open {}: {problem}", source.name());
                if self.live.is_some() {
                    self.notices.push((Notice { text, bad: true }, Instant::now()));
                } else {
                    self.start.complain(text);
                }
            }
        }
    }

    /// Files that were dropped on the window.
    fn take_dropped(&mut self, ctx: &egui::Context) {
        for path in dropped(ctx) {
            if opening::is_mesh(&path) {
                if let Some(live) = &mut self.live {
                    live.stop();
                }
                self.live = None;
                self.start.add_mesh(&path);
            } else {
                self.open(ctx, Source::File(path));
            }
        }
    }

    fn save_picture(&mut self, ctx: &egui::Context) {
        let path = picture::free_name();
        let tell = self.pictures.0.clone();
        picture::ask(ctx, move |image| {
            let notice = match picture::write(&image, &path) {
                Ok(()) => Notice { text: format!("Saved {}", path.display()), bad: false },
                Err(text) => Notice { text, bad: true },
            };
            let _ = tell.send(notice);
        });
    }

    /// What was asked for on the command line: a picture, and the end.
    fn follow_plan(&mut self, ctx: &egui::Context) {
        let now = Instant::now();
        // The picture is taken of a frame that has been drawn since it was known.
        self.view.fine |= self.shot.as_ref().is_some_and(|(at, _)| now + Duration::from_millis(800) >= *at);
        if self.shot.as_ref().is_some_and(|(at, _)| now >= *at)
            && let Some((_, path)) = self.shot.take()
        {
            let again = ctx.clone();
            picture::ask(ctx, move |image| {
                if let Err(problem) = picture::write(&image, &path) {
                    eprintln!("error: {problem}");
                }
                again.send_viewport_cmd(egui::ViewportCommand::Close);
            });
        }
        if self.end_at.is_some_and(|at| now >= at) {
            ctx.send_viewport_cmd(egui::ViewportCommand::Close);
        }
    }

    fn show_notices(&mut self, ctx: &egui::Context) {
        while let Ok(notice) = self.pictures.1.try_recv() {
            self.notices.push((notice, Instant::now()));
        }
        if let Some(live) = &mut self.live {
            self.notices.extend(live.take_notices().into_iter().map(|n| (n, Instant::now())));
        }
        self.notices.retain(|(_, since)| since.elapsed() < NOTICE);
        for (index, (notice, _)) in self.notices.iter().rev().take(4).enumerate() {
            let offset = egui::vec2(0.0, 44.0 + 38.0 * index as f32);
            egui::Area::new(egui::Id::unique(("notice", index))).anchor(Align2::CENTER_TOP, offset).show(
                ctx,
                |ui| {
                    let mut frame = egui::Frame::popup(ui.style());
                    if notice.bad {
                        frame = frame.stroke(egui::Stroke::new(1.5, ui.visuals().error_fg_color));
                    }
                    frame.show(ui, |ui| {
                        ui.set_max_width(760.0);
                        ui.label(RichText::new(&notice.text));
                    });
                },
            );
        }
    }

    /// One picture: the page that is shown, and what concerns all of them.
    fn page(&mut self, ui: &mut egui::Ui) {
        let ctx = ui.ctx().clone();
        self.frames.count += 1;
        self.take_opened();
        self.take_dropped(&ctx);
        let wanted = match &mut self.live {
            Some(live) => live.ui(ui, &self.view, &mut self.shown, &mut self.widgets),
            None => {
                let busy = self.opening.as_ref().map(|o| &o.source);
                if let Some(source) = self.start.ui(ui, &self.recent, busy, &mut self.widgets) {
                    self.open(&ctx, source);
                }
                None
            }
        };
        match wanted {
            Some(Wanted::Scenes) => self.live = None,
            Some(Wanted::Picture) => self.picture_in = Some(2),
            None => {}
        }
        self.view.fine = self.picture_in.is_some();
        match self.picture_in {
            Some(0) => {
                self.picture_in = None;
                self.save_picture(&ctx);
            }
            Some(n) => self.picture_in = Some(n - 1),
            None => {}
        }
        if ctx.input(|i| i.modifiers.command && i.key_pressed(egui::Key::Q)) {
            ctx.send_viewport_cmd(egui::ViewportCommand::Close);
        }
        self.show_notices(&ctx);
        self.widgets.finish(ctx.pixels_per_point());
        self.follow_plan(&ctx);
        // A scene moves on by itself; the start page only with its plan.
        let next = if self.live.is_some() { FRAME } else { Duration::from_millis(200) };
        ctx.request_repaint_after(next);
    }
}

impl eframe::App for Window {
    fn logic(&mut self, ctx: &egui::Context, _frame: &mut eframe::Frame) {
        // A window that nobody can see draws nothing, but its scene runs on.
        if let Some(live) = &mut self.live {
            live.go_on();
            ctx.request_repaint_after(FRAME);
        }
    }

    fn ui(&mut self, ui: &mut egui::Ui, _frame: &mut eframe::Frame) {
        self.page(ui);
    }

    fn on_exit(&mut self, gl: Option<&eframe::glow::Context>) {
        if let Some(live) = &mut self.live {
            live.stop();
        }
        if let Some(gl) = gl {
            self.view.destroy(gl);
        }
        let seconds = self.frames.since.elapsed().as_secs_f64();
        if self.live.is_some() && seconds > 1.0 {
            let rate = self.frames.count as f64 / seconds;
            if let Some(live) = &self.live {
                eprintln!("{}", live.timing_line());
            }
            eprintln!("{} pictures in {seconds:.1} s: {rate:.1} a second", self.frames.count);
        }
    }
}

/// Paths of the files that were dropped since the last picture.
fn dropped(ctx: &egui::Context) -> Vec<PathBuf> {
    ctx.input(|i| i.raw.dropped_files.iter().map(|f| f.path().to_owned()).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;
    use std::sync::Arc;

    /// A file on its way from the desktop.
    #[derive(Debug)]
    struct Dropped(PathBuf);

    impl egui::DroppedFile for Dropped {
        fn path(&self) -> &Path {
            &self.0
        }

        fn bytes(&self) -> Result<Vec<u8>, String> {
            std::fs::read(&self.0).map_err(|e| e.to_string())
        }
    }

    /// One picture, with a file that was dropped before it.
    fn picture(window: &mut Window, ctx: &egui::Context, file: Option<&Path>) {
        let file = file.map(|path| Arc::new(Dropped(path.to_owned())) as egui::DroppedFileHandle);
        let screen_rect = Some(egui::Rect::from_min_size(egui::Pos2::ZERO, egui::vec2(1280.0, 800.0)));
        let input =
            egui::RawInput { screen_rect, dropped_files: file.into_iter().collect(), ..Default::default() };
        ctx.run_ui(input, |ui| window.page(ui)).drop_without_applying_deltas();
    }

    fn window(ctx: &egui::Context) -> Window {
        // What is opened here is nobody's recent file.
        Window { recent_file: None, ..Window::new(ctx, Options::default()) }
    }

    fn folder(name: &str) -> PathBuf {
        let folder = std::env::temp_dir().join(format!("hapteron-dropped-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        folder
    }

    /// Pictures until a scene is open.
    fn opened(window: &mut Window, ctx: &egui::Context) {
        for _ in 0..600 {
            picture(window, ctx, None);
            if window.opening.is_none() {
                return;
            }
            std::thread::sleep(Duration::from_millis(50));
        }
        panic!("the scene does not open");
    }

    /// Would catch a scene file that is dropped and does not open, and a device that is named but not told to be missing.
    #[test]
    fn a_dropped_scene_opens_and_says_when_its_device_is_not_there() {
        let folder = folder("scene");
        let path = folder.join("mine.toml");
        let text = "[scene]\nname = \"mine\"\n[body]\nmesh = \"builtin:spoon\"\n[device]\nkind = \"haply\"\n\
                    [device.options]\naddress = \"127.0.0.1:9\"\npatience = 0.2\n";
        std::fs::write(&path, text).unwrap();
        let ctx = egui::Context::default();
        let mut window = window(&ctx);
        picture(&mut window, &ctx, Some(&path));
        assert_eq!(window.opening.as_ref().map(|o| o.source.clone()), Some(Source::File(path.clone())));
        opened(&mut window, &ctx);
        let live = window.live.as_ref().expect("no scene");
        assert!(!live.has_device());
        let told: Vec<&str> = window.notices.iter().map(|n| n.0.text.as_str()).collect();
        assert!(
            told.iter().any(|t| t.contains("(haply) cannot be used") && t.contains("127.0.0.1:9")),
            "{told:?}"
        );
        std::fs::remove_dir_all(&folder).unwrap();
    }

    /// Would catch meshes that are dropped one by one and do not become one scene, and files that are neither.
    #[test]
    fn dropped_meshes_gather_and_other_files_are_refused_in_words() {
        let folder = folder("meshes");
        let ctx = egui::Context::default();
        let mut window = window(&ctx);
        for name in ["spoon", "cup"] {
            let path = folder.join(format!("{name}.obj"));
            let mesh = hapteron::assets::builtin(name).unwrap();
            hapteron::assets::write_obj(&mesh, name, std::fs::File::create(&path).unwrap()).unwrap();
            picture(&mut window, &ctx, Some(&path));
        }
        assert_eq!(window.start.parts(), 2);
        let path = folder.join("letter.txt");
        std::fs::write(&path, "dear all").unwrap();
        picture(&mut window, &ctx, Some(&path));
        opened(&mut window, &ctx);
        assert!(window.live.is_none() && window.start.problem().is_some_and(|p| p.contains("letter.txt")));
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
