//! Reports: one HTML file that needs nothing else, with pictures, tables and plots that can be zoomed.

mod compare;
mod digest;
mod levels;
mod picture;
mod plot;
mod reproduction;
mod run;
mod stability;
mod timing;

pub use compare::{Compared, comparison};
pub use digest::Digest;
pub use levels::levels;
pub use reproduction::reproduction;
pub use run::{Live, Outcome, Time, run};
pub use stability::stability;
pub use timing::{distribution_json, json as timing_json, left_out, ratio_json, records_lost};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use plot::Plots;
use std::fmt::Write;

/// A page that is being written.
pub struct Page {
    html: String,
}

impl Page {
    /// A page with a title and, where there is one, a verdict beside it.
    pub fn new(title: &str, verdict: Option<(&str, bool)>) -> Self {
        let mut html = String::new();
        let chip = verdict.map_or_else(String::new, |(text, good)| {
            format!(r#"<span class="verdict {}">{}</span>"#, if good { "good" } else { "bad" }, escape(text))
        });
        let title = escape(title);
        let _ = write!(
            html,
            "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
             <title>{title}</title>\n<style>\n{}</style></head>\n<body><main>\n<h1>{title}{chip}</h1>\n",
            include_str!("style.css")
        );
        Self { html }
    }

    /// A section's title.
    pub fn heading(&mut self, text: &str) {
        let _ = writeln!(self.html, "<h2>{}</h2>", escape(text));
    }

    /// A paragraph; `soft` ones stand back.
    pub fn paragraph(&mut self, text: &str, soft: bool) {
        let class = if soft { r#" class="soft""# } else { "" };
        let _ = writeln!(self.html, "<p{class}>{}</p>", escape(text));
    }

    /// Figures that should be seen first: value and what it is.
    pub fn tiles(&mut self, tiles: &[(String, &str)]) {
        self.html.push_str("<div class=\"tiles\">");
        for (value, what) in tiles {
            let _ = write!(
                self.html,
                r#"<div class="tile"><b>{}</b><span>{}</span></div>"#,
                escape(value),
                escape(what)
            );
        }
        self.html.push_str("</div>\n");
    }

    /// PNG pictures side by side, with captions.
    pub fn pictures(&mut self, pictures: &[(Vec<u8>, String)]) {
        self.html.push_str("<div class=\"pictures\">\n");
        for (png, caption) in pictures {
            let caption = escape(caption);
            let _ = writeln!(
                self.html,
                r#"<figure><img alt="{caption}" src="data:image/png;base64,{}"><figcaption>{caption}</figcaption></figure>"#,
                STANDARD.encode(png)
            );
        }
        self.html.push_str("</div>\n");
    }

    /// A table; cells as they are.
    pub fn table(&mut self, header: &[&str], rows: &[Vec<Cell>]) {
        self.html.push_str("<table><thead><tr>");
        for title in header {
            let _ = write!(self.html, "<th>{}</th>", escape(title));
        }
        self.html.push_str("</tr></thead><tbody>\n");
        for row in rows {
            self.html.push_str("<tr>");
            for cell in row {
                cell.write(&mut self.html);
            }
            self.html.push_str("</tr>\n");
        }
        self.html.push_str("</tbody></table>\n");
    }

    /// Plots over one axis.
    pub fn plots(&mut self, plots: &Plots) {
        // "<" could end the script element.
        let json = serde_json::to_string(plots).unwrap_or_default().replace('<', "\\u003c");
        let _ = writeln!(
            self.html,
            "<div class=\"plots\"><div class=\"hint\"><span>Wheel: zoom. Drag: move. Shift and drag: select. Click a name: hide.\
             </span><button type=\"button\">Show all</button></div>\n<script type=\"application/json\">{json}</script></div>"
        );
    }

    /// Text as it stands in a file, folded away.
    pub fn details(&mut self, summary: &str, text: &str) {
        let _ = writeln!(
            self.html,
            "<details><summary>{}</summary><pre>{}</pre></details>",
            escape(summary),
            escape(text)
        );
    }

    /// The finished page.
    pub fn finish(mut self) -> String {
        let _ = write!(
            self.html,
            "<footer>hapteron {}. Units are SI unless written otherwise.</footer>\n</main>\n<script>\n{}</script>\n</body></html>\n",
            env!("CARGO_PKG_VERSION"),
            include_str!("script.js")
        );
        self.html
    }
}

/// A cell of a table.
pub enum Cell {
    /// Text.
    Text(String),
    /// Good or bad.
    Verdict(&'static str, bool),
}

impl Cell {
    fn write(&self, html: &mut String) {
        let _ = match self {
            Self::Text(text) => write!(html, "<td>{}</td>", escape(text)),
            Self::Verdict(text, good) => {
                write!(html, r#"<td class="{}">{text}</td>"#, if *good { "holds" } else { "fails" })
            }
        };
    }
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Would catch a name from a scene file that becomes markup or ends the script with the numbers.
    #[test]
    fn names_never_become_markup() {
        let evil = "</script><img src=x onerror=alert(1)>\"&";
        let mut page = Page::new(evil, Some((evil, true)));
        page.paragraph(evil, false);
        page.details(evil, evil);
        page.table(&[evil], &[vec![Cell::Text(evil.into())]]);
        let mut plots = Plots::new("time [s]");
        let times = plots.times(&[0.0, 1.0]);
        plots.add(plot::Plot::new(evil, evil).series(evil, times, &[0.0, f64::NAN]));
        page.plots(&plots);
        let html = page.finish();
        assert!(!html.contains("<img"), "{html}");
        assert_eq!(html.matches("</script>").count(), 2);
        assert!(!html.contains("NaN") && html.contains("[0.0,null]"));
    }
}
