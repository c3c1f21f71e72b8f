//! Scene files that were opened last, kept from one start to the next.

use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// So many are kept.
const KEPT: usize = 8;

/// The newest first.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
pub struct Recent {
    /// Scene files.
    #[serde(default)]
    pub scenes: Vec<PathBuf>,
}

impl Recent {
    /// Those of the last start; none when they cannot be read. Files that are gone are left out.
    #[must_use]
    pub fn load(file: Option<&Path>) -> Self {
        let text = file.and_then(|f| std::fs::read_to_string(f).ok());
        let mut recent: Self = text.and_then(|t| toml::from_str(&t).ok()).unwrap_or_default();
        recent.scenes.retain(|s| s.is_file());
        recent.scenes.truncate(KEPT);
        recent
    }

    /// Puts one to the front and writes the list. That it cannot be written is no reason not to open a scene.
    pub fn add(&mut self, scene: &Path, file: Option<&Path>) {
        let scene = std::path::absolute(scene).unwrap_or_else(|_| scene.to_owned());
        self.scenes.retain(|s| *s != scene);
        self.scenes.insert(0, scene);
        self.scenes.truncate(KEPT);
        if let (Some(file), Ok(text)) = (file, toml::to_string(self)) {
            if let Some(folder) = file.parent() {
                let _ = std::fs::create_dir_all(folder);
            }
            let _ = std::fs::write(file, text);
        }
    }
}

/// Where the list is kept: `hapteron/recent.toml` in the user's folder for settings.
#[must_use]
pub fn place() -> Option<PathBuf> {
    let of = |name: &str| std::env::var_os(name).filter(|v| !v.is_empty()).map(PathBuf::from);
    let folder =
        of("XDG_CONFIG_HOME").or_else(|| of("APPDATA")).or_else(|| of("HOME").map(|h| h.join(".config")))?;
    Some(folder.join("hapteron").join("recent.toml"))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Would catch a list that forgets, doubles, or offers what is gone.
    #[test]
    fn the_newest_is_first_and_what_is_gone_is_left_out() {
        let folder = std::env::temp_dir().join(format!("hapteron-recent-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let list = folder.join("deep").join("recent.toml");
        let scene = |n: usize| folder.join(format!("{n}.toml"));
        let mut recent = Recent::load(Some(&list));
        assert_eq!(recent, Recent::default());
        for n in [0, 1, 2, 1] {
            std::fs::write(scene(n), "").unwrap();
            recent.add(&scene(n), Some(&list));
        }
        assert_eq!(Recent::load(Some(&list)).scenes, [scene(1), scene(2), scene(0)]);
        std::fs::remove_file(scene(2)).unwrap();
        assert_eq!(Recent::load(Some(&list)).scenes, [scene(1), scene(0)]);
        std::fs::write(&list, "scenes = 3").unwrap();
        assert_eq!(Recent::load(Some(&list)), Recent::default());
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
