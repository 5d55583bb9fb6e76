//! Random forest (Breiman 2001): trees on bootstrap samples, features drawn anew in every split,
//! class fractions averaged.

super::trees::forest! {
    /// Parameters of a random forest.
    RandomForestParams, "rf", bootstrap: true, random_thresholds: false
}
