//! Videos: the frames that an MP4 tells of, and pictures of them.

#![allow(clippy::unwrap_used)]

mod muxed;

use std::path::{Path, PathBuf};

use corsmal_vision::{Rgb, Video};

/// Twenty frames of 32 by 24 px that become brighter; red on the left, so that it is told from the right.
/// Made by `encoded` below.
fn shades() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/shades.mp4")
}

fn written(folder: &Path, bytes: &[u8]) -> PathBuf {
    let path = folder.join("v.mp4");
    std::fs::write(&path, bytes).unwrap();
    path
}

fn refused(bytes: &[u8]) -> String {
    let folder = tempfile::tempdir().unwrap();
    match Video::open(&written(folder.path(), bytes)) {
        Err(error) => error.to_string(),
        Ok(video) => panic!("{} frames", video.len()),
    }
}

/// All pictures with their numbers.
fn pictures(path: &Path) -> Result<Vec<(u32, Rgb)>, String> {
    let mut all = Vec::new();
    let video = Video::open(path).map_err(|e| e.to_string())?;
    let mut pictures = video.pictures().map_err(|e| e.to_string())?;
    while let Some((number, picture)) = pictures.next(|_| true).map_err(|e| e.to_string())? {
        all.push((number, picture.unwrap()));
    }
    Ok(all)
}

#[test]
fn frames_are_counted_without_decoding() {
    assert_eq!(Video::open(&shades()).unwrap().len(), 20);
    let folder = tempfile::tempdir().unwrap();
    for count in [0, 1, 2, 3, 4, 7] {
        let frames: Vec<Vec<u8>> = (0..count).map(|k| vec![k as u8; k + 1]).collect();
        // Any codec: another program may have extracted the frames.
        let path = written(folder.path(), &muxed::mp4(b"mp4v", &[], &frames));
        assert_eq!(Video::open(&path).unwrap().len(), count);
    }
}

/// Frames that are predicted from later ones are stored after them.
#[test]
fn another_order_of_frames_is_told() {
    let here = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests");
    let of = |name: &str| Video::open(&here.join(name)).unwrap().is_reordered();
    assert_eq!(["reordered.mp4", "shades.mp4", "grey.mp4"].map(of), [true, false, false]);
}

#[test]
fn damaged_files_are_refused() {
    let whole = muxed::mp4(b"avc1", &[], &[vec![1; 5], vec![2; 9], vec![3; 4], vec![4; 4]]);
    let place = |kind: &[u8; 4]| whole.windows(4).position(|w| w == kind).unwrap();
    let changed = |at: usize, bytes: &[u8]| {
        let mut file = whole.clone();
        file[at..at + bytes.len()].copy_from_slice(bytes);
        refused(&file)
    };
    let most = u32::MAX.to_be_bytes();
    // Counts that a file claims, sizes of nothing, and boxes that leave theirs.
    assert!(changed(place(b"stsz") + 12, &most).contains("4294967295 frames; the limit is 100000"));
    assert!(changed(place(b"stsz") + 12, &[0, 0, 0, 5]).contains("locates 4 of 5 frames"));
    assert!(changed(place(b"stco") + 8, &most).contains("a table of 4294967295 entries ends"));
    assert!(changed(place(b"stts") + 12, &[0, 0, 0, 3]).contains("when 3 of 4 frames are shown"));
    // Frames that players do not show, or turn.
    assert!(changed(place(b"elst") + 19, &[2]).contains("edit list leaves out 2 of 4 frames"));
    assert!(changed(place(b"elst") + 12, &[0, 0, 3, 232]).contains("leaves out 3 of 4 frames"));
    assert!(changed(place(b"tkhd") + 44, &[0; 4]).contains("rotated"));
    assert!(changed(place(b"stco") + 12, &most).contains("it ends before frame 0"));
    assert!(changed(place(b"avcC") - 4, &[0; 4]).contains("box avcC has 0 bytes"));
    assert!(changed(place(b"trak") - 4, &most).contains("box trak has 4294967295 bytes"));
    assert!(changed(place(b"mdat") - 4, &most).contains("box mdat at byte 28 leaves the file"));
    assert!(changed(place(b"mdat") - 4, &[0, 0, 0, 3]).contains("box mdat"));
    assert!(changed(place(b"vide"), b"soun").contains("no video track"));
    assert!(changed(place(b"moov"), b"moof").contains("fragmented"));
    assert!(changed(place(b"mvhd"), b"mvex").contains("fragmented"));
    assert!(changed(place(b"moov"), b"free").contains("no index"));
    assert!(changed(place(b"stsc"), b"free").contains("no box stsc"));
    // One frame size for a number of frames that no chunk has.
    let mut all_equal = whole.clone();
    all_equal[place(b"stsz") + 8..place(b"stsz") + 16]
        .copy_from_slice(&[0, 0, 0, 1, 0, 0, 255, 255]);
    assert!(refused(&all_equal).contains("of 65535 frames"));
    assert!(refused(b"").contains("no index"));
    assert!(refused(b"RIFF\0\0\0\0").contains("not a readable MP4"));
    // Cut anywhere, or with any byte changed, it ends in words or in the frames that are there.
    let folder = tempfile::tempdir().unwrap();
    for at in 0..whole.len() {
        assert!(Video::open(&written(folder.path(), &whole[..at])).is_err(), "{at}");
        for flip in [0x01, 0x80, 0xff] {
            let mut file = whole.clone();
            file[at] ^= flip;
            if let Ok(video) = Video::open(&written(folder.path(), &file)) {
                assert!(video.len() <= 4, "{at}");
            }
        }
    }
}

#[cfg(not(feature = "video"))]
#[test]
fn the_way_to_pictures_is_said() {
    let said = pictures(&shades()).unwrap_err();
    assert!(said.contains("shades.mp4: this program was built without video"), "{said}");
    assert!(said.contains("extract the frames") && said.contains("--features video"), "{said}");
}

#[cfg(feature = "video")]
mod decoded {
    use openh264::encoder::{Encoder, EncoderConfig, MatrixCoefficients, VuiConfig};
    use openh264::formats::{RgbSliceU8, YUVBuffer};
    use openh264::{OpenH264API, nal_units};

    use super::*;

    /// Grey of frame `k`.
    fn shade(k: usize) -> u8 {
        20 + 10 * k as u8
    }

    /// Content of `avcC`, and frames with lengths of four bytes.
    fn encoded(count: usize) -> (Vec<u8>, Vec<Vec<u8>>) {
        let pictures = (0..count).map(|k| {
            let grey = shade(k);
            let pixel = |i: usize| if i % 32 < 16 { [grey, 0, 0] } else { [grey; 3] };
            let pixels: Vec<u8> = (0..32 * 24).flat_map(pixel).collect();
            YUVBuffer::from_rgb8_source(RgbSliceU8::new(&pixels, (32, 24)))
        });
        encoded_by(Encoder::new().unwrap(), pictures)
    }

    fn encoded_by(
        mut encoder: Encoder,
        pictures: impl Iterator<Item = YUVBuffer>,
    ) -> (Vec<u8>, Vec<Vec<u8>>) {
        let (mut setup, mut frames) = (Vec::new(), Vec::new());
        for picture in pictures {
            let stream = encoder.encode(&picture).unwrap().to_vec();
            let (mut frame, mut sets) = (Vec::new(), [Vec::new(), Vec::new()]);
            for unit in nal_units(&stream) {
                let unit = &unit[unit.iter().position(|&byte| byte == 1).unwrap() + 1..];
                match unit[0] & 31 {
                    7 => sets[0] = unit.to_vec(),
                    8 => sets[1] = unit.to_vec(),
                    _ => frame.extend([&(unit.len() as u32).to_be_bytes(), unit].concat()),
                }
            }
            if setup.is_empty() {
                setup.extend([1, sets[0][1], sets[0][2], sets[0][3], 0xff]);
                for (count, set) in [(0xe1, &sets[0]), (1, &sets[1])] {
                    setup.push(count);
                    setup.extend((set.len() as u16).to_be_bytes());
                    setup.extend(set);
                }
            }
            frames.push(frame);
        }
        (setup, frames)
    }

    fn check(pictures: &[(u32, Rgb)]) {
        for (k, (number, picture)) in pictures.iter().enumerate() {
            assert_eq!((*number as usize, picture.width, picture.height), (k, 32, 24));
            let near = |x: usize, want: [u8; 3]| {
                let got = &picture.data[3 * (12 * 32 + x)..][..3];
                let same = got.iter().zip(want).all(|(got, want)| got.abs_diff(want) <= 12);
                assert!(same, "frame {k}, column {x}: {got:?}, not {want:?}");
            };
            near(5, [shade(k), 0, 0]);
            near(26, [shade(k); 3]);
        }
    }

    #[test]
    fn what_was_encoded_is_seen() {
        let (setup, frames) = encoded(20);
        let folder = tempfile::tempdir().unwrap();
        let file = muxed::mp4(b"avc1", &setup, &frames);
        if std::env::var_os("CORSMAL_WRITE_SHADES").is_some() {
            std::fs::write(shades(), &file).unwrap();
        }
        for path in [written(folder.path(), &file), shades()] {
            let all = pictures(&path).unwrap();
            assert_eq!(all.len(), 20);
            check(&all);
        }
        // Pictures only of those that are wanted.
        let video = Video::open(&shades()).unwrap();
        let (mut pictures, mut seen) = (video.pictures().unwrap(), Vec::new());
        while let Some((number, picture)) = pictures.next(|number| number % 4 == 3).unwrap() {
            seen.extend(picture.map(|_| number));
        }
        assert_eq!(seen, [3, 7, 11, 15, 19]);
    }

    /// Twelve frames in another order than they are shown, each in another colour, made by
    /// `ffmpeg -f lavfi -i "nullsrc=s=32x24:r=10:d=1.2,geq=lum='60+10*N':cb='90+5*N':cr='170-6*N'" -c:v libx264 -bf 2
    /// -x264-params b-adapt=0:scenecut=0:keyint=12 -crf 4 -pix_fmt yuv420p`, with an edit list that hides nothing.
    #[test]
    fn frames_come_as_they_are_shown() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/reordered.mp4");
        let found = pictures(&path).unwrap();
        assert_eq!(found.len(), 12);
        for (k, (number, picture)) in found.iter().enumerate() {
            let n = k as f64;
            let (y, cb, cr) = (60.0 + 10.0 * n, -38.0 + 5.0 * n, 42.0 - 6.0 * n);
            // ITU-R BT.601, limited range.
            let light = 1.164_383 * (y - 16.0);
            let want = [
                light + 1.596_027 * cr,
                light - 0.391_762 * cb - 0.812_968 * cr,
                light + 2.017_232 * cb,
            ];
            assert_eq!(*number as usize, k);
            let got = &picture.data[3 * (12 * 32 + 16)..][..3];
            let near = got
                .iter()
                .zip(want)
                .all(|(got, want)| (f64::from(*got) - want.clamp(0.0, 255.0)).abs() <= 4.0);
            assert!(near, "frame {k}: {got:?} not {want:?}");
        }
    }

    /// Six frames of brightness alone, made as those above with `-pix_fmt gray`: the decoder leaves their colours unset.
    #[test]
    fn frames_without_colours_are_grey() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/grey.mp4");
        let found = pictures(&path).unwrap();
        assert_eq!(found.len(), 6);
        for (k, (_, picture)) in found.iter().enumerate() {
            let want = 1.164_383 * (60.0 + 10.0 * k as f64 - 16.0);
            for pixel in picture.data.as_chunks::<3>().0 {
                let near = (f64::from(pixel[0]) - want).abs() <= 4.0;
                assert!(
                    near && pixel.iter().all(|value| *value == pixel[0]),
                    "frame {k}: {pixel:?}"
                );
            }
        }
    }

    /// The same with `-pix_fmt yuv444p`.
    #[test]
    fn what_the_decoder_is_not_made_for_is_said() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/full.mp4");
        let said = pictures(&path).unwrap_err();
        assert!(said.contains("colours of 4:4:4") && said.contains("extract the frames"), "{said}");
    }

    /// Brightness and differences of colour of a frame.
    const YUV: [u8; 3] = [120, 105, 160];

    /// A frame of one colour, under a declaration of the stream.
    fn declaring(vui: Option<VuiConfig>) -> (Vec<u8>, Vec<Vec<u8>>) {
        let config = EncoderConfig::new();
        let config = if let Some(vui) = vui { config.vui(vui) } else { config };
        let encoder = Encoder::with_api_config(OpenH264API::from_source(), config).unwrap();
        let plane = |value: u8, count: usize| vec![value; count];
        let planes = [plane(YUV[0], 32 * 24), plane(YUV[1], 16 * 12), plane(YUV[2], 16 * 12)];
        encoded_by(encoder, std::iter::once(YUVBuffer::from_vec(planes.concat(), 32, 24)))
    }

    /// By the factors that ITU-R prints for limited range: light, red by Cr, green by Cb and by Cr, blue by Cb.
    fn near(picture: &Rgb, [light, red, green_cb, green_cr, blue]: [f64; 5], floor: f64) {
        let [y, cb, cr] =
            [f64::from(YUV[0]) - floor, f64::from(YUV[1]) - 128.0, f64::from(YUV[2]) - 128.0];
        let y = light * y;
        let want = [y + red * cr, y - green_cb * cb - green_cr * cr, y + blue * cb];
        let got = &picture.data[3 * (12 * 32 + 16)..][..3];
        let same = got.iter().zip(want).all(|(got, want)| (f64::from(*got) - want).abs() <= 2.0);
        assert!(same, "{got:?} not {want:?}");
    }

    #[test]
    fn colours_are_those_that_are_declared() {
        const BT601: [f64; 5] = [1.164_383, 1.596_027, 0.391_762, 0.812_968, 2.017_232];
        const BT709: [f64; 5] = [1.164_384, 1.792_741, 0.213_249, 0.532_909, 2.112_402];
        const BT2020: [f64; 5] = [1.164_384, 1.678_674, 0.187_326, 0.650_424, 2.141_772];
        const BT709_FULL: [f64; 5] = [1.0, 1.5748, 0.187_324, 0.468_124, 1.8556];
        let folder = tempfile::tempdir().unwrap();
        let open = |file: &[u8]| pictures(&written(folder.path(), file));
        let seen = |file: &[u8]| open(file).unwrap().remove(0).1;
        for (vui, factors, floor) in [
            (None, BT601, 16.0),
            (Some(VuiConfig::bt601()), BT601, 16.0),
            (Some(VuiConfig::bt709()), BT709, 16.0),
            (Some(VuiConfig::bt709_full()), BT709_FULL, 0.0),
            (Some(VuiConfig::bt2020()), BT2020, 16.0),
        ] {
            let (setup, frames) = declaring(vui);
            near(&seen(&muxed::mp4(b"avc1", &setup, &frames)), factors, floor);
        }
        // What the file says counts where the stream says nothing.
        let (silent, frames) = declaring(None);
        let in_colr = |colr: &[u8], setup: &[u8], frames: &[Vec<u8>]| {
            muxed::with_boxes(b"avc1", &[(b"avcC", setup), (b"colr", colr)], frames)
        };
        let full = b"nclx\0\x01\0\x01\0\x01\x80";
        near(&seen(&in_colr(full, &silent, &frames)), BT709_FULL, 0.0);
        near(&seen(&in_colr(b"nclc\0\x09\0\x0e\0\x09", &silent, &frames)), BT2020, 16.0);
        near(&seen(&in_colr(b"prof\0\x09\0\x0e\0\x09", &silent, &frames)), BT601, 16.0);
        near(&seen(&in_colr(b"ncl", &silent, &frames)), BT601, 16.0);
        let (setup, frames) = declaring(Some(VuiConfig::bt709()));
        near(&seen(&in_colr(full, &setup, &frames)), BT709, 16.0);
        // Colours that no matrix gives are refused.
        let odd = VuiConfig::bt709().matrix_coefficients(MatrixCoefficients::Ycgco);
        let (setup, frames) = declaring(Some(odd));
        let said = open(&muxed::mp4(b"avc1", &setup, &frames)).unwrap_err();
        assert!(said.contains("matrix 8 of H.273"), "{said}");
    }

    #[test]
    fn damaged_frames_are_named() {
        let (setup, frames) = encoded(6);
        let folder = tempfile::tempdir().unwrap();
        let refuse = |setup: &[u8], frames: &[Vec<u8>]| {
            pictures(&written(folder.path(), &muxed::mp4(b"avc1", setup, frames))).unwrap_err()
        };
        let mut long = frames.clone();
        long[2][..4].copy_from_slice(&[0x7f, 0xff, 0xff, 0xff]);
        assert!(refuse(&setup, &long).contains("frame 2 is damaged"));
        let mut empty = frames.clone();
        empty[3].clear();
        let said = refuse(&setup, &empty);
        assert!(said.contains("frame") && said.contains("v.mp4"), "{said}");
        assert!(refuse(&setup[..3], &frames).contains("avcC"));
        assert!(refuse(&[], &frames).contains("a damaged box avcC"));
        let other = muxed::mp4(b"mp4v", &setup, &frames);
        let said = pictures(&written(folder.path(), &other)).unwrap_err();
        assert!(said.contains("its codec is mp4v; only H.264 (avc1) videos are read"), "{said}");
        // Noise in the frames: words or pictures, whichever, and no panic.
        let mut state = 1u32;
        for round in 0..200 {
            let mut noisy = frames.clone();
            for _ in 0..1 + round % 7 {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                let frame = &mut noisy[state as usize % 6];
                let at = 4 + (state >> 8) as usize % (frame.len() - 4);
                frame[at] ^= (state >> 24) as u8;
            }
            let file = muxed::mp4(b"avc1", &setup, &noisy);
            if let Err(said) = pictures(&written(folder.path(), &file)) {
                assert!(said.contains("v.mp4"), "{said}");
            }
        }
    }
}
