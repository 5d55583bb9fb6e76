//! Inspection of weights: trained networks, checkpoints, weights alone.

use std::fs::File;
use std::io::Read;
use std::path::Path;
use std::process::ExitCode;

use serde::Serialize;
use serde_json::{Map, Value};

use super::model::flatten;
use super::refusal::{corrupt, to_json};
use crate::failure::Failure;
use crate::plural::plural;

/// Text entries in which networks, M2's capacity network and checkpoints say what they are.
const NETWORK: &str = "corsmal-feat";
const CAPACITY: &str = "corsmal-feat-capacity";
const CHECKPOINT: &str = "corsmal-feat-checkpoint";
/// Longest header that is read.
const MAX_HEADER: u64 = 100 << 20;
/// Tensors shown as text; JSON has all.
const SHOWN: usize = 20;

/// Everything that is printed.
#[derive(Serialize)]
struct Contents {
    path: String,
    format: &'static str,
    kind: &'static str,
    numbers: u64,
    /// What the file says about its network or training; null for weights alone.
    header: Value,
    members: Vec<Member>,
}

#[derive(Serialize)]
struct Member {
    name: String,
    #[serde(rename = "type")]
    kind: String,
    shape: Vec<u64>,
}

/// Prints what weights are of, and what trained them.
pub fn inspect(path: &Path, json: bool) -> Result<ExitCode, Failure> {
    match read(path) {
        Ok(contents) => {
            print!("{}", if json { to_json(&contents)? } else { contents.text() });
            Ok(ExitCode::SUCCESS)
        }
        Err(reason) => corrupt(path, &reason, json),
    }
}

fn read(path: &Path) -> Result<Contents, String> {
    let text = |e: std::io::Error| e.to_string();
    let mut file = File::open(path).map_err(text)?;
    let size = file.metadata().map_err(text)?.len();
    let mut length = [0; 8];
    file.read_exact(&mut length).map_err(text)?;
    let length = u64::from_le_bytes(length);
    if length > MAX_HEADER || length > size.saturating_sub(8) {
        return Err(format!("a header of {length} bytes in a file of {size}"));
    }
    let mut header = Vec::new();
    file.take(length).read_to_end(&mut header).map_err(text)?;
    let mut header: Map<String, Value> =
        serde_json::from_slice(&header).map_err(|e| format!("its header: {e}"))?;
    let texts = header.remove("__metadata__").unwrap_or_default();
    let (mut members, mut numbers) = (Vec::with_capacity(header.len()), 0u64);
    let mut places = Vec::with_capacity(header.len());
    for (name, tensor) in header {
        let whole =
            |value: &Value| value.as_u64().ok_or(format!("tensor {name}: {value} is not a size"));
        let sizes = tensor["shape"].as_array().into_iter().flatten();
        let shape = sizes.map(whole).collect::<Result<Vec<u64>, _>>()?;
        let count = shape.iter().try_fold(1u64, |n, &size| n.checked_mul(size));
        let count = count.ok_or_else(|| format!("tensor {name}: shape {shape:?}"))?;
        numbers = numbers.saturating_add(count);
        let offsets = &tensor["data_offsets"];
        let (from, to) = (whole(&offsets[0])?, whole(&offsets[1])?);
        let bytes = to.checked_sub(from).ok_or(format!("tensor {name}: bytes {from} to {to}"))?;
        let kind = tensor["dtype"].as_str().unwrap_or_default().to_owned();
        let bits =
            bits(&kind).ok_or(format!("tensor {name}: numbers of an unknown type {kind}"))?;
        let wanted = count.checked_mul(bits).map(|bits| bits.div_ceil(8));
        if wanted != Some(bytes) {
            let wanted = wanted.map_or("too many".into(), |wanted| wanted.to_string());
            return Err(format!(
                "tensor {name}: {count} numbers of type {kind} are {wanted} bytes, not {bytes}"
            ));
        }
        places.push((from, to));
        members.push(Member { name, kind, shape });
    }
    places.sort_unstable();
    let mut end = 0;
    for (from, to) in places {
        if from != end {
            return Err(format!(
                "its tensors are not adjacent: one ends at byte {end}, the next begins at {from}"
            ));
        }
        end = to;
    }
    if end != size - 8 - length {
        return Err(format!(
            "its tensors end at byte {end} of {} after the header",
            size - 8 - length
        ));
    }
    let kinds = [
        (NETWORK, "trained network"),
        (CAPACITY, "trained capacity network"),
        (CHECKPOINT, "checkpoint of a training run"),
    ];
    let told = kinds.into_iter().find_map(|(entry, kind)| Some((texts[entry].as_str()?, kind)));
    let (header, kind) = match told {
        Some((text, kind)) => {
            let header = serde_json::from_str(text).map_err(|e| format!("its text: {e}"))?;
            (header, kind)
        }
        None => (Value::Null, "weights alone"),
    };
    let path = path.display().to_string();
    Ok(Contents { path, format: "safetensors", kind, numbers, header, members })
}

/// Bits of a number of a type that safetensors knows.
fn bits(kind: &str) -> Option<u64> {
    Some(match kind {
        "F4" => 4,
        "F6_E2M3" | "F6_E3M2" => 6,
        "BOOL" | "U8" | "I8" | "F8_E5M2" | "F8_E4M3" | "F8_E8M0" | "F8_E5M2FNUZ"
        | "F8_E4M3FNUZ" => 8,
        "I16" | "U16" | "F16" | "BF16" => 16,
        "I32" | "U32" | "F32" => 32,
        "I64" | "U64" | "F64" | "C64" => 64,
        _ => return None,
    })
}

impl Contents {
    fn text(&self) -> String {
        let Self { path, kind, numbers, header, members, .. } = self;
        let word = |key: &str| header[key].as_str();
        let version =
            word("tool_version").map(|v| format!(" · corsmal-feat {v}")).unwrap_or_default();
        let network = word("network").map(|name| format!(" · {name}")).unwrap_or_default();
        let of = format!("{numbers} numbers in {}", plural(members.len(), "tensor"));
        let mut out = format!("{path}\n  {kind}{version}{network} · {of}\n\n");
        let mut line = |label: &str, text: &str| out.push_str(&format!("  {label:13}  {text}\n"));
        if let Some(target) = word("target") {
            line("predicts", target);
        }
        if let Some(labels) = header["labels"].as_array() {
            let labels: Vec<&str> = labels.iter().filter_map(Value::as_str).collect();
            line("classes", &labels.join(", "));
        }
        // A checkpoint has its epochs beside the rest.
        let history = if header["history"].is_object() { &header["history"] } else { header };
        if let Some(epochs) = history["epochs"].as_array() {
            let mut text = plural(epochs.len(), "epoch");
            let kept = history["kept"]
                .as_u64()
                .map_or(epochs.len(), |kept| (kept as usize).saturating_add(1));
            if let Some(epoch) = kept.checked_sub(1).and_then(|kept| epochs.get(kept)) {
                let loss = epoch["loss"].as_f64().unwrap_or(f64::NAN);
                let score = epoch["score"].as_f64().map(|s| format!(", score {s:.4}"));
                let which = if history["kept"].is_u64() { "kept" } else { "the last" };
                text += &format!(
                    "; epoch {kept}, {which}: loss {loss:.6}{}",
                    score.unwrap_or_default()
                );
            }
            if let Some(gpu) = word("gpu") {
                text += &format!("; on {gpu}");
            }
            line("training", &text);
        }
        for (label, key) in
            [("recipe", "recipe"), ("learned from", "provenance"), ("features", "feature_config")]
        {
            let mut lines = Vec::new();
            flatten("", &header[key], &mut lines);
            for (i, text) in lines.iter().enumerate() {
                line(if i == 0 { label } else { "" }, text);
            }
        }
        if header.is_null() {
            for Member { name, kind, shape } in members.iter().take(SHOWN) {
                line(kind, &format!("{name} {shape:?}"));
            }
            if members.len() > SHOWN {
                line("", &format!("and {} more", members.len() - SHOWN));
            }
        }
        match self.kind {
            "trained network" => {
                out.push_str(&format!("\n  corsmal-feat classify --model {path} INPUTS\n"));
            }
            "trained capacity network" => {
                out.push_str(&format!("\n  corsmal-feat capacity --method m2 --model {path}\n"));
            }
            _ => {}
        }
        out
    }
}
