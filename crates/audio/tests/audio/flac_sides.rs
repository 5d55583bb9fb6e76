//! FLAC whose frames store the difference of two channels.

use crate::common::read_file;

/// Bits, first to last.
#[derive(Default)]
struct Bits(Vec<bool>);

impl Bits {
    fn put(&mut self, value: i64, count: u32) -> &mut Self {
        self.0.extend((0..count).rev().map(|bit| value >> bit & 1 == 1));
        self
    }

    fn bytes(&self) -> Vec<u8> {
        let byte = |bits: &[bool]| bits.iter().fold(0, |byte, &bit| byte << 1 | u8::from(bit));
        self.0.chunks(8).map(|bits| byte(bits) << (8 - bits.len())).collect()
    }
}

fn checksum(bytes: &[u8], polynomial: u32, width: u32) -> i64 {
    let top = 1 << (width - 1);
    let sum = bytes.iter().fold(0u32, |sum, &byte| {
        (0..8).fold(sum ^ u32::from(byte) << (width - 8), |sum, _| {
            if sum & top == 0 { sum << 1 } else { sum << 1 ^ polynomial }
        }) & (2 * top - 1)
    });
    i64::from(sum)
}

/// One frame of left channel and difference, stored as they are.
fn flac(left: &[i64], right: &[i64], bits: u32) -> Vec<u8> {
    let block = left.len() as i64;
    let code = match bits {
        24 => 6,
        _ => 7,
    };
    let mut frame = Bits::default();
    frame.put(0xfff8, 16).put(6, 4).put(0, 4).put(8, 4).put(code, 3).put(0, 1);
    frame.put(0, 8).put(block - 1, 8);
    let header = checksum(&frame.bytes(), 0x07, 8);
    frame.put(header, 8).put(2, 8);
    for &l in left {
        frame.put(l, bits);
    }
    frame.put(2, 8);
    for (l, r) in left.iter().zip(right) {
        frame.put(l - r, bits + 1);
    }
    let mut bytes = frame.bytes();
    let footer = checksum(&bytes, 0x8005, 16);
    bytes.extend((footer as u16).to_be_bytes());
    let mut info = Bits::default();
    info.put(block, 16).put(block, 16).put(0, 24).put(0, 24);
    info.put(8000, 20).put(1, 3).put(i64::from(bits) - 1, 5).put(block, 36);
    info.0.resize(34 * 8, false);
    [b"fLaC\x80\0\0\x22".to_vec(), info.bytes(), bytes].concat()
}

#[test]
fn differences_are_added() {
    let left: Vec<i64> = (0..32).map(|i| 8_000_000 - 400_000 * i).collect();
    let right: Vec<i64> = left.iter().map(|l| -l).collect();
    let got = read_file(flac(&left, &right, 24)).unwrap();
    let both = left.iter().zip(&right).flat_map(|(&l, &r)| [l, r]);
    let expected: Vec<f32> = both.map(|v| v as f32 / (1 << 23) as f32).collect();
    assert_eq!(got.samples, expected);
}

/// In a release build, samples were wrong by up to 1.5 of full scale, without a word.
#[test]
fn differences_of_33_bits_are_unsupported() {
    let left: Vec<i64> = (0..32).map(|i| 2_000_000_000 - 100_000_000 * i).collect();
    let right: Vec<i64> = left.iter().map(|l| -l).collect();
    let refused = read_file(flac(&left, &right, 32)).unwrap_err();
    assert_eq!(refused.verdict().name(), "unsupported", "{refused}");
    assert!(refused.to_string().contains("33 bits"), "{refused}");
}
