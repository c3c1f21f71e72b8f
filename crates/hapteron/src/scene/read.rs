//! From text to [`SceneFile`], with errors that name the line and suggest a key.

use super::error::{SceneError, Source};
use super::file::SceneFile;

/// Reads a scene and sets the overrides (`table.key=value`) in it.
pub(super) fn read(source: &Source, overrides: &[String]) -> Result<SceneFile, SceneError> {
    let parsed = toml::from_str::<SceneFile>(&source.text);
    if overrides.is_empty() {
        return parsed.map_err(|e| source.fault_at(e.span().map(|s| s.start), explain(e.message())));
    }
    let mut table: toml::Table = toml::from_str(&source.text)
        .map_err(|e| source.fault_at(e.span().map(|s| s.start), explain(e.message())))?;
    if let Err(e) = parsed
        && !overrides.iter().any(|o| o.starts_with("body.mesh"))
    {
        return Err(source.fault_at(e.span().map(|s| s.start), explain(e.message())));
    }
    for text in overrides {
        let fault =
            |problem: String| SceneError { file: format!("--set {text}"), line: None, key: None, problem };
        set(&mut table, text).map_err(fault)?;
        // One at a time, so that the one at fault is named.
        toml::Value::Table(table.clone()).try_into::<SceneFile>().map_err(|e| fault(explain(e.message())))?;
    }
    toml::Value::Table(table).try_into().map_err(|e| source.fault_at(None, explain(e.message())))
}

/// Sets one `table.key=value`.
fn set(table: &mut toml::Table, text: &str) -> Result<(), String> {
    let Some((path, value)) = text.split_once('=') else {
        return Err("an override is written table.key=value, as in coupling.linear_stiffness=500".to_owned());
    };
    let value = value.trim();
    // What is no TOML value is a word, so that no quotes are needed on a command line.
    let value = toml::from_str::<toml::Table>(&format!("value = {value}"))
        .ok()
        .and_then(|mut t| t.remove("value"))
        .unwrap_or_else(|| toml::Value::String(value.trim_matches('"').to_owned()));
    let parts: Vec<&str> = path.trim().split('.').collect();
    let (table_name, index, key) = match parts[..] {
        [table, key] => (table, None, key),
        [table, index, key] => (table, Some(index), key),
        _ => {
            return Err(format!(
                "'{path}' is not a key; a key is written table.key, as in contact.stiffness"
            ));
        }
    };
    let entry = table.entry(table_name).or_insert_with(|| toml::Value::Table(toml::Table::new()));
    let target = match (entry, index) {
        (toml::Value::Table(t), None) => t,
        // As in device.options.library.
        (toml::Value::Table(t), Some(inner)) => {
            let inner_table = t.entry(inner).or_insert_with(|| toml::Value::Table(toml::Table::new()));
            inner_table.as_table_mut().ok_or_else(|| format!("'{table_name}.{inner}' is not a table"))?
        }
        (toml::Value::Array(items), index) => {
            let index = match index {
                Some(i) => {
                    i.parse::<usize>().map_err(|_| format!("'{i}' is not a number of an {table_name}"))?
                }
                None if items.len() == 1 => 0,
                None => return Err(format!("there are {} of them; write {table_name}.0.{key}", items.len())),
            };
            let count = items.len();
            let item = items.get_mut(index).and_then(toml::Value::as_table_mut);
            item.ok_or_else(|| {
                format!(
                    "there is no {table_name} {index}; they are counted from 0 to {}",
                    count.saturating_sub(1)
                )
            })?
        }
        _ => return Err(format!("'{table_name}' is not a table")),
    };
    target.insert(key.to_owned(), value);
    Ok(())
}

/// Adds a suggestion to the parser's message about an unknown key.
fn explain(message: &str) -> String {
    let mut quoted = message.split('`').skip(1).step_by(2);
    let Some(unknown) = quoted.next().filter(|_| message.starts_with("unknown")) else {
        return message.to_owned();
    };
    let known: Vec<&str> = quoted.collect();
    let nearest =
        known.iter().map(|k| (strsim::damerau_levenshtein(k, unknown), *k)).min().filter(|(distance, k)| {
            *distance <= 1 + k.len() / 3 || k.starts_with(unknown) || k.ends_with(unknown)
        });
    let kind = if message.starts_with("unknown variant") { "value" } else { "key" };
    match nearest {
        Some((_, k)) => format!("unknown {kind} `{unknown}`; did you mean `{k}`?"),
        None => format!("unknown {kind} `{unknown}`; known here: {}", known.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fault(text: &str, overrides: &[&str]) -> String {
        let source = Source { name: "s.toml".into(), text: text.into() };
        let overrides: Vec<String> = overrides.iter().map(|s| (*s).to_owned()).collect();
        read(&source, &overrides).unwrap_err().to_string()
    }

    const BODY: &str = "[body]\nmesh = \"a.stl\"\n";

    #[test]
    fn an_unknown_key_gets_its_line_and_a_suggestion() {
        let text = fault(&format!("{BODY}[contact]\nstifness = 3\n"), &[]);
        assert_eq!(text, "s.toml, line 4: unknown key `stifness`; did you mean `stiffness`?");
        assert!(fault(&format!("{BODY}[conact]\n"), &[]).contains("did you mean `contact`?"));
        let text = fault(&format!("{BODY}[integrator]\nmethod = \"runge-kuta-4\"\n"), &[]);
        assert!(text.contains("did you mean `runge-kutta-4`?"), "{text}");
    }

    #[test]
    fn a_wrong_type_and_broken_toml_get_their_line() {
        assert!(fault(&format!("{BODY}mass = \"heavy\"\n"), &[]).starts_with("s.toml, line 3: invalid type"));
        assert!(fault("[body\n", &[]).starts_with("s.toml, line 1: "));
        assert!(fault("", &[]).contains("missing field `body`"));
        assert!(fault(&format!("{BODY}[contact]\nanticipation = \"much\"\n"), &[]).contains("auto"));
    }

    #[test]
    fn overrides_are_set_and_named_when_wrong() {
        let source = Source { name: "s".into(), text: BODY.into() };
        let overrides = ["integrator.method=runge-kutta-4", "contact.stiffness=2e3", "body.position=[1,2,3]"]
            .map(String::from);
        let file = read(&source, &overrides).unwrap();
        assert_eq!(file.integrator.method, Some(super::super::file::Method::RungeKutta4));
        assert_eq!(file.contact.stiffness, Some(2000.0));
        assert_eq!(file.body.position, Some([1.0, 2.0, 3.0]));
        let overrides =
            ["device.options.address=localhost:1", "device.options.patience=0.5"].map(String::from);
        let options = read(&source, &overrides).unwrap().device.options;
        assert_eq!(options["address"].as_str(), Some("localhost:1"));
        assert_eq!(options["patience"].as_float(), Some(0.5));
        assert!(
            fault(&format!("{BODY}[contact]\nstiffness=3\n"), &["contact.stiffness.k=1"])
                .contains("is not a table")
        );
        assert!(fault(BODY, &["contact.stiff=1"]).starts_with("--set contact.stiff=1: unknown key"));
        assert!(fault(BODY, &["contact"]).contains("table.key=value"));
        assert!(fault(BODY, &["a.b.c.d=1"]).contains("not a key"));
        assert!(
            fault(&format!("{BODY}[[obstacle]]\nmesh=\"b\"\n"), &["obstacle.3.scale=1"])
                .contains("no obstacle 3")
        );
    }
}
