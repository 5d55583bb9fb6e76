//! The real pair of LoDE and its calibrations, where the reference data are at hand.

#![allow(clippy::unwrap_used)]

use std::path::{Path, PathBuf};

use corsmal_vision::lode::{self, Variant, View};
use corsmal_vision::{Calibration, Mask};

/// Folder of the reference data; says so when it is not there.
fn shared(part: &str) -> Option<PathBuf> {
    let root = std::env::var_os("CORSMAL_SHARED").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared"),
        PathBuf::from,
    );
    let path = root.join(part);
    if !path.exists() {
        eprintln!("skipped: {} is absent (set CORSMAL_SHARED)", path.display());
        return None;
    }
    Some(path)
}

#[test]
fn real_calibrations_are_read_exactly() {
    let Some(lode) = shared("data/lode") else { return };
    let text = std::fs::read(lode.join("calibration.json")).unwrap();
    let all: serde_json::Value = serde_json::from_slice(&text).unwrap();
    for name in ["S1_c1", "S1_c2", "S2_c1", "S2_c2"] {
        let pickle = Calibration::load(&lode.join(format!("calib/calib_{name}.pickle"))).unwrap();
        let one = serde_json::to_vec(&all[name]).unwrap();
        let json = Calibration::parse(&one, Path::new(name)).unwrap();
        assert_eq!(pickle, json, "{name}");
        assert!(pickle.ir1.is_some() && pickle.ir2.is_some());
        // The projection that the file gives is that of its parts.
        for camera in [&pickle.rgb, pickle.ir1.as_ref().unwrap()] {
            let own =
                corsmal_vision::Camera::new(camera.intrinsic, camera.rotation, camera.translation);
            for (a, b) in own.projection.iter().flatten().zip(camera.projection.iter().flatten()) {
                assert!((a - b).abs() < 1e-9);
            }
        }
    }
}

#[test]
fn the_real_pair_gives_the_published_size() {
    let Some(data) = shared("data/lode") else { return };
    let masks = [1, 2].map(|i| Mask::read(&data.join(format!("masks/mask_c{i}.png"))).unwrap());
    let cameras = [1, 2]
        .map(|i| Calibration::load(&data.join(format!("calib/calib_S1_c{i}.pickle"))).unwrap().rgb);
    let views = [0, 1].map(|i| View { mask: &masks[i], camera: &cameras[i] });
    let published = lode::dimensions(views, Variant::Published).unwrap();
    for (value, expected) in [
        (published.height, 317.635_270_541_082_15),
        (published.width, 76.493_055_555_555_56),
        (published.capacity, 571.243_477_618_6),
    ] {
        assert!((value - expected).abs() < 1e-6, "{value} is not {expected}");
    }
    let band = lode::band(views, Variant::Published);
    // One pixel less or more, as measured with the published program.
    assert!((band.low.unwrap() - 505.0).abs() < 1.0, "{band:?}");
    assert!((band.high.unwrap() - 639.0).abs() < 1.0, "{band:?}");
    let corrected = lode::dimensions(views, Variant::Corrected).unwrap();
    assert_eq!(corrected.width, published.width);
    assert!((corrected.height - published.height).abs() < 1.1, "{}", corrected.height);
    // Exchanged masks are no object; the published program measures them.
    assert!(corrected.residual < 1.0, "{}", corrected.residual);
    let exchanged = [0, 1].map(|i| View { mask: &masks[1 - i], camera: &cameras[i] });
    let error = lode::dimensions(exchanged, Variant::Corrected).unwrap_err().to_string();
    assert!(error.contains("do not meet at one point"), "{error}");
    assert!(lode::dimensions(exchanged, Variant::Published).is_ok());
}

/// Height, width and capacity by file name; `None` where the file has the prior.
fn estimates(path: &Path) -> Vec<(String, Option<[f64; 3]>)> {
    let mut reader = csv::Reader::from_path(path).unwrap();
    let rows = reader.records().map(|row| {
        let row = row.unwrap();
        let [h, w, c] = [1, 2, 3].map(|i| row[i].parse::<f64>().unwrap());
        (row[0].to_string(), (c != lode::PRIOR_ML).then_some([h, w, c]))
    });
    rows.collect()
}

/// Every stored estimate is pi times the squared mean of radii of the grid times a height of the
/// grid: the numbers of the radii add up to a whole number.
#[test]
fn stored_estimates_lie_on_the_grids() {
    let Some(data) = shared("data/ccm/m5_predictions") else { return };
    let (mut without_gaps, mut with_gaps, mut single) = (0, 0, 0);
    for frame in ["1", "20"] {
        let path = data.join(format!("capacity_estimation_{frame}_public_test.csv"));
        for (name, [height, _, capacity]) in
            estimates(&path).into_iter().filter_map(|(name, e)| Some((name, e?)))
        {
            if (height, capacity) == (0.0, 0.0) {
                // One circle only.
                single += 1;
                continue;
            }
            let slices = height / 1000.0 / lode::HEIGHTS.step() + 1.0;
            assert!((slices - slices.round()).abs() < 1e-6, "{name}: {slices} heights");
            let radius = (capacity * 1000.0 / (std::f64::consts::PI * height)).sqrt() / 1000.0;
            let mean = (radius - lode::RADII.first) / lode::RADII.step();
            let whole = |count: usize| {
                let sum = mean * count as f64;
                (sum - sum.round()).abs() < 1e-6
            };
            let slices = slices.round() as usize;
            let accepted = (1..=slices).rev().find(|&count| whole(count));
            match accepted {
                Some(count) if count == slices => without_gaps += 1,
                Some(_) => with_gaps += 1,
                None => panic!("{name}: {mean} is no mean of whole numbers"),
            }
        }
    }
    assert_eq!((without_gaps, with_gaps, single), (109, 81, 1));
}

#[test]
fn frames_combine_to_the_submission() {
    let Some(data) = shared("data/ccm/m5_predictions") else { return };
    let read =
        |frame| estimates(&data.join(format!("capacity_estimation_{frame}_public_test.csv")));
    let (first, late) = (read("1"), read("20"));
    let mut submission = csv::Reader::from_path(data.join("submission_public_test.csv")).unwrap();
    let (mut equal, mut kinds) = (0, [0; 4]);
    for row in submission.records() {
        let row = row.unwrap();
        let name = format!("id{}_{:0>4}.png", &row[0], &row[1]);
        let capacity = |of: &[(String, Option<[f64; 3]>)]| {
            of.iter().find(|(n, _)| *n == name).unwrap().1.map(|e| e[2])
        };
        let (a, b) = (capacity(&first), capacity(&late));
        kinds[usize::from(a.is_some()) + 2 * usize::from(b.is_some())] += 1;
        let own = lode::combine(a, b).unwrap_or(lode::PRIOR_ML);
        equal += usize::from((own - row[4].parse::<f64>().unwrap()).abs() < 1e-9);
    }
    assert_eq!((equal, kinds), (228, [81, 51, 52, 44]));
}
