//! Decodes recordings to raw interleaved little-endian `f32` beside a line of what was found:
//! `decode FILE...` prints only the lines, `decode FILE --raw OUT` also writes the samples.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use corsmal_audio::{AudioError, open};

fn decode(path: &Path, out: &mut dyn Write) -> Result<String, AudioError> {
    let mut source = open(path)?;
    let channels = usize::from(source.spec().channels);
    let mut block = vec![0.0f32; 8192 * channels];
    loop {
        let frames = source.read(&mut block)?;
        if frames == 0 {
            break;
        }
        for sample in &block[..frames * channels] {
            let offset = 0;
            out.write_all(&sample.to_le_bytes())
                .map_err(|source| AudioError::Io { offset, source })?;
        }
    }
    let repairs: Vec<_> = source.health().repairs.iter().map(ToString::to_string).collect();
    let (spec, frames) = (source.spec(), source.health().decoded_frames);
    let declared = spec.declared_frames;
    Ok(format!(
        "{}, {channels} channels, {} Hz, {frames} frames, declared {declared:?}, repairs {repairs:?}",
        spec.format, spec.sample_rate
    ))
}

fn main() -> std::io::Result<()> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let (files, mut out): (_, Box<dyn Write>) = match args.iter().position(|a| a == "--raw") {
        Some(i) if i + 1 < args.len() => {
            (&args[..i], Box::new(BufWriter::new(File::create(&args[i + 1])?)))
        }
        _ => (&args[..], Box::new(std::io::sink())),
    };
    for file in files {
        match decode(Path::new(file), &mut out) {
            Ok(line) => println!("{file}: {line}"),
            Err(error) => println!("{file}: {}: {error}", error.verdict().name()),
        }
    }
    out.flush()
}
