//! Capacities from synthetic views, and what damaged or missing files become.

#![allow(clippy::unwrap_used)]

mod gaps;
mod published;
mod refused;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use corsmal_ccm::capacity::{
    self, CapacityModel, CapacityOptions, Method, Problem, RegionNetwork, Row, Views,
};
use corsmal_ccm::dataset::{
    Container, DataSet, Filling, FillingLevel, FillingType, SequenceName, Subset,
};
use corsmal_ccm::predictions::{Named, read_capacities};
use corsmal_ccm::submission::RowKey;
use corsmal_ccm::synth::write_views;
use corsmal_vision::cuboid::Outliers;
use corsmal_vision::lode::{PRIOR_ML, Variant};
use corsmal_vision::region::Region;
use corsmal_vision::{Depth, Mask};

/// Two recordings of each training container, on the table and in the hand, with views.
fn data(dir: &Path) {
    for container in Container::all().take(9) {
        for scenario in [0, 1] {
            let (base, name) = recording(dir, container, scenario);
            write_views(&base, &name.to_string(), container, name, 5).unwrap();
        }
    }
}

/// A recording without views: its folder and name.
fn recording(dir: &Path, container: Container, scenario: u8) -> (PathBuf, SequenceName) {
    let filling = Filling::new(FillingType::Pasta, FillingLevel::Half).unwrap();
    let name = SequenceName { scenario, filling, background: 0, illumination: 0 };
    let base = dir.join(format!("train/{}", container.number()));
    std::fs::create_dir_all(base.join("audio")).unwrap();
    std::fs::write(base.join(format!("audio/{name}_audio.wav")), b"").unwrap();
    (base, name)
}

/// A network that takes the region's height for the capacity.
#[derive(Debug)]
struct Height(f64);

impl RegionNetwork for Height {
    fn capacity_ml(&self, region: &Region) -> Result<f64, String> {
        assert_eq!(region.image.len(), 112 * 112);
        Ok(f64::from(region.size[0]) * self.0)
    }

    fn identity(&self) -> &str {
        "height"
    }
}

fn options(dir: &Path, method: Method) -> CapacityOptions {
    CapacityOptions {
        data: dir.into(),
        detections: None,
        method,
        variant: Variant::Corrected,
        outliers: Outliers::Published,
        model: None,
        network: None,
        jobs: 2,
        seed: 1,
    }
}

fn run(options: &CapacityOptions) -> Vec<Row> {
    capacity::run(options, &|_, _| {}, &AtomicBool::new(false)).unwrap()
}

/// Mean of exp(-relative error) by category and overall.
fn score(rows: &[Row]) -> [f64; 4] {
    let of = |category: Option<usize>| {
        let scores: Vec<f64> = rows
            .iter()
            .filter_map(|row| {
                let RowKey::Sequence(container, _) = row.key else { return None };
                let kind = usize::from((container - 1) / 3);
                category.is_none_or(|c| c == kind).then_some(())?;
                let truth = Container::new(container)?.capacity_ml()?;
                let estimate = row.capacity();
                let relative = (estimate - truth).abs() / truth;
                Some(if estimate < 0.0 { 0.0 } else { (-relative).exp() })
            })
            .collect();
        scores.iter().sum::<f64>() / scores.len() as f64
    };
    [of(Some(0)), of(Some(1)), of(Some(2)), of(None)]
}

#[test]
fn methods_measure_synthetic_views_and_faults_are_rows() {
    let dir = tempfile::tempdir().unwrap();
    let root = dir.path();
    data(root);
    let mut scores = Vec::new();
    for method in [Method::M5, Method::M4] {
        let rows = run(&options(root, method));
        assert_eq!(rows.len(), 18);
        scores.push((method.name(), score(&rows)));
    }
    let published = CapacityOptions { variant: Variant::Published, ..options(root, Method::M5) };
    scores.push(("m5 published", score(&run(&published))));
    for outliers in [Outliers::Corrected, Outliers::Kept] {
        let rows = run(&CapacityOptions { outliers, ..options(root, Method::M4) });
        scores.push(("m4 other", score(&rows)));
    }
    let stop = AtomicBool::new(false);
    for method in [Method::M3, Method::Fused] {
        let learned = capacity::train(&options(root, method), &|_, _| {}, &stop).unwrap();
        println!("{:.3?}", learned.held_out);
        assert_eq!((learned.recordings, learned.failed), (18, vec![]));
        let learned = learned.model;
        let path = root.join("model.json");
        learned.write(&path).unwrap();
        let model = CapacityModel::read(&path).unwrap();
        assert_eq!(model, learned);
        if let Some(fusion) = &model.fusion {
            for (category, of) in &fusion.methods {
                println!("{category:?} {of:?} {:?}", fusion.priors[category]);
            }
        }
        let rows = run(&CapacityOptions { model: Some(model), ..options(root, method) });
        for row in &rows {
            let (low, high) = row.estimate.as_ref().unwrap().band.map(|b| (b[0], b[1])).unwrap();
            assert!(low < row.capacity() && row.capacity() < high, "{row:?}");
        }
        scores.push((method.name(), score(&rows)));
    }
    for (name, score) in &scores {
        println!("{name}: {score:.3?}");
    }
    let error = capacity::run(&options(root, Method::M3), &|_, _| {}, &stop).unwrap_err();
    assert!(error.to_string().contains("capacity train --method m3"), "{error}");
    let error = capacity::run(&options(root, Method::M2), &|_, _| {}, &stop).unwrap_err();
    assert!(error.to_string().contains("needs its network"), "{error}");
    refused::impossible_models_are_refused(&root.join("model.json"));
    let m2 = |scale, variant| {
        let network: Arc<dyn RegionNetwork> = Arc::new(Height(scale));
        run(&CapacityOptions { network: Some(network), variant, ..options(root, Method::M2) })
    };
    let regions = m2(1000.0, Variant::Corrected);
    let found = regions.iter().filter(|row| row.status() == "ok" && row.capacity() > 100.0);
    assert!(found.count() >= 16, "{regions:?}");
    assert!(m2(-1.0, Variant::Corrected).iter().all(|row| row.status() == "none"));

    // One file of each kind is damaged or gone.
    let path = |c: u8, file: &str| root.join(format!("train/{c}/{file}"));
    let name = "s0_fi1_fu1_b0_l0";
    std::fs::write(path(1, &format!("calib/{name}_c1_calib.pickle")), b"cos\nsystem\n.").unwrap();
    std::fs::remove_file(path(2, &format!("calib/{name}_c2_calib.pickle"))).unwrap();
    std::fs::write(path(3, &format!("detections/{name}.json")), b"[{").unwrap();
    std::fs::remove_file(path(4, &format!("detections/{name}.json"))).unwrap();
    for frame in ["0000", "0008"] {
        let depth = path(5, &format!("depth/{name}/c1/{frame}.png"));
        let half = std::fs::read(&depth).unwrap();
        std::fs::write(&depth, &half[..half.len() / 2]).unwrap();
    }
    let status = |rows: &[Row], container: u8| {
        let row = rows
            .iter()
            .find(|r| matches!(r.key, RowKey::Sequence(c, s) if c == container && s < 7));
        let row = row.unwrap();
        (row.status(), row.capacity())
    };
    // The last image of the third view shows nothing: the one before is taken, unless as published, where the
    // first of a short video is never looked at.
    let black = Depth { width: 1280, height: 720, data: vec![0; 1280 * 720] }.to_png().unwrap();
    std::fs::write(path(6, &format!("depth/{name}/c3/0008.png")), &black).unwrap();
    assert_eq!(status(&m2(1000.0, Variant::Corrected), 6).0, "ok");
    assert_eq!(status(&m2(1000.0, Variant::Published), 6), ("none", -1.0));
    // A mask of half the size.
    let half = |shown: bool| Mask { width: 640, height: 360, data: vec![shown; 640 * 360] };
    std::fs::create_dir_all(path(7, &format!("masks/{name}/c1"))).unwrap();
    let masks = path(7, &format!("masks/{name}/c1/0000.png"));
    std::fs::write(masks, half(true).to_png().unwrap()).unwrap();
    let m5 = run(&options(root, Method::M5));
    assert_eq!(status(&m5, 7), ("failed", -1.0));
    let reason = |rows: &[Row], container: u8| {
        let of = |r: &&Row| matches!(r.key, RowKey::Sequence(c, s) if c == container && s < 7);
        match &rows.iter().find(of).unwrap().estimate {
            Err(Problem::Damaged(reason)) => reason.clone(),
            other => panic!("{other:?}"),
        }
    };
    assert!(reason(&m5, 7).contains("0000.png: 640 by 360 px"), "{}", reason(&m5, 7));
    assert_eq!(status(&m5, 1), ("failed", -1.0));
    assert_eq!(status(&m5, 2), ("none", -1.0));
    assert_eq!(status(&m5, 3), ("failed", -1.0));
    assert_eq!(status(&m5, 4), ("prior", PRIOR_ML));
    let m4 = run(&options(root, Method::M4));
    assert_eq!(status(&m4, 5), ("failed", -1.0));
    let small = Depth { width: 640, height: 360, data: vec![500; 640 * 360] }.to_png().unwrap();
    for frame in ["0000", "0008"] {
        std::fs::write(path(5, &format!("depth/{name}/c1/{frame}.png")), &small).unwrap();
    }
    let halved = run(&options(root, Method::M4));
    assert!(reason(&halved, 5).contains(".png: 640 by 360 px"), "{}", reason(&halved, 5));
    // What is damaged teaches nothing, and is named.
    let learned = capacity::train(&options(root, Method::Fused), &|_, _| {}, &stop).unwrap();
    let failed: Vec<u8> = learned
        .failed
        .iter()
        .map(|(key, _)| match key {
            RowKey::Sequence(container, _) => *container,
            RowKey::Id(_) => 0,
        })
        .collect();
    assert_eq!((learned.recordings, &failed[..]), (18, &[1, 3, 5, 7][..]));
    assert!(learned.failed[0].1.contains("c1_calib.pickle"), "{:?}", learned.failed);
    let out = root.join("capacity.csv");
    let made = options(root, Method::M4);
    capacity::write(&out, &made, &m4).unwrap();
    let mut table = csv::Reader::from_path(&out).unwrap();
    let head = table.headers().unwrap().clone();
    let place = |name: &str| head.iter().position(|h| h == name).unwrap();
    let (version, hash) = (place("tool_version"), place("config_hash"));
    for row in table.records().map(|row| row.unwrap()) {
        assert_eq!((&row[version], &row[hash]), (env!("CARGO_PKG_VERSION"), &*made.config_hash()));
    }
    // The hash tells how a table was made, not where or by how many threads.
    let elsewhere = CapacityOptions { data: "elsewhere".into(), jobs: 1, ..made.clone() };
    assert_eq!(elsewhere.config_hash(), made.config_hash());
    let model = Some(learned.model);
    assert_eq!(
        CapacityOptions { model: model.clone(), ..made.clone() }.config_hash(),
        made.config_hash()
    );
    for other in [
        CapacityOptions { seed: 2, ..made.clone() },
        CapacityOptions { outliers: Outliers::Kept, ..made.clone() },
        CapacityOptions { variant: Variant::Published, ..made.clone() },
        options(root, Method::M5),
    ] {
        assert_ne!(other.config_hash(), made.config_hash(), "{other:?}");
    }
    let fused = options(root, Method::Fused);
    assert_ne!(CapacityOptions { model, ..fused.clone() }.config_hash(), fused.config_hash());
    let read = read_capacities(&out).unwrap();
    assert_eq!(read.len(), 18);
    assert_eq!(
        read.values().filter(|v| v.is_none()).count(),
        m4.iter().filter(|r| r.capacity() < 0.0).count()
    );
}

#[test]
fn the_ends_of_a_video_are_those_of_its_images_or_else_of_its_table() {
    let dir = tempfile::tempdir().unwrap();
    let (base, name) = recording(dir.path(), Container::new(1).unwrap(), 0);
    let set = DataSet::open(dir.path()).unwrap();
    let ends = || {
        let views = Views::of(&set.recordings[0], None);
        views.ends(&views.detections().unwrap().unwrap_or_default(), 20).unwrap()
    };
    assert_eq!(ends(), None);
    let table = |last: u32| {
        let rows = [3, last].map(|frame| {
            [1, 2].map(|view| format!("{frame},{view},person,0.9,0,0,9,9\n")).concat()
        });
        let text = format!("frame,view,label,score,x_min,y_min,x_max,y_max\n{}", rows.concat());
        std::fs::create_dir_all(base.join("detections")).unwrap();
        std::fs::write(base.join(format!("detections/{name}.csv")), text).unwrap();
    };
    // Frames in which nothing was found have no rows.
    table(40);
    assert_eq!(ends(), Some((0, 21)));
    table(8);
    assert_eq!(ends(), Some((0, 8)));
    let images = |kind: &str, view: u8, frames: std::ops::Range<u32>| {
        let folder = base.join(format!("{kind}/{name}/c{view}"));
        std::fs::create_dir_all(&folder).unwrap();
        for frame in frames {
            std::fs::write(folder.join(format!("{frame:04}.png")), b"").unwrap();
        }
    };
    images("depth", 1, 0..25);
    assert_eq!(ends(), Some((0, 8)));
    images("depth", 2, 1..25);
    assert_eq!(ends(), Some((1, 5)));
    images("rgb", 1, 0..30);
    images("rgb", 2, 0..30);
    assert_eq!(ends(), Some((0, 10)));
}

/// Ids begin at 0 in every part: a table tells them apart.
#[test]
fn ids_of_several_parts_stay_apart() {
    let dir = tempfile::tempdir().unwrap();
    for (part, recordings) in [("train", 3), ("test_pub", 2), ("test_priv", 1)] {
        let audio = dir.path().join(part).join("audio");
        std::fs::create_dir_all(&audio).unwrap();
        for id in 0..recordings {
            std::fs::write(audio.join(format!("{id:06}.wav")), b"").unwrap();
        }
    }
    let made = options(dir.path(), Method::M5);
    let rows = run(&made);
    let out = dir.path().join("m5.csv");
    capacity::write(&out, &made, &rows).unwrap();
    let read = capacity::read(&out).unwrap();
    let mut named: Vec<_> = read.keys().copied().collect();
    named.sort_unstable();
    let expected = [
        (Subset::Training, 0),
        (Subset::Training, 1),
        (Subset::Training, 2),
        (Subset::Public, 0),
        (Subset::Public, 1),
        (Subset::Private, 0),
    ];
    let expected = expected.map(|(part, id)| Named { part: Some(part), key: RowKey::Id(id) });
    assert_eq!(named, expected);
    assert_eq!(named[3].to_string(), "id 0 of the public test part");
    let both = dir.path().join("both.csv");
    assert_eq!(capacity::combine_files(&[out.clone(), out.clone()], -1.0, &both).unwrap(), (6, 6));
    assert_eq!(read_capacities(&both).unwrap().len(), 6);
    // A substitute is no estimate, also of an earlier combination.
    let (one, two) = (dir.path().join("one.csv"), dir.path().join("two.csv"));
    let rows = "id1_0001.png,500,prior\nid1_0002.png,300,ok\nid1_0003.png,734.94,ok\n";
    std::fs::write(&one, format!("fileName,capacity[mL],status\n{rows}")).unwrap();
    assert_eq!(capacity::combine_files(&[one], 400.0, &two).unwrap(), (3, 2));
    // Columns that are not used hold anything.
    let lengths = dir.path().join("lengths.csv");
    let header = "width top[mm],width bottom[mm],height[mm],execution[ms],method";
    let row = "id1_0001.png,500,n/a,n/a,n/a,,m5+fused";
    std::fs::write(&lengths, format!("fileName,capacity[mL],{header}\n{row}\n")).unwrap();
    let four = dir.path().join("four.csv");
    assert_eq!(capacity::combine_files(&[lengths], 400.0, &four).unwrap(), (1, 0));
    let text = std::fs::read_to_string(&four).unwrap();
    assert!(text.ends_with("\nid1_0001.png,500,ok,m5+fused\n"), "{text}");
    let of = |sequence: u16| Named::alone(RowKey::Sequence(1, sequence));
    let read = capacity::read(&two).unwrap();
    let priors = [1, 2, 3].map(|sequence| read[&of(sequence)].is_prior);
    assert_eq!(priors, [true, false, true]);
    let three = dir.path().join("three.csv");
    assert_eq!(capacity::combine_files(&[two], 600.0, &three).unwrap(), (3, 2));
    assert_eq!(capacity::read(&three).unwrap()[&of(1)].capacity_ml, Some(600.0));
    // A name twice in one part, and a part that there is not.
    let text = std::fs::read_to_string(&out).unwrap();
    for (from, to, said) in [
        ("public test", "private test", "a name that occurs once"),
        ("public test", "test", "training, public test or private test"),
    ] {
        std::fs::write(&out, text.replace(from, to)).unwrap();
        let error = capacity::read(&out).unwrap_err().to_string();
        assert!(error.contains(said), "{error}");
    }
}
