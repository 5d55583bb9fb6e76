//! How many threads work.

use crate::failure::Failure;

/// The number of worker threads.
#[derive(clap::Args, Clone, Copy)]
pub struct Jobs {
    /// Worker threads; one per core by default.
    #[arg(long, short, value_name = "N", env = "CORSMAL_FEAT_JOBS")]
    #[arg(value_parser = clap::value_parser!(u16).range(1..=1024))]
    jobs: Option<u16>,
}

impl Jobs {
    /// So many threads.
    pub fn pool(self) -> Result<rayon::ThreadPool, Failure> {
        Ok(rayon::ThreadPoolBuilder::new().num_threads(self.count()).build()?)
    }

    /// The number.
    pub fn count(self) -> usize {
        let cores = || std::thread::available_parallelism().map_or(1, usize::from);
        self.jobs.map_or_else(cores, usize::from)
    }
}
