//! What a pickle is made of.

use crate::weights::numbers::Kind;

/// A value on the pickle machine's stack.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::weights) enum Value {
    None,
    Bool(bool),
    Int(i64),
    Float,
    Text(String),
    Tuple(Vec<Value>),
    List(Vec<Value>),
    Dict(Vec<(Value, Value)>),
    Global(Global),
    Storage(Storage),
    Tensor(Tensor),
    Mark,
}

/// The names that are known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::weights) enum Global {
    OrderedDict,
    RebuildTensor,
    RebuildParameter,
    Storage(Kind),
}

/// Where a tensor's numbers lie in the archive.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::weights) struct Storage {
    pub(in crate::weights) kind: Kind,
    pub(in crate::weights) key: String,
    pub(in crate::weights) len: usize,
}

/// A view of a storage.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::weights) struct Tensor {
    pub(in crate::weights) storage: Storage,
    pub(in crate::weights) offset: usize,
    pub(in crate::weights) shape: Vec<usize>,
    pub(in crate::weights) strides: Vec<usize>,
}

/// Deepest nesting accepted; weights have a few levels.
const MAX_DEPTH: usize = 16;

/// Values in a value; refuses nesting beyond what weights have.
pub(super) fn size(value: &Value, depth: usize) -> Result<usize, String> {
    if depth > MAX_DEPTH {
        return Err("values nested too deep".into());
    }
    let add = |n: usize, item: &Value| Ok::<_, String>(n + size(item, depth + 1)?);
    match value {
        Value::Tuple(items) | Value::List(items) => items.iter().try_fold(1, add),
        Value::Dict(items) => items.iter().flat_map(|(k, v)| [k, v]).try_fold(1, add),
        Value::Text(text) => Ok(1 + text.len() / 64),
        Value::Storage(storage) => Ok(1 + storage.key.len() / 64),
        Value::Tensor(tensor) => Ok(1 + (tensor.storage.key.len() + 16 * tensor.shape.len()) / 64),
        _ => Ok(1),
    }
}

/// What is known by a name.
pub(super) fn global(module: &str, name: &str) -> Result<Global, String> {
    Ok(match (module, name) {
        ("collections", "OrderedDict") => Global::OrderedDict,
        ("torch._utils", "_rebuild_tensor_v2") => Global::RebuildTensor,
        ("torch._utils", "_rebuild_parameter") => Global::RebuildParameter,
        ("torch", "FloatStorage") => Global::Storage(Kind::F32),
        ("torch", "DoubleStorage") => Global::Storage(Kind::F64),
        ("torch", "HalfStorage") => Global::Storage(Kind::F16),
        ("torch", "BFloat16Storage") => Global::Storage(Kind::Bf16),
        ("torch", "LongStorage") => Global::Storage(Kind::I64),
        ("torch", "IntStorage") => Global::Storage(Kind::I32),
        _ => {
            return Err(format!(
                "it needs {module}.{name}; only dictionaries of tensors are read, and nothing in \
                 a pickle is run: save net.state_dict()"
            ));
        }
    })
}

/// What a known function makes of its arguments.
pub(super) fn call(function: Value, arguments: Value) -> Result<Value, String> {
    let Value::Tuple(arguments) = arguments else { return Err("a call without arguments".into()) };
    match (function, &arguments[..]) {
        (Value::Global(Global::OrderedDict), []) => Ok(Value::Dict(Vec::new())),
        (
            Value::Global(Global::RebuildTensor),
            [
                Value::Storage(storage),
                Value::Int(offset),
                Value::Tuple(shape),
                Value::Tuple(strides),
                // whether it is trained, its hooks; then what else there is to it
                rest @ ..,
            ],
        ) if shape.len() == strides.len() => {
            let plain = |more: &Value| matches!(more, Value::Dict(more) if more.is_empty());
            if !rest.iter().skip(2).all(plain) {
                return Err(
                    "a tensor whose numbers are to be negated or conjugated when read: save \
                            tensor.resolve_neg().resolve_conj()"
                        .into(),
                );
            }
            let sizes = |all: &[Value]| -> Result<Vec<usize>, String> {
                let one = |v: &Value| match v {
                    Value::Int(n) => usize::try_from(*n).map_err(|_| "a negative size".to_string()),
                    _ => Err("a size that is not a number".into()),
                };
                all.iter().map(one).collect()
            };
            let offset = usize::try_from(*offset).map_err(|_| "a negative offset")?;
            Ok(Value::Tensor(Tensor {
                storage: storage.clone(),
                offset,
                shape: sizes(shape)?,
                strides: sizes(strides)?,
            }))
        }
        (Value::Global(Global::RebuildParameter), [Value::Tensor(tensor), ..]) => {
            Ok(Value::Tensor(tensor.clone()))
        }
        _ => Err("a call of an unknown function, or with other arguments".into()),
    }
}

/// `('storage', type, key, location, count)`.
pub(super) fn storage(id: Value) -> Result<Value, String> {
    let Value::Tuple(parts) = id else { return Err("a storage without a description".into()) };
    match &parts[..] {
        [
            Value::Text(word),
            Value::Global(Global::Storage(kind)),
            Value::Text(key),
            Value::Text(_),
            Value::Int(len),
        ] if word == "storage" => {
            let len = usize::try_from(*len).map_err(|_| "a storage of negative size")?;
            Ok(Value::Storage(Storage { kind: *kind, key: key.clone(), len }))
        }
        _ => Err("a storage that is not described as PyTorch does".into()),
    }
}
