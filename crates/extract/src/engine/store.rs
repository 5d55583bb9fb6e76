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
    /// Bytes of the chunks as they were appended.
    bytes: usize,
    spilled: Option<Spilled>,
    folder: PathBuf,
}

struct Spilled {
    file: File,
    lengths: Vec<usize>,
    /// What is done to chunks that come back.
    finish: Option<Finish>,
}

/// Makes finished values of stored ones.
pub struct Finish {
    /// Values stored, and what becomes of as many.
    pub per_frame: (usize, usize),
    /// Finishes the values of whole frames.
    pub of: Box<dyn Fn(Vec<f32>) -> Vec<f32> + Send + Sync>,
}

impl Store {
    /// An empty store that would put its temporary file into `folder`.
    pub fn new(folder: &Path) -> Self {
        Self { chunks: Vec::new(), bytes: 0, spilled: None, folder: folder.to_path_buf() }
    }

    /// Number of values.
    pub fn len(&self) -> usize {
        let stored = self.bytes / size_of::<f32>();
        match self.spilled.as_ref().and_then(|spilled| spilled.finish.as_ref()) {
            Some(Finish { per_frame: (from, to), .. }) => stored / from * to,
            None => stored,
        }
    }

    /// Whether there is no value.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Appends a chunk to one that is not finished.
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
            let file = tempfile::tempfile_in(&self.folder)?;
            let mut spilled = Spilled { file, lengths: Vec::new(), finish: None };
            for chunk in self.chunks.drain(..) {
                spilled.write(&chunk)?;
            }
            self.spilled = Some(spilled);
        }
        Ok(())
    }

    /// Calls `each` with one chunk after the other. What comes next of a temporary file is made ready by another
    /// thread of the pool meanwhile.
    ///
    /// # Errors
    /// The temporary file cannot be read, or what `each` returns.
    pub fn chunks<E: From<io::Error>>(
        &mut self,
        mut each: impl FnMut(&[f32]) -> Result<(), E>,
    ) -> Result<(), E> {
        match &mut self.spilled {
            Some(spilled) => spilled.chunks(each),
            None => self.chunks.iter().try_for_each(|chunk| each(chunk)),
        }
    }

    /// Finishes all values: those in memory now, several chunks at a time by the threads of the pool, those in a
    /// temporary file as they come back.
    pub fn finish(mut self, finish: Finish) -> Self {
        if let Some(spilled) = &mut self.spilled {
            spilled.finish = Some(finish);
            return self;
        }
        self.chunks = self.chunks.into_par_iter().map(&finish.of).collect();
        self.bytes = self.chunks.iter().map(|chunk| size_of_val(chunk.as_slice())).sum();
        self
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
        self.chunks(|chunk| {
            all.extend_from_slice(chunk);
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

    fn chunks<E: From<io::Error>>(
        &mut self,
        mut each: impl FnMut(&[f32]) -> Result<(), E>,
    ) -> Result<(), E> {
        let Self { file, lengths, finish } = self;
        file.seek(SeekFrom::Start(0))?;
        let mut rest = lengths.iter();
        let mut next = || {
            let chunk = rest.next().map(|length| -> io::Result<Vec<f32>> {
                let mut chunk = vec![0.0; *length];
                file.read_exact(bytemuck::cast_slice_mut(&mut chunk))?;
                Ok(match finish {
                    Some(finish) => (finish.of)(chunk),
                    None => chunk,
                })
            });
            chunk.transpose()
        };
        let mut current = next()?;
        while let Some(chunk) = current {
            // Not by rayon's global threads, which a process that was forked lacks.
            current = if rayon::current_thread_index().is_some() {
                let mut ahead = Ok(None);
                let done = rayon::in_place_scope(|scope| {
                    scope.spawn(|_| ahead = next());
                    each(&chunk)
                });
                done?;
                ahead?
            } else {
                each(&chunk)?;
                next()?
            };
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chunks_come_back_in_order_from_memory_and_from_disk() {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
        for (chunk_len, in_pool) in [(10, true), (3 << 20, true), (3 << 20, false)] {
            let made = |finish: bool| {
                let mut store = Store::new(&std::env::temp_dir());
                for i in 0..4 {
                    store.push(vec![i as f32; chunk_len]).unwrap();
                }
                if !finish {
                    return store;
                }
                // Of two values one, greater by one.
                let of = |chunk: Vec<f32>| chunk.iter().step_by(2).map(|v| v + 1.0).collect();
                store.finish(Finish { per_frame: (2, 1), of: Box::new(of) })
            };
            let seen = |store: &mut Store| {
                let mut seen = Vec::new();
                store
                    .chunks(|chunk| {
                        seen.push((chunk[0], chunk.len()));
                        io::Result::Ok(())
                    })
                    .unwrap();
                seen
            };
            let check = || {
                let mut store = made(false);
                assert_eq!(store.len(), 4 * chunk_len);
                assert_eq!(seen(&mut store), [0.0, 1.0, 2.0, 3.0].map(|v| (v, chunk_len)));
                assert_eq!(store.into_vec().unwrap().len(), 4 * chunk_len);
                let mut store = made(true);
                assert_eq!(store.len(), 2 * chunk_len);
                for _ in 0..2 {
                    let expected = [1.0, 2.0, 3.0, 4.0].map(|v| (v, chunk_len / 2));
                    assert_eq!(seen(&mut store), expected);
                }
                assert_eq!(store.into_vec().unwrap().len(), 2 * chunk_len);
            };
            if in_pool { pool.install(check) } else { check() }
        }
    }
}
