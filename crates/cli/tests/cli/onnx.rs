//! `detect` and `embed r21d`: what they say without ONNX Runtime and, where `CORSMAL_ONNXRUNTIME` names its
//! library and the command has them, what they make.

#[cfg(not(feature = "onnx"))]
#[test]
fn the_way_to_models_is_said() {
    use crate::command::refused;

    let detect = ["detect", "--data", "d", "--model", "m.onnx", "--library", "l.so", "--out", "o"];
    let message = refused(&detect);
    assert!(message.contains("--features nets,onnx"), "{message}");
    #[cfg(feature = "nets")]
    {
        let embed = ["embed", "r21d", "--data", "d", "--model", "m.onnx", "--library", "l.so"];
        let message = refused(&[&embed[..], &["-o", "o.npz"]].concat());
        assert!(message.contains("--features nets,onnx"), "{message}");
    }
    let bad = refused(&[&detect[..], &["--frames", "some"]].concat());
    assert!(bad.contains("expected ends, all or every=N"), "{bad}");
}

#[cfg(feature = "onnx")]
mod with_runtime {
    use std::path::{Path, PathBuf};

    use corsmal_vision::Rgb;
    use serde_json::Value;

    use crate::command::{done, refused, run, text};

    /// The library, where it is named; says so where it is not.
    fn library() -> Option<String> {
        let library = std::env::var("CORSMAL_ONNXRUNTIME").ok();
        if library.is_none() {
            crate::command::skipped("CORSMAL_ONNXRUNTIME names no library of ONNX Runtime");
        }
        library
    }

    fn model(name: &str) -> PathBuf {
        let models = Path::new(env!("CARGO_MANIFEST_DIR")).join("../onnx/tests/models");
        models.join(format!("{name}.onnx"))
    }

    /// Two recordings with so many frames of 4 by 3 px in four views: red left of the middle.
    fn data(folder: &Path, frames: usize) {
        let pixel = |i: usize| [255 * u8::from(i % 4 < 2), 0, 0];
        let image = Rgb { width: 4, height: 3, data: (0..12).flat_map(pixel).collect() };
        let png = image.to_png().unwrap();
        for (container, name) in [(3, "s0_fi1_fu1_b0_l0"), (4, "s0_fi2_fu2_b0_l0")] {
            let base = folder.join(format!("train/{container}"));
            std::fs::create_dir_all(base.join("audio")).unwrap();
            std::fs::write(base.join(format!("audio/{name}_audio.wav")), b"").unwrap();
            for view in 1..=4 {
                let views = base.join(format!("rgb/{name}/c{view}"));
                std::fs::create_dir_all(&views).unwrap();
                for frame in 0..frames {
                    std::fs::write(views.join(format!("{frame:04}.png")), &png).unwrap();
                }
            }
        }
    }

    #[test]
    fn detections_are_made_and_read() {
        let Some(library) = library() else { return };
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        let (ccm, out, detector) = (path("ccm"), path("detections"), model("detector"));
        data(&ccm, 25);
        let words = ["detect", "--data", text(&ccm), "--library", &library, "--out", text(&out)];
        let detect = [&words[..], &["--model", text(&detector), "--json"]].concat();
        let of = |said: &str, key: &str| serde_json::from_str::<Value>(said).unwrap()[key].clone();
        let said = done(&detect);
        assert_eq!([of(&said, "written"), of(&said, "kept")], [2, 0]);
        let table = std::fs::read_to_string(out.join("3/s0_fi1_fu1_b0_l0.json")).unwrap();
        let rows: Vec<Value> = serde_json::from_str(&table).unwrap();
        // A cup and a person in the first frame, the 20th from the end and the last of four views.
        assert_eq!(rows.len(), 2 * 3 * 4);
        let frames: Vec<_> = rows.iter().map(|row| row["frame"].as_u64().unwrap()).collect();
        assert_eq!(frames[..6], [0, 0, 5, 5, 24, 24]);
        let crops = path("crops");
        let crop =
            ["crops", "--data", text(&ccm), "--detections", text(&out), "--out", text(&crops)];
        done(&crop);
        let cup = Rgb::read(&crops.join("3_s0_fi1_fu1_b0_l0_c2.png")).unwrap();
        assert_eq!((cup.width, cup.height), (2, 3));

        // What is there is kept, and not mixed with what others make.
        std::fs::remove_file(out.join("4/s0_fi2_fu2_b0_l0.json")).unwrap();
        let said = done(&detect);
        assert_eq!([of(&said, "written"), of(&said, "kept")], [1, 1]);
        let other = [&detect[..], &["--frames", "every=8", "--views", "1"]].concat();
        assert!(
            refused(&other)
                .contains("made by another model or version, or of other data or frames")
        );
        let said = done(&[&other[..], &["--overwrite"]].concat());
        assert_eq!(of(&said, "written"), 2);
        let table = std::fs::read_to_string(out.join("3/s0_fi1_fu1_b0_l0.json")).unwrap();
        assert_eq!(table.matches("\"cup\"").count(), 4);

        std::fs::write(ccm.join("train/4/rgb/s0_fi2_fu2_b0_l0/c1/0024.png"), b"no image").unwrap();
        let output = run(&[&other[..], &["--overwrite"]].concat());
        assert_eq!(output.status.code(), Some(1));
        assert!(String::from_utf8_lossy(&output.stderr).contains("c1/0024.png"));
        for (name, said) in [("unknown", "Levitate"), ("vector", "an image [3, height, width]")] {
            let file = model(name);
            let message = refused(&[&words[..], &["--model", text(&file)]].concat());
            assert!(message.contains(said), "{message}");
        }
        let nowhere =
            ["detect", "--data", text(&ccm), "--library", "nowhere.so", "--out", text(&out)];
        let message = refused(&[&nowhere[..], &["--model", text(&detector)]].concat());
        assert!(message.contains("nowhere.so: cannot be loaded as ONNX Runtime"), "{message}");
    }

    #[cfg(feature = "nets")]
    #[test]
    fn windows_of_four_views_become_sequences() {
        let Some(library) = library() else { return };
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        let (ccm, out, embedder) = (path("ccm"), path("r21d.npz"), model("embedder"));
        data(&ccm, 35);
        let words = ["embed", "r21d", "--data", text(&ccm), "--library", &library];
        let embed = [&words[..], &["--model", text(&embedder), "-o", text(&out)]].concat();
        assert!(done(&embed).contains("2 recordings, 16 x 512"));
        // Networks learn from it: two windows in each of four views.
        let network =
            corsmal_nets::networks::named("m5_r21d_type").unwrap().build(None, 0).unwrap();
        let read = corsmal_nets::dataset::Dataset::read(&out, &network).unwrap();
        assert_eq!(read.ids[0], "train/3/audio/s0_fi1_fu1_b0_l0_audio");
        assert_eq!((read.ids.len(), read.items.columns.len()), (2, 4));
        assert_eq!(read.items.columns[3].offsets, [0, 1024, 2048]);
        assert_eq!(read.column("container").unwrap(), ["3", "4"]);

        // A recording of a test part has no name: the others keep theirs, and teach.
        let base = ccm.join("test/10");
        let views = ccm.join("train/3/rgb/s0_fi1_fu1_b0_l0");
        std::fs::create_dir_all(base.join("audio")).unwrap();
        std::fs::write(base.join("audio/0000_audio.wav"), b"").unwrap();
        for view in 1..=4 {
            let to = base.join(format!("rgb/0000/c{view}"));
            std::fs::create_dir_all(&to).unwrap();
            for frame in 0..16 {
                let name = format!("{frame:04}.png");
                std::fs::copy(views.join(format!("c{view}/{name}")), to.join(name)).unwrap();
            }
        }
        assert!(done(&[&embed[..], &["--overwrite"]].concat()).contains("3 recordings, 20 x 512"));
        let read = corsmal_nets::dataset::Dataset::read(&out, &network).unwrap();
        assert_eq!(read.column("container").unwrap(), ["3", "4", ""]);
        assert_eq!(read.column("sequence").unwrap()[1..], ["s0_fi2_fu2_b0_l0", ""]);
        let learned = path("type.safetensors");
        let train = ["train", text(&out), "--net", "m5-r21d-type", "--target", "type"];
        let output = run(&[&train[..], &["--set", "epochs=1", "-o", text(&learned)]].concat());
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(
            output.status.success() && said.contains("1 item without type: left out"),
            "{said}"
        );

        let third = ccm.join("train/3/rgb/s0_fi1_fu1_b0_l0/c3");
        for frame in 15..35 {
            std::fs::remove_file(third.join(format!("{frame:04}.png"))).unwrap();
        }
        let output = run(&[&embed[..], &["--overwrite"]].concat());
        assert_eq!(output.status.code(), Some(1));
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(said.contains("view 3 has 15 colour frames; a window has 16"), "{said}");
        assert!(
            refused(&["embed", "r21d", "audio", "--weights", "w.pth", "-o", text(&path("o.npz"))])
                .contains("--data")
        );
    }
}
