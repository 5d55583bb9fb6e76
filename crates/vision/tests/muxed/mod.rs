//! MP4 files for tests.

fn boxed(kind: &[u8; 4], content: &[u8]) -> Vec<u8> {
    let size = (content.len() + 8) as u32;
    [&size.to_be_bytes(), kind, content].concat()
}

fn numbers(numbers: &[u32]) -> Vec<u8> {
    numbers.iter().flat_map(|n| n.to_be_bytes()).collect()
}

/// A table: version and flags, the number of entries, the entries of `width` numbers.
fn table(kind: &[u8; 4], width: usize, entries: &[u32]) -> Vec<u8> {
    boxed(kind, &[numbers(&[0, (entries.len() / width) as u32]), numbers(entries)].concat())
}

/// A file with one video track: its codec, the content of `avcC`, and frames, of which three are a chunk.
pub fn mp4(codec: &[u8; 4], setup: &[u8], frames: &[Vec<u8>]) -> Vec<u8> {
    with_boxes(codec, &[(b"avcC", setup)], frames)
}

/// The same with these boxes in the description of the codec.
pub fn with_boxes(codec: &[u8; 4], boxes: &[(&[u8; 4], &[u8])], frames: &[Vec<u8>]) -> Vec<u8> {
    let mut file = [boxed(b"ftyp", b"isom\0\0\0\0isom"), boxed(b"free", &[])].concat();
    let (mut sizes, mut chunks, mut at) = (vec![0, 0, frames.len() as u32], vec![], file.len() + 8);
    for (number, frame) in frames.iter().enumerate() {
        if number % 3 == 0 {
            chunks.push(at as u32);
        }
        sizes.push(frame.len() as u32);
        at += frame.len();
    }
    file.extend(boxed(b"mdat", &frames.concat()));
    let rest = frames.len() as u32 % 3;
    let mut runs = vec![1, 3, 1];
    if rest > 0 && frames.len() > 3 {
        runs.extend([chunks.len() as u32, rest, 1]);
    } else if rest > 0 {
        runs[1] = rest;
    }
    let boxes: Vec<u8> = boxes.iter().flat_map(|(kind, content)| boxed(kind, content)).collect();
    let entry = [vec![0; 78], boxes].concat();
    let stbl = [
        boxed(b"stsd", &[numbers(&[0, 1]), boxed(codec, &entry)].concat()),
        table(b"stts", 2, &[frames.len() as u32, 1]),
        boxed(b"stsz", &numbers(&sizes)),
        table(b"stsc", 3, &runs),
        table(b"stco", 1, &chunks),
    ];
    let handler = |kind: &[u8; 4]| boxed(b"hdlr", &[&[0; 8], &kind[..], &[0; 13]].concat());
    let minf = boxed(b"minf", &boxed(b"stbl", &stbl.concat()));
    let clock = boxed(b"mdhd", &numbers(&[0, 0, 0, 1, 0, 0]));
    let media = |kind| boxed(b"mdia", &[clock.clone(), handler(kind), minf.clone()].concat());
    let sound = boxed(b"trak", &boxed(b"mdia", &handler(b"soun")));
    // Everything is shown, upright.
    let edits = boxed(b"edts", &table(b"elst", 3, &[frames.len() as u32 * 1000, 0, 1 << 16]));
    let matrix = numbers(&[1 << 16, 0, 0, 0, 1 << 16, 0, 0, 0, 1 << 30, 0, 0]);
    let header = boxed(b"tkhd", &[vec![0; 40], matrix].concat());
    let video = boxed(b"trak", &[header, edits, media(b"vide")].concat());
    let movie = boxed(b"mvhd", &[numbers(&[0, 0, 0, 1000]), vec![0; 84]].concat());
    file.extend(boxed(b"moov", &[movie, sound, video].concat()));
    file
}
