"""Capacity of a container from calibrated views, by masks and depth images; only M2 uses a network.

Lengths are in mm and capacities in mL unless stated otherwise. `docs/vision.md` says what was
published, what is corrected, and what is our interpretation.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, TypedDict

import numpy as np
import numpy.typing as npt

from . import _core
from ._arrays import as_array
from ._refusals import existing, refuses, seed_of
from ._views import (
    Calibration,
    Camera,
    Depth,
    Doubles,
    Mask,
    StrPath,
    camera_numbers,
    depth_pixels,
    load_calibration,
    load_depth,
    load_mask,
    mask_pixels,
)
from .errors import ParameterError

__all__ = [
    "Calibration",
    "Camera",
    "Cuboid",
    "LodeEstimate",
    "Region",
    "UprightBox",
    "cuboid",
    "load_calibration",
    "load_depth",
    "load_mask",
    "lode",
    "m2_capacity",
    "region",
    "upright_box",
]


class LodeEstimate(TypedDict):
    """The result of `lode`."""

    height: float
    width: float
    capacity: float
    capacity_low: float | None
    capacity_high: float | None
    centre: Doubles
    profile: Doubles
    residual: float


class Cuboid(TypedDict):
    """The result of `cuboid`."""

    capacity: float
    low: Doubles
    high: Doubles
    share: float
    points: int


class UprightBox(TypedDict):
    """The result of `upright_box`."""

    volume: float
    sides: Doubles
    points: int


class Region(TypedDict):
    """The result of `region`."""

    bounds: tuple[int, int, int, int]
    image: npt.NDArray[np.float32]
    size: tuple[float, float]


@refuses
def lode(
    masks: Sequence[Mask],
    calibrations: Sequence[Calibration | StrPath],
    *,
    variant: Literal["published", "corrected"] = "corrected",
) -> LodeEstimate:
    """Measures an object from its masks in two views (LoDE, as M5 uses it).

    Parameters
    ----------
    masks : two paths of PNGs, or two boolean arrays [height, width]
    calibrations : calibrations of the two views, or their files
    variant : {"corrected", "published"}
        "published" keeps the quirks of the published program: indices left of or above an image
        wrap around, a circle that extends beyond the image ends the estimate, and gaps in the
        profile count as height. "corrected" also refuses masks that do not show one object, and an
        object that reaches the ends of what is tried (`docs/vision.md`).

    Returns
    -------
    dict
        `height` and largest `width` in mm, `capacity` in mL; `capacity_low` and `capacity_high`
        with masks one pixel smaller and larger (None if they give no estimate); `centre` [3] and
        `profile` [circles, 2] (height above the world's origin and radius) in m; `residual` in px,
        how far from the middles of the masks the centre is seen: a pixel or a few.

    Raises
    ------
    ParameterError
        No estimate is possible: a mask is empty, no circle is on both masks, a circle is outside an
        image, or the views contradict each other.

    Examples
    --------
    >>> found = corsmal_feat.vision.lode(["c1.png", "c2.png"], ["c1.json", "c2.json"])
    >>> round(found["width"]), 250 < found["capacity"] < 320
    (59, True)
    """
    if variant not in ("published", "corrected"):
        raise ParameterError(f"variant must be 'published' or 'corrected', not {variant!r}")
    if isinstance(masks, str) or isinstance(calibrations, str):
        raise ParameterError("lode needs a list of two masks and a list of two calibrations")
    if len(masks) != 2 or len(calibrations) != 2:
        raise ParameterError(
            f"lode needs two masks and two calibrations, not {len(masks)} and {len(calibrations)}"
        )
    first, second = (mask_pixels(m) for m in masks)
    left, right = (camera_numbers(c) for c in calibrations)
    height, width, capacity, low, high, profile, centre, residual = _core.lode(
        (first, second), (left, right), variant == "published"
    )
    return {
        "height": height,
        "width": width,
        "capacity": capacity,
        "capacity_low": low,
        "capacity_high": high,
        "centre": np.array(centre),
        "profile": np.array(profile).reshape(-1, 2),
        "residual": residual,
    }


@refuses
def cuboid(
    depth: Depth,
    mask: Mask,
    calibration: Calibration | StrPath,
    *,
    outliers: Literal["published", "corrected", "kept"] = "corrected",
    seed: int = 1,
) -> Cuboid:
    """M4's capacity: the volume of the box around an object's points, times its share on the mask.

    Parameters
    ----------
    depth : path, or uint16 [shape=(height, width)]
        A 16-bit PNG or its values in mm, aligned with the colour camera.
    mask : path, or bool [shape=(height, width)]
        Mask of the object.
    calibration : Calibration, or path
        Calibration of the view.
    outliers : {"corrected", "published", "kept"}
        Outliers are dropped by four isolation forests; in the published program, the last has no
        effect. "kept" drops none.
    seed : int
        Seed of the forests.

    Returns
    -------
    dict
        `capacity` in mL, corners `low` and `high` [3] in m, the `share` of the box on the mask, and
        the number of `points` kept.

    Raises
    ------
    ParameterError
        The calibration is of another resolution, no depth is on the mask, or the capacity is
        impossible (1 mL to 100 L), as with depth in another unit.

    Examples
    --------
    >>> box = corsmal_feat.vision.cuboid("c1_depth.png", "c1.png", "c1.json", outliers="kept")
    >>> box["points"], (box["high"] - box["low"]).round(2).tolist()
    (5005, [0.06, 0.03, 0.1])
    """
    low, high, share, capacity, points = _core.cuboid(
        depth_pixels(depth), mask_pixels(mask), camera_numbers(calibration), outliers, seed_of(seed)
    )
    return {
        "capacity": capacity,
        "low": np.array(low),
        "high": np.array(high),
        "share": share,
        "points": points,
    }


@refuses
def upright_box(
    depths: Sequence[Depth],
    masks: Sequence[Mask],
    calibrations: Sequence[Calibration | StrPath],
) -> UprightBox:
    """Smallest upright box around an object's points, from the depth of several views.

    Masks lose a pixel at their border, and 1 % of the points may lie beyond each face. A side that
    no camera sees has no points, so the box ends before it.

    Parameters
    ----------
    depths, masks, calibrations : sequences
        One per view, as in `cuboid`.

    Returns
    -------
    dict
        `volume` in mL; `sides` [3] in m: longer and shorter side of the base, and height; number of
        `points`.

    Raises
    ------
    ParameterError
        As in `cuboid`.

    Examples
    --------
    >>> box = corsmal_feat.vision.upright_box(["c1_depth.png"], ["c1.png"], ["c1.json"])
    >>> box["sides"].round(2).tolist()
    [0.06, 0.03, 0.1]
    """
    if not len(depths) == len(masks) == len(calibrations):
        raise ParameterError(
            "depths, masks and calibrations must have one element per view each, not "
            f"{len(depths)}, {len(masks)} and {len(calibrations)}"
        )
    views = [
        (depth_pixels(d), mask_pixels(m), camera_numbers(c))
        for d, m, c in zip(depths, masks, calibrations, strict=True)
    ]
    sides, volume, points = _core.upright_box(views)
    return {"volume": volume, "sides": np.array(sides), "points": points}


@refuses
def region(depth: Depth) -> Region | None:
    """M2's region of interest in a depth image; None if no near object is large enough.

    Parameters
    ----------
    depth : path, or uint16 [shape=(height, width)]
        A 16-bit PNG or its values in mm.

    Returns
    -------
    dict, or None
        `bounds` (first column, first row, column and row after the last), `image` [112, 112]
        (depth over 700 mm, resized) and `size` (height over 720, width over 1280): the inputs of
        M2's network.

    Examples
    --------
    >>> depth = np.zeros((720, 1280), np.uint16)
    >>> depth[300:500, 600:720] = 500
    >>> corsmal_feat.vision.region(depth)["bounds"]
    (597, 295, 723, 505)
    """
    found = _core.region(depth_pixels(depth))
    if found is None:
        return None
    (left, top, right, bottom), image, (height, width) = found
    return {"bounds": (left, top, right, bottom), "image": image, "size": (height, width)}


@refuses
def m2_capacity(depth: Depth | Region, weights: StrPath) -> float | None:
    """M2's capacity in mL from a depth image of the robot's view, or from its region of interest.

    Parameters
    ----------
    depth : path of a 16-bit PNG, array of uint16 in mm, or a result of `region`
    weights : path of the published weights of M2's capacity network (.pth, .npz, .safetensors)

    Returns
    -------
    float or None
        None if no near object is large enough. The network can give impossible values, even below
        0.

    Raises
    ------
    ParameterError
        The weights are for another network, or an image cannot be read.
    MissingFileError
        A file does not exist.

    Examples
    --------
    >>> network = corsmal_feat.nets.build("m2_capacity", seed=0)   # nobody has trained it
    >>> np.savez("untrained.npz", **network.state_dict())
    >>> depth = np.zeros((720, 1280), np.uint16)
    >>> depth[300:500, 600:720] = 500
    >>> capacity = corsmal_feat.vision.m2_capacity(depth, "untrained.npz")
    >>> bool(np.isfinite(capacity))
    True
    """
    if isinstance(depth, dict) and not depth.keys() >= Region.__required_keys__:
        raise ParameterError("depth must be a path, an array, or a result of region")
    found = depth if isinstance(depth, dict) else region(depth)
    if found is None:
        return None
    image = as_array("image", found["image"], np.float32)
    if image.ndim != 2:
        raise ParameterError(f"the image of a region has shape {image.shape}, expected (112, 112)")
    height, width = found["size"]
    return _core.m2_capacity(image, (float(height), float(width)), existing(weights))
