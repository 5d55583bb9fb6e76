use ndarray::{Array2, Axis, s};

use super::*;
use crate::librosa::LibrosaVersion;

/// Eight channels of a decaying tone with clicks.
fn recording(n: usize) -> Array2<f32> {
    Array2::from_shape_fn((8, n), |(c, i)| {
        let click = if i % 9000 < 40 { 0.3 } else { 0.0 };
        let t = i as f32 / 44_100.0;
        (0.2 * (t * 1500.0 * (1.0 + 0.1 * c as f32)).sin() + click) * (-t).exp()
    })
}

#[test]
fn shapes() {
    let (y, sr) = (recording(60_000), 44_100.0);
    assert_eq!(M1Stft::default().run(y.view()).unwrap().dim(), (1025, 118));
    assert_eq!(M2Mfcc::default().run(y.view(), sr).unwrap().dim(), (1501, 40));
    assert_eq!(M3Spectrogram::default().run(y.view(), sr).unwrap().dim(), (563, 11));
    let logmel = M4LogMel::default().run(y.view(), sr).unwrap();
    assert_eq!(logmel.dim(), (134, 64, 8));
    assert_eq!(m4_windows(logmel.view()).dim(), (5, 8, 64, 64));
    assert_eq!(M5A34f136::new(sr).unwrap().run(y.view()).unwrap().len(), 136);
    let patches = M5VggishPatches::default().run(y.view(), sr).unwrap();
    assert_eq!(patches.dim(), (1, 96, 64));
    assert_eq!(M6Spectrogram::default().run(y.view(), sr).unwrap().dim(), (96, 96));
    assert_eq!(Spec9216::default().run(y.row(0)).unwrap().dim(), (96, 96));
}

#[test]
fn silence_and_single_samples_are_finite_or_refused() {
    for n in [1, 2, 600, 5000] {
        let y = Array2::<f32>::zeros((8, n));
        let finite = |a: Array2<f32>| assert!(a.iter().all(|v| v.is_finite()), "{n}");
        finite(M2Mfcc::default().run(y.view(), 44_100.0).unwrap());
        finite(M3Spectrogram::default().run(y.view(), 44_100.0).unwrap());
        finite(M6Spectrogram::default().run(y.view(), 44_100.0).unwrap());
        let logmel = M4LogMel::default().run(y.view(), 44_100.0).unwrap();
        assert!(logmel.iter().all(|v| v.is_finite()));
        assert!(m4_windows(logmel.view()).iter().all(|v| v.is_finite()));
        assert!(M5VggishPatches::default().run(y.view(), 44_100.0).unwrap().is_empty());
        assert!(Spec9216::default().run(y.row(0)).is_err());
    }
    let none = Array2::<f32>::zeros((8, 0));
    assert!(M2Mfcc::default().run(none.view(), 44_100.0).is_err());
    assert!(M6Spectrogram::default().run(none.view(), 44_100.0).is_err());
    assert!(M4LogMel::default().run(none.view(), 44_100.0).is_err());
}

#[test]
fn the_low_frequency_channel_is_left_out() {
    assert!((downmix_71_weights().iter().sum::<f64>() - 1.0).abs() < 1e-15);
    let mut y = Array2::<f32>::zeros((8, 4));
    y.row_mut(3).fill(0.5);
    assert!(downmix_71(y.view()).unwrap().iter().all(|&v| v == 0.0));
    assert!(downmix_71(Array2::zeros((5, 4)).view()).is_err());
}

#[test]
fn m6_begins_at_the_given_time() {
    let y = recording(88_200);
    let from = |crop| {
        let plan = M6Spectrogram { librosa: LibrosaVersion::V011, crop };
        plan.run(y.view(), 44_100.0).unwrap()
    };
    assert_ne!(from(M6Crop::At(0.0)), from(M6Crop::At(1.0)));
}

#[test]
fn m4_has_the_same_bits_whatever_shares_its_lanes() {
    let y = recording(20_000);
    for variant in [Variant::Code, Variant::Paper] {
        let plan = M4LogMel { variant };
        let alone: Vec<_> =
            (0..8).map(|c| plan.run(y.slice(s![c..=c, ..]), 44_100.0).unwrap()).collect();
        for channels in [2, 3, 8] {
            let together = plan.run(y.slice(s![..channels, ..]), 44_100.0).unwrap();
            for (c, alone) in alone.iter().enumerate().take(channels) {
                assert_eq!(together.index_axis(Axis(2), c), alone.index_axis(Axis(2), 0));
            }
        }
    }
}

#[test]
fn m3_has_the_same_bits_without_what_it_does_not_read() {
    let plan = M3Spectrogram::default();
    for (sr, n) in
        [(44_100.0, 150_000), (44_100.0, 441 * 400), (48_000.0, 140_001), (8000.0, 20_000)]
    {
        let y = recording(n);
        let unread = plan.unread(sr, n as u64).unwrap() as usize;
        assert_eq!(unread > 0, n as f64 / sr > 2.5, "{sr} {n}");
        let part = plan.run(y.slice(s![.., unread..]), sr).unwrap();
        assert_eq!(part, plan.run(y.view(), sr).unwrap());
    }
    // Places of outputs that do not repeat; and no whole rates.
    assert_eq!(plan.unread(44_101.0, 1 << 20).unwrap(), 0);
    assert_eq!(plan.unread(44_100.5, 1 << 20).unwrap(), 0);
}
