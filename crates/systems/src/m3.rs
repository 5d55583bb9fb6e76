use crate::definition::Definition;

/// Concatenation's system.
pub(crate) const M3: Definition = Definition {
    name: "m3",
    about: "M3 (Concatenation): level and type by a perceptron for each category of container",
    networks: &["m3_mlp"],
    limits: &["The category comes from detections in the four views, which `benchmark` does not \
               read yet; its network m3-mlp can be trained, and --add joins predictions that were \
               made elsewhere."],
    make: None,
};
