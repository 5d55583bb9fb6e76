//! `corsmal-feat benchmark`: the paper's audio baselines and systems on a CCM data set.

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use corsmal_ccm::CcmError;
use corsmal_ccm::benchmark::{
    self, Baseline, BenchmarkOptions, CapacityTable, Finished, Made, System,
};
use corsmal_ccm::capacity::{self, CapacityOptions, Method};
use corsmal_report::{Cell, Report, Row, Source};
use corsmal_vision::cuboid::Outliers;
use corsmal_vision::lode::Variant;

use crate::args::Jobs;
use crate::failure::{FAILED_FILES, Failure, INTERRUPTED};
use crate::made;
use crate::paragraphs::wrapped;

/// Arguments of `benchmark`.
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  corsmal-feat benchmark --data ~/CCM --out report\n  \
                        corsmal-feat benchmark --data ~/CCM --out report --baselines zcr-mfcc-rf \
                        --add M6=m6_acc.csv\n  corsmal-feat benchmark --data ~/CCM --out report \
                        --methods m1,m2,m4,m6 --epochs 5\n  corsmal-feat benchmark --data ~/CCM --out report \\\n      \
                        --capacity m5 --capacity fused=fused.capacity --capacity M2=m2.csv\n\nSystems are trained on whole containers \
                        held out in three folds, with their published recipes; `corsmal-feat nets` \
                        lists them.\n\nThe report is report/report.html; the same tables \
                        are in report/tables and report/report.json. Exit code 1: a system could not be trained on these data \
                        and was left out.")]
pub struct Args {
    /// Folder of the data set.
    #[arg(long, value_name = "DIR")]
    data: PathBuf,
    /// Folder for the report, tables, pictures, submissions, models and cached features.
    #[arg(long, short, value_name = "DIR")]
    out: PathBuf,
    /// Baselines to run, such as zcr-mfcc-knn or spectrogram-pca-rf; by default all twelve, or none
    /// with --methods.
    #[arg(long, num_args = 1.., value_delimiter = ',', value_parser = baseline, value_name = "NAME")]
    baselines: Vec<Baseline>,
    /// Systems of the paper to train and run: m1 to m6, mask-rn. They need a build with the feature
    /// `nets`.
    #[arg(long, num_args = 1.., value_delimiter = ',', value_name = "NAME")]
    methods: Vec<String>,
    /// Epochs of every network of the systems; by default those of its recipe.
    #[arg(long, value_name = "N", requires = "methods", value_parser = clap::value_parser!(u32).range(1..=1 << 20))]
    epochs: Option<u32>,
    /// Embeddings of the recordings for M5, vggish or r21d, as an .npz with X, offsets and ids;
    /// several files with the same name are joined.
    #[arg(long, value_parser = named_file, value_name = "NAME=NPZ", requires = "methods")]
    embeddings: Vec<(String, PathBuf)>,
    /// Weights from which a network of the systems starts instead of random numbers, such as
    /// torchvision's for resnet18-level and resnet18-type.
    #[arg(long, value_parser = named_file, value_name = "NETWORK=FILE", requires = "methods")]
    weights: Vec<(String, PathBuf)>,
    /// Where the networks of the systems train: cpu, or gpu in a build with the feature `gpu`.
    #[arg(long, value_name = "DEVICE", default_value = "cpu", requires = "methods")]
    #[arg(value_parser = ["cpu", "gpu"])]
    device: String,
    /// Predictions of another method to add to the tables: a submission in an official format, or
    /// capacity estimates by file name.
    #[arg(long, value_parser = named_file, value_name = "NAME=CSV")]
    add: Vec<(String, PathBuf)>,
    /// Capacities to add: they get their own rows and complete the submissions of every baseline and
    /// system, so the filling mass has all three tasks. Give a name and a table of `capacity`, or a
    /// method to run first on the views of the data set: m4, m5, or m2, m3 or fused with a model of
    /// `capacity train`, m2 also with published weights.
    #[arg(long, value_parser = capacity_source, value_name = "m4|m5|METHOD=MODEL|NAME=CSV")]
    capacity: Vec<CapacitySource>,
    /// Folder of tables of detections (SEQUENCE.csv or .json, by container or not), for m3, mask-rn
    /// and --capacity; by default `detections/` next to each recording's audio folder.
    #[arg(long, value_name = "DIR")]
    detections: Option<PathBuf>,
    /// Seed of the forests, of the networks and votes of systems, and of the pseudo-random estimates.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    #[command(flatten)]
    jobs: Jobs,
    /// Print the whole report as JSON instead of its main scores.
    #[arg(long)]
    json: bool,
    /// Print only warnings and errors.
    #[arg(short, long)]
    quiet: bool,
}

fn baseline(name: &str) -> Result<Baseline, String> {
    let all = Baseline::all();
    all.iter().find(|b| b.slug() == name).copied().ok_or_else(|| {
        let known: Vec<_> = all.iter().map(Baseline::slug).collect();
        format!("known are {}", known.join(", "))
    })
}

fn named_file(text: &str) -> Result<(String, PathBuf), String> {
    match text.split_once('=') {
        Some((name, path)) if !name.is_empty() && !path.is_empty() => {
            Ok((name.to_string(), path.into()))
        }
        _ => Err("expected NAME=FILE such as M6=m6_acc.csv".into()),
    }
}

/// Where capacities come from.
#[derive(Clone)]
enum CapacitySource {
    Given(String, PathBuf),
    Run(Method, Option<PathBuf>),
}

fn capacity_source(text: &str) -> Result<CapacitySource, String> {
    let learning = |name: &str| {
        let all = [Method::M2, Method::M3, Method::Fused];
        all.into_iter().find(|method| method.name().eq_ignore_ascii_case(name))
    };
    match text {
        "m4" => Ok(CapacitySource::Run(Method::M4, None)),
        "m5" => Ok(CapacitySource::Run(Method::M5, None)),
        _ if text.contains('=') => {
            let (name, path) = named_file(text)?;
            Ok(match learning(&name).filter(|_| !is_text(&path)) {
                Some(method) => CapacitySource::Run(method, Some(path)),
                None => CapacitySource::Given(name, path),
            })
        }
        _ => Err("expected m4, m5, m2=MODEL, m3=MODEL or fused=MODEL from `corsmal-feat capacity \
                  train`, or NAME=FILE such as M2=m2.csv from `corsmal-feat capacity`"
            .into()),
    }
}

/// Whether a file is a table, and neither a model nor weights; one that cannot be opened is none.
fn is_text(path: &Path) -> bool {
    let mut start = Vec::new();
    let read = File::open(path).and_then(|file| file.take(64).read_to_end(&mut start));
    read.is_ok() && !start.starts_with(b"{") && !start.contains(&0) && !start.starts_with(b"PK")
}

/// What a method takes, as the paper's tables write it.
fn takes(method: Method) -> &'static str {
    match method {
        Method::M2 => "depth3",
        Method::M3 => "rgb1+rgb2+rgb3+rgb4",
        Method::M4 => "rgb1+depth1",
        Method::M5 => "rgb1+rgb2",
        Method::Fused => "rgb1+rgb2+rgb3+rgb4+depth1+depth2",
    }
}

/// The tables of capacities; methods are run and their tables kept in `capacity/` below the output.
fn capacities(args: &Args) -> Result<Option<Vec<CapacityTable>>, Failure> {
    let mut tables = Vec::with_capacity(args.capacity.len());
    for source in &args.capacity {
        let (method, model) = match source {
            CapacitySource::Given(name, path) => {
                let (name, path) = (name.clone(), path.clone());
                tables.push(CapacityTable { name, path, own: None, learned_from: Vec::new() });
                continue;
            }
            CapacitySource::Run(method, model) => (*method, model.as_deref()),
        };
        let name = match method {
            Method::Fused => "Fused".into(),
            _ => method.name().to_uppercase(),
        };
        if !args.quiet {
            eprintln!("{name}: capacities");
        }
        let mut options = CapacityOptions {
            data: args.data.clone(),
            detections: args.detections.clone(),
            method,
            variant: Variant::Corrected,
            outliers: Outliers::Corrected,
            model: None,
            network: None,
            jobs: args.jobs.count(),
            seed: args.seed,
        };
        // M2's weights may be a model or the published ones.
        let (model, weights) = if method == Method::M2 { (None, model) } else { (model, None) };
        let learned_from = super::capacity::read_learned(&mut options, model, weights)?;
        let rows = match capacity::run(&options, &|_, _| {}, crate::interrupt::flag()) {
            Err(error @ CcmError::Interrupted) => {
                eprintln!("{error}");
                return Ok(None);
            }
            rows => rows?,
        };
        let folder = args.out.join("capacity");
        std::fs::create_dir_all(&folder).map_err(|e| CcmError::io(&folder, e))?;
        let path = folder.join(format!("{}.csv", method.name()));
        capacity::write(&path, &options, &rows)?;
        tables.push(CapacityTable { name, path, own: Some(takes(method)), learned_from });
    }
    Ok(Some(tables))
}

#[cfg(feature = "nets")]
fn systems(args: &Args) -> Result<Vec<Box<dyn System>>, Failure> {
    use std::sync::Arc;

    use corsmal_systems::training::Weights;

    let methods = args.methods.iter().map(|name| corsmal_systems::named(name));
    let methods = methods.collect::<Result<Vec<_>, _>>()?;
    let mut weights = Vec::with_capacity(args.weights.len());
    for (name, path) in &args.weights {
        let network = corsmal_nets::networks::named(name)?.name;
        if !methods.iter().any(|method| method.networks.contains(&network)) {
            return Err(Failure::new(format!(
                "--weights {name}: no system of this run has that network"
            )));
        }
        if weights.iter().any(|(known, _)| known == network) {
            return Err(Failure::new(format!("--weights {name}: given twice")));
        }
        crate::networks::refuse_own(&format!("--weights {name}"), path)?;
        weights.push((network.to_owned(), Arc::new(Weights::read(path)?)));
    }
    if let (Some((name, _)), false) =
        (args.embeddings.first(), methods.iter().any(|method| method.name == "m5"))
    {
        return Err(Failure::new(format!("--embeddings {name}: only m5 takes embeddings")));
    }
    let epochs = args.epochs.map(|n| n as usize);
    let embeddings = args.embeddings.clone();
    let device = corsmal_nets::device::Device::named(&args.device)?;
    crate::networks::tell_device(&device, args.quiet);
    let settings = corsmal_systems::Settings { epochs, embeddings, weights, device };
    Ok(methods.into_iter().map(|method| method.make(&settings)).collect())
}

#[cfg(not(feature = "nets"))]
fn systems(args: &Args) -> Result<Vec<Box<dyn System>>, Failure> {
    // What these say is for the systems.
    let Args { epochs: _, embeddings: _, weights: _, device: _, .. } = args;
    if args.methods.is_empty() { Ok(Vec::new()) } else { Err(super::nets::absent()) }
}

/// Runs baselines and systems and writes the report.
pub fn run(args: Args) -> Result<ExitCode, Failure> {
    crate::publish::require_disk(&args.out)?;
    let systems = systems(&args)?;
    let baselines = match (args.baselines.is_empty(), systems.is_empty()) {
        (true, true) => Baseline::all(),
        _ => args.baselines.clone(),
    };
    let interrupted = |error: CcmError| {
        eprintln!("{error}");
        Ok(ExitCode::from(INTERRUPTED))
    };
    let Some(capacities) = capacities(&args)? else { return Ok(ExitCode::from(INTERRUPTED)) };
    let options = BenchmarkOptions {
        data: args.data.clone(),
        out: args.out.clone(),
        baselines,
        systems,
        added: args.add.clone(),
        capacities,
        detections: args.detections.clone(),
        jobs: args.jobs.count(),
        seed: args.seed,
        made: Made { on: Some(made::today()), command: Some(made::command()) },
    };
    let quiet = args.quiet;
    let stop = crate::interrupt::flag();
    let progress = |step: &str| {
        if !quiet || step.starts_with("warning: ") {
            eprintln!("{step}");
        }
    };
    let Finished { report, failed } = match benchmark::run(&options, &progress, stop) {
        Err(error @ CcmError::Interrupted) => return interrupted(error),
        finished => finished?,
    };
    if args.json {
        println!("{}", serde_json::to_string_pretty(&report)?);
    } else if !quiet {
        print!("{}{}", scores(&report), amounts(&report));
        if let Some(warning) = &report.warning {
            println!("{}\n", wrapped(warning, ""));
        }
        println!("{}", options.out.join("report.html").display());
    }
    Ok(if failed.is_empty() { ExitCode::SUCCESS } else { ExitCode::from(FAILED_FILES) })
}

/// The scores of capacity and filling mass, and the error of the weight, of the methods that
/// estimate them; nothing where there is none.
fn amounts(report: &Report) -> String {
    let tables: Vec<_> = report.sections.iter().flat_map(|s| &s.tables).collect();
    let table = |name: &str| tables.iter().find(|t| t.name == name);
    let weighed = |row: &&Row| {
        let same = |other: &Row| other.cells.first() == row.cells.first();
        table("weight").is_some_and(|weight| weight.rows.iter().any(same))
    };
    let mut out = String::new();
    for (name, about) in [
        ("capacity", "capacity, percent"),
        ("mass", "filling mass, percent"),
        ("weight", "error of the object's weight, newtons"),
    ] {
        let Some(table) = table(name) else { continue };
        let own = |row: &&Row| row.source != Source::Paper && row.cells.first() != Some(&random());
        // Of the filling mass those that estimate all of it, which are those with a weight.
        let whole = |row: &&Row| name != "mass" || weighed(row);
        let rows: Vec<&Row> = table.rows.iter().filter(own).filter(whole).collect();
        if rows.is_empty() {
            continue;
        }
        let text = |cell: &Cell| match cell {
            Cell::Text(text) => text.clone(),
            _ => String::new(),
        };
        let width = rows.iter().map(|r| text(&r.cells[0]).chars().count()).max().unwrap_or(6);
        let parts = ["Training", "Public", "Private", "Combined"];
        let places: Vec<(usize, &str)> = parts
            .into_iter()
            .filter_map(|part| Some((table.columns.iter().position(|c| c == part)?, part)))
            .filter(|(place, _)| rows.iter().any(|row| row.cells[*place] != Cell::None))
            .collect();
        let heads: String = places.iter().map(|(_, part)| format!("{part:>10}")).collect();
        out.push_str(&format!("{about}\n\n{:width$}{heads}\n", "method"));
        for row in rows {
            let number = |(place, _): &(usize, &str)| match row.cells[*place].value() {
                Some(value) if name == "weight" => format!("{value:10.3}"),
                Some(value) => format!("{value:10.2}"),
                None => format!("{:>10}", "\u{2013}"),
            };
            let numbers: String = places.iter().map(number).collect();
            out.push_str(&format!("{:width$}{numbers}\n", text(&row.cells[0])));
        }
        out.push('\n');
    }
    out
}

fn random() -> Cell {
    Cell::text("Random")
}

/// The scores of this run on recordings that were not trained on, from the report's tables of the
/// two classification tasks.
fn scores(report: &Report) -> String {
    const TASKS: [(&str, &str); 2] = [("level", "filling level"), ("type", "filling type")];
    let tables = report.sections.iter().flat_map(|s| &s.tables);
    let rows = |name: &str| -> Vec<&Row> {
        let table = tables.clone().find(|t| t.name == name);
        let rows = table.into_iter().flat_map(|t| &t.rows);
        rows.filter(|row| row.source != Source::Paper).collect()
    };
    let [levels, types] = TASKS.map(|(name, _)| rows(name));
    let word = |cell: Option<&Cell>| match cell {
        Some(Cell::Text(text)) => text.clone(),
        _ => String::new(),
    };
    // Method, inputs, protocol, then the score on the training part.
    let score = |cell: Option<&Cell>| match cell {
        Some(Cell::Score(value, Some((low, high)))) => {
            format!("{value:6.2}  {low:.1}\u{2013}{high:.1}")
        }
        Some(Cell::Score(value, None)) => format!("{value:6.2}"),
        _ => "     \u{2013}".into(),
    };
    let same =
        |a: &Row, b: &Row| [0, 2].iter().all(|&c| word(a.cells.get(c)) == word(b.cells.get(c)));
    // A method may address one of the tasks only.
    let alone = types.iter().filter(|row| !levels.iter().any(|other| same(row, other)));
    let shown: Vec<&Row> = levels.iter().chain(alone).copied().collect();
    let width = shown.iter().map(|r| word(r.cells.first()).chars().count()).max().unwrap_or(6);
    let mut out = format!(
        "\nweighted F1 on held-out training recordings, percent, with 95 % intervals\n\n\
         {:width$}  {:10}  {:21}{}\n",
        "method", "protocol", TASKS[0].1, TASKS[1].1
    );
    for row in shown {
        let (method, protocol) = (word(row.cells.first()), word(row.cells.get(2)));
        let of = |rows: &[&Row]| {
            score(rows.iter().find(|other| same(row, other)).and_then(|r| r.cells.get(3)))
        };
        let (level, kind) = (of(&levels), of(&types));
        out.push_str(&format!("{method:width$}  {protocol:10}  {level:21}{kind}\n"));
    }
    out + "\n"
}
