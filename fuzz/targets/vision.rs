//! Calibrations (pickle, JSON), images and tables of detections with their masks.
#![no_main]

use std::path::Path;

use corsmal_vision::{Calibration, Depth, Mask, Rgb, read_detections};

libfuzzer_sys::fuzz_target!(init: corsmal_fuzz::ours_only(), |bytes: &[u8]| {
    if let Ok(calibration) = Calibration::parse(bytes, Path::new("calib.pickle")) {
        let _ = calibration;
    }
    let image = corsmal_fuzz::file("image.png", bytes);
    let _ = (Depth::read(&image), Rgb::read(&image), Mask::read(&image));
    for name in ["detections.csv", "detections.json"] {
        for detection in read_detections(&corsmal_fuzz::file(name, bytes)).unwrap_or_default() {
            let _ = detection.mask(Some((64, 48)));
        }
    }
});
