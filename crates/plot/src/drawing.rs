//! The one drawing path: marks with a meaning, written as SVG.

use std::fmt::Write;

use crate::color::{Paint, Rgb};
use crate::error::PlotError;
use crate::font;
use crate::raster::png_of_rgb;

/// Position of a text relative to its point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Anchor {
    /// The text starts there.
    Start,
    /// The text is centred there.
    Middle,
    /// The text ends there.
    End,
}

/// Appearance of a text.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TextStyle {
    /// Size of the font in pixels.
    pub(crate) size: f64,
    /// Colour of the letters.
    pub(crate) paint: Paint,
    /// What the position means.
    pub(crate) anchor: Anchor,
    /// Reads upwards.
    pub(crate) upwards: bool,
    /// The heavier weight.
    pub(crate) bold: bool,
}

impl TextStyle {
    /// Upright text of normal weight.
    pub(crate) fn new(size: f64, paint: Paint, anchor: Anchor) -> Self {
        Self { size, paint, anchor, upwards: false, bold: false }
    }

    /// The heading of a figure.
    pub(crate) fn title() -> Self {
        Self { bold: true, ..Self::new(15.0, Paint::Ink, Anchor::Start) }
    }

    /// The numbers at an axis.
    pub(crate) fn tick(anchor: Anchor) -> Self {
        Self::new(11.0, Paint::Muted, anchor)
    }

    /// The same, reading upwards.
    pub(crate) fn upwards(self) -> Self {
        Self { upwards: true, ..self }
    }
}

/// A rectangle: left, top, width, height in pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Rect {
    pub(crate) x: f64,
    pub(crate) y: f64,
    pub(crate) w: f64,
    pub(crate) h: f64,
}

impl Rect {
    pub(crate) fn new(x: f64, y: f64, w: f64, h: f64) -> Self {
        Self { x, y, w, h }
    }

    pub(crate) fn right(&self) -> f64 {
        self.x + self.w
    }

    pub(crate) fn bottom(&self) -> f64 {
        self.y + self.h
    }
}

/// An image of `width * height` pixels, row by row from the top.
#[derive(Debug, Clone)]
pub(crate) struct Pixels {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) colors: Vec<Rgb>,
}

/// A figure in the making; coordinates in pixels from the top left.
pub struct Drawing {
    text: String,
}

/// At most two decimals, without trailing zeros.
fn number(v: f64) -> String {
    let text = format!("{v:.2}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".into() } else { text.to_owned() }
}

fn hex(Rgb(r, g, b): Rgb) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}

/// The attributes that give a mark its colour: its meaning as a class, which a style sheet may
/// override, and the colour on white paper.
fn painted(property: &str, paint: Paint) -> String {
    let color = hex(paint.color());
    match paint.class() {
        Some(class) => {
            format!("class=\"{}-{class}\" {property}=\"{color}\"", &property[..1])
        }
        None => format!("{property}=\"{color}\""),
    }
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

impl Drawing {
    pub(crate) fn new(width: f64, height: f64, title: &str) -> Self {
        let (w, h) = (number(width), number(height));
        let text = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {w} {h}\" width=\"{w}\" \
             height=\"{h}\" role=\"img\" aria-label=\"{}\" font-family=\"{}\">\n",
            escaped(title),
            font::FAMILIES
        );
        let mut drawing = Self { text };
        drawing.rect(Rect::new(0.0, 0.0, width, height), Paint::Paper);
        drawing
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

    /// A filled rectangle.
    pub(crate) fn rect(&mut self, rect: Rect, fill: Paint) {
        self.shade(rect, fill, 1.0, 0.0);
    }

    /// A rectangle of some opacity, with round corners.
    pub(crate) fn shade(&mut self, r: Rect, fill: Paint, opacity: f64, radius: f64) {
        let [x, y, w, h] = [r.x, r.y, r.w, r.h].map(number);
        let mut more = String::new();
        if opacity < 1.0 {
            more.push_str(&format!(" fill-opacity=\"{}\"", number(opacity.max(0.0))));
        }
        if radius > 0.0 {
            more.push_str(&format!(" rx=\"{}\"", number(radius)));
        }
        self.write(format_args!(
            "<rect x=\"{x}\" y=\"{y}\" width=\"{w}\" height=\"{h}\" {}{more}/>",
            painted("fill", fill)
        ));
    }

    /// A disc.
    pub(crate) fn disc(&mut self, x: f64, y: f64, radius: f64, fill: Paint) {
        let [x, y, r] = [x, y, radius].map(number);
        self.write(format_args!(
            "<circle cx=\"{x}\" cy=\"{y}\" r=\"{r}\" {}/>",
            painted("fill", fill)
        ));
    }

    /// A ring on paper.
    pub(crate) fn ring(&mut self, x: f64, y: f64, radius: f64, stroke: Paint) {
        let [x, y, r] = [x, y, radius].map(number);
        self.write(format_args!(
            "<circle cx=\"{x}\" cy=\"{y}\" r=\"{r}\" fill=\"none\" stroke-width=\"1.6\" {}/>",
            painted("stroke", stroke)
        ));
    }

    /// A line through points.
    pub(crate) fn line(&mut self, points: &[(f64, f64)], stroke: Paint, width: f64, dashed: bool) {
        if points.len() < 2 {
            return;
        }
        let dash = if dashed { " stroke-dasharray=\"4 4\"" } else { "" };
        self.write(format_args!(
            "<path d=\"{}\" fill=\"none\" stroke-width=\"{}\" stroke-linejoin=\"round\" \
             {}{dash}/>",
            path(points),
            number(width),
            painted("stroke", stroke)
        ));
    }

    /// A filled outline of some opacity.
    pub(crate) fn area(&mut self, points: &[(f64, f64)], fill: Paint, opacity: f64) {
        if points.len() < 3 {
            return;
        }
        self.write(format_args!(
            "<path d=\"{}Z\" fill-opacity=\"{}\" {}/>",
            path(points),
            number(opacity),
            painted("fill", fill)
        ));
    }

    /// Columns of width `step` side by side from `x` on, each filled from its first to its second
    /// y: the envelope of a waveform.
    pub(crate) fn envelope(&mut self, x: f64, step: f64, spans: &[(f64, f64)], fill: Paint) {
        // Half a pixel keeps a quiet stretch visible.
        let visible = |(top, bottom): (f64, f64)| {
            let missing = (0.5 - (bottom - top)).max(0.0) / 2.0;
            (top - missing, bottom + missing)
        };
        let place = |i: usize| x + step * i as f64;
        let tops = spans.iter().map(|s| visible(*s).0).enumerate();
        let bottoms = spans.iter().map(|s| visible(*s).1).enumerate().rev();
        let points: Vec<_> = tops
            .flat_map(|(i, y)| [(place(i), y), (place(i + 1), y)])
            .chain(bottoms.flat_map(|(i, y)| [(place(i + 1), y), (place(i), y)]))
            .collect();
        self.area(&points, fill, 1.0);
    }

    /// A line of text with its baseline at `y`.
    pub(crate) fn text(&mut self, x: f64, y: f64, text: &str, style: TextStyle) {
        let anchor = match style.anchor {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        };
        let (x, y) = (number(x), number(y));
        let turn = match style.upwards {
            true => format!(" transform=\"rotate(-90 {x} {y})\""),
            false => String::new(),
        };
        let weight = if style.bold { " font-weight=\"600\"" } else { "" };
        self.write(format_args!(
            "<text x=\"{x}\" y=\"{y}\" font-size=\"{}\" text-anchor=\"{anchor}\" \
             {}{weight}{turn}>{}</text>",
            number(style.size),
            painted("fill", style.paint),
            escaped(text)
        ));
    }

    /// Marks that show `hint` under the pointer.
    pub(crate) fn hinted(&mut self, hint: &str, marks: impl FnOnce(&mut Self)) {
        self.write(format_args!("<g><title>{}</title>", escaped(hint)));
        marks(self);
        self.write(format_args!("</g>"));
    }

    /// An image stretched over `rect`, without smoothing.
    pub(crate) fn image(&mut self, r: Rect, pixels: &Pixels) -> Result<(), PlotError> {
        let [x, y, w, h] = [r.x, r.y, r.w, r.h].map(number);
        let bytes: Vec<u8> = pixels.colors.iter().flat_map(|c| [c.0, c.1, c.2]).collect();
        let data = base64(&png_of_rgb(pixels.width, pixels.height, &bytes, None)?);
        self.write(format_args!(
            "<image x=\"{x}\" y=\"{y}\" width=\"{w}\" height=\"{h}\" \
             preserveAspectRatio=\"none\" image-rendering=\"optimizeSpeed\" \
             style=\"image-rendering:pixelated\" href=\"data:image/png;base64,{data}\"/>"
        ));
        Ok(())
    }

    /// A note on the paper, so that it can be read over other marks; `x` is its right edge.
    pub(crate) fn note(&mut self, x: f64, y: f64, text: &str) {
        let style = TextStyle { bold: true, ..TextStyle::new(10.5, Paint::Warm, Anchor::End) };
        let width = font::width(text, style.size, style.bold) + 8.0;
        self.shade(Rect::new(x - width, y - 11.0, width, 15.0), Paint::Paper, 0.85, 3.0);
        self.text(x - 4.0, y, text, style);
    }
}

fn path(points: &[(f64, f64)]) -> String {
    let mut path = String::new();
    for (i, (x, y)) in points.iter().enumerate() {
        let command = if i == 0 { 'M' } else { 'L' };
        let _ = write!(path, "{command}{} {}", number(*x), number(*y));
    }
    path
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
        assert_eq!([1.0, 0.5, 0.126, -2.0, -0.001].map(number), ["1", "0.5", "0.13", "-2", "0"]);
    }

    #[test]
    fn marks_name_their_meaning_and_their_colour() {
        assert_eq!(painted("fill", Paint::Ink), "class=\"f-ink\" fill=\"#1f2328\"");
        assert_eq!(painted("stroke", Paint::Series(9)), "class=\"s-s1\" stroke=\"#c86a1e\"");
        assert_eq!(painted("fill", Paint::Fixed(Rgb(1, 2, 3))), "fill=\"#010203\"");
    }
}
