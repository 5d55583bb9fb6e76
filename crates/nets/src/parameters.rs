//! The numbers of a network, under PyTorch's names and in PyTorch's layouts.

use std::collections::HashMap;
use std::sync::{Arc, OnceLock};

use rayon::prelude::*;

use crate::error::{NetError, Result};
#[cfg(any(test, feature = "gpu"))]
use crate::gpu::Uploaded;
use crate::matrix::Matrix;
use crate::packed::Packed;
use crate::random::Stream;
use crate::weights::State;

/// How a parameter starts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Initial {
    /// uniform within plus and minus this
    Uniform(f32),
    /// one value
    Constant(f32),
}

/// A parameter as a layer declares it.
#[derive(Clone, Debug)]
pub struct Declared {
    /// PyTorch's name, such as `conv1.weight`
    pub name: String,
    /// PyTorch's shape
    pub shape: Vec<usize>,
    /// first values
    pub initial: Initial,
    /// whether training changes it by its gradient (running statistics it does not)
    pub trained: bool,
}

impl Declared {
    /// A trained parameter.
    pub fn trained(name: String, shape: &[usize], initial: Initial) -> Self {
        Self { name, shape: shape.to_vec(), initial, trained: true }
    }

    /// A running statistic.
    pub fn running(name: String, n: usize, value: f32) -> Self {
        Self { name, shape: vec![n], initial: Initial::Constant(value), trained: false }
    }

    /// Numbers.
    pub fn len(&self) -> usize {
        self.shape.iter().product()
    }

    /// Whether it has no numbers.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// All parameters of a network in the order of its layers.
#[derive(Clone, Debug)]
pub struct Parameters {
    declared: Vec<Declared>,
    /// `[first dimension, product of the others]`
    values: Vec<Matrix>,
    /// the same as products read them, until they change
    packed: Vec<OnceLock<Arc<[Packed]>>>,
    index: HashMap<String, usize>,
    /// the same on a GPU, until they change
    #[cfg(any(test, feature = "gpu"))]
    uploaded: OnceLock<Arc<Uploaded>>,
}

impl Parameters {
    /// Initial values of this seed.
    pub fn new(declared: Vec<Declared>, seed: u64) -> Self {
        let values = declared
            .iter()
            .map(|d| {
                let stream = Stream::new(seed, &d.name);
                let value = |i: usize| match d.initial {
                    Initial::Uniform(bound) => (2.0 * stream.uniform(i as u64) - 1.0) * bound,
                    Initial::Constant(value) => value,
                };
                matrix_of(d, (0..d.len()).map(value).collect())
            })
            .collect();
        let index = declared.iter().enumerate().map(|(i, d)| (d.name.clone(), i)).collect();
        Self::of(declared, values, index)
    }

    fn of(declared: Vec<Declared>, values: Vec<Matrix>, index: HashMap<String, usize>) -> Self {
        let packed = vec![OnceLock::new(); declared.len()];
        Self {
            declared,
            values,
            packed,
            index,
            #[cfg(any(test, feature = "gpu"))]
            uploaded: OnceLock::new(),
        }
    }

    /// What each parameter is.
    pub fn declared(&self) -> &[Declared] {
        &self.declared
    }

    /// A parameter that a layer of this network declared.
    ///
    /// # Panics
    /// When no layer did.
    pub(crate) fn get(&self, name: &str) -> &Matrix {
        &self.values[self.index[name]]
    }

    /// The weights of a layer, packed by `pack` at the first call after they changed.
    pub(crate) fn packed(&self, name: &str, pack: impl FnOnce(&Matrix) -> Packed) -> &Packed {
        &self.packed_parts(name, |weight| vec![pack(weight)])[0]
    }

    /// The same for weights that become several matrices.
    pub(crate) fn packed_parts(
        &self,
        name: &str,
        pack: impl FnOnce(&Matrix) -> Vec<Packed>,
    ) -> &[Packed] {
        let i = self.index[name];
        if let Some(packed) = self.packed[i].get() {
            return packed;
        }
        // Not inside of `get_or_init`: a thread of the pool that waits there could hold the work that
        // the packing thread waits for.
        let packed = pack(&self.values[i]).into();
        self.packed[i].get_or_init(|| packed)
    }

    /// Whether any weights have been packed since they changed.
    pub(crate) fn has_packed(&self) -> bool {
        self.packed.iter().any(|packed| packed.get().is_some())
    }

    /// A copy without the packed weights.
    pub(crate) fn unpacked(&self) -> Self {
        Self::of(self.declared.clone(), self.values.clone(), self.index.clone())
    }

    /// The same on a GPU, sent by `upload` at the first call after they changed.
    #[cfg(any(test, feature = "gpu"))]
    pub(crate) fn uploaded(&self, upload: impl FnOnce() -> Uploaded) -> Arc<Uploaded> {
        self.uploaded.get_or_init(|| Arc::new(upload())).clone()
    }

    /// Whether training changes the parameter of this name by its gradient.
    #[cfg(any(test, feature = "gpu"))]
    pub(crate) fn is_trained(&self, name: &str) -> bool {
        self.declared[self.index[name]].trained
    }

    /// To be called when numbers change: what was made of them is made anew.
    fn forget_copies(&mut self, i: Option<usize>) {
        match i {
            Some(i) => self.packed[i] = OnceLock::new(),
            None => self.packed.fill(OnceLock::new()),
        }
        #[cfg(any(test, feature = "gpu"))]
        {
            self.uploaded = OnceLock::new();
        }
    }

    pub(crate) fn get_mut(&mut self, name: &str) -> &mut Matrix {
        let i = self.index[name];
        self.forget_copies(Some(i));
        &mut self.values[i]
    }

    /// Parameters with their values.
    pub fn iter(&self) -> impl Iterator<Item = (&Declared, &[f32])> {
        self.declared.iter().zip(self.values.iter().map(Matrix::values))
    }

    /// Numbers that training changes; running statistics are not counted, as in PyTorch.
    pub fn count(&self) -> usize {
        self.declared.iter().filter(|d| d.trained).map(Declared::len).sum()
    }

    /// The first parameter with a number that is not finite, and that number.
    pub(crate) fn not_finite(&self) -> Option<(&str, f32)> {
        self.iter().find_map(|(d, values)| Some((d.name.as_str(), not_finite(values)?)))
    }

    /// Replaces all values by those of a network that may have learned other classes: the last layer
    /// stays as it is where it has another number of outputs. Gives the names of what stays.
    ///
    /// # Errors
    /// As [`Parameters::load`], for other differences.
    pub(crate) fn adopt(&mut self, network: &str, state: &State) -> Result<Vec<String>> {
        let last = self.declared.last().map(|d| layer(&d.name));
        let (mut merged, mut stay) = (State::with_capacity(state.len()), Vec::new());
        for (name, shape, values) in state {
            let own = self.index.get(name).map(|&i| (&self.declared[i], &self.values[i]));
            let own = own.filter(|(d, _)| {
                Some(layer(name)) == last
                    && d.shape[0] != shape.first().copied().unwrap_or(0)
                    && d.shape.get(1..) == shape.get(1..)
            });
            merged.push(match own {
                Some((d, values)) => {
                    stay.push(name.clone());
                    (name.clone(), d.shape.clone(), values.values().to_vec())
                }
                None => (name.clone(), shape.clone(), values.clone()),
            });
        }
        self.load(network, &merged)?;
        Ok(stay)
    }

    /// Replaces all values by those given under PyTorch's names. `num_batches_tracked` may be there.
    ///
    /// # Errors
    /// [`NetError::Weights`] with every name and shape that differs; nothing is changed then.
    pub fn load(&mut self, network: &str, state: &[(String, Vec<usize>, Vec<f32>)]) -> Result<()> {
        let shapes = state.iter().map(|(name, shape, _)| (name.as_str(), shape.as_slice()));
        let mut differences = differences(&self.declared, shapes);
        let mut given: HashMap<&str, &[f32]> = HashMap::new();
        for (name, shape, values) in state.iter().filter(|s| self.index.contains_key(&s.0)) {
            if values.len() != shape.iter().product::<usize>() {
                differences.push(format!("{name} has {} values for {shape:?}", values.len()));
            } else if let Some(i) = values.iter().position(|v| !v.is_finite()) {
                differences.push(format!("{name}: value {i} is {}", values[i]));
            }
            given.insert(name, values);
        }
        if !differences.is_empty() {
            return Err(NetError::Weights { network: network.into(), differences });
        }
        for (d, value) in self.declared.iter().zip(&mut self.values) {
            *value = matrix_of(d, given[d.name.as_str()].to_vec());
        }
        self.forget_copies(None);
        Ok(())
    }
}

/// The layer of a parameter.
fn layer(name: &str) -> &str {
    name.rsplit_once('.').map_or("", |(layer, _)| layer)
}

/// Names and shapes that are not those declared; `num_batches_tracked` may be there.
pub(crate) fn differences<'a>(
    declared: &[Declared],
    given: impl Iterator<Item = (&'a str, &'a [usize])>,
) -> Vec<String> {
    let known: HashMap<&str, &Declared> = declared.iter().map(|d| (d.name.as_str(), d)).collect();
    let mut shapes: HashMap<&str, &[usize]> = HashMap::new();
    let mut differences = Vec::new();
    for (name, shape) in given.filter(|(name, _)| !name.ends_with("num_batches_tracked")) {
        if !known.contains_key(name) {
            differences.push(format!("{name} {shape:?} is not one of its parameters"));
        }
        shapes.insert(name, shape);
    }
    for d in declared {
        match shapes.get(d.name.as_str()) {
            None => differences.push(format!("{} {:?} is missing", d.name, d.shape)),
            Some(shape) if *shape != d.shape => {
                differences.push(format!("{} is {shape:?}, expected {:?}", d.name, d.shape));
            }
            Some(_) => (),
        }
    }
    differences
}

/// The first number that is not finite.
pub(crate) fn not_finite(values: &[f32]) -> Option<f32> {
    // A whole piece at a time, so that the processor looks at many numbers at once.
    let odd = |piece: &&[f32]| piece.iter().fold(false, |odd, v| odd | !v.is_finite());
    let piece = values.par_chunks(1 << 15).find_first(odd)?;
    piece.iter().copied().find(|v| !v.is_finite())
}

fn matrix_of(declared: &Declared, values: Vec<f32>) -> Matrix {
    let rows = declared.shape.first().copied().unwrap_or(1);
    Matrix::new(rows, values.len() / rows.max(1), values)
}
