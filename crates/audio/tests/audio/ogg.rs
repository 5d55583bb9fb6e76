//! Ogg: several streams, pages that are none, and Opus.

use corsmal_audio::Repair;

use crate::compressed::OGG;
use crate::damage::{read_both, refusal};

/// Opus of `opusenc`; `make_samples.py` wrote it.
const NOISE: &[u8] = include_bytes!("samples/noise-2ch.opus");
const CLICKS: &[u8] = include_bytes!("samples/clicks-2ch.opus");

/// A first page of Ogg with one packet.
fn first_page(serial: u32, packet: &[u8]) -> Vec<u8> {
    let mut page = b"OggS\0\x02\0\0\0\0\0\0\0\0".to_vec();
    page.extend(serial.to_le_bytes());
    page.extend([0; 8]);
    page.extend([1, packet.len() as u8]);
    page.extend(packet);
    let mut crc = 0u32;
    for byte in &page {
        crc ^= u32::from(*byte) << 24;
        for _ in 0..8 {
            crc = if crc >> 31 == 1 { crc << 1 ^ 0x04c1_1db7 } else { crc << 1 };
        }
    }
    page[22..26].copy_from_slice(&crc.to_le_bytes());
    page
}

#[test]
fn streams_that_are_not_read_are_named_once() {
    let pages: Vec<u8> = (0..1000).flat_map(|n| first_page(n, b"Speex   1.2")).collect();
    let error = refusal(&[pages, first_page(7, b"PCM     ")].concat()).to_string();
    assert!(error.contains("Ogg with Speex, OggPCM") && error.len() < 300, "{error}");
}

#[test]
fn marks_of_pages_without_a_page_do_not_take_forever() {
    assert_eq!(refusal(&[OGG, &b"OggS\0\0".repeat(20_000)].concat()).verdict().name(), "corrupt");
    // A few are junk.
    let got = read_both(&[OGG, &b"OggS\0\0".repeat(100)].concat());
    assert!(got.samples == read_both(OGG).samples);
}

#[test]
fn a_chain_is_said_to_be_several_recordings() {
    let once = read_both(OGG);
    let got = read_both(&[OGG, OGG].concat());
    let at = (once.samples.len() / once.channels) as u64;
    assert_eq!(got.report.repairs, [Repair::Concatenated { at }]);
    assert!(got.report.loss().is_none());
}

#[test]
fn a_gap_begins_where_its_silence_does() {
    let is_page = |(at, word): (usize, &[u8])| (word == b"OggS").then_some(at);
    let pages: Vec<usize> = OGG.windows(4).enumerate().filter_map(is_page).collect();
    // Neither the page with which the recording begins nor that with which it ends.
    let hurt = [&OGG[..pages[3]], &OGG[pages[4]..]].concat();
    let once = read_both(OGG);
    let length = (once.samples.len() / once.channels) as u64;
    let gap = |bytes: &[u8]| {
        let got = read_both(bytes);
        got.report.repairs.iter().find_map(|repair| match repair {
            Repair::LostFrames { first, count } => Some((*first, *count)),
            _ => None,
        })
    };
    let (first, count) = gap(&hurt).unwrap();
    assert!(first + count < length);
    assert_eq!(gap(&[OGG, &hurt].concat()), Some((length + first, count)));
    let (channels, got) = (once.channels, read_both(&hurt).samples);
    let silent = &got[first as usize * channels..(first + count) as usize * channels];
    assert!(silent.iter().all(|x| *x == 0.0));
}

/// Packets of more than 1500 bytes, and peaks beyond full scale, which are kept.
#[test]
fn loud_noise_in_opus_is_read_whole_and_not_clipped() {
    let got = read_both(NOISE);
    assert_eq!((got.samples.len(), got.repairs()), (2 * 11_520, vec![]));
    let peak = got.samples.iter().fold(0.0f32, |peak, y| peak.max(y.abs()));
    assert!(peak > 1.2, "{peak}");
    // Of noise between -1 and 1 the mean square is 1/3, at any place.
    for block in got.samples.chunks_exact(1152) {
        let power = block.iter().map(|y| y * y).sum::<f32>() / 1152.0;
        assert!((0.2..0.5).contains(&power), "{power}");
    }
}

/// Short blocks in two channels.
#[test]
fn clicks_in_opus_stand_at_their_time() {
    let got = read_both(CLICKS);
    assert_eq!((got.samples.len(), got.repairs()), (2 * 11_520, vec![]));
    for click in (0..11_520).step_by(1500).skip(1) {
        let loudest = |from: usize, to: usize| {
            let levels = got.samples[2 * from..2 * to].iter().step_by(2).map(|y| y.abs());
            levels.fold(0.0f32, f32::max)
        };
        assert!(loudest(click - 2, click + 3) > 0.5, "at {click}");
        assert!(loudest(click - 700, click - 300) < 0.2, "before {click}");
    }
}
