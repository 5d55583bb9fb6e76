//! Models and inputs that no estimate can come from.

use super::*;

/// Numbers in a model's file from which no estimate, or any memory, would follow.
pub fn impossible_models_are_refused(path: &Path) {
    let text = std::fs::read_to_string(path).unwrap();
    let sound: serde_json::Value = serde_json::from_str(&text).unwrap();
    for (place, value, part) in [
        ("/fusion/methods/cup/lode/deviation", serde_json::json!(0), "lode of category cup"),
        ("/fusion/priors/box/0", serde_json::json!(1e6), "prior of category box"),
        ("/m3/processes/cup/length", serde_json::json!(0.0), "not above 0"),
        (
            "/m3/means/glass",
            serde_json::json!([1.0]),
            "category glass: a process of 8 sizes and 1 means",
        ),
        ("/m3/processes", serde_json::json!({}), "no process"),
    ] {
        let mut changed = sound.clone();
        *changed.pointer_mut(place).unwrap() = value;
        let file = path.with_extension("changed");
        std::fs::write(&file, changed.to_string()).unwrap();
        let error = CapacityModel::read(&file).unwrap_err().to_string();
        assert!(error.contains("does not match the hash"), "{place}: {error}");
        // As version 0.1.0 wrote it.
        changed.as_object_mut().unwrap().remove("hash");
        std::fs::write(&file, changed.to_string()).unwrap();
        let error = CapacityModel::read(&file).unwrap_err().to_string();
        assert!(error.contains(part) && error.contains("model.changed"), "{place}: {error}");
    }
}

/// A calibration of another resolution, depth in another unit and a mask of everything: reasons, no numbers.
#[test]
fn inputs_of_another_scale_are_rows_with_a_reason() {
    let dir = tempfile::tempdir().unwrap();
    let (base, name) = recording(dir.path(), Container::new(1).unwrap(), 0);
    let put = |path: String, bytes: &[u8]| {
        let path = base.join(path);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, bytes).unwrap();
    };
    // From the front and from the right, 1 m from the origin.
    let calibrate = |scale: f64| {
        let turned = [[[1, 0, 0], [0, 0, -1], [0, 1, 0]], [[0, 1, 0], [0, 0, -1], [-1, 0, 0]]];
        for (view, rotation) in turned.iter().enumerate() {
            let (focal, x, y) = (920.0 * scale, 645.0 * scale, 358.0 * scale);
            let camera = serde_json::json!({
                "intrinsic": {"rgb": [[focal, 0, x], [0, focal, y], [0, 0, 1]]},
                "extrinsic": {"rgb": {"rvec": rotation, "tvec": [0, 0, 1]}},
            });
            let path = format!("calib/{name}_c{}_calib.json", view + 1);
            put(path, camera.to_string().as_bytes());
        }
    };
    let of = |x: usize, y: usize| (600..700).contains(&x) && (300..400).contains(&y);
    let depth = |unit: usize| {
        let mm = |at: usize| if of(at % 1280, at / 1280) { 350 + at % 1280 } else { 0 };
        let data = (0..1280 * 720).map(|at| (mm(at) * unit) as u16).collect();
        let image = Depth { width: 1280, height: 720, data };
        put(format!("depth/{name}/c1/0000.png"), &image.to_png().unwrap());
    };
    let seen = |label: &str, left: usize, right: usize| {
        serde_json::json!({
            "frame": 0, "view": 1, "label": label, "score": 0.9, "box": [left, 300, right, 400],
            "mask": [[left, 300, right, 300, right, 400, left, 400]],
        })
    };
    let table = serde_json::json!([seen("person", 500, 780), seen("cup", 600, 700)]);
    put(format!("detections/{name}.json"), table.to_string().as_bytes());
    let row = |method| {
        let all = run(&CapacityOptions { outliers: Outliers::Kept, ..options(dir.path(), method) });
        let reason = match &all[0].estimate {
            Ok(estimate) => estimate.substitute.clone().unwrap_or_default(),
            Err(Problem::Missing(reason) | Problem::Damaged(reason)) => reason.clone(),
        };
        (all[0].status(), reason)
    };
    calibrate(1.0);
    depth(1);
    assert_eq!(row(Method::M4), ("ok", String::new()));
    depth(10);
    let (status, reason) = row(Method::M4);
    assert!(status == "none" && reason.contains("impossible for a container"), "{reason}");
    depth(1);
    calibrate(0.5);
    let (status, reason) = row(Method::M4);
    assert!(status == "failed" && reason.contains("about 645 by 358 px"), "{reason}");
    calibrate(1.0);
    let all = Mask { width: 1280, height: 720, data: vec![true; 1280 * 720] }.to_png().unwrap();
    for view in [1, 2] {
        put(format!("masks/{name}/c{view}/0000.png"), &all);
    }
    let (status, reason) = row(Method::M5);
    assert!(status == "prior" && reason.contains("beyond the heights that are tried"), "{reason}");
}
