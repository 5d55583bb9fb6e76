//! Factors that people meet, by name.

/// Transform lengths in use.
const N_FFT: [f64; 13] = [
    256.0, 400.0, 441.0, 512.0, 882.0, 1024.0, 1102.0, 1103.0, 1764.0, 2048.0, 2205.0, 4096.0,
    8192.0,
];

/// How near a factor must be to a named one.
const NEAR: f64 = 2e-4;

/// Names `factor` as a known constant, its square, or the inverse of either.
pub(super) fn name(factor: f64) -> Option<String> {
    let near = |candidate: f64| (factor / candidate - 1.0).abs() <= NEAR;
    let lengths = N_FFT.iter().flat_map(|&n| {
        [
            (n, format!("n_fft = {n}: another normalisation of the transform")),
            (n / 2.0, format!("the sum of a Hann window of {n}: window normalisation")),
            (
                0.375 * n,
                format!("the sum of squares of a Hann window of {n}: window normalisation"),
            ),
        ]
    });
    let fixed = [
        (32_768.0, "32768: samples as 16-bit counts against -1 to 1"),
        (32_767.0, "32767: samples as 16-bit counts against -1 to 1"),
        (2.0, "2: one-sided against two-sided spectrum, or a gain"),
        (std::f64::consts::SQRT_2, "the root of 2: peak against effective value, or a gain"),
        (8.0, "8: sum against mean of eight channels"),
        (100.0, "100: per cent"),
    ];
    let fixed = fixed.into_iter().map(|(value, text)| (value, text.to_string()));
    for (value, text) in fixed.chain(lengths) {
        for (candidate, before) in [
            (value, ""),
            (1.0 / value, "1 / "),
            (value * value, "the square of "),
            (1.0 / (value * value), "1 / the square of "),
        ] {
            if near(candidate) {
                return Some(format!("{before}{text}"));
            }
        }
    }
    None
}

/// Names the difference of two levels in decibels.
pub(super) fn name_decibels(offset: f64) -> Option<String> {
    name(10f64.powf(offset / 10.0))
}

/// Names the ratio between two logarithms, or decibels, of the same quantity.
pub(super) fn name_logarithms(ratio: f64) -> Option<&'static str> {
    let ln10 = std::f64::consts::LN_10;
    let log2 = std::f64::consts::LOG10_2;
    let known = [
        (2.0, "20 log10 against 10 log10 of the same values (amplitude_to_db or power_to_db)"),
        (10.0 / ln10, "decibels (10 log10) against natural logarithms"),
        (20.0 / ln10, "decibels (20 log10) against natural logarithms"),
        (10.0, "decibels (10 log10) against log10"),
        (20.0, "decibels (20 log10) against log10"),
        (10.0 * log2, "decibels (10 log10) against log2"),
        (ln10, "natural logarithms against log10"),
    ];
    let near = |candidate: f64| (ratio / candidate - 1.0).abs() <= NEAR;
    known.into_iter().find(|&(value, _)| near(value) || near(1.0 / value)).map(|(_, text)| text)
}
