//! Paragraphs for a terminal of eighty columns.

/// Columns of a line.
pub const WIDTH: usize = 80;

/// `text` in lines that begin with `indent` and end before column eighty, broken between words.
pub fn wrapped(text: &str, indent: &str) -> String {
    let mut lines = vec![indent.trim_end_matches('\n').to_string()];
    for word in text.split_whitespace() {
        let line = lines.last().map_or("", String::as_str);
        let full = line.chars().count() + 1 + word.chars().count() > WIDTH;
        if full && line.len() > indent.len() {
            lines.push(indent.to_string());
        }
        if let Some(line) = lines.last_mut() {
            if line.len() > indent.len() {
                line.push(' ');
            }
            line.push_str(word);
        }
    }
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_end_before_the_margin_between_words() {
        let text = "word ".repeat(40);
        let lines = wrapped(&text, "# ");
        assert!(lines.lines().all(|line| line.starts_with("# word") && line.len() <= WIDTH));
        assert_eq!(lines.matches("word").count(), 40);
        let long = "x".repeat(100);
        assert_eq!(wrapped(&long, "  "), format!("  {long}"));
        assert_eq!(wrapped("", "# "), "# ");
    }
}
