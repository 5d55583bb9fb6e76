//! Dialects, repairs and refusals of the WAV reader, as `docs/reading.md` lists them.

use std::fs::File;
use std::io::{Seek, SeekFrom, Write};

use crate::common::{Recording, Wav, read_file, read_pipe, read_with, tag};
use corsmal_audio::{AudioError, Repair, open};

const SAMPLES: [i16; 8] = [0, 1, -1, 16384, -16384, 32767, -32768, 77];

fn expected() -> Vec<f32> {
    SAMPLES.iter().map(|&s| f32::from(s) / 32768.0).collect()
}

fn wav() -> Wav {
    Wav::pcm16(2, &SAMPLES)
}

/// Reads the file both as a file and as a pipe, which must agree.
fn read_both(wav: &Wav) -> Recording {
    let recording = read_file(wav.bytes()).unwrap();
    assert_eq!(recording, read_pipe(wav.bytes()).unwrap());
    recording
}

fn refusal(wav: &Wav) -> AudioError {
    read_file(wav.bytes()).expect_err("refused")
}

#[test]
fn plain_files_need_no_repair() {
    let got = read_both(&wav());
    assert_eq!((got.channels, got.sample_rate, got.declared_frames), (2, 44_100, Some(4)));
    assert_eq!(got.format, "wav pcm_s16le");
    assert_eq!(got.samples, expected());
    assert_eq!(got.report.decoded_frames, 4);
    assert!(got.report.repairs.is_empty() && !got.report.truncated);
}

#[test]
fn big_endian_and_64_bit_forms() {
    let data = SAMPLES.iter().flat_map(|s| s.to_be_bytes()).collect();
    let got = read_both(&Wav { form: b"RIFX", data, ..wav() });
    assert_eq!((got.format.as_str(), &got.samples), ("rifx pcm_s16be", &expected()));
    for form in [b"RF64", b"BW64"] {
        let long = Wav { form, data_size: Some(u32::MAX), long_size: Some(16), ..wav() };
        let got = read_both(&Wav { after: b"LIST\x04\0\0\0abcd".to_vec(), ..long });
        assert_eq!((got.samples.as_slice(), got.declared_frames), (&*expected(), Some(4)));
        assert!(got.report.repairs.is_empty());
    }
}

/// SoX, which rounds down to whole frames, and arecord.
#[test]
fn sizes_of_writers_into_pipes_are_no_claims() {
    for (channels, size) in [(2, 0x7fff_f000), (2, 0x7fff_ff00), (3, 0x7fff_f000 - 0x7fff_f000 % 6)]
    {
        let wav = Wav { data_size: Some(size), ..Wav::pcm16(channels, &SAMPLES[..6]) };
        let got = read_both(&wav);
        assert_eq!((got.repairs(), got.declared_frames), (vec!["data_size_unknown"], None));
        assert_eq!(got.samples, expected()[..6]);
    }
    // The largest number is no size where it is no whole number of frames.
    for size in [0x7fff_ffff, 0x7fff_ffdb, 0xffff_ffdb] {
        let wav = Wav { data_size: Some(size), ..Wav::pcm16(2, &SAMPLES[..6]) };
        let got = read_both(&wav);
        assert_eq!((got.repairs(), got.declared_frames), (vec!["data_size_unknown"], None));
    }
    for size in [0x7fff_f004, 0xffff_ffd8] {
        let got = read_both(&Wav { data_size: Some(size), ..wav() });
        assert_eq!(got.repairs(), ["truncated"]);
    }
}

#[test]
fn extensible_sub_formats() {
    for (sub, bits, name) in
        [(tag::PCM, 16, "pcm_s16le"), (tag::FLOAT, 32, "pcm_f32le"), (tag::ALAW, 8, "pcm_alaw")]
    {
        let got = read_both(&Wav { sub_format: Some(sub), bits, ..wav() });
        assert_eq!(got.format, format!("wav {name}"));
    }
    let error = refusal(&Wav { sub_format: Some(2), ..wav() });
    assert_eq!((error.verdict().name(), error.offset()), ("unsupported", Some(20)));
}

#[test]
fn odd_chunks_with_and_without_padding() {
    for body in [b"abc\0".to_vec(), b"abcX".to_vec(), b"abc".to_vec()] {
        let unpadded = body.len() == 3;
        let before = vec![(*b"junk", 3, body), (*b"LIST", 5, b"INFOx\0".to_vec())];
        let got = read_both(&Wav { before, ..wav() });
        assert_eq!(got.samples, expected());
        assert_eq!(got.repairs(), if unpadded { vec!["missing_padding"] } else { vec![] });
    }
}

#[test]
fn sizes_of_a_stream_mean_to_the_end() {
    for (size, name) in [(0, "data_size_zero"), (u32::MAX, "data_size_unknown")] {
        let got = read_both(&Wav { data_size: Some(size), ..wav() });
        assert_eq!((got.samples.as_slice(), got.declared_frames), (&*expected(), None));
        assert_eq!(got.repairs(), [name]);
        assert!(!got.report.truncated);
    }
    let rf64 = Wav { form: b"RF64", data_size: Some(u32::MAX), ..wav() };
    assert_eq!(read_both(&rf64).repairs(), ["data_size_unknown"]);
    let zero = Wav { long_size: Some(0), ..rf64 };
    assert_eq!(read_both(&zero).repairs(), ["data_size_zero"]);
}

#[test]
fn no_samples_are_no_samples() {
    let empty = Wav { data: Vec::new(), ..wav() };
    let got = read_both(&empty);
    assert_eq!((got.samples.len(), got.declared_frames), (0, Some(0)));
    assert!(got.report.repairs.is_empty());
    // Chunks after an empty data chunk are not samples where that can be seen.
    let little = Wav { after: b"LIST\x05\0\0\0abcde\0".to_vec(), ..empty.clone() };
    let big = Wav { form: b"RIFX", after: b"LIST\0\0\0\x05abcde\0".to_vec(), ..empty };
    for wav in [little, big] {
        let got = read_file(wav.bytes()).unwrap();
        assert_eq!((got.samples.len(), got.repairs()), (0, vec![]));
    }
}

#[test]
fn truncated_files_give_their_whole_frames() {
    let whole = wav().bytes();
    let header = wav().header().len();
    for cut in 0..whole.len() - header {
        let bytes = whole[..header + cut].to_vec();
        for got in [read_file(bytes.clone()).unwrap(), read_pipe(bytes).unwrap()] {
            assert_eq!(got.samples, expected()[..cut / 4 * 2], "{cut} bytes of data");
            assert_eq!(got.declared_frames, Some(4));
            assert!(got.report.truncated);
            let actual = cut as u64 / 4;
            let mut repairs = vec![Repair::Truncated { declared: Some(4), actual }];
            if cut % 4 != 0 {
                repairs.push(Repair::PartialFrame { bytes: cut as u64 % 4 });
            }
            assert_eq!(got.report.repairs, repairs);
        }
    }
}

#[test]
fn a_partial_last_frame_is_left_out() {
    let mut data = wav().data;
    data.truncate(14);
    let got = read_both(&Wav { data, ..wav() });
    assert_eq!((got.samples.as_slice(), got.report.truncated), (&expected()[..6], false));
    assert_eq!(got.report.repairs, [Repair::PartialFrame { bytes: 2 }]);
}

#[test]
fn wrong_block_alignment_is_not_believed() {
    for declared in [0, 1, 3, 2] {
        let got = read_both(&Wav { block_align: Some(declared), ..wav() });
        assert_eq!(got.samples, expected());
        assert_eq!(got.report.repairs, [Repair::BlockAlign { declared: declared.into(), used: 4 }]);
    }
}

#[test]
fn significant_bits_are_left_justified_in_their_container() {
    // 12 bits in two bytes, 20 bits in three: as the 16- and 24-bit samples with those bytes.
    let got = read_both(&Wav { bits: 12, ..wav() });
    assert_eq!(got.samples, expected());
    let data = vec![0x10, 0x32, 0x54, 0xf0, 0xff, 0xff];
    let got = read_both(&Wav { bits: 20, data: data.clone(), ..wav() });
    assert_eq!(got.samples, [0x543210 as f32 / 8_388_608.0, -16.0 / 8_388_608.0]);
    // EXTENSIBLE defines the container by the block alignment: here three bytes in four.
    let data = [&[0], &data[..3], &[0], &data[3..]].concat();
    let wide = Wav { bits: 20, block_align: Some(8), data, ..wav() };
    let got = read_both(&Wav { sub_format: Some(tag::PCM), ..wide.clone() });
    assert_eq!(got.samples, [0x543210 as f32 / 8_388_608.0, -16.0 / 8_388_608.0]);
    // The plain chunk does not, and readers disagree.
    assert_eq!(refusal(&wide).verdict().name(), "unsupported");
}

#[test]
fn refusals_name_status_and_byte() {
    let cases = [
        (Wav { channels: 0, ..wav() }, "corrupt", 22),
        (Wav { channels: 65, ..wav() }, "unsupported", 22),
        (Wav { sample_rate: 0, ..wav() }, "corrupt", 24),
        (Wav { sample_rate: 768_001, ..wav() }, "unsupported", 24),
        (Wav { bits: 0, ..wav() }, "unsupported", 20),
        (Wav { bits: 65, ..wav() }, "unsupported", 20),
        (Wav { tag: 0x31, bits: 4, ..wav() }, "unsupported", 20),
        (Wav { tag: 2, bits: 4, ..wav() }, "corrupt", 32),
        (Wav { tag: tag::FLOAT, bits: 16, ..wav() }, "unsupported", 20),
        (Wav { before: vec![(*b"data", 2, vec![0, 0])], ..wav() }, "corrupt", 12),
        (Wav { before: vec![(*b"LIST", 999, vec![0, 0])], ..wav() }, "corrupt", 12),
    ];
    for (wav, status, offset) in cases {
        let error = refusal(&wav);
        assert_eq!((error.verdict().name(), error.offset()), (status, Some(offset)), "{error}");
    }
    for (bytes, status) in [
        (&b""[..], "empty"),
        (b"RIFF\0\0", "corrupt"),
        (b"RIFF\0\0\0\0AVI LIST", "not_audio"),
        (b"hello, world", "not_audio"),
    ] {
        assert_eq!(read_file(bytes.to_vec()).unwrap_err().verdict().name(), status);
        assert_eq!(read_pipe(bytes.to_vec()).unwrap_err().verdict().name(), status);
    }
    assert_eq!(open("/nonexistent/file.wav".as_ref()).err().unwrap().verdict().name(), "io");
    assert_eq!(open("/".as_ref()).err().unwrap().verdict().name(), "io");
}

#[test]
fn endless_tiny_chunks_are_refused() {
    let mut bytes = b"RIFF\0\0\0\0WAVE".to_vec();
    bytes.resize(1 << 20, 0);
    assert_eq!(read_file(bytes.clone()).unwrap_err().verdict().name(), "corrupt");
    assert_eq!(read_pipe(bytes).unwrap_err().verdict().name(), "corrupt");
}

#[test]
fn more_than_4_gib_in_a_plain_file() {
    // A sparse file: 5 GiB of 8 channels whose 32-bit size field wrapped, then a chunk.
    const BYTES: u64 = 5 << 30;
    let wav = Wav { channels: 8, data_size: Some(BYTES as u32), ..Wav::pcm16(8, &[]) };
    let header = wav.header();
    let mut file = tempfile::NamedTempFile::new().unwrap();
    file.write_all(&header).unwrap();
    file.seek(SeekFrom::Start(header.len() as u64 + BYTES - 16)).unwrap();
    file.write_all(&wav_tail()).unwrap();
    file.write_all(b"LIST\x04\0\0\0abcd").unwrap();

    let mut source = open(file.path()).unwrap();
    assert_eq!(source.spec().declared_frames, Some(BYTES / 16));
    let wrapped = Repair::DataSizeWrapped { declared: BYTES % (1 << 32), used: BYTES };
    assert_eq!(source.health().repairs, [wrapped]);
    source.seek(BYTES / 16 - 1).unwrap();
    let got = read_with(source.as_mut(), std::iter::repeat(10)).unwrap();
    assert_eq!(got.samples, expected());
    assert!(!got.report.truncated);
    assert!(File::open(file.path()).unwrap().metadata().unwrap().len() > BYTES);
}

fn wav_tail() -> Vec<u8> {
    wav().data
}

#[test]
fn seeking_continues_anywhere() {
    let samples: Vec<i16> = (0..20_000).collect();
    let bytes = Wav { channels: 1, ..Wav::pcm16(1, &samples) }.bytes();
    let mut source = corsmal_audio::from_seekable(std::io::Cursor::new(bytes.clone())).unwrap();
    for frame in [19_999u64, 0, 12_345, 20_000, 99_999_999, 3] {
        source.seek(frame).unwrap();
        let mut out = [0.0; 2];
        let n = source.read(&mut out).unwrap();
        assert_eq!(n, (20_000 - frame.min(20_000)).min(2) as usize);
        for (k, y) in out[..n].iter().enumerate() {
            assert_eq!(*y, (frame as f32 + k as f32) / 32768.0);
        }
    }
    let mut pipe = corsmal_audio::from_reader(std::io::Cursor::new(bytes)).unwrap();
    assert!(!pipe.seekable());
    assert!(matches!(pipe.seek(0), Err(AudioError::NotSeekable)));
}

#[test]
fn an_output_shorter_than_a_frame_reads_nothing() {
    let mut source = corsmal_audio::from_seekable(std::io::Cursor::new(wav().bytes())).unwrap();
    assert_eq!(source.read(&mut [0.0]).unwrap(), 0);
    let got = read_with(source.as_mut(), std::iter::repeat(1)).unwrap();
    assert_eq!(got.samples, expected());
}
