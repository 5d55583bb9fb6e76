//! Capacities, added to what is heard.

use corsmal_ccm::benchmark::{Baseline, BenchmarkOptions, CapacityTable, System};
use corsmal_ccm::synth::{self, Size};
use corsmal_report::Cell;

use crate::systems::Constant;
use crate::{options, run};

/// One table has the capacities of all parts, of which two have the same ids.
#[test]
fn capacities_of_the_same_ids_go_to_their_parts() {
    let dir = tempfile::tempdir().unwrap();
    let (data, out) = (dir.path().join("data"), dir.path().join("report"));
    synth::generate(&data, Size::Small, 3).unwrap();
    let mut table = String::from("fileName,capacity[mL],part\n");
    for recording in corsmal_ccm::dataset::DataSet::open(&data).unwrap().recordings {
        let (container, sequence) =
            (recording.container.unwrap().number(), recording.sequence.unwrap());
        table += &format!("id{container}_{sequence:04}.png,300,\n");
    }
    for (folder, part, capacity) in
        [("test_pub", "public test", 400), ("test_priv", "private test", 500)]
    {
        let audio = data.join(folder).join("audio");
        std::fs::create_dir_all(&audio).unwrap();
        for id in 0..2 {
            std::fs::write(audio.join(format!("{id:06}.wav")), b"").unwrap();
            table += &format!("id{id:06}.png,{capacity},{part}\n");
        }
    }
    let path = dir.path().join("capacity.csv");
    std::fs::write(&path, table).unwrap();
    let given = CapacityTable { name: "X".into(), path, own: None, learned_from: Vec::new() };
    let systems: Vec<Box<dyn System>> = vec![Box::new(Constant)];
    let made =
        BenchmarkOptions { systems, capacities: vec![given], ..options(&data, &out, Vec::new()) };
    run(&made).unwrap();
    for (part, capacity) in [("public-test", "400"), ("private-test", "500")] {
        let path = out.join(format!("submissions/m4-x-{part}-2022.csv"));
        let rows = std::fs::read_to_string(&path).unwrap();
        let cells: Vec<&str> = rows.lines().skip(1).map(|r| r.split(',').nth(1).unwrap()).collect();
        assert_eq!(cells, [capacity; 2], "{rows}");
    }
}

/// Capacities have their rows, complete what is heard, and give whole submissions and figures of their errors.
#[test]
fn capacities_complete_what_is_heard() {
    let dir = tempfile::tempdir().unwrap();
    let (data, out) = (dir.path().join("data"), dir.path().join("report"));
    synth::generate(&data, Size::Reduced, 3).unwrap();
    let set = corsmal_ccm::dataset::DataSet::open(&data).unwrap();
    let mut table = String::from(
        "fileName,capacity[mL],width top[mm],width bottom[mm],height[mm],execution[ms],status\n",
    );
    let known = |r: &&corsmal_ccm::dataset::Recording| set.annotation(r).is_some();
    let silent = set.recordings.iter().find(known).unwrap().path.clone();
    for (row, recording) in set.recordings.iter().enumerate() {
        let (container, sequence) =
            (recording.container.unwrap().number(), recording.sequence.unwrap());
        // A tenth too large where it is known, and nothing for one recording.
        let capacity = set.annotation(recording).map_or(700.0, |a| 1.1 * a.capacity_ml);
        let capacity = if recording.path == silent { -1.0 } else { capacity };
        // "none" may be another program's word for no problem.
        let status = if (3..5).contains(&row) { "prior" } else { "none" };
        table += &format!("id{container}_{sequence:04}.png,{capacity},80,60,120,4.5,{status}\n");
    }
    // Of another data set.
    table += "id16_0000.png,734.94,80,60,120,4.5,prior\n";
    let file = dir.path().join("capacity.csv");
    std::fs::write(&file, table).unwrap();
    let forest = Baseline::all().into_iter().filter(|b| b.slug() == "zcr-mfcc-rf").collect();
    let learned_from = vec![2, 11];
    let capacities =
        vec![CapacityTable { name: "M 2".into(), path: file, own: None, learned_from }];
    let report = run(&BenchmarkOptions { capacities, ..options(&data, &out, forest) }).unwrap();

    let notes: Vec<&String> = report.sections.iter().flat_map(|s| &s.text).collect();
    let count = set.recordings.len();
    let said = format!("M 2: of {count} capacities, priors instead of estimates: 2; missing: 1.");
    assert!(notes.contains(&&said), "{notes:?}");
    let tables: Vec<_> = report.sections.iter().flat_map(|s| &s.tables).collect();
    let find = |table: &str, method: &str| {
        let table = tables.iter().find(|t| t.name == table).unwrap();
        let row = table.rows.iter().find(|r| r.cells[0] == Cell::text(method));
        let place = table.columns.iter().position(|c| c == "Training").unwrap();
        row.map(|row| row.cells[place].value())
    };
    let (heard, whole) = ("ZCR + MFCCs + RF", "ZCR + MFCCs + RF, capacity M 2");
    let set_size = set.recordings.iter().filter(|r| r.container.unwrap().number() < 10).count();
    let expected = 100.0 * (-0.1f64).exp() * (set_size - 1) as f64 / set_size as f64;
    assert!((find("capacity", "M 2").unwrap().unwrap() - expected).abs() < 1e-9);
    let mass = |method| find("mass", method).unwrap().unwrap();
    assert!(mass(whole) > mass(heard), "{} {}", mass(whole), mass(heard));
    assert!(find("weight", whole).unwrap().unwrap() > 0.0);
    assert_eq!((find("weight", heard), find("level", whole)), (None, None));
    let by_container = tables.iter().find(|t| t.name == "mass-by-container-training").unwrap();
    assert!(by_container.rows.iter().any(|r| r.cells[0] == Cell::text(whole)));
    assert!(by_container.rows.iter().all(|r| r.cells[0] != Cell::text(heard)));

    let read = |name: &str| std::fs::read_to_string(out.join(name)).unwrap();
    let submission = read("submissions/zcr-mfcc-rf-corrected-m-2-held-out-2022.csv");
    let rows: Vec<Vec<&str>> = submission.lines().skip(1).map(|l| l.split(',').collect()).collect();
    assert_eq!(rows.len(), set_size);
    assert_eq!(rows.iter().filter(|row| row[1] == "-1").count(), 1);
    for row in rows {
        let given = [2, 13, 14, 15, 19].map(|place| row[place]);
        assert_eq!(given, ["15", "80", "60", "120", "4.5"], "{row:?}");
        let sum: f64 = row[4..8].iter().map(|p| p.parse::<f64>().unwrap()).sum();
        assert!((sum - 1.0).abs() < 1e-5, "{row:?}");
    }
    let public = read("submissions/zcr-mfcc-rf-corrected-m-2-public-test.csv");
    assert!(public.lines().count() > 1 && !public.contains(",-1\n"), "{public}");
    for by in ["container", "type-and-level"] {
        let figure = read(&format!("figures/capacity-error-m-2-by-{by}.svg"));
        assert!(figure.contains("median 10.0"), "{figure}");
    }
    // Of what is only completed no figure says anything new.
    assert!(!out.join("figures/zcr-mfcc-rf-corrected-m-2-type-confusion.svg").exists());
}
