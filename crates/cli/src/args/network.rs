//! Networks instead of classifiers.

use std::path::PathBuf;

/// Which network is trained.
#[derive(clap::Args)]
pub struct NetworkArgs {
    /// Train a network of `corsmal-feat nets` instead of a classifier, from an .npz of its inputs;
    /// --set changes its recipe, such as epochs=5.
    #[arg(long, value_name = "NAME")]
    #[arg(conflicts_with_all = ["classifier", "standardize", "pca", "tune"])]
    pub net: Option<String>,
    /// Folder in which the training is kept after each epoch, and from which it goes on.
    #[arg(long, value_name = "FOLDER", requires = "net")]
    pub checkpoints: Option<PathBuf>,
}
