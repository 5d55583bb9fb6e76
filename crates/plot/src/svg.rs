//! SVG output.

use std::fmt::Write;

use crate::color::{PAPER, Rgb};
use crate::raster::encode;
use crate::surface::{Anchor, Pixels, PlotError, Rect, Surface, TextStyle};

/// An SVG document in the making.
pub(crate) struct Document {
    text: String,
}

/// At most two decimals, without trailing zeros.
fn number(v: f64) -> String {
    let text = format!("{v:.2}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

fn hex(Rgb(r, g, b): Rgb) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}

fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            // Control characters are not allowed in XML.
            c if c.is_control() => out.push('\u{fffd}'),
            c => out.push(c),
        }
    }
    out
}

impl Document {
    pub(crate) fn new(width: f64, height: f64) -> Self {
        let (w, h) = (number(width), number(height));
        let text = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {w} {h}\" width=\"{w}\" \
             height=\"{h}\" font-family=\"'Helvetica Neue', Arial, sans-serif\">\n"
        );
        let mut document = Self { text };
        document.rect(Rect::new(0.0, 0.0, width, height), PAPER);
        document
    }

    pub(crate) fn finish(mut self) -> String {
        self.text.push_str("</svg>\n");
        self.text
    }

    /// Writing to a string cannot fail.
    fn write(&mut self, line: std::fmt::Arguments<'_>) {
        let _ = self.text.write_fmt(line);
        self.text.push('\n');
    }
}

impl Surface for Document {
    fn rect(&mut self, r: Rect, fill: Rgb) {
        let [x, y, w, h] = [r.x, r.y, r.w, r.h].map(number);
        self.write(format_args!(
            "<rect x=\"{x}\" y=\"{y}\" width=\"{w}\" height=\"{h}\" fill=\"{}\"/>",
            hex(fill)
        ));
    }

    fn envelope(&mut self, x: f64, step: f64, spans: &[(f64, f64)], fill: Rgb) {
        let mut path = String::new();
        let mut point = |i: usize, y: f64| {
            let command = if path.is_empty() { 'M' } else { 'L' };
            let _ = write!(path, "{command}{} {}", number(x + step * i as f64), number(y));
        };
        for (i, (top, _)) in spans.iter().enumerate() {
            point(i, *top);
            point(i + 1, *top);
        }
        for (i, (_, bottom)) in spans.iter().enumerate().rev() {
            point(i + 1, *bottom);
            point(i, *bottom);
        }
        self.write(format_args!("<path d=\"{path}Z\" fill=\"{}\"/>", hex(fill)));
    }

    fn text(&mut self, x: f64, y: f64, text: &str, style: TextStyle) {
        let anchor = match style.anchor {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        };
        let (x, y) = (number(x), number(y));
        let turn =
            if style.upwards { format!(" transform=\"rotate(-90 {x} {y})\"") } else { "".into() };
        self.write(format_args!(
            "<text x=\"{x}\" y=\"{y}\" font-size=\"{}\" text-anchor=\"{anchor}\" \
             fill=\"{}\"{turn}>{}</text>",
            number(style.size),
            hex(style.color),
            escaped(text)
        ));
    }

    fn image(&mut self, r: Rect, pixels: &Pixels) -> Result<(), PlotError> {
        let [x, y, w, h] = [r.x, r.y, r.w, r.h].map(number);
        let bytes: Vec<u8> = pixels.colors.iter().flat_map(|c| [c.0, c.1, c.2]).collect();
        let data = base64(&encode(pixels.width, pixels.height, &bytes)?);
        self.write(format_args!(
            "<image x=\"{x}\" y=\"{y}\" width=\"{w}\" height=\"{h}\" \
             preserveAspectRatio=\"none\" style=\"image-rendering:pixelated\" \
             href=\"data:image/png;base64,{data}\"/>"
        ));
        Ok(())
    }
}

/// RFC 4648, with padding.
fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut out = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for chunk in bytes.chunks(3) {
        let byte = |i: usize| u32::from(chunk.get(i).copied().unwrap_or(0));
        let bits = byte(0) << 16 | byte(1) << 8 | byte(2);
        for i in 0..4 {
            let digit = DIGITS[(bits >> (18 - 6 * i) & 63) as usize];
            out.push(if i <= chunk.len() { char::from(digit) } else { '=' });
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_of_the_rfc_examples() {
        let cases =
            [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foob", "Zm9vYg==")];
        for (plain, coded) in cases {
            assert_eq!(base64(plain.as_bytes()), coded);
        }
    }

    #[test]
    fn texts_cannot_break_the_document() {
        assert_eq!(escaped("a<b>&\"\u{1}"), "a&lt;b&gt;&amp;&quot;\u{fffd}");
        assert_eq!([1.0, 0.5, 0.126, -2.0, 100.0].map(number), ["1", "0.5", "0.13", "-2", "100"]);
    }
}
