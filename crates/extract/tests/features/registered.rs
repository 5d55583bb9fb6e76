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
