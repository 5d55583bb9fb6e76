//! Weights on disk: what is written comes back, what is hostile is refused.

use std::io::Write;
use std::path::Path;

use corsmal_nets::weights::{self, State};
use corsmal_nets::{NetError, networks};

fn state() -> State {
    let network = networks::named("m4_level").unwrap().build(None, 1).unwrap();
    let all = network.parameters().iter();
    all.map(|(d, v)| (d.name.clone(), d.shape.clone(), v.to_vec())).collect()
}

#[test]
fn npz_and_safetensors_give_back_every_bit() {
    let folder = tempfile::tempdir().unwrap();
    let mut state = state();
    for name in ["w.npz", "w.safetensors"] {
        let path = folder.path().join(name);
        weights::write(&path, &state).unwrap();
        let mut back = weights::read(&path).unwrap();
        back.sort_by(|a, b| a.0.cmp(&b.0));
        state.sort_by(|a, b| a.0.cmp(&b.0));
        assert!(back == state, "{name}");
    }
}

#[test]
fn weights_of_another_architecture_are_named() {
    let mut network = networks::named("m5_vggish_level").unwrap().build(None, 0).unwrap();
    let before = network.parameters().iter().next().unwrap().1.to_vec();
    let mut other = state();
    other.push(("fc.bias2".into(), vec![1], vec![0.0]));
    let NetError::Weights { differences, .. } = network.load_state(&other).unwrap_err() else {
        panic!("refused as weights");
    };
    let text = differences.join("\n");
    for expected in [
        "lstm.weight_ih_l0 [1024, 1024] is not one of its parameters",
        "rnn.weight_ih_l4 [1536, 512] is missing",
        "fc.weight is [3, 256], expected [3, 512]",
        "fc.bias2",
    ] {
        assert!(text.contains(expected), "{expected}\n{text}");
    }
    assert_eq!(network.parameters().iter().next().unwrap().1, before);
}

/// A `.pth` as `torch.save(state_dict)` writes it, of one tensor `w` of shape `[2, 3]`.
fn pth(path: &Path, pickle: &[u8], numbers: &[u8]) {
    let mut zip = zip::ZipWriter::new(std::fs::File::create(path).unwrap());
    let options =
        zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
    for (name, bytes) in [("net/data.pkl", pickle), ("net/data/0", numbers)] {
        zip.start_file(name, options).unwrap();
        zip.write_all(bytes).unwrap();
    }
    zip.finish().unwrap();
}

/// Protocol 2: an ordered dictionary with one tensor of these sizes and strides.
fn pickle(shape: [u8; 2], strides: [u8; 2], len: u8) -> Vec<u8> {
    let mut p = b"\x80\x02ccollections\nOrderedDict\nq\x00)Rq\x01(X\x01\x00\x00\x00w".to_vec();
    p.extend(b"ctorch._utils\n_rebuild_tensor_v2\nq\x02((X\x07\x00\x00\x00storagectorch\n");
    p.extend(b"FloatStorage\nX\x01\x00\x00\x000X\x03\x00\x00\x00cpuK");
    p.push(len);
    p.extend(b"tQK\x00");
    p.extend([b'K', shape[0], b'K', shape[1], 0x86, b'K', strides[0], b'K', strides[1], 0x86]);
    p.extend(b"\x89h\x00)RtRu.");
    p
}

fn six() -> Vec<u8> {
    (0..6u8).flat_map(|v| f32::from(v).to_le_bytes()).collect()
}

#[test]
fn a_state_dict_of_pytorch_is_read_without_running_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("net.pth");
    pth(&path, &pickle([2, 3], [3, 1], 6), &six());
    let expected = ("w".to_owned(), vec![2, 3], vec![0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
    assert_eq!(weights::read(&path).unwrap(), [expected]);
    // A transposed view of the same numbers.
    pth(&path, &pickle([2, 3], [1, 2], 6), &six());
    assert_eq!(weights::read(&path).unwrap()[0].2, [0.0, 2.0, 4.0, 1.0, 3.0, 5.0]);
    // `expand`: three numbers, each row the same.
    pth(&path, &pickle([2, 3], [0, 1], 3), &six()[..12]);
    assert_eq!(weights::read(&path).unwrap()[0].2, [0.0, 1.0, 2.0, 0.0, 1.0, 2.0]);
}

/// `torch._neg_view`: the numbers are stored without the sign.
#[test]
fn numbers_to_be_negated_are_not_read_as_they_stand() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("net.pth");
    let mut negated = pickle([2, 3], [3, 1], 6);
    let end = negated.len() - b"tRu.".len();
    negated.splice(end..end, *b"}X\x03\x00\x00\x00neg\x88s");
    pth(&path, &negated, &six());
    let said = weights::read(&path).unwrap_err().to_string();
    assert!(said.contains("net.pth") && said.contains("resolve_neg"), "{said}");
}

#[test]
fn hostile_pickles_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("net.pth");
    let refuse = |pickle: &[u8], numbers: &[u8], expected: &str| {
        pth(&path, pickle, numbers);
        let text = weights::read(&path).unwrap_err().to_string();
        assert!(text.contains(expected) && text.contains("net.pth"), "{text}");
    };
    refuse(b"\x80\x02cposix\nsystem\nX\x04\x00\x00\x00ls -\x85R.", &six(), "posix.system");
    refuse(&pickle([200, 200], [200, 1], 6), &six(), "larger than the file");
    refuse(&pickle([2, 3], [9, 1], 6), &six(), "beyond its numbers");
    refuse(&pickle([2, 3], [3, 1], 6), &six()[..20], "5 numbers of 6");
    refuse(&pickle([2, 3], [3, 1], 6)[..40], &six(), "ends");
    refuse(b"\x80\x02]q\x00(h\x00e.", &six(), "not hold a dictionary");
    // Nesting, which dropping would follow down until the stack ends.
    let nested = |begin: &[u8], deeper: &[u8], times: usize, end: &[u8]| {
        [b"\x80\x02", begin, &deeper.repeat(times), end, b"."].concat()
    };
    let key = b"X\x05\x00\x00\x00model";
    refuse(&nested(b")", b"\x85", 200_000, b""), &six(), "too deep");
    refuse(&nested(b")", b"(K\x00t\x85", 1, b"\x85".repeat(50).as_slice()), &six(), "too deep");
    refuse(&nested(b"", b"]", 50_000, &b"a".repeat(49_999)), &six(), "too deep");
    let dicts = [b"}", &key[..]].concat();
    refuse(
        &nested(b"", &dicts, 50_000, &[b"}", &b"s".repeat(50_000)[..]].concat()),
        &six(),
        "deep",
    );
    // Values and texts that a few bytes recall again and again, and lists of any length.
    let long = [b"X\x00\x00\x10\x00", &[b'w'; 1 << 20][..], b"q\x00"].concat();
    refuse(&nested(&long, b"h\x00", 1000, b""), &six(), "too many values");
    let million = [b"(", &b"N".repeat(1_000_000)[..], b"e"].concat();
    refuse(&nested(b"]", &million, 4, b""), &six(), "too many values");
    // 2^61 numbers of eight bytes.
    let mut huge = b"\x80\x02}X\x01\x00\x00\x00wctorch._utils\n_rebuild_tensor_v2\n".to_vec();
    huge.extend(b"((X\x07\x00\x00\x00storagectorch\nDoubleStorage\nX\x01\x00\x00\x000");
    huge.extend(
        b"X\x03\x00\x00\x00cpuK\x06tQK\x00\x8a\x08\0\0\0\0\0\0\0\x20\x85K\x01\x85\x89}tRs.",
    );
    refuse(&huge, &six(), "larger than the file");
    // Each recall doubles the list: 2^40 values from a few hundred bytes.
    let mut bomb = b"\x80\x02]q\x00K\x01a".to_vec();
    for _ in 0..40 {
        bomb.extend(b"q\x00(h\x00h\x00l");
    }
    bomb.push(b'.');
    pth(&path, &bomb, &six());
    assert!(weights::read(&path).is_err());
    std::fs::write(&path, b"\x80\x02K\x01.").unwrap();
    let text = weights::read(&path).unwrap_err().to_string();
    assert!(text.contains("since PyTorch 1.6"), "{text}");
}

#[test]
fn damaged_files_are_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("w.safetensors");
    weights::write(&path, &state()).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    for cut in [4, 100, bytes.len() - 1] {
        std::fs::write(&path, &bytes[..cut]).unwrap();
        let text = weights::read(&path).unwrap_err().to_string();
        assert!(text.contains("w.safetensors"), "{text}");
    }
    let other = folder.path().join("w.bin");
    std::fs::write(&other, b"").unwrap();
    assert!(weights::read(&other).unwrap_err().to_string().contains(".safetensors"));
}

#[test]
fn content_says_what_weights_are_and_not_their_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    weights::write(&path("a.npz"), &state()).unwrap();
    weights::write(&path("a.safetensors"), &state()).unwrap();
    std::fs::rename(path("a.npz"), path("b.pth")).unwrap();
    std::fs::rename(path("a.safetensors"), path("b.npz")).unwrap();
    let sorted = |name: &str| {
        let mut read = weights::read(&path(name)).unwrap();
        read.sort_by(|a, b| a.0.cmp(&b.0));
        read
    };
    assert_eq!(sorted("b.pth"), sorted("b.npz"));
    let error = weights::write(&path("b.bin"), &state()).unwrap_err().to_string();
    assert!(error.contains("must end in .npz or .safetensors"), "{error}");
}
