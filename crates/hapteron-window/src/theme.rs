//! Colours, dark and light.

use crate::view::Colour;
use crate::widgets::Widgets;
use eframe::egui;
use egui::{Color32, CornerRadius, Stroke, TextStyle, Visuals};

/// Colours of what is drawn in 3D and in plots, for one of the two looks.
#[derive(Clone, Copy, Debug)]
pub struct Palette {
    /// Top and bottom of the 3D view.
    pub background: [Colour; 2],
    /// The grasped object.
    pub body: Colour,
    /// What it touches, one after another.
    pub obstacles: [Colour; 4],
    /// Of surfaces seen from inside.
    pub inside: Colour,
    /// The device's pose.
    pub ghost: Colour,
    /// The coupling's stretch.
    pub coupling: Colour,
    /// The force that the hand feels.
    pub force: Colour,
    /// The torque that the hand feels.
    pub torque: Colour,
    /// The force of the contacts.
    pub contact: Colour,
    /// Contacts within the tolerance, and those beyond.
    pub touching: Colour,
    /// Contacts that are only near.
    pub near: Colour,
    /// Contact planes.
    pub plane: Colour,
    /// Of the floor.
    pub grid: Colour,
    /// Words over the 3D view.
    pub text: Colour,
}

/// For dark surroundings.
pub const DARK: Palette = Palette {
    background: [[44, 52, 63, 255], [17, 20, 26, 255]],
    body: [112, 170, 214, 255],
    obstacles: [[222, 211, 190, 255], [190, 205, 178, 255], [214, 188, 200, 255], [200, 196, 220, 255]],
    inside: [164, 84, 78, 255],
    ghost: [255, 176, 66, 140],
    coupling: [255, 196, 84, 255],
    force: [255, 98, 88, 255],
    torque: [190, 132, 255, 255],
    contact: [92, 206, 140, 255],
    touching: [255, 226, 84, 255],
    near: [140, 156, 170, 150],
    plane: [92, 214, 232, 44],
    grid: [150, 168, 190, 90],
    text: [222, 230, 238, 255],
};

/// For bright surroundings.
pub const LIGHT: Palette = Palette {
    background: [[250, 251, 253, 255], [214, 221, 230, 255]],
    body: [84, 146, 200, 255],
    obstacles: [[226, 214, 190, 255], [184, 204, 170, 255], [214, 184, 198, 255], [194, 190, 218, 255]],
    inside: [190, 96, 88, 255],
    ghost: [214, 112, 0, 150],
    coupling: [206, 120, 0, 255],
    force: [214, 42, 40, 255],
    torque: [126, 60, 208, 255],
    contact: [16, 138, 78, 255],
    touching: [196, 78, 0, 255],
    near: [92, 106, 122, 160],
    plane: [0, 132, 164, 44],
    grid: [88, 104, 124, 90],
    text: [32, 40, 50, 255],
};

impl Palette {
    /// As egui is set.
    #[must_use]
    pub fn of(ui: &egui::Ui) -> &'static Self {
        if ui.visuals().dark_mode { &DARK } else { &LIGHT }
    }
}

/// As egui's.
#[must_use]
pub fn screen(colour: Colour) -> Color32 {
    let [r, g, b, a] = colour;
    Color32::from_rgba_unmultiplied(r, g, b, a)
}

/// Sets fonts, distances and both looks.
pub fn apply(ctx: &egui::Context) {
    for theme in [egui::Theme::Dark, egui::Theme::Light] {
        let mut visuals = theme.default_visuals();
        soften(&mut visuals);
        ctx.set_visuals_of(theme, visuals);
        ctx.style_mut_of(theme, |style| {
            style.spacing.item_spacing = egui::vec2(8.0, 4.0);
            style.spacing.button_padding = egui::vec2(8.0, 3.0);
            style.spacing.slider_width = 96.0;
            style.spacing.interact_size.y = 18.0;
            for (which, size) in
                [(TextStyle::Small, 11.5), (TextStyle::Body, 13.0), (TextStyle::Button, 13.0)]
            {
                if let Some(font) = style.text_styles.get_mut(&which) {
                    font.size = size;
                }
            }
        });
    }
}

/// Two buttons, dark and light.
pub fn switch(ui: &mut egui::Ui, widgets: &mut Widgets) {
    let dark = ui.visuals().dark_mode;
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = 2.0;
        for (name, preference, on) in
            [("Light", egui::ThemePreference::Light, !dark), ("Dark", egui::ThemePreference::Dark, dark)]
        {
            let button = egui::Button::selectable(on, name).small();
            if widgets.add(ui, name, button).clicked() {
                ui.ctx().set_theme(preference);
            }
        }
    });
}

fn soften(visuals: &mut Visuals) {
    let dark = visuals.dark_mode;
    let round = CornerRadius::same(4);
    for widget in [
        &mut visuals.widgets.noninteractive,
        &mut visuals.widgets.inactive,
        &mut visuals.widgets.hovered,
        &mut visuals.widgets.active,
        &mut visuals.widgets.open,
    ] {
        widget.corner_radius = round;
    }
    let text = if dark { Color32::from_gray(216) } else { Color32::from_gray(36) };
    visuals.widgets.noninteractive.fg_stroke = Stroke::new(1.0, text);
    visuals.widgets.inactive.fg_stroke = Stroke::new(1.0, text);
    visuals.panel_fill = if dark { Color32::from_rgb(27, 30, 36) } else { Color32::from_rgb(244, 246, 249) };
    visuals.extreme_bg_color =
        if dark { Color32::from_rgb(18, 20, 25) } else { Color32::from_rgb(255, 255, 255) };
    visuals.selection.bg_fill =
        if dark { Color32::from_rgb(38, 96, 146) } else { Color32::from_rgb(150, 200, 240) };
    visuals.window_corner_radius = CornerRadius::same(8);
}
