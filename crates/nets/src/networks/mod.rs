//! The networks of the paper, a file each, and the table that names them.
//!
//! Adding one: a file here with a [`Definition`], and one line in the list below.

use crate::error::{NetError, Result};
use crate::front_end::FrontEnd;
use crate::network::{Architecture, Network};
use crate::recipe::Recipe;

/// A published network.
#[derive(Clone, Copy, Debug)]
pub struct Definition {
    /// name on the command line; hyphen and underscore are equal
    pub name: &'static str,
    /// one sentence
    pub about: &'static str,
    /// outputs of the published network
    pub outputs: usize,
    /// whether the outputs are classes, and not one number
    pub classifies: bool,
    /// layers, for a number of outputs
    pub architecture: fn(usize) -> Architecture,
    /// how its input comes from a recording; `None` where it takes what other networks give, or
    /// more than sound
    pub front_end: Option<FrontEnd>,
    /// training as the published code has it, its defects corrected
    pub recipe: Recipe,
}

macro_rules! networks {
    ($($module:ident: $($definition:ident),+;)*) => {
        $(mod $module;)*

        /// All published networks.
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

/// Most outputs a network may be given.
pub const MAX_OUTPUTS: usize = 1 << 16;

impl Definition {
    /// With initial numbers of this seed and as many outputs as asked for, or as published.
    ///
    /// # Errors
    /// No outputs, or more than [`MAX_OUTPUTS`].
    pub fn build(&self, outputs: Option<usize>, seed: u64) -> Result<Network> {
        let outputs = outputs.unwrap_or(self.outputs);
        if outputs == 0 || outputs > MAX_OUTPUTS {
            return Err(NetError::Recipe {
                key: "outputs".into(),
                value: outputs.to_string(),
                allowed: format!("1 to {MAX_OUTPUTS}"),
            });
        }
        Network::new(self.name, (self.architecture)(outputs), seed)
    }
}
