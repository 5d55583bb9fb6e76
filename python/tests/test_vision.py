"""Capacity from calibrated views."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest
from corsmal_feat import vision
from corsmal_feat.errors import MissingFileError, ParameterError

SHARED = Path(os.environ.get("CORSMAL_SHARED", Path(__file__).parents[3] / "shared"))


def calibration(path: Path, around: float) -> Path:
    """A camera 1 m from the origin, 5 cm above it, that looks horizontally."""
    s, c = np.sin(around), np.cos(around)
    rotation = [[-s, c, 0.0], [0.0, 0.0, -1.0], [-c, -s, 0.0]]
    intrinsic = [[900.0, 0.0, 320.0], [0.0, 900.0, 320.0], [0.0, 0.0, 1.0]]
    camera = {"rvec": rotation, "tvec": [[0.0], [0.05], [1.0]]}
    path.write_text(json.dumps({"intrinsic": {"rgb": intrinsic}, "extrinsic": {"rgb": camera}}))
    return path


def cylinder() -> np.ndarray:
    """The view of a cylinder of 60 mm width and 100 mm height on the origin: nearly a rectangle."""
    mask = np.zeros((700, 640), dtype=bool)
    mask[275:366, 293:348] = True
    return mask


def test_lode_measures_a_cylinder(tmp_path: Path) -> None:
    files = [calibration(tmp_path / f"{i}.json", i * np.pi / 2) for i in range(2)]
    mask = cylinder()
    found = vision.lode([mask, mask], files)
    assert found["width"] == pytest.approx(60.0, abs=2.0)
    assert found["height"] == pytest.approx(100.0, abs=6.0)
    assert found["capacity"] == pytest.approx(np.pi * 9.0 * 10.0, rel=0.12)
    assert found["capacity_low"] is not None and found["capacity_high"] is not None
    assert found["capacity_low"] < found["capacity"] < found["capacity_high"]
    assert found["profile"].shape[1] == 2 and 0.0 <= found["residual"] < 2.0
    read = [vision.load_calibration(file) for file in files]
    assert vision.lode([mask, mask], read)["capacity"] == found["capacity"]
    assert read[0].rgb.projection.shape == (3, 4) and read[0].ir1 is None


def test_the_real_pair_gives_the_published_size() -> None:
    data = SHARED / "data" / "lode"
    if not data.exists():
        pytest.skip(f"{data} is absent (set CORSMAL_SHARED)")
    masks = [data / "masks" / f"mask_c{i}.png" for i in (1, 2)]
    files = [data / "calib" / f"calib_S1_c{i}.pickle" for i in (1, 2)]
    found = vision.lode(masks, files, variant="published")
    assert found["height"] == pytest.approx(317.63527054108215, abs=1e-6)
    assert found["width"] == pytest.approx(76.49305555555556, abs=1e-6)
    assert found["capacity"] == pytest.approx(571.2434776186, abs=1e-6)


def test_depth_gives_boxes_and_a_region(tmp_path: Path) -> None:
    file = calibration(tmp_path / "c.json", 0.0)
    mask = cylinder()
    # The front of the cylinder recedes to both sides.
    away = 970 + np.abs(np.arange(640) - 320)
    depth = np.where(mask, away[None, :], 0).astype(np.uint16)
    box = vision.cuboid(depth, mask, file, outliers="kept")
    assert box["points"] == mask.sum() and 0.5 < box["share"] <= 1.0
    assert box["high"] - box["low"] == pytest.approx([0.027, 0.0598, 0.0997], abs=0.003)
    volume = np.prod(box["high"] - box["low"]) * 1e6
    assert box["capacity"] == pytest.approx(volume * box["share"])
    upright = vision.upright_box([depth], [mask], [file])
    assert upright["sides"][2] == pytest.approx(0.095, abs=0.01)
    assert vision.region(depth) is None
    near = np.zeros((720, 1280), dtype=np.uint16)
    near[300:500, 600:720] = 500
    found = vision.region(near)
    assert found is not None
    assert found["bounds"] == (597, 295, 723, 505)
    assert found["image"].shape == (112, 112) and found["image"].dtype == np.float32


def test_refusals_say_what_is_possible(tmp_path: Path) -> None:
    file = calibration(tmp_path / "c.json", 0.0)
    mask = cylinder()
    with pytest.raises(ParameterError, match="the mask of view 1 is empty"):
        vision.lode([np.zeros_like(mask), mask], [file, file])
    with pytest.raises(ParameterError, match="two masks and two calibrations"):
        vision.lode([mask], [file])
    with pytest.raises(ParameterError, match="expected bool"):
        vision.lode([mask.astype(np.uint8), mask], [file, file])  # type: ignore[list-item]
    with pytest.raises(ParameterError, match="expected uint16"):
        vision.region(mask.astype(np.float64))  # type: ignore[arg-type]
    evil = tmp_path / "evil.pickle"
    evil.write_bytes(b"cos\nsystem\n(S'true'\ntR.")
    with pytest.raises(ParameterError, match=r"os\.system"):
        vision.load_calibration(evil)
    with pytest.raises(MissingFileError, match=r"none\.png"):
        vision.load_mask(tmp_path / "none.png")


def test_masks_of_another_size_are_refused(tmp_path: Path) -> None:
    files = [calibration(tmp_path / f"{i}.json", i * np.pi / 2) for i in range(2)]
    half = cylinder()[::2, ::2]
    with pytest.raises(ParameterError, match=r"view 1 has 320 by 350 px.* about 640 by 640 px"):
        vision.lode([half, half], files)


def test_inputs_that_contradict_each_other_are_refused(tmp_path: Path) -> None:
    files = [calibration(tmp_path / f"{i}.json", i * np.pi / 2) for i in range(2)]
    mask = cylinder()
    with pytest.raises(ParameterError, match="at the same place"):
        vision.lode([mask, mask], [files[0], files[0]])
    with pytest.raises(ParameterError, match=r"do not meet at one point, by \d+ px"):
        vision.lode([mask, np.roll(mask, 100, axis=0)], files)
    with pytest.raises(ParameterError, match="beyond the heights that are tried"):
        vision.lode([np.ones_like(mask), np.ones_like(mask)], files)
    depth = np.where(mask, 970 + np.abs(np.arange(640) - 320), 0).astype(np.uint16)
    for values in (depth // 10, depth * 30):
        with pytest.raises(ParameterError, match="impossible for a container"):
            vision.cuboid(values, mask, files[0], outliers="kept")
    half = np.ascontiguousarray(depth[::2, ::2])
    with pytest.raises(ParameterError, match="depth image has 320 by 350 px"):
        vision.cuboid(half, half > 0, files[0])
    camera = vision.load_calibration(files[0]).rgb
    longer = np.diag([1.5, 1.5, 1.0]) @ camera.intrinsic
    other = vision.Camera(longer, camera.rotation, camera.translation, camera.projection)
    with pytest.raises(ParameterError, match="'projMatrix' is not 'intrinsic' times"):
        vision.lode([mask, mask], [vision.Calibration(other), files[1]])


def test_cameras_that_see_nothing_are_refused(tmp_path: Path) -> None:
    file = calibration(tmp_path / "c.json", 0.0)
    camera = vision.load_calibration(file).rgb
    tiny = vision.Camera(
        camera.intrinsic, camera.rotation * 1e-39, camera.translation, camera.projection
    )
    depth = np.full((8, 8), 900, dtype=np.uint16)
    for outliers in ("published", "corrected", "kept"):
        with pytest.raises(ParameterError, match="not a rotation"):
            vision.cuboid(depth, depth > 0, vision.Calibration(tiny), outliers=outliers)


def test_m2_gives_the_published_capacities() -> None:
    data = SHARED / "data" / "ccm"
    weights = data / "weights" / "m2_capacity_cnn.npz"
    if not weights.exists():
        pytest.skip(f"{weights} is absent (set CORSMAL_SHARED)")
    reference = np.load(data / "m2_capacity_reference.npz")
    for image, size, expected in zip(
        reference["x"], reference["box"], reference["millilitres"], strict=True
    ):
        found: vision.Region = {
            "bounds": (0, 0, 1, 1),
            "image": image[0],
            "size": (float(size[0]), float(size[1])),
        }
        assert vision.m2_capacity(found, weights) == pytest.approx(float(expected[0]), abs=0.05)
    depth = np.zeros((720, 1280), dtype=np.uint16)
    assert vision.m2_capacity(depth, weights) is None
    depth[300:500, 600:720] = 500
    assert isinstance(vision.m2_capacity(depth, weights), float)
    with pytest.raises(ParameterError, match="not the weights of M2's capacity network"):
        vision.m2_capacity(depth, data / "weights" / "m2_filling_type_cnn.npz")


def test_seeds_are_whole_numbers() -> None:
    depth, intrinsic = np.zeros((4, 4), np.uint16), [[900.0, 0, 2], [0, 900, 2], [0, 0, 1]]
    camera = np.array(intrinsic)
    projection = camera @ np.eye(3, 4)
    calibration = vision.Calibration(vision.Camera(camera, np.eye(3), np.zeros(3), projection))
    for seed in (1.5, "1", -1, 2**64):
        with pytest.raises(ParameterError, match=r"seed must be a whole number from 0 to 2\*\*64"):
            vision.cuboid(depth, depth > 0, calibration, seed=seed)  # type: ignore[arg-type]
