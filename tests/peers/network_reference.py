"""The mathematics of our network by numpy alone, in f64 and one value after the other, and random networks and windows to try
it on: what onnx.py tests itself with. Nothing of the graphs' code is used.
"""

import numpy as np

ACTIONS, SCALARS, READ_CHANNELS, MAPS = 8, 6, 6, 3
LEAK, EPSILON = 0.01, 1e-5


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
    features = []
    for number, place in enumerate(np.flatnonzero(config["maps"])):
        name, x = f"radar.encoder.maps.{number}", maps[place] / 255.0
        if patches := config["encoder"].get("patches"):
            size = patches["size"]
            for row in range(0, len(x), size):
                for column in range(0, len(x), size):
                    square = x[row : row + size, column : column + size].ravel()
                    features.append(leaky_of(dense_of(w, f"{name}.Patches.dense", square)))
            continue
        shape = config["encoder"]["convolutions"]
        pool = shape["pool"]
        x = leaky_of(convolution_of(w, f"{name}.Convolutions.first", x[None], shape["strides"][0]))
        x = leaky_of(convolution_of(w, f"{name}.Convolutions.second", x, shape["strides"][1]))
        channels, side, _ = x.shape
        features.append(x.reshape(channels, side // pool, pool, side // pool, pool).max((2, 4)).ravel())
    inner = dense_of(w, "radar.encoder.first", np.concatenate([*features, scalars]))
    inner = leaky_of(norm_of(w, "radar.encoder.first_norm", inner))
    return norm_of(w, "radar.encoder.second_norm", dense_of(w, "radar.encoder.second", inner))


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
            turns = np.zeros((antennas, 2))
            for antenna in range(min(antennas, case["reads"].shape[2])):
                for read in case["reads"][:, tag, antenna]:
                    turns[antenna] += read[0], np.arctan2(read[2], read[3]) / np.pi
            named = dense_of(w, "tags.names", case["names"][tag])
            known = np.concatenate([moved, named, turns.clip(-8, 8).ravel()])
            tags.append(leaky_of(dense_of(w, "tags.join", known)))
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
        (kind, shape), points = *config["encoder"].items(), config["points"]
        for number in range(sum(config["maps"])):
            at = f"radar.encoder.maps.{number}"
            if kind == "patches":
                channels, side = shape["channels"], points // shape["size"]
                dense(f"{at}.Patches.dense", shape["size"] ** 2, channels)
                continue
            first, channels = shape["channels"]
            side = points // shape["strides"][0] // shape["strides"][1] // shape["pool"]
            layer(f"{at}.Convolutions.first", (first, 1, 3, 3), 9)
            layer(f"{at}.Convolutions.second", (channels, first, 3, 3), 9 * first)
        dense("radar.encoder.first", sum(config["maps"]) * channels * side * side + SCALARS, radar["width"])
        norm("radar.encoder.first_norm", radar["width"])
        dense("radar.encoder.second", radar["width"], radar["width"])
        norm("radar.encoder.second_norm", radar["width"])
        if radar["stack"] > 1:
            dense("radar.stack", radar["stack"] * radar["width"], radar["width"])
        sequence("radar", radar)
    if fusion != "radar":
        dense("tags.encoder", tags["stack"] * config["antennas"] * READ_CHANNELS, tags["width"])
        norm("tags.norm", tags["width"])
        sequence("tags", tags)
        dense("tags.names", config["name_dimensions"], tags["width"])
        dense("tags.join", 2 * tags["width"] + 2 * config["antennas"], tags["width"])
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


def shape_of(points, maps, encoder, radar, tags, fusion="concat", antennas=4, dimensions=32):
    branches = {}
    for name, (width, layers, heads, feed_forward, stack) in (("radar", radar), ("tags", tags)):
        sizes = {"width": width, "layers": layers, "heads": heads, "feed_forward": feed_forward, "stack": stack}
        branches[name] = {**sizes, "temporal": "transformer"}
    given = {"points": points, "maps": maps, "antennas": antennas, "name_dimensions": dimensions, "encoder": encoder}
    return {**given, **branches, "fusion": fusion, "dropout": 0.1}


def convolutions(channels, strides, pool):
    return {"convolutions": {"channels": channels, "strides": strides, "pool": pool}}


def patches(size, channels):
    return {"patches": {"size": size, "channels": channels}}


ALL = [True] * MAPS
# Configuration, frames, tags, antennas of the reader: all that can be odd, then the two shapes that are timed.
ODD = {
    "stacks past the end": (shape_of(16, ALL, convolutions([3, 5], [2, 1], 2), (12, 2, 3, 20, 4), (8, 1, 1, 12, 3)), 10, 3, 4),
    "fewer antennas than the network": (shape_of(8, ALL, convolutions([1, 2], [1, 1], 4), (8, 1, 2, 8, 1), (12, 2, 3, 16, 2)), 7, 2, 2),
    "more antennas than the network": (shape_of(8, ALL, convolutions([2, 1], [2, 1], 1), (8, 1, 2, 8, 2), (8, 1, 2, 8, 1), antennas=2), 4, 5, 4),
    "two maps": (shape_of(24, [True, False, True], convolutions([2, 4], [3, 1], 2), (16, 1, 4, 8, 1), (8, 1, 2, 8, 1)), 5, 2, 4),
    "one map, one frame, one tag": (shape_of(8, [False, True, False], convolutions([2, 4], [1, 1], 2), (8, 1, 2, 8, 1), (8, 1, 2, 8, 2)), 1, 1, 4),
    "no fusion": (shape_of(16, ALL, convolutions([4, 8], [2, 1], 2), (16, 1, 2, 32, 1), (8, 1, 2, 16, 2), "none"), 9, 4, 4),
    "squares": (shape_of(12, [True, False, True], patches(3, 5), (12, 2, 3, 20, 1), (8, 1, 1, 12, 2)), 5, 3, 4),
    "tags alone": (shape_of(16, ALL, convolutions([4, 8], [2, 1], 2), (16, 1, 2, 32, 1), (8, 1, 2, 16, 2), "rfid"), 9, 4, 4),
    "radar alone": (shape_of(16, ALL, convolutions([4, 8], [2, 1], 2), (16, 1, 2, 32, 3), (8, 1, 2, 16, 2), "radar"), 9, 4, 4),
}
TIMED = {
    "small": (shape_of(32, ALL, patches(4, 8), (64, 2, 2, 128, 1), (64, 2, 2, 128, 2)), 60, 6, 4),
    "paper": (shape_of(256, ALL, convolutions([1, 1], [1, 1], 8), (1024, 3, 2, 2048, 1), (128, 3, 2, 2048, 1)), 60, 6, 4),
}
