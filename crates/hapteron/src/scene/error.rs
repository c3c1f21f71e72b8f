//! What is wrong with a scene: file, line, key, cure.

/// Why a scene cannot be used.
#[derive(Debug, thiserror::Error)]
#[error("{file}{}{}: {problem}", .line.map(|l| format!(", line {l}")).unwrap_or_default(), .key.as_ref().map(|k| format!(", `{k}`")).unwrap_or_default())]
pub struct SceneError {
    /// The scene's file, or where an override came from.
    pub file: String,
    /// Line of the scene's file, counted from 1.
    pub line: Option<usize>,
    /// The key with its table, as `contact.stiffness`.
    pub key: Option<String>,
    /// What is wrong, and what to do.
    pub problem: String,
}

/// The text that a scene was read from, for errors that name a line.
#[derive(Clone, Debug, Default)]
pub(super) struct Source {
    pub name: String,
    pub text: String,
}

impl Source {
    /// An error about a key; `key` as `contact.stiffness` or `obstacle.1.mesh`.
    pub fn fault(&self, key: &str, problem: impl Into<String>) -> SceneError {
        SceneError {
            file: self.name.clone(),
            line: self.line_of(key),
            key: Some(key.to_owned()),
            problem: problem.into(),
        }
    }

    /// An error at a place of the text.
    pub fn fault_at(&self, offset: Option<usize>, problem: String) -> SceneError {
        let line = offset.map(|o| self.text.bytes().take(o).filter(|b| *b == b'\n').count() + 1);
        SceneError { file: self.name.clone(), line, key: None, problem }
    }

    /// Line of a key, or of its table when the key itself is not written.
    fn line_of(&self, key: &str) -> Option<usize> {
        let parts: Vec<&str> = key.split('.').collect();
        let (table, index, field) = match parts[..] {
            [table, index, field] => (table, index.parse::<usize>().ok()?, field),
            [table, field] => (table, 0, field),
            _ => return None,
        };
        let headers = [format!("[{table}]"), format!("[[{table}]]")];
        let mut seen = 0;
        let mut header = None;
        for (number, line) in self.text.lines().enumerate() {
            let bare = line.split('#').next().unwrap_or_default().trim();
            if bare.starts_with('[') {
                if header.is_some() {
                    break;
                }
                if headers.iter().any(|h| h == bare) {
                    header = (seen == index).then_some(number + 1);
                    seen += 1;
                }
            } else if header.is_some() && bare.split('=').next().is_some_and(|k| k.trim() == field) {
                return Some(number + 1);
            }
        }
        header
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fault_names_the_line_of_its_key() {
        let text = "[body]\nmesh = 1\n[[obstacle]]\nmesh = 2\n\n[[obstacle]]\n# mesh\nmesh=3\n";
        let source = Source { name: "s.toml".into(), text: text.into() };
        assert_eq!(source.fault("obstacle.1.mesh", "").line, Some(8));
        assert_eq!(source.fault("obstacle.1.scale", "").line, Some(6));
        assert_eq!(source.fault("body.mass", "").line, Some(1));
        assert_eq!(source.fault("hand.mass", "").line, None);
    }
}
