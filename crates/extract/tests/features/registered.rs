//! What a feature needs beside its file and its registry line: says what is missing.

use std::path::PathBuf;

use corsmal_extract::features::registry;

/// A file of the repository.
fn file(name: &str) -> String {
    let path: PathBuf = [env!("CARGO_MANIFEST_DIR"), "..", "..", name].iter().collect();
    std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

#[test]
fn every_feature_has_its_line_in_the_table_of_parity() {
    let page = file("docs/parity.md");
    let table = page.split("## At a glance").nth(1).unwrap().split("\n## ").next().unwrap();
    let rows: Vec<&str> = table.lines().filter_map(|line| line.split('|').nth(1)).collect();
    let missing: Vec<&str> = registry()
        .iter()
        .map(|feature| feature.kind())
        .filter(|kind| !rows.iter().any(|row| row.contains(&format!("`{kind}`"))))
        .collect();
    assert!(missing.is_empty(), "docs/parity.md, \"At a glance\", has no line for {missing:?}");
}

#[test]
fn every_feature_has_its_python_function() {
    let page = file("docs/python.md");
    let tables: Vec<&str> = page.lines().filter(|line| line.starts_with('|')).collect();
    let mut missing = Vec::new();
    for feature in registry() {
        if feature.python().is_empty() {
            continue;
        }
        let (module, function) = match feature.python().rsplit_once('.') {
            Some((module, function)) => (format!("{module}.py"), function),
            None => ("__init__.py".into(), feature.python()),
        };
        let source = file(&format!("python/corsmal_feat/{module}"));
        let exported = source.split("__all__ = [").nth(1).and_then(|rest| rest.split(']').next());
        if !exported.unwrap_or_default().contains(&format!("\"{function}\"")) {
            missing.push(format!("{}: {function} in __all__ of {module}", feature.kind()));
        }
        if !tables.iter().any(|row| row.contains(&format!("`{function}`"))) {
            missing.push(format!("{}: `{function}` in a table of docs/python.md", feature.kind()));
        }
    }
    assert!(missing.is_empty(), "missing: {missing:#?}");
}
