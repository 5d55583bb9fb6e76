//! Frames as R(2+1)D-18 takes them: windows of 16, as M5's features were made.

use corsmal_vision::Rgb;

/// Frames of a window; windows lie side by side, and frames that do not fill one are left out.
pub const FRAMES: usize = 16;
/// Side of what the network sees of a frame.
pub const SIDE: usize = 112;
/// Numbers of a window.
pub const FEATURES: usize = 512;

/// Size to which frames are brought before their middle is cut out.
const RESIZED: (usize, usize) = (171, 128);
/// Mean and deviation of red, green and blue over Kinetics-400, which torchvision's weights expect.
const MEAN: [f32; 3] = [0.432_16, 0.394_666, 0.376_45];
const DEVIATION: [f32; 3] = [0.228_03, 0.221_45, 0.216_989];

/// A frame resized to 171 by 128 px, linear between pixels without smoothing, its middle of 112 by 112, in
/// deviations from the mean: `[colour][row][column]`.
pub fn frame(image: &Rgb) -> Vec<f32> {
    let columns = taps(image.width, RESIZED.0);
    let rows = taps(image.height, RESIZED.1);
    let mut out = Vec::with_capacity(3 * SIDE * SIDE);
    for (colour, (mean, deviation)) in MEAN.into_iter().zip(DEVIATION).enumerate() {
        let pixel = |y: usize, x: usize| f32::from(image.data[3 * (y * image.width + x) + colour]);
        for &(y0, y1, down) in &rows {
            for &(x0, x1, along) in &columns {
                let line = |y: usize| pixel(y, x0) * (1.0 - along) + pixel(y, x1) * along;
                let value = line(y0) * (1.0 - down) + line(y1) * down;
                out.push((value / 255.0 - mean) / deviation);
            }
        }
    }
    out
}

/// Windows `[colour][frame][row][column]` of as many [`frame`]s as [`FRAMES`].
///
/// # Panics
/// For another number of frames.
pub fn window(frames: &[Vec<f32>]) -> Vec<f32> {
    assert_eq!(frames.len(), FRAMES, "a window's frames");
    let plane = SIDE * SIDE;
    let colours = (0..3).flat_map(|c| frames.iter().map(move |f| &f[c * plane..(c + 1) * plane]));
    colours.flatten().copied().collect()
}

/// For the middle pixels of the new size: two old pixels and the weight of the second.
fn taps(from: usize, to: usize) -> Vec<(usize, usize, f32)> {
    let scale = from as f64 / to as f64;
    // Half columns are rounded as in torchvision and in M5's code: 29.5 to 30.
    let first = (to - SIDE).div_ceil(2);
    let tap = |i: usize| {
        let at = ((i as f64 + 0.5) * scale - 0.5).max(0.0);
        let low = (at as usize).min(from - 1);
        (low, (low + 1).min(from - 1), (at - low as f64) as f32)
    };
    (first..first + SIDE).map(tap).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_middle_of_a_frame_is_scaled() {
        // As large as the resized frame: pixels stay what they are.
        let pixel = |i: usize| [(i % 171) as u8, (i / 171) as u8, 7];
        let image = Rgb { width: 171, height: 128, data: (0..171 * 128).flat_map(pixel).collect() };
        let seen = frame(&image);
        assert_eq!(seen.len(), 3 * 112 * 112);
        // Columns 30 to 141, rows 8 to 119, as torchvision cuts out the middle.
        let red = |value: f32| (value / 255.0 - 0.43216) / 0.22803;
        assert!((seen[0] - red(30.0)).abs() < 1e-6 && (seen[111] - red(141.0)).abs() < 1e-6);
        let green = |value: f32| (value / 255.0 - 0.394_666) / 0.221_45;
        let at = 112 * 112;
        assert!((seen[at] - green(8.0)).abs() < 1e-6);
        assert!((seen[2 * at - 1] - green(119.0)).abs() < 1e-6);

        // Twice as large: between two pixels.
        let pixel = |i: usize| [(i % 342 / 2) as u8, 0, 0];
        let image = Rgb { width: 342, height: 256, data: (0..342 * 256).flat_map(pixel).collect() };
        assert!((frame(&image)[5] - red(35.0)).abs() < 1e-6);
    }

    #[test]
    fn a_window_has_colours_outside() {
        let one = |k: usize| (0..3).flat_map(|c| vec![(10 * c + k) as f32; SIDE * SIDE]).collect();
        let frames: Vec<Vec<f32>> = (0..FRAMES).map(one).collect();
        let window = window(&frames);
        let plane = SIDE * SIDE;
        assert_eq!(window.len(), 3 * FRAMES * plane);
        assert_eq!([window[0], window[plane], window[FRAMES * plane]], [0.0, 1.0, 10.0]);
        assert_eq!(window[(FRAMES + 15) * plane], 25.0);
    }
}
