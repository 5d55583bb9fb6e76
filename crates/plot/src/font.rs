//! The bundled font: Inter in two weights, subset, under the SIL Open Font License.

use std::sync::{Arc, OnceLock};

use resvg::usvg::fontdb;
use ttf_parser::Face;

const REGULAR: &[u8] = include_bytes!("../fonts/Inter-Regular.otf");
const BOLD: &[u8] = include_bytes!("../fonts/Inter-SemiBold.otf");

/// Families in the order of preference; a viewer without Inter takes a similar one.
pub(crate) const FAMILIES: &str = "Inter, 'Helvetica Neue', Arial, 'DejaVu Sans', sans-serif";
/// The family that is bundled.
pub(crate) const FAMILY: &str = "Inter";
/// Width of a letter that the font does not have, as a share of the size.
const UNKNOWN: f64 = 1.0;

fn faces() -> &'static [Option<Face<'static>>; 2] {
    static FACES: OnceLock<[Option<Face<'static>>; 2]> = OnceLock::new();
    FACES.get_or_init(|| [REGULAR, BOLD].map(|data| Face::parse(data, 0).ok()))
}

/// Width of a line of text in pixels, from the bundled font's own metrics.
pub(crate) fn width(text: &str, size: f64, bold: bool) -> f64 {
    let Some(face) = &faces()[usize::from(bold)] else {
        return text.chars().count() as f64 * 0.6 * size;
    };
    let unit = size / f64::from(face.units_per_em());
    let advance = |c: char| {
        let glyph = face.glyph_index(c).and_then(|glyph| face.glyph_hor_advance(glyph));
        glyph.map_or(UNKNOWN * size, |advance| f64::from(advance) * unit)
    };
    text.chars().map(advance).sum()
}

/// Whether the bundled font has every letter of a text.
fn covers(text: &str) -> bool {
    let Some(face) = &faces()[0] else { return false };
    text.chars().all(|c| c.is_control() || face.glyph_index(c).is_some())
}

/// Fonts for rasterising `svg`: the bundled one, and those of the system only where the text has
/// letters that it lacks, so that pictures are the same on every machine.
pub(crate) fn database(svg: &str) -> Arc<fontdb::Database> {
    let mut database = fontdb::Database::new();
    database.load_font_data(REGULAR.to_vec());
    database.load_font_data(BOLD.to_vec());
    database.set_sans_serif_family(FAMILY);
    if !covers(svg) {
        database.load_system_fonts();
    }
    Arc::new(database)
}

/// A text cut to a width, with an ellipsis where something is missing.
pub(crate) fn fitted(text: &str, size: f64, bold: bool, room: f64) -> String {
    if width(text, size, bold) <= room {
        return text.to_owned();
    }
    let mut out = String::new();
    let ellipsis = width("…", size, bold);
    for c in text.chars() {
        out.push(c);
        if width(&out, size, bold) + ellipsis > room {
            out.pop();
            break;
        }
    }
    out.truncate(out.trim_end().len());
    out + "…"
}

/// A text broken at blanks into lines of at most a width; a longer word stands alone.
pub(crate) fn wrapped(text: &str, size: f64, bold: bool, room: f64) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split(' ').filter(|w| !w.is_empty()) {
        let joined = lines.last().map(|line| format!("{line} {word}"));
        match joined.filter(|line| width(line, size, bold) <= room) {
            Some(line) => {
                lines.pop();
                lines.push(line);
            }
            None => lines.push(word.to_owned()),
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_weights_are_readable_and_narrow_letters_are_narrow() {
        assert!(faces().iter().all(Option::is_some));
        assert!(width("iii", 12.0, false) < width("mmm", 12.0, false));
        assert!(width("abc", 12.0, true) > width("abc", 12.0, false));
        assert!((width("ab", 24.0, false) - 2.0 * width("ab", 12.0, false)).abs() < 1e-9);
    }

    #[test]
    fn what_is_drawn_is_in_the_font() {
        assert!(covers("Größe ±0.5 µ ≥ − × · … – — → ✓ κόσμος Привет 1⁻²"));
        assert!(!covers("音"));
    }

    #[test]
    fn texts_are_cut_and_wrapped_to_their_room() {
        assert_eq!(fitted("short", 12.0, false, 100.0), "short");
        let cut = fitted("a long name of a file.wav", 12.0, false, 60.0);
        assert!(cut.ends_with('…') && width(&cut, 12.0, false) <= 60.0, "{cut}");
        let lines = wrapped("Spectrogram, components and a forest", 11.0, false, 90.0);
        assert!(lines.len() > 1 && lines.iter().all(|l| width(l, 11.0, false) <= 90.0));
        assert_eq!(lines.join(" "), "Spectrogram, components and a forest");
    }
}
