"""The network's inference by ONNX Runtime, in f32 and in the int8 ways it has: a peer that checks ours and is timed against it.

    onnx.py FOLDER [--repeat N] [--ours COMMAND]
    onnx.py --self-test [--repeat N]

Packages: onnxruntime==1.32.0 onnx==1.23.2 onnx-ir==1.1.0 numpy==2.4.6.

FOLDER holds
  model.safetensors  an f32 model of ours
  case.safetensors   one window of F frames, T tags, A antennas, and what our f32 says of it at temperature 1:
                     maps U8 (F, 3, P, P), scalars F32 (F, 6), reads F32 (F, T, A, 6), names F32 (T, E),
                     actions F32 (8), targets F32 (T)

The network becomes two graphs, as a frame at a time runs it: `encoder`, one frame to its radar token, and `rest`, the tokens,
reads and names of the window to the probabilities. Each is written in more than one form, and each form runs in f32 and in
int8 of several kinds (`WAYS`). The f32 must give the case's probabilities, or the exit status is not 0.

Times are at batch 1 with 1 and 2 threads: first a look at all, least times, then N rounds of the fastest by turns, medians of
rounds' medians, and between the rounds COMMAND, which prints one line of JSON with our times in milliseconds:
  {"f32": {"1": {"encoder": ms, "rest": ms, "sum": ms}, "2": {...}}, "int8": {...}}
where 1 and 2 are threads, and what is not there is not compared. `sum` is the time from the last frame to the answer. An int8
way whose probabilities are further from the f32's than USABLE is listed but not picked.

On stdout one line of JSON, milliseconds and largest differences of probabilities; on stderr a table.
"""

import sys
from pathlib import Path

# This file's folder is where Python looks first, and there `onnx` would be this file.
sys.path = [entry for entry in sys.path if Path(entry or ".").resolve() != Path(__file__).resolve().parent]

import argparse
import json
import logging
import shlex
import statistics
import subprocess
import tempfile
import time

import numpy as np
import onnx
import onnxruntime
from onnx import TensorProto, helper, numpy_helper
from onnxruntime import quantization
from onnxruntime.quantization import matmul_nbits_quantizer

# Largest difference of f32 probabilities that passes, and of int8's that can stand for the network.
F32_BOUND = 1e-4
USABLE = 0.1
THREADS = (1, 2)
ACTIONS, SCALARS, READ_CHANNELS, MAPS = 8, 6, 6, 3
LEAK, EPSILON = 0.01, 1e-5
# With layer normalisation; the newest IR that goes with it.
OPSET, IR_VERSION, MICROSOFT = 17, 8, "com.microsoft"

# Frames of the case that ranges of the encoder's values are taken from, evenly spread.
CALIBRATION_FRAMES = 12
# Seconds of a first look at one way, and of one turn of a way and turns in a round.
LOOK, TURN, TURNS = 0.15, 0.1, 5
# Fastest ways that go into the rounds.
FINALISTS = 3

DTYPES = {"F32": np.dtype("<f4"), "U8": np.dtype("u1")}


class Mismatch(Exception):
    """What is compared is not the same, or cannot be."""


# Files


def read_safetensors(path):
    """Arrays by name, and the header's text entries."""
    raw = Path(path).read_bytes()
    length = int.from_bytes(raw[:8], "little")
    header = json.loads(raw[8 : 8 + length])
    metadata = header.pop("__metadata__", {})
    arrays = {}
    for name, entry in header.items():
        start, end = entry["data_offsets"]
        values = np.frombuffer(raw[8 + length + start : 8 + length + end], DTYPES[entry["dtype"]])
        arrays[name] = values.reshape(entry["shape"])
    return arrays, metadata


def write_safetensors(path, arrays, metadata=None):
    header, data = {"__metadata__": metadata} if metadata else {}, b""
    kinds = {dtype: name for name, dtype in DTYPES.items()}
    parts, end = [], 0
    for name, values in sorted(arrays.items()):
        data = values.tobytes()
        header[name] = {"dtype": kinds[values.dtype], "shape": values.shape, "data_offsets": [end, end + len(data)]}
        parts.append(data)
        end += len(data)
    text = json.dumps(header).encode()
    Path(path).write_bytes(len(text).to_bytes(8, "little") + text + b"".join(parts))


class Model:
    """Weights and shape of a network of ours."""

    def __init__(self, path):
        self.arrays, metadata = read_safetensors(path)
        description = json.loads(metadata["rf-hoi"])
        if description.get("precision", "f32") != "f32":
            raise Mismatch("the model is not an f32 one")
        self.config = config = description["config"]
        self.radar, self.tags, self.fusion = config["radar"], config["tags"], config["fusion"]
        if self.fusion not in ("concat", "none", "rfid", "radar") or "convolutions" not in config["encoder"]:
            raise Mismatch("only networks of convolutions, with no other fusion than by concatenation, become graphs")
        if any(branch["temporal"] != "transformer" for branch in (self.radar, self.tags)):
            raise Mismatch("only transformers become graphs")
        self.has_radar, self.has_tags = self.fusion != "rfid", self.fusion != "radar"
        self.convolutions = config["encoder"]["convolutions"]
        self.maps = [number for number in range(MAPS) if config["maps"][number]]
        if not self.maps:
            raise Mismatch("a network that looks at no map does not become a graph")
        self.taken = set()

    def __getitem__(self, name):
        self.taken.add(name)
        return self.arrays[name]


class Case:
    """One window, as the graphs take it."""

    def __init__(self, path, model):
        arrays, _ = read_safetensors(path)
        config, stack = model.config, model.tags["stack"]
        self.maps = np.ascontiguousarray(arrays["maps"][:, model.maps])
        self.scalars, self.names = arrays["scalars"], arrays["names"]
        reads = arrays["reads"]
        self.frames, self.count, antennas, _ = reads.shape
        # Tokens of a tag: frames of a stack one after the other, zeros past the end and for antennas that are not there.
        groups, taken = -(-self.frames // stack), min(antennas, config["antennas"])
        slots = np.zeros((self.count, groups * stack, config["antennas"], READ_CHANNELS), np.float32)
        slots[:, : self.frames, :taken] = reads[:, :, :taken].transpose(1, 0, 2, 3)
        self.reads = slots.reshape(self.count, groups, -1)
        self.want = {"actions": arrays["actions"], "targets": arrays["targets"]}

    def frame(self, number):
        return {"maps": self.maps[number : number + 1], "scalars": self.scalars[number : number + 1]}

    def window(self, model, tokens):
        feeds = {"tokens": tokens} if model.has_radar else {}
        return feeds | ({"reads": self.reads, "names": self.names} if model.has_tags else {})


# Graphs


class Graph:
    """Nodes one after the other; values are known by name."""

    def __init__(self, model):
        self.model = model
        self.nodes, self.constants, self.inputs, self.outputs, self.shapes = [], [], [], [], []

    def input(self, name, kind, shape):
        self.inputs.append(helper.make_tensor_value_info(name, kind, shape))
        return name

    def output(self, name, value, shape):
        self.nodes.append(helper.make_node("Identity", [value], [name], name))
        self.outputs.append(helper.make_tensor_value_info(name, TensorProto.FLOAT, shape))

    def constant(self, values):
        name = f"constant{len(self.constants)}"
        self.constants.append(numpy_helper.from_array(np.ascontiguousarray(values), name))
        return name

    def __call__(self, kind, *inputs, outputs=1, **attributes):
        number = len(self.nodes)
        names = [f"{kind}{number}_{n}" for n in range(outputs)]
        self.nodes.append(helper.make_node(kind, inputs, names, f"{kind}{number}", **attributes))
        return names[0] if outputs == 1 else names

    def reshape(self, value, *shape):
        return self("Reshape", value, self.constant(np.array(shape, np.int64)))

    def affine(self, value, weight, bias):
        return self("Gemm", value, self.constant(weight), self.constant(bias))

    def dense(self, value, name):
        return self.affine(value, self.model[f"{name}.weight"], self.model[f"{name}.bias"])

    def leaky(self, value):
        return self("LeakyRelu", value, alpha=LEAK)

    def norm(self, value, name):
        gamma, beta = self.constant(self.model[f"{name}.gamma"]), self.constant(self.model[f"{name}.beta"])
        return self("LayerNormalization", value, gamma, beta, axis=-1, epsilon=EPSILON)

    def attention(self, kind, heads, shape, *inputs):
        seen = self(kind, *inputs, domain=MICROSOFT, num_heads=heads)
        # Nothing infers the shapes of this domain.
        self.shapes.append(helper.make_tensor_value_info(seen, TensorProto.FLOAT, shape))
        return seen

    def head(self, value, name):
        return self.dense(self.leaky(self.dense(value, f"heads.{name}.first")), f"heads.{name}.second")

    def finish(self, name):
        graph = helper.make_graph(self.nodes, name, self.inputs, self.outputs, self.constants, value_info=self.shapes)
        sets = [helper.make_opsetid("", OPSET), helper.make_opsetid(MICROSOFT, 1)]
        made = helper.make_model(graph, opset_imports=sets, ir_version=IR_VERSION, producer_name="rf-hoi")
        return onnx.shape_inference.infer_shapes(made, data_prop=True)


def encoder_graph(model, form):
    """One frame's maps and scalars to its token, with the maps' convolutions `apart` or `grouped` in one."""
    g, points, shape, used = Graph(model), model.config["points"], model.convolutions, len(model.maps)
    maps = g.input("maps", TensorProto.UINT8, [1, used, points, points])
    scalars = g.input("scalars", TensorProto.FLOAT, [1, SCALARS])
    stride, pool = shape["stride"], shape["pool"]

    def convolve(value, layer, maps, group, stride, scale):
        names = [f"radar.encoder.maps.{number}.{layer}" for number in maps]
        weight = np.concatenate([model[f"{name}.weight"] for name in names]) * np.float32(scale)
        bias = np.concatenate([model[f"{name}.bias"] for name in names])
        attributes = {"group": group, "strides": [stride] * 2, "pads": [1] * 4, "kernel_shape": [3, 3]}
        return g.leaky(g("Conv", value, g.constant(weight), g.constant(bias), **attributes))

    def encode(codes, numbers):
        value = g("Cast", codes, to=TensorProto.FLOAT)
        # Codes are of 0 to 255, maps of 0 to 1; the first convolution's weights see to it.
        value = convolve(value, "first", numbers, len(numbers), stride, 1 / 255)
        value = convolve(value, "second", numbers, len(numbers), 1, 1)
        return g("Flatten", g("MaxPool", value, kernel_shape=[pool] * 2, strides=[pool] * 2))

    # Arrays are numbered by the maps that are looked at, not by all maps.
    if form == "grouped" or used == 1:
        features = [encode(maps, range(used))]
    else:
        each = g("Split", maps, outputs=used, axis=1)
        features = [encode(codes, [number]) for number, codes in enumerate(each)]
    joined = g("Concat", *features, scalars, axis=1)
    token = g.dense(g.leaky(g.dense(joined, "radar.encoder.first")), "radar.encoder.second")
    g.output("token", token, [1, model.radar["width"]])
    return g.finish("encoder")


def positions(length, width):
    """Sinusoidal positions, sine at even places and cosine at odd ones."""
    place = np.arange(width)
    angle = np.arange(length)[:, None] / 10_000.0 ** (place // 2 * 2 / width)
    return np.where(place % 2 == 0, np.sin(angle), np.cos(angle)).astype(np.float32)


def transformer(g, value, batch, length, branch, name, form):
    """(batch * length, width) to the same; attention in single operators (`plain`), `joined` in one, or `fused`
    with the projection before it."""
    width, heads = branch["width"], branch["heads"]
    size = width // heads
    value = g("Add", value, g.constant(np.tile(positions(length, width), (batch, 1))))
    name = f"{name}.temporal.Transformer"
    for number in range(branch["layers"]):
        layer = f"{name}.layers.{number}"
        weight, bias = (g.model[f"{layer}.attention.qkv.{part}"] for part in ("weight", "bias"))
        normed = g.norm(value, f"{layer}.attention_norm")
        if form == "fused":
            tokens = g.reshape(normed, batch, length, width)
            seen = g.attention("Attention", heads, [batch, length, width], tokens, g.constant(weight), g.constant(bias))
        elif form == "joined":
            qkv = g.reshape(g.affine(normed, weight, bias), batch, length, 3 * width)
            parts = g("Split", qkv, outputs=3, axis=2)
            seen = g.attention("MultiHeadAttention", heads, [batch, length, width], *parts)
        else:
            # Scores are over the root of the size; the queries' weights see to it.
            scale = np.repeat([size**-0.5, 1, 1], width).astype(np.float32)
            qkv = g.reshape(g.affine(normed, weight * scale, bias * scale), batch, length, 3 * heads, size)
            q, k, v = g("Split", g("Transpose", qkv, perm=[0, 2, 1, 3]), outputs=3, axis=1)
            scores = g("Softmax", g("MatMul", q, g("Transpose", k, perm=[0, 1, 3, 2])), axis=-1)
            seen = g("Transpose", g("MatMul", scores, v), perm=[0, 2, 1, 3])
        seen = g.dense(g.reshape(seen, batch * length, width), f"{layer}.attention.out")
        value = g("Add", value, seen)
        inner = g.leaky(g.dense(g.norm(value, f"{layer}.dense_norm"), f"{layer}.wide"))
        value = g("Add", value, g.dense(inner, f"{layer}.narrow"))
    return g.norm(value, f"{name}.norm")


def pooled(g, value, batch, length, width):
    """Means over the tokens, (batch, width)."""
    return g("ReduceMean", g.reshape(value, batch, length, width), axes=[1], keepdims=0)


def radar_branch(g, model, frames, form):
    width, stack = model.radar["width"], model.radar["stack"]
    tokens = g.input("tokens", TensorProto.FLOAT, [frames, width])
    groups = -(-frames // stack)
    if stack > 1:
        if missing := groups * stack - frames:
            tokens = g("Concat", tokens, g.constant(np.zeros((missing, width), np.float32)), axis=0)
        tokens = g.dense(g.reshape(tokens, groups, stack * width), "radar.stack")
    return pooled(g, transformer(g, tokens, 1, groups, model.radar, "radar", form), 1, groups, width)


def tag_branch(g, model, reads_shape, form):
    width, dimensions = model.tags["width"], model.config["name_dimensions"]
    count, groups, features = reads_shape
    reads = g.input("reads", TensorProto.FLOAT, [count, groups, features])
    names = g.input("names", TensorProto.FLOAT, [count, dimensions])
    tokens = g.dense(g.reshape(reads, count * groups, features), "tags.encoder")
    tokens = g.leaky(g.norm(tokens, "tags.norm"))
    tokens = transformer(g, tokens, count, groups, model.tags, "tags", form)
    both = g("Concat", pooled(g, tokens, count, groups, width), g.dense(names, "tags.names"), axis=1)
    return g.leaky(g.dense(both, "tags.join"))


def rest_graph(model, case, form):
    """Tokens, reads and names to the probabilities of actions and targets."""
    g, count = Graph(model), case.count
    radar = radar_branch(g, model, case.frames, form) if model.has_radar else None
    tags = tag_branch(g, model, case.reads.shape, form) if model.has_tags else None
    evidence = [tags] if tags else []
    if radar and model.fusion != "none":
        evidence.append(g("Expand", radar, g.constant(np.array([count, model.radar["width"]], np.int64))))
    scores = g.head(g("Concat", *evidence, axis=1) if len(evidence) > 1 else evidence[0], "target")
    targets = g("Softmax", g.reshape(scores, 1, count), axis=1)
    evidence = [radar] if radar else []
    if tags and model.fusion != "none":
        evidence += [g("MatMul", targets, tags), g("ReduceMean", tags, axes=[0], keepdims=1)]
    actions = g.head(g("Concat", *evidence, axis=1) if len(evidence) > 1 else evidence[0], "action")
    g.output("actions", g.reshape(g("Softmax", actions, axis=1), ACTIONS), [ACTIONS])
    g.output("targets", g.reshape(targets, count), [count])
    return g.finish("rest")


# int8


class Calibration(quantization.CalibrationDataReader):
    def __init__(self, feeds):
        self.feeds = iter(feeds)

    def get_next(self):
        return next(self.feeds, None)


DENSE = ["MatMul", "Gemm", "Attention"]
# How each int8 is asked for: of the activations' ranges as they come, of ranges from the case, of weights in blocks.
DYNAMIC = {
    "dynamic": {"op_types_to_quantize": DENSE, "weight_type": quantization.QuantType.QInt8},
    "dynamic-conv": {"op_types_to_quantize": [*DENSE, "Conv"], "weight_type": quantization.QuantType.QInt8},
    # The only weights that its integer convolution takes.
    "dynamic-conv-u8": {"op_types_to_quantize": [*DENSE, "Conv"], "weight_type": quantization.QuantType.QUInt8},
}
LAYERS = ["MatMul", "Gemm", "Conv", "MaxPool", "LeakyRelu", "Flatten"]
QDQ, QOPERATOR = quantization.QuantFormat.QDQ, quantization.QuantFormat.QOperator
WEIGHTS_ONLY = {"MatMulConstBOnly": True}
STATIC = {
    "qdq": {"quant_format": QDQ},
    "qdq-layers": {"quant_format": QDQ, "op_types_to_quantize": LAYERS, "extra_options": WEIGHTS_ONLY},
    # Dense layers that leave f32 behind them.
    "qdq-open": {
        "quant_format": QDQ,
        "op_types_to_quantize": LAYERS,
        "extra_options": WEIGHTS_ONLY | {"OpTypesToExcludeOutputQuantization": ["MatMul", "Gemm"]},
    },
    "qoperator": {"quant_format": QOPERATOR},
    "qoperator-layers": {"quant_format": QOPERATOR, "op_types_to_quantize": LAYERS, "extra_options": WEIGHTS_ONLY},
}
# Inputs of a block. Made for one row at a time, as the encoder has; with more rows it is slower than f32.
BLOCKS = {"blocks-128": 128}
# Ways of each graph. What is left out does the same as another: there is no convolution in the rest, and ranges from the case
# cannot be had of `fused` attention, nor of `joined` attention's inside.
WAYS = {
    "encoder": {form: ["f32", *DYNAMIC, *STATIC, *BLOCKS] for form in ("grouped", "apart")},
    "rest": {
        "plain": ["f32", "dynamic", "qdq", "qoperator"],
        "joined": ["f32", "dynamic", *STATIC],
        "fused": ["f32", "dynamic"],
    },
}


def quantise(precision, model, feeds, folder):
    """The model's bytes in a precision."""
    if precision in BLOCKS:
        return in_blocks(model, BLOCKS[precision])
    source, result = folder / "f32.onnx", folder / "int8.onnx"
    onnx.save(model, source)
    if precision in DYNAMIC:
        quantization.quantize_dynamic(source, result, per_channel=True, **DYNAMIC[precision])
        return result.read_bytes()
    kinds = {"activation_type": quantization.QuantType.QUInt8, "weight_type": quantization.QuantType.QInt8}
    options = {"per_channel": True, **kinds, **STATIC[precision]}
    quantization.quantize_static(source, result, Calibration(feeds), **options)
    return codes_as_they_are(onnx.load(result)).SerializeToString()


def codes_as_they_are(model):
    """Without the way from codes to f32 and back to the same codes."""
    constants = {c.name: numpy_helper.to_array(c) for c in model.graph.initializer}
    casts = {node.output[0]: node.input[0] for node in model.graph.node if node.op_type == "Cast"}
    for node in [n for n in model.graph.node if n.op_type == "QuantizeLinear" and n.input[0] in casts]:
        if constants[node.input[1]] == 1 and constants[node.input[2]] == 0:
            for other in model.graph.node:
                for place, name in enumerate(other.input):
                    if name == node.output[0]:
                        other.input[place] = casts[node.input[0]]
            model.graph.node.remove(node)
    used = {name for node in model.graph.node for name in node.input}
    for node in [n for n in model.graph.node if n.op_type == "Cast" and n.output[0] not in used]:
        model.graph.node.remove(node)
    return model


def in_blocks(model, size):
    """Weights of dense layers by blocks of inputs, activations quantised as they come."""
    split = onnx.ModelProto()
    split.CopyFrom(model)
    del split.graph.node[:]
    for node in model.graph.node:
        if node.op_type == "Gemm":
            product = f"{node.output[0]}_product"
            split.graph.node.append(helper.make_node("MatMul", node.input[:2], [product], node.name))
            split.graph.node.append(helper.make_node("Add", [product, node.input[2]], node.output, f"{node.name}_bias"))
        else:
            split.graph.node.append(node)
    work = matmul_nbits_quantizer.MatMulNBitsQuantizer(split, block_size=size, is_symmetric=True, bits=8, accuracy_level=4)
    work.process()
    return work.model.model.SerializeToString()


# Runs


class Run:
    """A graph that is ready, with its input and room for its output bound."""

    def __init__(self, graph, feeds, threads):
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads, options.inter_op_num_threads = threads, 1
        options.execution_mode = onnxruntime.ExecutionMode.ORT_SEQUENTIAL
        options.graph_optimization_level = onnxruntime.GraphOptimizationLevel.ORT_ENABLE_ALL
        options.log_severity_level = 4
        self.session = onnxruntime.InferenceSession(graph, options, providers=["CPUExecutionProvider"])
        self.bound = self.session.io_binding()
        for name, values in feeds.items():
            self.bound.bind_cpu_input(name, np.ascontiguousarray(values))
        self.out = {}
        for output in self.session.get_outputs():
            place = onnxruntime.OrtValue.ortvalue_from_shape_and_type(output.shape, np.float32)
            self.bound.bind_ortvalue_output(output.name, place)
            self.out[output.name] = place

    def of(self, feeds):
        """Results of some input."""
        names = [output.name for output in self.session.get_outputs()]
        return dict(zip(names, self.session.run(names, feeds)))

    def times(self, seconds, least=5):
        """Milliseconds of runs, warmed up, for so long."""
        run, bound = self.session.run_with_iobinding, self.bound
        for _ in range(3):
            run(bound)
        times, end = [], time.perf_counter() + seconds
        while len(times) < least or time.perf_counter() < end:
            start = time.perf_counter()
            run(bound)
            times.append((time.perf_counter() - start) * 1e3)
        return times


def call_overhead():
    """Milliseconds of a run that does next to nothing: what each time holds of Python."""
    value = helper.make_tensor_value_info("value", TensorProto.FLOAT, [1])
    out = helper.make_tensor_value_info("out", TensorProto.FLOAT, [1])
    graph = helper.make_graph([helper.make_node("Neg", ["value"], ["out"])], "nothing", [value], [out])
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=IR_VERSION)
    run = Run(model.SerializeToString(), {"value": np.zeros(1, np.float32)}, 1)
    return statistics.median(run.times(LOOK))


def difference(got, want):
    """Largest, of all probabilities; what is no number differs by 1."""
    return max(float(np.nan_to_num(np.abs(got[name] - want[name]), nan=1.0).max()) for name in ("actions", "targets"))


class Peer:
    """Both graphs in all forms and precisions."""

    def __init__(self, folder):
        self.model = Model(folder / "model.safetensors")
        self.case = Case(folder / "case.safetensors", self.model)
        self.graphs = {}
        if self.model.has_radar:
            self.graphs["encoder"] = {form: encoder_graph(self.model, form) for form in WAYS["encoder"]}
        self.graphs["rest"] = {form: rest_graph(self.model, self.case, form) for form in WAYS["rest"]}
        if left := set(self.model.arrays) - self.model.taken:
            raise Mismatch(f"arrays that no graph has taken: {sorted(left)}")
        self.bytes, self.failed = {}, {}
        self.check()

    def tokens(self, graph):
        if not self.model.has_radar:
            return None
        run = Run(graph, self.case.frame(0), 1)
        return np.concatenate([run.of(self.case.frame(n))["token"] for n in range(self.case.frames)])

    def answer(self, graph, tokens):
        return Run(graph, self.case.window(self.model, tokens), 1).of(self.case.window(self.model, tokens))

    def check(self):
        """f32 of all forms against the case."""
        plain = {graph: {form: m.SerializeToString() for form, m in forms.items()} for graph, forms in self.graphs.items()}
        self.difference = 0.0
        for encoder in plain.get("encoder", {"": None}).values():
            self.f32_tokens = self.tokens(encoder)
            for rest in plain["rest"].values():
                self.f32 = self.answer(rest, self.f32_tokens)
                for name, values in self.case.want.items():
                    if self.f32[name].shape != values.shape:
                        raise Mismatch(f"{name} is {self.f32[name].shape}, the case has {values.shape}")
                self.difference = max(self.difference, difference(self.f32, self.case.want))
        if not self.difference <= F32_BOUND:
            raise Mismatch(f"f32 probabilities differ by {self.difference:.2e}, {F32_BOUND} pass")

    def prepare(self, folder):
        """All ways as bytes, with how far their answers are from the f32's."""
        some = range(0, self.case.frames, -(-self.case.frames // CALIBRATION_FRAMES))
        frames = [self.case.frame(number) for number in some]
        feeds = {"encoder": frames, "rest": [self.case.window(self.model, self.f32_tokens)]}
        plain = self.graphs["rest"]["plain"].SerializeToString()
        self.differences = {}
        for graph, forms in self.graphs.items():
            for form, model in forms.items():
                for precision in WAYS[graph][form]:
                    way = graph, f"{form}.{precision}"
                    try:
                        made = model.SerializeToString()
                        if precision != "f32":
                            made = quantise(precision, model, feeds[graph], folder)
                        if graph == "encoder":
                            got = self.answer(plain, self.tokens(made))
                        else:
                            got = self.answer(made, self.f32_tokens)
                    except Exception as error:  # What it cannot do is part of the result.
                        self.failed[way] = str(error).strip().splitlines()[0][:200]
                        continue
                    self.bytes[way], self.differences[way] = made, difference(got, self.f32)

    def run(self, way, threads):
        feeds = self.case.frame(self.case.frames - 1) if way[0] == "encoder" else None
        return Run(self.bytes[way], feeds or self.case.window(self.model, self.f32_tokens), threads)

    def look(self):
        """Each way by itself: least milliseconds by way and threads, which a busy machine distorts least."""
        return {(*way, t): min(self.run(way, t).times(LOOK)) for way in self.bytes for t in THREADS}

    def finalists(self, look, threads):
        """The fastest ways by graph and precision."""
        chosen = {}
        for graph in self.graphs:
            for precision in ("f32", "int8"):
                usable = [w for w in self.bytes if w[0] == graph and w[1].endswith(".f32") == (precision == "f32")]
                usable = [w for w in usable if self.differences[w] <= USABLE]
                usable.sort(key=lambda w: look[(*w, threads)])
                if not usable:
                    raise Mismatch(f"no {precision} of {graph} can be used")
                chosen[graph, precision] = usable[:FINALISTS]
        return chosen

    def together(self, ways):
        """Largest difference with both graphs in their ways."""
        return difference(self.answer(self.bytes[ways["rest"]], self.tokens(self.bytes.get(ways.get("encoder")))), self.f32)


# Rounds


def one_round(runs):
    """Median and least time of each, by turns."""
    times = {way: [] for way in runs}
    for _ in range(TURNS):
        for way, run in runs.items():
            times[way] += run.times(TURN, least=2)
    return {way: (statistics.median(t), min(t)) for way, t in times.items()}


def ours_once(command):
    done = subprocess.run(shlex.split(command), capture_output=True, text=True)
    if done.returncode:
        raise Mismatch(f"{command} ended with {done.returncode}: {done.stderr.strip()[-500:]}")
    return json.loads(done.stdout.strip().splitlines()[-1])


def median_of(tables):
    """Tables of tables of numbers, the median at each place."""
    if isinstance(tables[0], dict):
        return {key: median_of([table[key] for table in tables]) for key in tables[0]}
    return statistics.median(tables)


def measure(peer, repeat, command):
    look = peer.look()
    chosen = {threads: peer.finalists(look, threads) for threads in THREADS}
    medians, ours = {}, []
    for _ in range(repeat):
        for threads in THREADS:
            runs = {way: peer.run(way, threads) for ways in chosen[threads].values() for way in ways}
            for way, value in one_round(runs).items():
                medians.setdefault((*way, threads), []).append(value)
        if command:
            ours.append(ours_once(command))
    finals = {key: statistics.median(m for m, _ in values) for key, values in medians.items()}
    least = {key: min(l for _, l in values) for key, values in medians.items()}
    best = {}
    for precision in ("f32", "int8"):
        for threads in THREADS:
            ways = {g: min(chosen[threads][g, precision], key=lambda w: finals[(*w, threads)]) for g in peer.graphs}
            row = {graph: finals[(*way, threads)] for graph, way in ways.items()}
            row |= {"sum": sum(row.values()), "ways": {graph: way[1] for graph, way in ways.items()}}
            row["least"] = {graph: least[(*way, threads)] for graph, way in ways.items()}
            row["difference"] = peer.together(ways)
            best.setdefault(precision, {})[str(threads)] = row
    ours = median_of(ours) if ours else {}
    return look, best, ours, ratios(best, ours)


def ratios(theirs, ours):
    """Their times over ours of the same precision, and of our most threads where we have none of so many."""
    found = {}
    for precision, by_threads in theirs.items():
        for threads, row in by_threads.items():
            there = [t for t in ours.get(precision, {}) if int(t) <= int(threads)]
            if there:
                of_ours = ours[precision][max(there, key=int)]
                values = {part: row[part] / of_ours[part] for part in ("encoder", "rest", "sum") if part in row and part in of_ours}
                found.setdefault(precision, {})[threads] = {"ours": int(max(there, key=int)), **values}
    return found


def report(peer, look, best, ours, ratio):
    """A table on stderr; the same for JSON."""
    say = lambda text="": print(text, file=sys.stderr)
    overhead = call_overhead()
    case, shape = peer.case, {"frames": peer.case.frames, "tags": peer.case.count, "points": peer.model.config["points"]}
    say(f"{shape['frames']} frames, {shape['tags']} tags, maps of {shape['points']} points; ms, batch 1")
    say(f"f32 differs from the case by {peer.difference:.1e}; a call's overhead is {overhead:.4f} ms")
    ways = {}
    for graph in peer.graphs:
        say(f"{graph:34} {'1 thread':>10} {'2 threads':>10} {'difference':>11}")
        for way in sorted((w for w in peer.bytes if w[0] == graph), key=lambda w: look[(*w, 1)]):
            times = {str(t): look[(*way, t)] for t in THREADS}
            ways.setdefault(graph, {})[way[1]] = {**times, "difference": peer.differences[way]}
            say(f"  {way[1]:32} {times['1']:10.4f} {times['2']:10.4f} {peer.differences[way]:11.1e}")
    for (graph, way), reason in peer.failed.items():
        say(f"  {graph} {way}: {reason}")
    say("best: medians of rounds")
    for precision, by_threads in best.items():
        for threads, row in by_threads.items():
            times = ", ".join(f"{part} {row[part]:.4f}" for part in (*peer.graphs, "sum"))
            ways_of = ", ".join(f"{graph} {row['ways'][graph]} (least {row['least'][graph]:.4f})" for graph in peer.graphs)
            say(f"  {precision} {threads}: {times}; difference {row['difference']:.1e}; {ways_of}")
    for precision, by_threads in ours.items():
        for threads, row in by_threads.items():
            say(f"  ours {precision} {threads}: " + ", ".join(f"{part} {value:.4f}" for part, value in row.items()))
    for precision, by_threads in ratio.items():
        for threads, row in by_threads.items():
            values = ", ".join(f"{part} {row[part]:.2f}" for part in row if part != "ours")
            say(f"  theirs over ours, {precision}, {threads} thread(s) over {row['ours']}: {values}")
    versions = {"onnxruntime": onnxruntime.__version__, "onnx": onnx.__version__, "numpy": np.__version__}
    failed = {f"{graph}.{way}": reason for (graph, way), reason in peer.failed.items()}
    head = {"versions": versions, **shape, "f32_difference": peer.difference, "overhead": overhead}
    return {**head, "look": ways, "failed": failed, "best": best, "ours": ours, "ratios": ratio}


def compare(folder, repeat, command):
    peer = Peer(folder)
    with tempfile.TemporaryDirectory() as work:
        peer.prepare(Path(work))
    print(json.dumps(report(peer, *measure(peer, repeat, command))), flush=True)


# Self-test: networks of random weights, and the same mathematics by numpy alone in f64.


def dense_of(w, name, x):
    return x @ w[f"{name}.weight"] + w[f"{name}.bias"]


def leaky_of(x):
    return np.where(x < 0, LEAK * x, x)


def norm_of(w, name, x):
    centred = x - x.mean(-1, keepdims=True)
    return centred / np.sqrt((centred**2).mean(-1, keepdims=True) + EPSILON) * w[f"{name}.gamma"] + w[f"{name}.beta"]


def softmax_of(x):
    e = np.exp(x - x.max(-1, keepdims=True))
    return e / e.sum(-1, keepdims=True)


def convolution_of(w, name, x, stride):
    """(in, P, P) to (out, P / stride, P / stride)."""
    padded = np.pad(x, ((0, 0), (1, 1), (1, 1)))
    windows = np.lib.stride_tricks.sliding_window_view(padded, (3, 3), axis=(1, 2))[:, ::stride, ::stride]
    return np.einsum("iyxab,oiab->oyx", windows, w[f"{name}.weight"]) + w[f"{name}.bias"][:, None, None]


def token_of(w, config, maps, scalars):
    shape, features = config["encoder"]["convolutions"], []
    pool = shape["pool"]
    for number, place in enumerate(np.flatnonzero(config["maps"])):
        name = f"radar.encoder.maps.{number}"
        x = leaky_of(convolution_of(w, f"{name}.first", maps[place][None] / 255.0, shape["stride"]))
        x = leaky_of(convolution_of(w, f"{name}.second", x, 1))
        channels, side, _ = x.shape
        features.append(x.reshape(channels, side // pool, pool, side // pool, pool).max((2, 4)).ravel())
    joined = np.concatenate([*features, scalars])
    return dense_of(w, "radar.encoder.second", leaky_of(dense_of(w, "radar.encoder.first", joined)))


def sequence_of(w, name, branch, x):
    """(L, W) to its mean after the transformer."""
    width, heads = branch["width"], branch["heads"]
    for at in range(len(x)):
        for place in range(width):
            angle = at / 10_000 ** ((place - place % 2) / width)
            x[at, place] += np.cos(angle) if place % 2 else np.sin(angle)
    for number in range(branch["layers"]):
        layer = f"{name}.temporal.Transformer.layers.{number}"
        qkv = dense_of(w, f"{layer}.attention.qkv", norm_of(w, f"{layer}.attention_norm", x))
        seen = []
        for part in np.split(np.arange(width), heads):
            q, k, v = (qkv[:, part + offset] for offset in (0, width, 2 * width))
            seen.append(softmax_of(q @ k.T / np.sqrt(width / heads)) @ v)
        x = x + dense_of(w, f"{layer}.attention.out", np.concatenate(seen, 1))
        inner = leaky_of(dense_of(w, f"{layer}.wide", norm_of(w, f"{layer}.dense_norm", x)))
        x = x + dense_of(w, f"{layer}.narrow", inner)
    return norm_of(w, f"{name}.temporal.Transformer.norm", x).mean(0)


def answer_of(w, config, case):
    fusion, radar, tags = config["fusion"], None, None
    frames, count, _, _ = case["reads"].shape
    head = lambda name, x: dense_of(w, f"heads.{name}.second", leaky_of(dense_of(w, f"heads.{name}.first", x)))
    if fusion != "rfid":
        tokens = [token_of(w, config, *frame) for frame in zip(case["maps"], case["scalars"])]
        if (stack := config["radar"]["stack"]) > 1:
            tokens += [np.zeros_like(tokens[0])] * (-frames % stack)
            tokens = [dense_of(w, "radar.stack", np.concatenate(tokens[n : n + stack])) for n in range(0, len(tokens), stack)]
        radar = sequence_of(w, "radar", config["radar"], np.array(tokens))
    if fusion != "radar":
        stack, antennas, tags = config["tags"]["stack"], config["antennas"], []
        for tag in range(count):
            tokens = []
            for first in range(0, frames, stack):
                token = np.zeros((stack, antennas, READ_CHANNELS))
                for slot, reads in enumerate(case["reads"][first : first + stack, tag]):
                    for antenna, read in enumerate(reads[:antennas]):
                        token[slot, antenna] = read
                tokens.append(leaky_of(norm_of(w, "tags.norm", dense_of(w, "tags.encoder", token.ravel()))))
            moved = sequence_of(w, "tags", config["tags"], np.array(tokens))
            both = np.concatenate([moved, dense_of(w, "tags.names", case["names"][tag])])
            tags.append(leaky_of(dense_of(w, "tags.join", both)))
    joined = fusion == "concat"
    evidence = [np.concatenate([*([tags[t]] if tags else []), *([radar] if joined or not tags else [])]) for t in range(count)]
    targets = softmax_of(np.array([head("target", e)[0] for e in evidence]))
    evidence = [radar] if fusion != "rfid" else []
    if tags and fusion != "none":
        evidence += [sum(t * p for t, p in zip(tags, targets)), sum(tags) / count]
    return {"actions": softmax_of(head("action", np.concatenate(evidence))), "targets": targets}


def random_weights(config, random):
    w, radar, tags, fusion = {}, config["radar"], config["tags"], config["fusion"]

    def layer(name, shape, inputs, gain=1.0):
        bound = gain * inputs**-0.5
        w[f"{name}.weight"] = random.uniform(-bound, bound, shape).astype(np.float32)
        w[f"{name}.bias"] = random.uniform(-bound, bound, shape[0] if len(shape) == 4 else shape[1]).astype(np.float32)

    def dense(name, a, b, gain=1.0):
        layer(name, (a, b), a, gain)

    def norm(name, width):
        w[f"{name}.gamma"] = random.uniform(0.5, 1.5, width).astype(np.float32)
        w[f"{name}.beta"] = random.uniform(-0.5, 0.5, width).astype(np.float32)

    def sequence(name, branch):
        width = branch["width"]
        for number in range(branch["layers"]):
            at = f"{name}.temporal.Transformer.layers.{number}"
            norm(f"{at}.attention_norm", width)
            # Strong enough that attention is not everywhere the same.
            dense(f"{at}.attention.qkv", width, 3 * width, 2.0)
            dense(f"{at}.attention.out", width, width)
            norm(f"{at}.dense_norm", width)
            dense(f"{at}.wide", width, branch["feed_forward"])
            dense(f"{at}.narrow", branch["feed_forward"], width)
        norm(f"{name}.temporal.Transformer.norm", width)

    if fusion != "rfid":
        shape = config["encoder"]["convolutions"]
        first, second = shape["channels"]
        side = config["points"] // shape["stride"] // shape["pool"]
        for number in range(sum(config["maps"])):
            layer(f"radar.encoder.maps.{number}.first", (first, 1, 3, 3), 9)
            layer(f"radar.encoder.maps.{number}.second", (second, first, 3, 3), 9 * first)
        dense("radar.encoder.first", sum(config["maps"]) * second * side * side + SCALARS, radar["width"])
        dense("radar.encoder.second", radar["width"], radar["width"])
        if radar["stack"] > 1:
            dense("radar.stack", radar["stack"] * radar["width"], radar["width"])
        sequence("radar", radar)
    if fusion != "radar":
        dense("tags.encoder", tags["stack"] * config["antennas"] * READ_CHANNELS, tags["width"])
        norm("tags.norm", tags["width"])
        sequence("tags", tags)
        dense("tags.names", config["name_dimensions"], tags["width"])
        dense("tags.join", 2 * tags["width"], tags["width"])
    a, b = radar["width"], tags["width"]
    widths = {"concat": (a + 2 * b, a + b), "none": (a, b), "rfid": (2 * b, b), "radar": (a, a)}[fusion]
    inner = a if fusion != "rfid" else b
    # Strong heads, so that probabilities are not all alike.
    for name, seen, inner, out in (("action", widths[0], inner, ACTIONS), ("target", widths[1], b, 1)):
        dense(f"heads.{name}.first", seen, inner, 2.0)
        dense(f"heads.{name}.second", inner, out, 4.0)
    return w


def random_case(config, random, frames, count, antennas):
    points = config["points"]
    maps = (255 * random.random((frames, MAPS, points, points)) ** 3).astype(np.uint8)
    maps[:, :, 0, 0] = 255
    reads = random.normal(0, 0.5, (frames, count, antennas, READ_CHANNELS)) + random.normal(0, 0.5, (count, 1, READ_CHANNELS))
    names = random.normal(0, 1, (count, config["name_dimensions"]))
    return {
        "maps": maps,
        "scalars": random.random((frames, SCALARS)).astype(np.float32),
        "reads": reads.astype(np.float32),
        "names": names.astype(np.float32),
    }


def shape_of(points, maps, channels, stride, pool, radar, tags, fusion="concat", antennas=4, dimensions=32):
    branches = {}
    for name, (width, layers, heads, feed_forward, stack) in (("radar", radar), ("tags", tags)):
        sizes = {"width": width, "layers": layers, "heads": heads, "feed_forward": feed_forward, "stack": stack}
        branches[name] = {**sizes, "temporal": "transformer"}
    encoder = {"convolutions": {"channels": channels, "stride": stride, "pool": pool}}
    given = {"points": points, "maps": maps, "antennas": antennas, "name_dimensions": dimensions, "encoder": encoder}
    return {**given, **branches, "fusion": fusion, "dropout": 0.1}


ALL = [True] * MAPS
# Configuration, frames, tags, antennas of the reader: all that can be odd, then the two shapes that are timed.
ODD = {
    "stacks past the end": (shape_of(16, ALL, [3, 5], 2, 2, (12, 2, 3, 20, 4), (8, 1, 1, 12, 3)), 10, 3, 4),
    "fewer antennas than the network": (shape_of(8, ALL, [1, 2], 1, 4, (8, 1, 2, 8, 1), (12, 2, 3, 16, 2)), 7, 2, 2),
    "more antennas than the network": (shape_of(8, ALL, [2, 1], 2, 1, (8, 1, 2, 8, 2), (8, 1, 2, 8, 1), antennas=2), 4, 5, 4),
    "two maps": (shape_of(24, [True, False, True], [2, 4], 3, 2, (16, 1, 4, 8, 1), (8, 1, 2, 8, 1)), 5, 2, 4),
    "one map, one frame, one tag": (shape_of(8, [False, True, False], [2, 4], 1, 2, (8, 1, 2, 8, 1), (8, 1, 2, 8, 2)), 1, 1, 4),
    "no fusion": (shape_of(16, ALL, [4, 8], 2, 2, (16, 1, 2, 32, 1), (8, 1, 2, 16, 2), "none"), 9, 4, 4),
    "tags alone": (shape_of(16, ALL, [4, 8], 2, 2, (16, 1, 2, 32, 1), (8, 1, 2, 16, 2), "rfid"), 9, 4, 4),
    "radar alone": (shape_of(16, ALL, [4, 8], 2, 2, (16, 1, 2, 32, 3), (8, 1, 2, 16, 2), "radar"), 9, 4, 4),
}
TIMED = {
    "small": (shape_of(32, ALL, [4, 8], 2, 2, (64, 2, 2, 128, 1), (64, 2, 2, 128, 2)), 60, 6, 4),
    "paper": (shape_of(256, ALL, [1, 1], 1, 8, (1024, 3, 2, 2048, 1), (128, 3, 2, 2048, 1)), 60, 6, 4),
}


def write_folder(folder, weights, config, case):
    description = {"version": 1, "precision": "f32", "config": config}
    write_safetensors(folder / "model.safetensors", weights, {"rf-hoi": json.dumps(description)})
    write_safetensors(folder / "case.safetensors", case)


def self_test(repeat):
    random = np.random.default_rng(1)
    for name, (config, *sizes) in (ODD | TIMED).items():
        with tempfile.TemporaryDirectory() as folder:
            folder = Path(folder)
            weights, case = random_weights(config, random), random_case(config, random, *sizes)
            case |= {part: values.astype(np.float32) for part, values in answer_of(weights, config, case).items()}
            write_folder(folder, weights, config, case)
            print(f"{name}: f32 differs by {Peer(folder).difference:.1e}", file=sys.stderr)
            if name in TIMED:
                compare(folder, repeat, None)
            else:
                every_array_matters(folder, weights, config, case)


def every_array_matters(folder, weights, config, case):
    """A model with other values in any one array must be found out."""
    random = np.random.default_rng(2)
    # What adds the same to all of a softmax's scores does not matter.
    same = "heads.target" if config["fusion"] == "radar" or len(case["names"]) == 1 else "heads.target.second.bias"
    for name, values in weights.items():
        if name.startswith(same):
            continue
        other = values + random.normal(1, 1, values.shape).astype(np.float32)
        write_folder(folder, weights | {name: other}, config, case)
        try:
            Peer(folder)
        except Mismatch:
            continue
        raise Mismatch(f"a wrong {name} was not found out")


def main():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("folder", type=Path, nargs="?")
    arguments.add_argument("--repeat", type=int, default=3, metavar="N", help="rounds")
    arguments.add_argument("--ours", metavar="COMMAND", help="prints our times as one line of JSON")
    arguments.add_argument("--self-test", action="store_true", help="random networks against numpy, no folder")
    given = arguments.parse_args()
    if given.self_test == (given.folder is not None) or given.repeat < 1:
        arguments.error("either a folder or --self-test, and at least one round")
    logging.disable(logging.WARNING)
    onnxruntime.set_default_logger_severity(4)
    try:
        self_test(given.repeat) if given.self_test else compare(given.folder, given.repeat, given.ours)
    except Mismatch as mismatch:
        sys.exit(str(mismatch))


if __name__ == "__main__":
    main()
