//! From brightness and differences of colour to red, green and blue, as a video declares them.
//!
//! The declaration is that of the stream (H.264, annex E), or else that of the file (`colr`). Where neither says
//! anything, players take BT.601 of limited range, and so does this.

use super::mp4::Declared;

/// The matrix that says nothing.
const UNSPECIFIED: u16 = 2;
/// Bits after the point.
const POINT: i32 = 16;

/// What is known of a video's colours.
#[derive(Clone, Copy, Debug)]
pub(super) struct Colours {
    file: Declared,
    stream: Option<Stream>,
}

/// What a sequence parameter set says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Stream {
    declared: Declared,
    /// Without colours: brightness alone.
    grey: bool,
    /// What the decoder is not made for.
    foreign: Option<&'static str>,
}

impl Colours {
    /// With what the file says.
    pub(super) fn new(file: Declared) -> Self {
        Self { file, stream: None }
    }

    /// Takes in a unit of the stream. Only sequence parameter sets say anything.
    ///
    /// # Errors
    /// In words, for damage and for parts of other colours.
    pub(super) fn read(&mut self, unit: &[u8]) -> Result<(), String> {
        if unit.first().is_none_or(|header| header & 31 != 7) {
            return Ok(());
        }
        let said = parameters(&unit[1..]).ok_or("a damaged sequence parameter set")?;
        match self.stream.replace(said) {
            Some(before) if before != said => Err("its parts declare different colours".into()),
            _ => Ok(()),
        }
    }

    /// Whether frames have brightness alone.
    pub(super) fn is_grey(&self) -> bool {
        self.stream.is_some_and(|stream| stream.grey)
    }

    /// What of the stream the decoder is not made for, in words.
    pub(super) fn foreign(&self) -> Option<&'static str> {
        self.stream?.foreign
    }

    /// What makes pictures of frames.
    ///
    /// # Errors
    /// In words, for a matrix that is none of the usual ones.
    pub(super) fn conversion(&self) -> Result<Conversion, String> {
        let stream = self.stream.map(|stream| stream.declared).unwrap_or_default();
        let known = |matrix: &u16| *matrix != UNSPECIFIED;
        let matrix = stream.matrix.filter(known).or(self.file.matrix.filter(known));
        let full = stream.full.or(self.file.full).unwrap_or(false);
        // Shares of red and of blue in brightness, by ITU-T H.273.
        let (red, blue) = match matrix {
            None | Some(5 | 6) => (0.299, 0.114),
            Some(1) => (0.2126, 0.0722),
            Some(4) => (0.30, 0.11),
            Some(7) => (0.212, 0.087),
            Some(9) => (0.2627, 0.0593),
            Some(other) => {
                return Err(format!(
                    "its colours are declared by matrix {other} of H.273; 1, 4 to 7 and 9 are read: extract the \
                     frames as PNG or JPEG (docs/vision.md)"
                ));
            }
        };
        Ok(Conversion::new(red, blue, full))
    }
}

/// Factors with [`POINT`] bits after the point.
#[derive(Clone, Copy, Debug)]
pub(super) struct Conversion {
    floor: i32,
    light: i32,
    red: i32,
    green: [i32; 2],
    blue: i32,
}

/// Rows of numbers of 8 bits: all, and how many to a row.
pub(super) type Plane<'a> = (&'a [u8], usize);

impl Conversion {
    fn new(red: f64, blue: f64, full: bool) -> Self {
        let (floor, light, colour) =
            if full { (0, 1.0, 1.0) } else { (16, 255.0 / 219.0, 255.0 / 224.0) };
        let fixed = |factor: f64| (factor * f64::from(1 << POINT)).round() as i32;
        let (by_red, by_blue) = (2.0 * (1.0 - red), 2.0 * (1.0 - blue));
        let green = 1.0 - red - blue;
        let green = [blue * by_blue / green, red * by_red / green];
        Self {
            floor,
            light: fixed(light),
            red: fixed(colour * by_red),
            green: green.map(|factor| fixed(colour * factor)),
            blue: fixed(colour * by_blue),
        }
    }

    /// A picture of `width` pixels a row, whose colours have half as many rows and columns; the nearest counts.
    pub(super) fn write(&self, [light, blue, red]: [Plane<'_>; 3], width: usize, to: &mut [u8]) {
        let rows = to.chunks_exact_mut((3 * width).max(1)).enumerate();
        for (y, to) in rows {
            let (blue, red) = (row(blue, y / 2), row(red, y / 2));
            let pairs = to.chunks_mut(6).zip(row(light, y).chunks(2));
            for ((to, light), (&blue, &red)) in pairs.zip(blue.iter().zip(red)) {
                let (blue, red) = (i32::from(blue) - 128, i32::from(red) - 128);
                let half = 1 << (POINT - 1);
                let add = [
                    self.red * red + half,
                    half - self.green[0] * blue - self.green[1] * red,
                    self.blue * blue + half,
                ];
                for (to, &light) in to.chunks_exact_mut(3).zip(light) {
                    let light = self.light * (i32::from(light) - self.floor);
                    for (to, add) in to.iter_mut().zip(add) {
                        *to = ((light + add) >> POINT).clamp(0, 255) as u8;
                    }
                }
            }
        }
    }
}

fn row((all, stride): Plane<'_>, at: usize) -> &[u8] {
    all.get(at * stride..).unwrap_or_default()
}

/// What a sequence parameter set says; `None` where it ends too early.
fn parameters(set: &[u8]) -> Option<Stream> {
    let mut bits = Bits::new(set);
    let (mut grey, mut foreign) = (false, None);
    let profile = bits.take(8)?;
    bits.take(16)?;
    bits.unsigned()?;
    if [44, 83, 86, 100, 110, 118, 122, 128, 134, 135, 138, 139, 244].contains(&profile) {
        let chroma = bits.unsigned()?;
        if chroma == 3 {
            bits.take(1)?;
        }
        let deep = [bits.unsigned()?, bits.unsigned()?] != [0, 0];
        let lossless = bits.flag()?;
        grey = chroma == 0;
        foreign = match (chroma, deep, lossless) {
            (2, ..) => Some("colours of 4:2:2"),
            (3, ..) => Some("colours of 4:4:4"),
            (_, true, _) => Some("more than 8 bits"),
            (.., true) => Some("lossless coding"),
            _ => None,
        };
        if bits.flag()? {
            for list in 0..if chroma == 3 { 12 } else { 8 } {
                if bits.flag()? {
                    bits.scaling_list(if list < 6 { 16 } else { 64 })?;
                }
            }
        }
    }
    bits.unsigned()?;
    match bits.unsigned()? {
        0 => {
            bits.unsigned()?;
        }
        1 => {
            bits.take(1)?;
            bits.unsigned()?;
            bits.unsigned()?;
            for _ in 0..bits.unsigned()? {
                bits.unsigned()?;
            }
        }
        _ => {}
    }
    bits.unsigned()?;
    bits.take(1)?;
    bits.unsigned()?;
    bits.unsigned()?;
    if !bits.flag()? {
        foreign = foreign.or(Some("interlaced frames"));
        bits.take(1)?;
    }
    bits.take(1)?;
    if bits.flag()? {
        for _ in 0..4 {
            bits.unsigned()?;
        }
    }
    let declared = if bits.flag()? { usability(&mut bits)? } else { Declared::default() };
    Some(Stream { declared, grey, foreign })
}

/// What its usability information says of colours.
fn usability(bits: &mut Bits) -> Option<Declared> {
    let mut found = Declared::default();
    // The shape of a pixel; its sides where it is none of the listed ones.
    if bits.flag()? && bits.take(8)? == 255 {
        bits.take(32)?;
    }
    if bits.flag()? {
        bits.take(1)?;
    }
    if bits.flag()? {
        bits.take(3)?;
        found.full = Some(bits.flag()?);
        if bits.flag()? {
            bits.take(16)?;
            found.matrix = Some(bits.take(8)? as u16);
        }
    }
    Some(found)
}

/// Bits of a unit, one after another.
struct Bits {
    bytes: Vec<u8>,
    at: usize,
}

impl Bits {
    /// Without the bytes that keep a unit from looking like the beginning of one.
    fn new(unit: &[u8]) -> Self {
        let (mut bytes, mut zeros) = (Vec::with_capacity(unit.len()), 0);
        for &byte in unit {
            if zeros >= 2 && byte == 3 {
                zeros = 0;
                continue;
            }
            zeros = if byte == 0 { zeros + 1 } else { 0 };
            bytes.push(byte);
        }
        Self { bytes, at: 0 }
    }

    fn flag(&mut self) -> Option<bool> {
        let byte = *self.bytes.get(self.at / 8)?;
        let bit = byte >> (7 - self.at % 8) & 1;
        self.at += 1;
        Some(bit == 1)
    }

    /// A number of at most 32 bits.
    fn take(&mut self, bits: usize) -> Option<u32> {
        (0..bits).try_fold(0, |number, _| Some(number << 1 | u32::from(self.flag()?)))
    }

    /// An Exp-Golomb number; signed ones are as long.
    fn unsigned(&mut self) -> Option<u32> {
        let mut zeros = 0;
        while !self.flag()? {
            zeros += 1;
        }
        (zeros < 32).then_some(())?;
        Some((1u32 << zeros) - 1 + self.take(zeros)?)
    }

    fn scaling_list(&mut self, size: usize) -> Option<()> {
        let (mut last, mut next) = (8i64, 8i64);
        for _ in 0..size {
            if next != 0 {
                let code = i64::from(self.unsigned()?);
                let change = if code % 2 == 1 { (code + 1) / 2 } else { -(code / 2) };
                next = (last + change).rem_euclid(256);
            }
            last = if next == 0 { last } else { next };
        }
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A set of the baseline profile, 32 by 24 px, with this after the flag of the usability information.
    fn set(tail: &str) -> Vec<u8> {
        // Profile, constraints, level; then id 0, 16 frame numbers, order 2, one reference, 2 by 2 blocks.
        let head =
            "010000101100000000001010".to_owned() + "1" + "1" + "011" + "010" + "0" + "010" + "010";
        let text = head + "1" + "1" + "0" + tail + "1";
        let padded = format!("{text:0<width$}", width = text.len().div_ceil(8) * 8);
        let byte = |k| u8::from_str_radix(&padded[8 * k..8 * (k + 1)], 2).unwrap();
        std::iter::once(0x67).chain((0..padded.len() / 8).map(byte)).collect()
    }

    #[test]
    fn declarations_are_found() {
        let of = |tail: &str| parameters(&set(tail)[1..]).unwrap().declared;
        assert_eq!(of("0"), Declared::default());
        // Nothing of pixels and of overscan, then a format, the range and the matrix.
        assert_eq!(of("1000"), Declared::default());
        let full = Declared { matrix: None, full: Some(true) };
        assert_eq!(of("10011011 0".replace(' ', "").as_str()), full);
        let matrix = Declared { matrix: Some(1), full: Some(false) };
        assert_eq!(of(&format!("100110101{:08b}{:08b}{:08b}", 1, 1, 1)), matrix);
        // Pixels twice as wide as high.
        let sides = format!("11{:08b}{:016b}{:016b}0110101{:08b}{:08b}{:08b}", 255, 2, 1, 9, 9, 9);
        assert_eq!(of(&sides), Declared { matrix: Some(9), full: Some(false) });
        for end in 1..4 {
            assert!(parameters(&set("0")[1..end]).is_none());
        }
        assert!(parameters(&[0; 400]).is_none());
    }

    #[test]
    fn the_stream_counts_before_the_file() {
        let file = Declared { matrix: Some(1), full: Some(true) };
        let bt709 = format!("{:?}", Conversion::new(0.2126, 0.0722, true));
        let mut colours = Colours::new(file);
        assert_eq!(format!("{:?}", colours.conversion().unwrap()), bt709);
        colours.read(&set("0")).unwrap();
        assert_eq!(format!("{:?}", colours.conversion().unwrap()), bt709);
        let tail = format!("100110101{:08b}{:08b}{:08b}", 1, 1, 8);
        let said = colours.read(&set(&tail)).unwrap_err();
        assert!(said.contains("different colours"), "{said}");
        let said = colours.conversion().unwrap_err();
        assert!(said.contains("matrix 8") && said.contains("extract the frames"), "{said}");
        let mut colours = Colours::new(Declared::default());
        colours.read(&[0x65, 0]).unwrap();
        assert!(colours.read(&[0x67, 0]).unwrap_err().contains("damaged"));
        let plain = format!("{:?}", Conversion::new(0.299, 0.114, false));
        assert_eq!(format!("{:?}", colours.conversion().unwrap()), plain);
    }

    #[test]
    fn odd_sides_and_short_planes_are_no_panic() {
        let conversion = Conversion::new(0.299, 0.114, false);
        let mut to = [7; 27];
        conversion.write([(&[235; 9], 3), (&[128; 4], 2), (&[128; 4], 2)], 3, &mut to);
        assert_eq!(to, [255; 27]);
        conversion.write([(&[235; 2], 3), (&[], 2), (&[], 2)], 3, &mut to);
        conversion.write([(&[], 0), (&[], 0), (&[], 0)], 0, &mut []);
    }
}
