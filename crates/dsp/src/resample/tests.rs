use std::sync::Arc;

use ndarray::Array2;
use proptest::prelude::*;

use super::kernel::SPAN;
use super::*;

/// Deterministic noise in -1..1.
fn noise(n: usize, seed: u64) -> Vec<f32> {
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    (0..n)
        .map(|_| {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            (state >> 40) as f32 / 8_388_608.0 - 1.0
        })
        .collect()
}

const RATES: [(f64, f64); 10] = [
    (44100.0, 22050.0),
    (22050.0, 44100.0),
    (48000.0, 16000.0),
    (44100.0, 16000.0),
    (44100.0, 48000.0),
    (44100.0, 8000.0),
    (44100.0, 25000.5),
    (8000.0, 44100.0),
    (3.0, 2.0),
    (100.0, 100.0),
];

#[test]
fn lengths_follow_librosa() {
    let plan = ResamplePlan::new(44100.0, 16000.0).unwrap();
    assert_eq!((plan.output_len(10), plan.filtered_len(10)), (4, 4));
    assert_eq!((plan.output_len(100), plan.filtered_len(100)), (37, 36));
    assert_eq!(plan.output_len(0), 0);
    let y = Array2::from_elem((1, 100), 0.5f32);
    let out = resample(y.view(), 44100.0, 16000.0, ResType::SoxrHq, true, false).unwrap();
    assert_eq!(out.ncols(), 37);
    assert_eq!(out[[0, 36]], 0.0);
    let free = resample(y.view(), 44100.0, 16000.0, ResType::SoxrHq, false, false).unwrap();
    assert_eq!(free.ncols(), 36);
}

#[test]
fn spans_of_an_array_join_without_a_seam() {
    for (from, to) in [(44100.0, 22050.0), (44100.0, 16000.0), (44100.0, 25000.5)] {
        let (plan, samples) = (ResamplePlan::new(from, to).unwrap(), noise(150_000, 3));
        let whole = 0..plan.filtered_len(samples.len() as u64);
        assert!(whole.end > 2 * SPAN as u64);
        let want = plan.segment(1, whole, &samples, 0).unwrap();
        let single = Array2::from_shape_fn((3, samples.len()), |(_, i)| samples[i]);
        let got = resample(single.view(), from, to, ResType::SoxrHq, false, false).unwrap();
        assert!(got.outer_iter().all(|row| row.iter().eq(&want)));
        let double = single.mapv(f64::from);
        let got = resample(double.view(), from, to, ResType::SoxrHq, false, false).unwrap();
        assert!(
            got.outer_iter().all(|row| row.iter().copied().eq(want.iter().map(|x| f64::from(*x))))
        );
    }
}

#[test]
fn the_last_samples_are_those_of_the_whole() {
    for (from, to) in RATES {
        for n in [1, 100, 5000] {
            let y = Array2::from_shape_vec((1, n), noise(n, 4)).unwrap();
            let whole = resample(y.view(), from, to, ResType::SoxrHq, true, false).unwrap();
            let whole = whole.row(0).to_vec();
            for count in [0, 1, 700, whole.len(), whole.len() + 9] {
                let last = resample_last(y.as_slice().unwrap(), from, to, count).unwrap();
                let want = &whole[whole.len().saturating_sub(count)..];
                assert_eq!(last, want, "{from} -> {to}, {count} of {}", whole.len());
            }
        }
    }
}

#[test]
fn faint_and_loud_signals_have_resampys_bits() {
    // Sums that are too small or too large for the quicker rounding.
    for scale in [1e-30, 1e-42, 1e35] {
        let y: Vec<f32> = noise(3000, 7).iter().map(|x| (f64::from(*x) * scale) as f32).collect();
        let wide: Vec<f64> = y.iter().map(|x| f64::from(*x)).collect();
        let kernel = (64, 0.9475937167399596, 14.769656459379492);
        let want = by_description(&wide, 0.5, kernel, |sum| (sum as f32).into());
        let y = Array2::from_shape_vec((1, y.len()), y).unwrap();
        let got = resample(y.view(), 2.0, 1.0, ResType::KaiserBest, false, false).unwrap();
        assert!(got.iter().map(|x| f64::from(*x)).eq(want), "{scale}");
    }
}

#[test]
fn tones_pass() {
    for (from, to) in RATES {
        let n = 20_000;
        let tone: Vec<f32> = (0..n).map(|i| (i as f64 * 0.05).sin() as f32).collect();
        let y = Array2::from_shape_vec((1, n), tone).unwrap();
        // resampy truncates its table step: the gain is off by up to 1 %.
        for (res_type, tolerance) in [(ResType::SoxrHq, 1e-5), (ResType::KaiserBest, 1e-2)] {
            let out = resample(y.view(), from, to, res_type, true, false).unwrap();
            let middle = out.ncols() / 2;
            for o in middle..middle + 50 {
                let exact = (o as f64 * from / to * 0.05).sin();
                let error = (f64::from(out[[0, o]]) - exact).abs();
                assert!(error < tolerance, "{from} -> {to} {res_type:?}: {error}");
            }
        }
    }
}

#[test]
fn large_samples_stay_finite() {
    for (from, to) in RATES {
        for x in [1e34, 1e36, 1e37] {
            let y = Array2::from_elem((1, 20_000), x as f32);
            let out = resample(y.view(), from, to, ResType::SoxrHq, true, false).unwrap();
            assert!(out.iter().all(|v| v.is_finite()), "{from} -> {to}, {x}");
        }
    }
}

#[test]
fn passes_in_the_middle_of_a_stream() {
    for (from, to) in [(44100.0, 22050.0), (44100.0, 5512.5), (44100.0, 25000.5)] {
        let plan = Arc::new(ResamplePlan::new(from, to).unwrap());
        for channels in [1, 3, 8] {
            let frames = 120_000;
            let input = noise(channels * frames, 8);
            let all = 0..plan.filtered_len(frames as u64);
            let want = plan.segment(channels, all, &input, 0).unwrap();
            for block in [1777, 40_000, frames] {
                let mut out = Vec::new();
                let mut stream = ResampleStream::new(plan.clone(), channels).unwrap();
                for block in input.chunks(block * channels) {
                    stream.push(block, &mut out).unwrap();
                }
                stream.finish(&mut out);
                assert!(out[..want.len()] == want[..], "{from} {to} {channels} {block}");
            }
        }
    }
}

/// Ends included: a filter gives nothing before its first output.
#[test]
fn stages_that_are_joined_give_what_they_give_apart() {
    for (from, to) in [(8000.0, 22050.0), (44100.0, 16000.0), (44100.0, 48000.0)] {
        let plan = ResamplePlan::new(from, to).unwrap();
        let designs = design::chain(from / to);
        let apart = designs.chunks(1).flat_map(|design| Stage::chain(design, 1)).collect();
        let apart = ResamplePlan { stages: apart, ..plan.clone() };
        assert!(plan.stages.len() < apart.stages.len());
        for n in [1, 300, 20_000] {
            let (y, all) = (noise(n, 11), 0..plan.filtered_len(n as u64));
            let got = plan.segment(1, all.clone(), &y, 0).unwrap();
            let want = apart.segment(1, all, &y, 0).unwrap();
            for (o, (got, want)) in got.iter().zip(&want).enumerate() {
                assert!((got - want).abs() < 1e-6, "{from} -> {to}, {o}: {got} for {want}");
            }
        }
    }
}

#[test]
fn energy_scale() {
    let y = Array2::from_shape_vec((1, 1000), noise(1000, 3)).unwrap();
    let plain = resample(y.view(), 2.0, 1.0, ResType::SoxrHq, true, false).unwrap();
    let scaled = resample(y.view(), 2.0, 1.0, ResType::SoxrHq, true, true).unwrap();
    for (a, b) in plain.iter().zip(&scaled) {
        assert!((f64::from(*a) * 2f64.sqrt() - f64::from(*b)).abs() < 1e-6);
    }
}

#[test]
fn impossible_rates_are_refused() {
    for (from, to) in [(0.0, 1.0), (1.0, -1.0), (1.0, f64::NAN), (1.0, 1e9)] {
        assert!(ResamplePlan::new(from, to).is_err());
    }
    let nan = Array2::from_elem((1, 8), f32::NAN);
    assert!(resample(nan.view(), 2.0, 1.0, ResType::SoxrHq, true, false).is_err());
    let plan = ResamplePlan::new(2.0, 1.0).unwrap();
    assert!(ResampleStream::new(Arc::new(plan), 0).is_err());
}

#[test]
fn half_bands_are_complementary() {
    // H(f) + H(nyquist - f) = 1 makes every even tap but the centre zero; DC gain is 1 to 2e-7.
    let Some(design::Design::Fir { taps, .. }) = design::chain(8.0).into_iter().next() else {
        panic!("no filter")
    };
    let centre = taps.len() / 2;
    assert!((taps.iter().sum::<f64>() - 1.0).abs() < 2e-7);
    assert!(
        taps.iter().enumerate().all(|(i, t)| i == centre || (i + centre) % 2 == 1 || *t == 0.0)
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn blocks_and_segments_give_the_same_bits(
        rates in 0..RATES.len(),
        channels in 1usize..4,
        frames in 0usize..3000,
        cuts in prop::collection::vec(0usize..700, 1..12),
        seed in any::<u64>(),
    ) {
        let (from, to) = RATES[rates];
        let plan = Arc::new(ResamplePlan::new(from, to).unwrap());
        let input = noise(frames * channels, seed);

        let mut whole = Vec::new();
        let mut stream = ResampleStream::new(plan.clone(), channels).unwrap();
        stream.push(&input, &mut whole).unwrap();
        stream.finish(&mut whole);
        prop_assert_eq!(whole.len(), plan.output_len(frames as u64) as usize * channels);

        let mut pieces = Vec::new();
        let mut stream = ResampleStream::new(plan.clone(), channels).unwrap();
        let mut at = 0;
        for cut in cuts.iter().cycle().take(50) {
            let end = (at + cut * channels).min(input.len());
            stream.push(&input[at..end], &mut pieces).unwrap();
            at = end;
        }
        stream.push(&input[at..], &mut pieces).unwrap();
        stream.finish(&mut pieces);
        prop_assert_eq!(&whole, &pieces);

        let filtered = plan.filtered_len(frames as u64);
        let middle = filtered / 3;
        for part in [0..middle, middle..filtered] {
            let needed = plan.input_range(part.clone());
            let first = (needed.start.max(0) as usize).min(frames);
            let last = (needed.end.max(0) as usize).min(frames).max(first);
            let cut = &input[first * channels..last * channels];
            let out = plan.segment(channels, part.clone(), cut, first as u64).unwrap();
            let span = part.start as usize * channels..part.end as usize * channels;
            prop_assert_eq!(&out[..], &whole[span]);
        }

        // Channels are independent.
        for c in 0..channels {
            let one: Vec<f32> = input.iter().skip(c).step_by(channels).copied().collect();
            let alone = plan.segment(1, 0..filtered, &one, 0).unwrap();
            let together: Vec<f32> =
                whole.iter().skip(c).step_by(channels).take(alone.len()).copied().collect();
            prop_assert_eq!(alone, together);
        }
    }
}

/// resampy 0.2.2's loop as its description has it: a sum of steps, two wings from a table of 512
/// entries per zero crossing, and a sum in the precision of `round`.
fn by_description(
    y: &[f64],
    ratio: f64,
    (zeros, rolloff, beta): (usize, f64, f64),
    round: fn(f64) -> f64,
) -> Vec<f64> {
    let scale = ratio.min(1.0);
    let half: Vec<f64> = (0..=512 * zeros)
        .map(|i| {
            let x = rolloff * i as f64 / 512.0 * std::f64::consts::PI;
            let r = i as f64 / (512 * zeros) as f64;
            let sinc = if i == 0 { 1.0 } else { x.sin() / x };
            let window = crate::window::bessel_i0(beta * (1.0 - r * r).max(0.0).sqrt());
            scale * (rolloff / crate::window::bessel_i0(beta) * sinc * window)
        })
        .collect();
    let stride = (scale * 512.0) as usize;
    let wing = |sum: f64, distance: f64, samples: &mut dyn Iterator<Item = &f64>| -> f64 {
        let at = distance * 512.0;
        let (offset, eta) = (at as usize, at.fract());
        let weights = (offset..).step_by(stride).take((half.len() - offset) / stride);
        let value = |at: usize| half[at] + eta * half.get(at + 1).map_or(0.0, |x| x - half[at]);
        weights.zip(samples).fold(sum, |sum, (at, x)| round(sum + value(at) * x))
    };
    let mut time = 0.0;
    (0..(y.len() as f64 * ratio) as usize)
        .map(|_| {
            let frame = (time as usize).min(y.len() - 1);
            let distance = scale * (time - frame as f64);
            time += 1.0 / ratio;
            let sum = wing(0.0, distance, &mut y[..=frame].iter().rev());
            wing(sum, scale - distance, &mut y[frame + 1..].iter())
        })
        .collect()
}

#[test]
fn windowed_sinc_is_resampys_loop() {
    let rates = [(44100.0, 16600.0), (48000.0, 22050.0), (48000.0, 44100.0), (44100.0, 11025.0)];
    for (from, to) in RATES.into_iter().chain(rates).filter(|(from, to)| from != to) {
        let y = Array2::from_shape_vec((1, 40_000), noise(40_000, 9)).unwrap();
        let wide = y.mapv(f64::from);
        for (res_type, kernel) in [
            (ResType::KaiserBest, (64, 0.9475937167399596, 14.769656459379492)),
            (ResType::KaiserFast, (16, 0.85, 8.555504641634386)),
        ] {
            let samples = wide.as_slice().unwrap();
            let want = by_description(samples, to / from, kernel, |sum| sum);
            let double = resample(wide.view(), from, to, res_type, false, false).unwrap();
            let single = resample(y.view(), from, to, res_type, false, false).unwrap();
            assert_eq!((double.ncols(), single.ncols()), (want.len(), want.len()));
            for (o, want) in want.iter().enumerate() {
                let (double, single) = (double[[0, o]], f64::from(single[[0, o]]));
                let name = format!("{res_type:?} {from} -> {to}, output {o}");
                // The sum of steps has left the exact times by 1e-7 of a sample.
                assert!((double - want).abs() < 1e-6, "{name}: {double} for {want}");
                assert!((single - want).abs() < 2e-6, "{name}: {single} for {want}");
            }
            // Where the rate falls to a whole part, to the last bit.
            if (from / to).fract() == 0.0 {
                let want = by_description(samples, to / from, kernel, |sum| (sum as f32).into());
                assert!(single.iter().map(|x| f64::from(*x)).eq(want), "{from} -> {to}");
            }
        }
    }
}

#[test]
fn windowed_sinc_streams_give_the_bits_and_length_of_arrays() {
    let rates = [
        (44100.0, 22050.0),
        (8000.0, 22050.0),
        (48000.0, 44100.0),
        (44100.0, 16000.0),
        (48000.0, 16000.0),
        (44100.0, 25000.5),
    ];
    for (from, to) in rates {
        for res_type in [ResType::KaiserBest, ResType::KaiserFast, ResType::SoxrHq] {
            let converter = Converter::new(from, to, res_type).unwrap();
            for frames in [0, 1, 2, 37, 400, 1501, 50_000] {
                let input = noise(2 * frames, 5);
                let channels = Array2::from_shape_vec((frames, 2), input.clone()).unwrap();
                let whole = match frames {
                    0 => Array2::zeros((2, 0)),
                    _ => resample(channels.t(), from, to, res_type, true, false).unwrap(),
                };
                for block in [1, 7, 64, 2000].into_iter().filter(|b| frames < 5000 || *b > 7) {
                    let mut out = Vec::new();
                    let mut stream = converter.stream(2).unwrap();
                    input.chunks(2 * block).for_each(|b| stream.push(b, &mut out).unwrap());
                    stream.finish(&mut out);
                    let want: Vec<f32> = whole.t().iter().copied().collect();
                    assert_eq!(out, want, "{res_type:?} {from} -> {to}, {frames} by {block}");
                }
            }
        }
    }
}

/// Only the first channel was cleared.
#[test]
fn no_samples_give_zeros_in_every_channel() {
    for (orig, target) in [(44_100.0, 44_100.0), (44_100.0, 22_050.0)] {
        for res_type in [ResType::SoxrHq, ResType::KaiserFast] {
            let y = Array2::<f32>::zeros((2, 0));
            let mut out = Array2::from_elem((2, 10), 7.0_f32);
            resample_into(y.view(), orig, target, res_type, false, out.view_mut()).unwrap();
            assert!(out.iter().all(|x| *x == 0.0), "{orig} {target} {res_type:?}");
        }
    }
}
