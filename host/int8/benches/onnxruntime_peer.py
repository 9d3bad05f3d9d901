"""The same work in onnxruntime, timed in turns with the kernels here, by threads.

python host/int8/benches/onnxruntime_peer.py target/debug/deps/throughput-* [ROUNDS]
needs onnxruntime, onnx, numpy
"""

import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import onnx
import onnxruntime as ort
from onnx import TensorProto, helper, numpy_helper
from onnxruntime.quantization import CalibrationDataReader, QuantFormat, QuantType, quantize_dynamic, quantize_static

RNG = np.random.default_rng(1)
TURN = 0.02
LEVELS = ["avx512-vnni", "amx"]


def model(path, nodes, weights, shape, output):
    graph = helper.make_graph(
        nodes,
        "peer",
        [helper.make_tensor_value_info("x", TensorProto.FLOAT, shape)],
        [helper.make_tensor_value_info(output, TensorProto.FLOAT, None)],
        [numpy_helper.from_array(value, name) for name, value in weights.items()],
    )
    made = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)])
    made.ir_version = 8
    onnx.save(onnx.shape_inference.infer_shapes(made), path)


def weight(*shape):
    return (RNG.standard_normal(shape) / np.sqrt(np.prod(shape[1:]))).astype(np.float32)


def layer(path, width, rows):
    """The products of a transformer layer in a row, each with bias and LeakyReLU; of the first, a third goes on."""
    weights, nodes, at = {"third": np.array([width, width, width], np.int64)}, [], "x"
    for name, k, n in [("qkv", width, 3 * width), ("out", width, width), ("up", width, 4 * width), ("down", 4 * width, width)]:
        weights[name] = weight(n, k).T.copy()
        weights[name + "_bias"] = weight(n)
        nodes.append(helper.make_node("MatMul", [at, name], [name + "_y"]))
        nodes.append(helper.make_node("Add", [name + "_y", name + "_bias"], [name + "_z"]))
        nodes.append(helper.make_node("LeakyRelu", [name + "_z"], [name + "_r"], alpha=0.01))
        at = name + "_r"
        if name == "qkv":
            nodes.append(helper.make_node("Split", [at, "third"], ["q", "k", "v"], axis=1))
            at = "q"
    model(path, nodes, weights, [rows, width], at)
    return [rows, width]


def convolutions(path, size, channels, stride, pool):
    weights, nodes, at = {}, [], "x"
    for number, (inputs, outputs) in enumerate(zip(channels, channels[1:])):
        name = f"conv{number}"
        weights[name] = weight(outputs, inputs, 3, 3)
        weights[name + "_bias"] = weight(outputs)
        attributes = {"kernel_shape": [3, 3], "pads": [1, 1, 1, 1], "strides": [stride, stride]}
        nodes.append(helper.make_node("Conv", [at, name, name + "_bias"], [name + "_y"], **attributes))
        nodes.append(helper.make_node("LeakyRelu", [name + "_y"], [name + "_r"], alpha=0.01))
        at = name + "_r"
    if pool:
        nodes.append(helper.make_node("MaxPool", [at], ["pooled"], kernel_shape=[pool] * 2, strides=[pool] * 2))
        at = "pooled"
    model(path, nodes, weights, [1, channels[0], size, size], at)
    return [1, channels[0], size, size]


class Calibration(CalibrationDataReader):
    def __init__(self, shape):
        self.left = [{"x": RNG.standard_normal(shape).astype(np.float32)} for _ in range(8)]

    def get_next(self):
        return self.left.pop() if self.left else None


def session(path, threads):
    options = ort.SessionOptions()
    options.intra_op_num_threads = threads
    options.inter_op_num_threads = 1
    return ort.InferenceSession(path, options, providers=["CPUExecutionProvider"])


def timed(run):
    run()
    start, times = time.perf_counter(), []
    while time.perf_counter() - start < TURN or len(times) < 5:
        before = time.perf_counter()
        run()
        times.append(time.perf_counter() - before)
    return times


def ours(binary, name, level):
    """Median and best of a few rounds, by threads; in microseconds."""
    command = [binary, "--bench", "--rounds", "15", "--level", level, name]
    found = {}
    for line in subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()[1:]:
        words = line.split()
        found[int(words[-5])] = float(words[-4]), float(words[-3])
    return found


def main():
    binary, rounds = sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 7
    folder = Path(tempfile.mkdtemp())
    cases = [(f"layer of {w}, {r} rows", lambda p, w=w, r=r: layer(p, w, r)) for w, r in [(128, 30), (128, 60), (1024, 30), (1024, 60)]]
    cases.append(("maps of 32: 1 to 4 to 8", lambda p: convolutions(p, 32, [1, 4, 8], 2, 0)))
    cases.append(("maps of 256: 1 to 1 to 1, pool 8", lambda p: convolutions(p, 256, [1, 1, 1], 1, 8)))
    print(f"onnxruntime {ort.__version__}; median and best in us, then both over ours at {' and '.join(LEVELS)}")
    for name, make in cases:
        paths = {kind: str(folder / f"{kind}.onnx") for kind in ["f32", "dynamic", "static"]}
        shape = make(paths["f32"])
        quantize_dynamic(paths["f32"], paths["dynamic"], weight_type=QuantType.QInt8, per_channel=True)
        quantize_static(paths["f32"], paths["static"], Calibration(shape), quant_format=QuantFormat.QDQ, per_channel=True, activation_type=QuantType.QUInt8, weight_type=QuantType.QInt8)
        x = {"x": RNG.standard_normal(shape).astype(np.float32)}
        sessions = {}
        for kind, path in paths.items():
            for threads in [1, 2]:
                try:
                    sessions[kind, threads] = session(path, threads)
                except Exception as error:  # a kind that it cannot run: dynamic convolutions of these types
                    print(f"{name}: {kind} does not run: {str(error)[:90]}")
                    break
        times = {key: [] for key in [*sessions, *((level, threads) for level in LEVELS for threads in [1, 2])]}
        for _ in range(rounds):
            for key, runner in sessions.items():
                found = np.array(timed(lambda: runner.run(None, x))) * 1e6
                times[key].append((np.median(found), found.min()))
            for level in LEVELS:
                for threads, found in ours(binary, name, level).items():
                    times[level, threads].append(found)
        for threads in [1, 2]:
            print(f"{name}, threads {threads}")
            for kind in [*paths, *LEVELS]:
                if (kind, threads) in times:
                    found = np.array(times[kind, threads])
                    print(f"  {kind:12} {np.median(found[:, 0]):10.1f} {found[:, 1].min():10.1f}", end="")
                    for level in LEVELS if kind in paths else []:
                        of = np.array(times[level, threads])
                        print(f"  {np.median(found[:, 0]) / np.median(of[:, 0]):7.2f} {found[:, 1].min() / of[:, 1].min():7.2f}", end="")
                    print(flush=True)


main()
