//! `pca`, and `extract --project`.

use std::ffi::OsStr;
use std::path::Path;

use super::support::{Ended, ended, extract, folder, table};
use crate::command::{names, tool};

fn pca(features: &Path, components: &str, out: &Path) -> Ended {
    let mut command = tool();
    command.args([OsStr::new("pca"), "--features".as_ref(), features.as_ref()]);
    command.args(["--n-components", components]).args([OsStr::new("--out"), out.as_ref()]);
    ended(&mut command)
}

#[test]
fn fitted_on_one_run_and_applied_to_another() {
    let (train, test) = (folder(6), folder(2));
    let at = |name: &str| train.path().join(name);
    let esc26 = ["--preset", "esc26"];
    extract(&train.path().join("audio"), &at("train.npz"), &esc26).with(0);
    let fitted = pca(&at("train.npz"), "3", &at("pca.npz")).with(0);
    assert!(fitted.stdout.contains("26 features to 3 components"), "{}", fitted.stdout);

    let seen = ended(tool().arg("inspect").arg(at("pca.npz"))).with(0);
    assert!(
        seen.stdout.contains("26 features to 3 components, fitted on 6 rows"),
        "{}",
        seen.stdout
    );

    let file = at("pca.npz").display().to_string();
    let project = ["--preset", "esc26", "--project", &file];
    extract(&test.path().join("audio"), &at("test.npz"), &project).with(0);
    let projected = table(&at("test.npz"));
    assert_eq!(projected.feature_names(), ["pca[0]", "pca[1]", "pca[2]"]);
    assert_eq!(projected.values().dim(), (2, 3));
    // The same two recordings are among the training rows, so there is something to see.
    assert!(projected.values().iter().all(|x| x.is_finite() && *x != 0.0));
}

/// The machines of a cluster may have the same file at different places.
#[test]
fn a_projection_that_lies_elsewhere_is_the_same() {
    let folder = folder(4);
    let at = |name: &str| folder.path().join(name);
    let audio = at("audio");
    extract(&audio, &at("train.npz"), &["--preset", "esc26"]).with(0);
    pca(&at("train.npz"), "2", &at("pca.npz")).with(0);
    std::fs::copy(at("pca.npz"), at("copy.npz")).unwrap();
    let places = [at("pca.npz").display().to_string(), at("copy.npz").display().to_string()];
    let run = |out: &str, place: &str, more: &[&str]| {
        let words = [&["--preset", "esc26", "--project", place], more].concat();
        extract(&audio, &at(out), &words)
    };
    run("x.npz", &places[0], &[]).with(0);
    let again = run("x.npz", &places[1], &["--resume"]).with(0);
    assert!(again.stderr.contains("up to date"), "{}", again.stderr);
    for (shard, place) in places.iter().enumerate() {
        run(&format!("{shard}.npz"), place, &["--shard", &format!("{shard}/2")]).with(0);
    }
    let mut merge = tool();
    merge.arg("merge").args([at("0.npz"), at("1.npz")]).arg("--out").arg(at("both.npz"));
    ended(&mut merge).with(0);
    assert_eq!(table(&at("both.npz")).values(), table(&at("x.npz")).values());
}

#[test]
fn what_cannot_be_fitted_or_applied_is_refused_and_leaves_nothing() {
    let folder = folder(4);
    let at = |name: &str| folder.path().join(name);
    let audio = at("audio");
    extract(&audio, &at("train.npz"), &["--preset", "esc26"]).with(0);
    extract(&audio, &at("frames.npz"), &["--preset", "logmel"]).with(0);
    pca(&at("train.npz"), "2", &at("pca.npz")).with(0);
    let file = at("pca.npz").display().to_string();
    extract(&audio, &at("projected.npz"), &["--preset", "esc26", "--project", &file]).with(0);
    let before = names(folder.path());
    for (features, components, out, reason) in [
        ("train.npz", "2", "new.csv", "must end in .npz"),
        ("train.npz", "2", "pca.npz", "exists"),
        ("train.npz", "5", "new.npz", "1 to 4, the smaller side of X, not 5"),
        ("train.npz", "0", "new.npz", "the smaller side of X, not 0"),
        ("frames.npz", "2", "new.npz", "no statistics"),
        ("pca.npz", "2", "new.npz", "file from another program"),
        ("projected.npz", "1", "new.npz", "already projected"),
        ("absent.npz", "2", "new.npz", "absent.npz"),
    ] {
        let refused = pca(&at(features), components, &at(out)).with(2);
        assert!(refused.stderr.contains(reason), "{reason}: {}", refused.stderr);
    }
    let other = ["--preset", "esc28", "--project", &file];
    let refused = extract(&audio, &at("new.npz"), &other).with(2);
    assert!(refused.stderr.contains("projection.file"), "{}", refused.stderr);
    assert_eq!(names(folder.path()), before);
}
