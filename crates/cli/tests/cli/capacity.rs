//! `capacity` as a user runs it, on synthetic views.

use std::path::Path;

use corsmal_ccm::dataset::{Container, SequenceName};
use corsmal_ccm::synth::write_views;

use crate::command::{done, refused, run, text};

/// Synthetic recordings, one a container with views; `alone`: the others are removed. Rendering views takes
/// longest.
fn data(dir: &Path, alone: bool) -> String {
    done(&["synth", "--small", "--quiet", "--out", text(dir)]);
    for container in Container::all().take(9) {
        let base = dir.join(format!("train/{}", container.number()));
        for entry in std::fs::read_dir(base.join("audio")).unwrap() {
            let path = entry.unwrap().path();
            let stem = path.file_stem().unwrap().to_str().unwrap();
            if let (true, Some(name)) = (stem.starts_with("s0_fi1_fu1_"), SequenceName::parse(stem))
            {
                write_views(&base, &name.to_string(), container, name, 1).unwrap();
            } else if alone {
                std::fs::remove_file(&path).unwrap();
            }
        }
    }
    text(dir).into()
}

/// Statuses and capacities of a table.
fn rows(path: &Path) -> Vec<(String, f64)> {
    let mut reader = csv::Reader::from_path(path).unwrap();
    let header = reader.headers().unwrap().clone();
    let column = |name: &str| header.iter().position(|h| h == name).unwrap();
    let (status, capacity) = (column("status"), column("capacity[mL]"));
    let rows = reader.records().map(|row| {
        let row = row.unwrap();
        (row[status].to_string(), row[capacity].parse().unwrap())
    });
    rows.collect()
}

#[test]
fn every_method_estimates_from_files() {
    let dir = tempfile::tempdir().unwrap();
    let data = data(&dir.path().join("data"), true);
    let out = dir.path().join("capacity.csv");
    let model = dir.path().join("fused.capacity");
    let learned =
        done(&["capacity", "train", "--method", "fused", "--data", &data, "--out", text(&model)]);
    assert!(learned.contains("SYNTHETIC"), "{learned}");
    let train = ["capacity", "train", "--method", "m3", "--data", &data, "--json", "--out"];
    let told = done(&[&train[..], &[text(&dir.path().join("told.capacity"))]].concat());
    let told: serde_json::Value = serde_json::from_str(&told).unwrap();
    assert_eq!([&told["recordings"], &told["used"], &told["failed"]], [9, 9, 0]);
    assert_eq!(told["synthetic"], true);
    for (method, model) in
        [("m3", Some(text(&model))), ("m4", None), ("m5", None), ("fused", Some(text(&model)))]
    {
        let common =
            ["capacity", "--method", method, "--data", &data, "--out", text(&out), "--overwrite"];
        let mut arguments = common.to_vec();
        if let Some(model) = model {
            arguments.extend(["--model", model]);
        }
        let said = done(&arguments);
        let found = rows(&out);
        assert!(said.contains(&format!("{} recordings", found.len())), "{method}: {said}");
        let measured = found.iter().filter(|(status, capacity)| status == "ok" && *capacity > 10.0);
        assert!(measured.count() * 3 > found.len() * 2, "{method}: {found:?}");
    }
    #[cfg(feature = "nets")]
    {
        m2_runs_on_weights(dir.path(), &data);
        m2_learns(dir.path(), &data);
    }
    // A table that is damaged: its recording is named, the others teach.
    let broken = std::fs::read_dir(Path::new(&data).join("train/2/audio")).unwrap().next();
    let broken = broken.unwrap().unwrap().file_name().into_string().unwrap();
    let stem = broken.strip_suffix("_audio.wav").unwrap();
    std::fs::write(Path::new(&data).join(format!("train/2/detections/{stem}.json")), "[{").unwrap();
    let train = ["capacity", "train", "--method", "m3", "--data", &data, "--overwrite", "--out"];
    let output = run(&[&train[..], &[text(&model)]].concat());
    assert_eq!(output.status.code(), Some(1));
    let named = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(named.contains(stem) && named.contains("1 of 9 recordings"), "{named}");
    let needs = refused(&["capacity", "--method", "m3", "--data", &data, "--out", "new.csv"]);
    assert!(needs.contains("capacity train --method m3"), "{needs}");
}

/// Weights that answer a quarter of 4000 mL whatever they see.
#[cfg(feature = "nets")]
fn m2_runs_on_weights(dir: &Path, data: &str) {
    use corsmal_nets::{networks, weights};

    let network = networks::named("m2_capacity").unwrap().build(None, 1).unwrap();
    let state = network.parameters().iter().map(|(d, values)| {
        let values = match d.name.as_str() {
            "linear3.weight" => vec![0.0; values.len()],
            "linear3.bias" => vec![0.25],
            _ => values.to_vec(),
        };
        (d.name.clone(), d.shape.clone(), values)
    });
    let file = dir.join("m2.npz");
    weights::write(&file, &state.collect()).unwrap();
    let out = dir.join("m2.csv");
    let arguments = ["capacity", "--method", "m2", "--data", data, "--out", text(&out)];
    assert!(refused(&arguments).contains("capacity train --method m2"));
    done(&[&arguments[..], &["--weights", text(&file)]].concat());
    let found = rows(&out);
    assert_eq!(found, vec![("ok".to_string(), 1000.0); 9]);
}

/// Few epochs: the same bytes on one thread and on two, and estimates by what was learned.
#[cfg(feature = "nets")]
fn m2_learns(dir: &Path, data: &str) {
    let train = |jobs: &str, form: &[&str], out: &Path| {
        let how = ["--set", "epochs=2", "--set", "batch=4", "--seed", "5", "--jobs", jobs];
        let what = ["capacity", "train", "--method", "m2", "--data", data, "--out", text(out)];
        done(&[&what[..], &how, form].concat())
    };
    let models = [dir.join("m2-1.safetensors"), dir.join("m2-2.safetensors")];
    let said = train("1", &[], &models[0]);
    assert!(said.contains("9 of 9 recordings") && said.contains("SYNTHETIC"), "{said}");
    let told: serde_json::Value =
        serde_json::from_str(&train("2", &["--json"], &models[1])).unwrap();
    assert_eq!([&told["recordings"], &told["used"], &told["failed"]], [9, 9, 0]);
    assert_eq!((&told["synthetic"], &told["out"]), (&true.into(), &text(&models[1]).into()));
    let [first, second] = models.each_ref().map(|path| std::fs::read(path).unwrap());
    assert_eq!(first, second);
    let out = dir.join("m2-learned.csv");
    let estimate =
        ["capacity", "--method", "m2", "--data", data, "--overwrite", "--out", text(&out)];
    done(&[&estimate[..], &["--model", text(&models[0])]].concat());
    let learned = std::fs::read_to_string(&out).unwrap();
    assert_eq!(rows(&out).len(), 9);
    // A model holds weights, too; weights are no model.
    done(&[&estimate[..], &["--weights", text(&models[0])]].concat());
    let without_time = |table: &str| -> Vec<String> {
        let lines = table.lines().map(|line| line.split(',').take(3).collect::<Vec<_>>().join(","));
        lines.collect()
    };
    assert_eq!(without_time(&std::fs::read_to_string(&out).unwrap()), without_time(&learned));
    let weights = dir.join("m2.npz");
    let refusal = refused(&[&estimate[..], &["--model", text(&weights)]].concat());
    assert!(refusal.contains("not a model of M2's capacity network"), "{refusal}");
    let other = ["capacity", "train", "--method", "m3", "--data", data, "--out", "new.capacity"];
    assert!(refused(&[&other[..], &["--set", "epochs=2"]].concat()).contains("--method m2"));
    let seeds = ["--set", "seed=1"];
    let m2 = ["capacity", "train", "--method", "m2", "--data", data, "--out", "new.capacity"];
    assert!(refused(&[&m2[..], &seeds].concat()).contains("--seed"));
    // Two epochs teach too little to show up in a table: the weights that answer 1000 mL do.
    benchmark_runs_what_learned(dir, &weights);
}

/// `benchmark` runs methods that learned, by their models, and says where their scores are too good.
#[cfg(feature = "nets")]
fn benchmark_runs_what_learned(dir: &Path, m2: &Path) {
    // All recordings: baselines need every class.
    let data = &data(&dir.join("all"), false);
    let report = dir.join("report");
    let fused = dir.join("fused.capacity");
    let of = |name: &str, path: &Path| format!("{name}={}", text(path));
    let (m2, m3, both) = (of("m2", m2), of("m3", &fused), of("fused", &fused));
    let common =
        ["benchmark", "--data", data, "--out", text(&report), "--baselines", "zcr-mfcc-knn"];
    let said =
        done(&[&common[..], &["--capacity", &m2, "--capacity", &m3, "--capacity", &both]].concat());
    for name in ["M2", "M3", "Fused"] {
        assert!(said.contains(&format!("ZCR + MFCCs + kNN, capacity {name}")), "{name}: {said}");
        let file = report.join(format!("capacity/{}.csv", name.to_lowercase()));
        assert_eq!(rows(&file).len(), 57);
    }
    let page = std::fs::read_to_string(report.join("report.html")).unwrap();
    assert!(page.contains("The model of Fused was trained on C1, C2"), "no caution");
    // Five of six recordings have no views: what stands there is no measurement.
    let table = report.join("capacity/m3.csv");
    let statuses = std::fs::read_to_string(&table).unwrap();
    let none = statuses.matches(",none,").count();
    let expected =
        format!("M3: of 57 capacities, priors instead of estimates: 0; missing: {none}.");
    assert!(none > 0 && page.contains(&expected), "{none}: {statuses}");
    assert!(!page.contains("PCA baselines come with"), "no baseline of this run has PCA");
    let odd = ["--methods", "m1", "--embeddings", "vggish=absent.npz"];
    let refusal = refused(&[&common[..], &odd].concat());
    assert!(refusal.contains("--embeddings vggish: only m5 takes embeddings"), "{refusal}");
    // What only adds a capacity is not the best at level or type.
    let glance = std::fs::read_to_string(report.join("tables/glance.csv")).unwrap();
    assert!(glance.contains("kNN") && !glance.contains("capacity"), "{glance}");
    let wrong = of("m2", &fused);
    let refusal =
        refused(&["benchmark", "-q", "--data", data, "--out", "no-report", "--capacity", &wrong]);
    assert!(refusal.contains("fused.capacity"), "{refusal}");
}

#[test]
fn what_an_estimate_needs_is_said() {
    for (given, missing) in [
        (vec![], "--method"),
        (vec!["--method", "m5"], "--data"),
        (vec!["--data", "d", "--out", "o.csv"], "--method"),
        (vec!["--method", "m5", "--data", "d"], "--out"),
    ] {
        let output = run(&[&["capacity"], &given[..]].concat());
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{message}");
        assert!(message.contains(missing), "{given:?}: {message}");
    }
}

/// They were ignored.
#[test]
fn options_of_other_methods_are_refused() {
    let of = ["capacity", "--data", "x", "-o", "none.csv", "--method"];
    for (words, message) in [
        (["m5", "--model", "a"], "--model is for m2, m3 and fused; --method is m5"),
        (["m4", "--model", "a"], "--model is for m2, m3 and fused; --method is m4"),
        (["m3", "--weights", "a"], "--weights is for m2; --method is m3"),
        (["m5", "--outliers", "kept"], "--outliers is for m4; --method is m5"),
        (["fused", "--outliers", "kept"], "--outliers is for m4; --method is fused"),
        (["fused", "--variant", "published"], "--variant is for m2, m4 and m5; --method is fused"),
        (["m3", "--variant", "corrected"], "--variant is for m2, m4 and m5; --method is m3"),
        (["m2", "--detections", "d"], "--detections is for m3, m4, m5 and fused; --method is m2"),
        (["m5", "--seed", "2"], "--seed is for m3, m4 and fused; --method is m5"),
    ] {
        let found = refused(&[&of[..], &words].concat());
        assert!(found.contains(message), "{found}");
    }
}

/// A folder with a typo in its name gave the prior for every recording, at exit code 0.
#[test]
fn a_folder_of_detections_must_have_some() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let data = data(&at("ccm"), true);
    std::fs::create_dir(at("empty")).unwrap();
    let (absent, empty, out) = (at("absent"), at("empty"), at("out"));
    for command in [
        &["capacity", "--method", "m5"][..],
        &["crops"],
        &["benchmark", "--baselines", "zcr-mfcc-knn"],
    ] {
        for (given, expected) in
            [(&absent, "absent: "), (&empty, "has no table of detections for any")]
        {
            let rest = ["--data", &data, "--detections", text(given), "--out", text(&out)];
            let message = refused(&[command, &rest].concat());
            assert!(message.contains(expected), "{command:?}: {message}");
        }
    }
}
