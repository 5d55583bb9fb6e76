//! Values of a recording: in memory while they are few, in an unnamed temporary file beyond that.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use rayon::prelude::*;

/// Bytes of one series kept in memory before it moves to a file.
const IN_MEMORY: usize = 24 << 20;

/// Chunks of `f32` values, appended in order and read back in order.
pub struct Store {
    chunks: Vec<Vec<f32>>,
    bytes: usize,
    spilled: Option<Spilled>,
    folder: PathBuf,
}

struct Spilled {
    file: File,
    lengths: Vec<usize>,
}

impl Store {
    /// An empty store that would put its temporary file into `folder`.
    pub fn new(folder: &Path) -> Self {
        Self { chunks: Vec::new(), bytes: 0, spilled: None, folder: folder.to_path_buf() }
    }

    /// Number of values.
    pub fn len(&self) -> usize {
        self.bytes / size_of::<f32>()
    }

    /// Whether there is no value.
    pub fn is_empty(&self) -> bool {
        self.bytes == 0
    }

    /// Appends a chunk.
    ///
    /// # Errors
    /// The temporary file cannot be made or written.
    pub fn push(&mut self, chunk: Vec<f32>) -> io::Result<()> {
        if chunk.is_empty() {
            return Ok(());
        }
        self.bytes += chunk.len() * size_of::<f32>();
        match &mut self.spilled {
            Some(spilled) => return spilled.write(&chunk),
            None => self.chunks.push(chunk),
        }
        if self.bytes > IN_MEMORY && self.chunks.len() > 1 {
            let mut spilled =
                Spilled { file: tempfile::tempfile_in(&self.folder)?, lengths: Vec::new() };
            for chunk in self.chunks.drain(..) {
                spilled.write(&chunk)?;
            }
            self.spilled = Some(spilled);
        }
        Ok(())
    }

    /// Calls `each` with batches of up to `batch` successive chunks.
    ///
    /// # Errors
    /// The temporary file cannot be read, or what `each` returns.
    pub fn batches<E: From<io::Error>>(
        &mut self,
        batch: usize,
        mut each: impl FnMut(&[Vec<f32>]) -> Result<(), E>,
    ) -> Result<(), E> {
        let Some(spilled) = &mut self.spilled else {
            return self.chunks.chunks(batch.max(1)).try_for_each(each);
        };
        spilled.batches(batch, |chunks| each(&chunks))
    }

    /// Puts `f` of every chunk in its place, several at a time by the threads of the pool.
    ///
    /// # Errors
    /// A temporary file fails.
    pub fn map(mut self, f: impl Fn(Vec<f32>) -> Vec<f32> + Sync) -> io::Result<Self> {
        let mut out = Self::new(&self.folder);
        let mut each = |chunks: Vec<Vec<f32>>| {
            let mapped: Vec<_> = chunks.into_par_iter().map(&f).collect();
            mapped.into_iter().try_for_each(|chunk| out.push(chunk))
        };
        match &mut self.spilled {
            Some(spilled) => spilled.batches(rayon::current_num_threads(), each)?,
            None => each(self.chunks)?,
        }
        Ok(out)
    }

    /// All values, where they are one chunk in memory.
    pub fn single(&self) -> Option<&[f32]> {
        match self.chunks.as_slice() {
            [] if self.spilled.is_none() => Some(&[]),
            [chunk] if self.spilled.is_none() => Some(chunk),
            _ => None,
        }
    }

    /// All values in memory.
    ///
    /// # Errors
    /// The temporary file cannot be read.
    pub fn into_vec(mut self) -> io::Result<Vec<f32>> {
        if self.spilled.is_none() && self.chunks.len() == 1 {
            return Ok(self.chunks.remove(0));
        }
        let mut all = Vec::with_capacity(self.len());
        self.batches(1, |chunks| {
            chunks.iter().for_each(|c| all.extend_from_slice(c));
            io::Result::Ok(())
        })?;
        Ok(all)
    }
}

impl Spilled {
    fn write(&mut self, chunk: &[f32]) -> io::Result<()> {
        self.lengths.push(chunk.len());
        self.file.write_all(bytemuck::cast_slice(chunk))
    }

    fn batches<E: From<io::Error>>(
        &mut self,
        batch: usize,
        mut each: impl FnMut(Vec<Vec<f32>>) -> Result<(), E>,
    ) -> Result<(), E> {
        self.file.seek(SeekFrom::Start(0))?;
        for lengths in self.lengths.chunks(batch.max(1)) {
            let mut read = |n: &usize| {
                let mut chunk = vec![0.0_f32; *n];
                self.file.read_exact(bytemuck::cast_slice_mut(&mut chunk))?;
                Ok(chunk)
            };
            each(lengths.iter().map(&mut read).collect::<io::Result<_>>()?)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chunks_come_back_in_order_from_memory_and_from_disk() {
        for chunk_len in [10, 3 << 20] {
            let mut store = Store::new(&std::env::temp_dir());
            for i in 0..4 {
                store.push(vec![i as f32; chunk_len]).unwrap();
            }
            assert_eq!(store.len(), 4 * chunk_len);
            let mut seen = Vec::new();
            store
                .batches(3, |chunks| {
                    chunks.iter().for_each(|c| seen.push((c[0], c.len())));
                    io::Result::Ok(())
                })
                .unwrap();
            assert_eq!(seen, [0.0, 1.0, 2.0, 3.0].map(|v| (v, chunk_len)));
            assert_eq!(store.into_vec().unwrap().len(), 4 * chunk_len);
        }
    }
}
