//! Networks instead of classifiers.

use std::path::PathBuf;

/// Options of classifiers. What needs --net names them, too: clap does not ask for an option that
/// another one excludes.
pub const CLASSIFIER: [&str; 4] = ["classifier", "standardize", "pca", "tune"];

/// Which network is trained.
#[derive(clap::Args)]
pub struct NetworkArgs {
    /// Train a network of `corsmal-feat nets` instead of a classifier, from recordings, from an .npz
    /// of its inputs, or from pictures; --set changes its recipe, such as epochs=5.
    #[arg(long, value_name = "NAME")]
    #[arg(conflicts_with_all = CLASSIFIER)]
    pub net: Option<String>,
    /// Where the network trains: cpu, or gpu in a build with the feature `gpu`.
    #[arg(long, value_name = "DEVICE", default_value = "cpu", requires = "net")]
    #[arg(conflicts_with_all = CLASSIFIER, value_parser = ["cpu", "gpu"])]
    pub device: String,
    /// Start from these weights instead of random numbers: .pth, .npz or .safetensors with the
    /// network's names, such as torchvision's for ResNet-18. The last layer may have had other classes.
    #[arg(long, value_name = "FILE", requires = "net", conflicts_with_all = CLASSIFIER)]
    pub weights: Option<PathBuf>,
    /// Folder in which to save the training after each epoch; the next run continues from it.
    #[arg(long, value_name = "FOLDER", requires = "net", conflicts_with_all = CLASSIFIER)]
    pub checkpoints: Option<PathBuf>,
}
