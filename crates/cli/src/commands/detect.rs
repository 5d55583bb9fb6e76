//! `corsmal-feat detect`: frames in, tables of detections out.

use std::path::PathBuf;
use std::process::ExitCode;

use crate::args::{Jobs, Told};
use crate::failure::Failure;

/// Arguments of `detect`.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  corsmal-feat detect --data ~/CCM --model mask_rcnn.onnx --library libonnxruntime.so.1.32.0 \\
      --out detections
  corsmal-feat capacity --method m5 --data ~/CCM --detections detections --out capacity.csv

Writes a table CONTAINER/SEQUENCE.json, which `capacity` and `crops` read, for each recording with
colour frames (images, or H.264 in MP4 in a build with the feature `video`). It has the objects that
the model found, with their confidence, and masks of containers. Existing tables are kept, so an
interrupted run can be resumed; model.json says which model made them.

Exit codes: 0 all fine, 1 some recordings have damaged files, 2 could not run, 130 interrupted.")]
pub struct Args {
    /// Folder of the data set.
    #[arg(long, value_name = "DIR")]
    data: PathBuf,
    /// torchvision's Mask R-CNN as an ONNX model; docs/vision.md says how to export it.
    #[arg(long, value_name = "FILE")]
    model: PathBuf,
    /// Shared library of ONNX Runtime, such as libonnxruntime.so.1.32.0 of the PyPI package onnxruntime.
    #[arg(long, value_name = "FILE", env = "CORSMAL_ONNXRUNTIME")]
    library: PathBuf,
    /// Folder to write the tables to.
    #[arg(long, short, value_name = "DIR")]
    out: PathBuf,
    /// Frames to run the model on: ends (the first, the 20th from the end and the last, for m5 and
    /// the vision baseline), all (for m3), or every=8 (for m4: every eighth frame, and the last).
    #[arg(long, value_name = "WHICH", default_value = "ends", value_parser = frames)]
    frames: Frames,
    /// Views to run the model on.
    #[arg(long, value_delimiter = ',', default_value = "1,2,3,4", value_name = "VIEW")]
    #[arg(value_parser = clap::value_parser!(u8).range(1..=4))]
    views: Vec<u8>,
    /// Minimum confidence of detections to write.
    #[arg(long, value_name = "P", default_value_t = 0.05, value_parser = crate::args::share)]
    score: f64,
    /// Remake existing tables.
    #[arg(long)]
    overwrite: bool,
    #[command(flatten)]
    jobs: Jobs,
    #[command(flatten)]
    told: Told,
}

/// Which frames of a view.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Frames {
    /// The first, the 20th from the end, and the last.
    Ends,
    /// Every so many, and the last.
    Every(usize),
}

fn frames(text: &str) -> Result<Frames, String> {
    match (text, text.strip_prefix("every=").map(str::parse)) {
        ("ends", _) => Ok(Frames::Ends),
        ("all", _) => Ok(Frames::Every(1)),
        (_, Some(Ok(step))) if step > 0 => Ok(Frames::Every(step)),
        _ => Err("expected ends, all or every=N such as every=8".into()),
    }
}

/// How to get what runs models.
#[cfg(not(feature = "onnx"))]
pub fn absent() -> Failure {
    Failure::new(
        "this build cannot run ONNX models; `cargo install --path crates/cli --features \
         nets,onnx` makes one that can",
    )
}

/// Says how to get it.
#[cfg(not(feature = "onnx"))]
pub fn run(args: Args) -> Result<ExitCode, Failure> {
    // What these say is for models.
    let Args { data: _, model: _, library: _, out: _, frames: _, views: _, .. } = args;
    let Args { score: _, overwrite: _, jobs: _, told: _, .. } = args;
    Err(absent())
}

/// Looks at frames and writes what is there.
#[cfg(feature = "onnx")]
pub fn run(args: Args) -> Result<ExitCode, Failure> {
    use corsmal_onnx::runtime::{Detector, Runtime};
    use serde_json::json;

    use crate::failure::{FAILED_FILES, INTERRUPTED};
    use crate::plural::plural;

    let set = crate::commands::dataset::open(&args.data)?;
    corsmal_ccm::capacity::require_colours(&set.recordings)?;
    if let Some(doubt) = corsmal_ccm::capacity::doubtful_colours(&set.recordings) {
        eprintln!("warning: {doubt}");
    }
    let runtime = Runtime::load(&args.library, args.jobs.count())?;
    let mut detector = Detector::open(&runtime, &args.model)?;
    let tables: Vec<PathBuf> = set
        .recordings
        .iter()
        .map(|recording| corsmal_ccm::capacity::Views::of(recording, None).table_in(&args.out))
        .collect();
    made_by(&args, &tables)?;
    let interrupted = || {
        eprintln!("interrupted; run the same command again to continue");
        ExitCode::from(INTERRUPTED)
    };
    let (mut written, mut kept, mut without, mut failed) = (0usize, 0usize, 0usize, 0usize);
    for (recording, place) in set.recordings.iter().zip(tables) {
        let views = corsmal_ccm::capacity::Views::of(recording, None);
        if place.exists() && !args.overwrite {
            kept += 1;
            continue;
        }
        match seen(&mut detector, (recording, &views), &args) {
            Err(Fault::Recording(reason)) => {
                eprintln!("{}: {reason}", recording.path.display());
                failed += 1;
            }
            Err(Fault::Model(failure)) => return Err(failure),
            Err(Fault::Interrupted) => return Ok(interrupted()),
            Ok(None) => without += 1,
            Ok(Some(rows)) => {
                if let Some(folder) = place.parent() {
                    std::fs::create_dir_all(folder)?;
                }
                if !(args.told.quiet || args.told.json) {
                    eprintln!("{}: {}", place.display(), plural(rows.len(), "detection"));
                }
                let text = serde_json::Value::from(rows).to_string();
                corsmal_files::draft::write(&place, text.as_bytes())?;
                written += 1;
            }
        }
    }
    let (out, recordings) = (&args.out, set.recordings.len());
    args.told.tell(
        || {
            json!({
                "out": out.display().to_string(), "recordings": recordings, "written": written, "kept": kept,
                "without_frames": without, "failed": failed,
            })
        },
        || {
            let tables = plural(written, "table");
            format!(
                "{}: {tables} of {recordings} recordings, {kept} kept, {without} without frames",
                out.display()
            )
        },
    )?;
    Ok(if failed > 0 { ExitCode::from(FAILED_FILES) } else { ExitCode::SUCCESS })
}

/// The views, each once.
#[cfg(feature = "onnx")]
fn chosen_views(args: &Args) -> std::collections::BTreeSet<u8> {
    args.views.iter().copied().collect()
}

/// Says in the folder what its `tables` are made by and of; refuses to mix them with others.
#[cfg(feature = "onnx")]
fn made_by(args: &Args, tables: &[PathBuf]) -> Result<(), Failure> {
    use corsmal_files::{draft, identity};

    let mut beside = tables.iter().map(|table| table.with_extension("csv"));
    if let Some(other) = beside.find(|other| other.is_file()) {
        return Err(Failure::new(format!(
            "{}: already a table of the same recording; remove it, or name another --out",
            other.display()
        )));
    }
    let identity = identity::of_file(&args.model)
        .map_err(|e| Failure::new(format!("{}: {e}", args.model.display())))?;
    let place = args.out.join("model.json");
    let frames = match args.frames {
        Frames::Ends => "ends".to_owned(),
        Frames::Every(step) => format!("every={step}"),
    };
    let about = serde_json::json!({
        "model": identity, "data": args.data.canonicalize()?.display().to_string(), "frames": frames,
        "views": chosen_views(args), "score": args.score,
        "tool_version": env!("CARGO_PKG_VERSION"),
    });
    let about = serde_json::to_string_pretty(&about)?;
    let others = std::fs::read_to_string(&place).ok().is_none_or(|found| found != about);
    if others {
        for table in tables.iter().filter(|table| table.exists()) {
            if !args.overwrite {
                return Err(Failure::new(format!(
                    "{}: made by another model or version, or of other data or frames; name another --out, \
                     or give --overwrite",
                    table.display()
                )));
            }
            // An interrupted run must not leave those of two models.
            std::fs::remove_file(table)?;
        }
    }
    std::fs::create_dir_all(&args.out)
        .map_err(|e| Failure::new(format!("{}: {e}", args.out.display())))?;
    Ok(draft::write(&place, about.as_bytes())?)
}

/// What ends the work on a recording, or on all.
#[cfg(feature = "onnx")]
enum Fault {
    Recording(String),
    Model(Failure),
    Interrupted,
}

#[cfg(feature = "onnx")]
impl From<corsmal_ccm::capacity::Problem> for Fault {
    fn from(problem: corsmal_ccm::capacity::Problem) -> Self {
        use corsmal_ccm::capacity::Problem;

        let (Problem::Missing(reason) | Problem::Damaged(reason)) = problem;
        Self::Recording(reason)
    }
}

/// The rows of a recording; `None` where it has no frames.
#[cfg(feature = "onnx")]
fn seen(
    detector: &mut corsmal_onnx::runtime::Detector,
    (recording, views): (&corsmal_ccm::dataset::Recording, &corsmal_ccm::capacity::Views),
    args: &Args,
) -> Result<Option<Vec<serde_json::Value>>, Fault> {
    let ends = match args.frames {
        Frames::Ends => views.ends(&[], corsmal_ccm::capacity::M5_FROM_END)?,
        Frames::Every(_) => None,
    };
    let (mut rows, mut any) = (Vec::new(), false);
    for view in chosen_views(args) {
        let colours = views.colours(view)?;
        let numbers = colours.numbers();
        let Some(&last) = numbers.last() else { continue };
        any = true;
        let wanted = |number: u32| {
            let chosen = match args.frames {
                // By number, as `capacity` takes them.
                Frames::Every(step) => (number as usize).is_multiple_of(step),
                Frames::Ends => ends.is_some_and(|(a, b)| [a, b].contains(&number)),
            };
            chosen || number == last
        };
        let mut reader = colours.read()?;
        while let Some((number, image)) = reader.next(wanted)? {
            if crate::interrupt::flag().load(std::sync::atomic::Ordering::SeqCst) {
                return Err(Fault::Interrupted);
            }
            let Some(image) = image else { continue };
            let size = (image.width, image.height);
            let found = detector
                .detect(&image, |found| found.rows((view, number), size, args.score as f32));
            let (model, path) = (args.model.display(), recording.path.display());
            let found = found.map_err(|e| e.to_string());
            let found = found.and_then(|rows| rows.map_err(|why| format!("{model}: {why}")));
            let of_frame = |why| format!("{path}, view {view}, frame {number}: {why}");
            rows.extend(found.map_err(|why| Fault::Model(Failure::new(of_frame(why))))?);
        }
    }
    Ok(any.then_some(rows))
}
