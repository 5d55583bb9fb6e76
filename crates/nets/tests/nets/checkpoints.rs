//! Trainings that were stopped.

use corsmal_nets::NetError;
use corsmal_nets::fit::{Task, fit};
use corsmal_nets::networks;
use serde_json::json;

use crate::training::{accuracy, recipe, vectors};

#[test]
fn a_training_that_was_stopped_goes_on_to_the_same_bytes() {
    let (items, classes) = vectors(9);
    let recipe = recipe(json!({
        "epochs": 4, "batch": 4, "lr": 1e-4, "select": "validation", "schedule": "cosine"
    }));
    let (train, watched): (Vec<usize>, Vec<usize>) = ((0..6).collect(), (6..9).collect());
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("training.safetensors");
    let task = Task { items: &items, classes: &classes, train: &train, watched: &watched };
    let go = |task: Task<'_>, path: Option<&std::path::Path>, until: usize| {
        let mut network = networks::named("m3_mlp").unwrap().build(None, 0).unwrap();
        let result = fit(&mut network, task, &recipe, path, accuracy, |p| p.epochs.len() < until);
        let all = network.parameters().iter().flat_map(|(_, v)| v.to_vec()).collect::<Vec<f32>>();
        result.map(|history| (history, all))
    };
    let undisturbed = go(task, None, 9).unwrap();
    assert!(matches!(go(task, Some(&path), 1), Err(NetError::Stopped { epochs: 1 })));
    assert!(matches!(go(task, Some(&path), 3), Err(NetError::Stopped { epochs: 3 })));
    assert!(go(task, Some(&path), 9).unwrap() == undisturbed);

    // One bit: it ended in another network, without a word.
    let sound = std::fs::read(&path).unwrap();
    let mut damaged = sound.clone();
    damaged[sound.len() / 4 * 2] ^= 1;
    std::fs::write(&path, &damaged).unwrap();
    let text = go(task, Some(&path), 9).unwrap_err().to_string();
    assert!(text.contains("the checkpoint is damaged"), "{text}");
    let text = String::from_utf8_lossy(&sound[8..4000]);
    let place = |key: &str| text.find(&format!("\\\"{key}\\\":")).unwrap() + 10;
    let (steps, hash) = (place("steps"), place("hash"));
    let change = |at: usize, word: &[u8]| {
        let mut changed = sound.clone();
        changed[at..at + word.len()].copy_from_slice(word);
        std::fs::write(&path, &changed).unwrap();
        go(task, Some(&path), 9).unwrap_err().to_string()
    };
    let text = change(steps + 8, b"9");
    assert!(text.contains("the checkpoint is damaged"), "{text}");
    let text = change(hash, b"cash");
    assert!(text.contains("unknown field `cash`"), "{text}");
    // More steps than there can be, or more epochs, panicked.
    let header = 8 + u64::from_le_bytes(sound[..8].try_into().unwrap()) as usize;
    let epoch = r#"{\"loss\":1,\"score\":1}"#;
    for (from, to) in [
        (r#"\"steps\":"#, r#"\"steps\":99999999999999999"#.to_string()),
        (r#"\"epochs\":["#, format!(r#"\"epochs\":[{epoch},"#)),
    ] {
        let text = std::str::from_utf8(&sound[8..header]).unwrap().replacen(from, &to, 1);
        let length = (text.len() as u64).to_le_bytes();
        std::fs::write(&path, [&length[..], text.as_bytes(), &sound[header..]].concat()).unwrap();
        let text = go(task, Some(&path), 9).unwrap_err().to_string();
        assert!(text.contains("of 4 epochs and") && text.contains("cannot be"), "{text}");
    }
    std::fs::write(&path, &sound).unwrap();

    let other = Task { train: &train[..5], ..task };
    let text = go(other, Some(&path), 9).unwrap_err().to_string();
    assert!(text.contains("training.safetensors") && text.contains("another training"), "{text}");
}
