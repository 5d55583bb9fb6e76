//! The memory that extractors work in, handed on from one recording to the next: made anew for each, it
//! would leave a hole in the heap for each.

use std::sync::Mutex;

use super::stream::Scratch;

/// Bytes of a buffer that is handed on, at most (16 MiB): 64 channels of M4's recordings.
const MOST: usize = 16 << 20;

/// What an extractor works in.
#[derive(Default)]
pub struct Workspace {
    /// Interleaved samples; those before the extractor's head are done with.
    pub buffer: Vec<f32>,
    pub scratch: Scratch,
}

impl Workspace {
    /// Values that a buffer of samples may hold to be handed on.
    pub const MOST_SAMPLES: usize = MOST / size_of::<f32>();
}

/// Workspaces that no extractor uses, as many as there are threads at most.
#[derive(Default)]
pub struct Workspaces(Mutex<Vec<Workspace>>);

impl Workspaces {
    /// Memory for an extractor.
    pub fn take(&self) -> Workspace {
        self.0.lock().unwrap_or_else(|e| e.into_inner()).pop().unwrap_or_default()
    }

    /// Keeps the memory of an extractor for the next one, but for buffers that are long.
    pub fn give(&self, mut workspace: Workspace) {
        let Workspace { buffer, scratch } = &mut workspace;
        clear(buffer);
        clear(&mut scratch.edge);
        // Their lengths stay: every row is written before it is read.
        for rows in [&mut scratch.frames, &mut scratch.spectrum, &mut scratch.rows] {
            if is_long(rows) {
                *rows = Vec::new();
            }
        }
        let mut idle = self.0.lock().unwrap_or_else(|e| e.into_inner());
        if idle.len() < rayon::current_num_threads() {
            idle.push(workspace);
        }
    }

    #[cfg(test)]
    pub fn idle(&self) -> usize {
        self.0.lock().unwrap().len()
    }

    #[cfg(test)]
    pub fn bytes(&self) -> usize {
        let bytes = |work: &Workspace| {
            let Scratch { frames, spectrum, rows, edge } = &work.scratch;
            let rows = [frames, spectrum, rows]
                .iter()
                .map(|rows| size_of_val(rows.as_slice()))
                .sum::<usize>();
            size_of::<f32>() * (work.buffer.capacity() + edge.capacity()) + rows
        };
        self.0.lock().unwrap().iter().map(bytes).sum()
    }
}

fn is_long<T>(values: &Vec<T>) -> bool {
    values.capacity() > MOST / size_of::<T>()
}

fn clear<T>(values: &mut Vec<T>) {
    match is_long(values) {
        true => *values = Vec::new(),
        false => values.clear(),
    }
}
