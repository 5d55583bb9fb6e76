//! The array job of `docs/examples`, as Slurm would start it.

use std::fs;
use std::process::Command;

use super::support::{ended, extract, folder};
use crate::command::{names, tool};

#[test]
fn the_tasks_of_an_array_job_make_one_run() {
    const TASKS: usize = 3;
    let folder = folder(10);
    let at = |name: &str| folder.path().join(name);
    fs::write(at("audio/00/bad.wav"), b"no audio").unwrap();
    extract(&at("audio"), &at("whole.npz"), &["--preset", "mfcc-zcr"]).with(1);
    let bin = std::path::Path::new(env!("CARGO_BIN_EXE_corsmal-feat")).parent().unwrap().to_owned();
    let path = format!("{}:{}", bin.display(), std::env::var("PATH").unwrap_or_default());
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/examples/slurm.sh");
    let task = |index: usize| {
        let mut command = Command::new("bash");
        command.arg(script).arg(at("audio")).arg(at("parts")).env("PATH", &path);
        command.env("SLURM_ARRAY_TASK_ID", index.to_string());
        command.env("TASKS", TASKS.to_string());
        ended(command.env("SLURM_CPUS_PER_TASK", "1")).with(0)
    };
    (0..TASKS).for_each(|index| drop(task(index)));
    // One that Slurm starts again has nothing to do.
    assert!(task(1).stderr.contains("up to date"));
    let parts = names(&at("parts"));
    assert_eq!(parts, ["0.npz", "1.npz", "2.npz"]);
    let mut merge = tool();
    merge.arg("merge").args(parts.iter().map(|name| at("parts").join(name)));
    ended(merge.arg("--out").arg(at("merged.npz"))).with(0);
    assert!(fs::read(at("merged.npz")).unwrap() == fs::read(at("whole.npz")).unwrap());
}
