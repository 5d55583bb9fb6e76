//! Containers beside WAV, built byte by byte: the same samples as in a WAV.

use corsmal_audio::Repair;

use crate::common::{Recording, read_file, read_pipe};

const SAMPLES: [i16; 8] = [0, 1, -1, 12_345, -12_345, i16::MAX, i16::MIN, 77];

fn read_both(bytes: &[u8]) -> Recording {
    let file = read_file(bytes.to_vec()).unwrap();
    assert_eq!(file, read_pipe(bytes.to_vec()).unwrap());
    file
}

fn expected() -> Vec<f32> {
    SAMPLES.iter().map(|s| f32::from(*s) / 32768.0).collect()
}

fn big() -> Vec<u8> {
    SAMPLES.iter().flat_map(|s| s.to_be_bytes()).collect()
}

fn little() -> Vec<u8> {
    SAMPLES.iter().flat_map(|s| s.to_le_bytes()).collect()
}

fn check(bytes: &[u8], format: &str, repairs: &[&str]) {
    let got = read_both(bytes);
    assert_eq!((got.format.as_str(), got.channels, got.sample_rate), (format, 2, 44_100));
    assert_eq!((got.samples.as_slice(), got.repairs()), (&expected()[..], repairs.to_vec()));
    // One byte before it does not matter.
    let behind = read_both(&[b"\n", bytes].concat());
    assert_eq!((behind.samples, behind.report), (got.samples, got.report));
    for length in 0..bytes.len() {
        let file = read_file(bytes[..length].to_vec()).map(|got| got.samples);
        let pipe = read_pipe(bytes[..length].to_vec()).map(|got| got.samples);
        assert_eq!(file.ok(), pipe.ok(), "{format}: {length} bytes");
    }
}

fn chunk(name: &[u8; 4], body: &[u8]) -> Vec<u8> {
    let mut chunk = [name.as_slice(), &(body.len() as u32).to_be_bytes(), body].concat();
    chunk.resize(chunk.len() + body.len() % 2, 0);
    chunk
}

fn aiff(kind: &[u8; 4], compression: &[u8], data: &[u8], sound_size: Option<u32>) -> Vec<u8> {
    let mut common = vec![0, 2, 0, 0, 0, 4, 0, 16, 0x40, 0x0e, 0xac, 0x44, 0, 0, 0, 0, 0, 0];
    common.extend(compression);
    let mut sound = chunk(b"SSND", &[&[0; 8], data].concat());
    if let Some(size) = sound_size {
        sound[4..8].copy_from_slice(&size.to_be_bytes());
    }
    let body = [kind.to_vec(), chunk(b"NAME", b"odd"), chunk(b"COMM", &common), sound].concat();
    [b"FORM".as_slice(), &(body.len() as u32).to_be_bytes(), &body].concat()
}

#[test]
fn aiff_and_aiff_c() {
    check(&aiff(b"AIFF", b"", &big(), None), "aiff pcm_s16be", &[]);
    check(&aiff(b"AIFC", b"NONE\0\0", &big(), None), "aifc pcm_s16be", &[]);
    check(&aiff(b"AIFC", b"sowt\0\0", &little(), None), "aifc pcm_s16le", &[]);
    // Each sample with a byte below it: libsndfile writes 42n1, others 42ni.
    let wide: Vec<u8> = SAMPLES.iter().flat_map(|s| (i32::from(*s) << 8).to_le_bytes()).collect();
    let wide: Vec<u8> = wide.chunks(4).flat_map(|sample| sample[..3].to_vec()).collect();
    for kind in [b"42n1\0\0", b"42ni\0\0"] {
        check(&aiff(b"AIFC", kind, &wide, None), "aifc pcm_s24le", &[]);
    }
    check(&aiff(b"AIFF", b"", &big(), Some(0)), "aiff pcm_s16be", &["data_size_zero"]);
    check(&aiff(b"AIFF", b"", &big(), Some(u32::MAX)), "aiff pcm_s16be", &["data_size_unknown"]);
    check(&aiff(b"AIFF", b"", &big(), Some(900)), "aiff pcm_s16be", &["truncated"]);
    // What SoX writes into a pipe.
    let streamed = Some(0x7f00_0008);
    check(&aiff(b"AIFF", b"", &big(), streamed), "aiff pcm_s16be", &["data_size_unknown"]);
    // Killed before the writer came back to its header: no size and no count, in either chunk.
    for size in [0, 8] {
        let mut killed = aiff(b"AIFF", b"", &big(), Some(size));
        let common = killed.windows(4).position(|w| w == b"COMM").unwrap();
        killed[common + 10..common + 14].fill(0);
        killed[4..8].fill(0);
        check(&killed, "aiff pcm_s16be", &["data_size_zero"]);
        let empty = killed.len() - 16;
        assert_eq!(read_both(&killed[..empty]).samples, []);
    }
    let mut wide = aiff(b"AIFF", b"", &big(), None);
    let common = wide.windows(4).position(|w| w == b"COMM").unwrap();
    wide[common + 14..common + 16].copy_from_slice(&2056u16.to_be_bytes());
    assert_eq!(read_file(wide).unwrap_err().verdict().name(), "unsupported");
    let error = read_file(aiff(b"AIFC", b"ima4\0\0", &big(), None)).unwrap_err();
    assert!(error.to_string().contains("ima4"), "{error}");
    // The samples first, which only a file can have.
    let plain = aiff(b"AIFF", b"", &big(), None);
    let (head, rest) = plain.split_at(12 + 12);
    let (common, sound) = rest.split_at(8 + 18);
    let swapped = [head, sound, common].concat();
    assert_eq!(read_file(swapped.clone()).unwrap().samples, expected());
    assert!(read_pipe(swapped).unwrap_err().to_string().contains("COMM first"));
}

fn au(size: u32) -> Vec<u8> {
    let fields = [28u32, size, 3, 44_100, 2].map(u32::to_be_bytes).concat();
    [b".snd".as_slice(), &fields, b"text", &big()].concat()
}

#[test]
fn au_in_both_byte_orders() {
    check(&au(16), "au pcm_s16be", &[]);
    check(&au(u32::MAX), "au pcm_s16be", &[]);
    check(&au(0), "au pcm_s16be", &["data_size_zero"]);
    check(&au(160), "au pcm_s16be", &["truncated"]);
    let fields = [24u32, 16, 3, 44_100, 2].map(u32::to_le_bytes).concat();
    check(&[b"dns.".as_slice(), &fields, &little()].concat(), "au pcm_s16le", &[]);
}

fn caf(flags: u32, data: &[u8], size: i64) -> Vec<u8> {
    let mut bytes = b"caff\0\x01\0\0desc\0\0\0\0\0\0\0\x20".to_vec();
    bytes.extend(44_100f64.to_be_bytes());
    bytes.extend(b"lpcm");
    bytes.extend([flags, 4, 1, 2, 16].map(u32::to_be_bytes).concat());
    bytes.extend(b"free\0\0\0\0\0\0\0\x03abcdata");
    bytes.extend(size.to_be_bytes());
    bytes.extend([0; 4]);
    bytes.extend(data);
    bytes
}

#[test]
fn core_audio_format() {
    check(&caf(0, &big(), 20), "caf pcm_s16be", &[]);
    check(&caf(2, &little(), 20), "caf pcm_s16le", &[]);
    check(&caf(2, &little(), -1), "caf pcm_s16le", &[]);
    check(&caf(2, &little(), 200), "caf pcm_s16le", &["truncated"]);
}

/// Metadata after no samples were samples.
#[test]
fn core_audio_without_samples() {
    let info = b"info\0\0\0\0\0\0\0\x10\0\0\0\x01title\0hello\0";
    for size in [0i64, 4] {
        let mut bytes = caf(0, info, size);
        if size == 0 {
            // Not even the count of edits.
            let at = bytes.len() - info.len() - 4;
            bytes.drain(at..at + 4);
        }
        let found = read_file(bytes).unwrap();
        assert!(found.samples.is_empty() && found.repairs().is_empty(), "{size} bytes of data");
    }
    check(&caf(2, &little(), 4), "caf pcm_s16le", &["data_size_zero"]);
}

/// Wave64; `size` is that of its data and of their header of 24 bytes.
fn w64(size: u64) -> Vec<u8> {
    let rest = *b"\xf3\xac\xd3\x11\x8c\xd1\x00\xc0\x4f\x8e\xdb\x8a";
    let part = |name: &[u8; 4], size: u64, body: &[u8]| {
        let mut part = [name.as_slice(), &rest, &size.to_le_bytes(), body].concat();
        part.resize(part.len().next_multiple_of(8), 0);
        part
    };
    let mut bytes = b"riff\x2e\x91\xcf\x11\xa5\xd6\x28\xdb\x04\xc1\x00\x00".to_vec();
    bytes.extend([0; 8]);
    bytes.extend(b"wave");
    bytes.extend(rest);
    let format = [1, 0, 2, 0, 0x44, 0xac, 0, 0, 0x10, 0xb1, 2, 0, 4, 0, 16, 0];
    bytes.extend(part(b"junk", 24 + 3, b"abc"));
    bytes.extend(part(b"fmt ", 24 + 16, &format));
    bytes.extend(part(b"data", size, &little()));
    bytes
}

#[test]
fn wave64() {
    check(&w64(24 + 16), "w64 pcm_s16le", &[]);
    check(&w64(24), "w64 pcm_s16le", &["data_size_zero"]);
    check(&w64(240), "w64 pcm_s16le", &["truncated"]);
}

/// A file of each container, and one whose size was never filled in: for the mutations.
pub fn seeds() -> Vec<Vec<u8>> {
    vec![
        aiff(b"AIFF", b"", &big(), None),
        aiff(b"AIFC", b"sowt\0\0", &little(), Some(0)),
        au(16),
        au(u32::MAX),
        caf(0, &big(), 20),
        caf(2, &little(), -1),
        w64(24 + 16),
        w64(24),
    ]
}

/// libsndfile's samples of the same files are beside them.
#[test]
fn adpcm_is_that_of_libsndfile() {
    let cases: [(&[u8], &[u8], &str); 2] = [
        (
            include_bytes!("samples/sines-2ch-ima.wav"),
            include_bytes!("samples/sines-2ch-ima.s16"),
            "wav adpcm_ima_wav",
        ),
        (
            include_bytes!("samples/sines-2ch-ms.wav"),
            include_bytes!("samples/sines-2ch-ms.s16"),
            "wav adpcm_ms",
        ),
    ];
    for (wav, samples, format) in cases {
        let got = read_both(wav);
        let (pairs, _) = samples.as_chunks::<2>();
        let expected: Vec<f32> =
            pairs.iter().map(|b| f32::from(i16::from_le_bytes(*b)) / 32768.0).collect();
        assert_eq!((got.samples.as_slice(), got.format.as_str()), (&expected[..], format));
        assert_eq!(got.declared_frames, Some(expected.len() as u64 / 2));
        // Cut inside a block: whole samples of it count, and the rest is said.
        let cut = read_file(wav[..wav.len() - 101].to_vec()).unwrap();
        assert!(cut.report.truncated && !cut.samples.is_empty());
        assert_eq!(cut.samples, expected[..cut.samples.len()]);
        // Samples after them.
        for second in [&b"data\x04\0\0\0\x01\0\x02\0"[..], wav] {
            let more = read_file([wav, second].concat()).unwrap();
            assert_eq!(more.report.repairs, [Repair::MoreData { offset: wav.len() as u64 }]);
            assert_eq!(more.samples, expected);
        }
        assert!(read_file([wav, b"LIST\0\0\0\0"].concat()).unwrap().repairs().is_empty());
    }
}

#[test]
fn other_recordings_behind_the_samples_are_said() {
    let first = aiff(b"AIFF", b"", &big(), None);
    for padding in [0, 1, 7] {
        let bytes = [first.clone(), vec![0; padding], first.clone()].concat();
        let got = read_file(bytes.clone()).unwrap();
        let offset = (first.len() + padding) as u64;
        assert_eq!(got.report.repairs, [Repair::MoreData { offset }]);
        assert_eq!((got.samples, read_pipe(bytes).unwrap().samples), (expected(), expected()));
    }
    let got = read_file([first, b"\0\0FORx, AIFF or what".to_vec()].concat()).unwrap();
    assert!(got.repairs().is_empty());
}

#[test]
fn chunks_that_claim_too_much_are_named() {
    let mut wide = aiff(b"AIFF", b"", &big(), None);
    wide[16..20].copy_from_slice(&60_000u32.to_be_bytes());
    let mut caf = b"caff\0\x01\0\0".to_vec();
    caf.extend(b"NAME\0\0\0\0\0\0\xea\x60and so on");
    let mut w64 = b"riff\x2e\x91\xcf\x11\xa5\xd6\x28\xdb\x04\xc1\x00\x00".to_vec();
    w64.extend([0; 8]);
    for name in [b"wave", b"NAME"] {
        w64.extend(name);
        w64.extend(b"\xf3\xac\xd3\x11\x8c\xd1\x00\xc0\x4f\x8e\xdb\x8a");
    }
    w64.extend(60_000u64.to_le_bytes());
    for (bytes, at) in [(wide, 12), (caf, 8), (w64, 40)] {
        for error in [read_file(bytes.clone()).unwrap_err(), read_pipe(bytes).unwrap_err()] {
            let text = error.to_string();
            assert!(text.contains("\"NAME\" of 60000 bytes"), "{text}");
            assert!(text.contains(&format!("byte {at}")), "{text}");
        }
    }
}
