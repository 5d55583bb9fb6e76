//! Recordings as the numbers that a network makes of them.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use corsmal_extract::config::Config;
use corsmal_extract::inputs::{self, Input};
use corsmal_extract::run::Recordings;
use corsmal_files::identity;
use corsmal_files::outcome::Status;
use corsmal_nets::dataset::Dataset;
use corsmal_nets::front_end::{FrontEnd, Tensor};
use corsmal_nets::items::{Column, Items};
use corsmal_nets::network::Network;
use corsmal_nets::networks::{self, Definition};
use corsmal_nets::recipe::Padding;
use corsmal_nets::weights;
use serde_json::{Value, json};

use crate::error::{Result, SystemError};
use crate::recordings;

/// Items of a pass.
const TOGETHER: usize = 64;

/// A network that embeds recordings.
pub struct Embedder {
    definition: &'static Definition,
    front_end: FrontEnd,
    config: Config,
    network: Network,
    /// identity of the file of weights
    weights: String,
}

impl Embedder {
    /// The network of this name with weights from a file.
    ///
    /// # Errors
    /// A network that does not embed; weights that are not its own.
    pub fn new(name: &str, path: &Path) -> Result<Self> {
        let definition = networks::named(name)?;
        if definition.classifies {
            return Err(SystemError::NoEmbeddings { network: definition.name });
        }
        let front_end = recordings::front_end(definition)?;
        let config = recordings::configuration(&front_end)?;
        let state = weights::read(path)?;
        let mut network = definition.build(None, 0)?;
        network
            .load_state(&state)
            .map_err(|e| SystemError::OtherWeights { path: path.into(), source: Box::new(e) })?;
        let weights = identity::of_file(path)
            .map_err(|source| SystemError::Io { path: path.into(), source })?;
        Ok(Self { definition, front_end, config, network, weights })
    }

    /// Numbers of a row.
    pub fn width(&self) -> usize {
        self.network.outputs()
    }

    /// How embeddings of these recordings were made, for the file that holds them.
    pub fn provenance(&self, recordings: &[Input]) -> Value {
        json!({
            "tool_version": env!("CARGO_PKG_VERSION"),
            "network": self.definition.name,
            "weights": self.weights,
            "config": self.config.to_value(),
            "config_hash": self.config.hash(),
            "inputs": inputs::list_hash(recordings),
        })
    }

    /// The rows of each recording, with its label columns, by `jobs` threads. `failed` is told each
    /// that has none, and why.
    ///
    /// # Errors
    /// Recordings that the network does not take; [`SystemError::Interrupted`] once `stop` is set.
    pub fn embed(
        &self,
        recordings: &[Input],
        jobs: usize,
        stop: &Arc<AtomicBool>,
        mut failed: impl FnMut(&Input, Status, &str),
    ) -> Result<Dataset> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(jobs).build()?;
        let engine = Recordings::new(Arc::new(self.config.clone()));
        let mut column = Column { values: Vec::new(), offsets: vec![0] };
        let mut embedded = Vec::new();
        for recorded in engine.in_order(recordings, jobs, stop)? {
            let recorded = recorded?;
            let (input, outcome) = (recorded.input, recorded.outcome);
            let tensor = match recorded.features.map(recordings::tensor) {
                None => {
                    failed(input, outcome.status, &outcome.reason);
                    continue;
                }
                Some(Err(reason)) => {
                    failed(input, Status::Io, &reason);
                    continue;
                }
                Some(Ok(tensor)) => tensor,
            };
            let rows = pool.install(|| self.rows(tensor))?;
            if let Some(odd) = rows.iter().find(|v| !v.is_finite()) {
                failed(input, Status::NonFinite, &format!("the embedding holds {odd}"));
                continue;
            }
            column.values.extend(rows);
            column.offsets.push(column.values.len());
            embedded.push(input);
        }
        let ids = embedded.iter().map(|input| input.id.clone()).collect();
        let columns = recordings::labels(&embedded);
        Ok(Dataset { ids, columns, items: Items { columns: vec![column] } })
    }

    /// The rows of one recording, one after another.
    fn rows(&self, tensor: Tensor) -> Result<Vec<f32>> {
        let patches = self.front_end.items(&self.network, tensor)?;
        let column = Column::of(patches.iter().map(|item| item.values.as_slice()));
        let items = Items { columns: vec![column] };
        let all: Vec<usize> = (0..items.len()).collect();
        let mut rows = Vec::with_capacity(all.len() * self.width());
        for part in all.chunks(TOGETHER) {
            let batch = items.batch(&self.network, part, Padding::Masked);
            rows.extend_from_slice(self.network.forward(&batch)?.values.values());
        }
        Ok(rows)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A small network in the place of VGGish, whose weights are 288 MB.
    fn small() -> Embedder {
        let definition = networks::named("m1").unwrap();
        let front_end = definition.front_end.unwrap();
        let config = recordings::configuration(&front_end).unwrap();
        let network = definition.build(Some(3), 1).unwrap();
        Embedder { definition, front_end, config, network, weights: "none".into() }
    }

    fn recordings(folder: &Path) -> Vec<Input> {
        let spec = hound::WavSpec {
            channels: 1,
            sample_rate: 44_100,
            bits_per_sample: 16,
            sample_format: hound::SampleFormat::Int,
        };
        let mut table = "path,level\n".to_owned();
        for take in 0..5_i32 {
            let path = folder.join(format!("{take}.wav"));
            if take == 3 {
                std::fs::write(&path, b"RIFF").unwrap();
            } else {
                let mut wav = hound::WavWriter::create(&path, spec).unwrap();
                (0..9000).for_each(|i| wav.write_sample((i * (300 + take)) as i16 / 2).unwrap());
                wav.finalize().unwrap();
            }
            table.push_str(&format!("{take}.wav,{}\n", take % 2));
        }
        let manifest = folder.join("all.csv");
        std::fs::write(&manifest, table).unwrap();
        inputs::collect(&[manifest]).unwrap().inputs
    }

    #[test]
    fn recordings_keep_their_order_and_labels_whatever_the_threads() {
        let folder = tempfile::tempdir().unwrap();
        let (embedder, found) = (small(), recordings(folder.path()));
        let stop = Arc::default();
        let embed = |found: &[Input], jobs| {
            let mut failed = Vec::new();
            let tell = |input: &Input, status, _: &str| failed.push((input.id.clone(), status));
            (embedder.embed(found, jobs, &stop, tell).unwrap(), failed)
        };
        let (all, failed) = embed(&found, 1);
        assert_eq!(all.ids, ["0", "1", "2", "4"]);
        assert_eq!(all.column("level").unwrap(), ["0", "1", "0", "0"]);
        assert_eq!(failed, [("3".to_owned(), Status::Corrupt)]);
        let (column, width) = (&all.items.columns[0], embedder.width());
        assert_eq!(column.offsets, [0, width, 2 * width, 3 * width, 4 * width]);
        assert_eq!(embed(&found, 3).0.items, all.items);
        let last = embed(&found[4..], 1).0.items;
        assert_eq!(last.columns[0].values, column.values[3 * width..]);
        stop.store(true, std::sync::atomic::Ordering::Relaxed);
        let stopped = embedder.embed(&found, 1, &stop, |_, _, _| ());
        assert!(matches!(stopped, Err(SystemError::Interrupted)));
    }
}
