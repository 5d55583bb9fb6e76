//! A block whose input is added to its output.

use crate::batch::{Batch, Shape};
use crate::error::{NetError, Result};
#[cfg(any(test, feature = "gpu"))]
use crate::gpu;
use crate::kernels;
use crate::layer::{Backward, Chain, Layer, Pass, kept_by};
use crate::parameters::Declared;

/// `main(x) + shortcut(x)`; an empty shortcut passes `x` on.
#[derive(Debug)]
pub struct Residual {
    main: Chain,
    shortcut: Chain,
}

impl Residual {
    /// From the two ways.
    pub fn new(main: Chain, shortcut: Chain) -> Self {
        Self { main, shortcut }
    }
}

impl Layer for Residual {
    fn describe(&self) -> String {
        let names =
            |chain: &Chain| chain.iter().map(|l| l.describe()).collect::<Vec<_>>().join("; ");
        match self.shortcut.is_empty() {
            true => format!("input + ({})", names(&self.main)),
            false => format!("({}) + ({})", names(&self.shortcut), names(&self.main)),
        }
    }

    fn parameters(&self) -> Vec<Declared> {
        self.main.iter().chain(&self.shortcut).flat_map(|l| l.parameters()).collect()
    }

    fn output(&self, input: Shape) -> Result<Shape> {
        let through = |chain: &Chain| chain.iter().try_fold(input, |s, l| l.output(s));
        let (main, shortcut) = (through(&self.main)?, through(&self.shortcut)?);
        let refusal = || NetError::layer(self.describe(), "the same shape from both paths", input);
        (main == shortcut).then_some(main).ok_or_else(refusal)
    }

    fn kept(&self, input: Shape) -> usize {
        kept_by(&self.main, input) + kept_by(&self.shortcut, input)
    }

    fn forward(&self, input: Batch, pass: &mut Pass<'_>) -> Batch {
        let short = pass.chain(&self.shortcut, input.clone());
        let mut out = pass.chain(&self.main, input);
        kernels::add(out.values.values_mut(), short.values.values());
        out
    }

    fn backward(&self, gradient: Batch, pass: &mut Backward<'_>) -> Batch {
        let wanted = pass.wanted;
        let mut main = pass.chain(&self.main, gradient.clone(), wanted);
        let short = pass.chain(&self.shortcut, gradient, wanted);
        if wanted {
            kernels::add(main.values.values_mut(), short.values.values());
        }
        main
    }

    #[cfg(any(test, feature = "gpu"))]
    fn on_gpu(&self, input: gpu::Flow, pass: &mut gpu::Pass<'_>) -> gpu::Flow {
        let short = pass.chain(&self.shortcut, input.clone());
        pass.chain(&self.main, input).zip(short, |main, short| main + short)
    }
}
