//! Where networks compute.

use crate::error::{NetError, Result};

/// The processor or a GPU.
#[derive(Clone, Debug, Default)]
pub enum Device {
    /// the processor, on every core
    #[default]
    Cpu,
    /// a GPU
    #[cfg(any(test, feature = "gpu"))]
    Gpu(crate::gpu::Gpu),
}

impl Device {
    /// `cpu`, or `gpu` for the one that the graphics library takes by itself.
    ///
    /// # Errors
    /// [`NetError::NoDevice`] for other names, a build without GPUs, or a machine without one.
    pub fn named(name: &str) -> Result<Self> {
        let refusal =
            |reason: &str| Err(NetError::NoDevice { name: name.into(), reason: reason.into() });
        match name {
            "cpu" => Ok(Self::Cpu),
            #[cfg(feature = "gpu")]
            "gpu" => crate::gpu::Gpu::open().map(Self::Gpu),
            #[cfg(not(feature = "gpu"))]
            "gpu" => refusal("this build has no GPU support: build it with --features gpu"),
            _ => refusal("expected cpu or gpu"),
        }
    }

    /// What a GPU calls itself; none for the processor.
    pub fn gpu_name(&self) -> Option<&str> {
        match self {
            Self::Cpu => None,
            #[cfg(any(test, feature = "gpu"))]
            Self::Gpu(gpu) => Some(gpu.name()),
        }
    }
}
