//! `corsmal-feat embed vggish`: windows of recordings.

use std::path::Path;
use std::process::ExitCode;

use corsmal_files::format::require_npz;
use corsmal_systems::SystemError;
use corsmal_systems::embedding::Embedder;

use super::args::Args;
use crate::failure::{Failure, INTERRUPTED};
use crate::recordings;

/// Embeds recordings and writes.
pub fn run(args: &Args, weights: &Path) -> Result<ExitCode, Failure> {
    require_npz(&args.out)?;
    crate::publish::check(&args.out, args.overwrite)?;
    let embedder = Embedder::new(&args.network, weights)?;
    let found = recordings::named(&args.paths, recordings::warn)?;
    let columns = found.iter().flat_map(|input| &input.labels).map(|(name, _)| name.as_str());
    corsmal_nets::dataset::require_names(&args.out, columns)?;
    let stop = crate::interrupt::flag();
    let mut failed = 0;
    let embedded = embedder.embed(&found, args.jobs.count(), stop, |input, status, reason| {
        eprintln!("{}: {status}: {reason}", input.id);
        failed += 1;
    });
    let dataset = match embedded {
        Err(SystemError::Interrupted) => {
            eprintln!("interrupted; nothing was written");
            return Ok(ExitCode::from(INTERRUPTED));
        }
        embedded => embedded?,
    };
    if dataset.ids.is_empty() {
        return Err(Failure::new("no recording has an embedding: nothing was written"));
    }
    let (recordings, width) = (dataset.ids.len(), embedder.width());
    let rows = dataset.items.columns[0].values.len() / width;
    dataset.write_sequences(&args.out, width, &embedder.provenance(&found).to_string())?;
    args.tell(recordings, [rows, width], failed)
}
