//! The networks of the paper and our own, a file each, and the table that names them.
//!
//! Adding one: a file here with a [`Definition`], and one line in the list below.

use crate::error::{NetError, Result};

mod definition;

pub use definition::{Definition, MAX_OUTPUTS};

macro_rules! networks {
    ($($module:ident: $($definition:ident),+;)*) => {
        $(mod $module;)*

        /// All networks.
        pub const NETWORKS: &[Definition] = &[$($($module::$definition),+),*];
    };
}

networks! {
    m1: M1;
    m2_type: M2_TYPE;
    m2_capacity: M2_CAPACITY;
    m3_mlp: M3_MLP;
    m4_type: M4_TYPE;
    m4_level: M4_LEVEL;
    m5_vggish: M5_VGGISH_LEVEL, M5_VGGISH_TYPE;
    m5_r21d: M5_R21D_LEVEL, M5_R21D_TYPE;
    m6: M6_ACTION, M6_POURING, M6_SHAKING;
    vggish: VGGISH;
    resnet18: RESNET18_LEVEL, RESNET18_TYPE;
    attention_gru: ATTENTION_GRU;
    mel_cnn: MEL_CNN;
}

/// The definition of this name.
///
/// # Errors
/// [`NetError::UnknownNetwork`].
pub fn named(name: &str) -> Result<&'static Definition> {
    let wanted = name.replace('-', "_").to_ascii_lowercase();
    NETWORKS.iter().find(|d| d.name == wanted).ok_or_else(|| NetError::UnknownNetwork {
        name: name.into(),
        allowed: NETWORKS.iter().map(|d| d.name).collect::<Vec<_>>().join(", "),
    })
}

/// The same, where its outputs are classes.
///
/// # Errors
/// [`NetError::UnknownNetwork`], [`NetError::NoClasses`].
pub fn classifier(name: &str) -> Result<&'static Definition> {
    let definition = named(name)?;
    match definition.classifies {
        true => Ok(definition),
        false => Err(NetError::NoClasses { network: definition.name.into() }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_paper_changes_what_it_says() {
        let with = |name: &str, text: &str| {
            let changes = serde_json::from_str(text).unwrap();
            named(name).unwrap().recipe_with(&changes)
        };
        let recipe = with("m4_level", r#"{"recipe": "paper", "epochs": 3}"#).unwrap();
        assert_eq!((recipe.lr, recipe.batch, recipe.epochs), (1e-5, 32, 3));
        let code = named("m1").unwrap().recipe;
        assert_eq!(with("m1", r#"{"recipe": "paper"}"#).unwrap(), code);
        assert!(with("m1", r#"{"recipe": "other"}"#).is_err());
    }

    #[test]
    fn what_would_change_nothing_is_refused() {
        for (name, key, value, used_by) in [
            ("m1", "momentum", "0.9", "m2_type"),
            ("m6_action", "activation", "\"double\"", "m4_type"),
            ("mel_cnn", "padding", "\"published\"", "m5_vggish_level"),
            ("m4_type", "offset", "\"random\"", "m4_level"),
        ] {
            let with = |name: &str| {
                let changes = serde_json::from_str(&format!("{{\"{key}\": {value}}}")).unwrap();
                named(name).unwrap().recipe_with(&changes)
            };
            let refusal = with(name).unwrap_err().to_string();
            assert!(refusal.contains(key), "{refusal}");
            assert!(with(used_by).is_ok(), "{used_by}");
        }
    }
}
