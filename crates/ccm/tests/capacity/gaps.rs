//! What is missing from some frames, and what a model has not learned.

use super::*;

/// A frame without depth took the box of all others with it; the mean of a category counted as measured.
#[test]
fn the_fused_estimate_does_without_single_frames_and_says_when_it_is_the_prior() {
    let dir = tempfile::tempdir().unwrap();
    let root = dir.path();
    data(root);
    let stop = AtomicBool::new(false);
    let learned = capacity::train(&options(root, Method::Fused), &|_, _| {}, &stop).unwrap();
    let path = root.join("model.json");
    learned.model.write(&path).unwrap();
    let fused = |path: &Path| {
        let model = Some(CapacityModel::read(path).unwrap());
        let rows = run(&CapacityOptions { model, ..options(root, Method::Fused) });
        let of = |r: &Row| matches!(r.key, RowKey::Sequence(7, s) if s < 7);
        rows.into_iter().find(of).unwrap()
    };
    let all = fused(&path);
    let name = "s0_fi1_fu1_b0_l0";
    let first = [1, 2].map(|c| root.join(format!("train/7/depth/{name}/c{c}/0000.png")));
    let black = Depth { width: 1280, height: 720, data: vec![0; 1280 * 720] }.to_png().unwrap();
    first.iter().for_each(|place| std::fs::write(place, &black).unwrap());
    let lost = fused(&path);
    first.iter().for_each(|place| std::fs::remove_file(place).unwrap());
    let absent = fused(&path);
    assert_eq!((lost.capacity(), lost.status()), (absent.capacity(), "ok"));
    assert_ne!(lost.capacity(), all.capacity());

    let text = std::fs::read_to_string(&path).unwrap();
    let mut model: serde_json::Value = serde_json::from_str(&text).unwrap();
    model.as_object_mut().unwrap().remove("hash").unwrap();
    for part in ["/fusion/methods", "/m3/processes"] {
        model.pointer_mut(part).unwrap().as_object_mut().unwrap().remove("box").unwrap();
    }
    let path = root.join("other.json");
    std::fs::write(&path, model.to_string()).unwrap();
    let row = fused(&path);
    let reason = row.estimate.as_ref().unwrap().substitute.clone().unwrap();
    assert_eq!((row.status(), row.estimate.as_ref().unwrap().frames), ("prior", 0));
    assert!(all.estimate.unwrap().frames > 0);
    assert!(reason.starts_with("prior: no method") && reason.contains(" box "), "{reason}");
}

/// The first was read, and nothing said of the other.
#[test]
fn two_tables_or_calibrations_that_differ_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let (base, name) = recording(dir.path(), Container::new(1).unwrap(), 0);
    write_views(&base, &name.to_string(), Container::new(1).unwrap(), name, 5).unwrap();
    let options = options(dir.path(), Method::M5);
    assert_eq!(run(&options)[0].status(), "ok");
    std::fs::write(base.join(format!("detections/{name}.csv")), b"frame,view\n").unwrap();
    let refused = |expected: &str| match &run(&options)[0].estimate {
        Err(Problem::Damaged(reason)) => assert!(reason.contains(expected), "{reason}"),
        other => panic!("{other:?}"),
    };
    refused("are tables of the same recording: remove one");
    std::fs::remove_file(base.join(format!("detections/{name}.csv"))).unwrap();

    let other = base.join(format!("view1/calib/{name}.pickle"));
    std::fs::create_dir_all(other.parent().unwrap()).unwrap();
    let copy = |view: u8| {
        std::fs::copy(base.join(format!("calib/{name}_c{view}_calib.pickle")), &other).unwrap()
    };
    copy(1);
    assert_eq!(run(&options)[0].status(), "ok");
    copy(2);
    refused("are different calibrations of the same view");
}
