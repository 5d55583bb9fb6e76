//! Inspection of calibrations.

use std::path::Path;
use std::process::ExitCode;

use corsmal_vision::{Calibration, Camera};
use serde_json::json;

use super::refusal::{corrupt, to_json};
use crate::failure::Failure;

/// Prints the cameras of a view.
pub fn inspect(path: &Path, json: bool) -> Result<ExitCode, Failure> {
    let name = path.display().to_string();
    let calibration = match Calibration::load(path) {
        Ok(calibration) => calibration,
        Err(error) => return corrupt(path, &error, json),
    };
    if json {
        let contents = json!({ "path": name, "kind": "calibration", "cameras": calibration });
        print!("{}", to_json(&contents)?);
        return Ok(ExitCode::SUCCESS);
    }
    println!("{name}\n  calibration of a view; px, and m in the world\n");
    let Calibration { rgb, ir1, ir2 } = &calibration;
    for (label, camera) in
        [("colour", Some(rgb)), ("infrared 1", ir1.as_ref()), ("infrared 2", ir2.as_ref())]
    {
        if let Some(camera) = camera {
            println!("  {label:10}  {}", told(camera));
        }
    }
    Ok(ExitCode::SUCCESS)
}

fn told(camera: &Camera) -> String {
    let k = &camera.intrinsic;
    let place = camera.back_projection().map(|back| back.point(0.0, 0.0, 0.0));
    let place = place.map(|[x, y, z]| format!(", at {x:.3}, {y:.3}, {z:.3}"));
    format!(
        "focal lengths {:.1}, {:.1}, principal point {:.1}, {:.1}{}",
        k[0][0],
        k[1][1],
        k[0][2],
        k[1][2],
        place.unwrap_or_default()
    )
}
