//! Options that would have no effect are refused, not passed over.

use crate::command::{done, refused, text};
use crate::models::small_table;

/// clap asks for no option that another one excludes: these were accepted.
#[test]
fn what_needs_an_option_does_not_go_with_those_that_exclude_it() {
    let train = ["train", "a.npz", "--target", "class", "-o", "m.model"];
    let validate = ["cross-validate", "a.npz", "--target", "class"];
    let of_networks = [["--weights", "w.pth"], ["--checkpoints", "runs"], ["--device", "gpu"]];
    let of_classifiers: [&[&str]; 4] =
        [&["--classifier", "knn"], &["--standardize"], &["--pca", "3"], &["--tune", "k=1,3"]];
    for command in [&train[..], &validate] {
        for network in of_networks {
            for classifier in of_classifiers {
                let said = refused(&[command, &network, classifier].concat());
                assert!(said.contains("cannot be used with"), "{network:?} {classifier:?}: {said}");
            }
        }
    }
    let crops = ["train", "--crops", "c", "--classifier", "knn", "-o", "m.model"];
    let weights = ["--type-weights", "9,1", "-o", "f.csv"];
    let levels = ["--level-weights", "9,1", "-o", "f.csv"];
    for line in [
        &crops[..],
        &[&["fuse", "a.csv", "b.csv"][..], &weights].concat(),
        &[&["fuse", "--predictions", "a.csv", "b.csv"][..], &levels].concat(),
        &[&["fuse", "--joint", "j.csv"][..], &weights].concat(),
        &["classify", "-m", "m.model", "--features", "a.npz", "--hop", "1"],
        &["embed", "vggish", "audio", "--weights", "w.pth", "--model", "m.onnx", "-o", "v.npz"],
    ] {
        let said = refused(line);
        assert!(said.contains("cannot be used with"), "{line:?}: {said}");
    }
}

#[test]
fn what_a_form_has_no_place_for_is_refused() {
    let fuse = |more: &[&str]| refused(&[&["fuse", "-o", "f.csv"], more].concat());
    assert!(fuse(&["a.csv", "--format", "2022"]).contains("--format is for submissions"));
    assert!(
        fuse(&["--type", "t.csv", "--mass-prior"]).contains("the format of 2020 has no masses")
    );
    let extract = |more: &[&str]| refused(&[&["extract", "a.wav", "--compress"], more].concat());
    assert!(extract(&["-o", "x.parquet"]).contains("not Parquet"));
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    let (wav, out) = (at("a.wav"), at("x.npz"));
    std::fs::write(&wav, b"RIFF").unwrap();
    let windows = ["extract", &wav, "-o", &out, "--window", "1", "--set", "signal.end=2"];
    let said = refused(&windows);
    assert!(said.contains("signal.end") && said.contains("must be 0 with windows"), "{said}");
    let csv = folder.path().join("p.csv");
    std::fs::write(&csv, "id,true,predicted\na,1.5,1\nb,2,2.5\n").unwrap();
    let said = refused(&["score", csv.to_str().unwrap(), "--reject", "0.6"]);
    assert!(said.contains("--reject is for classes"), "{said}");
}

/// All predictions were kept, as if they were certain.
#[test]
fn predictions_without_probabilities_cannot_be_rejected() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let (file, model) = (at("x.npz"), at("m"));
    small_table(&file, |_, _| {});
    for set in ["probability=false", "solver=linfa"] {
        let learn = ["train", text(&file), "--target", "type", "--classifier", "svm", "--set", set];
        done(&[&learn[..], &["-o", text(&model), "-q", "--overwrite"]].concat());
        let classify = ["classify", "-m", text(&model), "--features", text(&file)];
        done(&classify);
        let said = refused(&[&classify[..], &["--reject", "0.5"]].concat());
        assert!(said.contains("--reject: this svm has no probabilities"), "{said}");
    }
    let said =
        refused(&["classify", "-m", text(&model), "--features", text(&file), "--vote", "mean"]);
    assert!(said.contains("--window, which takes recordings"), "{said}");
}

/// They were refused for outer folds that no choice of parameters needs.
#[test]
fn parameters_are_chosen_with_few_rows_of_a_class() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let (file, model) = (at("x.npz"), at("m"));
    small_table(&file, |_, labels| labels[..3].fill("z".into()));
    let learn = ["train", text(&file), "--target", "type", "--classifier", "knn"];
    done(&[&learn[..], &["--tune", "k=1,3", "-o", text(&model), "-q"]].concat());
}
