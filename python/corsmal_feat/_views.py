"""Calibrations, masks and depth images of camera views."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from . import _core
from ._arrays import as_array
from ._refusals import existing, refuses
from .errors import ParameterError

StrPath = str | os.PathLike[str]
Doubles = npt.NDArray[np.float64]
Mask = StrPath | npt.NDArray[np.bool_]
Depth = StrPath | npt.NDArray[np.uint16]


@dataclass(frozen=True, eq=False)
class Camera:
    """A camera without lens distortion.

    Attributes
    ----------
    intrinsic : ndarray [3, 3], focal lengths and principal point in px
    rotation : ndarray [3, 3], world to camera (the data set calls it `rvec`)
    translation : ndarray [3], world to camera, in m
    projection : ndarray [3, 4], world to pixels, homogeneous

    Examples
    --------
    >>> camera = corsmal_feat.vision.load_calibration("c1.json").rgb
    >>> camera.projection @ [0.0, 0.0, 0.0, 1.0]  # where the world's origin is seen
    array([320., 365.,   1.])
    """

    intrinsic: Doubles
    rotation: Doubles
    translation: Doubles
    projection: Doubles


@dataclass(frozen=True, eq=False)
class Calibration:
    """The cameras of one view.

    Attributes
    ----------
    rgb : Camera
        Colour camera.
    ir1, ir2 : Camera, optional
        Infrared cameras, if the file has them.

    Examples
    --------
    >>> calibration = corsmal_feat.vision.load_calibration("c1.json")
    >>> calibration.rgb.intrinsic[0, 0], calibration.ir1
    (np.float64(900.0), None)
    """

    rgb: Camera
    ir1: Camera | None = None
    ir2: Camera | None = None


@refuses
def load_calibration(path: StrPath) -> Calibration:
    """Reads a calibration file of the data set, or the same content as JSON.

    A pickle is not executed: only lists, dictionaries, strings, numbers and numpy arrays are read;
    anything else is refused.

    Parameters
    ----------
    path : path
        The file.

    Returns
    -------
    Calibration

    Raises
    ------
    ParameterError
        The file cannot be read, holds anything else, or has no colour camera.
    MissingFileError
        There is no such file.

    Examples
    --------
    >>> corsmal_feat.vision.load_calibration("c1.json").rgb.translation.tolist()
    [0.0, 0.05, 1.0]
    """
    return Calibration(**{name: _camera(n) for name, n in _core.load_calibration(existing(path))})


@refuses
def load_mask(path: StrPath) -> npt.NDArray[np.bool_]:
    """Reads the PNG of a mask.

    Parameters
    ----------
    path : path
        The file.

    Returns
    -------
    bool [shape=(height, width)]
        True where a pixel is not black.

    Raises
    ------
    ParameterError
        The file cannot be read, has several values beside black, or has the mask in its
        transparency.
    MissingFileError
        There is no such file.

    Examples
    --------
    >>> mask = corsmal_feat.vision.load_mask("c1.png")
    >>> mask.shape, int(mask.sum())
    ((700, 640), 5005)
    """
    return _core.load_mask(existing(path))


@refuses
def load_depth(path: StrPath) -> npt.NDArray[np.uint16]:
    """Reads a 16-bit depth PNG.

    Parameters
    ----------
    path : path
        The file.

    Returns
    -------
    uint16 [shape=(height, width)]
        Depth in mm; 0 where nothing was measured.

    Raises
    ------
    ParameterError
        The file cannot be read, or is no 16-bit PNG.
    MissingFileError
        There is no such file.

    Examples
    --------
    >>> corsmal_feat.vision.load_depth("c1_depth.png").max()
    np.uint16(997)
    """
    return _core.load_depth(existing(path))


def _camera(numbers: Sequence[float]) -> Camera:
    n = np.array(numbers)
    return Camera(n[:9].reshape(3, 3), n[9:18].reshape(3, 3), n[18:21], n[21:].reshape(3, 4))


def camera_numbers(calibration: Calibration | StrPath) -> list[float]:
    """The 33 numbers of the colour camera, as the extension module takes them."""
    if not isinstance(calibration, Calibration):
        calibration = load_calibration(calibration)
    camera = calibration.rgb
    parts = (camera.intrinsic, camera.rotation, camera.translation, camera.projection)
    numbers = np.concatenate([as_array("calibration", part, np.float64).ravel() for part in parts])
    if numbers.size != 33:
        raise ParameterError(
            f"calibration has {numbers.size} numbers, expected 33 (3 x 3, 3 x 3, 3 and 3 x 4)"
        )
    return [float(n) for n in numbers]


def mask_pixels(mask: Mask) -> npt.NDArray[np.bool_]:
    """A mask, which is read if it is a path."""
    if isinstance(mask, np.ndarray):
        if mask.dtype != np.bool_ or mask.ndim != 2:
            raise ParameterError(
                f"mask has dtype {mask.dtype} and shape {mask.shape}, expected bool [height, width]"
            )
        return as_array("mask", mask)
    return load_mask(mask)


def depth_pixels(depth: Depth) -> npt.NDArray[np.uint16]:
    """A depth image, which is read if it is a path."""
    if isinstance(depth, np.ndarray):
        if depth.dtype != np.uint16 or depth.ndim != 2:
            raise ParameterError(
                f"depth has dtype {depth.dtype} and shape {depth.shape}, expected uint16 "
                "[height, width] in mm"
            )
        return as_array("depth", depth)
    return load_depth(depth)
