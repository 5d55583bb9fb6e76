//! M2's network: read, and trained.

use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;

use corsmal_ccm::CcmError;
use corsmal_ccm::capacity::{self, LabelledRegion, Method, RegionNetwork, Regions};
use corsmal_models::params::key_values;
use corsmal_nets::NetError;
use corsmal_nets::capacity::{self as network, CapacityNetwork, Example};
use corsmal_nets::fit::Progress;
use corsmal_vision::region::Region;
use serde_json::json;

use super::learning::{Args, SYNTHETIC, ended};
use super::source::{SEED, VariantName, learned_containers};
use crate::failure::{Failure, INTERRUPTED};
use crate::interrupt;
use crate::networks::tell;

/// A network and the hash of its file.
#[derive(Debug)]
struct Read(CapacityNetwork, String);

impl RegionNetwork for Read {
    fn capacity_ml(&self, region: &Region) -> Result<f64, String> {
        self.0.millilitres(&region.image, region.size).map_err(|e| e.to_string())
    }

    fn identity(&self) -> &str {
        &self.1
    }
}

/// The network of a model or of weights, and the containers that a model learned from.
pub(super) fn read(
    model: Option<&Path>,
    weights: Option<&Path>,
) -> Result<(Arc<dyn RegionNetwork>, Vec<u8>), Failure> {
    let (path, network) = match (model, weights) {
        (Some(model), None) => (model, CapacityNetwork::read_model(model)?),
        (None, Some(weights)) => (weights, CapacityNetwork::read(weights)?),
        _ => {
            return Err(Failure::new(
                "--method m2 needs either --model, made by `corsmal-feat capacity train --method \
                 m2`, or --weights, the published file of its network (.pth, .npz or .safetensors)",
            ));
        }
    };
    let learned_from = network.header.as_ref().map(|h| learned_containers(&h.provenance));
    let identity = corsmal_files::identity::of_file(path)
        .map_err(|e| Failure::new(format!("{}: {e}", path.display())))?;
    Ok((Arc::new(Read(network, identity)), learned_from.unwrap_or_default()))
}

/// Trains it on the regions of a data set's training recordings.
pub(super) fn train(args: Args) -> Result<ExitCode, Failure> {
    let mut changes = key_values(&args.parameters)?;
    if changes.insert("seed".into(), args.source.seed.unwrap_or(SEED).into()).is_some() {
        return Err(Failure::new("--set seed=…: give --seed instead"));
    }
    let recipe = network::recipe(&changes)?;
    let checkpoint = match &args.checkpoints {
        None => None,
        Some(folder) => {
            std::fs::create_dir_all(folder)
                .map_err(|e| Failure::new(format!("{}: {e}", folder.display())))?;
            Some(folder.join("training.safetensors"))
        }
    };
    let pool = args.source.jobs.pool()?;
    let options = args.source.options(Method::M2, VariantName::Corrected);
    crate::commands::dataset::open(&options.data)?;
    let found = match capacity::regions(&options, &|_, _| {}, interrupt::flag()) {
        Err(error @ CcmError::Interrupted) => {
            eprintln!("{error}");
            return Ok(ExitCode::from(INTERRUPTED));
        }
        found => found?,
    };
    let Regions { regions, provenance, recordings, synthetic, failed } = found;
    let mut examples = Vec::with_capacity(regions.len());
    for LabelledRegion { region, capacity, .. } in &regions {
        let (depth, size) = (&region.image, region.size);
        examples.push(Example { depth, size, millilitres: *capacity });
    }
    let progress = |told: Progress<'_>| {
        tell("m2_capacity", told, args.told.quiet, "score of held-out regions")
    };
    let trained = pool.install(|| {
        network::train(&examples, &recipe, provenance, checkpoint.as_deref(), progress)
    });
    let trained = trained.map_err(|error| match (&error, &checkpoint) {
        (NetError::Stopped { .. }, Some(_)) => {
            Failure::interrupted(format!("{error}; run the same command again to continue"))
        }
        (NetError::Stopped { .. }, None) => {
            Failure::interrupted(format!("{error}; --checkpoints FOLDER keeps finished epochs"))
        }
        _ => error.into(),
    })?;
    let bytes = trained.to_bytes().map_err(Failure::new)?;
    corsmal_files::draft::write(&args.out, &bytes)?;
    let used = regions.len();
    if args.told.json {
        let summary = json!({
            "out": args.out.display().to_string(), "recordings": recordings, "used": used, "failed": failed.len(),
            "synthetic": synthetic,
        });
        println!("{}", serde_json::to_string_pretty(&summary)?);
    } else if !args.told.quiet {
        let out = args.out.display();
        println!("{out}: learned from the regions of {used} of {recordings} recordings");
        if synthetic {
            println!("{}", SYNTHETIC);
        }
    }
    Ok(ended(&failed, recordings))
}
