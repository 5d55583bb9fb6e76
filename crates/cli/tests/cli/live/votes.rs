//! Votes over the windows of a recording.

use super::*;

#[test]
fn windows_are_voted_on() {
    let trained = Trained::new(&["--classifier", "knn", "--set", "k=1"]);
    let (model, audio, out) = (trained.path("m"), trained.path("audio"), trained.path("out.csv"));
    std::fs::create_dir(&audio).unwrap();
    recording(&audio.join("a.wav"), &[0, 1, 2, 4, 6]);
    recording(&audio.join("b.wav"), &[1, 1, 1, 0]);
    let classify = ["classify", "--model", text(&model), "-q", "--in", text(&audio)];
    let windows = ["--window", "1", "--hop", "1"];
    let voted = |vote: &[&str]| done(&[&classify[..], &windows, vote].concat());
    let majority = voted(&["--vote", "majority"]);
    let rows = |table: &str| -> Vec<Vec<String>> {
        let lines = table.lines().skip(1);
        lines.map(|l| l.split(',').skip(2).map(String::from).collect()).collect()
    };
    assert_eq!(majority.lines().next(), Some("id,path,status,windows,predicted,p_noise,p_tone"));
    assert_eq!(
        rows(&majority),
        [["ok", "5", "tone", "0.2", "0.8"], ["ok", "4", "noise", "0.75", "0.25"]]
    );
    // With one neighbour the probabilities are votes, too.
    assert_eq!(voted(&["--vote", "mean"]), majority);
    let quiet = voted(&["--vote", "majority", "--background", "tone", "--least", "2"]);
    assert_eq!(rows(&quiet)[0][2], "tone");
    let loud = voted(&["--vote", "majority", "--background", "tone"]);
    assert_eq!(rows(&loud)[0][2], "noise");

    // The same from a file of windows, by `fuse`.
    done(&[&classify[..], &windows, &["--out", text(&out)]].concat());
    let fuse = ["fuse", "--out", "-", "--predictions", text(&out), "--vote", "majority"];
    let fused = done(&fuse);
    assert_eq!(fused.lines().next(), Some("id,path,status,predicted,p_noise,p_tone"));
    assert_eq!(rows(&fused), [["ok", "tone", "0.2", "0.8"], ["ok", "noise", "0.75", "0.25"]]);
    let fused = done(&[&fuse[..], &["--background", "tone", "--least", "1"]].concat());
    assert_eq!(rows(&fused)[0][1], "noise");
}

/// A vote over what is left of a recording is told from one over all of it.
#[test]
fn failed_windows_of_a_vote_are_said() {
    let trained = Trained::new(&["--classifier", "knn", "--set", "k=1"]);
    let (model, wav) = (trained.path("m"), trained.path("nan.wav"));
    let spec = hound::WavSpec {
        channels: 1,
        sample_rate: RATE as u32,
        bits_per_sample: 32,
        sample_format: hound::SampleFormat::Float,
    };
    let mut writer = hound::WavWriter::create(&wav, spec).unwrap();
    let samples = [0, 0, 0, 1].into_iter().flat_map(second);
    for (i, sample) in samples.enumerate() {
        let value = if i == RATE + 5 { f32::NAN } else { f32::from(sample) / 32768.0 };
        writer.write_sample(value).unwrap();
    }
    writer.finalize().unwrap();
    let windows = ["--window", "1", "--hop", "1", "--vote", "majority"];
    let classify = ["classify", "--model", text(&model), "--in", text(&wav)];
    let output = run(&[&classify[..], &windows].concat());
    assert_eq!(output.status.code(), Some(1));
    let table = String::from_utf8(output.stdout).unwrap();
    let line: Vec<_> = table.lines().nth(1).unwrap().split(',').skip(2).collect();
    assert_eq!(line[..3], ["non_finite", "3", "tone"], "{table}");
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(message.contains("1 window failed, the first: NaN"), "{message}");
}
