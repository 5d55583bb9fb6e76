//! What the vision baseline sees of recordings.

#![allow(clippy::unwrap_used)]

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use corsmal_ccm::CcmError;
use corsmal_ccm::capacity::{Problem, Views};
use corsmal_ccm::crop::{self, Written, crops};
use corsmal_ccm::dataset::{
    Container, DataSet, Filling, FillingLevel, FillingType, SequenceName, Subset,
};
use corsmal_ccm::synth::write_views;
use corsmal_vision::{Mask, Rgb, read_detections};

/// A recording without views: the folder of its container and its name.
fn recording(dir: &Path, number: u8) -> (PathBuf, SequenceName) {
    let filling = Filling::new(FillingType::Rice, FillingLevel::Full).unwrap();
    let name = SequenceName { scenario: 0, filling, background: 0, illumination: 0 };
    let base = dir.join(format!("train/{number}"));
    std::fs::create_dir_all(base.join("audio")).unwrap();
    std::fs::write(base.join(format!("audio/{name}_audio.wav")), b"").unwrap();
    (base, name)
}

/// An image whose red counts columns and whose green counts rows.
fn image(width: usize, height: usize) -> Rgb {
    let pixel = |i: usize| [(i % width) as u8, (i / width) as u8, 9];
    Rgb { width, height, data: (0..width * height).flat_map(pixel).collect() }
}

fn write(path: &Path, bytes: &[u8]) {
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    std::fs::write(path, bytes).unwrap();
}

fn views(dir: &Path) -> Views {
    Views::of(&DataSet::open(dir).unwrap().recordings[0], None)
}

/// What is cut out of each view.
fn seen_by(views: &Views) -> [Result<Rgb, Problem>; 4] {
    crops(views, &AtomicBool::new(false))
}

/// Size and first pixel.
fn seen(crop: &Result<Rgb, Problem>) -> (usize, usize, u8, u8) {
    let crop = crop.as_ref().unwrap();
    (crop.width, crop.height, crop.data[0], crop.data[1])
}

#[test]
fn the_best_cup_or_glass_of_the_last_frame_is_cut_out() {
    let dir = tempfile::tempdir().unwrap();
    let (base, name) = recording(dir.path(), 3);
    let png = image(40, 30).to_png().unwrap();
    for (view, frame) in [(1, 0), (1, 7), (2, 7), (3, 7)] {
        write(&base.join(format!("rgb/{name}/c{view}/{frame:04}.png")), &png);
    }
    // In view 1 a mask with rows 5 and 6, columns 10 to 12; in view 2 a box, partly outside; in view 3 a
    // box in another frame.
    let mut mask = Mask::empty(40, 30);
    for (x, y) in [(10, 5), (11, 5), (12, 6)] {
        mask.data[y * 40 + x] = true;
    }
    write(&base.join("detections/c1.png"), &mask.to_png().unwrap());
    let table = "frame,view,label,score,x_min,y_min,x_max,y_max,mask\n\
                 7,1,bottle,0.99,0,0,5,5,\n\
                 7,1,wine glass,0.4,9,4,14,8,c1.png\n\
                 7,1,cup,0.3,0,0,5,5,\n\
                 7,2,cup,0.2,30.5,20,50,40,\n\
                 0,3,cup,0.9,0,0,5,5,\n";
    write(&base.join(format!("detections/{name}.csv")), table.as_bytes());
    let found = seen_by(&views(dir.path()));
    assert_eq!(seen(&found[0]), (3, 2, 10, 5));
    assert_eq!(seen(&found[1]), (10, 10, 30, 20));
    let reason = |view: usize| match &found[view] {
        Err(Problem::Missing(reason)) => reason.clone(),
        other => panic!("{other:?}"),
    };
    assert_eq!(reason(2), "no container in view 3, frame 7");
    assert_eq!(reason(3), "no colour image of view 4");

    // A mask's file counts before the detections.
    let mut other = Mask::empty(40, 30);
    other.data[2 * 40 + 39] = true;
    write(&base.join(format!("masks/{name}/c2/0007.png")), &other.to_png().unwrap());
    assert_eq!(seen(&seen_by(&views(dir.path()))[1]), (1, 1, 39, 2));
}

#[test]
fn damaged_files_are_named() {
    let dir = tempfile::tempdir().unwrap();
    let (base, name) = recording(dir.path(), 3);
    write(&base.join(format!("rgb/{name}/c1/0000.png")), &image(40, 30).to_png().unwrap());
    write(&base.join(format!("rgb/{name}/c2/0000.png")), b"no image");
    let fault = |view: usize, expected: &str| match &seen_by(&views(dir.path()))[view - 1] {
        Err(Problem::Damaged(reason)) => assert!(reason.contains(expected), "{reason}"),
        other => panic!("{other:?}"),
    };
    let table = base.join(format!("detections/{name}.csv"));
    let header = "frame,view,label,score,x_min,y_min,x_max,y_max,mask\n";
    write(&table, format!("{header}0,2,cup,0.9,0,0,9,9,\n").as_bytes());
    fault(2, "c2/0000.png");
    write(&base.join("detections/m.png"), &Mask::empty(41, 30).to_png().unwrap());
    write(&table, format!("{header}0,1,cup,0.9,0,0,9,9,m.png\n").as_bytes());
    fault(1, "41 by 30 px; its image has 40 by 30");
    write(&table, b"frame\n0\n");
    fault(1, "detections");
}

/// Detectors give them, too: of one view, which then shows no container.
#[test]
fn boxes_of_nothing_are_no_damage() {
    let dir = tempfile::tempdir().unwrap();
    let (base, name) = recording(dir.path(), 3);
    write(&base.join(format!("rgb/{name}/c1/0000.png")), &image(40, 30).to_png().unwrap());
    let table = base.join(format!("detections/{name}.csv"));
    for bounds in
        ["40,0,60,9", "5,5,5,9", "5,30,9,40", "-9,-9,-1,-1", "7,7,7,7", "-1000000,0,0,1000000"]
    {
        let header = "frame,view,label,score,x_min,y_min,x_max,y_max,mask\n";
        write(&table, format!("{header}0,1,cup,0.9,{bounds},\n").as_bytes());
        match &seen_by(&views(dir.path()))[0] {
            Err(Problem::Missing(reason)) => {
                assert!(reason.contains("outside the image or without area"))
            }
            other => panic!("{bounds}: {other:?}"),
        }
    }
    // Partly beyond the picture; as wide as a pixel once its edges are whole.
    let header = "frame,view,label,score,x_min,y_min,x_max,y_max\n";
    write(&table, format!("{header}0,1,cup,0.9,-1000000,-7,3,1000000\n").as_bytes());
    assert_eq!(seen(&seen_by(&views(dir.path()))[0]), (3, 30, 0, 0));
    let header = "frame,view,label,score,x_min,y_min,x_max,y_max\n";
    write(&table, format!("{header}0,1,cup,0.9,5.2,5,5.4,9\n").as_bytes());
    assert_eq!(seen(&seen_by(&views(dir.path()))[0]), (1, 4, 5, 5));
}

/// A video counts where there are no images of its frames.
#[test]
fn frames_may_be_in_a_video() {
    let dir = tempfile::tempdir().unwrap();
    let (base, name) = recording(dir.path(), 3);
    let shades = Path::new(env!("CARGO_MANIFEST_DIR")).join("../vision/tests/shades.mp4");
    let shades = std::fs::read(shades).unwrap();
    for view in [1, 2] {
        write(&base.join(format!("rgb/{name}_c{view}.mp4")), &shades);
    }
    let table = "frame,view,label,score,x_min,y_min,x_max,y_max\n19,1,cup,0.9,2,3,10,20\n";
    write(&base.join(format!("detections/{name}.csv")), table.as_bytes());
    let all = views(dir.path());
    assert_eq!(all.colours(2).unwrap().numbers().len(), 20);
    // The first and, from the end, the 20th frame, whatever the table ends with.
    assert_eq!(all.ends(&[], 20).unwrap(), Some((0, 0)));
    assert_eq!(all.ends(&[], 19).unwrap(), Some((0, 1)));
    match &seen_by(&all)[0] {
        Ok(crop) => assert_eq!((crop.width, crop.height, crop.data[1] < 20), (8, 17, true)),
        Err(Problem::Damaged(reason)) => {
            assert!(reason.contains("_c1.mp4: this program was built without video"), "{reason}");
        }
        Err(other) => panic!("{other:?}"),
    }
    // A table about frames that the video does not have is another recording's, or counts from 1.
    write(&base.join(format!("detections/{name}.csv")), table.replace("\n19,", "\n20,").as_bytes());
    let refused = views(dir.path()).detections().unwrap_err();
    let expected = "frame 20 of view 1: its video has 20 frames, counted from 0";
    assert!(matches!(&refused, Problem::Damaged(r) if r.contains(expected)), "{refused:?}");
    // Unless the images have it: of a constant rate there may be more of them.
    let png = image(40, 30).to_png().unwrap();
    write(&base.join(format!("rgb/{name}/c1/0020.png")), &png);
    assert!(views(dir.path()).detections().is_ok());
    std::fs::remove_dir_all(base.join(format!("rgb/{name}"))).unwrap();
    write(&base.join(format!("detections/{name}.csv")), table.as_bytes());
    // Masks have numbers of their own.
    for view in [1, 2] {
        let mask = Mask::empty(40, 30).to_png().unwrap();
        write(&base.join(format!("masks/{name}/c{view}/0007.png")), &mask);
    }
    assert_eq!(views(dir.path()).ends(&[], 20).unwrap(), Some((7, 7)));
    // A damaged video fails where its pictures are wanted, and nowhere else.
    for view in [1, 2, 3] {
        write(&base.join(format!("rgb/{name}_c{view}.mp4")), &shades[..200]);
    }
    std::fs::remove_dir_all(base.join("masks")).unwrap();
    let all = views(dir.path());
    let damaged = all.colours(3).err().unwrap();
    assert!(
        matches!(&damaged, Problem::Damaged(reason) if reason.contains("_c3.mp4")),
        "{damaged:?}"
    );
    assert_eq!(all.ends(&all.detections().unwrap().unwrap(), 20).unwrap(), Some((0, 0)));
    assert_eq!(all.ends(&[], 20).unwrap(), None);
    // An empty folder hides no video, images do.
    std::fs::create_dir_all(base.join(format!("rgb/{name}/c3"))).unwrap();
    assert!(views(dir.path()).colours(3).is_err());
    write(&base.join(format!("rgb/{name}/c3/0004.png")), &image(40, 30).to_png().unwrap());
    assert_eq!(views(dir.path()).colours(3).unwrap().numbers(), [4]);
}

/// `detections`, `ends` and `colours` each read them again.
#[test]
fn the_index_of_a_video_is_read_once() {
    let dir = tempfile::tempdir().unwrap();
    let (base, name) = recording(dir.path(), 3);
    let shades = Path::new(env!("CARGO_MANIFEST_DIR")).join("../vision/tests/shades.mp4");
    let shades = std::fs::read(shades).unwrap();
    let video = |view: u8| base.join(format!("rgb/{name}_c{view}.mp4"));
    (1..=2).for_each(|view| write(&video(view), &shades));
    let table = "frame,view,label,score,x_min,y_min,x_max,y_max\n19,1,cup,0.9,2,3,10,20\n\
                 19,2,cup,0.9,2,3,10,20\n";
    write(&base.join(format!("detections/{name}.csv")), table.as_bytes());
    let all = views(dir.path());
    assert_eq!(all.detections().unwrap().unwrap().len(), 2);
    (1..=2).for_each(|view| std::fs::remove_file(video(view)).unwrap());
    assert_eq!(all.ends(&[], 19).unwrap(), Some((0, 1)));
    assert_eq!(all.colours(1).unwrap().numbers().len(), 20);
    assert_eq!(all.clone().colours(2).unwrap().numbers().len(), 20);
    assert!(views(dir.path()).colours(1).unwrap().numbers().is_empty());
}

/// In a folder of their own, tables lie by container, or by part where that is not known.
#[test]
fn tables_are_found_in_a_folder_of_their_own() {
    let dir = tempfile::tempdir().unwrap();
    let (data, tables) = (dir.path().join("data"), dir.path().join("tables"));
    recording(&data, 3);
    for part in ["test_pub", "test_priv"] {
        write(&data.join(format!("{part}/audio/000007.wav")), b"");
    }
    let header = "frame,view,label,score,x_min,y_min,x_max,y_max\n";
    for recording in DataSet::open(&data).unwrap().recordings {
        let views = Views::of(&recording, Some(&tables));
        assert!(views.detections().unwrap().is_none());
        let rows = "0,1,cup,0.9,0,0,5,5\n".repeat(1 + recording.part as usize);
        write(&views.table_in(&tables), format!("{header}{rows}").as_bytes());
    }
    let places = ["3/s0_fi2_fu2_b0_l0", "public-test/000007", "private-test/000007"];
    for (place, recording) in places.iter().zip(DataSet::open(&data).unwrap().recordings) {
        assert!(tables.join(format!("{place}.json")).exists(), "{place}");
        let found = Views::of(&recording, Some(&tables)).detections().unwrap().unwrap();
        assert_eq!(found.len(), 1 + recording.part as usize, "{place}");
    }
    // Labels that come later tell the containers.
    let labels = "id,container id,scenario,background,illumination,width at the top,width at the bottom,height,depth,\
        container capacity,container mass,filling type,filling level,filling density,filling mass,object mass\n\
        7,10,0,1,0,97.1,60.4,117.9,-1,520,10,0,0,0,0,10\n";
    write(&data.join("test_pub/ccm_test_pub_annotation.csv"), labels.as_bytes());
    let set = DataSet::open(&data).unwrap();
    let labelled = set.recordings.iter().find(|r| r.part == Subset::Public).unwrap();
    assert_eq!(labelled.container.map(|c| c.number()), Some(10));
    let views = Views::of(labelled, Some(&tables));
    assert_eq!(views.detections().unwrap().unwrap().len(), 1 + Subset::Public as usize);
    assert_eq!(views.table_in(&tables), tables.join("public-test/000007.json"));
    write(&tables.join("10/000007.json"), b"[]");
    let Err(Problem::Damaged(two)) = views.detections() else { panic!("two tables") };
    assert!(two.contains("are tables of the same recording"), "{two}");
    // The others are said to have none.
    std::fs::remove_file(tables.join("private-test/000007.json")).unwrap();
    let said = corsmal_ccm::capacity::without_tables(&set.recordings, Some(&tables)).unwrap();
    assert!(
        said.contains("1 of 3 recordings have no table") && said.contains("private-test"),
        "{said}"
    );
}

#[test]
fn labelled_pictures_are_written_once() {
    let dir = tempfile::tempdir().unwrap();
    let (data, out) = (dir.path().join("data"), dir.path().join("crops"));
    // A coloured cup, a clear one, a glass and a box, which no detector takes for a cup in all views.
    let mut seen = 0;
    for number in [1, 3, 4, 7] {
        let (base, name) = recording(&data, number);
        let container = Container::new(number).unwrap();
        write_views(&base, &name.to_string(), container, name, 5).unwrap();
        let table = read_detections(&base.join(format!("detections/{name}.json"))).unwrap();
        let last = table.iter().map(|d| d.frame).max().unwrap();
        let shows = |view: &u8| {
            table.iter().any(|d| {
                (d.view, d.frame) == (*view, last) && crop::LABELS.contains(&d.label.as_str())
            })
        };
        seen += [1, 2, 3, 4].iter().filter(|view| shows(view)).count();
    }
    assert!((4..16).contains(&seen));
    let make = || crop::write(&data, None, &out, 2, &AtomicBool::new(false));
    let Written { crops, recordings, without, failed, synthetic } = make().unwrap();
    assert_eq!((recordings, failed.len(), synthetic), (4, 0, false));
    assert_eq!((crops, without), (seen, 16 - seen));
    let table = std::fs::read_to_string(out.join("labels.csv")).unwrap();
    assert_eq!(table.lines().count(), crops + 1);
    assert!(table.lines().any(|line| line == "1_s0_fi2_fu2_b0_l0_c1,1,1,opaque,opaque"), "{table}");
    for line in table.lines().skip(1) {
        let cells: Vec<&str> = line.split(',').collect();
        let labels = if matches!(cells[1], "1" | "7") { ["opaque"; 2] } else { ["full", "rice"] };
        assert_eq!(cells[3..], labels, "{line}");
        let picture = Rgb::read(&out.join(format!("{}.png", cells[0]))).unwrap();
        assert!(picture.width > 20 && picture.height > 20, "{line}");
    }
    assert!(make().unwrap_err().to_string().contains("new or empty folder"));

    let damaged = data.join("train/4/rgb/s0_fi2_fu2_b0_l0/c2/0008.png");
    std::fs::write(&damaged, b"no image").unwrap();
    let again = dir.path().join("again");
    let made = crop::write(&data, None, &again, 2, &AtomicBool::new(false)).unwrap();
    assert_eq!(made.failed.len(), 1);
    assert!(made.failed[0].1.contains("c2/0008.png"), "{:?}", made.failed);
    assert!(!again.join("4_s0_fi2_fu2_b0_l0_c1.png").exists());

    // What is broken off leaves nothing that looks like a folder of pictures.
    let broken_off = dir.path().join("broken-off");
    let stopped = || crop::write(&data, None, &broken_off, 2, &AtomicBool::new(true)).unwrap_err();
    assert!(matches!(stopped(), CcmError::Interrupted));
    assert!(!broken_off.exists());
    // A folder of the user stays, and what another run has just begun in it. What a killed one left long ago is removed.
    let killed = broken_off.join(".crops-killed");
    std::fs::create_dir_all(&killed).unwrap();
    assert!(matches!(stopped(), CcmError::Interrupted));
    assert_eq!(std::fs::read_dir(&broken_off).unwrap().count(), 1);
    #[cfg(unix)]
    {
        write(&killed.join("1.png"), b"part");
        let hour = std::time::Duration::from_secs(3600);
        let folder = std::fs::File::open(&killed).unwrap();
        folder.set_modified(std::time::SystemTime::now() - hour).unwrap();
        folder.lock().unwrap();
        assert!(matches!(stopped(), CcmError::Interrupted));
        assert!(killed.is_dir(), "of a run that is alive");
        drop(folder);
        assert!(matches!(stopped(), CcmError::Interrupted));
        assert!(!killed.exists());
    }
    crop::write(&data, None, &broken_off, 2, &AtomicBool::new(false)).unwrap();
    assert!(broken_off.join("labels.csv").exists());
}

#[test]
fn a_data_set_without_containers_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let data = dir.path().join("data");
    recording(&data, 3);
    let error = crop::write(&data, None, &dir.path().join("out"), 1, &AtomicBool::new(false));
    let error = error.unwrap_err().to_string();
    assert!(error.contains("none of 1 recordings has colour frames"), "{error}");
    let (base, name) = recording(&data, 4);
    write(&base.join(format!("rgb/{name}/c2/0000.png")), &image(40, 30).to_png().unwrap());
    let error = crop::write(&data, None, &dir.path().join("out"), 1, &AtomicBool::new(false));
    let error = error.unwrap_err().to_string();
    assert!(error.contains("none of 2 labelled training recordings"), "{error}");
    assert!(error.contains("no colour image of view 1"), "{error}");
}
