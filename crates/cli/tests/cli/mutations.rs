//! Mutated files of every kind but audio (which its own crate mutates) must end in an answer or an
//! error, never in a panic. `CORSMAL_MUTATIONS=100000 cargo test --test cli mutated` runs longer;
//! `fuzz/` looks for more, guided by what the code does.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use corsmal_ccm::capacity::{self, CapacityModel};
use corsmal_ccm::dataset::{Annotations, read_actions};
use corsmal_ccm::predictions::{self, read_capacities};
use corsmal_ccm::submission::Submission;
use corsmal_compare::{Criteria, compare};
use corsmal_extract::config::Config;
use corsmal_extract::engine::Signals;
use corsmal_extract::inputs;
use corsmal_extract::projection::Projection;
use corsmal_files::feature_file::FeatureFile;
use corsmal_files::npz::{Compression, NpzWriter};
use corsmal_models::dataset::{LabelFile, LabelledTable, MemberNames};
use corsmal_models::predictions::PredictionTable;
use corsmal_vision::{Calibration, Depth, Mask, Rgb, read_detections};

/// splitmix64: a deterministic sequence of numbers.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() % n.max(1) as u64) as usize
    }

    fn of<'a, T: ?Sized>(&mut self, all: &[&'a T]) -> &'a T {
        all[self.below(all.len())]
    }
}

/// What readers of text trip over.
const WORDS: [&[u8]; 18] = [
    b"-1",
    b"0",
    b"1e308",
    b"1e-320",
    b"NaN",
    b"inf",
    b"18446744073709551616",
    b"0x10",
    b"",
    b"\"",
    b",",
    b"\n",
    b"\r\n",
    b"{",
    b"}]",
    b"null",
    "\u{feff}\u{202e}ß".as_bytes(),
    b"\xff\xfe\0",
];

/// Changes a few places: bits, bytes, lengths, words, stretches left out or doubled.
fn mutate(bytes: &mut Vec<u8>, random: &mut Random) {
    for _ in 0..=random.below(4) {
        let at = random.below(bytes.len());
        let end = (at + random.below(24)).min(bytes.len());
        match random.below(8) {
            _ if bytes.is_empty() => bytes.extend(random.of(&WORDS)),
            0 => bytes[at] ^= 1 << random.below(8),
            1 => bytes[at] = random.next() as u8,
            2 => bytes.truncate(at),
            3 => drop(bytes.drain(at..end)),
            4 => {
                let piece = bytes[at..end].to_vec();
                let to = random.below(bytes.len());
                bytes.splice(to..to, piece);
            }
            5 => {
                let field =
                    [0, 1, 0x7fff_ffff, 0x8000_0000, u32::MAX, 0x0fff_ffff][random.below(6)];
                for (to, from) in bytes[at..].iter_mut().zip(field.to_le_bytes()) {
                    *to = from;
                }
            }
            6 => {
                // A word in place of a number.
                let digits = |b: &u8| b.is_ascii_digit() || b".-+e".contains(b);
                let from = bytes[at..].iter().position(digits).map_or(at, |skip| at + skip);
                let length = bytes[from..].iter().take_while(|b| digits(b)).count();
                bytes.splice(from..from + length, random.of(&WORDS).iter().copied());
            }
            _ => drop(bytes.splice(at..at, random.of(&WORDS).iter().copied())),
        }
    }
}

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn file(&self, name: &str, bytes: &[u8]) -> PathBuf {
        let path = self.0.path().join(name);
        // A file that is cut and written anew would wait for the disk.
        let _ = fs::remove_file(&path);
        fs::write(&path, bytes).unwrap();
        path
    }
}

/// Hands mutations of the seeds to `read`; some must be read and some refused, or the test tries
/// nothing. On a panic, the bytes are said.
#[track_caller]
fn mutated(seeds: &[Vec<u8>], mut read: impl FnMut(&[u8]) -> bool) {
    let count = std::env::var("CORSMAL_MUTATIONS").ok().and_then(|n| n.parse().ok());
    let (mut random, mut read_well, mut refused) = (Random(1), 0, 0);
    for seed in seeds {
        assert!(read(seed), "a seed is refused: {}", String::from_utf8_lossy(seed));
    }
    for _ in 0..count.unwrap_or(1500) {
        let mut bytes = seeds[random.below(seeds.len())].clone();
        mutate(&mut bytes, &mut random);
        let done = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| read(&bytes)));
        match done {
            Ok(true) => read_well += 1,
            Ok(false) => refused += 1,
            Err(_) => panic!("a panic on {}", bytes.escape_ascii()),
        }
    }
    assert!(read_well > 0 && refused > 0, "{read_well} read, {refused} refused");
}

fn texts(all: &[&str]) -> Vec<Vec<u8>> {
    all.iter().map(|text| text.as_bytes().to_vec()).collect()
}

/// A feature file: a table of 6 rows, and frames where there is a name for them.
fn features(path: &Path, frames: bool) -> Vec<u8> {
    let mut writer = NpzWriter::create(path, Compression::Stored).unwrap();
    let values: Vec<f32> = (0..12).map(|i| i as f32 / 7.0).collect();
    writer.floats("X", &[6, 2], &values).unwrap();
    writer.strings("y", &["a", "b", "a", "b", "a", "b"].map(String::from)).unwrap();
    if frames {
        writer.floats("r/mfcc", &[1, 3, 4], &values).unwrap();
    }
    writer.finish().unwrap();
    fs::read(path).unwrap()
}

#[test]
fn mutated_manifests_and_labels() {
    let folder = Folder::new();
    folder.file("a.wav", b"RIFF");
    let csv = "path,id,y,start,end\na.wav,1,a,0,0.1\na.wav,2,\"b,c\",0.1,\n";
    mutated(&texts(&[csv, "path\na.wav\n"]), |bytes| {
        let path = folder.file("list.csv", bytes);
        let _ = LabelFile::read(&path, None);
        inputs::collect(&[&path]).is_ok()
    });
    let lines =
        "{\"path\": \"a.wav\", \"id\": \"1\", \"y\": 1}\n{\"path\": \"a.wav\", \"end\": 0.5}\n";
    mutated(&texts(&[lines]), |bytes| inputs::collect(&[folder.file("list.jsonl", bytes)]).is_ok());
}

#[test]
fn mutated_archives() {
    let folder = Folder::new();
    let mut tar = tar::Builder::new(Vec::new());
    for (name, content) in [("r0.wav", &b"RIFF"[..]), ("r0.json", b"{\"y\": 1}"), ("r0.cls", b"3")]
    {
        let mut header = tar::Header::new_gnu();
        header.set_size(content.len() as u64);
        header.set_mode(0o644);
        header.set_cksum();
        tar.append_data(&mut header, name, content).unwrap();
    }
    mutated(&[tar.into_inner().unwrap()], |bytes| {
        inputs::collect(&[folder.file("list.tar", bytes)]).is_ok()
    });
}

#[test]
fn mutated_configurations() {
    let toml = "[signal]\nsample_rate = 8000\n[features.mfcc]\nn_mfcc = 13\nn_fft = 256\n\
                [features.zero_crossing_rate]\n[summary]\nstats = [\"mean\", \"std\"]\n";
    let noise: Vec<f32> = (0..800_u32).map(|i| (i * i % 997) as f32 / 997.0 - 0.5).collect();
    mutated(&texts(&[toml]), |bytes| {
        let Ok(text) = std::str::from_utf8(bytes) else { return false };
        let Ok(config) = Config::with_overrides(text, "test", &[]) else { return false };
        let again = Config::from_value(config.to_value()).unwrap();
        assert_eq!(again.hash(), config.hash());
        if let Ok(mut signal) = Signals::new(Arc::new(config)).start(16_000, 1)
            && signal.push(&noise).is_ok()
        {
            let _ = signal.finish();
        }
        true
    });
}

#[test]
fn mutated_tables_of_the_benchmark() {
    let folder = Folder::new();
    let header = "id,container id,scenario,background,illumination,width at the top,width at the bottom,\
                  height,depth,container capacity,container mass,filling type,filling level,\
                  filling density,filling mass,object mass,handover starting frame\n";
    let row = "0,1,0,0,0,69.8,60,130,0,185,2,1,1,0.41,37,39,200\n";
    mutated(&texts(&[&format!("{header}{row}")]), |bytes| {
        Annotations::read(&folder.file("a.csv", bytes)).is_ok()
    });
    let old = "Container ID,Sequence,Filling type,Filling level,Container Capacity\n1,0,1,2,300\n";
    mutated(&texts(&[old]), |bytes| Submission::read(&folder.file("s.csv", bytes)).is_ok());
    mutated(&texts(&["fileName,capacity[mL]\nid10_0000.png,300.5\n"]), |bytes| {
        let path = folder.file("c.csv", bytes);
        let _ = (read_actions(&path), capacity::read(&path), CapacityModel::read(&path));
        read_capacities(&path).is_ok()
    });
    let votes = "Object,Sequence,p0,p1\n10,s0_fi1_fu1_b0_l0,1,0\n1,s0_fi1_fu1_b0_l0,0.5,0.5\n";
    mutated(&texts(&[votes]), |bytes| predictions::read(&folder.file("p.csv", bytes)).is_ok());
    let table = "id,true,predicted,p_rice,p_water\na,rice,rice,0.9,0.1\nb,water,rice,0.6,0.4\n";
    mutated(&texts(&[table]), |bytes| {
        PredictionTable::parse(bytes, Path::new("predictions.csv")).is_ok()
    });
}

#[test]
fn mutated_views() {
    let folder = Folder::new();
    let camera = "{\"intrinsic\": {\"rgb\": [[920, 0, 640], [0, 920, 360], [0, 0, 1]]}, \
                  \"extrinsic\": {\"rgb\": {\"rvec\": [0.1, 0.2, 0.3], \"tvec\": [[0], [0], [1]]}}}";
    let pickle = pickled_camera();
    mutated(&texts(&[camera, &pickle]), |bytes| {
        Calibration::parse(bytes, Path::new("calibration")).is_ok()
    });
    let boxes = "[{\"frame\": 0, \"view\": 1, \"label\": 47, \"score\": 0.9, \"box\": [1, 2, 30, 40], \
                 \"mask\": {\"size\": [48, 64], \"counts\": [100, 20, 2952]}}]";
    let table = "frame,view,label,score,x_min,y_min,x_max,y_max,mask\n0,1,cup,0.9,1,2,30,40,\n";
    for (name, text) in [("d.json", boxes), ("d.csv", table)] {
        mutated(&texts(&[text]), |bytes| {
            let Ok(found) = read_detections(&folder.file(name, bytes)) else { return false };
            for detection in found {
                let _ = detection.mask(Some((64, 48)));
            }
            true
        });
    }
    let mut png = Vec::new();
    depth_png(&mut png);
    mutated(&[png], |bytes| {
        let path = folder.file("0000.png", bytes);
        let _ = (Rgb::read(&path), Mask::read(&path));
        Depth::read(&path).is_ok()
    });
}

/// A list of the intrinsic and the extrinsic part, as Python 2 pickles it with protocol 0.
fn pickled_camera() -> String {
    let array = |rows: usize, values: &[f64]| {
        let columns = values.len() / rows;
        let bytes = values.iter().flat_map(|value| value.to_le_bytes());
        let text: String = bytes.map(|byte| format!("\\x{byte:02x}")).collect();
        format!(
            "cnumpy.core.multiarray\n_reconstruct\n(cnumpy\nndarray\n(I0\ntS'b'\ntR(I1\n(I{rows}\n\
             I{columns}\ntcnumpy\ndtype\n(S'f8'\nI0\nI1\ntR(I3\nS'<'\nNNNI-1\nI-1\nI0\ntbI00\n\
             S'{text}'\ntb"
        )
    };
    let matrix = array(3, &[920.0, 0.0, 640.0, 0.0, 920.0, 360.0, 0.0, 0.0, 1.0]);
    let (turn, shift) = (array(3, &[0.1, 0.2, 0.3]), array(3, &[0.0, 0.0, 1.0]));
    format!("(l(dS'rgb'\n{matrix}sa(dS'rgb'\n(dS'rvec'\n{turn}sS'tvec'\n{shift}ssa.")
}

/// A grey image of 8 by 4 pixels of 16 bits, stored without compression.
fn depth_png(out: &mut Vec<u8>) {
    let rows: Vec<u8> =
        (0..4_u8).flat_map(|y| [0].into_iter().chain((0..16).map(move |x| x * y))).collect();
    let mut zlib = vec![0x78, 0x01, 0x01];
    zlib.extend((rows.len() as u16).to_le_bytes());
    zlib.extend((!(rows.len() as u16)).to_le_bytes());
    zlib.extend(&rows);
    let (a, b) = rows.iter().fold((1_u32, 0_u32), |(a, b), byte| {
        let a = (a + u32::from(*byte)) % 65_521;
        (a, (a + b) % 65_521)
    });
    zlib.extend((b << 16 | a).to_be_bytes());
    out.extend(b"\x89PNG\r\n\x1a\n");
    let head = [0, 0, 0, 8, 0, 0, 0, 4, 16, 0, 0, 0, 0];
    for (kind, content) in [(b"IHDR", &head[..]), (b"IDAT", &zlib), (b"IEND", &[])] {
        out.extend((content.len() as u32).to_be_bytes());
        let start = out.len();
        out.extend(kind);
        out.extend(content);
        let check = crc32(&out[start..]);
        out.extend(check.to_be_bytes());
    }
}

fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(u32::MAX, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| {
            (crc >> 1) ^ (0xedb8_8320 & (crc & 1).wrapping_neg())
        })
    })
}

#[test]
fn mutated_feature_files() {
    let folder = Folder::new();
    let seeds = [
        features(&folder.0.path().join("table.npz"), false),
        features(&folder.0.path().join("frames.npz"), true),
    ];
    let other = folder.file("other.npz", &seeds[1]);
    mutated(&seeds, |bytes| {
        let path = folder.file("features.npz", bytes);
        let _ = (Projection::load(&path), FeatureFile::open(&path).map(|mut file| file.table()));
        let _ = compare(&path, &other, &Criteria::default());
        LabelledTable::read(&path, &MemberNames::default()).is_ok()
    });
}

#[cfg(feature = "nets")]
#[test]
fn mutated_weights() {
    let folder = Folder::new();
    let header = r#"{"a.weight":{"dtype":"F32","shape":[2,3],"data_offsets":[0,24]}}"#;
    let mut weights = (header.len() as u64).to_le_bytes().to_vec();
    weights.extend(header.as_bytes());
    weights.extend([0; 24]);
    mutated(&[weights], |bytes| {
        let path = folder.file("weights.safetensors", bytes);
        let _ = corsmal_nets::model::NetModel::load(&path);
        let _ = corsmal_nets::capacity::CapacityNetwork::read(&path);
        corsmal_nets::weights::read(&path).is_ok()
    });
}
