"""Our network as ONNX graphs, from the model's file: `encoder`, one frame to its radar token, and `rest`, the tokens, reads and
names of a window to the probabilities. What the files hold is in onnx.py.
"""

import json
from pathlib import Path

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

ACTIONS, SCALARS, READ_CHANNELS, MAPS = 8, 6, 6, 3
LEAK, EPSILON = 0.01, 1e-5
# Place of the sine of a turn in a read; what a net turn is made of, and how large it is at most.
SINE, TURN_CHANNELS, MOST_TURNS = 2, 2, 8
# With layer normalisation; the newest IR that goes with it.
OPSET, IR_VERSION, MICROSOFT = 17, 8, "com.microsoft"

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
    header = {"__metadata__": metadata} if metadata else {}
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
        if self.fusion not in ("concat", "none", "rfid", "radar") or config.get("beams"):
            raise Mismatch("only networks without learnt beams, with no other fusion than by concatenation, become graphs")
        if any(branch["temporal"] != "transformer" for branch in (self.radar, self.tags)):
            raise Mismatch("only transformers become graphs")
        self.has_radar, self.has_tags = self.fusion != "rfid", self.fusion != "radar"
        self.encoder = config["encoder"]
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
        # Net turns: of sure differences, and of turns between neighbours; half turns.
        turns = np.arctan2(slots[..., SINE], slots[..., SINE + 1]) / np.pi
        sums = np.stack([slots[..., 0].sum(1), turns.sum(1)], -1).clip(-MOST_TURNS, MOST_TURNS)
        self.turns = sums.reshape(self.count, -1).astype(np.float32)
        self.want = {"actions": arrays["actions"], "targets": arrays["targets"]}

    def frame(self, number):
        return {"maps": self.maps[number : number + 1], "scalars": self.scalars[number : number + 1]}

    def window(self, model, tokens):
        feeds = {"tokens": tokens} if model.has_radar else {}
        tags = {"reads": self.reads, "turns": self.turns, "names": self.names}
        return feeds | (tags if model.has_tags else {})


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
    g, points, used = Graph(model), model.config["points"], len(model.maps)
    maps = g.input("maps", TensorProto.UINT8, [1, used, points, points])
    scalars = g.input("scalars", TensorProto.FLOAT, [1, SCALARS])
    convolutions, patches = model.encoder.get("convolutions"), model.encoder.get("patches")

    def convolve(value, layer, maps, scale, stride, pad, arrange=lambda weight: weight):
        names = [f"radar.encoder.maps.{number}.{layer}" for number in maps]
        weight = np.concatenate([arrange(model[f"{name}.weight"]) for name in names]) * np.float32(scale)
        bias = np.concatenate([model[f"{name}.bias"] for name in names])
        shape = {"strides": [stride] * 2, "pads": [pad] * 4, "kernel_shape": weight.shape[2:]}
        return g.leaky(g("Conv", value, g.constant(weight), g.constant(bias), group=len(maps), **shape))

    def encode(codes, numbers):
        value = g("Cast", codes, to=TensorProto.FLOAT)
        # Codes are of 0 to 255, maps of 0 to 1; the first layer's weights see to it.
        if patches:
            size = patches["size"]
            squares = lambda weight: weight.T.reshape(-1, 1, size, size)
            return g("Flatten", convolve(value, "Patches.dense", numbers, 1 / 255, size, 0, squares))
        strides, pool = convolutions["strides"], convolutions["pool"]
        value = convolve(value, "Convolutions.first", numbers, 1 / 255, strides[0], 1)
        value = convolve(value, "Convolutions.second", numbers, 1, strides[1], 1)
        if pool > 1:
            value = g("MaxPool", value, kernel_shape=[pool] * 2, strides=[pool] * 2)
        return g("Flatten", value)

    def first_dense(value):
        name = "radar.encoder.first"
        weight = model[f"{name}.weight"]
        if patches:
            # Ours has the channels of a square side by side, a convolution its squares of a channel.
            places, channels = (points // patches["size"]) ** 2, patches["channels"]
            taken = used * places * channels
            maps = weight[:taken].reshape(used, places, channels, -1).transpose(0, 2, 1, 3)
            weight = np.concatenate([maps.reshape(taken, -1), weight[taken:]])
        return g.affine(value, weight, model[f"{name}.bias"])

    # Arrays are numbered by the maps that are looked at, not by all maps.
    if form == "grouped" or used == 1:
        features = [encode(maps, range(used))]
    else:
        each = g("Split", maps, outputs=used, axis=1)
        features = [encode(codes, [number]) for number, codes in enumerate(each)]
    joined = g("Concat", *features, scalars, axis=1)
    inner = g.leaky(g.norm(first_dense(joined), "radar.encoder.first_norm"))
    token = g.norm(g.dense(inner, "radar.encoder.second"), "radar.encoder.second_norm")
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
    turns = g.input("turns", TensorProto.FLOAT, [count, model.config["antennas"] * TURN_CHANNELS])
    names = g.input("names", TensorProto.FLOAT, [count, dimensions])
    tokens = g.dense(g.reshape(reads, count * groups, features), "tags.encoder")
    tokens = g.leaky(g.norm(tokens, "tags.norm"))
    tokens = transformer(g, tokens, count, groups, model.tags, "tags", form)
    moved = pooled(g, tokens, count, groups, width)
    return g.leaky(g.dense(g("Concat", moved, g.dense(names, "tags.names"), turns, axis=1), "tags.join"))


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
