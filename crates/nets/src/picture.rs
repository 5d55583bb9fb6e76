//! From a picture to what a network takes.

/// Mean and deviation of red, green and blue over ImageNet, which torchvision's weights expect.
const MEAN: [f32; 3] = [0.485, 0.456, 0.406];
const DEVIATION: [f32; 3] = [0.229, 0.224, 0.225];

/// The numbers of a picture: red, green and blue of 8 bits pixel by pixel become 0 to 1, then
/// differences from ImageNet's mean in its deviations.
pub fn item(rgb: &[u8]) -> Vec<f32> {
    let colours = MEAN.into_iter().zip(DEVIATION).cycle();
    rgb.iter().zip(colours).map(|(&v, (mean, d))| (f32::from(v) / 255.0 - mean) / d).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_are_scaled_one_by_one() {
        let got = item(&[0, 255, 51, 102, 0, 255]);
        let want = [-2.117_904, 2.428_571, -0.915_556, -0.371_179, -2.035_714, 2.64];
        assert!(got.iter().zip(want).all(|(g, w): (&f32, f32)| (g - w).abs() < 1e-5), "{got:?}");
    }
}
