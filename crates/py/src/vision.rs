//! Calibrations, masks, depth images, and capacities from them.

use std::path::PathBuf;

use corsmal_nets::capacity::CapacityNetwork;
use corsmal_vision::cloud::{DepthView, upright_box as around};
use corsmal_vision::cuboid::{Outliers, cuboid as measure};
use corsmal_vision::lode::{Variant, View, band, dimensions};
use corsmal_vision::{Calibration, Camera, Depth, Mask, region as find_region};
use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyArray2, PyReadonlyArray2};
use pyo3::prelude::*;

use crate::errors::value_error;
use crate::pool::compute;

/// Intrinsic, rotation, translation and projection of a camera, row by row.
pub(crate) type Numbers = [f64; 33];
pub(crate) type Sizes = (f64, f64, f64, Option<f64>, Option<f64>, Vec<[f64; 2]>, [f64; 3], f64);
pub(crate) type Box3 = ([f64; 3], [f64; 3], f64, f64, usize);
pub(crate) type FoundRegion<'py> = Option<([usize; 4], Bound<'py, PyArray2<f32>>, [f32; 2])>;

fn numbers(camera: &Camera) -> Numbers {
    let mut all = camera
        .intrinsic
        .iter()
        .flatten()
        .chain(camera.rotation.iter().flatten())
        .chain(&camera.translation)
        .chain(camera.projection.iter().flatten());
    std::array::from_fn(|_| *all.next().unwrap_or(&0.0))
}

fn camera(n: &Numbers) -> PyResult<Camera> {
    let square = |at: usize| std::array::from_fn(|r| std::array::from_fn(|c| n[at + 3 * r + c]));
    let mut camera = Camera::new(square(0), square(9), [n[18], n[19], n[20]]);
    camera.projection = std::array::from_fn(|r| std::array::from_fn(|c| n[21 + 4 * r + c]));
    camera.check().map_err(value_error)?;
    Ok(camera)
}

fn mask(array: &PyReadonlyArray2<'_, bool>) -> PyResult<Mask> {
    let array = array.as_array();
    let (height, width) = array.dim();
    if array.is_empty() {
        return Err(value_error("mask has no pixels"));
    }
    Ok(Mask { width, height, data: array.iter().copied().collect() })
}

fn depth(array: &PyReadonlyArray2<'_, u16>) -> PyResult<Depth> {
    let array = array.as_array();
    let (height, width) = array.dim();
    if array.is_empty() {
        return Err(value_error("depth has no pixels"));
    }
    Ok(Depth { width, height, data: array.iter().copied().collect() })
}

/// Cameras of a calibration file by name.
#[pyfunction]
pub(crate) fn load_calibration(
    py: Python<'_>,
    path: PathBuf,
) -> PyResult<Vec<(&'static str, Numbers)>> {
    let read = compute(py, || Calibration::load(&path))?.map_err(value_error)?;
    let cameras = [("rgb", Some(read.rgb)), ("ir1", read.ir1), ("ir2", read.ir2)];
    Ok(cameras.into_iter().filter_map(|(name, c)| Some((name, numbers(&c?)))).collect())
}

/// A mask's PNG as a boolean array.
#[pyfunction]
pub(crate) fn load_mask(py: Python<'_>, path: PathBuf) -> PyResult<Bound<'_, PyArray2<bool>>> {
    let mask = compute(py, || Mask::read(&path))?.map_err(value_error)?;
    let array = Array2::from_shape_vec((mask.height, mask.width), mask.data);
    Ok(array.map_err(value_error)?.into_pyarray(py))
}

/// A depth PNG as an array of mm.
#[pyfunction]
pub(crate) fn load_depth(py: Python<'_>, path: PathBuf) -> PyResult<Bound<'_, PyArray2<u16>>> {
    let depth = compute(py, || Depth::read(&path))?.map_err(value_error)?;
    let array = Array2::from_shape_vec((depth.height, depth.width), depth.data);
    Ok(array.map_err(value_error)?.into_pyarray(py))
}

/// Height, width, capacity, its band, profile, centre and residual.
#[pyfunction]
pub(crate) fn lode(
    py: Python<'_>,
    masks: [PyReadonlyArray2<'_, bool>; 2],
    cameras: [Numbers; 2],
    published: bool,
) -> PyResult<Sizes> {
    let masks = [mask(&masks[0])?, mask(&masks[1])?];
    let cameras = [camera(&cameras[0])?, camera(&cameras[1])?];
    let variant = if published { Variant::Published } else { Variant::Corrected };
    let (found, band) = compute(py, || {
        let views = [0, 1].map(|i| View { mask: &masks[i], camera: &cameras[i] });
        dimensions(views, variant).map(|found| (found, band(views, variant)))
    })?
    .map_err(value_error)?;
    let (low, high) = (band.low, band.high);
    let (profile, centre, residual) = (found.profile, found.centre, found.residual);
    Ok((found.height, found.width, found.capacity, low, high, profile, centre, residual))
}

/// Corners, share on the mask, capacity and points of M4's box.
#[pyfunction]
pub(crate) fn cuboid(
    py: Python<'_>,
    depth_mm: PyReadonlyArray2<'_, u16>,
    pixels: PyReadonlyArray2<'_, bool>,
    numbers: Numbers,
    outliers: &str,
    seed: u64,
) -> PyResult<Box3> {
    let outliers = match outliers {
        "published" => Outliers::Published,
        "corrected" => Outliers::Corrected,
        "kept" => Outliers::Kept,
        other => {
            return Err(value_error(format!(
                "outliers must be one of published, corrected, kept, not {other}"
            )));
        }
    };
    let (depth, mask, camera) = (depth(&depth_mm)?, mask(&pixels)?, camera(&numbers)?);
    let found = compute(py, || measure(&depth, &mask, &camera, outliers, seed))?;
    let found = found.map_err(value_error)?;
    Ok((found.low, found.high, found.share, found.capacity, found.points))
}

/// Sides, volume and points of the upright box around the depth of several views.
#[pyfunction]
pub(crate) fn upright_box(
    py: Python<'_>,
    views: Vec<(PyReadonlyArray2<'_, u16>, PyReadonlyArray2<'_, bool>, Numbers)>,
) -> PyResult<([f64; 3], f64, usize)> {
    let views = views
        .iter()
        .map(|(d, m, n)| Ok((depth(d)?, mask(m)?, camera(n)?)))
        .collect::<PyResult<Vec<_>>>()?;
    let found = compute(py, || {
        let views: Vec<DepthView<'_>> =
            views.iter().map(|(depth, mask, camera)| DepthView { depth, mask, camera }).collect();
        around(&views)
    })?
    .map_err(value_error)?;
    Ok((found.sides, found.volume, found.points))
}

/// Bounds, input image and relative size of M2's region of interest.
#[pyfunction]
pub(crate) fn region<'py>(
    py: Python<'py>,
    depth_mm: PyReadonlyArray2<'py, u16>,
) -> PyResult<FoundRegion<'py>> {
    let depth = depth(&depth_mm)?;
    let Some(found) = compute(py, || find_region::region(&depth))? else { return Ok(None) };
    let side = find_region::INPUT_SIDE;
    let image = Array2::from_shape_vec((side, side), found.image).map_err(value_error)?;
    Ok(Some((found.bounds, image.into_pyarray(py), found.size)))
}

/// Capacity in mL by M2's network, from what [`region`] gives.
#[pyfunction]
pub(crate) fn m2_capacity(
    py: Python<'_>,
    image: PyReadonlyArray2<'_, f32>,
    size: [f32; 2],
    weights: PathBuf,
) -> PyResult<f64> {
    let image: Vec<f32> = image.as_array().iter().copied().collect();
    compute(py, || {
        let network = CapacityNetwork::read(&weights).map_err(|e| e.to_string())?;
        network.millilitres(&image, size).map_err(|e| e.to_string())
    })?
    .map_err(value_error)
}
