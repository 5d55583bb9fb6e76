//! What the output of M2's network means.

use crate::error::Result;
use crate::network::Network;

/// The network's output is the capacity over this many mL.
pub(super) const LARGEST_ML: f64 = 4000.0;
/// Side of its input in px.
pub(super) const SIDE: usize = 112;

/// Capacity in mL of one region.
pub(super) fn millilitres_of(network: &Network, depth: &[f32], size: [f32; 2]) -> Result<f64> {
    let depth = (vec![1, 1, SIDE, SIDE], depth.to_vec());
    let inputs = network.batches(&[depth, (vec![1, 2], size.to_vec())])?;
    let outputs = network.forward(&inputs)?;
    Ok(outputs.values.values().iter().map(|&y| f64::from(y) * LARGEST_ML).sum())
}
