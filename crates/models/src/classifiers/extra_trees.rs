//! Extremely randomised trees (Geurts et al. 2006): thresholds drawn at random, the best of the
//! drawn features kept.

super::trees::forest! {
    /// Parameters of extremely randomised trees.
    ExtraTreesParams, "et", bootstrap: false, random_thresholds: true
}
