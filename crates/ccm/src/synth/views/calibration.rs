//! Calibrations as the data set has them: text pickles of `[intrinsic, extrinsic]`.

use std::fmt::Write;

use corsmal_vision::Camera;

/// The pickle of a colour camera (protocol 0).
pub(super) fn pickle(camera: &Camera) -> Vec<u8> {
    let flat = |rows: &[&[f64]]| rows.concat();
    let intrinsic: Vec<&[f64]> = camera.intrinsic.iter().map(|r| &r[..]).collect();
    let rotation: Vec<&[f64]> = camera.rotation.iter().map(|r| &r[..]).collect();
    let projection: Vec<&[f64]> = camera.projection.iter().map(|r| &r[..]).collect();
    let mut text = String::from("((dS'rgb'\n");
    array(&mut text, [3, 3], &flat(&intrinsic));
    text.push_str("s(dS'rgb'\n(dS'rvec'\n");
    array(&mut text, [3, 3], &flat(&rotation));
    text.push_str("sS'tvec'\n");
    array(&mut text, [3, 1], &camera.translation);
    text.push_str("sS'projMatrix'\n");
    array(&mut text, [3, 4], &flat(&projection));
    text.push_str("ssl.");
    text.into_bytes()
}

fn array(text: &mut String, [rows, columns]: [usize; 2], values: &[f64]) {
    let _ = write!(
        text,
        "cnumpy.core.multiarray\n_reconstruct\n(cnumpy\nndarray\n(I0\ntS'b'\ntR(I1\n(I{rows}\n\
         I{columns}\ntcnumpy\ndtype\n(S'f8'\nI0\nI1\ntR(I3\nS'<'\nNNNI-1\nI-1\nI0\ntbI00\nS'"
    );
    for byte in values.iter().flat_map(|v| v.to_le_bytes()) {
        let _ = write!(text, "\\x{byte:02x}");
    }
    text.push_str("'\ntb");
}

#[cfg(test)]
mod tests {
    use super::*;
    use corsmal_vision::Calibration;

    #[test]
    fn what_is_written_reads_back() {
        let camera = Camera::new(
            [[920.0, 0.0, 645.0], [0.0, 920.5, 358.0], [0.0, 0.0, 1.0]],
            [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]],
            [0.1, -0.2, 1.3],
        );
        let read = Calibration::parse(&pickle(&camera), std::path::Path::new("c")).unwrap();
        assert_eq!((read.rgb, read.ir1), (camera, None));
    }
}
