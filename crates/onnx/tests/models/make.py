"""Makes the small ONNX models of the tests: python make.py (onnx 1.23)."""

from pathlib import Path

import numpy as np
from onnx import TensorProto, checker, helper, numpy_helper, save

HERE = Path(__file__).parent
FLOAT, INT = TensorProto.FLOAT, TensorProto.INT64


def write(name, nodes, inputs, outputs, constants=(), check=True):
    """Writes a graph in opset 17."""
    value = helper.make_tensor_value_info
    tensors = [numpy_helper.from_array(array, key) for key, array in constants]
    graph = helper.make_graph(
        nodes,
        name,
        [value(*each) for each in inputs],
        [value(*each) for each in outputs],
        tensors,
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)])
    model.ir_version = 8
    if check:
        checker.check_model(model)
    save(model, HERE / f"{name}.onnx")


def detector(name, image, extra=()):
    """Two objects whose masks are the red and the green of the image."""
    nodes = [
        helper.make_node("Slice", ["image", "zero", "two", "channel"], ["colours"]),
        helper.make_node("Unsqueeze", ["colours", "one"], ["masks"]),
        helper.make_node("Identity", ["the_boxes"], ["boxes"]),
        helper.make_node("Identity", ["the_labels"], ["labels"]),
        helper.make_node("Identity", ["the_scores"], ["scores"]),
        *extra,
    ]
    constants = [
        ("zero", np.array([0])),
        ("one", np.array([1])),
        ("two", np.array([2])),
        ("channel", np.array([0])),
        ("the_boxes", np.array([[1, 0, 3, 2], [0, 0, 4, 3]], np.float32)),
        ("the_labels", np.array([47, 1])),
        ("the_scores", np.array([0.75, 0.5], np.float32)),
    ]
    outputs = [
        ("boxes", FLOAT, [2, 4]),
        ("labels", INT, [2]),
        ("scores", FLOAT, [2]),
        ("masks", FLOAT, [2, 1, "height", "width"]),
    ]
    write(name, nodes, [("image", FLOAT, image)], outputs, constants)


detector("detector", [3, "height", "width"])

# 512 numbers: the mean of each colour, then zeros.
mean = helper.make_node("ReduceMean", ["clip"], ["mean"], axes=[2, 3, 4], keepdims=0)
padded = helper.make_node("Pad", ["mean", "pads"], ["features"])
write(
    "embedder",
    [mean, padded],
    [("clip", FLOAT, ["items", 3, 16, 112, 112])],
    [("features", FLOAT, ["items", 512])],
    [("pads", np.array([0, 0, 0, 509]))],
)
# Gives three numbers only.
write(
    "short",
    [mean, helper.make_node("Identity", ["mean"], ["features"])],
    [("clip", FLOAT, ["items", 3, 16, 112, 112])],
    [("features", FLOAT, ["items", 3])],
    check=False,
)
# Takes a vector; has no masks; has an operator that there is not.
plain = helper.make_node("Identity", ["x"], ["y"])
write("vector", [plain], [("x", FLOAT, [5])], [("y", FLOAT, [5])])
write("unmasked", [plain], [("x", FLOAT, [3, 2, 2])], [("y", FLOAT, [3, 2, 2])])
unknown = helper.make_node("Levitate", ["x"], ["y"])
write("unknown", [unknown], [("x", FLOAT, [3, 2, 2])], [("y", FLOAT, [3, 2, 2])], check=False)
