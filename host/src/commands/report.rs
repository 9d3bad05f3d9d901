//! Figures as text: a line each, nested ones indented.

use serde::Serialize;
use serde_json::{Map, Value};

/// Prints `object` as JSON on one line, or as text.
pub(super) fn print(object: &impl Serialize, json: bool) -> anyhow::Result<()> {
    let line = serde_json::to_string(object)?;
    if json {
        println!("{line}");
    } else {
        print!("{}", text(&serde_json::from_str(&line)?));
    }
    Ok(())
}

fn text(value: &Value) -> String {
    let mut out = String::new();
    if let Value::Object(map) = value {
        lines(map, 0, &mut out);
    }
    out
}

fn lines(map: &Map<String, Value>, indent: usize, out: &mut String) {
    let width = map.keys().map(String::len).max().unwrap_or(0);
    for (name, value) in map {
        let pad = " ".repeat(indent);
        match value {
            Value::Object(inner) if inner.is_empty() => {}
            Value::Object(inner) => {
                out.push_str(&format!("{pad}{name}\n"));
                lines(inner, indent + 2, out);
            }
            Value::Array(items) if items.iter().any(|i| i.is_object()) => {
                out.push_str(&format!("{pad}{name}\n"));
                for item in items {
                    out.push_str(&format!("{pad}  {}\n", row(item)));
                }
            }
            Value::Array(items) if items.iter().any(Value::is_string) => {
                for item in items {
                    out.push_str(&format!("{pad}{name:width$}  {}\n", scalar(item)));
                }
            }
            Value::Array(items) if items.is_empty() => {}
            value => out.push_str(&format!("{pad}{name:width$}  {}\n", scalar(value))),
        }
    }
}

/// An object on one line.
fn row(item: &Value) -> String {
    match item {
        Value::Object(map) => {
            map.iter().map(|(name, value)| format!("{name} {}", scalar(value))).collect::<Vec<_>>().join("  ")
        }
        other => scalar(other),
    }
}

fn scalar(value: &Value) -> String {
    match value {
        Value::Null => "-".to_owned(),
        Value::String(text) => text.clone(),
        Value::Number(number) => match number.as_f64() {
            Some(x) if number.is_f64() => significant(x),
            _ => number.to_string(),
        },
        Value::Array(items) => items.iter().map(scalar).collect::<Vec<_>>().join(", "),
        other => other.to_string(),
    }
}

/// Four digits that mean something.
fn significant(x: f64) -> String {
    const DIGITS: i32 = 4;
    let before_point = if x == 0.0 { 1 } else { x.abs().log10().floor() as i32 + 1 };
    let decimals = (DIGITS - before_point).clamp(0, 9) as usize;
    format!("{x:.decimals$}")
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn figures_line_up_and_nest() {
        let value = json!({
            "frames": 100, "level_db": -20.35451, "iq_order": null, "tlv_types": [1, 7],
            "uplink": {"packets": 7}, "notes": ["a", "b"], "list": [{"frame": 1, "level_db": 0.00123456}], "empty": []
        });
        let want = "frames     100\nlevel_db   -20.35\niq_order   -\ntlv_types  1, 7\nuplink\n  packets  7\nnotes      a\n\
                    notes      b\nlist\n  frame 1  level_db 0.001235\n";
        assert_eq!(text(&value), want);
    }
}
