//! Small models by ONNX Runtime, where its library is named by `CORSMAL_ONNXRUNTIME`.

#![cfg(feature = "runtime")]
#![allow(clippy::unwrap_used)]

use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, OnceLock};

use corsmal_onnx::OnnxError;
use corsmal_onnx::clip::{FRAMES, SIDE};
use corsmal_onnx::runtime::{ClipEmbedder, Detector, Runtime};
use corsmal_vision::Rgb;

fn model(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("tests/models/{name}.onnx"))
}

/// The runtime, once for this process; says so where there is no library.
fn runtime() -> Option<&'static Mutex<Runtime>> {
    static RUNTIME: OnceLock<Option<Mutex<Runtime>>> = OnceLock::new();
    let made = RUNTIME.get_or_init(|| {
        let Some(library) = std::env::var_os("CORSMAL_ONNXRUNTIME") else {
            // Written past the test harness, which keeps what passing tests print.
            let said = "skipped: CORSMAL_ONNXRUNTIME names no library of ONNX Runtime\n";
            std::io::stderr().write_all(said.as_bytes()).unwrap();
            return None;
        };
        // Before another one is loaded: a process has one.
        let missing = Runtime::load(Path::new("nowhere/libonnxruntime.so"), 1).err().unwrap();
        let said = missing.to_string();
        assert!(said.contains("nowhere/libonnxruntime.so: cannot be loaded"), "{said}");
        Some(Mutex::new(Runtime::load(Path::new(&library), 1).unwrap()))
    });
    made.as_ref()
}

#[test]
fn a_detector_sees_a_frame() {
    let Some(runtime) = runtime() else { return };
    let mut detector = Detector::open(&runtime.lock().unwrap(), &model("detector")).unwrap();
    // 4 by 3 px: red in the left half, green below.
    let pixel = |i: usize| [255 * u8::from(i % 4 < 2), 200 * u8::from(i / 4 == 2), 0];
    let image = Rgb { width: 4, height: 3, data: (0..12).flat_map(pixel).collect() };
    let seen = detector.detect(&image, |found| {
        assert_eq!(found.boxes, [[1.0, 0.0, 3.0, 2.0], [0.0, 0.0, 4.0, 3.0]]);
        assert_eq!((found.labels, found.scores), (&[47, 1][..], &[0.75, 0.5][..]));
        assert_eq!(found.masks[..4], [1.0, 1.0, 0.0, 0.0]);
        assert_eq!(found.masks[12..], [[0.0; 8].as_slice(), &[200.0 / 255.0; 4]].concat());
        found.rows((2, 5), (4, 3), 0.6).unwrap()
    });
    let rows = seen.unwrap();
    assert_eq!((rows.len(), &rows[0]["label"]), (1, &"cup".into()));
}

#[test]
fn an_embedder_gives_512_numbers() {
    let Some(runtime) = runtime() else { return };
    let open = |name: &str| ClipEmbedder::open(&runtime.lock().unwrap(), &model(name)).unwrap();
    let plane = FRAMES * SIDE * SIDE;
    let window: Vec<f32> = (0..3 * plane).map(|i| (i / plane) as f32).collect();
    let features = open("embedder").embed(&window).unwrap();
    assert_eq!(features.len(), 512);
    assert_eq!(features[..4], [0.0, 1.0, 2.0, 0.0]);
    let error = open("short").embed(&window).unwrap_err().to_string();
    assert!(error.contains("first output: found [1, 3], expected [1, 512]"), "{error}");
}

#[test]
fn other_models_are_refused() {
    let Some(runtime) = runtime() else { return };
    let runtime = runtime.lock().unwrap();
    let of = |name: &str| Detector::open(&runtime, &model(name)).err().unwrap();
    let unknown = of("unknown");
    assert!(matches!(unknown, OnnxError::Model { .. }));
    assert!(unknown.to_string().contains("Levitate"), "{unknown}");
    let vector = of("vector").to_string();
    assert!(
        vector.contains("input x: found") && vector.contains("an image [3, height, width]"),
        "{vector}"
    );
    let unmasked = of("unmasked").to_string();
    assert!(unmasked.contains("outputs: found y, expected boxes among them"), "{unmasked}");
    let none = of("nowhere").to_string();
    assert!(none.contains("nowhere.onnx"), "{none}");
    let clips = ClipEmbedder::open(&runtime, &model("detector")).err().unwrap().to_string();
    assert!(clips.contains("windows [items, 3, 16, 112, 112]"), "{clips}");
}
